"""Shipped linkages with elastic links in space from the energies of their elements, in 40 digits.

Nothing is of symgen. A node has a position r and directors d1, d2, d3. An element of length L has the chord
c = (r' - r)/L, its sines c.d2, c.d3 at both nodes, and the sine t of twist (d3.d2' - d2.d3')/2. A sine p of a node
with the sines p, s has the angle p (1 - (c.c - 1)/2 + (p^2 + s^2)/6). With the angles z, z' and y, y' of both planes,
m = (z' - z)(1 + t^2/12), n = (y' - y)(1 + t^2/12) and w = (EI_z - EI_y) m n/(GJ + (EI_z n^2 + EI_y m^2)/12), the
energy is that of

    strain      (c.c - 1)/2 + sum of (2 a^2 - a b + 2 b^2)/30 over both planes                   EA L
    bending     m - w n/12, n + w m/12; z + z' + t (y - y')/3, y + y' + t (z' - z)/3             EI/L; 3 EI/L
    twist       t + t^3/6 + z y' - y z'; w                                                       GJ/L; GJ/(12 L)

each over two, with stresses by strains and by their rates times ``tau``. The kinetic energy is that of Hermite's
cubic through r and d1, and of fibres on linear d2 and d3. Joints and directors are constraints.

A run takes the steps of Gauss' method with four stages, M a + F(q, v) + J^T lambda = 0 and J v + Phi_t = 0 at
the stages, and projects places and rates on the constraints with M and with J at the end: the time
discretisation is that of symgen, in decimal numbers of ``DIGITS`` digits. Derivatives are differences of two
runs, a parameter apart by ``CHANGE`` of its value.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import mpmath as mp
import numpy as np

DIGITS, CHANGE, CLOSE = 100, "1e-42", 86
#: Time of the runs [s], and steps.
END, STEPS = 5e-4, 4
MODES = 6
#: Corrections in floats, before those in decimal numbers.
_ROUGH = 8
Array = Any


@dataclass(frozen=True)
class Link:
    """An elastic link: its ends, direction of the width, and section; values are mpmath numbers."""

    first: list[Any]
    last: list[Any]
    rates: tuple[list[Any], list[Any]]
    density: Any
    width: Any
    thickness: Any
    modulus: Any
    elements: int = 4

    @property
    def length(self) -> Any:
        return mp.norm(mp.matrix(self.last) - mp.matrix(self.first))

    def directors(self) -> list[mp.matrix]:
        """d1, d2 towards the z axis, d3."""
        along = (mp.matrix(self.last) - mp.matrix(self.first)) / self.length
        wide = mp.matrix([0, 0, 1])
        wide = wide - (wide.T * along)[0] * along
        wide = wide / mp.norm(wide)
        return [along, wide, cross(along, wide)]

    def section(self) -> list[Any]:
        """L of an element, mu, J of fibres on d2 and d3, EA, EI about z and y, GJ; Poisson's ratio is 0.3."""
        w, h, e = self.width, self.thickness, self.modulus
        a, b = max(w, h), min(w, h)
        series = mp.nsum(lambda n: mp.tanh((2 * n + 1) * mp.pi * a / b / 2) / (2 * n + 1) ** 5, [0, mp.inf])
        torsion = a * b**3 * (mp.mpf(1) / 3 - 64 / mp.pi**5 * b / a * series)
        of_z, of_y = h * w**3 / 12, w * h**3 / 12
        rho = self.density
        return [self.length / self.elements, rho * w * h, rho * of_z, rho * of_y, e * w * h, e * of_z, e * of_y,
                e / mp.mpf("2.6") * torsion]  # fmt: skip


def cross(a: Any, b: Any) -> mp.matrix:
    """The vector product."""
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class Linkage:
    """The equations of elastic links with joints; nodes are counted along the links."""

    def __init__(self, links: list[Link], masses: dict[int, Any], tau: Any) -> None:
        self.links, self.tau = links, tau
        self.nodes = sum(link.elements + 1 for link in links)
        n = self.size = 12 * self.nodes
        self.mass, sections, self.first = mp.zeros(n, n), [], []
        self.start, self.rates = [mp.mpf(0)] * n, [mp.mpf(0)] * n
        self.own: list[list[mp.matrix]] = []
        node = 0
        for link in links:
            numbers, directors = link.section(), link.directors()
            apart = (mp.matrix(link.rates[1]) - mp.matrix(link.rates[0])) / link.length
            turning = cross(directors[0], apart)
            for k in range(link.elements + 1):
                share, at = mp.mpf(k) / link.elements, 12 * (node + k)
                for i in range(3):
                    self.start[at + i] = (1 - share) * link.first[i] + share * link.last[i]
                    self.rates[at + i] = (1 - share) * link.rates[0][i] + share * link.rates[1][i]
                for j, d in enumerate(directors, 1):
                    self.start[at + 3 * j : at + 3 * j + 3] = [*d]
                    self.rates[at + 3 * j : at + 3 * j + 3] = [*cross(turning, d)]
                self.own.append(directors)
                if k < link.elements:
                    self.first.append(node + k)
                    sections.append(numbers)
                    self._add_mass(12 * (node + k), numbers)
            node += link.elements + 1
        for at, m in masses.items():
            for i in range(3):
                self.mass[12 * at + i, 12 * at + i] += m
        self.sections = mp.matrix(sections)
        #: Linear constraints: unknowns with factors, and value and rate as functions of the time.
        self.linear: list[tuple[dict[int, int], Callable[[Any], tuple[Any, Any]]]] = []
        #: Products a.b = value: two maps from unknowns to a vector, (3, n), and two constant vectors.
        self.products: list[tuple[dict[int, Any], Any, dict[int, Any], Any, Any]] = []
        for node in range(self.nodes):
            for i in range(3):
                for j in range(i, 3):
                    half = mp.mpf(1) / (2 if i == j else 1)
                    a, b = ({12 * node + 3 * (k + 1): x} for k, x in ((i, half), (j, mp.mpf(1))))
                    self.products.append((a, None, b, None, half if i == j else 0))

    def _add_mass(self, at: int, numbers: list[Any]) -> None:
        length, mu, of_d2, of_d3 = numbers[:4]
        own = [[156, 22 * length, 54, -13 * length], [22 * length, 4 * length**2, 13 * length, -3 * length**2],
               [54, 13 * length, 156, -22 * length], [-13 * length, -3 * length**2, -22 * length, 4 * length**2]]  # fmt: skip
        places = [at, at + 3, at + 12, at + 15]
        for i in range(3):
            for a, row in zip(places, own, strict=True):
                for b, x in zip(places, row, strict=True):
                    self.mass[a + i, b + i] += mu * length / 420 * x
            for shift, inertia in ((6, of_d2), (9, of_d3)):
                for a in (at, at + 12):
                    for b in (at, at + 12):
                        part = inertia * length / (3 if a == b else 6)
                        self.mass[a + shift + i, b + shift + i] += part

    def pin(self, node: int, motion: Callable[[Any], tuple[list[Any], list[Any]]]) -> None:
        """Prescribe the position of a node by a function that returns it and its rate."""
        for i in range(3):
            self.linear.append(({12 * node + i: 1}, lambda t, i=i: tuple(x[i] for x in motion(t))))

    def join(self, one: int, other: int) -> None:
        """Join the positions of two nodes."""
        for i in range(3):
            self.linear.append(({12 * one + i: 1, 12 * other + i: -1}, lambda _: (0, 0)))

    def across(self, node: int, a: Any, b: Any, other: int | None) -> None:
        """Keep a direction fixed in a node across one fixed in another, or in the ground."""

        def fixed(node: int, direction: Any) -> dict[int, Any]:
            return {12 * node + 3 * k: (d.T * direction)[0] for k, d in enumerate(self.own[node], 1)}

        if other is None:
            self.products.append((fixed(node, a), None, {}, b, 0))
        else:
            self.products.append((fixed(node, a), None, fixed(other, b), None, 0))

    def revolute(self, node: int, axis: Any, other: int | None = None) -> None:
        """Keep an axis fixed in a node parallel to one fixed in another, or in the ground."""
        one = cross(axis, [1, 0, 0])
        for normal in (one, cross(axis, one)):
            self.across(node, normal, axis, other)


@dataclass(frozen=True)
class Slope:
    """A number with its slopes by the six invariants of an element."""

    value: Any
    by: list[Any]

    def __add__(self, other: Any) -> Slope:
        if not isinstance(other, Slope):
            return Slope(self.value + other, self.by)
        return Slope(self.value + other.value, [x + y for x, y in zip(self.by, other.by, strict=True)])

    def __mul__(self, other: Any) -> Slope:
        if not isinstance(other, Slope):
            return Slope(self.value * other, [x * other for x in self.by])
        pairs = zip(self.by, other.by, strict=True)
        return Slope(self.value * other.value, [x * other.value + self.value * y for x, y in pairs])

    __radd__, __rmul__ = __add__, __mul__

    def __sub__(self, other: Any) -> Slope:
        return self + other * -1

    def __truediv__(self, other: Any) -> Slope:
        if not isinstance(other, Slope):
            return Slope(self.value / other, [x / other for x in self.by])
        ratio = self.value / other.value
        pairs = zip(self.by, other.by, strict=True)
        return Slope(ratio, [(x - ratio * y) / other.value for x, y in pairs])


def strains(
    invariants: list[Slope], length: Any, axial: Any, about_z: Any, about_y: Any, torsion: Any
) -> list[tuple[Slope, Any]]:
    """Strains of an element by its stretch, four sines and sine of twist, with their stiffnesses."""
    stretch, z1, z2, y1, y2, t = invariants
    first, last = (stretch * -1 + 1 + (z * z + y * y) / 6 for z, y in ((z1, y1), (z2, y2)))
    z1, y1, z2, y2 = z1 * first, y1 * first, z2 * last, y2 * last
    bows = ((a * a * 2 - a * b + b * b * 2) / 30 for a, b in ((z1, z2), (y1, y2)))
    turned = t * t / 12 + 1
    z, y = (z2 - z1) * turned, (y2 - y1) * turned
    of_twist = z * y * (about_z - about_y) / ((y * y * about_z + z * z * about_y) / 12 + torsion)
    return [
        (stretch + sum(bows, stretch * 0), axial * length),
        (z - of_twist * y / 12, about_z / length),
        (z1 + z2 + t * (y1 - y2) / 3, 3 * about_z / length),
        (y + of_twist * z / 12, about_y / length),
        (y1 + y2 + t * (z2 - z1) / 3, 3 * about_y / length),
        (t + t * t * t / 6 + z1 * y2 - y1 * z2, torsion / length),
        (of_twist, torsion / (12 * length)),
    ]


class Numbers:
    """The same equations for arrays of floats, complex numbers or decimal numbers."""

    def __init__(self, of: Linkage, number: Callable[[Any], Any], kind: Any) -> None:
        def array(values: Any) -> Array:
            return np.array([number(x) for x in values], dtype=kind)

        n, self.of, self.number, self.kind = of.size, of, number, kind
        self.mass = array(of.mass).reshape(n, n)
        self.section = array(of.sections).reshape(-1, 8).T
        self.tau, self.start, self.rate = number(of.tau), array(of.start), array(of.rates)
        self.nodes = np.array(of.first)
        zero = number(mp.mpf(0))
        self.linear = np.full((len(of.linear), n), zero, kind)
        for row, (factors, _) in zip(self.linear, of.linear, strict=True):
            for place, x in factors.items():
                row[place] = number(mp.mpf(x))
        count = len(of.products)
        self.left, self.right = np.full((2, count, 3, n), zero, kind)
        self.fixed_left, self.fixed_right = np.full((2, count, 3), zero, kind)
        self.values = array([mp.mpf(row[-1]) for row in of.products])
        sides = ((self.left, self.fixed_left, 0), (self.right, self.fixed_right, 2))
        for k, row in enumerate(of.products):
            for maps, constants, i in sides:
                for place, factor in row[i].items():
                    for axis in range(3):
                        maps[k, axis, place + axis] = number(factor)
                if row[i + 1] is not None:
                    constants[k] = array([*row[i + 1]])

    def given(self, t: Any) -> tuple[Array, Array]:
        """Values and rates of the linear constraints at a time, an mpmath number."""
        rows = [motion(t) for _, motion in self.of.linear]
        found = np.array([[self.number(mp.mpf(x)) for x in row] for row in rows], self.kind)
        return found[:, 0], found[:, 1]

    def forces(self, q: Array, v: Array) -> Array:
        """Forces of the elements, (..., n), at places and rates (..., n)."""
        length, *_, axial, about_z, about_y, torsion = self.section
        shape = (*q.shape[:-1], -1, 4, 3)
        (r, _, d2, d3), (s, _, e2, e3), (vr, _, v2, v3), (vs, _, w2, w3) = (
            np.moveaxis(x.reshape(shape)[..., self.nodes + k, :, :], -2, 0) for x in (q, v) for k in (0, 1)
        )
        c, vc = (s - r) / length[:, None], (vs - vr) / length[:, None]

        def dot(a: Array, b: Array) -> Array:
            return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]

        two = self.number(mp.mpf(2))
        places = [(dot(c, c) - 1) / two, dot(c, d2), dot(c, e2), dot(c, d3), dot(c, e3)]
        places.append((dot(e2, d3) - dot(e3, d2)) / two)
        rates = [dot(vc, x) + dot(c, y) for x, y in ((d2, v2), (e2, w2), (d3, v3), (e3, w3))]
        rates = [dot(c, vc), *rates, (dot(w2, d3) + dot(e2, v3) - dot(w3, d2) - dot(e3, v2)) / two]
        one, zero = places[0] * 0 + 1, places[0] * 0
        given = [Slope(x, [one if k == i else zero for k in range(6)]) for i, x in enumerate(places)]
        on = [zero] * 6
        for strain, stiffness in strains(given, length, axial, about_z, about_y, torsion):
            rate = sum((s * x for s, x in zip(strain.by, rates, strict=True)), zero)
            stress = stiffness * (strain.value + self.tau * rate)
            on = [x + stress * s for x, s in zip(on, strain.by, strict=True)]
        normal, on = on[0], on[1:]
        f1, f2, f3, f4, half = (x[..., None] for x in (*on[:4], on[4] / two))
        on_chord = (normal[..., None] * c + f1 * d2 + f2 * e2 + f3 * d3 + f4 * e3) / length[:, None]
        none = on_chord * 0
        first = np.stack([-on_chord, none, f1 * c - half * e3, f3 * c + half * e2], axis=-2)
        last = np.stack([on_chord, none, f2 * c + half * d3, f4 * c - half * d2], axis=-2)
        found = np.zeros(q.reshape(shape).shape, none.dtype)
        for k, node in enumerate(self.nodes):
            found[..., node, :, :] += first[..., k, :, :]
            found[..., node + 1, :, :] += last[..., k, :, :]
        return found.reshape(q.shape)

    def sides(self, q: Array) -> tuple[Array, Array]:
        """Both vectors of all products, (products, 3)."""
        return self.left @ q + self.fixed_left, self.right @ q + self.fixed_right

    def jacobian(self, q: Array) -> Array:
        """Slopes of the constraints, (constraints, n)."""
        a, b = self.sides(q)
        slopes = np.sum(self.left * b[:, :, None] + self.right * a[:, :, None], axis=1)
        return np.concatenate([self.linear, slopes])

    def errors(self, q: Array, given: Array) -> Array:
        """Phi."""
        a, b = self.sides(q)
        return np.concatenate([self.linear @ q - given, np.sum(a * b, axis=1) - self.values])

    def speeds(self, q: Array, v: Array, given: Array) -> Array:
        """Rates of the constraints."""
        (a, b), va, vb = self.sides(q), self.left @ v, self.right @ v
        return np.concatenate([self.linear @ v - given, np.sum(va * b + a * vb, axis=1)])

    def equations(self, q: Array, v: Array, a: Array, multipliers: Array, given: Array) -> Array:
        """M a + F + J^T lambda, and rates of the constraints."""
        pushed = self.mass @ a + self.forces(q, v) + multipliers @ self.jacobian(q)
        return np.concatenate([pushed, self.speeds(q, v, given)])


def decimal(x: Any) -> Decimal:
    """An mpmath number as a decimal one."""
    return Decimal(mp.nstr(x, DIGITS, min_fixed=0, max_fixed=0))


def _scheme() -> tuple[mp.matrix, mp.matrix, mp.matrix]:
    """Weights A (4, 4), b and c of Gauss' method."""
    roots = mp.polyroots(
        [70, -140, 90, -20, 1], maxsteps=500, extraprec=400
    )  # of Legendre's polynomial on 0, 1
    powers = mp.matrix([[c**k for k in range(4)] for c in roots])
    sums = mp.matrix([[c ** (k + 1) / (k + 1) for k in range(4)] for c in roots])
    whole = mp.matrix([[mp.mpf(1) / (k + 1) for k in range(4)]])
    return sums * powers**-1, whole * powers**-1, mp.matrix(roots)


def _refined(matrix: Array, residual: Callable[[Array], Array], x: Array) -> Array:
    """Solve equations in decimal numbers by corrections with a matrix of floats."""
    inverse = np.linalg.inv(matrix)
    size = None
    for _ in range(200):
        left = residual(x)
        largest = max(map(abs, left))
        if not largest:
            return x
        exponent = largest.adjusted()
        scaled = np.array([float(y.scaleb(-exponent)) for y in left])
        change = np.array([Decimal(float(y)).scaleb(exponent) for y in inverse @ scaled], object)
        x = x - change
        size = max(map(abs, change))
        if size < max(1, *map(abs, x)) * Decimal(1).scaleb(-CLOSE):
            return x
    raise AssertionError(f"corrections stay at {size:.1e}")


def run(of: Linkage) -> Array:
    """Places at the end of the run, decimal numbers."""
    exact, rough = Numbers(of, decimal, object), Numbers(of, float, float)
    n, weights = of.size, _scheme()
    a, b, _ = (np.array([decimal(x) for x in w], object).reshape(w.rows, w.cols) for w in weights)
    b, h, step = b[0], decimal(mp.mpf(END) / STEPS), mp.mpf(END) / STEPS
    rough_a, rough_h = a.astype(float), float(h)
    floats = np.vectorize(float, otypes=[float])
    m = len(of.linear) + len(of.products)

    def saddle(jacobian: Array, mass: Array) -> Array:
        zero = jacobian[0, 0] * 0
        return np.block([[mass, jacobian.T], [jacobian, np.full((m, m), zero)]])

    def projected(metric: Array, right: Array) -> Array:
        inverse = floats(metric)
        return _refined(inverse, lambda x: metric @ x - right, np.full(n + m, Decimal(0), object))[:n]

    q, v, zeros = exact.start, exact.rate, np.full(n, Decimal(0), object)
    over = exact.speeds(q, v, exact.given(mp.mpf(0))[1])
    v = v - projected(saddle(exact.jacobian(q), exact.mass), np.concatenate([zeros, over]))
    stages = np.zeros((4, n + m))
    for k in range(STEPS):
        times = [k * step + step * x for x in weights[2]]
        rates = [exact.given(t)[1] for t in times]

        def moved(a: Array, h: Any, x: Array, q: Array, v: Array) -> tuple[Array, Array]:
            own, shape = x.reshape(4, -1)[:, :n], a.sum(axis=1)
            return q + h * np.outer(shape, v) + h * h * (a @ (a @ own)), v + h * (a @ own)

        def residual(x: Array, of: Numbers, a: Array, h: Any, q: Array, v: Array, rates: Array) -> Array:
            x = x.reshape(4, -1)
            places, speeds = moved(a, h, x, q, v)
            rows = zip(places, speeds, x[:, :n], x[:, n:], rates, strict=True)
            return np.concatenate([of.equations(*row) for row in rows])

        at = floats(q), floats(v)
        rough_rates = [floats(x) for x in rates]
        for again in range(_ROUGH):
            if again in (0, _ROUGH - 1):
                whole = _matrix(rough, rough_a, rough_h, stages, *moved(rough_a, rough_h, stages, *at))
            left = residual(stages, rough, rough_a, rough_h, *at, rough_rates)
            stages = stages - np.linalg.solve(whole, left).reshape(4, -1)
        start = np.array([Decimal(x) for x in stages.ravel().tolist()], object)
        found = _refined(whole, lambda x: residual(x, exact, a, h, q, v, rates), start).reshape(4, -1)  # noqa: B023
        q, v = q + h * v + h * h * ((b @ a) @ found[:, :n]), v + h * (b @ found[:, :n])
        given, metric = exact.given((k + 1) * step), saddle(exact.jacobian(q), exact.mass)
        while True:
            change = projected(metric, np.concatenate([zeros, exact.errors(q, given[0])]))
            q = q - change
            if max(map(abs, change)) < Decimal(1).scaleb(-CLOSE):
                break
        v = v - projected(metric, np.concatenate([zeros, exact.speeds(q, v, given[1])]))
        stages = floats(found)
    return q


def _matrix(of: Numbers, a: Array, h: float, stages: Array, places: Array, speeds: Array) -> Array:
    """Slopes of the equations at all stages by second rates and multipliers; those of forces by complex steps."""
    n, size = of.of.size, stages.shape[1]
    matrix = np.zeros((4, size, 4, size))
    tiny, linear = 1e-30 * np.eye(n), len(of.linear)
    for i, (q, v, x) in enumerate(zip(places, speeds, stages, strict=True)):
        by_places, by_rates = np.zeros((2, size, n))
        by_places[:n] = of.forces(q + 1j * tiny, v + 0j * tiny).imag.T / 1e-30
        by_rates[:n] = of.forces(q + 0j * tiny, v + 1j * tiny).imag.T / 1e-30
        pushed = np.einsum("k,kax,kay->xy", x[n + linear :], of.left, of.right)
        by_places[:n] += pushed + pushed.T
        va, vb = of.left @ v, of.right @ v
        by_places[n + linear :] = np.einsum("ka,kax->kx", va, of.right) + np.einsum("ka,kax->kx", vb, of.left)
        by_rates[n:] = jacobian = of.jacobian(q)
        for j in range(4):
            matrix[i, :, j, :n] = h**2 * (a[i] @ a[:, j]) * by_places + h * a[i, j] * by_rates
        matrix[i, :n, i, :n] += of.mass
        matrix[i, :n, i, n:] = jacobian.T
    return matrix.reshape(4 * size, -1)


def frequencies(of: Linkage) -> list[Any]:
    """The lowest frequencies with strain [Hz] about the start, where no link is strained, mpmath numbers."""
    rough = Numbers(of, mp.mpf, object)
    n, q = of.size, rough.start
    stiffness = mp.zeros(n, n)
    # Forces are odd in small displacements up to the second order: central differences, to 40 digits.
    step = mp.mpf(10) ** (-mp.mp.dps // 3)
    still = np.full(n, mp.mpf(0), object)
    for j in range(n):
        moved = []
        for sign in (1, -1):
            at = q.copy()
            at[j] += sign * step
            moved.append(rough.forces(at, still))
        for i, x in enumerate((moved[0] - moved[1]) / (2 * step)):
            stiffness[i, j] = x
    jacobian = mp.matrix(rough.jacobian(q).tolist())
    orthogonal, _ = mp.qr(jacobian.T)
    basis = orthogonal[:, jacobian.rows :]
    mass, stiff = (basis.T * x * basis for x in (of.mass, stiffness))
    lower = mp.cholesky(mass) ** -1
    squares = sorted(mp.eigsy(lower * stiff * lower.T, eigvals_only=True))
    strained = [x for x in squares if x > mp.mpf("1e-10") * squares[-1]]
    return [mp.sqrt(x) / (2 * mp.pi) for x in strained[:MODES]]


def recorded(q: Array) -> list[Any]:
    """Return the place of the end of the first link, and the deflection of its middle."""
    first, middle, last = (q[12 * k : 12 * k + 3] for k in (0, 2, 4))
    return [*last, *(middle - (first + last) / 2)]


def slider_crank(p: dict[str, Any]) -> Linkage:
    """The scene ``spatial_slider_crank``."""
    r, w, x, none = p["r"], p["rate"], mp.mpf("0.3"), mp.mpf(0)
    root = mp.sqrt(2)
    begins = [r * w / root, none, r * w / root]
    # Along the rod, which keeps its length, both ends have the same speed.
    ends = [(begins[0] * x) / x, none, none]
    rod = Link(
        [none, r, none], [x, none, none], (begins, ends), p["density"], p["width"], p["thickness"], p["E"]
    )
    of = Linkage([rod], {4: p["piston"]}, mp.mpf("1e-5"))
    s, c = mp.sin, mp.cos
    of.pin(0, lambda t: (
        [r * s(w * t) / root, r * c(w * t), r * s(w * t) / root],
        [r * w * c(w * t) / root, -r * w * s(w * t), r * w * c(w * t) / root],
    ))  # fmt: skip
    of.linear += [({12 * 4 + i: 1}, lambda _: (0, 0)) for i in (1, 2)]
    axis = mp.matrix([0, 0, 1])
    across = cross(axis, of.own[4][0])
    of.across(4, across / mp.norm(across), axis, None)
    return of


def four_bar(p: dict[str, Any]) -> Linkage:
    """The scene ``spatial_four_bar``; the start of C moves in the plane."""
    r, w, none = p["r"], p["rate"], mp.mpf(0)
    b, c, d = [none, r, none], [mp.mpf("0.24"), mp.mpf("0.14"), none], [mp.mpf("0.22"), none, none]
    vb = [-r * w, none, none]
    bars = mp.matrix([[c[0] - b[0], c[1] - b[1]], [c[0] - d[0], c[1] - d[1]]])
    vc = mp.lu_solve(bars, mp.matrix([(c[0] - b[0]) * vb[0], 0]))
    vc = [vc[0], vc[1], none]
    wide, thin = mp.mpf("0.012"), mp.mpf("0.008")
    coupler = Link(b, c, (vb, vc), mp.mpf(7850), wide, wide, p["E"])
    rocker = Link(d, c, ([none] * 3, vc), p["density"], thin, thin, mp.mpf("207e9"))
    of = Linkage([coupler, rocker], {}, mp.mpf("1e-5"))
    of.pin(0, lambda t: (
        [-r * mp.sin(w * t), r * mp.cos(w * t), none], [-r * w * mp.cos(w * t), -r * w * mp.sin(w * t), none],
    ))  # fmt: skip
    of.pin(5, lambda _: (d, [none] * 3))
    of.join(4, 9)
    upright = mp.matrix([0, 0, 1])
    of.revolute(0, upright)
    of.revolute(4, mp.matrix([0, mp.sin(p["error"]), mp.cos(p["error"])]), 9)
    of.revolute(5, upright)
    return of


def cases() -> dict[str, tuple[Any, dict[str, Any], tuple[str, str], list[str]]]:
    """Return of each scene the linkage, parameters, a point with the first link, and the coordinates held.

    The point is the end of that link. Numbers have the digits of mpmath's context.
    """
    of = mp.mpf
    return {
        "spatial_slider_crank": (
            slider_crank,
            {"rate": of(60), "r": of("0.05"), "density": of(7850), "width": of("0.008"),
             "thickness": of("0.004"), "E": of("210e9"), "piston": of("0.3")},
            ("P", "rod"), [],
        ),
        "spatial_four_bar": (
            four_bar,
            {"rate": of(30), "r": of("0.06"), "error": 5 * mp.pi / 180, "density": of(7850), "E": of("207e9")},
            ("C", "coupler"), ["C.position.z"],
        ),
    }  # fmt: skip
