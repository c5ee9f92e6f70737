"""Limits of wall time, and what a long run says of its remaining time."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, SimulationError

CASES = Path(__file__).parents[2] / "cases"


def ended(run, set_up=2.0):
    """Return the error of a run that is limited to 0.1 s of wall time, and was estimated to take longer."""
    begun = time.perf_counter()
    with pytest.raises(
        SimulationError, match=r"ended after max_wall = 0\.1 s of wall time, at t = "
    ) as caught:
        run()
    assert time.perf_counter() - begun < 0.1 + set_up
    return caught.value


def test_runs_end_at_max_wall(tmp_path):
    """Uniform rotation, a free loop and an elastic link: the wall time holds, and what was recorded is right."""
    spin = tmp_path / "spin.toml"
    spin.write_text(
        'symgen = 1\n[points]\nO = { at = ["0 m", "0 m"], ground = true }\nA = { at = ["1 m", "0 m"] }\n'
        '[links]\nOA = { points = ["O", "A"], mass = "1 kg" }\n'
        '[start]\nvelocities = { A = ["0 m/s", "2 m/s"] }\n[analysis]\noutputs = ["A.position"]\n'
    )
    for backend, end in (("auto", 1e6), ("numpy", 1e4)):
        model = symgen.build(spin, backend=backend)
        error = ended(lambda model=model, end=end: model.simulate(end, samples=int(end) + 1, max_wall=0.1))
        places = error.partial.variable("A.position").values
        t = np.arange(len(places))
        assert error.partial.time == pytest.approx(t)
        assert 1.0 < error.time < end
        few = slice(0, 20)  # the angle is 2 t
        assert places[few] == pytest.approx(np.stack([np.cos(2 * t), np.sin(2 * t)], axis=1)[few], abs=1e-6)
    model = symgen.build(CASES / "free_par.toml", backend="numpy")
    ended(lambda: model.simulate(1e3, max_wall=0.1))
    model = symgen.build("thesis_four_bar", backend="numpy")
    model.simulate(steps=4, samples=2)  # its equations are derived by the first run
    for options in ({"rtol": 1e-9}, {"method": "dop853", "rtol": 1e-12}):
        ended(lambda options=options: model.simulate(revolutions=1000, max_wall=0.1, **options), set_up=5.0)


def test_max_wall_counts_assembling_and_ends_sweeps_and_chains(monkeypatch):
    model = symgen.build("thesis_four_bar", backend="numpy")
    speeds = (np.linspace(900, 1000, 400) * np.pi / 30).tolist()
    calls = {
        "elements": lambda limit: model.large_rotation(elements=3, revolutions=50.0, max_wall=limit),
        "speed_response": lambda limit: model.speed_response(speeds, samples=8, rtol=0.5, max_wall=limit),
        "chain": lambda limit: symgen.Chain([1.0, 1.0], [1.0, 1.0]).simulate(
            1e5, [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], method="rk4", step=1e-3, samples=10**6, max_wall=limit
        ),
    }
    partial = {}
    for name, call in calls.items():
        for limit in (1e-3, 0.1):
            begun = time.perf_counter()
            with pytest.raises(SimulationError, match=rf"ended after max_wall = {limit:g} s") as caught:
                call(limit)
            assert time.perf_counter() - begun < limit + 3.0, name
            partial[name] = caught.value.partial
        with pytest.raises(ModelError, match="expected max_wall to be a finite number above zero"):
            call(-1.0)

    clock = time.perf_counter

    def expire(_):
        monkeypatch.setattr(time, "perf_counter", lambda: clock() + 600.0)

    with pytest.raises(SimulationError, match=r"after max_wall = 600 s(.*\n)*  1 of 400 speeds") as caught:
        model.speed_response(speeds, samples=8, rtol=0.5, max_wall=600.0, progress=expire)
    assert caught.value.partial.speeds == pytest.approx([900.0 * math.pi / 30])
    chain = partial["chain"]
    assert 0.01 < chain.times[-1] < 1e5
    assert np.ptp(chain.energy) < 1e-6


def test_a_long_run_announces_its_remaining_time_once(monkeypatch):
    from symgen.errors import SlowRunWarning

    monkeypatch.setattr("symgen.runtime.integrate.pace.SPAN", 0.2)
    model = symgen.build("four_bar", backend="numpy")
    begun = time.perf_counter()
    with pytest.warns(SlowRunWarning) as notes, pytest.raises(SimulationError):
        model.simulate(1e5, max_wall=0.6)
    assert time.perf_counter() - begun < 2.5
    (note,) = notes
    assert re.search(
        r"of 100000 s after 0\.\d+ s: about [\d.]+ (hours|days|min) remain at this pace", str(note.message)
    )
