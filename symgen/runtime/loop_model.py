"""A compiled closed loop: what a user holds in hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.errors import ModelError
from symgen.runtime import _core
from symgen.runtime.arguments import count, real, reals
from symgen.runtime.checkpoint import keeping
from symgen.runtime.compiled import Compiled
from symgen.runtime.description import LoopDescription
from symgen.runtime.library import Library
from symgen.runtime.loop_kernels import LoopKernels
from symgen.runtime.loop_start import Closed, assemblies, close_near, counted
from symgen.runtime.loop_turn import driven, follow, follow_through, followed
from symgen.runtime.options import options
from symgen.runtime.turn import Turn
from symgen.runtime.typed import Typed

if TYPE_CHECKING:
    from symgen.runtime.result import Result

Array = NDArray[np.float64]

#: Steps in which parameters go from the scene's to other values while the loop is kept closed.
_STAGES = 16


class LoopModel(Compiled):
    """Compiled equations of one closed loop of links, given as a link-joint table.

    Made by :func:`symgen.build`. Parameters that the scene declares tunable can be changed with
    :meth:`with_parameters` without compiling again.
    """

    description: LoopDescription

    def __init__(
        self,
        description: LoopDescription,
        library: Library,
        derive: Callable[[], Any],
        parameters: Mapping[str, float] | None = None,
        typed: Typed | None = None,
    ) -> None:
        super().__init__(description, library, derive, parameters, typed)
        self._kernels = LoopKernels(description, library, list(self.parameters.values()), typed)
        self._start: Closed | None = None

    def __repr__(self) -> str:
        d = self.description
        return (
            f"<LoopModel {d.name!r}: {' '.join(d.joints)}, {d.coordinates} variables, {self.backend} backend>"
        )

    @property
    def is_driven(self) -> bool:
        """Whether its inputs alone move it; otherwise its motion follows from forces."""
        return not self.description.having("free")

    def with_parameters(self, **values: float) -> LoopModel:
        """Return the same loop with other values of its tunable parameters, in SI units."""
        changed = {**self.parameters, **values}
        return LoopModel(self.description, self._library, self._derive, changed, self._typed)

    @property
    def kernels(self) -> LoopKernels:
        """Its kernels as functions of arrays."""
        return self._kernels

    def closed_start(self) -> Closed:
        """Return the closed pose at the beginning of the range, found once."""
        if self._start is None:
            d = self.description
            t = self._kernels.time_of(d.span[0]) if d.span else 0.0  # free motion starts at t = 0
            q = np.array(d.start)
            if self.is_changed:
                self._start = self._kept_closed() or close_near(self._kernels, t, q)
            else:
                self._start = Closed(t, q, d.rank)
        return self._start

    def _kept_closed(self) -> Closed | None:
        """Follow the closure from the scene's own parameters to these; None where that does not lead here."""
        d = self.description
        q, kernels = np.append(d.start, 0.0), self._kernels
        own = np.array([p.default for p in d.parameters])
        asked = np.array(list(self.parameters.values()))
        t = 0.0
        for part in np.linspace(0.0, 1.0, _STAGES + 1)[1:]:
            kernels = LoopKernels(d, self._library, ((1 - part) * own + part * asked).tolist())
            try:
                t = kernels.time_of(d.span[0]) if d.span else 0.0
            except ModelError:
                return None
            before = q.copy()
            if kernels.equations(d.having("dependent"), d.rank).close(t, q) != _core.DONE:
                return None
            scale = np.array([d.size if v.is_length else 1.0 for v in d.variables])
            if np.max(np.abs(q - before)[:-1] / scale) > 1.0:
                return None
        return counted(self._kernels, t, q[:-1])

    def at(self, values: ArrayLike) -> Turn:
        """Evaluate the driven loop at these values of its first input [rad, m], each on the scene's branch.

        The loop is followed to each of them from the beginning of its range, so that it never changes its
        assembly; the order of the values is kept.

        Raises
        ------
        ModelError
            When the loop is not driven by inputs alone.
        SimulationError
            When a value cannot be reached, naming it and the row that holds the loop; it carries the rest.
        InitialStateError
            When the loop cannot be assembled at the beginning of its range.
        """
        driven(self.description)
        return follow(self._kernels, self.closed_start(), reals(values, "values of the input"))

    def turn(
        self,
        start: float | None = None,
        stop: float | None = None,
        samples: int = 361,
        *,
        through: bool = False,
    ) -> Turn:
        """Evaluate the driven loop over a range of its first input [rad, m]; the scene's own when absent.

        With ``through`` it is followed by arc length from the beginning of the range, on through the values
        at which the input turns back, until it leaves the range or is back where it began; the samples are
        then equal parts of that way.

        Raises
        ------
        As :meth:`at`; a range that cannot be gone through ends with SimulationError, which carries the part
        that was reached.
        """
        driven(self.description)
        if not 2 <= count(samples, "samples") <= 10_000_000:
            raise ModelError(f"expected between 2 and 10 million samples, got {samples}")
        low, high = self.description.span
        low = low if start is None else real(start, "start")
        high = high if stop is None else real(stop, "stop")
        if not low < high:
            raise ModelError(f"expected a range with start before stop, got {low:g} to {high:g}")
        if not through:
            return self.at(np.linspace(low, high, samples))
        begin = followed(self._kernels, self.closed_start(), low)
        return follow_through(self._kernels, begin, high, samples)

    def assemblies(self, value: float | None = None) -> tuple[dict[str, float], ...]:
        """Return the ways in which the loop closes at a value of its first input, by variable [rad, m].

        They are looked for from many starts, the same every time; the nearest to the scene's own comes first.
        """
        if value is not None:
            driven(self.description)
        begin = self.closed_start()
        t = begin.t if value is None else self._kernels.time_of(real(value, "value"))
        names = [v.name for v in self.description.variables]
        return tuple(dict(zip(names, q.tolist(), strict=True)) for q in assemblies(self._kernels, t, begin.q))

    def __getattr__(self, name: str) -> Any:
        if name in ("kinematics", "equilibrium", "modes", "accelerations"):
            raise ModelError(
                f"{name} is for linkages of points and links, and {self.name} is a link-joint table\n"
                "  model.turn() evaluates a driven loop, model.simulate() runs a free one."
            )
        raise AttributeError(f"a LoopModel has no attribute {name!r}")

    def simulate(
        self,
        t_end: float | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        samples: int = 201,
        max_steps: int = 1_000_000_000,
        stabilisation: str = "projection",
        max_drift: float | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float = 10.0,
        resume: str | os.PathLike[str] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Result:
        """Run the motion of a loop with free variables; arguments and errors as of ``Model.simulate``.

        ``max_drift`` limits the defect of closure [m], of rotations times the size of the loop.

        Raises
        ------
        ModelError
            When nothing is free: :meth:`turn` evaluates a driven loop. For options out of range.
        ResultError
            For a checkpoint that cannot be written, or is of another run.
        SimulationError
            When the run cannot go on; it carries the time and what was recorded.
        InitialStateError
            When the loop cannot be assembled at the start.
        """
        from symgen.runtime.loop_run import run

        d = self.description
        if not d.having("free"):
            raise ModelError(
                f"{d.name} has no free variable: its inputs move it\n"
                "  Evaluate it over its range ('symgen run SCENE', model.turn()), or give a variable under "
                "loop.free."
            )
        end = d.t_end if t_end is None else real(t_end, "t_end")
        kept = (stabilisation, None, max_drift)
        chosen = options(end, method, rtol, atol, step, samples, max_steps, *kept, precision=self._type)
        if chosen.stabilisation == "baumgarte":
            raise ModelError("baumgarte is for linkages of points and links: loops take projection, or raw")
        if chosen.method.kind != "explicit":
            raise ModelError(
                f"{chosen.method.name} is for linkages of points and links, not for loops of joints"
            )
        kept_in = keeping(checkpoint, checkpoint_every, resume)
        return run(self._kernels, self.closed_start(), chosen, progress, kept_in)
