"""Open chains and trees of rigid rods of any length, in time proportional to the number of rods.

The kernels are the shipped loops ``chain`` and ``chain_spatial``: nothing is compiled for a chain.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.chain.elimination import ChainMotion, Elimination
from symgen.runtime.chain.inputs import refuse, tree, vector
from symgen.runtime.chain.run import ChainRun, run
from symgen.runtime.integrate.checkpoint import keeping
from symgen.runtime.integrate.integrators import integrator
from symgen.runtime.integrate.options import options, sample_count
from symgen.runtime.integrate.pace import limited
from symgen.runtime.kernels.library import shipped_module

_MODULES = {2: "chain", 3: "chain_spatial"}


@checked
class Chain(Elimination):
    """Rigid rods joined end to end, or branching; a base that is pinned or free.

    Point 0 is the base, rod k ends at point k + 1. Source: H. A. Attia, *Dynamic Analysis of a Chain of Rigid
    Rods*, sections 2.1 and 2.2, solved by elimination from the leaves to the root.

    Parameters
    ----------
    lengths, masses
        Of each rod [m, kg]; masses may be zero where a point mass is carried.
    centres
        Centre of mass of each rod from its inner point [m]; by default the middle.
    inertias
        Moment of inertia of each rod about its centre of mass, across it [kg m^2]; by default uniform.
    parents
        The point that each rod starts from, ``parents[k] <= k``; by default the end of the rod before.
    point_masses
        Mass at each point [kg], n + 1 of them.
    pinned
        Whether the base is held, else it is free.
    gravity
        Acceleration of gravity [m/s^2]; its length, 2 or 3, says plane or space.

    Raises
    ------
    ModelError
        When a value is not finite, of the wrong shape or sign, or leaves a rod's outer end without mass.
    """

    @checked
    def __init__(
        self,
        lengths: ArrayLike,
        masses: ArrayLike,
        *,
        centres: ArrayLike | None = None,
        inertias: ArrayLike | None = None,
        parents: Sequence[int] | Indices | None = None,
        point_masses: ArrayLike | None = None,
        pinned: bool = True,
        gravity: ArrayLike = (0.0, -9.81),
    ) -> None:
        self.lengths = vector("lengths", lengths, None)
        n = self.rods = len(self.lengths)
        if not n:
            raise ModelError("a chain has one rod or more, got no lengths")
        self.masses = vector("masses", masses, n)
        self.gravity = vector("gravity", gravity, None)
        self.dimension = len(self.gravity)
        if self.dimension not in _MODULES:
            raise ModelError(f"gravity has 2 components in the plane or 3 in space, got {self.dimension}")
        self.centres = self.lengths / 2 if centres is None else vector("centres", centres, n)
        uniform = self.masses * self.lengths**2 / 12
        self.inertias = uniform if inertias is None else vector("inertias", inertias, n)
        points = 0.0 if point_masses is None else point_masses
        self.point_masses = vector("point_masses", points, n + 1)
        refuse("lengths", self.lengths <= 0, self.lengths, "more than zero: without length, no direction")
        for name in ("masses", "inertias", "point_masses"):
            refuse(name, getattr(self, name) < 0, getattr(self, name), "zero or more")
        self.pinned = bool(pinned)
        self._parents = tree(parents, n)
        self.parents = np.arange(n, dtype=np.intp) if self._parents is None else self._parents
        self._kernels = shipped_module(_MODULES[self.dimension])
        self._gather()

    def accelerations(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        *,
        along: ArrayLike | None = None,
        rates: ArrayLike | None = None,
        forces: ArrayLike | None = None,
        base: ArrayLike | None = None,
        refinements: int | None = None,
        threads: int | None = None,
    ) -> ChainMotion:
        """Return accelerations of all points, multipliers, tensions and the reaction at the base.

        Parameters
        ----------
        positions, velocities
            Of all points (n + 1, axes) [m, m/s]; velocities are zero by default. With one more axis in front,
            many chains at once, side by side.
        along, rates
            In their place: vectors of the rods from inner to outer point (n, axes) [m], and rates [m/s].
            They lose no digits far from the origin.
        forces
            Forces on the points besides gravity (n + 1, axes) [N].
        base
            Acceleration of a held base (axes) [m/s^2]; by default zero.
        refinements
            Steps of iterative refinement, up to 100; by default as many as cancellation asks for.
        threads
            Threads over many chains; by default one for each core. The result does not depend on it.

        Raises
        ------
        ModelError
            For wrong shapes, values that are not finite, or masses that leave a motion undetermined.
        """
        if refinements is not None and not 0 <= refinements <= 100:
            raise ModelError(f"expected between 0 and 100 refinements, got {refinements}")
        d = self._vectors("positions", positions, "along", along)
        if velocities is None and rates is None:
            w = np.zeros_like(d)
        else:
            w = self._vectors("velocities", velocities, "rates", rates)
        if d.shape != w.shape:
            raise ModelError(f"positions and velocities differ in shape: {d.shape} and {w.shape} by rods")
        batch = d.shape[:-2]
        force = self._force(forces, batch)
        start = np.zeros((*batch, self.dimension))
        if base is not None:
            if not self.pinned:
                raise ModelError("base gives the acceleration of a held base, and this one is free")
            start += vector("base", base, self.dimension)
        gamma = -np.einsum("...i,...i->...", w, w)
        solved = self._solve(d, gamma, force, start, -1 if refinements is None else refinements, threads)
        self._check(solved)
        return solved

    def kinetic_energy(self, velocities: ArrayLike) -> Array:
        """Return the kinetic energy [J] at velocities of the points (..., n + 1, axes) [m/s]."""
        return self._kinetic(self._points("velocities", velocities))

    def potential_energy(self, positions: ArrayLike) -> Array:
        """Return the potential energy [J] of gravity at positions (..., n + 1, axes) [m]."""
        return self._potential(self._points("positions", positions))

    def simulate(
        self,
        t_end: float,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        *,
        forces: ArrayLike | Callable[..., ArrayLike] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        samples: int | None = None,
        t_eval: ArrayLike | None = None,
        max_steps: int = 1_000_000_000,
        max_wall: float | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float = 10.0,
        resume: str | os.PathLike[str] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> ChainRun:
        """Run one chain, or many, by the integrators of all models; every step ends with lengths to rounding.

        The projection is the smallest change in the metric of the mass matrix, by the same elimination. The
        state is kept as rod vectors, so lengths keep their digits far from the origin. Many chains take the
        same steps, and the tolerance is that of their errors in the root mean square.

        Parameters
        ----------
        t_end
            Time to run [s].
        positions, velocities
            Start (n + 1, axes) [m, m/s], many chains with an axis in front.
        forces
            Forces on the points [N], or a function of time, positions and velocities that returns them.
        method, rtol, atol, step, samples, t_eval, max_steps
            As of :meth:`symgen.Model.simulate`: dop853 by default, with rtol = 1e-9 or a step [s].
            Implicit methods do not apply.
        max_wall, checkpoint, checkpoint_every, resume, progress
            As there. A run with a function for its forces is resumed with the same function.

        Raises
        ------
        ModelError
            For a start of wrong shape or lengths, and options out of range.
        SimulationError
            When the run cannot continue, or the wall time is spent; it carries the samples so far.
        """
        if method is not None and integrator(method).needs_tangent:
            raise ModelError(
                f"{method} is implicit and needs derivatives of the forces, which a chain has not\n"
                "  Choose dop853, dopri5, rk4 or rattle."
            )
        count = sample_count(samples, t_eval, 201)
        chosen = options(t_end, method, rtol, atol, step, count, max_steps)
        keep = keeping(checkpoint, checkpoint_every, resume)
        with limited(max_wall):
            self.accelerations(positions, velocities, forces=None if callable(forces) else forces)  # checks
            return run(self, positions, velocities, forces, chosen, t_eval, keep, progress)
