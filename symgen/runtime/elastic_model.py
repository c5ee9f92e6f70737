"""A compiled linkage with elastic links: what a user holds in hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from symgen.errors import ModelError, nearest
from symgen.runtime.arguments import count as whole
from symgen.runtime.checkpoint import keeping
from symgen.runtime.compiled import Compiled
from symgen.runtime.description import Description

if TYPE_CHECKING:
    from symgen.runtime.beam_layout import Layout
    from symgen.runtime.beams import Beam
    from symgen.runtime.elastic_modes import ElasticModes
    from symgen.runtime.elastic_motion import ElasticMotion
    from symgen.runtime.elastic_result import ElasticResult
    from symgen.runtime.model import Model
    from symgen.runtime.sweep import Sweep

#: How an elastic motion is found, by name.
METHODS = (
    "gauss",
    "gauss4",
    "newmark",
    "generalized-alpha",
    "wilson-theta",
    "dop853",
    "rk4",
    "quasi-static",
    "periodic",
)
FORMS = ("exact", "thesis")


#: Gives the linkage with its elastic links in so many rods.
Segmented = Callable[[int], "Model"]


class ElasticModel(Compiled):
    """A planar linkage some of whose links bend, moving about the motion it would have if all were rigid.

    Made by :func:`symgen.build`. ``rigid`` is that linkage, its crank driven: a :class:`Model`.
    """

    description: Description

    def __init__(self, rigid: Model, in_segments: Segmented | None = None) -> None:
        self.rigid, self._in_segments, self._typed = rigid, in_segments, rigid._typed
        self.description = rigid.description
        self._motion = cache(self._made)

    def _made(self, geometric_stiffness: bool) -> ElasticMotion:
        from symgen.runtime.elastic_motion import ElasticMotion  # it loads SciPy

        return ElasticMotion(self.rigid, geometric_stiffness)

    def __repr__(self) -> str:
        motion = self._motion(True)
        links = ", ".join(b.info.link for b in motion.beams)
        return f"<ElasticModel {self.name!r}: {links} elastic, {self.unknowns} unknowns>"

    #: An elastic motion is found in time.
    is_driven = False

    @property
    def parameters(self) -> Mapping[str, float]:  # type: ignore[override]
        """Values of the tunable parameters, in SI units."""
        return self.rigid.parameters

    @property
    def backend(self) -> str:
        """Where the kernels of the rigid motion come from."""
        return self.rigid.backend

    def _evaluate_many(self, *arguments: Any) -> Any:
        return self.rigid._evaluate_many(*arguments)

    @property
    def equations(self) -> Any:
        """The derived SymPy matrices of the rigid motion by name."""
        return self.rigid.equations

    @property
    def is_changed(self) -> bool:
        """Whether a parameter has another value than in the scene."""
        return self.rigid.is_changed

    @property
    def redundant(self) -> tuple[str, ...]:
        """Constraints of the rigid motion that others imply."""
        return self.rigid.redundant

    @property
    def beams(self) -> tuple[Beam, ...]:
        """The elastic links, with their constant matrices."""
        return self._motion(True).beams

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the elastic motion, those that constraints leave."""
        return self.layout.unknowns - self.layout.constraints

    @property
    def layout(self) -> Layout:
        """Where everything stands in the matrices of the elastic motion."""
        return self._motion(True).layout

    @property
    def crank_speed(self) -> float:
        """Angular velocity of the crank [rad/s]; that at the start where it is driven or free."""
        return self._motion(True).speed

    @property
    def lowest_frequency(self) -> float:
        """The lowest frequency [Hz] of the structure at rest, over the poses of a turn."""
        return self._motion(True).lowest_frequency

    def with_parameters(self, **values: float) -> ElasticModel:
        """Return the same model with other values of its tunable parameters, in SI units."""
        return ElasticModel(self.rigid.with_parameters(**values), self._in_segments)

    def modes(self, angle: float | None = None, *, moving: bool = False) -> ElasticModes:
        """Return frequencies and shapes of the structure in a pose of its rigid links.

        Parameters
        ----------
        angle
            Direction of the crank [rad]; that of the start when absent.
        moving
            As the links turn: with centrifugal, gyroscopic and axial forces of the rigid motion, as if these
            lasted; each joint on the axes of an elastic link. At rest otherwise.

        Raises
        ------
        ModelError, SimulationError
            When the crank stands still elsewhere, or cannot come there.
        """
        from symgen.runtime.elastic_modes import modes_with_errors

        motion = self._motion(True)
        return modes_with_errors(motion, motion.time_at(motion.angle if angle is None else angle), moving)

    def run(
        self,
        method: str = "gauss",
        *,
        revolutions: float = 1.0,
        steps: int | None = None,
        rtol: float = 1e-4,
        samples: int = 361,
        at: Sequence[float] | None = None,
        form: str = "exact",
        geometric_stiffness: bool = True,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float = 10.0,
        resume: str | os.PathLike[str] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ElasticResult:
        """Find the elastic motion and return strains, displacements and lengths.

        Parameters
        ----------
        method
            One of ``METHODS``. ``quasi-static`` leaves out all that the elastic motion itself adds;
            ``periodic`` finds the steady state of a crank at constant speed, with its Floquet multipliers.
            All others start undeformed and at rest relative to the rigid motion.
        revolutions
            Turns of the crank.
        steps
            Steps a turn of methods with fixed steps; doubled until two runs agree within ``rtol`` if absent.
        rtol
            Error over the peak stress of every station, as runs with doubled steps show it; of adaptive
            methods the tolerance.
        samples
            Number of equally spaced times recorded.
        at
            Directions of the crank [rad] to record instead, in the last turn.
        form
            ``exact``, or ``thesis``: rotations of axes taken as constant, for comparison only.
        geometric_stiffness
            Leave it out where false, whatever the scene says.
        checkpoint, checkpoint_every
            A file that is given the state of a run through time every so many seconds of wall time.
        resume
            Such a file to go on from, to the same bits as if the run had not been stopped.

        Raises
        ------
        ModelError, ResultError
            For options out of range, or a method that does not suit the linkage; for a checkpoint that cannot
            be written, or is of another run.
        SimulationError
            When the linkage cannot turn, or the motion grows out of all bounds.
        """
        from symgen.runtime.elastic_run import Task, run

        self._refuse_types("runs of elastic links are", but="types of C")
        for value, known, what in ((method, METHODS, "method"), (form, FORMS, "form")):
            if value not in known:
                raise ModelError(f"there is no {what} {value!r}. {nearest(value, known)}")
        task = Task(method, revolutions, steps, rtol, samples, None if at is None else tuple(at), form)
        kept_in = keeping(checkpoint, checkpoint_every, resume)
        return run(self._motion(geometric_stiffness), task, progress, kept_in)

    def sweep(
        self,
        speeds: Sequence[float],
        *,
        rtol: float = 1e-4,
        samples: int = 361,
        progress: Callable[[float], None] | None = None,
    ) -> Sweep:
        """Find the steady state at many speeds of the crank: peaks, Floquet multipliers, critical speeds.

        Parameters
        ----------
        speeds
            Angular velocities of the crank [rad/s]. It must be proportional to a tunable parameter.
        rtol
            Error over the peak stress of every run.
        samples
            Number of equally spaced times of a turn that peaks are looked for at.

        Raises
        ------
        ModelError
            When no tunable parameter sets the speed, or a speed makes no sense.
        SimulationError
            When the linkage cannot turn.
        """
        from symgen.runtime.sweep_run import sweep

        self._refuse_types("sweeps are")
        return sweep(self, speeds, rtol, samples, progress)

    def in_segments(self, count: int = 12) -> Model:
        """Return the linkage with every elastic link in so many rigid rods with torsion springs between them.

        It is derived and compiled when first asked for. ``LINK__k.angle`` are the directions of the rods.
        """
        if self._in_segments is None:
            raise ModelError(f"{self.name} was made without its rods: build it with symgen.build")
        return self._in_segments(whole(count, "segments")).with_parameters(**self.parameters)

    def exact(
        self,
        segments: int = 12,
        *,
        revolutions: float = 1.0,
        rtol: float = 1e-7,
        samples: int = 361,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float = 10.0,
        resume: str | os.PathLike[str] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ElasticResult:
        """Run the linkage with large rotation of its elastic links, in rods with springs between them.

        It is the judge of what :meth:`run` gives, which holds for small bending only. The error falls as the
        square of the number of rods, and the cost rises faster than its cube, as steps in time get shorter
        with its square; the notes of the result say what rods leave out. See ``docs/elastic_arbiter.md``.

        Parameters
        ----------
        segments
            Number of rods of each elastic link.
        revolutions
            Turns of the crank.
        rtol
            Relative tolerance of the local error of the steps in time.
        samples
            Number of equally spaced times recorded.
        checkpoint, checkpoint_every, resume
            See :meth:`run`.

        Raises
        ------
        ModelError, SceneError, ResultError
            For options out of range; for a checkpoint that cannot be written, or is of another run.
        SimulationError
            When the run cannot go on.
        """
        from symgen.runtime.exact_run import ExactTask, exact_run

        self._refuse_types("runs in rods with springs are")
        task = ExactTask(segments, revolutions, rtol, samples)
        kept = {"checkpoint": checkpoint, "checkpoint_every": checkpoint_every, "resume": resume}
        return exact_run(self._motion(True), self.in_segments(segments), task, progress, kept)
