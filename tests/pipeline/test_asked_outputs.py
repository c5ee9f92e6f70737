"""Only selected outputs are derived: positions alone need no dynamics."""

from __future__ import annotations

import json

import numpy as np
import pytest
from shared.full import full
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import CapabilityError, SceneError
from symgen.lowering.program import lower_system
from symgen.models.analyses import elastic_systems
from symgen.pipeline.build import build_kinematics
from symgen.pipeline.systems import derive
from symgen.scene.loading import SceneText, check_scene, read_scene
from symgen.scene.resolve import resolve

#: Kernels and matrices that hold masses, loads or forces.
DYNAMICS = {
    "accelerations", "factor", "solve", "energy", "reactions", "residual", "mass_matrix", "force",
    "kinetic_energy", "potential_energy", "power", "inverse", "given", "inverse_efforts", "given_efforts",
}  # fmt: skip


def asking(text, outputs, **analysis):
    """The same scene with other outputs."""
    asked = {**text.data.get("analysis", {}), **analysis, "outputs": list(outputs)}
    return SceneText(text.name, text.file, {**text.data, "analysis": asked})


def operations(text):
    return sum(k.counts.flops for k in lower_system(derive(text)).kernels)


@pytest.mark.parametrize(
    ("scene", "every"),
    [
        ("four_bar", 1),
        full("crank_rocker", 1),
        ("vertical_rods", 4),
        full("vertical_rods", 1),
        ("screw_jack", 4),
        full("screw_jack", 2),
        ("planar_4r", 18),
        full("planar_4r", 9),
        ("thesis_four_bar", 4),
        full("thesis_four_bar", 1),
    ],
)
def test_one_output_less_never_costs_more(scene, every):
    """Rods in the plane and in space, loops, elastic links: each output left out by itself."""
    text = read_scene(scene)
    outputs = next(e.matrices for e in derive(text).exports if e.kernel == "outputs")
    whole = operations(asking(text, outputs))
    counts = {o: operations(asking(text, [x for x in outputs if x != o])) for o in outputs[::every]}
    assert {o: n for o, n in counts.items() if n > whole} == {}
    assert operations(asking(text, outputs[:1])) < whole


def test_one_station_less_never_costs_more():
    data = read_scene("thesis_four_bar").data
    found = []
    for stations in (
        [{"link": "coupler", "at": 0.3}, {"link": "coupler", "at": 0.7}],
        [{"link": "coupler", "at": 0.3}],
    ):
        linkage = resolve(symgen.Scene(**{**data, "stations": stations}))
        systems = elastic_systems(linkage).values()
        found.append(sum(k.counts.flops for s in systems for k in lower_system(s).kernels))
    more, less = found
    assert less <= more


def derived(system):
    return {m.name for m in system.matrices} | {k.name for k in lower_system(system).kernels}


def test_positions_of_a_loop_generate_no_dynamics():
    text = read_scene("planar_4r")
    positions = asking(text, ["theta4", "theta4.rate", "coupler.position", "rocker.centre"])
    system = derive(positions)
    assert not derived(system) & DYNAMICS
    assert not any("wrench" in name or "binor" in name for name in derived(system))
    assert any(line.startswith("dynamics: no output asks for a force") for line in system.left_out)
    assert derived(derive(text)) & DYNAMICS
    assert not any(line.startswith("dynamics") for line in derive(text).left_out)


def test_positions_of_a_linkage_generate_no_dynamics():
    """And they are those of the run that integrates the same motion from its forces."""
    text = read_scene("crank_rocker")
    outputs = ["B.position", "B.velocity", "B.acceleration", "rocker.angle", "rocker.angular_velocity"]
    model = symgen.build(check_scene(asking(text, outputs, kind="kinematics")))
    system = derive(asking(text, outputs, kind="kinematics"))
    assert not derived(system) & DYNAMICS
    assert not {k.name for k in model.description.kernels} & DYNAMICS
    assert not any(isinstance(m, str) and "mass" in m for m in derived(system))
    motion = model.kinematics(samples=21)
    run = symgen.build(check_scene(asking(text, outputs))).simulate(samples=21, rtol=1e-11)
    assert set(outputs) <= {v.name for v in motion.variables}
    for name in outputs:
        expected = run[name].values
        assert motion[name].values == pytest.approx(expected, abs=1e-7 * np.max(np.abs(expected))), name


def test_the_command_kinematics_makes_no_dynamics(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    done = CliRunner().invoke(app, ["kinematics", "crank_rocker", "--samples", "5", "--json"])
    assert done.exit_code == 0, done
    assert "rocker.acceleration" in json.loads(done.stdout)["outputs"]
    made = [json.loads(f.read_text()) for f in tmp_path.rglob("description.json")]
    assert made
    assert not {k["name"] for d in made for k in d["kernels"]} & DYNAMICS


MASSLESS = {
    "points": {
        "O": {"at": [0, 0], "ground": True},
        "A": {"at": ["2 cm", 0]},
        "B": {"at": ["5 cm", "5 cm"]},
        "C": {"at": ["8 cm", 0], "ground": True},
    },
    "links": {
        "crank": {"points": ["O", "A"], "mass": 0},
        "coupler": {"points": ["A", "B"], "mass": 0, "length": "7 cm"},
        "rocker": {"points": ["C", "B"], "mass": 0, "length": "6 cm"},
    },
    "drivers": [{"link": "crank", "angle": "2*pi*t/T"}],
    "parameters": {"T": "1 s"},
    "analysis": {"kind": "kinematics", "outputs": ["B.position", "crank.angle"]},
}


def test_parameters_of_kinematics_change_without_compiling_again():
    tables = MASSLESS | {"parameters": {"T": {"value": "1 s", "tunable": True}}}
    model = symgen.build(symgen.Scene(**tables))
    slow, fast = (m.initial_state().velocities["B"] for m in (model, model.with_parameters(T=0.5)))
    assert np.max(np.abs(slow)) > 0
    assert fast == pytest.approx(2 * slow)


def written(tmp_path, **analysis):
    """A file of the scene, with other keys under [analysis]."""
    lines = ["symgen = 1", "[points]"]
    points = {
        "O": "[0, 0], ground = true",
        "A": '["2 cm", 0]',
        "B": '["5 cm", "5 cm"]',
        "C": '["8 cm", 0], ground = true',
    }
    lines += [f"{name} = {{ at = {at} }}" for name, at in points.items()]
    lines += ["[links]", 'crank = { points = ["O", "A"] }']
    lines += ['coupler = { points = ["A", "B"], length = "7 cm" }']
    lines += ['rocker = { points = ["C", "B"], length = "6 cm" }']
    lines += [
        "[parameters]",
        'T = "1 s"',
        "[[drivers]]",
        'link = "crank"',
        'angle = "2*pi*t/T"',
        "[analysis]",
    ]
    lines += [f"{key} = {json.dumps(value)}" for key, value in (MASSLESS["analysis"] | analysis).items()]
    path = tmp_path / "rocker.toml"
    path.write_text("\n".join(lines))
    return str(path)


def test_kinematics_needs_no_masses_and_says_what_it_left_out(tmp_path):
    path = written(tmp_path)
    done = CliRunner().invoke(app, ["run", path, "--json", "--samples", "3"])
    assert done.exit_code == 0, done
    found = json.loads(done.stdout)["outputs"]
    assert list(found) == ["crank.angle", "B.position.x", "B.position.y"]
    angle = found["crank.angle"]
    assert [angle["minimum"], angle["maximum"]] == pytest.approx([0, 2 * np.pi])
    x, y = (found[f"B.position.{axis}"]["final"] for axis in "xy")
    assert (np.hypot(x - 0.02, y), np.hypot(x - 0.08, y)) == pytest.approx((0.07, 0.06))
    told = CliRunner().invoke(app, ["explain", path])
    assert "omitted: masses, loads, energies and forces: only kinematics is requested" in told.stdout
    steps = CliRunner().invoke(app, ["show", path, "derivation"])
    assert steps.exit_code == 0 and "constraint_jacobian" in steps.stdout and "mass" not in steps.stdout


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("simulate", ["--rtol", "1e-6"], "does not support simulate: its scene requests kinematics only"),
        ("run", ["--precision", "float128"], "--precision: kinematics is computed in double precision"),
        ("show", ["momentum_rows"], "is a kinematic analysis, which has no momentum rows"),
        ("modes", [], "does not support modes: its scene requests kinematics only"),
        ("accuracy", [], "selects kinematics, which computes no forces"),
        ("run", ["--set", "analysis.kind=dynamics"], "this link has no mass"),
    ],
)
def test_what_kinematics_does_not_have(tmp_path, command, options, said):
    done = CliRunner().invoke(app, [command, written(tmp_path), *options])
    assert isinstance(done.exception, symgen.SymgenError)
    assert said in str(done.exception)


def test_outputs_that_take_forces_are_refused():
    tables = MASSLESS | {"analysis": {"kind": "kinematics", "outputs": ["O.reaction"]}}
    with pytest.raises(SceneError, match="is no output of kinematics"):
        derive(symgen.Scene(**tables))
    with pytest.raises(SceneError, match="analysis of a loop follows from its outputs"):
        symgen.Scene(**{**read_scene("cardan").data, "analysis": {"kind": "kinematics"}})


def test_too_few_drives_are_said():
    model = build_kinematics("four_bar")
    with pytest.raises(CapabilityError, match="1 more drive"):
        model.kinematics()
