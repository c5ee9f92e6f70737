"""Random chains, trees, loops and planar bodies under random loads, against an independent minimal-coordinate model.

Every mechanism is compared in several random states: accelerations of all points, the force of every rod's length
constraint, and the reactions, each relative to the largest of its kind. Closed linkages whose loops are nearer to
a dead centre than a condition number of 100, a bound set before any comparison, are drawn anew.
"""

from __future__ import annotations

import numpy as np
import pytest
from shared.full import full_unless
from shared.golden import reference
from shared.minimal import Body, Mechanism, Minimal, Real
from shared.random_mechanisms import draw, random_pose

import symgen

TOLERANCE = 1e-12
STATES = 7
KINDS = ("chain", "tree", "loop", "bodies")
#: Dimension, kind, number of bodies, whether nothing is pinned to the ground. A loop needs three rods.
CASES = [
    (dimension, kind, count, (count + KINDS.index(kind)) % 2 == 0)
    for dimension in (2, 3)
    for kind in KINDS
    for count in range(3 if kind == "loop" else 1, 11)
]


def drawn(case):
    dimension, kind, count, free = case
    rng = np.random.default_rng([dimension, KINDS.index(kind), count])
    return rng, draw(rng, dimension, count, kind, free)


@pytest.mark.parametrize(
    ("case",),
    full_unless(
        lambda case: CASES.index(case) % 8 == 3 or case[1:] == ("loop", 10, True), [(case,) for case in CASES]
    ),
    ids=lambda c: f"{c[0]}D-{c[1]}-{c[2]}-{'free' if c[3] else 'pinned'}",
)
def test_against_minimal_coordinates(case):
    rng, (scene, minimal, start, _) = drawn(case)
    model = symgen.build(scene, backend="c" if case[2] == 10 else "numpy")
    lengths = {body.name: body.length for body in minimal.order}
    assert set(model.description.points) >= set(minimal.mechanism.ground)
    for _ in range(STATES):
        pose, _ = random_pose(rng, minimal, start)
        speeds = minimal.speeds(pose)
        points, _, _ = minimal.motion(pose)
        t = round(float(rng.uniform(0, 2)), 3)
        state = model.state(
            {p: points[p].value.astype(float) for p in model.description.free},
            {p: (points[p].slope @ speeds).astype(float) for p in model.description.free},
            t=t,
        )
        found, expected = model.accelerations(state), minimal.solve(pose, Real(str(t)))
        agree(found.points, expected.accelerations)
        agree(found.reactions, expected.reactions)
        agree({k: found.multipliers[k] * lengths[k] for k in expected.tensions}, expected.tensions)


def agree(found, expected):
    """Compare values by name, relative to the largest of all."""
    assert set(found) == set(expected)
    size = max((np.max(np.abs(v)) for v in expected.values()), default=0)
    for name, value in expected.items():
        assert np.max(np.abs(found[name] - value)) <= TOLERANCE * size, name


def test_the_draw_covers_what_it_should():
    """Over 500 states; every sign of the equivalent particles; few closed linkages near a dead centre."""
    assert len(CASES) * STATES >= 500
    negative = np.zeros(3, dtype=int)
    rods = refused = loops = 0
    for case in CASES:
        rng, (_, minimal, start, before) = drawn(case)
        refused += before
        loops += len(minimal.cuts)
        if minimal.cuts:
            refused += sum(random_pose(rng, minimal, start)[1] for _ in range(STATES))
        for body in minimal.order:
            m, l, lc, ic = body.mass, body.length, body.centre[0], body.inertia
            rods += 1
            negative += [ic < m * (l - lc) * (lc - l / 2), ic > m * lc * (l - lc), ic < m * lc * (l / 2 - lc)]
        assert minimal.freedoms >= 1
    assert loops >= 20
    assert np.all(negative > 0.05 * rods)
    assert refused <= 0.05 * len(CASES) * STATES


@pytest.mark.parametrize(
    "name",
    [
        "rods_triple_pendulum_planar",
        "rods_double_pendulum_spatial",
        "rods_double_pendulum_spatial_exactly_vertical",
        "rods_four_bar_pinned_pinned",
        "rods_peaucellier_moving",
    ],
)
def test_the_minimal_model_gives_the_reference_numbers(name):
    numbers = reference(name)
    place, speed, expected = (
        {f"P{i}": np.array([Real(x) for x in v]) for i, v in enumerate(numbers[key])}
        for key in ("pos", "vel", "acc")
    )
    bodies = []
    for k, rod in enumerate(numbers["rods"]):
        m, lc, io, l = (Real(rod[key]) for key in ("m", "lc", "Io", "l"))
        frame = {f"P{rod['i']}": (Real(0), Real(0)), f"P{rod['j']}": (l, Real(0))}
        bodies.append(Body(f"L{k}", frame, m, (lc, Real(0)), io - m * lc**2))
    gravity = np.array([Real(x) for x in numbers["gravity"]])
    ground = {f"P{i}": place[f"P{i}"] for i in numbers["fixed"]}
    minimal = Minimal(Mechanism(len(gravity), ground, bodies, gravity))
    found = minimal.solve(minimal.pose(place, speed), Real(0))
    size = max(np.max(np.abs(a)) for a in expected.values())
    for p, a in expected.items():
        assert np.max(np.abs(found.accelerations[p] - a)) < 1e-15 * size
    tensions = np.array([Real(x) * b.length for x, b in zip(numbers["lambda_rods"], bodies, strict=True)])
    found_tensions = np.array([found.tensions[b.name] for b in bodies])
    assert np.max(np.abs(found_tensions - tensions)) < 1e-14 * np.max(np.abs(tensions))
