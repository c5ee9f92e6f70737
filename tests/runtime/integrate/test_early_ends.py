"""Runs that end before their range, at dead centres or events: each is reported, also where all end early."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shared.linkages import at, ground, rod

import symgen
from symgen.errors import SimulationError
from symgen.report.sweeps import summary, sweep_study
from symgen.runtime.many.dataset import RECORDED
from symgen.runtime.sweeps.designs import Uniform
from symgen.study.sweeps import varied

CRANKS = (0.26, 0.28, 0.3)


@pytest.fixture(scope="module")
def model():
    """A four-bar of 35, 30 and 40 cm, drawn with a crank of 10 cm, which turns at 60 rpm for a second."""
    return symgen.build(
        symgen.Scene(
            parameters={"w": "60 rpm", "a": {"value": "10 cm", "tunable": True}},
            units={"length": "cm", "angle": "deg"},
            points={"O": ground(0, 0), "A": at(0.1, 0), "B": at(0.32, 0.27), "C": ground(0.4, 0)},
            links={
                "crank": rod("O", "A", length="a"),
                "coupler": rod("A", "B", length="35 cm"),
                "rocker": rod("C", "B", length="30 cm"),
            },
            drivers=[{"link": "crank", "angle": "w*t"}],
            analysis={"t_end": "1 s"},
        )
    )


def stop(crank):
    """The crank's angle at which coupler and rocker are in line, 65 cm from A to C."""
    return math.acos((crank**2 + 0.4**2 - 0.65**2) / (2 * crank * 0.4))


def angles_of(texts):
    return [float(str(text).partition("crank.angle = ")[2].partition(" deg")[0]) for text in texts]


@pytest.mark.parametrize("analysis", ["kinematics", "inverse_dynamics"])
def test_every_run_that_a_dead_centre_ends_is_named(model, analysis):
    exact = [math.degrees(stop(crank)) for crank in CRANKS]
    for options in ({"reduce": "peak"}, {"reduce": None}, {"reduce": np.max}):
        runs = getattr(model, f"{analysis}_many")({"a": [*CRANKS, 0.1]}, samples=41, **options)
        *ended, whole = runs["ended_early"].values
        assert angles_of(ended) == pytest.approx(exact, rel=1e-8) and whole == ""
        assert all("coupler and rocker in line" in text for text in ended)
    runs = model.sweep({"a": CRANKS}, analysis, samples=41)  # all of them
    assert angles_of(runs["ended_early"].values) == pytest.approx(exact, rel=1e-8)
    about = summary(runs)
    assert about["ended_early"] == 3 and about["failed"] == 0
    (note,) = [note for note in sweep_study(runs, about).notes if "ended early" in note]
    assert note.startswith(
        "3 of 3 runs ended early, and their values are of the part before; the first, a = 26 cm: dead"
    )


def test_the_same_number_of_samples_does_not_hide_an_early_end(model):
    """Cranks of 26 and 26.1 cm stop within one interval of 41 samples: equal counts, both short of the turn."""
    runs = model.sweep({"a": [0.26, 0.261]}, "kinematics", samples=41, of=["B"])
    assert np.ptp(runs[RECORDED].values) == 0 and summary(runs)["ended_early"] == 2


def test_requested_values_that_are_all_reached_are_no_early_end(model):
    inputs = [0.0, 0.5, 1.0]
    runs = model.kinematics_many({"a": CRANKS}, at=inputs, of=["A"])
    assert runs["ended_early"].values.tolist() == [""] * 3
    assert runs["A.position"].values[:, :, 0] == pytest.approx(np.outer(CRANKS, np.cos(inputs)), abs=1e-12)


def test_tolerances_and_optimisations_refuse_runs_that_all_end_early(model):
    of = {"a": Uniform(0.26, 0.3)}
    options = {"samples": 41, "of": ["B"]}
    match = r"2 of 2 runs ended early, the first at a = 26 cm: dead centre .* deg: coupler and rocker in line"
    with pytest.raises(SimulationError, match=match):
        model.tolerances(of, "kinematics", method="worst-case", **options)
    match = r"the optimisation came to a = 30 cm: the run ended early: dead centre"
    with pytest.raises(SimulationError, match=match):
        model.optimise(
            {"a": (0.26, 0.3)}, "B.position.range.x", start={"a": 0.3}, analysis="kinematics", **options
        )


def test_keys_of_the_scene_are_shown_as_they_are_written():
    model, vary, _ = varied("crank_rocker", {"links.crank.length": "26 cm,28 cm"})
    runs = model.sweep(vary, "kinematics", samples=21, of=["B"])
    study = sweep_study(runs, summary(runs))
    assert any("the first, links.crank.length = 0.26 m: dead centre" in note for note in study.notes)
    with pytest.raises(SimulationError, match=r"came to links\.crank\.length = 0\.26 m: the run ended early"):
        model.optimise(
            {"links_crank_length": (0.25, 0.3)},
            "B.position.range.x",
            analysis="kinematics",
            start={"links_crank_length": 0.26},
            samples=21,
            of=["B"],
        )


def test_an_event_that_ends_runs_is_named():
    """A mass falls from rest past a height h below its start after sqrt(2 h/g); the last one within 0.2 s does not."""
    model = symgen.build(
        symgen.Scene(
            parameters={"h": {"value": "0.1 m", "tunable": True}},
            points={"O": ground(0, 0), "P": at(0, 0), "E": ground(0, -1)},
            links={"rail": {"points": ["O", "E"]}},
            masses=[{"point": "P", "mass": "1 kg"}],
            guides=[{"points": ["P"], "along": "rail"}],
            gravity={"acceleration": [0, "-9.81 m/s^2"]},
            events=[{"name": "low", "of": "P.position.y + h", "ends_run": True}],
            analysis={"t_end": "0.2 s", "outputs": ["P.position"]},
        )
    )
    runs = model.simulate_many({"h": [0.05, 0.1, 0.3]}, reduce="final")
    *ended, whole = runs["ended_early"].values
    times = [float(text.partition("at t = ")[2].removesuffix(" s")) for text in ended]
    assert all("the event 'low'" in text for text in ended) and whole == ""
    assert times == pytest.approx(np.sqrt(2 * np.array([0.05, 0.1]) / 9.81), rel=1e-8)


@pytest.mark.parametrize("method", ["dop853", "radau5"])
def test_rounding_is_named_where_it_ends_a_run(method):
    """Masses from 1 to 1e12 kg: as the chain becomes straight, forces follow from differences of positions."""
    with pytest.raises(
        SimulationError, match=r"since rounding of the positions .*\n  Use precision 'longdouble'"
    ) as e:
        symgen.build("mass_ratios").simulate(0.15, method=method, rtol=1e-10)
    assert 0.1 < e.value.time < 0.12
    run = symgen.build("mass_ratios", precision="longdouble").simulate(0.15, rtol=1e-10)
    assert run.statistics["t"] == 0.15
    with pytest.raises(SimulationError, match="may be stiff\n  Loosen"):  # a pole, where rounding is no cause
        symgen.build(pole()).simulate(2.0, method=method)


def pole():
    """A crank under a torque that grows beyond all numbers at 1 s."""
    return symgen.Scene(
        parameters={"c": "1 N*m", "T": "1 s"},
        points={"O": {"at": [0, 0], "ground": True}, "A": {"at": ["1 m", 0]}},
        links={"crank": {"points": ["O", "A"], "mass": "1 kg"}},
        torques=[{"link": "crank", "torque": "c*T**2/(T - t)**2"}],
    )
