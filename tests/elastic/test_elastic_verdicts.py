"""Verdicts in results of elastic links: stability, neglected modes of a reduction, panels of plots."""

from __future__ import annotations

import io
import math
import pickle

import numpy as np
import pytest
from rich.console import Console
from shared.in_numpy import build

import symgen
from symgen.errors import CapabilityError, ModelError, SimulationError
from symgen.report.elastic import print_elastic_result
from symgen.runtime.elastic.large import passes
from symgen.runtime.result.elastic import is_stable
from symgen.scene.loading import read_scene

RPM = math.pi / 30


@pytest.fixture(scope="module")
def four_bar():
    return symgen.build("thesis_four_bar")


def test_undamped_vibrations_that_strains_do_not_show_do_not_make_it_unstable(four_bar):
    """With the steps that its strains need, the largest multiplier at 60 rpm came out as 1.09; it is one."""
    run = four_bar.with_parameters(speed=60 * RPM).periodic(samples=31)
    assert abs(run.floquet[0]) == pytest.approx(1.0, abs=1e-6)
    assert run.stable is True
    assert not any("unstable" in note for note in run.notes)


def test_multipliers_of_vibrations_that_steps_do_not_resolve(four_bar):
    run = four_bar.with_parameters(speed=60 * RPM).periodic(samples=31, steps=512)
    assert abs(run.floquet[0]) == pytest.approx(1.0, abs=1e-6)
    assert run.stable is True and run.statistics["floquet_error"] < 1e-6
    response = four_bar.speed_response([100 * RPM, 110 * RPM], rtol=1e-2, samples=31)
    assert response.unstable == pytest.approx((110.0 * RPM,))


def test_multipliers_of_too_few_steps_do_not_tell(four_bar):
    """The lowest vibrations, some 5 per revolution, are neither resolved by 8 steps nor much faster than the crank."""
    run = four_bar.with_parameters(speed=250 * RPM).periodic(samples=2, steps=8)
    assert run.stable is None and run.summary()["statistics"]["stable"] is None
    assert run.statistics["floquet_error"] is None
    assert any("not known whether it is stable" in note for note in run.notes)


def test_a_crank_much_slower_than_all_vibrations():
    """They decay in each revolution; with steps that do not resolve them, multipliers came out as one."""
    run = symgen.build("elastic_slider_crank", set={"speed": "0.01 rpm"}).periodic(samples=31)
    assert run.stable is True and abs(run.floquet[0]) < 1e-12
    assert run.statistics["error"] < 1e-4


def test_verdict():
    assert is_stable(1.0 + 5e-7, 0.0) is True
    assert is_stable(1.0001, 1e-9) is False
    assert is_stable(1.0001, 5e-4) is True
    assert is_stable(1.2, 0.01) is None
    assert is_stable(0.3, None) is None


def test_mesh_error_of_a_part_of_the_revolution():
    """The finer elements are stepped over the whole revolution too: with the steps to 0.05 rad it came out as 0.15."""
    model = symgen.build("elastic_slider_crank")
    part, whole = model.periodic(at=[0.05], steps=256), model.periodic(at=[0.05, 6.2], steps=256)
    assert part.mesh_error < 0.005 and whole.mesh_error < 0.005


def end_moment(**spring):
    """A strip of 2 elements under an abrupt end moment, optionally with a torsion spring at its tip."""
    points = {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.5 m", "0 m"]}}
    section = {"width": "20 mm", "thickness": "2 mm"}
    strip = {"points": ["O", "A"], "density": "7850 kg/m^3", "section": section}
    return symgen.Scene(
        points=points,
        links={"strip": strip | {"elastic": {"E": "210 GPa", "elements": 2}}},
        torques=[{"link": "strip", "point": "A", "torque": "1 N*m"}],
        torsion_springs=[{"link": "strip", "point": "A", **spring}] if spring else [],
        crank={"link": "strip", "speed": "0 rpm"},
        analysis={"t_end": "2 ms"},
    )


def test_notes_on_the_error_by_elements(monkeypatch, tmp_path):
    """A large error has the remedy; an unknown one the reason; saved results keep both."""
    model = build(end_moment())
    run = model.large_rotation(elements=1, samples=5, rtol=0.1)
    assert run.mesh_error > 0.05
    note = next(n for n in run.summary()["notes"] if "error by elements" in n)
    assert f"{100 * run.mesh_error:.0f} % of the peak stress" in note and "elements of the run" in note
    run.save(tmp_path / "run.npz")
    assert symgen.load_result(tmp_path / "run.npz").summary()["notes"] == run.summary()["notes"]

    def refused(*_, **__):
        raise ModelError("the finer elements are refused\n  Remedy.")

    unknown = model.large_rotation(elements=1, samples=5, rtol=0.1)
    monkeypatch.setattr(passes, "SystemRun", refused)
    assert unknown.mesh_error is None
    assert (
        unknown.summary()["notes"][-1] == "the error by elements is not known: the finer elements are refused"
    )
    stated = pickle.loads(pickle.dumps(unknown))
    assert stated.summary()["notes"] == unknown.summary()["notes"]


def test_the_remedy_for_a_moving_crank_is_a_key_of_its_scene(four_bar):
    with pytest.raises(CapabilityError, match=r"--set crank\.speed="):
        four_bar.equilibrium()


def test_loads_by_angles_have_no_balance_of_powers_and_a_note():
    run = build(end_moment(stiffness="8 N*m")).simulate(samples=5, steps=16)
    assert run.statistics["power_balance"] is None
    assert any("no balance of powers" in note and "counts revolutions" in note for note in run.notes)


def test_error_of_steps_that_are_given(four_bar):
    assert four_bar.periodic(steps=256, samples=31).statistics["error"] < 1e-2
    assert four_bar.periodic(steps=1, samples=2).statistics["error"] > 1.0


@pytest.mark.parametrize("kind", ["guyan", "craig-bampton"])
def test_a_reduction_is_told(kind):
    data = read_scene("elastic_slider_crank").data
    reduction = {"kind": kind, "modes": 2} if kind == "craig-bampton" else kind
    data["links"]["rod"]["elastic"]["reduction"] = reduction
    notes = symgen.build(symgen.Scene(**data)).simulate(samples=31).notes
    assert any(f"rod: reduced ({kind})" in note for note in notes)
    assert any("do not bend it" in note for note in notes) == (kind == "guyan")


def test_panels_by_kind(four_bar, tmp_path):
    run = four_bar.quasi_static(samples=3)
    labels = [axes.get_ylabel() for axes in run.plot(file=tmp_path / "run.svg").axes]
    assert len(labels) == len(set(labels)) == 6
    assert {"bending strain\n[microstrain]", "displacement\n[m]"} <= set(labels)
    (selected,) = run.plot("A.position.x", "B.position").axes
    assert selected.get_ylabel() == "position\n[m]"


def test_a_crank_at_rest_is_told_over_time():
    data = read_scene("rotating_cantilever").data
    data["crank"]["speed"] = "0 rpm"
    data["gravity"] = {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]}
    model = symgen.build(symgen.Scene(**data))
    run = model.simulate(samples=31)
    console = Console(width=100, record=True, file=io.StringIO())
    print_elastic_result(run, model, console)
    assert "at [s]" in console.export_text()
    assert run.coordinate.name == "time" and np.ptp(run.time) > 0.0


def test_statics_of_many_elements_by_a_banded_solver():
    """Root stress M h/I of a uniform load, and the deflection q L^4/8EI of the tip."""
    data = read_scene("rotating_cantilever").data
    data["crank"]["speed"] = "0 rpm"
    data["links"]["strip"]["elastic"]["elements"] = 30
    data["distributed_forces"] = [{"link": "strip", "force": ["0 N/m", "-4 N/m"]}]
    run = symgen.build(symgen.Scene(**data)).quasi_static(samples=2)
    moment_of_area = 0.05 * 0.005**3 / 12
    assert abs(run["root.stress"].values) == pytest.approx(2.0 * 0.0025 / moment_of_area, rel=1e-8)
    tip = run["tip.displacement"].values[:, 1]
    assert tip == pytest.approx(-4.0 / (8 * 210e9 * moment_of_area), rel=1e-8)


@pytest.mark.parametrize("rtol", [0.0, -1.0, 1.0, math.nan, 1e-320])
def test_a_tolerance_that_no_steps_meet_is_refused(four_bar, rtol):
    words = {math.nan: "a finite number for rtol", 1e-320: "rtol of at least 2.2e-14"}
    with pytest.raises(ModelError, match=f"expected {words.get(rtol, 'rtol above zero and below one')}"):
        four_bar.simulate(rtol=rtol)


@pytest.mark.parametrize("at", [[], [math.nan]])
def test_no_crank_angle_is_refused(four_bar, at):
    with pytest.raises(ModelError, match="expected finite crank angles"):
        four_bar.simulate(at=at)


def test_a_turn_is_told_over_degrees(four_bar):
    """Units in brackets are no markup."""
    console = Console(width=140, record=True, file=io.StringIO())
    print_elastic_result(four_bar.quasi_static(samples=31), four_bar, console)
    text = " ".join(console.export_text().split())
    assert "range over crank angle" in text and "least at [deg] greatest at [deg]" in text


def test_angles_asked_for_have_their_columns(four_bar):
    run = four_bar.simulate(method="gauss", at=[math.pi / 2, math.pi], rtol=1e-2)
    console = Console(width=140, record=True, file=io.StringIO())
    print_elastic_result(run, four_bar, console)
    text = console.export_text()
    line = next(line for line in text.splitlines() if "coupler.stress" in line)
    psi = 6894.757293168361
    shown = [psi * float(x) for x in line.split()[2:4]]
    assert shown == pytest.approx(run["coupler.stress"].values, rel=1e-5)
    words = " ".join(text.split())
    assert "over crank angle [deg]" in words and "at the selected crank angles only" in words


def test_a_steady_state_that_is_not_the_only_one():
    """Nothing sets the angle of a free shaft."""
    data = read_scene("rotating_cantilever").data
    data["crank"]["mode"] = "free"
    run = symgen.build(symgen.Scene(**data)).periodic(samples=31)
    assert any("not the only one" in note for note in run.notes)
    held = symgen.build("rotating_cantilever").periodic(samples=31)
    assert not any("not the only one" in note for note in held.notes)


def test_modes_in_a_line(four_bar):
    shown = repr(four_bar.modes(0.0))
    assert shown == "<ElasticModes 'thesis_four_bar' at 0 deg: 7.95038, 83.6901, 122.978, ... Hz, 10 modes>"


def test_stress_without_that_of_the_axial_force_is_told():
    model = symgen.build("elastic_slider_crank", set={"links.rod.elastic.axial": False})
    assert any("rod: kept at constant length" in note for note in model.quasi_static().notes)
    assert not any("constant length" in n for n in symgen.build("elastic_slider_crank").quasi_static().notes)


def test_links_too_stiff_for_an_explicit_method_are_said_to_be():
    stiff = symgen.build("thesis_four_bar", set={"E": "1e24 Pa"})
    with pytest.raises(SimulationError, match="too stiff for this method.*\n.*gauss"):
        stiff.simulate(method="dop853")


def test_a_speed_beyond_the_range_of_numbers_is_refused():
    model = symgen.build("elastic_four_bar").with_parameters(speed=1e200)
    with pytest.raises(
        SimulationError, match="forces of the rigid motion exceed the range of numbers at t = 0"
    ):
        model.quasi_static()
