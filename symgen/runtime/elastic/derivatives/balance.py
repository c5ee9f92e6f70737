"""The implicit function of the equations of elastic links, in a pose at rest or in all poses of a revolution.

Rates S' and S'' are those of S in the poses multiplied by a matrix, which is zero at rest. Displacements with

    M S'' + C S' + K S + J^T mu = Q,   J S = 0

have differentials by the same system, where dM and others are tangents along a parameter and the matrix is in
proportion to 1/T:

    M dS'' + C dS' + K dS + J^T dmu = dQ - dM S'' - dC S' - dK S - dJ^T mu + (dT/T) (2 M S'' + C S'),
    J dS = -dJ S.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.elastic.derivatives.matrices import Assembled
from symgen.runtime.kernels.evaluate import UNIT

#: Numbers in long double.
Wide = NDArray[Any]

#: Solutions with one factorisation, each for the residual of those before it in long double.
_REFINED = 3


class Balance:
    """Displacements in poses, and their differentials.

    Parameters
    ----------
    matrices
        Equations in the poses; numbers may have tangents.
    rate
        First derivative by the time of values in the poses, (poses, poses) [1/s].
    """

    def __init__(self, matrices: Sequence[Assembled], rate: Wide) -> None:
        from scipy.linalg import lu_factor

        self.rate = rate
        mass, damping, stiffness, self.bound = (
            np.array([getattr(x, name).real for x in matrices], np.longdouble)
            for name in ("mass", "damping", "stiffness", "bound")
        )
        self._matrices = np.array([stiffness, damping, mass])
        count, m, n = self.bound.shape
        sizes = np.sqrt(np.max(np.abs(np.diagonal(stiffness, axis1=1, axis2=2)), axis=0)).astype(float)
        #: Square roots of the stiffness of each unknown.
        self.sizes = sizes = np.where(sizes > 0.0, sizes, 1.0)
        self._weights = np.max(np.abs(self.bound / sizes), axis=2, initial=0.0)
        scaled = self.bound / sizes / self._weights[:, :, None]
        system = np.zeros((count, n + m, count, n + m))
        first, second = rate.astype(float), (rate @ rate).astype(float)
        both = np.outer(sizes, sizes)
        for k in range(count):
            of_rates = np.multiply.outer((damping[k] / both).astype(float), first[k])
            of_rates += np.multiply.outer((mass[k] / both).astype(float), second[k])
            system[k, :n, :, :n] = of_rates.transpose(0, 2, 1)
            system[k, :n, k, :n] += stiffness[k] / both
            system[k, :n, k, n:], system[k, n:, k, :n] = scaled[k].T, scaled[k]
        self._factors = lu_factor(system.reshape(count * (n + m), -1), overwrite_a=True)
        #: S (poses, unknowns), and mu (poses, constraints).
        self.state = self._solved(np.array([x.load.real for x in matrices]), np.zeros((count, m)))

    def differential(self, along: Sequence[Assembled], longer: float = 0.0) -> Wide:
        """Return dS (poses, unknowns) for matrices with tangents along a parameter, and ``longer``, dT/T."""
        places, mu = self.state
        rates = self.rate @ places
        second = self.rate @ rates
        load, opened = [], []
        for k, x in enumerate(along):
            force = x.load.imag - x.mass.imag @ second[k] - x.damping.imag @ rates[k]
            load.append((force - x.stiffness.imag @ places[k] - x.bound.imag.T @ mu[k]) / UNIT)
            opened.append(-x.bound.imag @ places[k] / UNIT)
        slower = longer * self._forces(0.0 * places, rates, 2 * second)
        return self._solved(np.array(load) + slower, np.array(opened))[0]

    def _forces(self, places: Wide, rates: Wide, second: Wide) -> Wide:
        """Return forces M S'' + C S' + K S in the poses."""
        return np.einsum("okij,okj->ki", self._matrices, np.array([places, rates, second]))

    def _solved(self, forces: Wide, opened: Wide) -> tuple[Wide, Wide]:
        """Return S and mu for forces (poses, unknowns), and J S (poses, constraints)."""
        from scipy.linalg import lu_solve

        s, mu = np.zeros(forces.shape, np.longdouble), np.zeros(opened.shape, np.longdouble)
        for _ in range(_REFINED):
            rates = self.rate @ s
            left = forces - self._forces(s, rates, self.rate @ rates)
            left = left - _times(self.bound.transpose(0, 2, 1), mu)
            right = np.hstack([left / self.sizes, (opened - _times(self.bound, s)) / self._weights])
            x = lu_solve(self._factors, right.astype(float).ravel()).reshape(len(right), -1)
            s, mu = s + x[:, : len(self.sizes)] / self.sizes, mu + x[:, len(self.sizes) :] / self._weights
        return s, mu


def _times(matrices: Wide, rows: Wide) -> Wide:
    return np.einsum("kij,kj->ki", matrices, rows)
