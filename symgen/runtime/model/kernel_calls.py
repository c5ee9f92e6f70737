"""Calls of the compiled kernels of a model by name, and results of states that other programs integrated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime.model.verbs import verb

if TYPE_CHECKING:
    from symgen.runtime.kernels.batch import Rows
    from symgen.runtime.result.result import Result


class KernelCalls:
    """Kernels of a scene at many states, and those of a user-defined system, declared for every model."""

    @verb
    def batch(
        self,
        what: str,
        t: ArrayLike,
        q: ArrayLike,
        u: ArrayLike | None = None,
        *,
        work: ArrayLike | None = None,
        threads: int = 1,
    ) -> dict[str, Rows]:
        """Evaluate a kernel at many states in one call, in the precision the model was built in.

        States go through the lanes of vector registers. Each gets the operations of the kernel and no others:
        multipliers are not refined, and with redundant constraints they are one choice of many.

        Parameters
        ----------
        what
            A kernel of :attr:`operations`, or one of its results, such as ``"accelerations"``.
        t
            One time [s], or one per state.
        q, u
            A row per state: coordinates and velocities, as in ``State.q`` and ``State.u``; zero velocities
            when absent.
        work
            A row per state of the work memory that the kernel reads; the accelerations and multipliers of
            the state when absent.
        threads
            Number of threads. It changes no bit of the results.

        Returns
        -------
        dict
            Results of the kernel by name, a row per state: in the model's precision where NumPy has it
            (``float32``, ``float64``, ``longdouble``), in float64 for ``float128``, and mpmath's numbers for
            the backend ``mpmath``.

        Raises
        ------
        ModelError
            When there is no such kernel, or for arrays of other shapes.
        """
        raise NotImplementedError

    @verb
    def record(self, times: ArrayLike, states: ArrayLike, inputs: ArrayLike | None = None) -> Result:
        """Return the result of a motion that another solver found, as :meth:`simulate` would.

        It has outputs, drift, plots and an animation. Drift is that of the recorded times, of the energy
        only where no load does work. Angles of links are continuous if none turns by half a revolution
        between two times.

        Parameters
        ----------
        times
            Increasing times [s].
        states
            States y = (q, u) of :attr:`rhs`, a row per time: ``motion.y.T`` of SciPy's ``solve_ivp``.
        inputs
            Values of the inputs of the scene, a row per time; those of the model when absent.

        Raises
        ------
        ModelError
            For arrays of other shapes, times that do not increase, and numbers that are not finite.
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
    ) -> dict[str, NDArray[np.float64]]:
        """Return the results of a kernel of a user-defined system by name, shaped; a single column is 1-D.

        Parameters
        ----------
        kernel
            One of :attr:`operations`.
        t, q, u, p, work
            The argument arrays, in the units that the System declares. What depends on ``p`` alone is
            recomputed at every call, also where the System declares ``p`` constant over a run.

        Raises
        ------
        ModelError
            When there is no such kernel, or for arrays of other sizes.
        """
        raise NotImplementedError
