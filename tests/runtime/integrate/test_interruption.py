"""Ctrl-C ends long calls at once: compiled loops look at signals, and sizes have limits."""

from __future__ import annotations

import signal
import time
from functools import partial

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import ModelError

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs timers of Unix")


def many_loops():
    model = symgen.build("rssr")
    name = next(iter(model.parameters))
    values = model.parameters[name] * np.linspace(1.0, 1.001, 3000)
    return lambda: model.kinematics_many({name: values}, samples=1000, threads=1, reduce=np.max)


def many_runs():
    model = symgen.build("four_bar")
    options = {"method": "rk4", "step": 1e-4, "threads": 1, "reduce": np.max}
    begin = model.initial_state()
    model.simulate_many({}, states=[begin], t_end=0.1, **options)  # compiles
    return lambda: model.simulate_many({}, states=[begin] * 3000, **options)


def analysis(scene, verb):
    model = symgen.build(scene)
    return lambda: getattr(model, verb)(samples=1_000_000)


@pytest.mark.parametrize(
    ("prepare", "after"),
    [
        (partial(analysis, "rssr", "inverse_dynamics"), 1.0),
        full(partial(analysis, "rssr", "inverse_dynamics"), 4.0),
        full(partial(analysis, "rssr", "kinematics"), 1.0),
        full(partial(analysis, "crank_rocker", "kinematics"), 1.0),
        full(partial(analysis, "crank_rocker", "kinematics"), 3.0),
        full(partial(analysis, "bricard", "inverse_dynamics"), 1.0),
        full(partial(analysis, "bricard", "inverse_dynamics"), 6.0),
        full(many_loops, 1.0),
        full(many_runs, 1.0),
    ],
)
def test_ctrl_c_is_not_kept_waiting(prepare, after):
    """The exception comes within a second of the signal; without looks at signals, after the whole call."""
    sent, call = [], prepare()

    def stop(number, frame):
        del number, frame
        sent.append(time.perf_counter())
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    asked = time.perf_counter() + after
    try:
        signal.setitimer(signal.ITIMER_REAL, after)
        with pytest.raises(KeyboardInterrupt):
            call()
        assert time.perf_counter() - asked < 1.5
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert sent


def test_a_loop_works_after_an_interruption():
    """An interrupted call leaves no error behind for the next one."""
    model = symgen.build("rssr")
    expected = model.kinematics(samples=11)
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with pytest.raises(KeyboardInterrupt):
            model.kinematics(samples=1_000_000)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    found = model.kinematics(samples=11)
    for x, y in zip(found.variables, expected.variables, strict=True):
        assert x.values.tobytes() == y.values.tobytes()


@pytest.mark.parametrize("verb", ["kinematics", "inverse_dynamics"])
def test_sizes_of_loops_have_limits(verb):
    model = symgen.build("rssr")
    with pytest.raises(ModelError, match="between 2 and 1 million samples, got 10000000"):
        getattr(model, verb)(samples=10_000_000)
    with pytest.raises(ModelError, match="at most 1 million values, got 1000001"):
        getattr(model, verb)(at=np.linspace(0.0, 1.0, 1_000_001))
