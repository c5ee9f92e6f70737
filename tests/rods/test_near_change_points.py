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


def transmission(p, joint, times):
    """Sine of the angle between coupler and rocker: both circles determine their joint to a rounding error over it."""
    angle = p["s"] + p["w"] * times
    coupler = (joint - p["a"] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)) / p["b"]
    rocker = (joint - np.array([p["d"], 0.0])) / p["c"]
    return np.abs(coupler[:, 0] * rocker[:, 1] - coupler[:, 1] * rocker[:, 0])


#: Rounding errors of forces, times the fourth power of the transmission: each derivative multiplies those of places
#: by one over it once more, and forces, which accelerations determine, by another.
ROUNDING = 64 * np.finfo(float).eps
FORCES = ("crank.torque", "rocker.C.force")


def check(seed):
    random = np.random.default_rng(seed)
    six, wound = bool(random.integers(2)), bool(random.integers(2))
    p, side, _ = sizes(random, six)
    model = model_of(six, wound)
    tuned = {name: value for name, value in p.items() if name in model.parameters}
    model = model.with_parameters(**tuned)
    run = model.simulate(1.0, samples=SAMPLES[-1])
    expected = {v.name: v.values for v in run.variables if v.name in OUTPUTS}
    joint = joint_of(p, side, run.time)
    assert expected["B.position"] == pytest.approx(joint, abs=1e-9)
    rounding = np.maximum(1e-9, ROUNDING / transmission(p, joint, run.time) ** 4)
    within = {
        name: max(1.0, float(np.max(np.abs(values))))
        * (rounding if name in FORCES else np.full_like(rounding, 1e-9))
        for name, values in expected.items()
    }
    columns = {name: [value, value] for name, value in tuned.items()}
    for samples in SAMPLES:
        every = (SAMPLES[-1] - 1) // (samples - 1)
        found = [
            (model.inverse_dynamics(samples=samples), model.inverse_dynamics_many),
            (model.kinematics(samples=samples), model.kinematics_many),
            (model.simulate(1.0, samples=samples), None),
        ]
        for result, many in found:
            several = many(columns, samples=samples, threads=1) if many else None
            for name in {*expected} & {v.name for v in result.variables}:
                there, limit = expected[name][::every], within[name][::every]
                limit = limit.reshape(-1, *[1] * (there.ndim - 1))
                for values in (result[name].values, *(several[name].values if several else ())):
                    assert np.all(np.abs(values - there) <= limit), (seed, samples, name)


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


@pytest.mark.parametrize(
    "options",
    [
        {"rtol": 1e-3},
        {"method": "dopri5", "rtol": 1e-4},
        {"method": "radau5", "rtol": 1e-6},
        {"method": "rk4", "step": 2e-3},
        {"method": "rattle6", "step": 2e-3},
        {"method": "generalized-alpha", "step": 1e-3},
    ],
)
def test_steps_of_runs_keep_the_branch(options):
    """Steps far longer than the passage of the pose, without a stage in it."""
    model = model_of(False, False)
    for seed in (0, 2, 3, 19):
        random = np.random.default_rng(seed)
        p, side, gap = sizes(random, False)
        assert gap < 1e-8
        tuned = {name: value for name, value in p.items() if name in model.parameters}
        run = model.with_parameters(**tuned).simulate(1.0, samples=SAMPLES[-1], **options)
        assert run["B.position"].values == pytest.approx(joint_of(p, side, run.time), abs=1e-9)


@pytest.mark.parametrize("gap", [1e-9, 1e-5])
def test_the_rigid_motion_of_elastic_links(gap):
    """At a few times, between which its strides meet the pose in which all links are nearly in one line."""
    p = {"a": 0.3, "b": 0.5 + gap, "c": 0.6, "d": 0.8, "s": 0.0, "w": 1.0}
    (x, y), *_ = joint_of(p, 1.0, np.zeros(1)).tolist()
    lengths = {"a.value": p["a"], "b": p["b"], "c": p["c"], "frame": p["d"]}
    changes = {f"parameters.{name}": f"{value!r} m" for name, value in lengths.items()}
    changes |= {"parameters.speed.value": "1 rad/s", "points.B.at": [f"{x!r} m", f"{y!r} m"]}
    motion = symgen.build("elastic_four_bar", set=changes).motion(True)
    for before in (3.0, 3.006, 3.014):
        times = np.array([2.0, before, 3.2, 4.0])
        q = motion.rigid_motion(motion.equations(), times)[0][0]
        assert q[:, 2:4] == pytest.approx(joint_of(p, 1.0, times), abs=1e-12)


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
