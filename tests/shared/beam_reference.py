"""Elements by Gauss quadrature of shape functions found numerically: independent of the derived kernels.

In Timoshenko's element of uniform section, equilibrium determines both shear strains; the derived element
equals it after condensation of its shear unknowns.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial as P
from numpy.polynomial.legendre import leggauss

POINTS = 14


def _hermite(L, derivatives):
    """Polynomials that have one derivative 1 at one end and all others 0."""
    k = derivatives
    powers = [P([0] * i + [1]) for i in range(2 * k)]
    rows = [[p.deriv(d)(x) if d else p(x) for p in powers] for x in (0.0, 1.0) for d in range(k)]
    inverse = np.linalg.inv(np.array(rows))
    found = []
    for i in range(2 * k):
        unit = P(inverse[:, i])
        found.append(unit(P([0, 1 / L])) * L ** (i % k))
    return found


def shapes(name, q):
    """Nu, Nw, Nphi as lists of polynomials in x from the first node."""
    L = q[0]
    zero = P([0.0])
    first, second = P([1, -1 / L]), P([0, 1 / L])
    if name == "timoshenko":
        phi = 12 * q[12] / (q[17] * L**2)  # uniform, or the value of the first node
        s = P([0, 1 / L])
        c = 1 / (1 + phi)
        w = [
            c * (1 + phi - phi * s - 3 * s**2 + 2 * s**3),
            c * L * ((1 + phi / 2) * s - (2 + phi / 2) * s**2 + s**3),
            c * (phi * s + 3 * s**2 - 2 * s**3),
            c * L * (-(phi / 2) * s + (phi / 2 - 1) * s**2 + s**3),
        ]
        r = [
            c * 6 / L * (s**2 - s),
            c * (1 + phi - (4 + phi) * s + 3 * s**2),
            c * 6 / L * (s - s**2),
            c * (3 * s**2 - (2 - phi) * s),
        ]
        return (
            [first, zero, zero, second, zero, zero],
            [zero, w[0], w[1], zero, w[2], w[3]],
            [zero, r[0], r[1], zero, r[2], r[3]],
        )
    k = 2 if name == "cubic" else 3
    h = _hermite(L, k)
    nu = [first, *[zero] * k, second, *[zero] * k]
    nw = [zero, *h[:k], zero, *h[k:]]
    if name == "beam9":
        s = P([0, 1 / L])
        nu = [1 - 3 * s + 2 * s**2, *[zero] * k, 2 * s**2 - s, *[zero] * k, 4 * s * (1 - s)]
        nw = [*nw, zero]
    return nu, nw, [p.deriv() for p in nw]


class Reference:
    """The matrices of an element for arguments ``q`` of its kernels, flat; ``shape`` at u[0]."""

    @staticmethod
    def _rows(element, q, x):
        nu, nw, phi = shapes(element, q)
        return np.array(
            [
                [p(x) for p in nu],
                [p(x) for p in nw],
                [p.deriv()(x) for p in nw],
                [p(x) for p in phi],
                [p.deriv()(x) for p in nu],
                [p.deriv()(x) for p in phi],
            ]
        )

    def _sum(self, element, q, f):
        points, weights = leggauss(POINTS)
        L = q[0]
        return sum(
            L / 2 * w * f(x, *self._rows(element, q, x))
            for x, w in zip(L / 2 * (1 + points), weights, strict=True)
        )

    @staticmethod
    def _section(element, q):
        m, j, a, b, s = P(q[1:4]), P(q[4:9]), P(q[9:12]), P(q[12:17]), P(q[17:20])
        if element not in ("rayleigh", "timoshenko"):
            j = P([0.0])
        if element != "timoshenko":
            s = P([0.0])
        return m, j, a, b, s

    def mass(self, element, q):
        m, j, *_ = self._section(element, q)
        o = np.outer
        return self._sum(
            element, q, lambda x, u, w, dw, p, du, c: m(x) * (o(u, u) + o(w, w)) + j(x) * o(p, p)
        ).ravel()

    def gyroscopic(self, element, q):
        m = self._section(element, q)[0]
        return self._sum(element, q, lambda x, u, w, *_: m(x) * (np.outer(u, w) - np.outer(w, u))).ravel()

    def stiffness(self, element, q):
        _, _, a, b, s = self._section(element, q)
        o = np.outer
        return self._sum(
            element,
            q,
            lambda x, u, w, dw, p, du, c: a(x) * o(du, du) + b(x) * o(c, c) + s(x) * o(dw - p, dw - p),
        ).ravel()

    def geometric(self, element, q):
        m = self._section(element, q)[0]
        before, moment = m.integ(), (m * P([0, 1])).integ()
        return np.array(
            [
                self._sum(element, q, lambda x, u, w, dw, *_, f=f: f(x) * np.outer(dw, dw))
                for f in (P([1.0]), before, moment)
            ]
        ).ravel()

    def load(self, element, q):
        m, j, *_ = self._section(element, q)
        return self._sum(
            element,
            q,
            lambda x, u, w, dw, p, du, c: np.array(
                [m(x) * u, m(x) * w, m(x) * x * u, m(x) * x * w + j(x) * p]
            ),
        ).ravel()

    def shape(self, element, q, u):
        return self._rows(element, q, u[0]).ravel()
