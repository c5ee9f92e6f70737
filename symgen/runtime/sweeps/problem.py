"""Problem of an optimisation: reduced outputs of runs and their derivatives by the variables."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.errors import ModelError, SimulationError, SymgenError, nearest
from symgen.runtime.arrays import Array
from symgen.runtime.linearisation.state_space import coordinate_choices
from symgen.runtime.many.dataset import EARLY, RECORDED, along_samples, times_of_samples
from symgen.runtime.many.poses import FLOQUET
from symgen.runtime.many.reductions import REDUCTIONS, mean_weights
from symgen.runtime.many.runs import FAILURES, with_own_controller
from symgen.runtime.result.records import in_words
from symgen.runtime.sweeps.designs import Listed
from symgen.runtime.sweeps.sweep import OF_A_POSE, sweep_of

if TYPE_CHECKING:
    import xarray

#: Part of a parameter's range over which differences are taken, to either side.
_STEP = 1e-5
#: Agreement of exact derivatives with differences at the start, over the largest.
_AGREE = 1e-4


@dataclass(frozen=True, slots=True)
class ReducedOutput:
    """A reduction of an output, or of a component: ``OUTPUT.REDUCTION`` or ``OUTPUT.REDUCTION.COMPONENT``.

    A variable of the optimisation has no reduction.
    """

    output: str
    reduction: str
    component: str

    @classmethod
    def named(cls, name: str, variables: Collection[str] = ()) -> ReducedOutput:
        """Return the quantity of a name; raise ModelError for an output without a reduction."""
        if name in variables:
            return cls(name, "", "")
        head, _, last = name.rpartition(".")
        if last in REDUCTIONS and head:
            return cls(head, last, "")
        output, _, reduction = head.rpartition(".")
        if reduction in REDUCTIONS and output:
            return cls(output, reduction, last)
        raise ModelError(
            f"expected OUTPUT.REDUCTION such as 'A.torque.peak', got {name!r}. {nearest(last, REDUCTIONS)}"
        )

    @property
    def of_magnitude(self) -> bool:
        """Whether it is of the magnitude of its samples."""
        return self.reduction in ("peak", "rms")

    def value(self, samples: Array, slopes: Array, weights: Array) -> tuple[Array, Array]:
        """Return the quantity of samples (..., samples), and its slopes from those (variables, samples).

        ``weights`` are those of the samples in a mean.
        """
        if self.reduction == "rms":
            value = np.sqrt(samples**2 @ weights)
            return value, (slopes @ (weights * samples)) / max(float(np.max(value)), 1e-300)
        if self.reduction == "mean":
            return samples @ weights, slopes @ weights
        if self.reduction == "final":
            return samples[..., -1], slopes[..., -1]
        high, low = int(np.argmax(samples)), int(np.argmin(samples))
        if self.reduction == "range":
            return np.ptp(samples, axis=-1), slopes[..., high] - slopes[..., low]
        at = low if self.reduction == "least" else high
        return samples[..., at], slopes[..., at]


#: Where the weights of samples in a mean are kept among outputs.
_WEIGHTS = ""


@dataclass(frozen=True, slots=True)
class OptimisationArguments:
    """Arguments of an optimisation but its objective; see :meth:`symgen.Model.optimise`."""

    model: Any
    variables: Mapping[str, Any]
    constraints: Mapping[str, Any]
    analysis: str | None
    start: Mapping[str, float]
    tolerance: float
    iterations: int
    threads: int | None
    arguments: Mapping[str, Any]
    method: str = "SLSQP"
    seed: int = 0


class Problem:
    """Samples of outputs, and their derivatives, at values of the variables over their ranges, 0 to 1."""

    def __init__(
        self,
        bounds: Mapping[str, tuple[float, float]],
        quantities: Sequence[ReducedOutput],
        search: OptimisationArguments,
    ) -> None:
        self.search, self.model, self.names = search, search.model, tuple(bounds)
        self.low, self.high = np.array([*bounds.values()]).T
        self.outputs = list(dict.fromkeys(q.output for q in quantities if q.reduction))
        if not self.outputs:
            raise ModelError("expected an output of the runs as the objective or in a constraint, got none")
        self.analysis = search.analysis
        self.runs, self.exact, self.reason = 0, False, ""
        self._held: dict[bytes, dict[str, Array]] = {}
        self._many: dict[bytes, dict[str, Array]] = {}
        self._failed: set[bytes] = set()
        self._slopes: dict[bytes, dict[str, Array]] = {}
        self._components: dict[str, tuple[str, ...]] = {}
        self._units: dict[str, str] = {}
        self._times: Array | None = None
        self._size = 0.0

    @property
    def gradients(self) -> str:
        """How gradients are computed: ``exact``, or ``differences`` and why."""
        return "exact" if self.exact else f"differences ({self.reason})"

    def parameters(self, x: Array) -> Array:
        """Return the values of the variables in SI units."""
        return self.low + (self.high - self.low) * x

    def at(self, x: Array) -> dict[str, Array]:
        """Return the samples of all outputs (samples, components).

        Raises
        ------
        SimulationError
            When the run fails.
        """
        key = np.ascontiguousarray(x).tobytes()
        if key not in self._held:
            self._held = {key: {name: v[0] for name, v in self.samples(x[None], whole=True).items()}}
        return self._held[key]

    def works(self, x: Array) -> bool:
        """Return whether the run at a point succeeds."""
        key = np.ascontiguousarray(x).tobytes()
        if key not in self._failed:
            try:
                self.at(x)
            except SimulationError:
                self._failed.add(key)
        return key not in self._failed

    def samples(self, points: Array, whole: bool = False) -> dict[str, Array]:
        """Return the samples of all outputs, (points, samples, components); nan where a run fails.

        Raises
        ------
        SimulationError
            When a run fails, and all are needed as a ``whole``.
        """
        design = Listed(self.names, self.parameters(points))
        s = self.search
        sweep = sweep_of(self.model, self.analysis, design, self.outputs, "history", s.arguments, s.threads)
        if not self._components:
            sweep.check_outputs()
        self.analysis = sweep.analysis
        self.runs += len(points)
        try:
            arrays = sweep.dataset()
        except FAILURES as error:
            if whole or not self._components:
                raise self._stopped(design.rows[0], str(error)) from None
            empty = {n: np.full((len(points), 1, len(c) or 1), np.nan) for n, c in self._components.items()}
            return {_WEIGHTS: np.full((len(points), 1), np.nan), **empty}
        if FLOQUET in self.outputs:
            raise ModelError(f"{FLOQUET} is one value of a run, without samples: it cannot be optimised")
        failed = [(i, str(e)) for i, e in enumerate(arrays["error"].values) if e]
        if RECORDED in arrays:
            failed += self._ended_early(arrays)
            along = along_samples(arrays, self.outputs[0])
            along = np.broadcast_to(along, (len(points), along.shape[-1]))
            weights = mean_weights(along, times_of_samples(arrays))
        else:
            weights = np.ones((len(points), 1))  # of the one sample of a pose
        if failed and whole:
            raise self._stopped(design.rows[failed[0][0]], failed[0][1])
        if self._times is None and not failed:
            self._times = times_of_samples(arrays)
        weights[[i for i, _ in failed]] = np.nan
        samples_by_name = {_WEIGHTS: weights}
        for name in self.outputs:
            if name not in arrays:  # its components alone are recorded
                part = next(str(n) for n in arrays.data_vars if str(n).startswith(f"{name}."))
                raise ModelError(
                    f"{name} is not recorded, but {part}\n  Record {name}, or name {part}.range."
                )
            values = np.array(arrays[name].values, dtype=float)
            if RECORDED not in arrays:
                values = values[:, None]
            values[[i for i, _ in failed]] = np.nan
            vector = "axis" in arrays[name].dims
            self._components[name] = tuple(map(str, arrays["axis"].values)) if vector else ()
            self._units[name] = str(arrays[name].attrs.get("units", ""))
            samples_by_name[name] = values if vector else values[..., None]
        return samples_by_name

    def _ended_early(self, runs: xarray.Dataset) -> list[tuple[int, str]]:
        """Return prescribed motions that ended early, and runs that others outlast, with the reason."""
        sizes = runs[RECORDED].values
        self._size = self._size or float(self.search.arguments.get("samples", np.nanmax(sizes)))
        early = runs[EARLY].values if EARLY in runs else np.full(len(sizes), "")
        short = np.isfinite(sizes) & (sizes != self._size)
        if self.analysis != "simulate":
            short |= early != ""
        reasons = [early[i] or f"{sizes[i]:g} of {self._size:g} samples" for i in range(len(sizes))]
        return [(i, f"the run ended early: {reasons[i]}") for i in np.flatnonzero(short).tolist()]

    def _stopped(self, row: Array, error: str) -> SimulationError:
        """Return the error of an optimisation that comes to parameters with which the run fails."""
        place = in_words(self.model.description, dict(zip(self.names, row.tolist(), strict=True)))
        return SimulationError(f"the optimisation came to {place}: {error}", time=0.0)

    def slopes(self, x: Array) -> dict[str, Array]:
        """Return the derivatives of all samples (variables, samples, components) by variables from 0 to 1."""
        key = np.ascontiguousarray(x).tobytes()
        if key not in self._slopes:
            slopes = None
            with suppress(*FAILURES):  # of the exact ones next to a singular pose
                slopes = self._exact(x) if self.exact else None
            self._slopes = {key: self._differences(x) if slopes is None else slopes}
        return self._slopes[key]

    def _differences(self, x: Array) -> dict[str, Array]:
        """Take differences between two runs for each variable: to one side where the other one has no run.

        On a bound of the variable the outer side is the point itself.
        """
        here, steps, count = self.at(x), _STEP * np.eye(len(x)), len(x)
        ends = np.vstack([np.minimum(x + steps, 1.0), np.maximum(x - steps, 0.0)])
        samples = self.samples(ends)
        failed: Any = np.asarray(np.isnan(samples[_WEIGHTS]).any(axis=1))
        unusable = failed | (ends == x).all(axis=1)
        lost = unusable[:count] & unusable[count:]
        if lost.any():
            self.samples(ends[failed & np.tile(lost, 2)], whole=True)  # raises why
        ends[failed] = x
        apart = np.sum(ends[:count] - ends[count:], axis=1)[:, None, None]
        for name in self.outputs:
            samples[name][failed] = here[name]
        return {name: (samples[name][:count] - samples[name][count:]) / apart for name in self.outputs}

    def _exact(self, x: Array) -> dict[str, Array]:
        """Return exact derivatives of all samples: of prescribed motions at their times, and along runs."""
        values = dict(zip(self.names, self.parameters(x).tolist(), strict=True))
        changed, names = self.model.with_parameters(**values), list(self.names)
        labels = {n: [f"{n}.{c}" if c else n for c in self._components[n] or ("",)] for n in self.outputs}
        flat = [label for of_one in labels.values() for label in of_one]
        if self.analysis in ("kinematics", "inverse_dynamics"):
            times = [] if self._times is None else self._times.tolist()
            each = [changed.sensitivity(flat, names, at=t).derivatives for t in times]
        elif self.analysis in OF_A_POSE:
            each = [self._of_the_pose(changed, flat)]
        else:
            result = getattr(changed, str(self.analysis))(**with_own_controller(self.search.arguments))
            self.runs += 1
            if result.KIND == "elastic":
                each = list(result.gradient(flat, names).derivatives)
            else:
                first, coordinates_held = self._at_start(changed, flat)
                later = result.time[result.time > 0.0]
                along = result.gradient(flat, names, coordinates=coordinates_held, t_eval=later)
                rows = along.derivatives[:, : len(flat)]  # without the time of an event
                each = [*[first] * (len(result.time) - len(later)), *rows]
        stacked = np.stack(each) * (self.high - self.low)  # (samples, outputs, variables)
        place = {label: i for i, label in enumerate(flat)}
        return {n: stacked[:, [place[label] for label in labels[n]]].transpose(2, 0, 1) for n in self.outputs}

    def _of_the_pose(self, model: Any, outputs: list[str]) -> Array:
        """Return exact derivatives of an equilibrium, or of frequencies about it or in a pose."""
        arguments = dict(self.search.arguments)
        if model.description.method == "rods":
            arguments = {"at": arguments["at"] if "at" in arguments else model.equilibrium(**arguments)}
        requested = ["frequencies"] if self.analysis == "modes" else outputs
        sensitivity = model.sensitivity(requested, list(self.names), **arguments)
        return sensitivity.derivatives[[sensitivity.outputs.index(name) for name in outputs]]

    def _at_start(self, model: Any, outputs: list[str]) -> tuple[Array, tuple[str, ...]]:
        """Return exact derivatives at the start, and coordinates that determine it and are held."""
        of_linkage = model.description.method in ("rods", "general")
        for coordinates in coordinate_choices(model) if of_linkage else ():
            with suppress(ModelError):
                derivatives: Array = model.sensitivity(
                    outputs, list(self.names), coordinates=coordinates
                ).derivatives
                return derivatives, coordinates
        return model.sensitivity(outputs, list(self.names)).derivatives, ()

    def choose_gradients(self, x: Array) -> None:
        """Take exact derivatives where the model has them and they agree with differences at the start."""
        self.at(x)
        prescribed = self.analysis in ("kinematics", "inverse_dynamics")
        if prescribed and "linearise" not in self.model.capabilities:
            self.reason = "those of many driven loops take less time"
            return
        if prescribed and self._times is None:
            self.reason = "the times of the samples depend on the variables"
            return
        rough = self._differences(x)
        try:
            exact = self._exact(x)
        except (SymgenError, AttributeError) as error:  # of an analysis without derivatives
            self.reason = str(error).partition("\n")[0]
            return
        self.exact = all(
            exact[n].shape == rough[n].shape
            and np.allclose(exact[n], rough[n], rtol=0.0, atol=_AGREE * max(np.max(np.abs(rough[n])), 1e-300))
            for n in self.outputs
        )
        if not self.exact:
            self.reason = "exact ones hold times and angles at the start, and differ from these"

    def of(self, quantity: ReducedOutput, values: Array) -> Array:
        """Return the samples (..., samples) from which a quantity is reduced, of those with components."""
        components = self._components[quantity.output]
        if quantity.component:
            if quantity.component not in components:
                known = ", ".join(components) or "none"
                raise ModelError(
                    f"{quantity.output} has no component {quantity.component!r}. Known: {known}."
                )
            component_values: Array = values[..., components.index(quantity.component)]
            return np.abs(component_values) if quantity.of_magnitude else component_values
        if not components:
            return np.abs(values[..., 0]) if quantity.of_magnitude else values[..., 0]
        if not quantity.of_magnitude:
            axes = ", ".join(components)
            raise ModelError(
                f"{quantity.reduction} of the vector {quantity.output} needs a component: {axes}"
            )
        return np.sqrt(np.sum(values**2, axis=-1))

    def slopes_of(self, quantity: ReducedOutput, values: Array, slopes: Array) -> Array:
        """Return the derivatives (variables, samples) of the samples from which a quantity is reduced."""
        components = self._components[quantity.output]
        if components and not quantity.component:
            size = np.maximum(np.sqrt(np.sum(values**2, axis=-1)), 1e-300)
            return np.sum(slopes * values, axis=-1) / size
        i = components.index(quantity.component) if quantity.component else 0
        return slopes[..., i] * (np.sign(values[..., i]) if quantity.of_magnitude else 1.0)

    def quantity(self, quantity: ReducedOutput, x: Array) -> tuple[Array, Array]:
        """Return the samples and their derivatives (variables, samples) of a quantity at a point."""
        values, slopes = self.at(x)[quantity.output], self.slopes(x)[quantity.output]
        return self.of(quantity, values), self.slopes_of(quantity, values, slopes)

    def slope(self, quantity: ReducedOutput, x: Array) -> Array:
        """Return the derivatives (variables,) of a quantity at a point."""
        if not quantity.reduction:
            return np.where(np.array(self.names) == quantity.output, self.high - self.low, 0.0)
        return np.asarray(quantity.value(*self.quantity(quantity, x), self.weights(x))[1])

    def unit(self, quantity: ReducedOutput) -> str:
        """Return the unit of a quantity after a run."""
        if not quantity.reduction:
            return next(p.unit for p in self.model.description.tunable if p.name == quantity.output)
        return self._units[quantity.output]

    def value(self, quantity: ReducedOutput, x: Array) -> float:
        """Return a quantity at a point."""
        if not quantity.reduction:
            return float(self.parameters(x)[self.names.index(quantity.output)])
        samples = self.of(quantity, self.at(x)[quantity.output])
        return float(quantity.value(samples, np.zeros((0, samples.size)), self.weights(x))[0])

    def many(self, quantity: ReducedOutput, points: Array) -> Array:
        """Return a quantity at some points; nan where a run fails.

        The runs of one call are kept for the next, which may be of another quantity at some of the points.
        """
        keys = [np.ascontiguousarray(x).tobytes() for x in points]
        if not {*keys} <= {*self._many}:
            samples = self.samples(points)
            self._many = {key: {name: v[i] for name, v in samples.items()} for i, key in enumerate(keys)}
        runs = [self._many[key] for key in keys]
        if quantity.reduction:
            each = ((self.of(quantity, run[quantity.output]), run[_WEIGHTS]) for run in runs)
            return np.array([quantity.value(s, np.zeros((0, s.size)), w)[0] for s, w in each])
        failed = [np.isnan(run[_WEIGHTS]).any() for run in runs]
        return np.where(failed, np.nan, self.parameters(points)[:, self.names.index(quantity.output)])

    def weights(self, x: Array) -> Array:
        """Return the weights of the samples in a mean."""
        return self.at(x)[_WEIGHTS]
