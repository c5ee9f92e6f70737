"""Chains and trees of scenes: the recursion against the derived equations, and what is refused."""

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError

TREE = """
symgen = 1
title = "A tree of five rods"
[parameters]
pitch = "0.4 m"
kilogram = "1 kg"
turn = "0.5 rad/s"
[points]
P2 = { at = ["0.9 m", "0.5 m"] }
P1 = { at = ["0.5 m", "0 m"] }
P0 = { at = ["0.1 m", "0.2 m"], ground = true }
"Q{k=1 to 3}" = { at = ["0.5 m", "-{k}*pitch"] }
[links]
"arm{k=2 to 3}" = { points = ["Q{k}", "Q{k-1}"], mass = "{k}*kilogram", centre = 0.3, inertia = "0.02 kg*m^2" }
first = { points = ["P1", "P0"], mass = "1 kg", centre = 0.2 }
second = { points = ["P1", "P2"], mass = "2 kg" }
arm1 = { points = ["P1", "Q1"], mass = "0.5 kg" }
[[masses]]
point = "Q3"
mass = "0.3 kg"
[gravity]
acceleration = ["0.4 m/s^2", "-9.81 m/s^2"]
[start.rates]
first = "1 rad/s"
second = "-2 rad/s"
"arm{k=1 to 3}" = "{k}*turn"
[analysis]
t_end = "0.1 s"
outputs = ["Q3.position"]
"""


def scene(tmp_path, text=TREE):
    file = tmp_path / "tree.toml"
    file.write_text(text)
    return file


def test_the_recursion_gives_the_motion_of_the_derived_equations(tmp_path):
    """Rods written from either end, with centres off the middle, in another order than from the base."""
    file = scene(tmp_path)
    found, model = symgen.build_chain(file), symgen.build(file)
    motion = found.chain.accelerations(found.positions, found.velocities)
    expected = model.accelerations()
    assert found.points[:2] == ("P0", "P1") and sorted(found.links) == sorted(model.description.links)
    for name, acceleration in zip(found.points[1:], motion.accelerations[1:], strict=True):
        np.testing.assert_allclose(acceleration, expected[name], rtol=0, atol=1e-12 * 50)
    run = found.chain.simulate(found.t_end, found.positions, found.velocities)
    tip = np.asarray(model.simulate(t_end=found.t_end, rtol=1e-10)["Q3.position"])[-1]
    np.testing.assert_allclose(run.positions[-1, found.points.index("Q3")], tip, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        (
            "[links]",
            '[links]\nclosing = { points = ["P2", "Q3"], mass = "1 kg" }',
            "arm3: this link closes a loop",
        ),
        (
            'P2 = { at = ["0.9 m", "0.5 m"] }',
            'P2 = { at = ["0.9 m", "0.5 m"], ground = true }',
            "one ground point",
        ),
        (
            "[gravity]",
            '[[springs]]\nbetween = ["P2", "Q3"]\nstiffness = "1 N/m"\nlength = "1 m"\n[gravity]',
            "springs",
        ),
        ('second = "-2 rad/s"\n', "", "second: expected the rates of all links"),
        (
            "[start.rates]",
            '[start.velocities]\nP1 = ["1 m/s", "2 m/s"]\n[start.rates]',
            r"rates\] first: .*velocity of P1",
        ),
        ('mass = "2 kg" }', 'mass = "2 kg", length = "0.7 m" }', r"links.second\] length: .*drawn lengths"),
    ],
)
def test_what_a_chain_has_not_is_refused_by_its_key(tmp_path, old, new, where):
    assert old in TREE
    with pytest.raises(SceneError, match=where):
        symgen.build_chain(scene(tmp_path, TREE.replace(old, new)))


@pytest.mark.parametrize("kind", ["motion", "kinematics"])
def test_scenes_of_too_many_points_name_chains(kind):
    """Their matrices would take 6.6 GB at 10,000 points."""
    count = 5_001
    links = {f"L{i}": {"points": [f"P{i}", f"P{i + 1}"], "mass": "1 kg"} for i in range(count)}
    points = {f"P{i}": {"at": [f"{i} m", "0 m"], "ground": i == 0} for i in range(count + 1)}
    analysis = {"t_end": "1 s"} | ({"kind": kind} if kind == "kinematics" else {})
    scene = symgen.Scene(
        points=points, links=links, gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}, analysis=analysis
    )
    words = r"\[points\].* 10002 coordinates; equations are derived for at most 10000\n  symgen.build_chain"
    with pytest.raises(SceneError, match=words):
        symgen.build(scene)
