"""Derivatives at the start of shipped linkages of extreme sizes, against the equations of motion in 40 digits."""

from __future__ import annotations

from copy import deepcopy
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from shared.linkages import G

import symgen
from symgen.scene.loading import SHIPPED, read_scene

STEP = mp.mpf("1e-15")


def with_tunable(name, parameters, placed):
    """A shipped scene without parameters, with some in place of numbers of links, and gravity of size g."""
    data = deepcopy(dict(read_scene(SHIPPED / f"{name}.toml").data))
    parameters = parameters | {"g": f"{G!r} m/s^2"}
    data["parameters"] = {key: {"value": value, "tunable": True} for key, value in parameters.items()}
    data["gravity"]["acceleration"] = [0, "-g"]
    for (link, key), parameter in placed.items():
        data["links"][link][key] = parameter
    return symgen.build(symgen.Scene(**data))


def accelerations(rods, places, rates, g):
    """Accelerations of moving points and the reaction at the first, of uniform rods (start, end, mass)."""
    names = [*places]
    moving = [p for p in names if p in rates]
    n, m = 2 * len(moving), len(rods)
    matrix, right, mass = mp.matrix(n + m, n + m), mp.matrix(n + m, 1), {}
    for start, end, value in rods:
        for p in (start, end):
            for q in (start, end):
                mass[p, q] = mass.get((p, q), 0) + value / (3 if p == q else 6)
    for (p, q), value in mass.items():
        if p not in moving:
            continue
        i = 2 * moving.index(p)
        right[i + 1] -= g * value
        if q in moving:
            for k in range(2):
                matrix[i + k, 2 * moving.index(q) + k] += value
    for j, (start, end, _) in enumerate(rods):
        d = [y - x for x, y in zip(places[start], places[end], strict=True)]
        v = [y - x for x, y in zip(rates.get(start, (0, 0)), rates.get(end, (0, 0)), strict=True)]
        right[n + j] = -(v[0] ** 2 + v[1] ** 2)
        for p, sign in ((start, -1), (end, 1)):
            for k in range(2) if p in moving else ():
                matrix[n + j, 2 * moving.index(p) + k] += sign * d[k]
                matrix[2 * moving.index(p) + k, n + j] += sign * d[k]
    found = mp.lu_solve(matrix, right)
    at = {p: [found[2 * i], found[2 * i + 1]] for i, p in enumerate(moving)}
    first, reaction = names[0], [mp.mpf(0), mp.mpf(0)]
    for (p, q), value in mass.items():
        if p == first:
            reaction = [x + value * a for x, a in zip(reaction, at.get(q, (0, 0)), strict=True)]
            reaction[1] += g * value
    for j, (start, end, _) in enumerate(rods):
        if first in (start, end):
            pull = found[n + j] * (1 if end == first else -1)
            d = [y - x for x, y in zip(places[start], places[end], strict=True)]
            reaction = [x + pull * y for x, y in zip(reaction, d, strict=True)]
    return at, reaction


def chain(directions, lengths, masses, g):
    """Acceleration of the last point and reaction of a chain that hangs at rest from the first."""
    places = {"P0": [mp.mpf(0), mp.mpf(0)]}
    for k, (direction, length) in enumerate(zip(directions, lengths, strict=True)):
        step = [length * x / mp.hypot(*direction) for x in direction]
        places[f"P{k + 1}"] = [x + y for x, y in zip(places[f"P{k}"], step, strict=True)]
    rods = [(f"P{k}", f"P{k + 1}", m) for k, m in enumerate(masses)]
    at, reaction = accelerations(rods, places, {p: (0, 0) for p in places if p != "P0"}, g)
    return [*at[f"P{len(masses)}"], *reaction]


def slopes(function, at):
    """Central differences of a list by each argument, (outputs, arguments)."""
    columns = []
    for i, x in enumerate(at):
        high, low = (function(*at[:i], x + s * STEP * abs(x), *at[i + 1 :]) for s in (1, -1))
        columns.append([(a - b) / (2 * STEP * abs(x)) for a, b in zip(high, low, strict=True)])
    return np.array([[float(y) for y in column] for column in columns]).T


def drawn(model):
    return [[mp.mpf(float(x)) for x in place] for place in model.initial_state().positions.values()]


def compared(model, found, expected, rel):
    """Two vectors agree, an acceleration and a reaction; where they vanish, by value over parameter."""
    natural = 1e-3 * found.values[:, None] / np.array([*model.parameters.values()])
    for rows in (slice(0, 2), slice(2, 4)):
        size = np.maximum(*(np.linalg.norm(x[rows], axis=0) for x in (expected, natural)))
        assert np.all(np.linalg.norm(found.derivatives[rows] - expected[rows], axis=0) <= rel * size)


@pytest.mark.full
def test_a_chain_of_masses_from_1_to_1e12():
    placed = {("rod3", "mass"): "m3", ("rod4", "length"): "l4"}
    model = with_tunable("mass_ratios", {"m3": "1e4 kg", "l4": "1 m"}, placed)
    rods = [f"rod{k}.angle" for k in range(1, 8)]
    found = model.sensitivity(["P7.acceleration", "P0.reaction"], ["m3", "l4", "g"], coordinates=rods)
    with mp.workdps(50):
        places = drawn(model)
        steps = [[y - x for x, y in zip(*pair, strict=True)] for pair in pairwise(places)]
        lengths = [mp.mpf(1)] * 7

        def outputs(m3, l4, g):
            masses = [mp.mpf(100) ** k for k in range(7)]
            return chain(steps, [*lengths[:3], l4, *lengths[4:]], [*masses[:2], m3, *masses[3:]], g)

        expected = slopes(outputs, [mp.mpf(model.parameters[x]) for x in ("m3", "l4", "g")])
    compared(model, found, expected, 1e-9)


def test_a_chain_of_lengths_of_a_metre_and_a_micrometre():
    """Directions of rods of a micrometre are known to ten digits."""
    placed = {("rod2", "mass_per_length"): "rho", ("rod3", "length"): "l3"}
    model = with_tunable("length_ratios", {"rho": "1 kg/m", "l3": "1 m"}, placed)
    rods = [f"rod{k}.angle" for k in range(1, 5)]
    found = model.sensitivity(["P4.acceleration", "P0.reaction"], ["rho", "l3", "g"], coordinates=rods)
    with mp.workdps(50):
        places = drawn(model)
        steps = [[y - x for x, y in zip(*pair, strict=True)] for pair in pairwise(places)]
        lengths = [mp.mpf(x) for x in ("1", "1e-6", "1", "1e-6")]

        def outputs(rho, l3, g):
            own = [*lengths[:2], l3, lengths[3]]
            return chain(steps, own, [x * d for x, d in zip(own, (1, rho, 1, 1), strict=True)], g)

        expected = slopes(outputs, [mp.mpf(model.parameters[x]) for x in ("rho", "l3", "g")])
    compared(model, found, expected, 1e-9)


def test_a_four_bar_far_from_the_origin():
    placed = {("coupler", "length"): "b", ("rocker", "mass"): "m"}
    model = with_tunable("far_origin", {"b": "1.8 m", "m": "1.4 kg"}, placed)
    found = model.sensitivity(["B.acceleration", "O.reaction"], ["b", "m", "g"], coordinates=["crank.angle"])
    with mp.workdps(50):
        angle, rate = mp.mpf("1.1"), mp.mpf("2.5")

        def outputs(b, m, g):
            a = mp.expj(angle)
            away = 2 - a
            inside = mp.acos((b**2 + abs(away) ** 2 - mp.mpf("1.4") ** 2) / (2 * b * abs(away)))
            end = a + b * mp.expj(mp.arg(away) + inside)
            va = 1j * rate * a
            d, e = end - a, end - 2
            rows = mp.matrix([[d.real, d.imag], [e.real, e.imag]])
            vb = mp.lu_solve(rows, mp.matrix([d.real * va.real + d.imag * va.imag, 0]))
            places = {"O": (0, 0), "A": (a.real, a.imag), "B": (end.real, end.imag), "C": (2, 0)}
            rods = [("O", "A", mp.mpf(1)), ("A", "B", mp.mpf("1.8")), ("B", "C", m)]
            at, reaction = accelerations(rods, places, {"A": (va.real, va.imag), "B": (vb[0], vb[1])}, g)
            return [*at["B"], *reaction]

        expected = slopes(outputs, [mp.mpf("1.8"), mp.mpf("1.4"), mp.mpf(model.parameters["g"])])
    compared(model, found, expected, 1e-9)
