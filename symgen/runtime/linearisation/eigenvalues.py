"""Eigenvalues of small motions M y'' + C y' + K y = 0, whatever their damping and symmetry."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.arrays import Array, Indices

#: Squares of frequencies below this part of the largest one are numerically zero.
SMALL = 1e-12
#: Part of the root of the stiffness below which eigenvalues are those of motions that dampers slow down.
_SLOW = 0.1


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
        error[places] = np.abs(values[places]) ** 2 / min(unit, np.min(np.abs(values[places])))
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
