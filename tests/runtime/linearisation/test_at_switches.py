"""Linear models of states on switching points of loads: a note names the point."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app

K, BUMPER, MASS = 50.0, 30.0, 2.0


def cart(force, **more):
    return symgen.Scene(
        parameters={"k": {"value": "50 N/m", "tunable": True}, "b": "30 N/m", "c": "1 N"},
        inputs={"F": "0 N"},
        points={
            "A": {"at": ["-1 m", 0], "ground": True},
            "B": {"at": ["1 m", 0], "ground": True},
            "C": {"at": [0, 0]},
        },
        links={"rail": {"points": ["A", "B"]}},
        masses=[{"point": "C", "mass": "2 kg"}],
        guides=[{"points": ["C"], "along": "rail"}],
        gravity={"acceleration": [0, 0]},
        forces=[{"point": "C", "force": [force, 0]}],
        analysis={"outputs": ["C.position"]},
        **more,
    )


def test_a_bumper_that_just_touches():
    """The slope is the mean of both sides, and every analysis says so; beside the point it is that of its side."""
    model = symgen.build(cart("F - k*C.x - b*max(0, C.x)"))
    for x, stiffness, notes in (
        (0.0, K + BUMPER / 2, 1),
        (0.1, K + BUMPER, 0),
        (-0.1, K, 0),
        (1e-6, K + BUMPER, 0),
    ):
        linear = model.linearise(model.state({"C.position.x": x}), coordinates=["C.position.x"])
        assert linear.A[1, 0] == pytest.approx(-stiffness / MASS)
        assert len(linear.notes) == notes
    rest = model.equilibrium()
    found = (
        model.linearise(),
        rest,
        model.modes(rest).equilibrium,
        model.sensitivity(["C.position.x"], ["k"], at=rest),
    )
    for record in found:
        (note,) = record.notes
        assert "switching point of" in note and "C.x" in note and "[[forces]] no. 1" in note
        assert "mean of both sides" in note and record.summary()["notes"] == [note]


@pytest.mark.parametrize(
    ("force", "v", "notes"),
    [
        ("F - k*C.x - c*sign(C.vx)", 0.0, 1),
        ("F - k*C.x - c*sign(C.vx)", 0.3, 0),
        ("F - k*C.x - c*sign(C.vx) - c*sign(C.y/A.x)", 0.3, 0),  # the rail holds y
        ("F - c*law(C.x*k/c)", 0.0, 1),
        ("F - k*C.x", 0.0, 0),
    ],
)
def test_friction_at_rest_and_a_knot_of_a_table(force, v, notes):
    table = {"law": {"x": [-1, 0, 1], "y": [-1, 0, 3], "kind": "linear"}}
    model = symgen.build(cart(force, **({"tables": table} if "law" in force else {})))
    state = model.state({"C.position.x": 0.0}, {"C.position.x": v})
    assert len(model.linearise(state, coordinates=["C.position.x"]).notes) == notes


@pytest.mark.parametrize(
    ("value", "slope", "notes"), [(24.0, 0.5, 1), (-24.0, 0.5, 1), (20.0, 1.0, 0), (30.0, 0.0, 0)]
)
def test_an_input_at_its_limit(value, slope, notes):
    limited = cart("c*max(-24, min(24, F/c))", name="limited")
    linear = symgen.build(limited).with_parameters(F=value).linearise(coordinates=["C.position.x"])
    assert linear.B[1, 0] == pytest.approx(slope / MASS) and len(linear.notes) == notes
    assert not notes or "the input F" in linear.notes[0]


def test_an_input_of_a_smooth_load_has_no_note():
    for force in ("F*F/c", "F*C.x*k/c", "F + k*C.x*cos(F/c)"):
        assert symgen.build(cart(force)).linearise(coordinates=["C.position.x"]).notes == ()


SCENE = """
symgen = 1
parameters = { k = "50 N/m", b = "30 N/m" }
masses = [{ point = "C", mass = "2 kg" }]
guides = [{ points = ["C"], along = "rail" }]
gravity = { acceleration = [0, 0] }
forces = [{ point = "C", force = ["-k*C.x - b*max(0, C.x)", 0] }]
[points]
A = { at = ["-1 m", 0], ground = true }
B = { at = ["1 m", 0], ground = true }
C = { at = [0, 0] }
[links]
rail = { points = ["A", "B"] }
"""


def test_the_command_line_prints_the_note(tmp_path):
    file = tmp_path / "bumper.toml"
    file.write_text(SCENE)
    for command in ("linearise", "modes", "equilibrium"):
        done = CliRunner().invoke(app, [command, str(file)])
        assert done.exit_code == 0, done.exception
        assert "Note: the state is on the switching point of" in " ".join(done.output.split())
