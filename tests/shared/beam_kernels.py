"""The compiled matrices of elements as arrays, and a plain assembly of one straight link from them."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from symgen.elements import ELEMENTS
from symgen.runtime.kernels.library import shipped_module

#: Coefficients of the section by name, in the order of the kernels.
SIZES = {"mass": 3, "rotary": 5, "axial": 3, "bending": 5, "shear": 3}
ROWS = ("u", "w", "slope", "rotation", "axial_strain", "curvature")


def arguments(length: float, **section) -> np.ndarray:
    """Arguments of a link's kernels: length and section, zero by default; one number is a uniform property."""
    found = [length]
    for name, size in SIZES.items():
        given = np.atleast_1d(section.get(name, 0.0))
        found += [*given, *np.zeros(size - len(given))]
    return np.array(found, dtype=float)


def moved(q: np.ndarray, start: float, length: float) -> np.ndarray:
    """Arguments of the part of a link that begins at ``start``."""
    found, at = [length], 1
    for size in SIZES.values():
        c = q[at : at + size]
        found += [sum(comb(k, j) * c[k] * start ** (k - j) for k in range(j, size)) for j in range(size)]
        at += size
    return np.array(found)


def matrix(name: str, kernel: str, q: np.ndarray) -> np.ndarray:
    n = len(ELEMENTS[name].dofs)
    found = getattr(shipped_module(f"element_{name}"), kernel)(q=q)
    return found.reshape(-1, n) if kernel == "load" else found.reshape(-1, n, n).squeeze()


def shape(name: str, q: np.ndarray, x: float) -> dict[str, np.ndarray]:
    found = shipped_module(f"element_{name}").shape(q=q, u=np.array([x]))
    return dict(zip(ROWS, found.reshape(len(ROWS), -1), strict=True))


@dataclass
class Link:
    """A straight link of n equal elements, all unknowns kept; ``at[node][dof]`` is the place of one."""

    at: list[dict[str, int]]
    along: list[int]  # all that stretch it
    mass: np.ndarray
    stiffness: np.ndarray
    centrifugal: np.ndarray
    stretching: np.ndarray  # for the axial force at its start and, times -omega^2, for what lies before

    def frequencies(self, held: list[int], omega2: float = 0.0, stiff: np.ndarray | None = None):
        """Angular frequencies with some unknowns held."""
        from scipy.linalg import eigh

        free = np.setdiff1d(np.arange(len(self.mass)), held)
        whole = self.stiffness - omega2 * self.centrifugal
        whole = whole if stiff is None else whole + stiff
        values = eigh(whole[np.ix_(free, free)], self.mass[np.ix_(free, free)], eigvals_only=True)
        return np.sqrt(np.abs(values))


def link(name: str, q: np.ndarray, n: int) -> Link:
    element, length = ELEMENTS[name], q[0] / n
    per, inner = len(element.node_dofs), len(element.inner_dofs)
    size = (n + 1) * per + n * inner
    mass, stiffness, centrifugal = (np.zeros((size, size)) for _ in range(3))
    stretching = np.zeros((2, size, size))
    for i in range(n):
        own = moved(q, i * length, length)
        first = i * (per + inner)
        second = first + per + inner
        dofs = np.array(
            [*range(first, first + per), *range(second, second + per), *range(first + per, second)]
        )
        where = np.ix_(dofs, dofs)
        still = own.copy()
        still[4:9] = 0
        mass[where] += matrix(name, "mass", own)
        centrifugal[where] += matrix(name, "mass", still)
        stiffness[where] += matrix(name, "stiffness", own)
        tension, inside, moment = matrix(name, "geometric", own)
        start = i * length
        before_moment = sum(c * start ** (k + 2) / (k + 2) for k, c in enumerate(q[1:4]))
        stretching[0][where] += tension
        stretching[1][where] += before_moment * tension + start * inside + moment
    at = [{d: i * (per + inner) + k for k, d in enumerate(element.node_dofs)} for i in range(n + 1)]
    names = [*element.node_dofs, *element.inner_dofs] * n + [*element.node_dofs]
    along = [i for i, dof in enumerate(names) if dof in ("u", "mid")]
    return Link(at, along, mass, stiffness, centrifugal, stretching)
