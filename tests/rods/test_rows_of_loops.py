"""Rows of parallel loops, eliminated by minimum degree: singular poses and redundant constraints."""

from __future__ import annotations

import numpy as np
import pytest
from shared.stability_truths import compound_pendulum

import symgen
from symgen.errors import SceneError

RATE = 10.0


def row(cranks, couplers, angle=np.pi / 2, **more):
    """Return cranks of 1 m and 1 kg at an angle, 1 m apart, whose ends A0, A1, ... carry couplers."""
    x, y = np.cos(angle), np.sin(angle)
    velocity = [f"{float(-RATE * y)!r} m/s", f"{float(RATE * x)!r} m/s"]
    points = {f"O{k}": {"at": [f"{k} m", "0 m"], "ground": True} for k in range(cranks)}
    points |= {f"A{k}": {"at": [f"{float(k + x)!r} m", f"{float(y)!r} m"]} for k in range(cranks)}
    links = {f"crank{k}": {"points": [f"O{k}", f"A{k}"], "mass": "1 kg"} for k in range(cranks)}
    return symgen.Scene(
        title="row of loops",
        points=points,
        links=links | couplers,
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        start={"velocities": {f"A{k}": velocity for k in range(cranks)}},
        analysis={"outputs": [f"A{cranks - 1}.position"], "t_end": "1 s"},
        **more,
    )


def rods(cranks):
    return {f"rod{k}": {"points": [f"A{k}", f"A{k + 1}"], "mass": "2 kg"} for k in range(cranks - 1)}


def bodies(cranks):
    """Bodies of 2 kg on three cranks each: one of the three is redundant."""
    made = {}
    for k in range(0, cranks - 1, 2):
        places = {"centre": ["1 m", "0 m"], "inertia": "0.7 kg*m^2", "mass": "2 kg"}
        made[f"body{k}"] = {"points": [f"A{k}", f"A{k + 1}", f"A{k + 2}"], **places}
    return made


@pytest.mark.parametrize(("cranks", "couplers", "redundant"), [(6, rods, 0), (7, bodies, 3)])
def test_a_row_through_its_collinear_states(cranks, couplers, redundant):
    """All couplers translate: the row is a pendulum. Twice per revolution every loop loses rank."""
    made = couplers(cranks)
    scene = row(cranks, made)
    order = symgen.derive(scene).saddle_point.order
    assert min(order[1 - cranks :]) < 2 * cranks, "multipliers of the loops come last: not minimum degree"
    model = symgen.build(scene)
    assert len(model.redundant) == redundant
    result = model.simulate(rtol=1e-12, samples=21)
    moment, inertia = cranks / 2 + 2 * len(made), cranks / 3 + 2 * len(made)
    angle = compound_pendulum(result.time, np.pi / 2, RATE, moment, inertia)
    expected = np.column_stack([cranks - 1 + np.cos(angle), np.sin(angle)])
    assert result[f"A{cranks - 1}.position"].values == pytest.approx(expected, abs=1e-9)
    assert f"passed {angle[-1] // np.pi:.0f} losses of rank" in " ".join(result.notes)


def test_a_row_cannot_start_in_its_collinear_state():
    with pytest.raises(SceneError, match=r"9 constraints of rank 5 there, and of a higher one nearby"):
        symgen.build(row(5, rods(5), angle=0.0))
