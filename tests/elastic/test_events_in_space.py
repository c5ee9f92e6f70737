"""Events of runs of elastic links in space, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.in_numpy import build

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.integrate.pace import Pace

SECTION = {"diameter": "4 mm"}
ELASTIC = {"E": "210 GPa", "elements": 2, "shear": {"poisson": 0.3}}
ROD = {"density": "7850 kg/m^3", "section": SECTION, "elastic": ELASTIC}
G, SPEED, ARM = 9.81, 30.0, 0.05


def at(*place, **keys):
    return {"at": [f"{x} m" for x in place], **keys}


def falling(*events, **more):
    """Return a rod that falls, thrown upwards; nothing strains it."""
    return symgen.Scene(
        points={"A": at(0, 0, 0), "B": at(0.2, 0.1, 0), "O": at(0, 0, -1, ground=True)},
        links={"rod": {"points": ["A", "B"], **ROD}},
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"-{G} m/s^2"]},
        start={"velocities": {p: ["0 m/s", "0 m/s", "0.5 m/s"] for p in "AB"}},
        events=list(events),
        analysis={"t_end": "0.2 s"},
        **more,
    )


def test_events_of_a_thrown_rod():
    """Height v t - g t^2/2: its top, and its way down through the start and through -0.05 m, where the run ends.

    Its strains are round-off, which no steps reduce: the run with twice the steps is the last.
    """
    v = 0.5
    run = build(
        falling(
            {"name": "top", "of": "A.velocity.z", "direction": "falling"},
            {"name": "back", "of": "(A.position.z + B.position.z)/2"},
            {"name": "rising", "of": "A.velocity.z", "direction": "rising"},
            {"name": "ground", "of": "B.position.z", "value": "-0.05 m", "ends_run": True},
            {"name": "later", "of": "t", "value": "0.18 s"},
        )
    ).simulate(samples=21)
    low = (v + math.sqrt(v**2 + 2 * G * 0.05)) / G
    assert [(e.name, e.rising) for e in run.events] == [("top", False), ("back", False), ("ground", False)]
    np.testing.assert_allclose([e.time for e in run.events], [v / G, 2 * v / G, low], rtol=1e-9)
    place = run.events[-1].motion["A"]
    assert place["position"][2] == pytest.approx(-0.05, abs=1e-9)
    assert place["velocity"][2] == pytest.approx(v - G * low, rel=1e-8)
    assert run.time[-1] <= low < run.time[-1] + 0.01
    assert any("'ground' ended the run" in note for note in run.notes)
    assert run.statistics["steps"] == 4 * (len(run.time) - 1)
    assert run.statistics["error"] < 2e-3 and run.mesh_error < 2e-3


def test_events_of_a_driven_crank():
    """The drive prescribes the pin, and so the times at which it passes the plane through its axis."""
    scene = symgen.Scene(
        parameters={"w": f"{SPEED} rad/s"},
        points={"K": at(0, 0, 0, ground=True), "A": at(0, ARM, 0), "B": at(0, ARM, -0.3)},
        links={"crank": {"points": ["K", "A"], "mass": "0.1 kg"}, "rod": {"points": ["A", "B"], **ROD}},
        joints=[{"point": "K", "links": ["crank"], "kind": "revolute", "axis": [0, 0, 1]}],
        welds=[{"point": "A", "links": ["rod", "crank"]}],
        drivers=[{"link": "crank", "angle": "w*t"}],
        events=[{"name": "passes", "of": "A.position.y"}],
        analysis={"t_end": "0.2 s"},
    )
    run = build(scene).simulate(0.12, samples=7, rtol=1e-2)
    np.testing.assert_allclose([e.time for e in run.events], [math.pi / 2 / SPEED], rtol=1e-7)
    assert not run.events[0].rising and len(run.time) == 7


def test_a_run_that_ends_before_its_second_sample_is_refused():
    event = {"name": "early", "of": "t", "value": "0.01 s", "ends_run": True}
    with pytest.raises(ModelError, match="'early' ends the run at t = 0.01 s, before the second sample"):
        build(falling(event)).simulate(samples=3)


def test_a_run_that_max_wall_ends_has_its_events(monkeypatch):
    """The run is ended within its first pass, after the event."""
    monkeypatch.setattr(Pace, "chunk", lambda self: 1)
    monkeypatch.setattr(Pace, "spent", lambda self, t, reason: t > 0.08)
    event = {"name": "top", "of": "A.velocity.z", "direction": "falling"}
    with pytest.raises(SimulationError, match="max_wall") as ended:
        build(falling(event)).simulate(samples=21, max_wall=100.0)
    part = ended.value.partial
    assert part.statistics["error"] is None and 0.06 < part.time[-1] <= 0.081
    np.testing.assert_allclose([e.time for e in part.events], [0.5 / G], rtol=1e-9)
