"""Analyses that linkages with elastic links alone support."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from symgen.runtime.model.verbs import verb

if TYPE_CHECKING:
    from symgen.runtime.result.elastic import ElasticResult
    from symgen.runtime.result.modes import AssembledMatrices
    from symgen.runtime.result.speed_response import SpeedResponse


class ElasticAnalyses:
    """Steady states and reference solutions of elastic links, declared for every model."""

    @verb
    def periodic(
        self,
        *,
        steps: int | None = None,
        rtol: float | None = None,
        samples: int | None = None,
        at: ArrayLike | None = None,
        form: str | None = None,
        geometric_stiffness: bool | None = None,
        max_step: float | None = None,
        max_wall: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ElasticResult:
        """Return the steady state of one revolution, with its Floquet multipliers.

        The crank has constant speed, or the periodic speed that its motor produces. Arguments and errors are
        those of :meth:`simulate`.
        """
        raise NotImplementedError

    @verb
    def quasi_static(
        self,
        *,
        revolutions: float | None = None,
        samples: int | None = None,
        at: ArrayLike | None = None,
        form: str | None = None,
        geometric_stiffness: bool | None = None,
        max_wall: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ElasticResult:
        """Return the static deformation under the loads and inertia of the rigid motion.

        Arguments and errors are those of :meth:`simulate`.
        """
        raise NotImplementedError

    @verb
    def large_rotation(
        self,
        *,
        elements: int | None = None,
        t_end: float | None = None,
        revolutions: float | None = None,
        rtol: float | None = None,
        samples: int | None = None,
        max_step: float | None = None,
        max_wall: float | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float | None = None,
        resume: str | os.PathLike[str] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ElasticResult:
        """Run the motion in large rotation of the elastic links, by beam elements.

        It is the reference solution for :meth:`simulate`, which holds for small bending only; see
        ``docs/large_rotation.md``. Other arguments and errors are those of :meth:`simulate`.

        Parameters
        ----------
        elements
            Number of beam elements of each elastic link (4, or those of the scene if these are more). The
            result has forces, torque, deflections, energies, and error estimates by time steps and by
            elements.
        t_end, revolutions
            End of the run [s], or revolutions of the crank (1).
        rtol
            Error by time steps over the peak stress of each station (2e-3).
        """
        raise NotImplementedError

    @verb
    def speed_response(
        self,
        speeds: Sequence[float],
        *,
        rtol: float = 1e-4,
        samples: int = 361,
        max_wall: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> SpeedResponse:
        """Return the steady states at many crank speeds: peaks, Floquet multipliers, critical speeds.

        Parameters
        ----------
        speeds
            Angular velocities of the crank [rad/s]. The scene's speed must be proportional to a tunable
            parameter.
        rtol
            Error over the peak stress of every run.
        samples
            Number of equally spaced times of a revolution at which peaks are evaluated.
        max_wall
            Wall time [s] after which the analysis ends with an error that contains the completed speeds.

        Raises
        ------
        ModelError
            When no tunable parameter sets the speed, or a speed is zero or not finite.
        SimulationError
            When the crank cannot make a revolution.
        """
        raise NotImplementedError

    @verb
    def matrices(
        self, at: float | None = None, *, over: str | None = None, elements: int | None = None
    ) -> AssembledMatrices:
        """Return the assembled matrices of elastic links in the plane, with names of rows and columns.

        Of linkages with free coordinates, and with ``elements``, they are those of the equation of motion in
        large rotation, M a + r(q, v) + J^T lambda = 0, at the state that a run from the start reaches.

        Parameters
        ----------
        at
            Angle of the crank [rad]; by default that of the start.
        over
            ``time`` if ``at`` is a time [s].
        elements
            Number of elements of each elastic link in large rotation.
        """
        raise NotImplementedError
