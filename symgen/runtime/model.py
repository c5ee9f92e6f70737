"""A compiled model: what a user holds in hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime import _core
from symgen.runtime.causes import without_direction
from symgen.runtime.checkpoint import keeping
from symgen.runtime.initial import Start, start
from symgen.runtime.linkage_model import LinkageModel
from symgen.runtime.options import options
from symgen.runtime.redundancy import least_norm, not_unique
from symgen.runtime.result import Result
from symgen.runtime.simulate import run
from symgen.runtime.state import Accelerations, State, finite

if TYPE_CHECKING:
    from symgen.runtime._rhs import Rhs
    from symgen.runtime.equilibrium import Equilibrium
    from symgen.runtime.forces import Forces
    from symgen.runtime.modes import Modes

Array = NDArray[np.float64]


class Model(LinkageModel):
    """Compiled equations of one scene.

    Made by :func:`symgen.build`. Parameters that the scene declares tunable can be changed with
    :meth:`with_parameters` without compiling again.
    """

    def with_parameters(self, **values: float) -> Model:
        """Return the same model with other values of its tunable parameters, in SI units."""
        changed = {**self.parameters, **values}
        return Model(self.description, self._library, self._derive, changed, self._analyses, self._typed)

    def _found(self) -> Start:
        """Return the start: the one stored with the scene, unless a parameter was changed."""
        d = self.description
        if self._start is None and (self.is_changed or not d.start):
            self._start = start(self._evaluator)
        elif self._start is None:
            q, u = np.split(np.array(d.start), 2)
            self._start = Start(q, u, d.redundant)
        return self._start

    @property
    def redundant(self) -> tuple[str, ...]:
        """Constraints that follow from the others wherever the linkage goes, as messages call them."""
        return tuple(self.description.labels[i] for i in self._found().redundant)

    def accelerations(self, state: State | None = None) -> Accelerations:
        """Return accelerations by point, multipliers and ground reactions by name, at a state.

        Raises
        ------
        ModelError
            When the constraints have lost rank there, so that no finite answer exists.
        """
        d = self.description
        state = self.initial_state() if state is None else state
        n = d.coordinates
        redundant = self._found().redundant
        equations = self._evaluator.equations(len(redundant))
        row = np.concatenate([state.q, state.u, [0.0, 0.0]])
        status = equations.check(state.t, row)
        line = without_direction(self._evaluator, state.t, state.q, state.u)
        if line:
            raise ModelError(f"no finite accelerations at t = {state.t:g} s: {line}")
        if status != _core.DONE:
            name = "a redundant constraint is independent of the others there"
            if equations.lost == equations.redundant:
                name = f"{d.unknown(equations.weakest)} is not independent of the others"
            raise ModelError(
                f"the equations of motion are singular at t = {state.t:g} s, so accelerations are not "
                f"determined: {name}"
            )
        work = equations.solutions(np.array([state.t]), row[None, :])[0]
        work[:-1] = self._in_type(state.t, state.q, state.u, work[:-1])
        if redundant:
            work = least_norm(self._evaluator, state.t, state.q, work, len(redundant))
        of_points = self._evaluator.blocks("point_accelerations", state.t, state.q, state.u, work)
        points = dict(zip(d.points, of_points["point_accelerations"], strict=True))
        reactions = {}
        if self._evaluator.has("reactions"):
            found = self._evaluator.blocks("reactions", state.t, state.q, state.u, work)
            reactions = dict(zip(d.ground, found["reactions"], strict=True))
        open_rows = not_unique(self._evaluator, state.t, state.q, len(redundant))
        multipliers = dict(zip(d.constraints, work[n:-1].tolist(), strict=True))
        return Accelerations(points, multipliers, reactions, tuple(d.constraints[i] for i in open_rows))

    @property
    def rhs(self) -> Rhs:
        """The right-hand side for solvers of SciPy and others: see :mod:`symgen.runtime.rhs`."""
        from symgen.runtime.rhs import right_hand_side

        return right_hand_side(self)

    def forces(
        self,
        start: float = 0.0,
        stop: float | None = None,
        *,
        at: Sequence[float] | None = None,
        elements: int = 1,
        sections: Sequence[float] = (0.5,),
        samples: int = 361,
        state: State | None = None,
    ) -> Forces:
        """Return joint forces, section forces and driving torques of the driven linkage, by rigid elements.

        Parameters
        ----------
        start, stop
            The range of time [s], 0 to the scene's ``t_end`` when absent.
        at
            Directions [rad] of the driven link to evaluate, instead of ``samples`` times of the range.
        elements
            Into how many elements each link is cut; forces between them are given.
        sections
            Parts of the length of links at which section forces are given besides.
        samples
            Number of equally spaced times.
        state
            The assembly to follow, one of :meth:`assemblies`; the scene's own when absent.

        Raises
        ------
        ModelError
            When freedoms are not driven (it says how many), or for a request out of range.
        SimulationError
            When a pose cannot be reached or determines no forces; it names direction, rank and forces.
        """
        from symgen.runtime.forces_run import ForceTask, analyse

        begin = self.initial_state() if state is None else state
        end = self.description.t_end if stop is None else stop
        asked = ForceTask(start, end, samples, at, elements, sections)
        redundant = len(self._found().redundant)
        return analyse(self._kinematics(), self.analysis("forces"), begin.q, begin.t, redundant, asked)

    def equilibrium(
        self, *, state: State | None = None, t: float | None = None, stable: bool = True
    ) -> Equilibrium:
        """Return a static equilibrium: see ``docs/analyses.md``.

        Parameters
        ----------
        state
            The pose to start from; the scene's own when absent. Its velocities do not matter.
        t
            The time [s] at which forces and drives are held; that of ``state`` when absent.
        stable
            Go downhill to a stable equilibrium, or, if false, to one of any kind nearby. A start that is in
            equilibrium already is the answer in both cases.

        Raises
        ------
        ModelError
            When a drive or a ground point moves at that time.
        SimulationError
            When no equilibrium is found, as in free fall.
        """
        from symgen.runtime.equilibrium import at_rest, describe, find
        from symgen.runtime.linear import Statics

        begin = self.initial_state() if state is None else state
        when = begin.t if t is None else float(t)
        bonds = self._kinematics()
        at_rest(bonds, begin.q, when)
        statics = Statics(bonds, self.analysis("statics"), when)
        return describe(statics, *find(statics, begin.q, stable))

    def modes(self, about: Equilibrium | None = None) -> Modes:
        """Return frequencies and shapes of the small oscillations about an equilibrium.

        Parameters
        ----------
        about
            What :meth:`equilibrium` gave; the equilibrium found from the scene's start when absent.

        Raises
        ------
        ModelError, SimulationError
            When there is no equilibrium, or nothing is free to move.
        """
        from symgen.runtime.modes import analyse

        return analyse(self._evaluator, self.equilibrium() if about is None else about)

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
        stabilisation_rate: float | None = None,
        max_drift: float | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float = 10.0,
        resume: str | os.PathLike[str] | None = None,
        state: State | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Result:
        """Run the motion and return its result.

        Parameters
        ----------
        t_end
            End of the run [s]; the scene's own when absent.
        method
            An integrator's name (``docs/integrators.md``); ``dop853`` when absent, ``rk4`` with a ``step``.
        rtol, atol
            Tolerances of the local error of adaptive methods: relative (1e-9), in m and m/s (rtol/1000).
        step
            The fixed step [s]; a method that adapts its own takes fixed ones then, without judging them.
        samples
            Number of equally spaced times at which the outputs are recorded.
        max_steps
            A run that needs more steps ends with an error.
        stabilisation, stabilisation_rate
            ``projection`` onto the constraints after every step; for comparison only: ``baumgarte``, of the
            rate r [1/s] in Phi'' + 2 r Phi' + r^2 Phi = 0 (10), and ``raw``, which lets them drift.
        max_drift
            Error of a constraint [m] beyond which the run ends with an error; none when absent.
        checkpoint, checkpoint_every
            A file that is given the run's state every so many seconds of wall time.
        resume
            Such a file to go on from, to the same bits as if the run had not been stopped.
        state
            Where to start; :meth:`initial_state` when absent.
        progress
            Called now and then with the part of the run that is done.

        Raises
        ------
        ModelError, ResultError
            For options out of range; for a checkpoint that cannot be written, or is of another run.
        SimulationError
            When the run cannot go on; it carries the time and what was recorded.
        """
        end = self.description.t_end if t_end is None else t_end
        kept = (stabilisation, stabilisation_rate, max_drift)
        chosen = options(end, method, rtol, atol, step, samples, max_steps, *kept, precision=self._type)
        tangent = self.analysis("tangent", stepping=True) if chosen.method.needs_tangent else None
        kept_in = keeping(checkpoint, checkpoint_every, resume)
        found = self._found()
        t, y = (0.0, found.y) if state is None else finite(state)
        return run(self._evaluator, t, y, found.redundant, chosen, progress, self._typed, kept_in, tangent)
