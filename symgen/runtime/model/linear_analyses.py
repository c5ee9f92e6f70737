"""Matrices of the equations of motion, linear state-space models, and derivatives by parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime.model.verbs import verb

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Linearisation, Sensitivity
    from symgen.runtime.result.elastic import ElasticResult
    from symgen.runtime.result.state import State
    from symgen.runtime.rods.equilibrium import Equilibrium


class LinearAnalyses:
    """Mass matrix, constraint Jacobian, linearisation and sensitivities, declared for every model."""

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
            coordinates of the moving points in the order of ``State.q``: M [kg] of M a + J^T lambda = f. Of
            loops the free variables.

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
        Jacobian of :attr:`rhs` by the state is the matrix A of ``linearise(state)``. Of loops these are
        screws of the joint variables in the first frame, (6, variables): rotations, then displacements.
        """
        raise NotImplementedError

    @verb
    def linearise(
        self,
        at: State | Equilibrium | float | None = None,
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
            A state, the result of :meth:`equilibrium`, or a time [s] of the run from the start; the
            start when absent.
        inputs
            Inputs of the scene, all when absent. Others keep their values in :attr:`parameters`.
        outputs
            Scalars that a scene can record, such as ``A.position.x``, ``crank.angle``, ``energy``, or all
            components of ``O.reaction``; a coordinate with ``'`` is its rate. The coordinates when absent.
        coordinates
            Independent scalars of the pose, one for each degree of freedom: angles of links (plane),
            components of positions. The states are these and their rates. When absent, the positions and
            velocities of all moving points: A is then the Jacobian of :attr:`rhs`, constraints included.
            Of loops joint variables that are not prescribed, and the free ones when absent.

        Raises
        ------
        ModelError
            For unknown names; for coordinates that do not determine the motion; for a singular state, or one
            that violates the constraints; for forces that redundant constraints leave open.
        """
        raise NotImplementedError

    @verb
    def sensitivity(
        self,
        outputs: Sequence[str],
        parameters: Sequence[str] | None = None,
        *,
        at: State | Equilibrium | ElasticResult | float | None = None,
        coordinates: Sequence[str] = (),
        t_end: float | None = None,
        t_eval: ArrayLike | None = None,
        integrals: Sequence[str] = (),
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        max_steps: int | None = None,
        max_step: float | None = None,
    ) -> Sensitivity:
        """Return exact derivatives of outputs by tunable parameters: see ``docs/sensitivity.md``.

        Parameters
        ----------
        outputs
            Scalars that a scene can record, as for :meth:`linearise`: poses, velocities, accelerations,
            reactions, drive efforts, energies. At an equilibrium also ``frequencies`` [Hz] of all modes that
            oscillate, damped if they are, sorted by the modulus of their eigenvalues, and ``poles``, all
            eigenvalues, growing ones first; they come last. Of elastic links
            ``frequencies`` at rest in the pose, which come first, and those outputs of :meth:`quasi_static`
            that are displacements of joints, strains, stresses at stations or changes of length.
        parameters
            Tunable parameters and inputs, all when absent. Of a run also the initial values of
            ``coordinates`` and of their rates, called ``crank.angle`` and ``crank.angle'``; of a loop
            those of its free variables, without ``coordinates``.
        at
            An equilibrium, which moves with the parameters; or a state, which is held as far as drives and
            ``coordinates`` determine it, together with its time. Where drives alone move the linkage, and
            of loops and elastic links, a time [s] gives the state. Of elastic links also the result of
            :meth:`periodic`, which moves with the parameters at held angles of the crank, or of
            :meth:`simulate`, at its samples. The start when absent.
        coordinates
            Independent coordinates as for :meth:`linearise` that are held at a state, with their rates: one
            for each degree of freedom that is not driven.
        t_end, t_eval
            With either, the derivatives are those along the run from that state: at the end [s], or at these
            increasing times [s] after the start. Of driven loops and elastic links ``t_eval``
            gives poses [s]. An event that ends the run of a linkage replaces later times; derivatives there
            are those at its time, which changes, and ``time`` is a further output.
        integrals
            Outputs whose integrals over the time from the start are further outputs, ``integral of NAME``.
        method, rtol, atol, step, max_steps, max_step
            Options of the run, as for :meth:`simulate`; the method is explicit, or of linkages ``radau5``,
            ``newmark`` or ``generalized-alpha``. ``max_steps`` is 1,000,000 when absent: the states between
            all steps are kept.

        Raises
        ------
        ModelError
            As :meth:`linearise`; for a neutral equilibrium; for a parameter that contradicts redundant
            constraints; for equal frequencies.
        SimulationError
            When the pose of that time cannot be reached; as :meth:`simulate`.
        """
        raise NotImplementedError
