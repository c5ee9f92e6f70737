"""Synthesis of spherical four-bars: linkages that the test draws on the unit sphere itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shared.full import full

import symgen
from symgen.synthesis.spherical import SphericalFourBar

ARCS = np.radians([30.0, 80.0, 70.0, 85.0])


def drawn(crank, arcs=ARCS, side=1.0):
    """Return the axes O, A, B, C (4, 3) by the intersection of two cones about A and C; None without one."""
    a, b, c, d = arcs
    o, ground = np.array([0.0, 0.0, 1.0]), np.array([math.sin(d), 0.0, math.cos(d)])
    joint = np.array([math.sin(a) * math.cos(crank), math.sin(a) * math.sin(crank), math.cos(a)])
    g = joint @ ground
    x, y = np.linalg.solve([[1, g], [g, 1]], [math.cos(b), math.cos(c)])
    across = np.cross(joint, ground)
    left = 1 - (x * x + y * y + 2 * x * y * g)
    if left < 0:
        return None
    return np.array(
        [o, joint, x * joint + y * ground + side * math.sqrt(left) * across / np.linalg.norm(across), ground]
    )


def rocker(crank):
    """Return the rotation of the rocker about C, from the arc OC continued."""
    _, _, b, _ = drawn(crank)
    d = ARCS[3]
    return math.atan2(b[1], b @ [math.cos(d), 0.0, -math.sin(d)])


def arcs_of(design):
    return [*design.linkage.lengths.values()]


def has(designs):
    return any(np.allclose(arcs_of(d), ARCS, rtol=1e-7) and not d.faults for d in designs)


@pytest.mark.parametrize("given", [("crank_start", "rocker_start"), ("crank_start",), ()])
def test_function_generation(given):
    """Four to six pairs; every linkage found has its coupler's arc where crank and rocker are at the pairs."""
    cranks = np.linspace(0.3, 3.3, 6 - len(given))
    rockers = np.unwrap([rocker(x) for x in cranks])
    x = cranks - (0 if "crank_start" in given else cranks[0])
    y = rockers - (0 if "rocker_start" in given else rockers[0])
    task = {"kind": "function", "linkage": "spherical", "input": x.tolist(), "output": y.tolist()}
    found = symgen.synthesise({**task, **dict.fromkeys(given, 0)})
    assert has(found.designs)
    for design in found.designs:
        k = design.linkage
        arcs = np.array([k.A, k.B])
        ends = []
        for turn, out in zip(x - x[0], y - y[0], strict=True):
            joint = Rotation.from_rotvec(turn * k.O).apply(arcs[0])
            end = Rotation.from_rotvec(out * k.C).apply(arcs[1])
            ends.append(joint @ end)
        assert np.ptp(ends) < 1e-9


@pytest.mark.parametrize("turned", [False, full(True)])
def test_motion_generation_of_five_rotations(turned):
    """Six dyads guide a coupler through five rotations, one of them about z: the drawn linkage is among them."""
    frame = Rotation.from_rotvec([0.3, -0.2, 0.5] if turned else [0, 0, 0])
    triads = [
        frame.apply(np.array([k[1], k[2], np.cross(k[1], k[2])]))
        for k in map(drawn, (0.3, 0.9, 1.7, 2.5, 3.4))
    ]
    moves = [np.linalg.solve(triads[0], t).T for t in triads]
    rotations = Rotation.from_matrix(moves).as_rotvec()
    found = symgen.synthesise(
        {"kind": "motion", "linkage": "spherical", "rotations": rotations.tolist(), "starts": 80}
    )
    assert has(found.designs)
    assert len(found.designs) == 30  # six dyads, each as the crank of five others
    for design in found.designs:
        k = design.linkage
        for ground, joint in ((k.O, k.A), (k.C, k.B)):
            assert np.ptp([ground @ move @ joint for move in moves]) < 1e-9


def test_motion_generation_on_given_axes_and_its_scene(tmp_path):
    triads = [np.array([k[1], k[2], np.cross(k[1], k[2])]) for k in map(drawn, (0.3, 0.9, 1.7))]
    rotations = Rotation.from_matrix([np.linalg.solve(triads[0], t).T for t in triads]).as_rotvec()
    found = symgen.synthesise(
        {"kind": "motion", "linkage": "spherical", "rotations": rotations.tolist(), "ground_azimuth": [0, 0],
         "ground_elevation": ["90 deg", "5 deg"]}
    )  # fmt: skip
    (design,) = found.designs
    assert not design.faults
    own = [*ARCS[:1], *ARCS[1:3], ARCS[3]]
    assert np.sin(arcs_of(design)) == pytest.approx(np.sin(own), rel=1e-9)  # an axis and its opposite are one
    file = tmp_path / "design.toml"
    file.write_text(design.linkage.toml())
    run = symgen.build(file).kinematics(at=np.pi + np.array([0.3, 0.9, 1.7]), over="input")
    turned = run["theta4"].values
    expected = np.array([rocker(x) for x in (0.3, 0.9, 1.7)])
    assert turned - turned[0] == pytest.approx(expected[0] - expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_a_crank_stops_where_the_cones_no_longer_meet(seed):
    """And it turns by class where they meet all around, with transmission angles from spherical triangles."""
    generator = np.random.default_rng(seed)
    arcs = generator.uniform(0.2, 2.5, 4)
    directions = np.linspace(-np.pi, np.pi, 801)
    closes = np.array([drawn(x, arcs) is not None for x in directions])
    if not closes.any():
        return
    start = float(generator.choice(directions[closes]))
    axes = drawn(start, arcs)
    linkage = SphericalFourBar(*axes)
    assert arcs == pytest.approx([*linkage.lengths.values()], rel=1e-9)
    assert linkage.turns == closes.all() or linkage.grashof == "change-point"
    for way, stop in zip((-1, 1), linkage.swing, strict=True):
        turned = start + way * np.linspace(0.0, 2 * np.pi, 2001)
        passes = np.array([drawn(x, arcs) is not None for x in turned])
        assert math.isinf(stop) if passes.all() else abs(stop - turned[~passes][0]) < 4e-3


def test_a_run_stays_on_the_branch_of_its_pose():
    for side in (1.0, -1.0):
        linkage = SphericalFourBar(*drawn(0.4, side=side))
        cranks = np.linspace(0.4, 6.0, 9)
        run = linkage.angles(cranks)
        d = ARCS[3]
        for x, theta in zip(cranks, run["theta4"].values, strict=True):
            _, _, b, _ = drawn(x, side=side)
            wanted = math.atan2(b[1], b @ [math.cos(d), 0.0, -math.sin(d)])
            assert math.remainder(-theta - wanted, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
