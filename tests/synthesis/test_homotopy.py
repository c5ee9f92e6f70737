"""Small systems of synthesis, solved completely by homotopy (POLSYS_PLP) from polynomials that the test writes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

from symgen.synthesis import dyads, function
from symgen.synthesis.tasks import read_task

pypolsys = pytest.importorskip("pypolsys")

A, B, C, D = 0.4, 1.1, 0.9, 1.0
#: Coupler's point from A in axes along AB.
POINT = 0.3 + 0.5j


def drawn(crank):
    """Return rocker angle, coupler angle and coupler's point by the intersection of two circles."""
    joint = A * np.exp(1j * crank)
    e = abs(D - joint)
    along = (e * e + B * B - C * C) / (2 * e)
    end = joint + (along + 1j * math.sqrt(B * B - along * along)) * (D - joint) / e
    turned = (end - joint) / B
    return np.angle(end - D), np.angle(turned), joint + POINT * turned


def real_roots(equations, groups):
    """Return all real roots (roots, unknowns) of polynomials that are linear in each group of unknowns."""
    unknowns = [x for group in groups for x in group]
    polys = [sp.Poly(e, *unknowns) for e in equations]
    pypolsys.polsys.init_poly(*pypolsys.utils.fromSympy(polys))
    pypolsys.polsys.init_partition(
        *pypolsys.utils.make_mh_part(len(unknowns), [[unknowns.index(x) + 1 for x in g] for g in groups])
    )
    pypolsys.polsys.solve(1e-10, 1e-12, 0.0)
    every = pypolsys.polsys.myroots[:-1].T
    residual = sp.lambdify(unknowns, equations)
    kept = []
    for x in every:
        size = max(1.0, np.abs(x).max())
        if (
            size < 1e6
            and np.abs(x.imag).max() < 1e-7 * size
            and np.abs(residual(*x.real)).max() < 1e-7 * size**2
        ):
            kept.append(x.real)
    return np.array(kept)


def same(one, other):
    """Return whether each row of one array is in the other, and the reverse."""
    gaps = np.abs(one[:, None] - other[None]).max(axis=2) / np.maximum(1.0, np.abs(one).max(axis=1))[:, None]
    return bool((gaps.min(axis=1) < 1e-6).all() and (gaps.min(axis=0) < 1e-6).all())


@pytest.mark.parametrize("count", [3, 4, 5])
def test_function_generation(count):
    """Freudenstein's equation at 3 to 5 pairs, with the cosines and sines of unknown starts as unknowns."""
    cranks = np.linspace(0.3, 2.4, count)
    rockers = np.array([drawn(x)[0] for x in cranks])
    ratios = sp.symbols("k1:4")
    circles = [sp.symbols("cx sx"), sp.symbols("cy sy")]
    free = circles[len(circles) - (count - 3) :]
    known = {"crank_start": 0, "rocker_start": 0}
    for name, _ in zip(("rocker_start", "crank_start"), free, strict=False):
        del known[name]

    def turned(circle, angle):
        c, s = circle if circle in free else (1, 0)
        return c * math.cos(angle) - s * math.sin(angle), s * math.cos(angle) + c * math.sin(angle)

    equations = []
    for x, y in zip(cranks, rockers, strict=True):
        (cx, sx), (cy, sy) = turned(circles[0], x), turned(circles[1], y)
        equations.append(ratios[0] * cy - ratios[1] * cx + ratios[2] - cx * cy - sx * sy)
    equations += [c**2 + s**2 - 1 for c, s in free]
    roots = real_roots(equations, [ratios, *free])
    wanted = []
    for k1, k2, k3 in roots[:, :3]:
        if min(abs(k1), abs(k2)) > 1e-6:
            a, c = 1 / k1, 1 / k2
            b2 = a * a + c * c + 1 - 2 * a * c * k3
            if b2 > 1e-12:
                wanted.append([abs(a), math.sqrt(b2), abs(c)])
    task = {"kind": "function", "input": cranks.tolist(), "output": rockers.tolist(), "starts": 400, **known}
    found = function.four_bars(read_task(task)[1])
    lengths = np.array([[*k.lengths.values()][:3] for k in found.linkages])
    assert wanted and same(np.array(wanted), lengths)


def test_burmester_of_five_poses():
    """The real dyads of five poses: their ground points and joints, from differences of the five distances."""
    _, angles, places = zip(*(drawn(x) for x in (0.3, 0.9, 1.6, 2.4, 3.5)), strict=True)
    ground, joint = sp.symbols("gx gy"), sp.symbols("jx jy")

    def reach(place, angle):
        c, s = math.cos(angle), math.sin(angle)
        x = place.real + c * joint[0] - s * joint[1] - ground[0]
        y = place.imag + s * joint[0] + c * joint[1] - ground[1]
        return x**2 + y**2

    distances = [reach(*pose) for pose in zip(places, angles, strict=True)]
    equations = []
    for other in distances[1:]:
        difference = sp.Poly(sp.expand(other - distances[0]), *ground, *joint)
        # squares of the unknowns cancel but for rounding
        equations.append(sp.Add(*(c * sp.prod(x**k for x, k in zip(difference.gens, m, strict=True))
                                  for m, c in difference.terms() if max(m) < 2 and m[0] + m[1] < 2 and m[2] + m[3] < 2)))  # fmt: skip
    wanted = real_roots(equations, [ground, joint])
    points = [[f"{float(x)!r} m" for x in (p.real, p.imag)] for p in places]
    _, task = read_task({"kind": "motion", "points": points, "angles": [float(x) for x in angles]})
    found = dyads.motion(task)
    size = float(np.linalg.norm(np.ptp([[p.real, p.imag] for p in places], axis=0)))
    assert same(wanted, size * np.array(found.search.roots)[:, :4])
    assert len(wanted) == 4 and len(found.linkages) == 12
