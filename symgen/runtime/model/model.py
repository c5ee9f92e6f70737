"""The one interface of compiled models: analyses with the same names and arguments for every mechanism."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self, overload

from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.display import display
from symgen.errors import CapabilityError
from symgen.runtime.many.calls import MANY, ManyRuns
from symgen.runtime.model.compiled import Compiled
from symgen.runtime.model.elastic_analyses import ElasticAnalyses
from symgen.runtime.model.kernel_calls import KernelCalls
from symgen.runtime.model.linear_analyses import LinearAnalyses
from symgen.runtime.model.verbs import Verb, verb
from symgen.runtime.sweeps.calls import Sweeps

if TYPE_CHECKING:
    from symgen.runtime._rhs import Rhs
    from symgen.runtime.result.modes import ElasticModes
    from symgen.runtime.result.result import Result
    from symgen.runtime.result.state import Accelerations, AssemblyModes, State
    from symgen.runtime.rods.equilibrium import Equilibrium
    from symgen.runtime.rods.modes import Modes

#: Why most models do not support an analysis, where it is for one method alone.
_INSTEAD = {"evaluate": "it calls kernels of user-defined systems; batch calls those of scenes"}


class Model(LinearAnalyses, ManyRuns, Sweeps, ElasticAnalyses, KernelCalls, Compiled):
    """A compiled mechanism. :func:`symgen.build` returns one.

    Every model has the analyses below, with the same arguments. An analysis that a mechanism does not support
    raises CapabilityError with the reason when it is accessed, so that ``hasattr(model, "modes")`` is False.
    An argument that does not apply to a mechanism is refused by name. Angles are in radians, all else in SI.
    """

    #: Why analyses are missing, by name; under "" the reason for all others.
    MISSING: ClassVar[Mapping[str, str]]

    @checked
    def with_parameters(self, /, **values: float) -> Self:
        """Return the same model with other values of its tunable parameters, in SI units."""
        changed = {**self.parameters, **values}
        parts = self.description, self._library, self._derive, changed, self._analyses, self._typed
        return type(self)(*parts, **self._more)

    @property
    def capabilities(self) -> tuple[str, ...]:
        """Names of the analyses that the model supports."""
        return tuple(name for name in VERBS if self._refused(MANY.get(name, name)) is None)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__()} - {*VERBS} | {*self.capabilities})

    def _carrier(self, name: str) -> Model:
        """Return the model whose method ``_NAME`` carries out an analysis."""
        return self

    def _refused(self, name: str) -> str | None:
        """Return why an analysis is not supported; None where it is."""
        if name not in self.MISSING and hasattr(type(self), f"_{name}"):
            return None
        return self.MISSING.get(name) or _INSTEAD.get(name) or self.MISSING[""]

    @property
    def rhs(self) -> Rhs:
        """Right-hand side f(t, y, u) of a mechanism for other solvers: see ``docs/solvers.md``."""
        raise CapabilityError(f"{self.name} does not support rhs: it is for rigid linkages and loops")

    @verb
    def in_segments(self, count: int = 12) -> Model:
        """Return the linkage with every elastic link in so many rigid rods with torsion springs between them.

        It is derived and compiled when first requested. ``LINK__k.angle`` are the directions of the rods.
        """
        raise NotImplementedError

    @verb
    def simulate(
        self,
        t_end: float | None = None,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        steps: int | None = None,
        revolutions: float | None = None,
        samples: int | None = None,
        t_eval: ArrayLike | None = None,
        at: ArrayLike | None = None,
        form: str | None = None,
        geometric_stiffness: bool | None = None,
        initial: str | Sequence[float] | None = None,
        max_steps: int | None = None,
        stabilisation: str | None = None,
        stabilisation_rate: float | None = None,
        max_drift: float | None = None,
        max_step: float | None = None,
        max_wall: float | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float | None = None,
        resume: str | os.PathLike[str] | None = None,
        state: State | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Result:
        """Run the motion in time and return its result.

        Parameters
        ----------
        t_end
            End of the run [s]; the scene's own when absent. Elastic links: one revolution when absent.
        method
            An integrator's name (``docs/integrators.md``): ``dop853`` when absent, ``rk4`` with a ``step``.
            Elastic links: ``gauss`` when absent, ``gauss4``, ``newmark``, ``generalized-alpha``,
            ``wilson-theta``, ``dop853``, ``rk4``.
        rtol, atol
            Tolerances of the local error of adaptive methods: relative (1e-9), in m and m/s (rtol/1000).
            Elastic links: ``rtol`` is the error over the peak stress (1e-4) of methods with fixed steps.
        step
            The fixed step [s]; adaptive methods then take fixed steps without error control.
        steps, revolutions
            Elastic links: fixed steps per revolution, those that ``rtol`` needs when absent; revolutions
            of the crank in place of ``t_end``.
        samples
            Number of equally spaced times recorded (201; elastic links 361).
        t_eval
            Increasing times [s] from the start to ``t_end`` to record instead; ``result.at`` records others.
        at
            Elastic links: directions of the crank [rad] to record instead, in the last revolution.
        form, geometric_stiffness
            Elastic links: ``exact`` or ``thesis`` (rotations of axes taken as constant, for comparison only);
            false omits geometric stiffness, whatever the scene says.
        initial
            Elastic links: ``undeformed``, at rest relative to the rigid motion (the default), or
            ``quasi-static``, with the shape under the loads of the rigid motion at the start, and its rates;
            or the amplitudes of the first modes at rest, their largest displacements [m].
        max_steps
            A run that needs more steps (1e9) ends with an error.
        stabilisation, stabilisation_rate
            ``projection`` onto the constraints after every step; for comparison only: ``baumgarte``, of the
            rate r [1/s] in Phi'' + 2 r Phi' + r^2 Phi = 0 (10), and ``raw``, which lets them drift.
        max_drift
            Error of a constraint [m] beyond which the run ends with an error; none when absent. Loops: the
            defect of closure [m], of rotations times the size of the loop.
        max_step
            The longest step [s] of an adaptive method; for loads shorter than the steps.
        max_wall
            Wall time [s] after which the run ends with an error that carries its result so far.
        checkpoint, checkpoint_every
            A file to which the state of the run is written every so many seconds of wall time (10).
        resume
            A checkpoint to continue from, to the same bits as an uninterrupted run.
        state
            The state to start from; that of the scene when absent.
        progress
            Called now and then with the completed part of the run.

        Raises
        ------
        ModelError, ResultError
            For options out of range; for a checkpoint that cannot be written, or is of another run.
        InitialStateError
            When the start cannot be assembled.
        SimulationError
            If the run cannot continue; it carries the time and the samples recorded.
        """
        raise NotImplementedError

    @verb
    def kinematics(
        self,
        start: float | None = None,
        stop: float | None = None,
        *,
        at: ArrayLike | None = None,
        over: str | None = None,
        samples: int | None = None,
        of: Sequence[str] | None = None,
        state: State | None = None,
        through: bool = False,
    ) -> Result:
        """Return positions, velocities and accelerations of the driven mechanism, without forces.

        The mechanism is followed from its start, so that it stays on one assembly branch. Elastic links: the
        motion of the rigid linkage.

        Parameters
        ----------
        start, stop
            The range; the scene's own when absent.
        at
            Values to evaluate instead of a range, in any order.
        over
            The variable of range and values: ``input`` (first input of a loop [rad, m], direction of the
            driven link [rad]) or ``time`` [s]. By default values are of the input; a range of the input for
            loops, of the time for linkages.
        samples
            Number of equally spaced poses of the range (361; linkages 181).
        of
            Linkages: points and links (plane) to record; all that move when absent.
        state
            Linkages: the assembly to follow, one of :meth:`assemblies`; the scene's own when absent.
        through
            Continue past turning points of the input until the range is left or the curve closes. Linkages
            continue on the other branch, back in time; a loop is sampled by equal parts of the arc length.

        Raises
        ------
        ModelError
            For a wrong range, value or name; when drives do not determine the motion.
        InitialStateError
            When the mechanism cannot be assembled at the start.
        SimulationError
            When a pose cannot be reached; it names the cause, and carries the poses that were.
        """
        raise NotImplementedError

    @verb
    def inverse_dynamics(
        self,
        start: float | None = None,
        stop: float | None = None,
        *,
        at: ArrayLike | None = None,
        over: str | None = None,
        samples: int | None = None,
        elements: int | None = None,
        sections: Sequence[float] | None = None,
        state: State | None = None,
        through: bool = False,
    ) -> Result:
        """Return joint forces and drive efforts of the driven mechanism along its motion.

        Loops: together with the motion. Linkages: also section forces; elastic links are taken as rigid.

        Parameters
        ----------
        start, stop, at, over, samples, state, through
            As for :meth:`kinematics` (361 samples).
        elements
            Linkages: number of elements of each link (1); forces between them are recorded.
        sections
            Linkages: parts of the length of links at which section forces are recorded (the middle).

        Raises
        ------
        ModelError, InitialStateError
            As :meth:`kinematics`.
        SimulationError
            When a pose cannot be reached or does not determine the forces; it names direction, rank, forces.
        """
        raise NotImplementedError

    @verb
    def equilibrium(
        self,
        *,
        state: State | None = None,
        t: float | None = None,
        stable: bool = True,
        segments: int | None = None,
    ) -> Equilibrium:
        """Return a static equilibrium: see ``docs/analyses.md``.

        Parameters
        ----------
        state
            The pose to start from; the scene's own when absent. Its velocities do not matter.
        t
            The time [s] at which forces and drives are held; that of ``state`` when absent.
        stable
            Descend to a stable equilibrium, or, if false, find one of any kind nearby. A start that is in
            equilibrium already is the answer in both cases.
        segments
            Elastic links: number of rods of each link, which rotate by any angle (12).

        Raises
        ------
        ModelError
            When a drive or a ground point moves at that time.
        SimulationError
            When no equilibrium is found, as in free fall.
        """
        raise NotImplementedError

    @overload
    def modes(self, at: Equilibrium) -> Modes: ...

    @overload
    def modes(self, at: float, *, moving: bool = False) -> ElasticModes: ...

    @overload
    def modes(self, at: None = None, *, moving: bool = False) -> Modes | ElasticModes: ...

    @verb
    def modes(self, at: Equilibrium | float | None = None, *, moving: bool = False) -> Modes | ElasticModes:
        """Return frequencies and shapes of small vibrations.

        Parameters
        ----------
        at
            The equilibrium about which a linkage vibrates; that found from the scene's start when absent.
            Elastic links: direction of the crank [rad], in space the time [s]; that of the start if absent.
        moving
            Elastic links: with centrifugal, gyroscopic and axial forces of the rigid motion, as if these
            lasted, each joint on the axes of an elastic link. At rest otherwise.

        Raises
        ------
        ModelError, SimulationError
            When there is no equilibrium, nothing is free to move, or the crank cannot take that direction.
        """
        raise NotImplementedError

    @verb
    def assemblies(
        self, at: float | None = None, *, over: str | None = None
    ) -> AssemblyModes[State] | AssemblyModes[dict[str, float]]:
        """Return the assembly modes, the scene's own first: states of a linkage, joint variables of a loop.

        They are all modes of linkages of driven cranks, dyads and triads; those of others are searched from
        many starts, the same every time: ``complete`` and ``incomplete`` of the tuple tell. Velocities are
        zero.

        Parameters
        ----------
        at
            Value of the first input [rad, m], or of the time [s] with ``over="time"``; the start when absent.
        over
            ``input`` (default) or ``time``.

        Raises
        ------
        ModelError
            When the drives do not determine the pose, or the value is not in their range.
        """
        raise NotImplementedError

    @checked
    def draw(
        self,
        at: ArrayLike | None = None,
        *,
        over: str | None = None,
        paths: Sequence[str] | None = None,
        unit: str | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> Any:
        """Draw the mechanism in one or more poses, with the paths of points; notebooks show the drawing.

        Parameters
        ----------
        at
            Values at which poses are drawn; the beginning of the motion when absent.
        over
            Their variable: ``input`` (default where there is one) or ``time`` [s].
        paths
            Points, or joints of a loop, whose paths over the motion are drawn; all that move when absent.
        unit
            Unit of length of DXF and of the scale bar, such as ``mm``; that of ``[units]``, otherwise m.
        file
            File to write: ``.svg``, or ``.dxf`` (``pip install 'symgen[dxf]'``).

        Raises
        ------
        ModelError
            For a name or unit that is unknown, and for user-defined systems.
        ResultError
            When the file cannot be written.
        """
        return display("draw", self, at, over, paths, unit, file)

    @verb
    def accelerations(self, state: State | None = None) -> Accelerations:
        """Return accelerations by point, multipliers and ground reactions by name, at a state.

        Raises
        ------
        ModelError
            When the constraints have lost rank there, so that no finite answer exists.
        """
        raise NotImplementedError


#: Names of all analyses, then those of many runs in a call.
VERBS: tuple[str, ...] = (
    *(
        name
        for of in (Model, LinearAnalyses, ElasticAnalyses, KernelCalls)
        for name, value in vars(of).items()
        if isinstance(value, Verb)
    ),
    *MANY,
)
