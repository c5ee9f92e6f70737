"""Notes on what a scene may not mean: loose links, missing loads, angular velocities in hertz."""

from __future__ import annotations

from pathlib import Path

import symgen
from symgen.scene.resolve import resolve

CASES = Path(__file__).parents[1] / "cases"


def test_loose_links_and_missing_loads_are_noted():
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["1 m", "0 m"]},
            "B": {"at": ["1 m", "0 m"]},
            "C": {"at": ["2 m", "0 m"]},
        },
        links={
            "held": {"points": ["O", "A"], "mass": "1 kg"},
            "loose": {"points": ["B", "C"], "mass": "1 kg"},
        },
        analysis={"t_end": "0.1 s", "outputs": ["C.position"]},
    )
    notes = symgen.build(scene, backend="numpy").simulate(samples=2).notes
    assert [n for n in notes if "link loose is joined to nothing else" in n]
    assert [n for n in notes if "no gravity and no load" in n]
    motor = symgen.build("elastic_four_bar_motor", backend="numpy")
    assert not motor.description.remarks, "its crank has a torque"
    driven = symgen.build(CASES / "event_wrap.toml", backend="numpy").simulate(0.1, samples=2)
    assert not [n for n in driven.notes if "no load" in n], "its motion is prescribed"


def test_angular_velocities_in_hertz_are_noted():
    def notes(speed, angle):
        of = symgen.load_scene("crank_rocker", set={"parameters.speed": speed, "drivers.0.angle": angle})
        return [n for n in resolve(of).remarks if "Hz" in n]

    assert not notes("60 rpm", "speed*t") and not notes("1 Hz", "2*pi*speed*t")
    (note,) = notes("1 Hz", "speed*t")
    assert note.startswith("drivers.0.angle") and "rev/s" in note


def test_loose_links_and_missing_loads_of_elastic_scenes_are_noted():
    elastic = {
        "density": "7850 kg/m^3",
        "section": {"width": "20 mm", "thickness": "5 mm"},
        "elastic": {"E": "2.06e11 Pa", "elements": 1},
    }
    points = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.3 m", "0 m"]}}
    apart = {"B": {"at": ["1 m", "0 m"]}, "C": {"at": ["2 m", "0 m"]}}
    crank = {"link": "crank", "speed": "30 rad/s"}
    bar, loose = {"points": ["O", "A"], **elastic}, {"points": ["B", "C"], "mass": "1 kg"}
    scene = symgen.Scene(points={**points, **apart}, links={"crank": bar, "loose": loose}, crank=crank)
    exact = symgen.build(scene).large_rotation(elements=3, revolutions=0.02, samples=3)
    assert [n for n in exact.notes if "link loose is joined to nothing else" in n]
    held = symgen.Scene(points=points, links={"crank": bar}, crank={**crank, "speed": "0 rad/s"})
    result = symgen.build(held, backend="numpy").quasi_static(samples=2)
    assert [n for n in result.notes if "no gravity and no load" in n]
