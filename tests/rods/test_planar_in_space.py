"""Linkages written with three coordinates that stay in a plane: their cost is that of the plane."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError, SceneError
from symgen.lowering.program import lower_system
from symgen.pipeline.systems import derive
from symgen.scene.loading import check_scene
from symgen.scene.resolve import resolve

#: What the vocabulary of space may cost more than that of the plane, for the same motion.
DEARER = 1.1

CHAIN = {
    "points": {"O": {"at": [0, 0], "ground": True}},
    "links": {},
    "gravity": {"acceleration": ["0.3 m/s^2", "-9.81 m/s^2"]},
    "analysis": {"t_end": "0.6 s"},
}


def chain(count):
    """A chain of rods, drawn along a slope."""
    points, links, last = dict(CHAIN["points"]), {}, "O"
    for i in range(1, count + 1):
        points[f"P{i}"] = {"at": [f"{0.8 * i:.1f} m", f"{-0.6 * i:.1f} m"]}
        links[f"L{i}"] = {"points": [last, f"P{i}"], "mass": f"{1 + 0.2 * i:.1f} kg"}
        last = f"P{i}"
    rates = {"velocities": {last: ["0.6 m/s", "0.8 m/s"]}}
    return CHAIN | {"points": points, "links": links, "start": rates}


def four_bar():
    """A closed loop with a damped spring, a point mass, a load on the state, and a couple on its crank."""
    points = {
        "O": {"at": [0, 0], "ground": True},
        "A": {"at": ["0.2 m", "0.3 m"]},
        "B": {"at": ["0.9 m", "0.5 m"]},
        "C": {"at": ["1 m", 0], "ground": True},
        "M": {"on": "AB", "fraction": 0.4},
    }
    links = {k: {"points": list(k), "mass": "2 kg"} for k in ("OA", "AB", "BC")}
    spring = {"between": ["O", "B"], "stiffness": "300 N/m", "length": "0.8 m", "damping": "2 N*s/m"}
    return CHAIN | {
        "parameters": {"c": {"value": "3 N*s/m", "tunable": True}},
        "points": points,
        "links": links,
        "springs": [spring],
        "masses": [{"point": "M", "mass": "0.5 kg"}],
        "forces": [{"point": "M", "force": ["-c*M.vx", "-c*M.vy"]}],
        "torques": [{"link": "OA", "torque": "2 N*m"}],
    }


def put(vector, across, value=0):
    """Return a vector in space: its two components in the order in which a left turn is positive."""
    found = [value] * 3
    found[across - 2], found[across - 1] = vector
    return found


#: Axes of the plane whose names stand for x and y, by the axis across it.
NAMES = {2: "xy", 1: "zx", 0: "yz"}


def lifted(tables, across=2, level=0):
    """Return the same scene with three coordinates, in a plane across an axis."""
    x, y = NAMES[across]
    across_it = "xyz"[across]
    words = {".vx": f".v{x}", ".vy": f".v{y}"}
    found = dict(tables)
    found["points"] = {
        name: point | {"at": put(point["at"], across, level)} if "at" in point else point
        for name, point in tables["points"].items()
    }
    found["gravity"] = {"acceleration": put(tables["gravity"]["acceleration"], across)}
    found["forces"] = []
    for load in tables.get("forces", []):
        force = [words[c[-3:]].join([c[:-3], ""]) for c in load["force"]]
        found["forces"].append(load | {"force": put(force, across, f"-c*M.v{across_it}")})
    found["torques"] = [t | {"torque": put([0, 0], across, t["torque"])} for t in tables.get("torques", [])]
    if "start" in tables:
        velocities = tables["start"]["velocities"]
        found["start"] = {"velocities": {p: put(v, across) for p, v in velocities.items()}}
    return found


def operations(tables):
    return sum(k.counts.flops for k in lower_system(derive(symgen.Scene(**tables))).kernels)


def with_analysis(tables, **more):
    return tables | {"analysis": tables["analysis"] | more}


SCENES = {"chain of 2": chain(2), "chain of 5": chain(5), "four-bar": four_bar()}


@pytest.mark.parametrize("across", [2, 1, 0])
@pytest.mark.parametrize("name", SCENES)
def test_operations_are_those_of_the_plane(name, across):
    tables = SCENES[name]
    in_space = lifted(tables, across, "0.3 m")
    assert operations(in_space) <= DEARER * operations(tables)
    assert operations(in_space) < 0.8 * operations(with_analysis(in_space, motion="space"))


@pytest.mark.parametrize(
    ("name", "across"), [("chain of 2", 2), ("chain of 5", 1), ("four-bar", 2), ("four-bar", 0)]
)
def test_runs_are_those_of_the_plane(name, across):
    tables = SCENES[name]
    flat = build(symgen.Scene(**tables)).simulate(samples=21)
    run = build(symgen.Scene(**lifted(tables, across, "0.3 m"))).simulate(samples=21)
    assert run.axes == ("x", "y", "z")
    for variable in flat.variables:
        found = run[variable.name].values
        if found.ndim == 2:
            level = 0.3 if variable.name.endswith("position") else 0.0
            assert np.all(found[:, across] == level)
            found = found[:, [across - 2, across - 1]]
        assert found == pytest.approx(variable.values, rel=1e-12, abs=1e-12), variable.name


@pytest.mark.parametrize("across", [2, 1])
def test_every_output_is_that_of_space(across):
    """The same scene derived in space is another derivation of all that a run may record."""
    words = ["position", "velocity", "acceleration"]
    outputs = [f"{p}.{w}" for p in "AB" for w in words] + ["O.reaction", "C.reaction", "AB.tension"]
    outputs += ["OA.angular_velocity", "AB.A.force", "AB.M.force", "momentum", "angular_momentum"]
    outputs += ["energy", "kinetic_energy", "potential_energy"]
    tables = with_analysis(lifted(four_bar(), across, "0.3 m"), outputs=outputs)
    run = build(symgen.Scene(**tables)).simulate(0.3, samples=7)
    other = build(symgen.Scene(**with_analysis(tables, motion="space"))).simulate(0.3, samples=7)
    for name in outputs:
        found, expected = run[name].values, other[name].values
        assert found.shape == expected.shape
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * max(1.0, np.max(np.abs(expected)))), name
    assert np.max(np.abs(run["angular_momentum"].values), axis=0) == pytest.approx(
        np.max(np.abs(other["angular_momentum"].values), axis=0), rel=1e-7
    )


#: What takes the four-bar out of its plane z = 0, with what is said of it.
LEAVES = {
    "a load": ({"forces": [{"point": "A", "force": [0, 0, "1 N"]}]}, "forces.0 has a component along z"),
    "a load by time": ({"forces": [{"point": "A", "force": [0, 0, "c*A.vz + t*f"]}]}, "forces.0"),
    "gravity": ({"gravity": {"acceleration": [0, "-1 m/s^2", "g"]}}, "gravity.acceleration"),
    "a couple": ({"torques": [{"link": "OA", "torque": ["1 N*m", 0, 0]}]}, "torques.0"),
    "a velocity": ({"start": {"velocities": {"A": [0, 0, "1 m/s"]}}}, "start.velocities.A"),
    "a rate": ({"start": {"rates": {"OA": ["1 rad/s", 0, 0]}}}, "start.rates.OA"),
    "moving ground": ({"C": ["0 m", 0, "0.1 m*sin(t*w)"]}, "points.C.motion"),
    "a torsion spring": (
        {"torsion_springs": [{"link": "OA", "against": "AB", "stiffness": "1 N*m"}]},
        "torsion",
    ),
    "a point": ({"A": ["0.2 m", "0.3 m", "1 mm"]}, "its points lie in no plane"),
    "a load with a pole": ({"forces": [{"point": "A", "force": ["k/A.z", 0, 0]}]}, "forces.0 has no value"),
}


@pytest.mark.parametrize("what", LEAVES)
def test_what_leaves_the_plane_is_derived_in_space(what):
    changes, said = LEAVES[what]
    tables = lifted(four_bar()) | {k: v for k, v in changes.items() if len(k) > 1}
    tables["parameters"] = tables["parameters"] | {
        "f": "1 N/s", "g": {"value": "0 m/s^2", "tunable": True}, "w": "1 rad/s", "k": "1 N*m", "l": "0.1 m",
    }  # fmt: skip
    points = tables["points"]
    if what == "moving ground":
        points["C"] = points["C"] | {"motion": [0, 0, "l*sin(w*t)"]}
    if what == "a point":
        points["A"] = {"at": changes["A"]}
    linkage = resolve(check_scene(symgen.pipeline.build.text_of(symgen.Scene(**tables))))
    assert linkage.plane is None and linkage.dimension == 3
    assert said in linkage.leaves_plane


def test_modes_and_equilibria_keep_the_motion_across_the_plane():
    """A pendulum swings alike in both planes, and an upright one falls across the plane of its drawing too."""
    tables = lifted(chain(1) | {"gravity": {"acceleration": [0, "-9.81 m/s^2"]}, "start": {"velocities": {}}})
    model = build(symgen.Scene(**tables))
    assert len(model.description.free) * 2 == model.description.coordinates
    frequency = np.sqrt(1.5 * 9.81) / (2 * np.pi)
    assert model.modes().frequencies == pytest.approx([frequency, frequency], rel=1e-9)
    assert len(model.equilibrium(state=model.initial_state()).state.q) == 3


def test_a_state_off_the_plane_is_refused_and_the_word_lets_it_leave():
    tables = lifted(chain(1))
    model = build(symgen.Scene(**tables))
    places, swing = {"P1": [0.8, -0.6, 0]}, {"P1": [0, 0, 1]}
    with pytest.raises(ModelError, match=r'expected 0 along z, got 1.*\n.*motion = "space"'):
        model.state(places, swing)
    free = build(symgen.Scene(**with_analysis(tables, motion="space")))
    run = free.simulate(0.2, state=free.state(places, swing), samples=3)
    assert abs(run["P1.position"].values[-1, 2]) > 0.1
    with pytest.raises(ModelError, match="along z"):
        model.simulate(0.2, state=free.state(places, swing))


def test_the_word_is_for_points_in_space():
    with pytest.raises(SceneError, match=r"two coordinates") as error:
        resolve(symgen.Scene(**with_analysis(chain(1), motion="space")))
    assert "[analysis] motion" in str(error.value)


def test_explain_names_what_was_left_out(tmp_path):
    text = """
    symgen = 1
    [points]
    O = { at = [0, 0, 0], ground = true }
    A = { at = ["1 m", 0, 0] }
    [links]
    p = { points = ["O", "A"], mass = "1 kg" }
    [gravity]
    acceleration = [0, 0, "-9.81 m/s^2"]
    """
    for extra, said in {
        "": "omitted: motion across the plane y = 0, for all points, loads and starts lie in it",
        '[start.velocities]\nA = [0, "1 m/s", 0]': "start.velocities.A has a component along y",
        '[analysis]\nmotion = "space"': 'derived in space: analysis.motion = "space"',
    }.items():
        path = tmp_path / "pendulum.toml"
        path.write_text(text + extra)
        done = CliRunner().invoke(app, ["explain", str(path)])
        assert done.exit_code == 0, done
        assert said in done.stdout
        assert ("with motion across its plane" in done.stdout) == (not extra)


def test_a_state_that_rounding_took_off_the_plane_is_in_it():
    model = build(symgen.Scene(**lifted(chain(1))))
    near = {"P1": [0.8, -0.6, 1e-17]}
    assert model.state(near).q == pytest.approx([0.8, -0.6], abs=1e-16)
