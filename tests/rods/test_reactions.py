"""Reactions of ground points that share a load: hinges, links between ground points."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError

CASES = Path(__file__).parents[1] / "cases"


@pytest.mark.parametrize("points", [["H1", "H2", "K"], ["H2", "K", "H1"], ["K", "H2", "H1"]], ids="".join)
def test_two_hinges_share_the_axial_force_equally_in_every_order(points):
    """A door on a vertical axis at rest: a couple of horizontal forces, and half its weight in each hinge."""
    mass, arm, height, g = 12.0, 0.45, 1.2, 9.81
    scene = symgen.Scene(
        points={
            "H1": {"at": ["0 m", "0 m", "0 m"], "ground": True},
            "H2": {"at": ["0 m", "0 m", f"{height} m"], "ground": True},
            "K": {"at": ["0.9 m", "0 m", "0.5 m"]},
        },
        links={
            "door": {
                "points": points,
                "mass": f"{mass} kg",
                "centre": [f"{arm} m", "0 m", "0.7 m"],
                "inertia": ["1.5 kg*m^2", "2.1 kg*m^2", "1.1 kg*m^2"],
            }
        },
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"{-g} m/s^2"]},
        analysis={"t_end": "0.1 s", "outputs": ["H1.reaction", "H2.reaction", "door.H1.force"]},
    )
    result = symgen.build(scene, backend="numpy").simulate(samples=2)
    side = mass * g * arm / height
    assert result["H1.reaction"].values[-1] == pytest.approx([side, 0, mass * g / 2], abs=1e-10)
    assert result["H2.reaction"].values[-1] == pytest.approx([-side, 0, mass * g / 2], abs=1e-10)
    assert result["door.H1.force"].values[-1] == pytest.approx([side, 0, mass * g / 2], abs=1e-10)
    assert any("door is held at the ground points" in note for note in result.notes)


def test_the_axial_parts_are_equal_in_motion():
    result = symgen.build(CASES / "hinge_split.toml", backend="numpy").simulate(samples=5)
    line = np.array([0.1, 0.0, 1.2])
    lower, upper = result["H1.reaction"].values @ line, result["H2.reaction"].values @ line
    assert lower == pytest.approx(upper, abs=1e-9)


def test_the_weight_of_a_link_between_ground_points_is_in_the_reactions():
    """A beam of 5 kg with 1 kg that hangs at a quarter of it."""
    result = symgen.build(CASES / "rail_weight.toml", backend="numpy").simulate(samples=2)
    assert result["O.reaction"].values[-1] == pytest.approx([0, 9.81 * (5 / 2 + 3 / 4)], abs=1e-10)
    assert result["P.reaction"].values[-1] == pytest.approx([0, 9.81 * (5 / 2 + 1 / 4)], abs=1e-10)
    assert any("beam lies between the ground points" in note for note in result.notes)


def test_a_body_on_two_ground_points():
    """Moments about either point give the parts across their line, whatever the line's slope."""
    g, arm = 9.81, 0.5
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "P": {"at": ["2 m", "1 m"], "ground": True},
            "A": {"at": ["3 m", "1 m"]},
        },
        links={
            "body": {
                "points": ["O", "P"],
                "mass": "1 kg",
                "centre": ["0.5 m", "0.9 m"],
                "inertia": "0.1 kg*m^2",
            },
            "rod": {"points": ["P", "A"], "mass": "1e-9 kg"},
        },
        gravity={"acceleration": ["0 m/s^2", f"{-g} m/s^2"]},
        analysis={"t_end": "0.1 s", "outputs": ["O.reaction", "P.reaction"]},
    )
    result = symgen.build(scene, backend="numpy").simulate(samples=2)
    o, p = result["O.reaction"].values[0], result["P.reaction"].values[0]
    across = np.array([-1.0, 2.0]) / math.sqrt(5)
    assert p @ across == pytest.approx(g * arm / math.sqrt(5), abs=1e-7)
    assert o @ across == pytest.approx(g * (2.0 - arm) / math.sqrt(5), abs=1e-7)
    assert o + p == pytest.approx([0, g], abs=1e-7)


def test_the_mass_of_a_link_between_moving_ground_points_is_refused():
    """What it would load are the reactions."""
    moving = {"at": ["1 m", "1 m"], "ground": True, "motion": ["v*t", "1 m"]}
    scene = symgen.Scene(
        parameters={"v": "1 m/s"},
        points={"O": {"at": ["0 m", "1 m"], "ground": True}, "P": moving, "A": {"at": ["1 m", "0 m"]}},
        links={
            "rail": {"points": ["O", "P"], "mass": "1 kg"},
            "rod": {"points": ["P", "A"], "mass": "1 kg"},
        },
    )
    with pytest.raises(SceneError, match="reactions do not include its inertia"):
        symgen.build(scene)
