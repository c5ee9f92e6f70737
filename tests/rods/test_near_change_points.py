"""Driven linkages close to change points keep their assembly branch, for any number of samples."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shared.full import full
from shared.linkages import GRAVITY, circles, four_bar, ground, rod

import symgen
from symgen.runtime.rods import kinematics

SAMPLES = (3, 13, 61, 361)
TURNS = 5.0
OUTPUTS = ("crank.torque", "rocker.C.force", "B.position", "B.velocity", "coupler.angle", "rocker.angle")


def tuned(six, wound):
    """A four-bar linkage, or a six-bar of dyads, of tunable sizes, its crank driven; with loads of angles."""
    lengths = {name: {"value": f"{value} m", "tunable": True} for name, value in _drawn().items()}
    numbers = {"w": "1 rad/s", "s": "0 rad", "k": "3 N*m"}
    points = {
        "O": ground(0, 0),
        "A": {"at": ["ax", "ay"]},
        "B": {"at": ["bx", "by"]},
        "C": {"at": ["d", "0 m"], "ground": True},
    }
    links = {
        "crank": rod("O", "A", 0.7, length="a"),
        "coupler": rod("A", "B", 1.3, length="b"),
        "rocker": rod("C", "B", 0.9, length="c"),
    }
    if six:
        points |= {"E": {"at": ["ex", "ey"]}, "G": ground(0.2, -4.0)}
        links |= {"arm": rod("B", "E", 0.5, length="e"), "end": rod("G", "E", 0.4, length="f")}
    loads = {}
    if wound:
        loads["torsion_springs"] = [
            {"link": "crank", "stiffness": "k", "angle": "-100 deg"},
            {"link": "coupler", "against": "crank", "stiffness": "k/2", "angle": "70 deg"},
            {"link": "rocker", "stiffness": "2*k", "angle": "130 deg"},
        ]
        loads["torques"] = [{"link": "rocker", "torque": "k*coupler.angle - k/3*crank.angle"}]
    return symgen.Scene(
        parameters=lengths | {k: {"value": v, "tunable": True} for k, v in numbers.items()},
        points=points,
        links=links,
        drivers=[{"link": "crank", "angle": "s + w*t"}],
        gravity=GRAVITY,
        analysis={"t_end": "1 s", "outputs": list(OUTPUTS)},
        **loads,
    )


def _drawn():
    return {
        "a": 0.3, "b": 0.51, "c": 0.6, "d": 0.8, "ax": 0.3, "ay": 0.0, "bx": 0.67, "by": 0.58,
        "e": 4.0, "f": 4.0, "ex": 3.0, "ey": -1.0,
    }  # fmt: skip


@cache
def model_of(six, wound):
    """Of each linkage one model; without loads of angles its variants run in lanes."""
    return symgen.build(tuned(six, wound), backend="c")


def sizes(random, six):
    """Return parameters whose crank passes the collinear poses on the ground line, one of them at a small gap."""
    while True:
        a, c, d = random.uniform(0.1, 1.0, 3)
        gap = 10 ** random.uniform(-9, -1)
        folded, second = random.random() < 0.5, random.choice((-1.0, 1.0))
        # the crank points away from the other ground point: a + d + gap = b + c; or to it: |d - a| = |b - c| + gap
        b = c + second * (abs(d - a) - gap) if folded else a + d + gap - c
        margin = b + c - a - d if folded else abs(d - a) - abs(b - c)
        if b > 0.05 and margin > 0.05 and min(a, d) > 0.1 and abs(d - a) > 0.1:
            break
    start = random.uniform(-np.pi, np.pi)
    close = 0.0 if folded else np.pi
    # no sample next to the pose itself, where the gap magnifies rounding errors
    step = 2 * np.pi * TURNS / (SAMPLES[-1] - 1)
    start += (0.5 + random.uniform(-0.1, 0.1)) * step - np.remainder(start - close, step)
    side = random.choice((-1.0, 1.0))
    place = a * np.array([np.cos(start), np.sin(start)])
    joint = circles(place, [d, 0.0], b, c, side)
    found = {
        "a": a, "b": b, "c": c, "d": d, "s": start, "k": random.uniform(1.0, 5.0),
        "ax": place[0], "ay": place[1], "bx": joint[0], "by": joint[1],
    }  # fmt: skip
    if six:
        end = np.array([0.2, -4.0])
        e, f = random.uniform(3.7, 4.2, 2)
        knee = circles(joint, end, e, f, random.choice((-1.0, 1.0)))
        found |= {"e": e, "f": f, "ex": knee[0], "ey": knee[1]}
    rate = 2 * np.pi * TURNS * random.choice((-1.0, 1.0))
    return {k: float(v) for k, v in (found | {"w": rate}).items()}, side, gap


def joint_of(p, side, times):
    """The joint B from two circles."""
    angle = p["s"] + p["w"] * times
    place = p["a"] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return circles(place, [p["d"], 0.0], p["b"], p["c"], side)


def check(seed):
    random = np.random.default_rng(seed)
    six, wound = bool(random.integers(2)), bool(random.integers(2))
    p, side, gap = sizes(random, six)
    known = model_of(six, wound)
    p = {name: value for name, value in p.items() if name in known.parameters}
    model = known.with_parameters(**p)
    # runs may take a smaller gap for a crossing of branches, which they note
    found = [model.simulate(1.0, samples=SAMPLES[-1])] if gap > 1e-7 else []
    found += [model.inverse_dynamics(samples=SAMPLES[-1]), model.kinematics(samples=SAMPLES[-1])]
    expected = {v.name: v.values for result in reversed(found) for v in result.variables if v.name in OUTPUTS}
    joint = joint_of(p, side, np.linspace(0.0, 1.0, SAMPLES[-1]))
    assert expected["B.position"] == pytest.approx(joint, abs=1e-9)
    columns = {name: [value, value] for name, value in p.items()}
    for samples in SAMPLES:
        forces, motion = model.inverse_dynamics(samples=samples), model.kinematics(samples=samples)
        many = (
            model.inverse_dynamics_many(columns, samples=samples, threads=1),
            model.kinematics_many(columns, samples=samples, threads=1),
        )
        every = (SAMPLES[-1] - 1) // (samples - 1)
        for result, several in zip((forces, motion), many, strict=True):
            for name in {*expected} & {v.name for v in result.variables}:
                there = expected[name][::every]
                within = 1e-9 * max(1.0, float(np.max(np.abs(expected[name]))))
                for values in (result[name].values, *several[name].values):
                    assert np.max(np.abs(values - there)) <= within, (seed, samples, name)


@pytest.mark.parametrize("seeds", [range(3), *(full(range(i, i + 27)) for i in range(3, 300, 27))])
def test_analyses_agree_for_any_number_of_samples(seeds):
    for seed in seeds:
        check(seed)


GAPS = (1e-9, 1e-8, 1e-6, 1e-4, 1e-2)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("by_arc_length", [False, True])
def test_the_assembly_of_two_circles(gap, by_arc_length, monkeypatch):
    """Both ways to follow a linkage, through the pose in which all links are nearly in one line."""
    if by_arc_length:
        monkeypatch.setattr(kinematics, "along_branch", lambda *given: None)
    model = symgen.build(four_bar(0.3, 0.5 + gap, 0.6, 0.8, 2.2), backend="numpy")
    p = {"a": 0.3, "b": 0.5 + gap, "c": 0.6, "d": 0.8, "s": 2.2, "w": 1.0}
    for samples in (3, 13, 61):
        motion = model.kinematics(0.0, 1.8, samples=samples)
        expected = joint_of(p, 1.0, motion.time)
        assert motion["B.position"].values == pytest.approx(expected, abs=1e-9)
        assert not motion.bifurcations and not motion.dead_centres


@pytest.mark.parametrize("gap", GAPS[1:])
def test_a_short_range_that_cannot_be_reached_is_not_stepped_over(gap):
    """The coupler is too short by the gap: dead centres on both sides of the line, at any number of samples."""
    model = symgen.build(four_bar(0.3, 0.5 - gap, 0.6, 0.8, 2.2), backend="numpy")
    # the distance of A from C is b + c there
    at_dead_centre = np.arccos((0.09 + 0.64 - (1.1 - gap) ** 2) / 0.48) - 2.2
    for samples in (3, 13, 201):
        motion = model.kinematics(0.0, 1.8, samples=samples)
        assert motion.dead_centres[0].t == pytest.approx(at_dead_centre, abs=1e-8 + 1e-14 / np.sqrt(gap))
        assert motion.time[-1] < at_dead_centre
