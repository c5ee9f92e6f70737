"""The interface of all compiled models: analyses with the same names and arguments for every mechanism."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, overload

from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.display import display
from symgen.errors import CapabilityError
from symgen.runtime.many.calls import MANY, ManyRuns
from symgen.runtime.model.compiled import Compiled
from symgen.runtime.model.elastic_analyses import ElasticAnalyses
from symgen.runtime.model.kernel_calls import KernelCalls
from symgen.runtime.model.linear_analyses import LinearAnalyses
from symgen.runtime.model.verbs import INTERNAL, Verb, verb
from symgen.runtime.sweeps.calls import Sweeps

if TYPE_CHECKING:
    from symgen.runtime._rhs import Rhs
    from symgen.runtime.result.equilibrium import Equilibrium, Modes
    from symgen.runtime.result.modes import ElasticModes
    from symgen.runtime.result.result import Result
    from symgen.runtime.result.state import Accelerations, AssemblyModes, State

#: Reasons why models do not support an analysis of a single method.
_INSTEAD = {"evaluate": "it calls kernels of user-defined systems; batch calls those of scenes"}


class Model(LinearAnalyses, ManyRuns, Sweeps, ElasticAnalyses, KernelCalls, Compiled):
    """A compiled mechanism. :func:`symgen.build` returns one.

    Every model has the analyses below, with the same arguments. An analysis that a mechanism does not support
    raises CapabilityError with the reason when it is accessed, so that ``hasattr(model, "modes")`` is False.
    An argument that does not apply to a mechanism is refused by name. Values are in SI units and radians.
    """

    #: Reasons why analyses are missing, by name; under "" the reason for all others.
    MISSING: ClassVar[Mapping[str, str]]

    @property
    def capabilities(self) -> tuple[str, ...]:
        """Names of the analyses that the model supports."""
        return tuple(name for name in VERBS if self._refused(MANY.get(name, name)) is None)

    def __dir__(self) -> list[str]:
        public = {name for name in super().__dir__() if not name.startswith("_")}
        return sorted(public - INTERNAL - {*VERBS} | {*self.capabilities})

    def _carrier(self, name: str) -> Model:
        """Return the model whose method ``_NAME`` carries out an analysis."""
        return self

    def _refused(self, name: str) -> str | None:
        """Return the reason why an analysis is not supported; None if it is."""
        if name not in self.MISSING and hasattr(type(self), f"_{name}"):
            return None
        return self.MISSING.get(name) or _INSTEAD.get(name) or self.MISSING[""]

    @property
    def rhs(self) -> Rhs:
        """Right-hand side f(t, y, u) of a mechanism for other solvers: see ``docs/solvers.md``."""
        raise CapabilityError(f"{self.name} does not support rhs: it is for rigid linkages and loops")

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
        controller: Callable[..., Any] | None = None,
        sample: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Result:
        """Run the motion in time and return its result.

        Parameters
        ----------
        t_end
            End of the run [s]; by default that of the scene, for elastic links one revolution.
        method
            Name of an integrator (``docs/integrators.md``): by default ``taylor`` for ``rtol`` of at most
            1e-7 where it can, otherwise ``dop853``. Elastic links: ``gauss`` (default), ``gauss4``,
            ``newmark``, ``generalized-alpha``, ``wilson-theta``, ``bdf2`` to ``bdf5``, ``dop853``, ``rk4``.
        rtol, atol
            Tolerances of the local error of adaptive methods: relative (1e-9), in m and m/s (rtol/1000).
            Elastic links: ``rtol`` is the error over the peak stress (1e-4) of methods with fixed steps.
        step
            Fixed step [s]; ``dop853`` and ``dopri5`` then take fixed steps without error control.
        steps, revolutions
            Elastic links: fixed steps per revolution (by default as many as
            ``rtol`` needs), and revolutions of the crank in place of ``t_end``.
        samples
            Number of equally spaced times recorded (201; elastic links 361).
        t_eval
            Increasing times [s] from the start to ``t_end`` to record instead; ``result.at`` records others.
        at
            Elastic links: angles of the crank [rad] to record instead, in the last revolution.
        form, geometric_stiffness
            Elastic links: ``exact``, or ``thesis`` (constant transformations, for comparison only); false
            omits geometric stiffness, for all links.
        initial
            Elastic links: ``undeformed``, at rest relative to the rigid motion (the default), or
            ``quasi-static``, with the shape under the loads of the rigid motion (in space, of equilibria with
            the input held) and its rates; or the largest displacements [m] of the first modes at rest.
        max_steps
            Number of steps (1e9) after which the run ends with an error.
        stabilisation, stabilisation_rate
            ``projection`` onto the constraints after every step. For comparison only: ``baumgarte``, with the
            rate r [1/s] in Phi'' + 2 r Phi' + r^2 Phi = 0 (10), and ``raw``, without correction.
        max_drift
            Constraint error [m] beyond which the run ends with an error; default: none. Loops: closure defect
            [m], with rotations multiplied by the size of the loop.
        max_step
            Longest step [s] of an adaptive method; for loads shorter than the steps.
        max_wall
            Wall time [s] after which the run ends with an error that contains the result so far.
        checkpoint, checkpoint_every
            File to which the state of the run is written, and the wall time [s] between two writes (10).
        resume
            Checkpoint from which the run continues, with the bits of an uninterrupted run.
        state
            Initial state; by default that of the scene.
        controller, sample
            Function ``f(t, view)`` that returns inputs by name, such as ``{"F": 2.0}``, and the time [s]
            between two calls, in which inputs are constant; without this time it has no memory, and is
            called in every evaluation: see ``docs/control.md``. The method is then ``dop853`` by default.
        progress
            Called from time to time with the completed part of the run, 0 to 1.

        Raises
        ------
        ModelError, ResultError
            For options out of range; for a checkpoint that cannot be written, or is of another run.
        InitialStateError
            When the start cannot be assembled.
        SimulationError
            When the run cannot continue, or its controller raises an exception or returns anything but
            inputs; it contains the time and the recorded samples.
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
            Range of poses; by default that of the scene.
        at
            Values to evaluate instead of a range, in any order; of those that a linkage has several
            times, the first.
        over
            Variable of range and values: ``input`` (first input of a loop [rad, m], direction of the driven
            link [rad]) or ``time`` [s]. By default ``at`` has values of the input; a range is of the input
            for loops, of the time for linkages.
        samples
            Number of equally spaced poses of the range (361; linkages 181, in the part that they reach).
        of
            Linkages: points and links (plane) to record; by default all that move.
        state
            Linkages: assembly mode, one of :meth:`assemblies`; by default that of the scene.
        through
            Continue past turning points of the input. Linkages continue on the other branch, back in time;
            samples of a loop are equally spaced in arc length.

        Raises
        ------
        ModelError
            For a wrong range, value or name; when drives do not determine the motion.
        InitialStateError
            When the mechanism cannot be assembled at the start.
        SimulationError
            When a pose cannot be reached; it names the cause and contains the poses before it.
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

        Results of loops include the motion, those of linkages in the plane section forces; elastic links
        count as rigid. Linkages in space: the outputs that the scene selects, at the poses of the motion.

        Parameters
        ----------
        start, stop, at, over, samples, state, through
            As for :meth:`kinematics` (361 samples).
        elements
            Linkages: number of elements of each link (1); the forces between them are recorded.
        sections
            Linkages: fractions of the length at which section forces are recorded (the middle).

        Raises
        ------
        ModelError, InitialStateError
            As :meth:`kinematics`.
        SimulationError
            When a pose cannot be reached or does not determine the forces; it names pose, rank and forces.
        """
        raise NotImplementedError

    @verb
    def equilibrium(
        self,
        *,
        state: State | None = None,
        at: float | None = None,
        stable: bool = True,
        elements: int | None = None,
    ) -> Equilibrium:
        """Return a static equilibrium: see ``docs/analyses.md``.

        Parameters
        ----------
        state
            Initial pose; by default that of the scene. Its velocities have no effect.
        at
            Time [s] at which forces and drives are held, by default that of ``state``. Drives that alone
            determine the pose lead to it from ``state``.
        stable
            Find a stable equilibrium, or, if false, a nearby one of any kind. A start that is already an
            equilibrium is returned in both cases.
        elements
            Elastic links in the plane: number of elements of each link, which bend by any angle (4, or those
            of the scene if these are more).

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
            Equilibrium about which a linkage vibrates; by default that found from the scene's start. Elastic
            links: angle of the crank [rad], in space the time [s]; by default that of the start.
        moving
            Elastic links: with centrifugal, gyroscopic and axial forces of the rigid motion, frozen at that
            instant, with each joint in the axes of an elastic link. At rest otherwise.

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

        The list is complete for linkages of driven cranks, dyads and triads. Other mechanisms are searched
        from many fixed starts. ``complete`` of the tuple states whether the list is complete, ``incomplete``
        the reason if it may not be. Velocities are zero.

        Parameters
        ----------
        at
            Value of the first input [rad, m], or of the time [s] with ``over="time"``; by default the start.
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
        of: Sequence[str] | None = None,
        unit: str | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> Any:
        """Draw the mechanism in one or more poses, with the paths of points; notebooks show the drawing.

        Parameters
        ----------
        at
            Values at which poses are drawn; by default the beginning of the motion.
        over
            Variable of the values: ``input`` (the default, if there is one) or ``time`` [s].
        of
            Points, or joints of a loop, whose paths over the motion are drawn; by default all that move.
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
        return display("draw", self, at, over, of, unit, file)

    @verb
    def accelerations(self, state: State | None = None) -> Accelerations:
        """Return accelerations by point, multipliers and ground reactions by name, at a state.

        Raises
        ------
        ModelError
            When the constraints lose rank at the state, so that accelerations are not finite or not unique.
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
