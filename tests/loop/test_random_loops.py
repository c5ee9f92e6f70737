"""Random single loops: closed means closed, refused means that none closes."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from shared.drawn_loops import draw, judge
from shared.full import full

import symgen
from symgen.runtime.loop.frames import ball_angles

#: Seeds of loops without and with a screw; the first have every outcome among them.
SOME = [*((seed, False) for seed in range(101, 109)), (6, True), (8, True)]
ALL = [*((seed, False) for seed in range(100, 200)), *((seed, True) for seed in range(30))]


@pytest.mark.parametrize("seeds", [SOME, full(ALL)], ids=["some", "all"])
def test_random_loops(seeds):
    outcomes: Counter[str] = Counter()
    for seed, helical in seeds:
        outcome, wrong = judge(draw(seed, helical), f"random_loop_{seed}")
        assert not wrong, f"loop {seed}{' with a screw' if helical else ''}, {outcome}: {wrong}"
        outcomes[outcome] += 1
    assert set(outcomes) >= {"built", "idle", "cannot be assembled", "cannot follow"}
    assert outcomes["built"] >= 2


@pytest.mark.parametrize(("name", "count"), [("rssr", 4), ("slider_crank", 4), ("bennett", 1)])
def test_every_choice_of_the_angles_of_balls_closes(name, count):
    model = symgen.build(name)
    begin = model.closed_start()
    choices = ball_angles(model.kernels, begin.q)
    assert len(choices) == count
    for q in choices:
        defect = model.kernels("position", begin.t, q, np.zeros_like(q))["closure_defect"]
        assert np.max(np.abs(defect)) < 1e-14 * max(1.0, model.description.size)


def test_angles_of_balls_whose_second_spin_is_held():
    """The constant alpha of the two balls of a link may be in either row."""
    rows = [
        {"joint": "R", "link": "crank", "theta": "theta1", "a": "1 m"},
        {"joint": "S", "link": "coupler", "theta": "?", "eta": "?", "alpha": "?", "a": "5 m"},
        {"joint": "S", "link": "rocker", "theta": "?", "eta": "?", "alpha": "20 deg", "a": "3 m"},
        {"joint": "R", "link": "ground", "theta": "?", "S": "1.5 m", "alpha": "70 deg", "a": "4 m"},
    ]
    loop = {"rows": rows, "inputs": {"theta1": "w*t"}}
    model = symgen.build(symgen.Scene(parameters={"w": "1 rad/s"}, loop=loop).called("spin_held_behind"))
    begin = model.closed_start()
    choices = ball_angles(model.kernels, begin.q)
    assert len(choices) == 4
    for q in choices:
        defect = model.kernels("position", begin.t, q, np.zeros_like(q))["closure_defect"]
        assert np.max(np.abs(defect)) < 1e-13
