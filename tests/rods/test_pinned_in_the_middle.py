"""Statements of the pages on scenes: a pin between inner points of two links, and full turns with dwells."""

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from shared.linkages import at, ground

import symgen
from symgen.errors import SceneError

DOCS = Path(__file__).parents[2] / "docs"


def test_two_arms_with_a_pin_in_their_middles():
    """Under gravity the angle a of both arms to the floor falls by a'' = -3 g cos(a)/(2 l)."""
    page = (DOCS / "scene.md").read_text("utf-8")
    tables = tomllib.loads(re.search(r"middles:\n\n```toml\n(.*?)```", page, re.DOTALL)[1])
    tables["points"]["G"] = ground(2, 0)
    tables["links"]["floor"] = {"points": ["O", "G"]}
    scene = symgen.Scene(
        **tables,
        guides=[{"points": ["C"], "along": "floor"}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        analysis={
            "t_end": "0.2 s",
            "outputs": ["rise.angle", "fall.angle", "rise.angular_acceleration", "B.position"],
        },
    )
    run = symgen.build(scene).simulate(rtol=1e-11)
    angle = run["rise.angle"].values
    assert angle[0] == pytest.approx(math.atan2(0.6, 0.8)) and angle[-1] < angle[0] - 0.1
    assert run["rise.angular_acceleration"].values == pytest.approx(-1.5 * 9.81 * np.cos(angle), abs=1e-9)
    assert run["fall.angle"].values == pytest.approx(math.pi - angle, abs=1e-10)
    assert run["B.position"].values == pytest.approx(np.stack([0 * angle, np.sin(angle)], axis=1), abs=1e-10)


def indexer(angle):
    return symgen.Scene(
        parameters={"station": "-90 deg", "T": "1.2 s", "T1": "0.4 s"},
        points={"O": ground(0, 0), "W": at(0.25, 0)},
        links={"table": {"points": ["O", "W"], "mass": "3 kg"}},
        drivers=[{"link": "table", "angle": angle}],
        analysis={"t_end": "6 s", "outputs": ["table.angle", "table.angular_velocity", "table.torque"]},
    )


def test_full_turns_with_dwells():
    """Five stations, more than a turn; the modified sine by its integral, between them rest."""
    page = (DOCS / "scene_jumps.md").read_text("utf-8")
    (angle,) = re.findall(r'^angle = "(station.*?)"', page, re.MULTILINE)
    times = np.linspace(0.0, 6.0, 61)
    model = symgen.build(indexer(angle))
    x = np.clip(np.mod(times + 1e-12, 1.2) / 0.4, 0, 1)
    steps = np.floor(times / 1.2 + 1e-9)
    a = math.pi / (4 + math.pi)  # Chakraborty: quarters of a fast sine at both ends of a slow one
    first, last = a * x - a / (4 * math.pi) * np.sin(4 * math.pi * x), x >= 7 / 8
    middle = 2 / (4 + math.pi) + a * x - 9 * a / (4 * math.pi) * np.sin((4 * math.pi * x + math.pi) / 3)
    end = 4 / (4 + math.pi) + a * x - a / (4 * math.pi) * np.sin(4 * math.pi * x)
    profile = np.where(x <= 1 / 8, first, np.where(last, end, middle))
    for motion in (model.simulate(t_eval=times, rtol=1e-11), model.inverse_dynamics(at=times, over="time")):
        found = motion["table.angle"].values
        assert found == pytest.approx(-math.pi / 2 * (steps + profile), abs=1e-8)
        rest = (x == 1) & (np.mod(times, 1.2) > 0.45)
        assert np.abs(motion["table.torque"].values[rest]).max() < 1e-9
    assert found[-1] == pytest.approx(-2.5 * math.pi)
    with pytest.raises(
        SceneError, match="jumps from .* with mod(.|\n)*Let the parts of mod end as they begin"
    ):
        symgen.build(indexer(angle.replace("+ profile", "+ 0.9*profile")))
