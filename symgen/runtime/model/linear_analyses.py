"""Matrices of the equations of motion, linear state-space models, and derivatives by parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from symgen.runtime.arrays import Array
from symgen.runtime.model.verbs import verb

if TYPE_CHECKING:
    from symgen.runtime.linearisation.record import Linearisation, Sensitivity
    from symgen.runtime.result.elastic import ElasticResult
    from symgen.runtime.result.equilibrium import Equilibrium
    from symgen.runtime.result.state import State


class LinearAnalyses:
    """Mass matrix, constraint Jacobian, linearisation and sensitivities, declared for every model."""

    @verb
    def mass_matrix(self, state: State | None = None, *, coordinates: Sequence[str] | None = None) -> Array:
        """Return the mass matrix (coordinates, coordinates) at a state, by default the start.

        Parameters
        ----------
        state
            State; its velocities have no effect.
        coordinates
            Independent coordinates as for :meth:`linearise`, which determine the units. By default the
            coordinates of the moving points in the order of ``State.q``: M [kg] of M a + J^T lambda = f. For
            loops the default is the free variables.

        Raises
        ------
        ModelError
            As :meth:`linearise`.
        """
        raise NotImplementedError

    @verb
    def jacobian(self, state: State | None = None) -> Array:
        """Return the constraint Jacobian dPhi/dq (constraints, coordinates) at a state, by default the start.

        Rows are in the order of ``model.description.constraints``, columns in that of ``State.q``. The
        Jacobian of :attr:`rhs` by the state is the matrix A of ``linearise(state)``. For loops the result has
        the screws of the joint variables in the first frame, (6, variables): rotations, then displacements.
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
        """Return the state-space matrices A, B, C, D at a state, as exact derivatives.

        Deviations are from any state, at rest or in motion; ``rates`` of the result are zero at an
        equilibrium. Time and prescribed drives are held constant. See ``docs/control.md``.

        Parameters
        ----------
        at
            State, result of :meth:`equilibrium`, or time [s] of the run from the start; by default the start.
        inputs
            Inputs of the scene, by default all. Others keep their values in :attr:`parameters`.
        outputs
            Scalars that a scene can record, such as ``A.position.x``, ``crank.angle``, ``energy``, or all
            components of ``O.reaction``; a coordinate with ``'`` is its rate. By default the coordinates.
        coordinates
            Independent scalars of the pose, one for each degree of freedom: angles of links (plane),
            components of positions. The states are these coordinates and their rates. By default the states
            are positions and velocities of all moving points; A is then the Jacobian of :attr:`rhs`,
            constraints included. Coordinates of loops are joint variables that are not prescribed, by default
            the free variables.

        Raises
        ------
        ModelError
            For unknown names; for coordinates that do not determine the motion; for a singular state, or one
            that violates the constraints; for forces that redundant constraints leave undetermined.
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
            reactions, drive efforts, energies. At an equilibrium also ``frequencies``, the damped frequencies
            [Hz] of all modes that oscillate, by rising modulus of their eigenvalues, and ``poles``, all
            eigenvalues, growing ones first; these are the last outputs. For elastic links: ``frequencies`` at
            rest in the pose, which are the first outputs, and displacements of joints, strains, stresses at
            stations and changes of length of :meth:`quasi_static`; in space
            ``frequencies`` alone, or all outputs of a run.
        parameters
            Tunable parameters and inputs, by default all. For a run also the initial values of
            ``coordinates`` and of their rates, such as ``crank.angle`` and ``crank.angle'``; for a loop those
            of its free variables, without ``coordinates``.
        at
            An equilibrium, which moves with the parameters; or a state, in which the time, drives and
            ``coordinates`` are held constant. If drives alone move the linkage, and for loops and elastic
            links, a time [s] specifies the state. For elastic links also the result of :meth:`periodic`,
            at constant angles of the crank, or of :meth:`simulate`, at its samples. By default the start,
            which also moves with the parameters if the scene has ``start.equilibrium``.
        coordinates
            Independent coordinates as for :meth:`linearise`, held constant with their rates at a state: one
            for each degree of freedom that is not driven.
        t_end, t_eval
            With one of these, derivatives are along the run from that state: at the end [s], or at these
            increasing times [s] from the start on. For driven loops and elastic links ``t_eval`` are times of
            poses [s]. An event that ends the run of a linkage replaces later times; derivatives at the event
            include the change of its time, and ``time`` is a further output.
        integrals
            Outputs whose integrals over the time from the start are further outputs, ``integral of NAME``.
        method, rtol, atol, step, max_steps, max_step
            Options of the run, as for :meth:`simulate`; the method is explicit (``dop853``), or of linkages
            ``taylor``, ``radau5``, ``newmark`` or ``generalized-alpha``. The default of ``max_steps`` is
            1,000,000, since the states between all steps are stored.

        Raises
        ------
        ModelError
            As :meth:`linearise`; for a neutral equilibrium; for a parameter that contradicts redundant
            constraints; for equal frequencies.
        SimulationError
            When the pose at that time cannot be reached; as :meth:`simulate`.
        """
        raise NotImplementedError
