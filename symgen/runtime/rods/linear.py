"""The equations of a model linearised about a pose at rest, on the motions that the constraints leave."""

from __future__ import annotations

import math

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.equilibrium import Linearised
from symgen.runtime.result.recording import nearest_turn, references_of
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.meshing import slips
from symgen.runtime.rods.poses import Poses, angles_in_loads

_EPS = float(np.finfo(float).eps)
#: Rank tolerance of the constraints, above the error with which poses meet them.
RANK = 1e-9


class Statics:
    """Forces, stiffness and damping of a model at rest at one time."""

    def __init__(
        self, constraints: Constraints, statics: Evaluator, t: float, references: Array | None
    ) -> None:
        self.constraints, self.t = constraints, t
        self._statics = statics
        self.hold(np.zeros(statics.description.windings) if references is None else references)
        self._rest, self._states = np.zeros(constraints.n), len(constraints.description.states)
        self._entries: dict[str, tuple[Indices, ...]] = {}
        metric = np.eye(constraints.n)
        if statics.has("metric"):
            metric = statics.blocks("metric", t, self._rest, self._rest)["metric"]
        #: Factor L of the metric L L^T of small motions, in which steps are measured, corrections least.
        self.root = np.asarray(np.linalg.cholesky(metric), dtype=float)

    def measured(self, change: Array) -> float:
        """Return the length of a change of the coordinates in the metric of small motions [m]."""
        return float(np.linalg.norm(change @ self.root))

    def turned(self, q: Array) -> Array:
        """Return the angles in loads [rad] at a pose, nearest to the references."""
        pose = Poses(np.array([self.t]), np.array([[q, self._rest, self._rest]]))
        return nearest_turn(angles_in_loads(self.constraints.evaluator, pose)[:, 0], self.references)

    def revolves(self, here: Array, there: Array) -> bool:
        """Return whether an angle in loads changes by more than a quarter revolution, or gears by a tooth."""
        change = np.abs(self.turned(there) - self.turned(here))
        states = np.array([[q, self._rest, self._rest] for q in (here, there)])
        if slips(self.constraints, Poses(np.full(2, self.t), states)):
            return True
        return bool(np.any(np.minimum(change, math.tau - change) > math.pi / 2))

    def count(self, q: Array) -> None:
        """Move the references of angles in loads along to a pose."""
        self.hold(references_of(self.turned(q)))

    def hold(self, references: Array) -> None:
        """Set the references of angles in loads [rad]."""
        self.references, self._statics = references, self._statics.holding(references)
        #: Kernels of the equations of motion.
        self.evaluator = self.constraints.evaluator.holding(references)

    def force(self, q: Array, rates: Array | None = None) -> Array:
        """Return the applied forces on the coordinates [N], by default at rest."""
        return self._statics("force", self.t, q, self.rates(q) if rates is None else rates)

    def rates(self, q: Array) -> Array:
        """Return rates at rest: those of integrals are first-order states, which ``q`` has in their place."""
        rates = self._rest.copy()
        first = len(rates) - self._states
        rates[first:] = q[first:]
        return rates

    def pose(self, q: Array, u: Array) -> Array:
        """Return coordinates with first-order states in the place of their integrals."""
        first = len(q) - self._states
        return np.concatenate([q[:first], u[first:]])

    def matrix(self, name: str, q: Array, multipliers: Array) -> Array:
        """Return ``mass_matrix``, ``stiffness`` or ``damping``, shape (n, n)."""
        n = self.constraints.n
        whole = np.zeros((n, n))
        info = self._statics.description.kernel(name)
        if info is None:  # all zero
            return whole
        work = np.zeros(self._statics.work_size + n + self.constraints.m + 1)
        work[n : n + self.constraints.m] = multipliers
        entries = self._statics(name, self.t, q, self.rates(q), work)
        if name not in self._entries:
            names = self.constraints.description.of_coordinates()
            places = np.array(info.blocks[0].places(names, names), dtype=np.intp).reshape(-1, 3)
            self._entries[name] = tuple(places.T)
        rows, columns, where = self._entries[name]
        whole[rows, columns] = entries[where]
        return whole

    def at(self, q: Array, in_motion: bool = False) -> Linearised:
        """Return the equations linearised at the pose q; ``in_motion``: with states as rates of integrals."""
        constraints = self.constraints
        force = self.force(q)
        if not np.all(np.isfinite(force)):
            raise ModelError(
                f"{constraints.description.name}: a force is not finite in a pose on the way to equilibrium"
            )
        scale = (
            constraints.evaluator("constraints", self.t, q, self._rest)[constraints.m : 2 * constraints.m]
            if constraints.m
            else self._rest[:0]
        )
        jacobian = constraints.jacobian(q, self.t)
        # Over the factor of the metric: nothing depends on the points that carry a body.
        left, values, right = np.linalg.svd(np.linalg.solve(self.root, jacobian.T).T)
        rank = int(np.count_nonzero(values > RANK * values.max(initial=0.0)))
        basis = np.linalg.solve(self.root.T, right[rank:].T)
        scaled = left[:, :rank] @ ((right[:rank] @ np.linalg.solve(self.root, force)) / values[:rank])
        multipliers = scaled / scale  # rows were divided by the scale, so multipliers carry it
        carried = jacobian.T @ scaled
        whole = [self.matrix(name, q, multipliers) for name in ("mass_matrix", "damping", "stiffness")]
        damped = np.isfinite(whole[1])
        whole[1][~damped] = 0.0
        if self._states and not in_motion:
            whole[2][:, -self._states :] = whole[1][:, -self._states :]
            whole[1][:, -self._states :] = 0.0
        mass, damping, stiffness = (basis.T @ matrix @ basis for matrix in whole)
        stiffness[np.abs(stiffness) <= 16 * _EPS * np.max(np.abs(whole[2]), initial=0.0)] = 0.0
        size = float(max(np.max(np.abs(force), initial=0.0), np.max(np.abs(scaled), initial=0.0)))
        noise = 16 * _EPS * (size + float(np.max(np.abs(whole[2])) * np.max(np.abs(q))))
        unbalanced = force - carried
        return Linearised(
            basis, mass, damping, stiffness, multipliers, unbalanced, size, noise, bool(np.all(damped)),
            self._states if in_motion else 0,
        )  # fmt: skip
