"""Assembled matrices of elastic links: an assembly from the equations of the thesis, modes, sums of the parts."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh
from shared.commands import call
from shared.elastic_linkages import six_bar_scene, two_loops_scene
from shared.thesis_assembly import BOUNDARY, HELD, assembled, assembly

import symgen
from symgen.errors import ModelError
from symgen.runtime._beams import AT_REST

ANGLES = (0.0, 60.0, 120.0, 200.0, 300.0)
#: Unknowns of the four-bar in the order of the thesis.
UNKNOWNS = [
    *("M.x", "M.y", "crank.theta@0", "crank.kappa@0", "A.x", "A.y", "crank.theta@1", "crank.kappa@1"),
    *("coupler.theta@0", "coupler.kappa@0", "B.x", "B.y", "coupler.theta@1", "coupler.kappa@1"),
    *("output.theta@0", "output.kappa@0", "Q.x", "Q.y", "output.theta@1", "output.kappa@1"),
]
#: Sizes of unknowns for one metre on a link of a foot.
_SIZE = {"m": 1.0, "rad": 1 / 0.3, "1/m": 1 / 0.3**2}


@cache
def model(name="thesis_four_bar"):
    return symgen.build(name)


@pytest.mark.parametrize("angle", ANGLES)
def test_matrices_of_the_thesis_linkage(angle):
    found, expected = model().matrices(np.radians(angle)), assembled(np.radians(angle))
    free = [name for k, name in enumerate(UNKNOWNS, 1) if k not in (*BOUNDARY, HELD)]
    size = np.array([_SIZE[unit] for unit in found["elastic_mass"].row_units])
    for name, matrix in expected.items():
        assert [*found[name].rows] == free
        scale = np.outer(size, size) if matrix.ndim == 2 else size
        gap = np.abs(found[name].values - matrix) * scale
        assert np.max(gap) < 1e-12 * np.max(np.abs(matrix * scale)), name
    assert not found["elastic_damping"].values.any()


def test_assembly_and_boundary_are_those_of_the_thesis():
    z, boundary = (model().matrices()[name] for name in ("assembly", "boundary"))
    assert [*z.columns] == UNKNOWNS
    assert np.array_equal(z.values, assembly())
    assert z.rows[9:11] == ("coupler_1.w@0", "coupler_1.theta@0")
    assert [*boundary.values] == sorted((*BOUNDARY, HELD))
    free = model("elastic_four_bar_free").matrices()["boundary"]
    assert [*free.values] == [*BOUNDARY] and free.rows[2] == "crank.kappa@1"


@pytest.mark.parametrize("angle", ANGLES)
def test_frequencies_of_the_matrices_are_those_of_modes(angle):
    found = model().matrices(np.radians(angle))
    squares = eigh(found["elastic_stiffness"].values, found["elastic_mass"].values, eigvals_only=True)
    modes = model().modes(np.radians(angle))
    assert np.sqrt(squares) / (2 * np.pi) == pytest.approx(modes.frequencies, rel=1e-9)


SCENES = {
    "loops": lambda: two_loops_scene({"mode": "motor", "torque": "stall*cos(this.angle) - drag*this.rate"}),
    "turned": lambda: six_bar_scene(("coupler", "rocker", "lever"), turned=True),
    "bodies": lambda: six_bar_scene(("rocker", "link"), 0.3),
}


@pytest.mark.parametrize("name", ["elastic_four_bar_motor", "elastic_slider_crank", *SCENES])
def test_parts_sum_to_the_matrices_of_runs(name):
    """With dampers, torsion springs, forces along links, a motor, damping ratios, rigid links: what runs take."""
    built = symgen.build(symgen.Scene(**SCENES[name]())) if name in SCENES else model(name)
    motion, found = built._motion(True), built.matrices(0.013, over="time")
    status, *expected, basis = motion.equations().matrices(0.013)
    _, _, _, rest, _, _ = motion.equations().matrices(0.013, AT_REST)
    assert status == 0
    names = found["elastic_mass"].rows
    order = [motion.layout.names.index(unknown) for unknown in names]
    value = {key: matrix.values for key, matrix in found.items()}
    parts = (
        value["elastic_mass"],
        value["elastic_damping"] + value["elastic_gyroscopic"],
        sum(value[f"elastic_{kind}stiffness"] for kind in ("", "geometric_", "motion_")),
    )
    if basis is None:
        there = np.ix_(order, order)
        for part, whole in zip(parts, expected[:3], strict=True):
            assert part == pytest.approx(whole[there], rel=1e-12, abs=1e-13 * np.max(np.abs(whole)))
        assert value["elastic_load"] == pytest.approx(expected[3][order])
        assert value["elastic_stiffness"] == pytest.approx(rest[there], abs=1e-13 * np.max(rest))
        return
    r, rate, second = (value[f"condensation{k}"] for k in ("", "_rate", "_second_rate"))
    mass, damping, stiffness = parts
    for kind, matrix in {
        "mass": r.T @ mass @ r,
        "damping": r.T @ (damping @ r + 2 * mass @ rate),
        "stiffness": r.T @ (stiffness @ r + damping @ rate + mass @ second),
        "load": r.T @ value["elastic_load"],
    }.items():
        whole = value[f"condensed_{kind}"]
        assert matrix == pytest.approx(whole, rel=1e-9, abs=1e-13 * np.max(np.abs(whole)))
    assert sorted(np.diag(value["condensed_mass"])) == pytest.approx(sorted(np.diag(expected[0])))


def test_show_prints_the_matrices_of_a_crank_angle():
    text = call("show", "thesis_four_bar", "elastic_mass", "--at", "60", "--rows", "A.x,B.y")
    expected = model().matrices(np.radians(60))["elastic_mass"]
    lines = text.splitlines()
    assert lines[0] == "elastic_mass at 60 deg: mass matrix [kg; *m per angle, *m^2 per curvature]"
    assert max(map(len, lines)) <= 100
    row = [float(x) for line in lines if "A.x [m]" in line for x in line.split("]")[1].split()]
    assert row == pytest.approx(expected.values[expected.rows.index("A.x")], rel=1e-9)
    assert "at t = 0.01 s" in call("show", "thesis_four_bar", "boundary", "--at", "0.01 s")
    with pytest.raises(ModelError, match="has no row 'A'"):
        call("show", "thesis_four_bar", "elastic_mass", "--rows", "A")
    with pytest.raises(ModelError, match="four_bar has no elastic links in the plane"):
        call("show", "four_bar", "elastic_mass")
    with pytest.raises(ModelError, match="no assembled matrix 'elastic_mas'"):
        model().matrices()["elastic_mas"]
    with pytest.raises(ModelError, match="have no variable"):
        model().matrices(0.0, over="angle")
