"""The equations of a model linearised about a pose at rest, on the motions that the constraints leave."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.result.recording import nearest_turn
from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.poses import Poses, angles_in_loads, references_of

_EPS = float(np.finfo(float).eps)
#: Rank tolerance of the constraints, above the error with which poses meet them.
RANK = 1e-9
#: Squares of frequencies below this part of the largest one are numerically zero.
SMALL = 1e-12
#: Part of the root of the stiffness below which eigenvalues are those of motions that dampers slow down.
_SLOW = 0.1


@dataclass(frozen=True, slots=True)
class Linearised:
    """M y'' + C y' + K y = 0 with dq = Z y, the columns of ``basis`` Z spanning the free motions.

    They are orthonormal in the metric of small motions. ``multipliers`` are those of minimum norm that
    balance the forces, ``unbalanced`` is the rest that they cannot [N], ``scale`` the largest of the forces
    and constraint forces it is left of [N], ``noise`` the round-off of the forces, that of the positions
    times the stiffness included [N]. ``damped`` tells whether the damping of every force exists: forces
    without a slope by velocities at rest, such as with the root of a squared speed, have none in ``damping``.
    """

    basis: Array
    mass: Array
    damping: Array
    stiffness: Array
    multipliers: Array
    unbalanced: Array
    scale: float
    noise: float
    damped: bool = True

    @property
    def freedoms(self) -> int:
        """Number of free motions."""
        return self.basis.shape[1]

    def eigenvalues(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the eigenvalues [1/s], one per mode, and the motions y of unit modal mass as columns.

        Raises
        ------
        ModelError
            If a force has no slope by velocities at rest.
        """
        if not self.damped:
            raise ModelError(
                "there are no modes: the damping of a force is not defined at rest, such as that of a force "
                "with sqrt(speed^2)\n  Write the force with abs(speed) or sign(speed)."
            )
        return eigenvalues(self.mass, self.stiffness, self.damping)

    def stability(self) -> str:
        """Return ``unstable`` if a mode grows, ``neutral`` if no force drives one back, or ``stable``."""
        values = eigenvalues(self.mass, self.stiffness, self.damping)[0]
        if np.any(values.real > 0.0):
            return "unstable"
        return "neutral" if np.any(values == 0.0) else "stable"


class Statics:
    """Forces, stiffness and damping of a model at rest at one time."""

    def __init__(
        self, constraints: Constraints, statics: Evaluator, t: float, references: Array | None
    ) -> None:
        self.constraints, self.t = constraints, t
        self._hold(statics, np.zeros(statics.description.windings) if references is None else references)
        self._rest = np.zeros(constraints.n)
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
        """Return whether an angle in loads changes by more than a quarter revolution between two poses."""
        change = np.abs(self.turned(there) - self.turned(here))
        return bool(np.any(np.minimum(change, math.tau - change) > math.pi / 2))

    def count(self, q: Array) -> None:
        """Move the references of angles in loads along to a pose."""
        self._hold(self._statics, references_of(self.turned(q)))

    def _hold(self, statics: Evaluator, references: Array) -> None:
        self.references, self._statics = references, statics.holding(references)
        #: Kernels of the equations of motion.
        self.evaluator = self.constraints.evaluator.holding(references)

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
        mass, damping, stiffness = (basis.T @ matrix @ basis for matrix in whole)
        stiffness[np.abs(stiffness) <= 16 * _EPS * np.max(np.abs(whole[2]), initial=0.0)] = 0.0
        size = float(max(np.max(np.abs(force), initial=0.0), np.max(np.abs(scaled), initial=0.0)))
        noise = 16 * _EPS * (size + float(np.max(np.abs(whole[2])) * np.max(np.abs(q))))
        unbalanced = force - carried
        return Linearised(
            basis, mass, damping, stiffness, multipliers, unbalanced, size, noise, bool(np.all(damped))
        )


def eigenvalues(mass: Array, stiffness: Array, damping: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the eigenvalues s [1/s] of M s^2 + C s + K, and their motions of unit modal mass as columns.

    Growing ones are first, the others follow by rising modulus. Of each conjugate pair there is that with a
    positive imaginary part; without damping there is one per freedom, of each pair s, -s the growing one. The
    motions are real and orthogonal where the matrices are symmetric, without damping.
    """
    if not len(mass):
        return np.zeros(0), np.zeros((0, 0))
    root = np.asarray(np.linalg.cholesky(mass), dtype=float)
    stiffness, damping = (_congruent(root, matrix) for matrix in (stiffness, damping))
    if np.any(damping):
        values, shapes = _damped(stiffness, damping)
    elif np.max(np.abs(stiffness - stiffness.T)) <= 1e-10 * np.max(np.abs(stiffness)):
        squares, shapes = np.linalg.eigh((stiffness + stiffness.T) / 2)
        small = SMALL * np.max(np.abs(squares))
        squares = np.where(np.abs(squares) <= small, 0.0, squares)
        values = np.where(squares < 0, 1.0, 1j) * np.sqrt(np.abs(squares))
    else:
        values, shapes = _circulatory(stiffness)
    order = in_order(values)
    return values[order], np.linalg.solve(root.T, shapes[:, order])


def in_order(values: NDArray[Any]) -> Indices:
    """Return the places of eigenvalues in their order: growing ones first, then by rising modulus."""
    return np.lexsort((values.real, np.abs(values), values.real <= 0.0))


def oscillating(values: NDArray[Any]) -> Indices:
    """Return the places of the eigenvalues that oscillate, growing or not, by rising modulus."""
    places = np.flatnonzero(values.imag)
    return places[np.argsort(np.abs(values[places]), kind="stable")]


def _congruent(root: Array, matrix: Array) -> Array:
    """Return L^-1 A L^-T."""
    half = np.linalg.solve(root, matrix)
    return np.linalg.solve(root, half.T).T


def _circulatory(stiffness: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return eigenvalues and unit shapes of y'' + K y = 0 with any K: s^2 is an eigenvalue of -K."""
    squares, shapes = np.linalg.eig(stiffness)
    squares = squares.astype(complex)
    squares[np.abs(squares) <= SMALL * np.max(np.abs(squares))] = 0.0
    equal = np.abs(squares.imag) <= np.sqrt(SMALL) * np.abs(squares)  # round-off parts equal squares so far
    values = np.sqrt(-np.where(equal, squares.real + 0j, squares))
    # Flutter: of the squares a, a* one gives s that grows, the other -s* that decays.
    return np.where(values.imag < 0.0, -values, values), shapes.astype(complex)


def _damped(stiffness: Array, damping: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return eigenvalues and unit shapes of y'' + C y' + K y = 0, one of each conjugate pair.

    Time is scaled, so that both blocks of the first-order form are of one size. Strong damping slows motions
    down to eigenvalues that are lost on this scale: they are those of the inverse.
    """
    from scipy.linalg import eig

    k = len(stiffness)
    of_stiffness, of_damping = (float(np.linalg.norm(a, 2)) for a in (stiffness, damping))
    rate = max(np.sqrt(of_stiffness), of_damping)
    free, still = _unresisted(stiffness, damping)
    values, vectors = eig(np.block([[np.zeros((k, k)), np.eye(k)], [-stiffness / rate**2, -damping / rate]]))
    order = np.argsort(np.abs(values), kind="stable")
    values, vectors, error = values[order] * rate, vectors[:k, order], np.full(2 * k, rate)
    slow = int(np.searchsorted(np.abs(values), _SLOW * np.sqrt(of_stiffness)))
    while 0 < slow < 2 * k and np.abs(values[slow]) < 1.001 * np.abs(values[slow - 1]):
        slow += 1  # not between two of a pair
    if slow > still == free.shape[1]:
        places, unit = slice(still, slow), of_stiffness / of_damping
        scaled = stiffness / of_stiffness, damping / of_damping, unit / of_damping
        inverses, rates = _slow(*scaled, free)
        order = np.argsort(-np.abs(inverses), kind="stable")[: slow - still]
        values[places], vectors[:, places] = unit / inverses[order], rates[:, order]
        error[places] = np.abs(values[places]) ** 2 / unit
    values[:still] = 0.0
    values = np.where(np.abs(values.imag) <= np.sqrt(SMALL) * np.abs(values), values.real, values)
    steady = (values.imag != 0.0) & (np.abs(values.real) <= 1e-13 * error)
    values = np.where(steady, 1j * values.imag, values)
    keep = values.imag >= 0.0
    return values[keep], vectors[:, keep] / np.linalg.norm(vectors[:, keep], axis=0)


def _unresisted(stiffness: Array, damping: Array) -> tuple[Array, int]:
    """Return the motions without stiffness as columns, and the number of zero eigenvalues.

    A motion without stiffness has one, or two if nothing damps it.
    """
    left, sizes, right = np.linalg.svd(stiffness)
    rank = int(np.count_nonzero(sizes > SMALL * sizes[0]))
    resisted = np.linalg.svd(left[:, rank:].T @ damping @ right[rank:].T, compute_uv=False)
    damped = np.count_nonzero(resisted > SMALL * np.max(np.abs(damping)))
    return right[rank:].T, int(2 * len(resisted) - damped)


def _slow(stiffness: Array, damping: Array, mass: float, free: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the inverses of the eigenvalues but zero of m y'' + C y' + K y = 0, and the rates y' of each.

    ``free`` are the motions without stiffness, whose places no force depends on.
    """
    k, held = len(stiffness), np.linalg.qr(free, mode="complete")[0][:, free.shape[1] :]
    n = held.shape[1]
    first = np.block([[np.zeros((n, n)), held.T], [-stiffness @ held, -damping]])
    inverses, states = np.linalg.eig(np.linalg.solve(first, np.diag(np.repeat([1.0, mass], [n, k]))))
    return inverses, states[n:]
