"""Calls of the compiled kernels of a model, its motion by steps, and results of states of other programs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from symgen.runtime.arrays import Array
from symgen.runtime.model.verbs import verb

if TYPE_CHECKING:
    from symgen.runtime.integrate.stepper import Stepper
    from symgen.runtime.kernels.batch import Rows
    from symgen.runtime.result.result import Result
    from symgen.runtime.result.state import State


class KernelCalls:
    """Calls of kernels and steps, for programs around a model, declared for every model."""

    @verb
    def batch(
        self,
        kernel: str,
        t: ArrayLike,
        q: ArrayLike,
        u: ArrayLike | None = None,
        *,
        work: ArrayLike | None = None,
        threads: int = 1,
    ) -> dict[str, Rows]:
        """Evaluate a kernel at many states in one call, in the precision of the model.

        States are evaluated in SIMD lanes, by the operations of the kernel alone: multipliers are not
        refined, and with redundant constraints they are one of many solutions.

        Parameters
        ----------
        kernel
            Kernel of :attr:`operations`, or one of its results, such as ``"accelerations"``.
        t
            One time [s], or one per state.
        q, u
            Coordinates and velocities, a row per state, as in ``State.q`` and ``State.u``; velocities are
            zero by default.
        work
            Work memory that the kernel reads, a row per state; by default the accelerations and
            multipliers of the state.
        threads
            Number of threads. It changes no bit of the results.

        Returns
        -------
        dict
            Results of the kernel by name, a row per state: in the model's precision if NumPy has this type
            (``float32``, ``float64``, ``longdouble``), in float64 for ``float128``, and numbers of mpmath for
            the backend ``mpmath``.

        Raises
        ------
        ModelError
            When there is no such kernel, or for arrays of other shapes.
        """
        raise NotImplementedError

    @verb
    def record(self, times: ArrayLike, states: ArrayLike, inputs: ArrayLike | None = None) -> Result:
        """Return the result of a motion computed by another solver, like a result of :meth:`simulate`.

        It has outputs, drift, plots and an animation. The drift is that at the recorded times; the energy
        drift is omitted if loads do work. Angles are continuous if no link rotates by more than half a
        revolution between two times.

        Parameters
        ----------
        times
            Increasing times [s].
        states
            States y = (q, u) of :attr:`rhs`, a row per time: ``motion.y.T`` of SciPy's ``solve_ivp``.
        inputs
            Values of the inputs of the scene, a row per time; by default those of the model.

        Raises
        ------
        ModelError
            For arrays of other shapes, times that do not increase, and numbers that are not finite.
        """
        raise NotImplementedError

    @verb
    def coordinates(self, y: State | ArrayLike, t: ArrayLike = 0.0) -> dict[str, Any]:
        """Return coordinates and rates of a state by name, as :meth:`linearise` names its states.

        Of linkages ``LINK.angle`` (in the plane, within 180 degrees) and ``POINT.position.x``; of loops the
        joint variables; of user-defined systems their coordinates. ``NAME'`` is the rate of NAME.

        Parameters
        ----------
        y
            A state y = (q, u) of :attr:`rhs` or a stepper, rows of states, or a ``State``.
        t
            Time [s] of the state, or of each row, for the angles of links on moving ground; a ``State`` has
            its own.

        Returns
        -------
        dict
            A number for each name, or an array with a number per row [rad, m, rad/s, m/s].

        Raises
        ------
        ModelError
            For arrays of other shapes, and entries that are not real numbers.
        """
        raise NotImplementedError

    @verb
    def evaluate(
        self,
        kernel: str,
        *,
        t: float = 0.0,
        q: ArrayLike = (),
        u: ArrayLike = (),
        p: ArrayLike = (),
        work: ArrayLike = (),
    ) -> dict[str, Array]:
        """Return the matrices of a kernel of a user-defined system by name; a single column is a 1-D array.

        Parameters
        ----------
        kernel
            One of :attr:`operations`.
        t, q, u, p, work
            Argument arrays, in the units that the System declares. The per-run precomputation from ``p`` is
            repeated at every call.

        Raises
        ------
        ModelError
            When there is no such kernel, or for arrays of other sizes.
        """
        raise NotImplementedError

    @verb
    def stepper(
        self,
        *,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_step: float | None = None,
        state: State | None = None,
        elements: int | None = None,
    ) -> Stepper:
        """Return a motion that advances by calls, for control loops: see ``docs/control.md``.

        It takes the steps of :meth:`simulate`, in float64.

        Parameters
        ----------
        method, rtol, atol, step, max_step
            As for :meth:`simulate`, but ``dop853`` by default for every ``rtol``. The last of fixed steps in
            a call is as long as the rest. Elastic links: steps in large rotation, as many in a call as
            ``rtol`` needs (1e-6: the error of places at its end over sizes), or of at most ``step`` [s].
        state
            Initial state; by default that of the scene.
        elements
            Elastic links in the plane: number of elements of each link (4, or those of the scene if more).

        Raises
        ------
        ModelError
            For options out of range, and a state of another model.
        InitialStateError, SimulationError
            When the start cannot be assembled, or there is no motion from it.
        """
        raise NotImplementedError
