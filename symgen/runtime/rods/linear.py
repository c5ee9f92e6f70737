"""The equations of a model linearised about a pose at rest, on the motions that the constraints leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.constraints import Constraints

_EPS = float(np.finfo(float).eps)
#: Rank tolerance of the constraints, above the error with which poses meet them.
RANK = 1e-9
#: Squares of frequencies below this part of the largest one are numerically zero.
SMALL = 1e-12


@dataclass(frozen=True, slots=True)
class Linearised:
    """M y'' + C y' + K y = 0 with dq = Z y, the columns of ``basis`` Z spanning the free motions.

    ``multipliers`` are those of least norm that balance the forces, ``unbalanced`` is what no multipliers
    can balance [N], ``scale`` the largest of the forces and constraint forces it is left of [N], ``noise``
    the round-off of the forces, that of the positions times the stiffness included [N].
    """

    basis: Array
    mass: Array
    damping: Array
    stiffness: Array
    multipliers: Array
    unbalanced: Array
    scale: float
    noise: float

    @property
    def freedoms(self) -> int:
        """Number of free motions."""
        return self.basis.shape[1]

    def stability(self) -> str:
        """Return ``stable``, ``neutral`` or ``unstable``, by the squares of the undamped frequencies.

        That is the sign of the reduced stiffness when it is symmetric, and flutter is seen when it is not.
        """
        from scipy.linalg import eigvals

        squares = eigvals(self.stiffness, self.mass) if self.freedoms else np.ones(1)
        small = SMALL * float(np.max(np.abs(squares)))
        if np.any(squares.real < -small) or np.any(np.abs(squares.imag) > np.sqrt(SMALL) * np.abs(squares)):
            return "unstable"
        return "neutral" if np.any(squares.real <= small) else "stable"


class Statics:
    """Forces, stiffness and damping of a model at rest at one time."""

    def __init__(self, constraints: Constraints, statics: Evaluator, t: float) -> None:
        self.constraints, self.t, self._statics = constraints, t, statics
        self._rest = np.zeros(constraints.n)
        self._entries: dict[str, tuple[Indices, ...]] = {}

    def force(self, q: Array) -> Array:
        """Return the applied forces on the coordinates at rest [N]."""
        return self._statics("force", self.t, q, self._rest)

    def matrix(self, name: str, q: Array, multipliers: Array) -> Array:
        """Return ``mass_matrix``, ``stiffness`` or ``damping``, shape (n, n)."""
        n = self.constraints.n
        whole = np.zeros((n, n))
        info = self._statics.description.kernel(name)
        if info is None:  # all zero
            return whole
        work = np.zeros(self._statics.work_size + n + self.constraints.m + 1)
        work[n : n + self.constraints.m] = multipliers
        entries = self._statics(name, self.t, q, self._rest, work)
        if name not in self._entries:
            names = self.constraints.description.of_coordinates()
            places = np.array(info.blocks[0].places(names, names), dtype=np.intp).reshape(-1, 3)
            self._entries[name] = tuple(places.T)
        rows, columns, where = self._entries[name]
        whole[rows, columns] = entries[where]
        return whole

    def at(self, q: Array) -> Linearised:
        """Return the equations linearised at the pose q."""
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
        left, values, right = np.linalg.svd(jacobian)
        rank = int(np.count_nonzero(values > RANK * values.max(initial=0.0)))
        basis = right[rank:].T
        scaled = left[:, :rank] @ ((right[:rank] @ force) / values[:rank])
        multipliers = scaled / scale  # rows were divided by the scale, so multipliers carry it
        carried = jacobian.T @ scaled
        whole = [self.matrix(name, q, multipliers) for name in ("mass_matrix", "damping", "stiffness")]
        mass, damping, stiffness = (basis.T @ matrix @ basis for matrix in whole)
        size = float(max(np.max(np.abs(force), initial=0.0), np.max(np.abs(scaled), initial=0.0)))
        noise = 16 * _EPS * (size + float(np.max(np.abs(whole[2])) * np.max(np.abs(q))))
        unbalanced = force - carried
        return Linearised(basis, mass, damping, stiffness, multipliers, unbalanced, size, noise)
