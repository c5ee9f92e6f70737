"""Runs from given states: angles in loads count revolutions from there, which a note says."""

from __future__ import annotations

from shared.in_numpy import build

import symgen

DOOR = {
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
    "links": {"door": {"points": ["O", "A"], "mass": "1 kg"}},
    "torsion_springs": [{"link": "door", "stiffness": "10 N*m", "angle": "170 deg"}],
    "start": {"rates": {"door": "-20 rad/s"}},
    "gravity": {"acceleration": ["0 m/s^2", "0 m/s^2"]},
}


def notes_of_a_restart(**tables) -> str:
    model = build(symgen.Scene(**tables))
    whole = model.simulate(0.2, samples=3)
    state = model.state({"A": whole.final["A"]["position"]}, {"A": whole.final["A"]["velocity"]}, 0.2)
    assert not any("revolutions" in note for note in whole.notes)
    return " ".join(model.simulate(0.3, samples=3, state=state).notes)


def test_a_run_from_a_given_state_says_that_springs_count_revolutions_anew():
    assert "the given state has no revolutions: angles of loads and torsion springs" in notes_of_a_restart(
        **DOOR
    )


def test_a_run_from_a_given_state_without_angles_in_loads_has_no_such_note():
    assert "revolutions" not in notes_of_a_restart(
        **{k: v for k, v in DOOR.items() if k != "torsion_springs"}
    )
