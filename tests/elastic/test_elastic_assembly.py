"""Rigid motion and compiled equations of elastic linkages against positions, Newton-Euler and dense assembly."""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.linalg import eigh
from shared.elastic_assembly import Case, Joints, equations, floats
from shared.elastic_linkages import (
    DIGITS,
    FT,
    LBF,
    RPM,
    SIX_BAR,
    SLUG,
    STEP,
    cantilever,
    four_bar,
    six_bar,
    six_bar_scene,
    slider_crank,
    two_loops,
)
from shared.elastic_linkages import two_loops_scene as scene
from shared.full import full

import symgen
from symgen.runtime.beams.frames import MOTION

MOTOR = {"mode": "motor", "torque": "stall*cos(this.angle) - drag*this.rate"}


def motor(angle, rate):
    return 2 * mp.cos(angle) - rate / 10


def shunt(_, rate):
    """The motor of ``elastic_four_bar_motor``."""
    return 10 * LBF * FT * (1 - rate / (95 * RPM))


#: Elastic links of six-bars, with joints between their ends, and between those of rigid links with a crank whose
#: speed is not constant: the amplitude of its departure.
SIX_BARS = {"six_bar": (("coupler", "rocker", "lever"),), "bodies": (("rocker", "link"), 0.3)}
#: With torsion springs at sections and a disc.
SIX_BARS["turned"] = SIX_BARS["six_bar"]
CASES = {
    "thesis_four_bar": Case(four_bar(373 * RPM)),
    "elastic_four_bar_free": Case(four_bar(373 * RPM), "free"),
    "elastic_four_bar_motor": Case(four_bar(95 * RPM), "motor", shunt, 0.5 * SLUG * FT**2),
    "elastic_slider_crank": Case(slider_crank()),
    "rotating_cantilever": Case(cantilever()),
    "held": Case(two_loops()),
    "free": Case(two_loops(), "free"),
    "motor": Case(two_loops(), "motor", motor),
    "flywheel": Case(two_loops(0.02), "motor", motor),
    "six_bar": Case(six_bar(SIX_BAR, *SIX_BARS["six_bar"])),
    "turned": Case(six_bar(SIX_BAR, *SIX_BARS["turned"], turned=True)),
}
SCENES = {
    "held": {"mode": "held"},
    "free": {"mode": "free"},
    "motor": MOTOR,
    "flywheel": {**MOTOR, "flywheel": "0.02 kg*m^2"},
}


@cache
def six_bar_model(name):
    return symgen.build(symgen.Scene(**six_bar_scene(*SIX_BARS[name], turned=name == "turned")))


@cache
def motion(name, stiffened=True):
    if name in SIX_BARS:
        return six_bar_model(name).motion(stiffened)
    model = symgen.build(symgen.Scene(**scene(SCENES[name])) if name in SCENES else name)
    return model.motion(stiffened)


@pytest.fixture(params=CASES)
def name(request):
    return request.param


def times(found, count=3):
    return np.random.default_rng(7).uniform(0, found.period, count)


def weights_of(row):
    """Direction, rates and joint force of a link in its own axes, as weights of its constant matrices."""
    along, rate, second, acceleration, force = row.reshape(5, 2)
    squared = along @ along
    c, s = along / np.sqrt(squared)
    omega = (along[0] * rate[1] - along[1] * rate[0]) / squared
    turning = (along[0] * second[1] - along[1] * second[0]) / squared - 2 * omega * (along @ rate) / squared
    ax, ay = c * acceleration[0] + s * acceleration[1], c * acceleration[1] - s * acceleration[0]
    return {
        "cosine": c,
        "sine": s,
        "damping_gyroscopic": -2 * omega,
        "damping_mass_quarter": 2 * omega,
        "stiffness_centrifugal": -(omega**2),
        "stiffness_damping_quarter": omega,
        "stiffness_gyroscopic": -turning,
        "stiffness_gyroscopic_quarter": -2 * omega**2,
        "stiffness_mass_ends": -(omega**2),
        "stiffness_mass_quarter": turning,
        "load_out": omega**2,
        "load_turn": -turning,
        "load_x": -ax,
        "load_y": -ay,
        "stiffness_geometric0": -(c * force[0] + s * force[1]),
        "stiffness_geometric1": ax,
        "stiffness_geometric2": -(omega**2),
    }


def test_rigid_motion_and_joint_forces(name):
    """The weights follow from two rates of the link's vector, its first point's acceleration and joint force."""
    found, linkage = motion(name), CASES[name].linkage
    compiled = found.equations()
    for t in times(found):
        _, _, rows, *_ = compiled.motion.evaluate(t)
        instant = linkage.at(t)
        known = [weights_of(instant.links_row(beam.info.link).astype(float)) for beam in found.beams]
        exact = np.array([[weights[column] for column in MOTION] for weights in known])
        size = np.maximum(np.abs(exact).max(axis=0), 1e-3 * np.abs(exact).max())
        assert np.abs((rows.reshape(exact.shape) - exact) / size).max() < 1e-12


def by_columns(case, t):
    """Jacobian of the constraints that elastic links leave, by differences of lengths and angles."""
    joints = Joints(case)
    with mpmath.workdps(DIGITS):
        at = [
            [x for p in joints.points for x in case.linkage.places(mpf(t) + k * STEP)[p]] for k in (-1, 0, 1)
        ]
        before, now, after = (joints.jacobian(q) for q in at)
        series = now, (after - before) / (2 * STEP), (after - 2 * now + before) / STEP**2
        return [floats(m) for m in series]


@pytest.mark.parametrize("name", ["elastic_slider_crank", *SCENES])
def test_jacobian_of_the_constraints_and_its_rates(name):
    """Each row of the kernel is the gradient of a length, a distance or an angle, by a constant factor."""
    found, case = motion(name), CASES[name]
    blocks = {b.name: b for b in found.joints.info("joints").blocks}
    compiled = found.equations()
    factors = None
    for t in times(found):
        joined = compiled.motion.evaluate(t)[3]
        exact = by_columns(case, t)
        assert blocks["jacobian"].columns == tuple(n.replace(".", "_") for n in Joints(case).names)
        for block, mine in zip(("jacobian", "jacobian_rate", "jacobian_second_rate"), exact, strict=True):
            b = blocks[block]
            own = joined[b.offset : b.offset + mine.size].reshape(mine.shape)
            assert b.shape == mine.shape
            if factors is None:
                factors = _factors(own, mine)
            difference = np.abs(own[factors[0]] - factors[1] * mine)
            assert difference.max() < 1e-12 * np.abs(factors[1] * mine).max(), block


def _factors(own, mine):
    """Which row of one Jacobian goes with each of the other, and by which factor."""
    cosines = (own @ mine.T) / np.linalg.norm(own, axis=1)[:, None] / np.linalg.norm(mine, axis=1)
    order = np.argmax(np.abs(cosines), axis=0)
    assert sorted(order) == list(range(len(own)))
    ratio = np.linalg.norm(own[order], axis=1) / np.linalg.norm(mine, axis=1)
    return order, (ratio * np.sign(cosines[order, np.arange(len(order))]))[:, None]


def free_unknowns(basis):
    """The unknowns that R copies: its unit rows."""
    units = np.eye(basis.shape[2])
    return [int(np.flatnonzero(np.all(basis[0] == row, axis=1))[0]) for row in units]


def compare(found, compiled, case, t, **options):
    """All of M, C, K, Q, R, R', R'' of the unknowns that are left, to 1e-12 of the largest entry.

    Terms of R'' that are as large as R' times the speed of the crank may cancel.
    """
    status, *made, basis = compiled.matrices(t, options.get("rest", False))
    assert status == 0
    left = None if basis is None else free_unknowns(basis)
    *exact, own = equations(case, found.beams, list(found.layout.names), t, independent=left, **options)
    if options.get("rest"):
        made, exact = made[:3], exact[:3]  # the loads of a structure at rest are not asked for
    elif basis is not None and not options.get("thesis"):
        made, exact = [*made, *basis], [*exact, *own]
    sizes = [np.abs(b).max() for b in exact]
    if len(exact) == 7:
        sizes[6] = max(sizes[6], abs(found.speed) * sizes[5])
    for a, b, size in zip(made, exact, sizes, strict=True):
        assert np.abs(a - b).max() <= 1e-12 * size


@pytest.mark.parametrize("options", [{}, {"thesis": True}, {"rest": True}], ids=["exact", "thesis", "rest"])
def test_compiled_equations(name, options):
    found = motion(name)
    compiled = found.equations("thesis" in options)
    for t in times(found, 2):
        compare(found, compiled, CASES[name], t, **options)


@pytest.mark.parametrize("name", ["thesis_four_bar", "elastic_slider_crank", "held"])
def test_compiled_equations_without_geometric_stiffness(name):
    found = motion(name, False)
    for t in times(found, 2):
        compare(found, found.equations(), CASES[name], t)


def test_geometric_stiffness_is_seen():
    """Without this term the comparison above would fail by far."""
    with_it, without = (motion("thesis_four_bar", s).equations().matrices(0.01)[3] for s in (True, False))
    assert np.abs(with_it - without).max() > 1e-6 * np.abs(with_it).max()


@pytest.mark.parametrize("axis", "xy")
def test_a_uniform_shift_of_a_link_needs_no_force(axis):
    """Both ends of the coupler are shifted: what its own unknowns feel is nothing, in the exact form only."""
    found = motion("thesis_four_bar")
    names = found.layout.names
    shift = np.array([float(name in {f"A.{axis}", f"B.{axis}"}) for name in names])
    own = [k for k, name in enumerate(names) if name.startswith("coupler.")]
    for thesis in (False, True):
        compiled = found.equations(thesis)
        for t in times(found):
            _, _, damping, stiffness, *_ = compiled.matrices(t)
            for matrix in (damping, stiffness):
                felt = np.abs(matrix[own] @ shift).max() / np.abs(matrix[own]).max()
                assert (felt > 1e-9) if thesis else (felt < 1e-15)


def random_six_bar(seed):
    """Sizes of a six-bar that closes in every position of its crank."""
    factors = 1 + np.random.default_rng(seed).uniform(-0.04, 0.04, len(SIX_BAR))
    return {name: float(size * factor) for (name, size), factor in zip(SIX_BAR.items(), factors, strict=True)}


@pytest.mark.parametrize("name", SIX_BARS)
@pytest.mark.parametrize("seed", [1, *(full(seed) for seed in range(2, 101))])
def test_random_six_bars(name, seed):
    """Matrices; frequencies at rest, and deflections of the structure at rest under the loads of the motion."""
    sizes = random_six_bar(seed)
    found = six_bar_model(name).with_parameters(**sizes).motion(True)
    case, t = (
        Case(six_bar(sizes, *SIX_BARS[name], turned=name == "turned")),
        float(np.random.default_rng(seed).uniform(0, 0.2)),
    )
    compiled = found.equations()
    compare(found, compiled, case, t)
    load = compiled.matrices(t)[4]
    _, mass, _, stiffness, _, basis = compiled.matrices(t, True)
    left = None if basis is None else free_unknowns(basis)
    exact = equations(case, found.beams, list(found.layout.names), t, rest=True, independent=left)
    squares = [eigh(k, m, eigvals_only=True) for k, m in ((stiffness, mass), (exact[2], exact[0]))]
    assert np.abs(squares[0] / squares[1] - 1)[:6].max() < 1e-9
    bent = [np.linalg.solve(k, load) for k in (stiffness, exact[2])]
    # Round-off of the entries, by the condition of the matrix of unit diagonal: some poses hardly hold a link.
    # It bounds the deflections in the units of that matrix: a small curvature next to large rotations is less exact.
    sizes = np.sqrt(np.diag(exact[2]))
    round_off = 100 * np.finfo(float).eps * np.linalg.cond(exact[2] / np.outer(sizes, sizes))
    assert round_off < 1e-8
    assert np.linalg.norm(sizes * (bent[0] - bent[1])) < round_off * np.linalg.norm(sizes * bent[1])
