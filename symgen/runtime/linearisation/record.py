"""Linear state-space models of mechanisms, and derivatives by parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import Shown
from symgen.errors import ModelError, OptionsError, SimulationError, check_known
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.arguments import reals

if TYPE_CHECKING:
    from scipy.signal import StateSpace

    from symgen.runtime.kernels.description import Described


@checked
@dataclass(frozen=True, slots=True)
class Linearisation(Shown):
    """d(dx)/dt = A dx + B du, dy = C dx + D du: deviations from a state of the mechanism, in SI units.

    Attributes
    ----------
    A, B, C, D
        Arrays (states, states), (states, inputs), (outputs, states) and (outputs, inputs).
    states, inputs, outputs
        Names of the entries of x, u and y. The first half of the states are coordinates, the others their
        time derivatives: ``pole.angle'`` is that of ``pole.angle``.
    units
        Unit of every state, input and output by name.
    t, x, u, y
        Time [s], state, inputs and outputs about which it is linearised.
    rates
        dx/dt there: zero at an equilibrium.
    freedoms
        Degrees of freedom there: fewer than coordinates where constraints or drives couple these.
    at_equilibrium
        Whether that state is an equilibrium that was found as such.
    notes
        What limits the matrices: switching points of loads on which the state is.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: dict[str, str]
    t: float
    x: Array
    u: Array
    y: Array
    rates: Array
    freedoms: int
    at_equilibrium: bool = False
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        where = "an equilibrium" if self.at_equilibrium else f"t = {self.t:g} s"
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<Linearisation at {where}: {sizes}; A, B, C, D, poles, state_space>"

    @property
    def state_space(self) -> StateSpace:
        """The model as a ``scipy.signal.StateSpace``; raise ModelError without inputs or outputs."""
        for kind, names in (("inputs", self.inputs), ("outputs", self.outputs)):
            if not names:
                raise ModelError(
                    f"a StateSpace needs {kind}, and this model has none\n"
                    f"  {'Add [inputs] to the scene.' if kind == 'inputs' else 'Give outputs to linearise.'}"
                )
        from scipy.signal import StateSpace

        return StateSpace(self.A, self.B, self.C, self.D)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s], by rising modulus; of a conjugate pair that of positive frequency first."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return np.asarray(values[np.lexsort((-values.imag, np.abs(values)))])

    def summary(self) -> dict[str, Any]:
        """Return it in plain numbers, as printed by ``symgen linearise --json``."""

        def named(names: tuple[str, ...], values: Array) -> dict[str, Any]:
            pairs = zip(names, values.tolist(), strict=True)
            return {name: {"unit": self.units[name], "value": value} for name, value in pairs}

        return {
            "analysis": "linearise",
            "t": self.t,
            "states": named(self.states, self.x),
            "inputs": named(self.inputs, self.u),
            "outputs": named(self.outputs, self.y),
            "rates": self.rates.tolist(),
            "freedoms": self.freedoms,
            **{name: getattr(self, name).tolist() for name in "ABCD"},
            "poles": [[s.real, s.imag] for s in self.poles.tolist()],
            "notes": list(self.notes),
        }


@checked
@dataclass(frozen=True, slots=True)
class Sensitivity(Shown):
    """Derivatives of outputs by parameters, in SI units.

    Attributes
    ----------
    derivatives
        Array (outputs, parameters); along a run or at several times (times, outputs, parameters).
    outputs, parameters
        Names of its rows and columns.
    values
        Values of the outputs; with several times (times, outputs).
    units
        Unit of every output and parameter by name.
    t
        Time [s]; an array (times,) of several.
    at_equilibrium
        Whether the state is an equilibrium, which moves with the parameters.
    notes
        What limits the derivatives: switching points of loads on which a state is, losses of rank that a run
        passes.
    """

    derivatives: Array
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    values: Array
    units: dict[str, str]
    t: float | Array
    at_equilibrium: bool = False
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        last = self.derivatives[-1] if self.derivatives.ndim == 3 else self.derivatives
        table = [("", *(f"by {p} [{self.units[p]}]" for p in self.parameters))]
        table += [
            (f"{name} [{self.units[name]}]", *(f"{slope:.6g}" for slope in row))
            for name, row in zip(self.outputs, last.tolist(), strict=True)
        ]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ("  ".join(f"{x:>{w}}" for x, w in zip(row, widths, strict=True)) for row in table)
        where = "the equilibrium" if self.at_equilibrium else f"t = {np.ravel(self.t)[-1]:g} s"
        return "\n".join([f"<Sensitivity at {where}>", *lines])

    def summary(self) -> dict[str, Any]:
        """Return it in plain numbers, as printed by ``symgen sensitivity --json``."""
        last = np.moveaxis(self.derivatives, -2, 0)  # along a run, lists over the times
        rows = zip(self.outputs, self.values.T.tolist(), np.moveaxis(last, -1, 1).tolist(), strict=True)
        return {
            "analysis": "sensitivity",
            "t": np.asarray(self.t).tolist(),
            "parameters": {name: self.units[name] for name in self.parameters},
            "outputs": {
                name: {
                    "unit": self.units[name],
                    "value": value,
                    "by": dict(zip(self.parameters, slopes, strict=True)),
                }
                for name, value, slopes in rows
            },
            "notes": list(self.notes),
        }

    def __getitem__(self, names: tuple[str, str]) -> Any:
        """Return the derivative of an output by a parameter: ``found["O.reaction.x", "stiffness"]``.

        A float; an array (times,) with several times.
        """
        output, parameter = names
        for name, known in ((output, self.outputs), (parameter, self.parameters)):
            check_known(name, known, "there is no derivative of or by")
        values = self.derivatives[..., self.outputs.index(output), self.parameters.index(parameter)]
        return values if values.ndim else float(values)


def sensitivity_of(
    d: Described,
    outputs: Mapping[str, str],
    parameters: Sequence[str],
    values: Array,
    derivatives: Array,
    t: float | Array,
    further: Mapping[str, str] | None = None,
) -> Sensitivity:
    """Return derivatives of outputs by parameters of a model, or by ``further`` quantities: units by name.

    Raises
    ------
    SimulationError
        When a derivative is not finite.
    """
    known = {p.name: p.unit for p in d.tunable} | dict(further or {})
    units = dict(outputs) | {name: known[name] for name in parameters}
    return _finite(Sensitivity(derivatives, tuple(outputs), tuple(parameters), values, units, t))


def with_outputs(
    sensitivity: Sensitivity, units: Mapping[str, str], values: Array, derivatives: Array
) -> Sensitivity:
    """Return derivatives at one time with those of further outputs, by name their units.

    Raises
    ------
    SimulationError
        When a derivative is not finite.
    """
    return _finite(
        replace(
            sensitivity,
            derivatives=np.vstack([sensitivity.derivatives, derivatives]),
            outputs=(*sensitivity.outputs, *units),
            values=np.append(sensitivity.values, values),
            units=sensitivity.units | dict(units),
        )
    )


def _finite(sensitivity: Sensitivity) -> Sensitivity:
    """Return derivatives; raise SimulationError with output and parameter of one that is not finite."""
    for *i, row, column in np.argwhere(~np.isfinite(sensitivity.derivatives)).tolist():
        t = float(np.asarray(sensitivity.t)[tuple(i)])
        raise SimulationError(
            f"the derivative of {sensitivity.outputs[row]} by {sensitivity.parameters[column]} is not "
            "finite at "
            f"t = {t:.9g} s",
            time=t,
        )
    return sensitivity


def at_times(
    sensitivities: Callable[[Sequence[float]], Sequence[Sensitivity]], at: Any, t_eval: Any, start: float
) -> Sensitivity:
    """Return derivatives at a time [s], the start when absent, or at all times of ``t_eval``.

    Raises
    ------
    ModelError
        For both, no times, or times that are not finite.
    """
    if t_eval is None:
        return sensitivities([start if at is None else float(at)])[0]
    times = reals(t_eval, "t_eval")
    if at is not None or not len(times):
        raise OptionsError(
            "give {at} or {t_eval}, not both" if len(times) else "expected times for {t_eval}, got none"
        )
    each = sensitivities(times.tolist())
    derivatives, values = (np.array([getattr(x, of) for x in each]) for of in ("derivatives", "values"))
    return replace(each[0], derivatives=derivatives, values=values, t=times)
