"""Frequencies and deflections of beams by the compiled elements against closed forms, by number of elements."""

from __future__ import annotations

import numpy as np
import pytest
from shared.beam_kernels import ROWS, arguments, link, matrix, shape

from symgen.elements import ELEMENTS

#: A steel bar of 1 m, 20 mm x 60 mm: stubby enough that shear and rotary inertia count.
E, G, RHO, WIDTH, HEIGHT, LENGTH = 2.1e11, 8.1e10, 7850.0, 0.02, 0.06, 1.0
AREA, INERTIA = WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12
BAR = {
    "mass": RHO * AREA, "rotary": RHO * INERTIA, "axial": E * AREA, "bending": E * INERTIA,
    "shear": 5 / 6 * G * AREA,
}  # fmt: skip
NAMES = list(ELEMENTS)
BENT = np.sqrt(BAR["bending"] / BAR["mass"]) / LENGTH**2


def bar(**changes):
    return arguments(LENGTH, **(BAR | changes))


def pinned(found, *, axial=True):
    """Held at both ends in u and w, without bending moment."""
    ends = (found.at[0], found.at[-1])
    held = [end[d] for end in ends for d in ("w", "kappa") if d in end]
    return held + ([end["u"] for end in ends] if axial else [])


def clamped(found):
    """Held at the first end; no moment at the other."""
    first, last = found.at[0], found.at[-1]
    return [first[d] for d in ("u", "w", "theta")] + ([last["kappa"]] if "kappa" in last else [])


def pinned_exact(name: str, mode: int) -> float:
    """The closed form of the element's own theory: waves sin(kx), one half wave per mode."""
    k = mode * np.pi / LENGTH
    bending, mass, rotary, shear = (BAR[n] for n in ("bending", "mass", "rotary", "shear"))
    if name == "timoshenko":
        stiff = np.array([[shear * k**2, -shear * k], [-shear * k, bending * k**2 + shear]])
        return np.sqrt(np.linalg.eigvals(stiff / np.array([[mass], [rotary]])).real.min())
    inertia = mass + (rotary * k**2 if name == "rayleigh" else 0)
    return np.sqrt(bending * k**4 / inertia)


def errors(name, numbers, mode=1):
    found = []
    for n in numbers:
        made = link(name, bar(), n)
        bending = made.frequencies(_only_bending(made, pinned(made)))
        found.append(bending[mode - 1] / pinned_exact(name, mode) - 1)
    return np.array(found)


def _only_bending(made, held):
    """Also hold all that stretches the link, so that only bending modes are left."""
    return sorted({*held, *made.along})


#: Numbers of elements to compare, and the order of the frequency: twice (degree - 1) of the deflection.
ORDERS = {"beam8": ((1, 2), 8), "beam9": ((1, 2), 8), "rayleigh": ((1, 2), 8), "cubic": ((4, 8), 4), "timoshenko": ((8, 16), 4)}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_frequencies_of_a_pinned_beam_converge_from_above(name):
    """Order twice (degree - 1) of the deflection; from above, as for every conforming element."""
    numbers, order = ORDERS[name]
    coarse, fine = errors(name, numbers)
    assert coarse > fine > 0
    # Coarse meshes may converge faster at first, not slower.
    assert order - 0.3 < np.log2(coarse / fine) < order + 2


@pytest.mark.parametrize(
    "n, first, second", [(1, 7.1475e-4, 8.133e-3), (2, 1.01e-6, 7.15e-4), (3, 3e-8, 1.2e-5)]
)
def test_pinned_beam_as_published(n, first, second):
    """The digits of the method's golden numbers."""
    assert errors("beam8", [n])[0] == pytest.approx(first, rel=0.01, abs=5e-9)
    assert errors("beam8", [n], 2)[0] == pytest.approx(second, rel=0.05)


#: Roots of cos(x) cosh(x) = -1.
CANTILEVER = (1.875104068711961, 4.694091132974175)


def test_frequencies_of_a_cantilever():
    """The error of one element is the golden number of the method; the order is eight."""
    found = []
    for n in (1, 2, 4):
        made = link("beam8", bar(), n)
        found.append(made.frequencies(_only_bending(made, clamped(made)))[:2] / BENT)
    first = [f[0] / CANTILEVER[0] ** 2 - 1 for f in found]
    assert first[0] == pytest.approx(2.1e-6, rel=0.02)
    assert 7.0 < np.log2(first[0] / first[1]) < 8.5
    assert found[2] == pytest.approx(np.square(CANTILEVER), rel=1e-7)


@pytest.mark.parametrize("name, order", [("cubic", 2), ("beam9", 4)])
def test_frequencies_of_stretching(name, order):
    """A bar held at one end: a quarter wave. One more power of x, two orders more."""
    exact = np.pi / 2 / LENGTH * np.sqrt(BAR["axial"] / BAR["mass"])
    found = []
    for n in (4, 8):
        made = link(name, bar(), n)
        across = np.setdiff1d(np.arange(len(made.mass)), made.along)
        found.append(made.frequencies([*across, made.at[0]["u"]])[0] / exact - 1)
    assert found[1] > 0
    assert np.log2(found[0] / found[1]) == pytest.approx(order, abs=0.1)


def flapping(speed: float, near: float) -> float:
    """Frequency of a rotating cantilever across the plane, over sqrt(EI/m)/L^2, from its power series.

    w_xxxx - speed^2/2 ((1 - x^2) w_x)_x = p^2 w, clamped at 0, free at 1.
    """
    from scipy.optimize import brentq

    def ends(p, second, third):
        a = np.zeros(90)
        a[2:4] = second, third
        for k in range(a.size - 4):
            stretched = (k + 2) * (k + 1) * a[k + 2] - (k + 1) * k * a[k]
            a[k + 4] = (speed**2 / 2 * stretched + p**2 * a[k]) / ((k + 4) * (k + 3) * (k + 2) * (k + 1))
        k = np.arange(a.size)
        return (k * (k - 1)) @ a, (k * (k - 1) * (k - 2)) @ a

    def determinant(p):
        (m1, f1), (m2, f2) = ends(p, 1.0, 0.0), ends(p, 0.0, 1.0)
        return m1 * f2 - m2 * f1

    return brentq(determinant, 0.97 * near, 1.03 * near, xtol=1e-12)


@pytest.mark.parametrize("name, n, error", [("beam8", 4, 2e-6), ("cubic", 20, 5e-5)])
@pytest.mark.parametrize("speed", [0, 1, 6, 12])
def test_frequencies_of_a_rotating_cantilever(name, n, error, speed):
    """Out of the plane it only stiffens; in the plane the square is less by that of the speed."""
    made = link(name, bar(), n)
    omega2 = (speed * BENT) ** 2
    tension = omega2 * BAR["mass"] * LENGTH**2 / 2
    stiff = tension * made.stretching[0] - omega2 * made.stretching[1]
    held = _only_bending(made, clamped(made))
    flap = made.frequencies(held, 0.0, stiff)[:2] / BENT
    lag = made.frequencies(held, omega2, stiff)[:2] / BENT
    assert flap == pytest.approx([flapping(speed, f) for f in flap], rel=error)
    assert lag**2 == pytest.approx(flap**2 - speed**2, rel=1e-8, abs=1e-7)


@pytest.mark.parametrize("slenderness", [1e1, 1e3, 1e5])
def test_a_timoshenko_cantilever_is_exact_and_does_not_lock(slenderness):
    """Deflection under a load at its end, with one element: F L^3/3EI + F L/kGA."""
    bending, shear = 1.0, slenderness**2
    q = arguments(LENGTH, axial=1.0, bending=bending, shear=shear)
    free = np.array([4, 5, 6, 7])
    stiffness = matrix("timoshenko", "stiffness", q)[np.ix_(free, free)]
    w = np.linalg.solve(stiffness, [1.0, 0.0, 0.0, 0.0])[0]
    assert w == pytest.approx(LENGTH**3 / 3 / bending + LENGTH / shear, rel=1e-12)


def test_timoshenko_without_its_shear_strains_is_the_cubic_element():
    q = bar(rotary=0.0)
    for kernel in ("mass", "gyroscopic", "stiffness", "geometric"):
        one, other = (matrix(name, kernel, q) for name in ("timoshenko", "cubic"))
        assert one[..., :6, :6] == pytest.approx(other, rel=1e-14, abs=1e-15 * np.abs(other).max())
    assert matrix("timoshenko", "load", q)[:, :6] == pytest.approx(matrix("cubic", "load", q), rel=1e-14)


def tapered(rng):
    """Positive properties along the element, of every power."""
    sizes = {"mass": 3, "rotary": 5, "axial": 3, "bending": 5, "shear": 3}
    return arguments(0.7, **{k: [2.0, *rng.uniform(-0.3, 0.5, n - 1)] for k, n in sizes.items()})


@pytest.mark.parametrize("name", NAMES)
def test_tapered_against_quadrature(name):
    """All integrals by Gauss points of the shape functions."""
    q = tapered(np.random.default_rng(3))
    length, at, properties = q[0], 1, {}
    for key, size in {"mass": 3, "rotary": 5, "axial": 3, "bending": 5, "shear": 3}.items():
        properties[key] = np.polynomial.Polynomial(q[at : at + size])
        at += size
    mu = properties["mass"]
    before, moment = mu.integ(), (mu * np.polynomial.Polynomial([0, 1])).integ()
    rotary = properties["rotary"] if ELEMENTS[name].rotary else lambda x: 0.0
    points, weights = np.polynomial.legendre.leggauss(12)
    n = len(ELEMENTS[name].dofs)
    sums = {k: np.zeros((n, n)) for k in ("mass", "gyroscopic", "stiffness")}
    stretching, loads = np.zeros((3, n, n)), np.zeros((4, n))
    for x, weight in zip(length / 2 * (1 + points), length / 2 * weights, strict=True):
        rows = shape(name, q, x)
        u, w, slope, phi, strain, curvature = (rows[r] for r in ROWS)
        gamma, m = slope - phi, weight * mu(x)
        sums["mass"] += m * (np.outer(u, u) + np.outer(w, w)) + weight * rotary(x) * np.outer(phi, phi)
        sums["gyroscopic"] += m * (np.outer(u, w) - np.outer(w, u))
        for row, key in ((strain, "axial"), (curvature, "bending"), (gamma, "shear")):
            sums["stiffness"] += weight * properties[key](x) * np.outer(row, row)
        stretching += weight * np.outer(slope, slope) * np.array([1, before(x), moment(x)])[:, None, None]
        loads += np.array([m * u, m * w, m * x * u, m * x * w + weight * rotary(x) * phi])
    for kernel, exact in (*sums.items(), ("geometric", stretching), ("load", loads)):
        assert matrix(name, kernel, q) == pytest.approx(exact, rel=1e-12, abs=1e-13 * np.abs(exact).max()), (
            kernel
        )


@pytest.mark.parametrize("name", NAMES)
def test_rows_of_the_station_are_derivatives(name):
    q, h = bar(), 1e-4
    ahead, here, behind = (shape(name, q, x) for x in (0.3 + h, 0.3, 0.3 - h))
    for row, derivative in (("w", "slope"), ("u", "axial_strain"), ("rotation", "curvature")):
        difference = (ahead[row] - behind[row]) / (2 * h)
        assert here[derivative] == pytest.approx(difference, rel=1e-5, abs=1e-5)
    if ELEMENTS[name].rotation is None:
        assert here["rotation"] == pytest.approx(here["slope"], abs=0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NAMES)
def test_definite(name, seed):
    """Mass positive; stiffness too but for three rigid displacements; geometric stiffness not negative."""
    q = tapered(np.random.default_rng(seed))
    mass = matrix(name, "mass", q)
    scale = 1 / np.sqrt(np.diag(mass))
    assert np.linalg.eigvalsh(mass * np.outer(scale, scale)).min() > 1e-6
    for kernel in ("stiffness", "geometric"):
        for found in np.atleast_3d(matrix(name, kernel, q).T).T.reshape(-1, *mass.shape):
            values = np.linalg.eigvalsh(found)
            assert values.min() > -1e-13 * values.max()
            if kernel == "stiffness":
                assert (values > 1e-8 * values.max()).sum() == len(mass) - 3
