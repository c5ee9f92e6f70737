"""Letters of a scene's constants in what is shown: those that occur, with plain meanings, in every format."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import SymgenError
from symgen.regeneration.sources import systems
from symgen.scene.loading import check_scene, override, read_scene
from symgen.scene.reading import Values
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import in_letters


def shown(*arguments):
    done = CliRunner().invoke(app, ["show", *arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def listed(scene):
    """Return the rows of the table of constants by name."""
    lines = iter(shown(scene).splitlines())
    rows = {}
    for line in lines:
        if line.startswith("─"):
            break
    for line in lines:
        if line.startswith(("Zero", symgen.derive(scene).title)):
            return rows
        name, *_ = line.split("  ")
        rows[name] = line
    return rows


def test_only_letters_that_occur_are_listed():
    """The rail of the car axis has no mass: its centre occurs nowhere."""
    names = listed("car_axis")
    assert "l_rail" in names and "s_rail" not in names
    assert "s_rail" in {c.quantity.name for c in symgen.derive("car_axis").constants}


def test_numbered_letters_of_one_value_are_one_row():
    rows = listed("whip")
    assert set(rows) == {"l_rod1, ..., l_rod25", "rho", "g"}
    row = rows["l_rod1, ..., l_rod25"]
    assert "0.04" in row and "length of link rod1, ..." in row


def test_shared_terms_have_a_legend():
    text = shown("crank_rocker", "mass_matrix", "--format", "shared")
    assert "m_crank    mass of link crank [kg] = 0.1" in text


def test_values_in_the_derivation():
    text = shown("crank_rocker", "derivation", "--with", "m_crank=7")
    assert "m_crank" not in text and "m_coupler" in text
    assert "m_coupler" not in shown("crank_rocker", "derivation", "--with", "m_crank=7", "--numeric")
    with pytest.raises(SymgenError, match="the derivation of crank_rocker has no symbol 'm_cranc'"):
        shown("crank_rocker", "derivation", "--with", "m_cranc=7")


def test_all_compared_systems_have_letters():
    every = systems("elastic_four_bar").all
    assert len(every) > 1
    for prefix, system in every.items():
        assert {"a", "b", "bearing"} <= {c.quantity.name for c in system.constants}, prefix


def test_letters_say_of_what_they_are():
    names = ("car_axis", "andrews_squeezer", "rssr", "tumbling_body", "double_four_bar")
    scenes = [*map(read_scene, names), override(read_scene("rccc"), {"loop.rows.1.alpha": "40 deg"})]
    meanings = {
        c.quantity.name: c.quantity.description
        for scene in scenes
        for c in in_letters(resolve(check_scene(scene)))[1].constants
    }
    assert meanings["m_at_L"] == "mass at L"
    assert meanings["s_rail"] == "distance of the centre of mass of link rail from W, along its line"
    assert "alpha of joint 2, between input and coupler" in meanings.values()
    assert not [m for m in meanings.values() if " of row " in m or "mass of the mass" in m or "{" in m]


ANGLES = {
    "half": {"value": "0.5*turn", "tunable": True},
    "turn": "1 rev",
    "rate": {"value": "rpm*n", "tunable": True},
    "rpm": "60 rpm",
    "n": 2,
    "share": "half/turn",
    "height": "sin(half)",
    "per_time": "3 1/s",
    "stiffness": "5 N*m/rad",
}


def test_angles_and_their_rates_are_in_radians():
    """By the units they are written in; sums and multiples of angles too, their ratios and sines not."""
    text = read_scene("four_bar")
    read = Values(check_scene(replace(text, data={**text.data, "parameters": ANGLES})))
    of = {p.quantity.name: p.quantity.unit for p in read.parameters}
    of |= {name: c.quantity.unit for name, c in read.written.constants.items()}
    assert of == {
        "half": "rad", "turn": "rad", "rate": "rad/s", "rpm": "rad/s", "n": "1", "share": "1", "height": "1",
        "per_time": "1/s", "stiffness": "N*m",
    }  # fmt: skip
    changed = symgen.build("slider_crank", set={"alpha4": "0.25 turn", "rpm": "2 1/s"})
    values = dict(zip((p.name for p in changed.description.tunable), changed.parameter_values, strict=True))
    assert values["alpha4"] == pytest.approx(1.5707963267948966) and values["rpm"] == 2
    with pytest.raises(SymgenError, match="expected an angular velocity such as .* got '3 m'"):
        symgen.build("slider_crank", set={"rpm": "3 m"})


def test_a_constant_that_depends_on_a_parameter_is_a_letter_with_its_meaning():
    text = shown("slider_crank", "inputs")
    assert "one where ratio is zero, nothing elsewhere [1] = exp(-1000000000000*ratio**2)" in text
    by = shown(
        "slider_crank", "inputs", "--by", "ratio", "--rows", "s1", "--columns", "value", "--format", "numeric"
    )
    assert "s1" in by


@pytest.mark.parametrize(
    ("scene", "output", "equation"),
    [
        ("slider_crank", "theta1.rate", "row theta1, column rate of inputs"),
        ("slider_crank", "theta2", "zero of closure_defect"),
        (
            "slider_crank",
            "theta2.rate",
            "row theta2 of the solution of A q' = V: closure_matrix, closure_rhs",
        ),
        ("bennett", "theta3.acceleration", "of the solution of screws * accelerations + screw_drift = 0"),
        ("cssp", "S1.acceleration", "solution of inverse_efforts = given_efforts along motions"),
        ("cssp", "theta1.rate", "integral of theta1.acceleration"),
    ],
)
def test_the_motion_of_a_variable_says_its_equation(scene, output, equation):
    head = " ".join(shown(scene, output).partition("\n\n")[0].split())
    assert equation in head
    names = {m.name for m in symgen.derive(scene).matrices}
    assert not set(re.findall(r"\w*(?:closure|screw|efforts|inputs)\w*", equation)) - names


@pytest.mark.parametrize(
    ("scene", "matrix", "rows", "columns", "unit"),
    [
        ("element_beam8", "shape", "u", None, "1"),
        ("element_beam8", "shape", "slope", "theta1", "1"),
        ("element_beam8", "shape", "curvature", "w1", "1/m^2"),
        ("element_beam8", "shape", "curvature", "kappa2", "1"),
        ("slider_crank", "inputs", "s1", "rate", "m/s"),
        ("slider_crank", "inputs", "theta1", "", "rad, rad/s, rad/s^2"),
        ("slider_crank", "rows", "", "alpha", "rad"),
        ("slider_crank", "rows", "row1", "S", "m"),
        ("slider_crank", "crank_frame", "", "p", "m"),
        ("slider_crank", "row_1_transform", "x", "x", "1"),
        ("slider_crank", "rod_motion", "wx", "", "rad/s"),
        ("slider_crank", "closure_step_rhs", "d12", "", "m"),
        ("slider_crank", "rod_binor", "px", "vx", "kg"),
        ("slider_crank", "rod_binor", "hx", "wx", "kg*m^2"),
        ("slider_crank", "rod_binor", "px", "", "kg"),
        ("slider_crank", "screws", "wx", "S4", "1, m"),
        ("thesis_four_bar", "constraints", "crank", "", "m^2"),
        ("thesis_four_bar", "velocity_constraints", "crank_drive", "", "m/s"),
        ("slider_crank", "closure_jacobian", "wx", "", "1"),
        ("element_beam8", "stiffness", "w1", "w1", "N/m"),
        ("element_beam8", "stiffness", "theta1", "kappa2", "N*m^2"),
        ("element_beam8", "stiffness", "w1", "theta1", "N"),
        ("element_beam8", "mass", "theta1", "theta2", "kg*m^2"),
        ("thesis_four_bar", "elastic_load", "coupler.theta@1", "", "N*m"),
        ("thesis_four_bar", "elastic_damping", "A.x", "A.y", "N*s/m"),
        ("thesis_four_bar", "stress_recovery", "coupler", "coupler.theta@1", "Pa"),
        ("thesis_four_bar", "elastic_stiffness", "A.x", "", "N/m; *m per angle, *m^2 per curvature"),
    ],
)
def test_a_row_or_entry_has_units_of_its_own(scene, matrix, rows, columns, unit):
    asked = [x for option, name in (("--rows", rows), ("--columns", columns)) if name for x in (option, name)]
    head = " ".join(shown(scene, matrix, *asked).split())
    assert f"[{unit}];" in head
