"""Findings and pictures of all results: largest values, singular poses of a prescribed motion, plots."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.display import display
from symgen.errors import CapabilityError, ResultError
from symgen.runtime.arrays import Array
from symgen.runtime.result.records import Coordinate, LocatedEvent, Variable, by_owner, unknown

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Sensitivity
    from symgen.runtime.model.averages import Average


@dataclass(frozen=True, slots=True)
class SingularPose:
    """A pose in which the drives do not determine the motion.

    Attributes
    ----------
    kind
        ``dead centre``: a turning point that the drive cannot pass; ``bifurcation``: branches of the motion
        cross there, and the smooth continuation was followed.
    t
        Time [s].
    drives
        Value of every drive by name [rad or m].
    positions
        Position of every point by name [m].
    collinear
        Pairs of links in one line, if these cause the dead centre.
    units
        Unit of every drive by name.
    """

    kind: str
    t: float
    drives: dict[str, float]
    positions: dict[str, list[float]]
    collinear: tuple[tuple[str, str], ...]
    units: dict[str, str] = field(default_factory=dict)

    def describe(self, shown: Mapping[str, tuple[str, float]] | None = None) -> str:
        """Return a line of text; ``shown`` has name and size of the displayed unit by SI unit."""
        where = ", ".join(self._drive(name, shown or {}) for name in self.drives)
        lines = "; ".join(f"{a} and {b} in line" for a, b in self.collinear)
        return f"{self.kind} at t = {self.t:.12g} s, {where}{f': {lines}' if lines else ''}"

    def _drive(self, name: str, shown: Mapping[str, tuple[str, float]]) -> str:
        unit = self.units.get(name, "")
        label, size = shown.get(unit, (unit, 1.0))
        return f"{name} = {self.drives[name] / size:.9g} {label}".rstrip()


class Findings:
    """Properties of a result that follow from its outputs and statistics."""

    if TYPE_CHECKING:
        KIND: ClassVar[str]
        _cache: dict[str, Any]
        name: str
        coordinate: Coordinate
        times: Array | None

        @property
        def time(self) -> Array: ...  # noqa: D102

        variables: tuple[Variable, ...]
        events: tuple[LocatedEvent, ...]
        statistics: Mapping[str, Any]

    @property
    def peaks(self) -> dict[str, float]:
        """Largest absolute value of every scalar output, except positions along links, in its unit.

        Between equally spaced samples it is the peak of the parabola through the largest and its neighbours.
        """
        along = self.coordinate.values if self.times is None else self.times
        even = len(along) > 2 and bool(np.allclose(np.diff(along), along[1] - along[0]))
        return {
            v.name: _between(np.abs(v.values)) if even else float(np.max(np.abs(v.values)))
            for v in self.variables
            if v.values.ndim == 1 and not v.name.endswith(".greatest_stress_at")
        }

    def selected(self, names: Sequence[str]) -> Self:
        """Return the result with some of its outputs alone.

        Parameters
        ----------
        names
            Outputs, components of outputs, or points and links, which stand for all of their outputs.

        Raises
        ------
        ResultError
            For names of which the result has no output.
        """
        found = by_owner(self.variables, names)
        for name, outputs in found.items():
            if not outputs:
                raise ResultError(f"the result has no output {name!r}. {unknown(name, self.variables)}")
        chosen = {key: v for outputs in found.values() for key, v in outputs.items()}
        part: Self = replace(self, variables=tuple(chosen.values()))  # type: ignore[type-var]
        part._cache.update((key, value) for key, value in self._cache.items() if key == "origin")
        return part

    def averages(self, rtol: float = 1e-8) -> dict[str, Average]:
        """Return means, root mean squares, extremes and, of powers, work over time, by component.

        They are over the time from the first sample to the last. The number of samples has no effect on them:
        the analysis is repeated some times at the nodes of a quadrature, and next to extremes.

        Parameters
        ----------
        rtol
            Error, over the mean magnitude of the output.

        Raises
        ------
        ResultError
            For results of elastic links, of single poses, or that were loaded or copied.
        """
        from symgen.runtime.model.averages import averages

        if not 1e-12 <= rtol < 1:
            raise ResultError(f"expected rtol between 1e-12 and 1, got {rtol:g}")
        return averages(self, rtol)

    @property
    def singular_poses(self) -> tuple[SingularPose, ...]:
        """Dead centres and bifurcations of a prescribed motion of a linkage, in the order of time.

        Raises
        ------
        CapabilityError
            For results of other analyses.
        """
        if "singular_poses" not in self.statistics:
            raise CapabilityError(
                f"a {type(self).__name__} of {self.name} has no singular poses: kinematics and "
                "inverse_dynamics of a linkage record them"
            )
        return tuple(
            SingularPose(**{**p, "collinear": tuple((a, b) for a, b in p["collinear"])})
            for p in self.statistics["singular_poses"]
        )

    @property
    def dead_centres(self) -> tuple[SingularPose, ...]:
        """The :attr:`singular_poses` that the drive cannot pass."""
        return tuple(p for p in self.singular_poses if p.kind == "dead centre")

    @property
    def bifurcations(self) -> tuple[SingularPose, ...]:
        """The :attr:`singular_poses` in which branches of the motion cross."""
        return tuple(p for p in self.singular_poses if p.kind == "bifurcation")

    def _of_analysis(self, model: Any, verb: str, arguments: Mapping[str, Any]) -> None:
        """Set the analysis that the result is of; see :attr:`origin`.

        In place of a controller, which may have a memory, it has the inputs that the controller has set.
        """
        controls = self._cache.get("controls") or getattr(self.__dict__.get("_source"), "controls", None)
        if controls:
            arguments = {**arguments, "controller": controls.repeated}
        self._cache["origin"] = model, verb, arguments

    @property
    def origin(self) -> tuple[Any, str, Mapping[str, Any]] | None:
        """Model, analysis and arguments of the result; None for one that was loaded or copied."""
        return self._cache.get("origin")

    def gradient(
        self,
        outputs: Sequence[str],
        parameters: Sequence[str] | None = None,
        *,
        coordinates: Sequence[str] = (),
        t_eval: ArrayLike | None = None,
        integrals: Sequence[str] = (),
    ) -> Sensitivity:
        """Return exact derivatives of outputs of this analysis: ``model.sensitivity`` with its arguments.

        For runs and prescribed motions, derivatives are at the end (or at the event that ends a run) or at
        times ``t_eval`` [s]; for elastic links at all samples.

        Parameters
        ----------
        outputs, parameters, coordinates, integrals
            See :meth:`symgen.Model.sensitivity`.
        t_eval
            Increasing times [s], from the start on.

        Raises
        ------
        ResultError
            For a result that was loaded or copied, and an analysis without derivatives.
        ModelError, SimulationError
            As :meth:`symgen.Model.sensitivity`.
        """
        if self.origin is None:
            raise ResultError(
                "a result that was loaded or copied has no gradient: repeat the analysis, or call "
                "model.sensitivity"
            )
        model, verb, arguments = self.origin
        more = {"coordinates": coordinates, "t_eval": t_eval, "integrals": integrals}
        options_of_run: dict[str, Any] = {
            name: x for name, x in more.items() if x is not None and len(np.atleast_1d(x))
        }
        if self.KIND == "elastic" and verb in ("simulate", "periodic"):
            options_of_run["at"] = self
        elif verb == "simulate":
            if "controller" in arguments:
                raise ResultError(
                    "runs with a controller have no gradient\n"
                    "  Write its law into the scene, with [states] where it needs any."
                )
            if arguments.get("stabilisation", "projection") != "projection":
                raise ResultError(
                    f"runs with the stabilisation {arguments['stabilisation']!r} have no gradient\n"
                    "  Take projection."
                )
            options = ("method", "rtol", "atol", "step", "max_steps", "max_step")
            options_of_run |= {name: arguments[name] for name in options if name in arguments}
            options_of_run |= {"at": arguments.get("state")} | (
                {} if t_eval is not None else {"t_end": self._run_end(arguments)}
            )
        elif verb == "quasi_static":
            options_of_run.setdefault("t_eval", self.time)
        elif verb in ("kinematics", "inverse_dynamics"):
            options_of_run |= {} if t_eval is not None else {"at": float(self.time[-1])}
        else:
            raise ResultError(f"results of {verb} have no gradient")
        return model.sensitivity(outputs, parameters, **options_of_run)

    def _run_end(self, arguments: Mapping[str, Any]) -> float:
        """Return the requested end of the run [s]: an event that ended the run also ends its repetition."""
        known = self.origin[0].description if self.events and self.origin else None
        if known is None or self.events[-1].name not in [e.name for e in known.events if e.ends_run]:
            return float(self.time[-1])
        end = arguments.get("t_end")
        if end is None:
            end = known.t_end if arguments.get("t_eval") is None else np.asarray(arguments["t_eval"])[-1]
        return float(end)


class Pictures:
    """Plots and animations of a result."""

    if TYPE_CHECKING:
        _cache: dict[str, Any]

    def plot(
        self,
        *names: str | Sequence[str],
        file: str | os.PathLike[str] | None = None,
        xy: str = "",
        over: str = "",
        compare: Mapping[str, Any] | None = None,
    ) -> Any:
        """Draw outputs over the coordinate, or a path; see :func:`symgen.report.page.plots.plot`."""
        names = tuple(n for name in names for n in ([name] if isinstance(name, str) else name))
        return display("plot", self, *names, file=file, xy=xy, over=over, compare=compare)

    def animate(self, file: str | os.PathLike[str] | None = None, *, frames: int = 241) -> Any:
        """Return the animation of the result, which notebooks play, next to plots of its outputs.

        Another run of the analysis computes the positions of all points. Deflections of elastic links are
        magnified; the caption states the factor.

        Parameters
        ----------
        file
            File to write: ``.html``, ``.gif``, or ``.mp4`` where ffmpeg is installed.
        frames
            Maximum number of frames, each a sample of the result.

        Raises
        ------
        ResultError
            For a result that was loaded or has a single sample, and when the file cannot be written.
        ModelError
            For an analysis whose method has no animation.
        """
        return display("animate", self, file, frames)

    def _repr_html_(self) -> str:
        return display("result_html", self)


for _call in (Findings.gradient, Pictures.plot, Pictures.animate):
    _call.__qualname__ = f"Result.{_call.__name__}"  # the class that users know, in messages
checked(Findings)
checked(Pictures)


def _between(values: Array) -> float:
    """Return the peak of the parabola through the largest of equally spaced values and its neighbours."""
    k = int(np.argmax(values))
    if not 0 < k < len(values) - 1:
        return float(values[k])
    before, here, after = (float(x) for x in values[k - 1 : k + 2])
    bend = 2 * here - before - after
    return here + (after - before) ** 2 / (8 * bend) if bend > 0.0 else here
