"""Matrices of the equations of motion and linear state-space models, for control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.model.verbs import verb

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Linearisation
    from symgen.runtime.result.state import State
    from symgen.runtime.rods.equilibrium import Equilibrium


class LinearAnalyses:
    """Mass matrix, constraint Jacobian and linearisation, declared for every model."""

    @verb
    def mass_matrix(
        self, state: State | None = None, *, coordinates: Sequence[str] | None = None
    ) -> NDArray[np.float64]:
        """Return the mass matrix (coordinates, coordinates) at a state; the start when absent.

        Parameters
        ----------
        state
            The state; its velocities do not matter.
        coordinates
            Independent coordinates as for :meth:`linearise`; the units follow from theirs. When absent, the
            coordinates of the moving points in the order of ``State.q``: M [kg] of M a + J^T lambda = f.

        Raises
        ------
        ModelError
            As :meth:`linearise`.
        """
        raise NotImplementedError

    @verb
    def jacobian(self, state: State | None = None) -> NDArray[np.float64]:
        """Return the constraint Jacobian J = dPhi/dq (constraints, coordinates) at a state; else the start.

        Rows are in the order of ``model.description.constraints``, columns in that of ``State.q``. The
        Jacobian of :attr:`rhs` by the state is the matrix A of ``linearise(state)``.
        """
        raise NotImplementedError

    @verb
    def linearise(
        self,
        at: State | Equilibrium | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        *,
        coordinates: Sequence[str] | None = None,
    ) -> Linearisation:
        """Return the state-space matrices A, B, C, D at a state: exact derivatives, no differences.

        The deviations may be from any state, at rest or in motion; ``rates`` of the result are zero at an
        equilibrium. Time and the prescribed drives are held. See ``docs/control.md``.

        Parameters
        ----------
        at
            A state, or the result of :meth:`equilibrium`; the start when absent.
        inputs
            Inputs of the scene, all when absent. Others keep their values in :attr:`parameters`.
        outputs
            Scalars that a scene can record, such as ``A.position.x``, ``crank.angle``, ``energy``, or all
            components of ``O.reaction``; a coordinate with ``'`` is its rate. The coordinates when absent.
        coordinates
            Independent scalars of the pose, one for each degree of freedom: angles of links (plane),
            components of positions. The states are these and their rates. When absent, the positions and
            velocities of all moving points: A is then the Jacobian of :attr:`rhs`, constraints included.

        Raises
        ------
        ModelError
            For unknown names; for coordinates that do not determine the motion; for a singular state, or one
            that violates the constraints; for forces that redundant constraints leave open.
        """
        raise NotImplementedError
