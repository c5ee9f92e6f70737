"""Inverse dynamics in space beyond the machines: a crank on its axis, loss of rank, files, what is refused."""

import math

import numpy as np
import pytest
from rich.console import Console
from shared.linkages import at, ground

import symgen
from symgen.errors import CapabilityError, ModelError, SimulationError
from symgen.report.forces import print_forces

M, R, G, W = 1.3, 0.4, 9.81, 3.0


def crank(**analysis):
    """A point mass on a massless crank about the x axis, from the y axis on."""
    return symgen.Scene(
        parameters={"w": f"{W} rad/s"},
        points={"O": ground(0, 0, 0), "A": at(0, R, 0)},
        links={"crank": {"points": ["O", "A"], "mass": "0 kg"}},
        masses=[{"point": "A", "mass": f"{M} kg"}],
        joints=[{"point": "O", "links": ["crank"], "kind": "revolute", "axis": [1, 0, 0]}],
        drivers=[{"link": "crank", "angle": "w*t"}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-G} m/s^2"]},
        analysis={"t_end": "2 s", **analysis},
    )


def test_a_crank_about_an_axis(tmp_path):
    """Torque by the moment of gravity, reaction by Newton's law for the mass."""
    model = symgen.build(crank(outputs=["crank.torque", "O.reaction", "crank.angle"]))
    angles = np.radians([0.0, 40.0, 200.0])
    forces = model.inverse_dynamics(at=angles)
    assert forces.coordinate.name == "crank.angle" and forces.time == pytest.approx(angles / W)
    c, s = np.cos(angles), np.sin(angles)
    assert forces["crank.torque"].values == pytest.approx(M * G * R * c, abs=1e-11)
    reaction = M * np.stack([0 * c, -R * W**2 * c, G - R * W**2 * s], axis=1)
    assert forces["O.reaction"].values == pytest.approx(reaction, abs=1e-10)
    many = model.inverse_dynamics()
    assert many.averages()["crank.torque"].rms == pytest.approx(
        M * G * R * math.sqrt(0.5 + math.sin(4 * W) / (8 * W)), rel=1e-7
    )
    many.save(tmp_path / "forces.nc")
    loaded = symgen.load_result(tmp_path / "forces.nc")
    assert np.array_equal(loaded["O.reaction"].values, many["O.reaction"].values)
    console = Console(width=120, record=True)
    print_forces(many, model, console)
    text = console.export_text()
    assert "forces by multipliers, 361 poses; condition" in text
    assert "accelerations by drives met within" in text and "elements" not in text


def test_many_runs_and_sweeps():
    scene = crank(outputs=["crank.torque"]).model_dump(exclude_unset=True)
    scene["parameters"]["m"] = {"value": f"{M} kg", "tunable": True}
    scene["masses"][0]["mass"] = "m"
    model = symgen.build(symgen.Scene(**scene))
    runs = model.sweep({"m": [1.0, 2.0]}, "inverse_dynamics", outputs=["crank.torque"], samples=5)
    assert runs["crank.torque.peak"].values == pytest.approx([G * R, 2 * G * R], rel=1e-12)


def test_poses_that_determine_no_forces():
    """A jack stretches to its dead centre, in line with the crank, and back: there no force of it is determined."""
    angle = math.radians(60)
    first = math.sqrt(1 + R**2 + 2 * R * math.cos(angle))
    scene = crank(outputs=["jack.tension"]).model_dump(exclude_unset=True)
    scene["parameters"] = {"l": f"{1 + R} m", "c": f"{1 + R - first!r} m", "T": "1 s"}
    scene["points"] |= {
        "A": at(0, R * math.cos(angle), R * math.sin(angle)),
        "P": ground(0, -1, 0),
    }
    scene["links"]["jack"] = {"points": ["P", "A"], "mass": "0 kg", "length": "l - c*((t - T)/T)**2"}
    del scene["drivers"]
    model = symgen.build(symgen.Scene(**scene))
    with pytest.raises(SimulationError, match="forces"):
        model.inverse_dynamics(at=[1.0], over="time")
    forces = model.inverse_dynamics(at=[0.5], over="time")
    assert np.isfinite(forces["jack.tension"].values).all()
    run = model.simulate(t_eval=[0.5], rtol=1e-12)
    assert forces["jack.tension"].values == pytest.approx(run["jack.tension"].values, rel=1e-8)


@pytest.mark.parametrize(
    ("analysis", "arguments", "error", "words"),
    [
        ({}, {}, CapabilityError, "in space it computes the outputs that the scene selects(.|\n)*--of"),
        (
            {"outputs": ["crank.torque"]},
            {"elements": 2},
            ModelError,
            "section forces are for linkages in the plane",
        ),
        (
            {"outputs": ["crank.torque"]},
            {"sections": [0.2]},
            ModelError,
            "section forces are for linkages in the plane",
        ),
    ],
)
def test_what_is_refused(analysis, arguments, error, words):
    with pytest.raises(error, match=words):
        symgen.build(crank(**analysis)).inverse_dynamics(**arguments)


def test_loads_that_are_no_numbers():
    scene = crank(outputs=["crank.torque"]).model_dump(exclude_unset=True)
    scene["parameters"] |= {"F": "1 N", "T": "1 s"}
    scene["forces"] = [{"point": "A", "force": ["0 N", "0 N", "F*sqrt(1 - t/T)"]}]
    with pytest.raises(
        SimulationError, match="no finite crank.torque at t = 1.5 s: a load there is not a number"
    ):
        symgen.build(symgen.Scene(**scene)).inverse_dynamics(at=[0.5, 1.5], over="time")
