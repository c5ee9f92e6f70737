"""Errors of loops name row, angle, count and remedy."""

from __future__ import annotations

import copy
import math
import re

import numpy as np
import pytest
from shared.loop_scenes import PLANAR, bennett, deg, driven, m, planar_4r, rssr_start

import symgen
from symgen.errors import InitialStateError, SceneError, SimulationError, SymgenError

INCH = 0.0254
#: Largest S1 with which the crank of the example turns round, alpha4 = 270 deg: sqrt(a2^2 - (a1 + a4)^2).
LIMITS = {0: 48.538644, 10: 44.899889, 20: 38.418745, 30: 27.129320}


def data():
    return copy.deepcopy(symgen.load_scene("slider_crank").model_dump(exclude_unset=True))


def says(error, *words):
    """Every word is there, and a line of what to do."""
    text = str(error.value)
    missing = [w for w in words if w not in text]
    assert not missing, f"{missing} not in: {text}"
    assert "\n  " in text


@pytest.fixture(scope="module")
def crank():
    return symgen.build("slider_crank")


@pytest.fixture(scope="module")
def rocking():
    """A crank that cannot make a full revolution: 0.3, 0.4, 0.2, ground 0.25."""
    return symgen.build(planar_4r((0.3, 0.4, 0.2, 0.25)))


@pytest.mark.parametrize("a4", LIMITS)
def test_true_limits_of_the_offset(crank, a4):
    """A full turn just below the limit, none just above it, where the printed iteration gave up far sooner."""
    limit = math.sqrt(50**2 - (12 + a4) ** 2)
    assert limit == pytest.approx(LIMITS[a4], abs=1e-6)
    near = 1e-3
    run = crank.with_parameters(a4=a4 * INCH, S1=(limit - near) * INCH).inverse_dynamics(samples=73)
    assert len(run.time) == 73
    assert run.closure < 1e-12
    assert run.variable("S4").values[0] / INCH == pytest.approx(
        math.sqrt(limit**2 - (limit - near) ** 2), rel=1e-9
    )
    beyond = crank.with_parameters(a4=a4 * INCH, S1=(limit + near) * INCH)
    with pytest.raises(SymgenError) as error:
        beyond.inverse_dynamics(samples=73)
    says(error, "theta1 = 0 deg", "row", "assembled")


def test_offset_that_is_reached_on_the_way(crank):
    """S1 swings with the crank and passes its limit within the turn: the angle is named, the rest is kept."""
    swinging = crank.with_parameters(a4=30 * INCH, S1=44 * INCH, ratio=1.0)
    # b^2 - q = a2^2 - (a4 + a1 cos)^2 - S1^2 for alpha4 = 270 deg
    angles = np.linspace(0, math.pi, 200_001)
    room = 50**2 - (30 + 12 * np.cos(angles)) ** 2 - (44 * np.sin(angles)) ** 2
    end = math.degrees(angles[np.argmax(room < 0)])
    with pytest.raises(SimulationError) as error:
        swinging.inverse_dynamics()
    says(error, "row", "theta1 = ")
    assert named_angle(error) == pytest.approx(end, abs=0.01)
    reached = error.value.partial
    assert math.degrees(reached.variable("theta1").values[-1]) == pytest.approx(end, abs=1.0)
    assert reached.closure < 1e-12


def named_angle(error):
    return float(re.search(r"beyond theta1 = ([-\d.]+) deg", str(error.value)).group(1))


def test_branch_loss_in_a_full_turn_names_the_angle(rocking):
    """Coupler and rocker fold at cos = (0.2^2 - 0.3^2 - 0.25^2)/(2 0.3 0.25)."""
    end = math.degrees(math.acos((0.2**2 - 0.3**2 - 0.25**2) / (2 * 0.3 * 0.25)))
    with pytest.raises(SimulationError) as error:
        rocking.inverse_dynamics()
    says(error, "row", "rank", "joint R")
    assert named_angle(error) == pytest.approx(end, abs=1e-3)
    assert np.max(error.value.partial.variable("theta1").values) == pytest.approx(math.radians(138), abs=1e-9)


def test_angle_that_cannot_be_assembled(rocking):
    with pytest.raises(SimulationError) as error:
        rocking.inverse_dynamics(at=math.radians(150))
    says(error, "theta1 = 150 deg", "row")
    assert rocking.inverse_dynamics(at=math.radians(130)).closure < 1e-12


def test_no_assembly_at_an_angle_that_has_none(rocking):
    assert rocking.assemblies(math.radians(150)) == ()
    assert len(rocking.assemblies(math.radians(90))) == 2


def test_lengths_that_never_close():
    with pytest.raises((SceneError, InitialStateError)) as error:
        symgen.build(stretched()).inverse_dynamics()
    says(error, "theta1 = 0 deg", "row", "open by")


def stretched():
    """Ground longer than all the rest."""
    lengths = (0.1, 0.2, 0.3, 0.9)
    links = ("crank", "coupler", "rocker", "ground")
    rows = [
        ("R", link, {"theta": "theta1" if i == 0 else "?", "a": m(a)})
        for i, (link, a) in enumerate(zip(links, lengths, strict=True))
    ]
    return driven(rows, {})


def test_table_of_the_thesis_has_one_variable_too_few():
    """alpha3 fixed leaves each ball two turns: five unknowns for six equations, and S1 cannot be an input."""
    scene = data()
    scene["loop"]["rows"][2]["alpha"] = "90 deg"
    with pytest.raises(SceneError) as error:
        symgen.build(symgen.Scene(**scene))
    says(error, "rows.2", "alpha", "ball", "U")
    for row in (1, 2):
        scene["loop"]["rows"][row]["joint"] = "U"
    del scene["loop"]["start"]["alpha3"]
    scene["parameters"]["S1"]["value"] = "3.5 in"
    scene["parameters"]["a4"]["value"] = "30 in"
    scene["analysis"]["outputs"] = ["S4"]
    with pytest.raises((SceneError, InitialStateError)) as error:
        symgen.build(symgen.Scene(**scene)).inverse_dynamics()
    says(error, "C U U P", "5")


def test_too_many_variables():
    rows = [
        ("R", "crank", {"theta": "theta1", "a": "1 m"}),
        ("S", "coupler", {"theta": "?", "eta": "?", "a": "5 m"}),
        ("S", "rocker", {"theta": "?", "eta": "?", "alpha": "?", "a": "3 m"}),
        ("C", "ground", {"theta": "?", "S": "?", "alpha": "70 deg", "a": "4 m"}),
    ]
    with pytest.raises(SceneError) as error:
        symgen.build(driven(rows, rssr_start()))
    says(error, "7 dependent variables", "6 equations")


def test_skew_hinges_do_not_move():
    links = ("crank", "coupler", "rocker", "ground")
    rows = [
        ("R", link, {"theta": "theta1" if i == 0 else "?", "alpha": deg(20 * i + 10), "a": m(a)})
        for i, (link, a) in enumerate(zip(links, PLANAR, strict=True))
    ]
    with pytest.raises(SceneError) as error:
        symgen.build(driven(rows, {}))
    says(error, "theta1 = 0 deg", "rank", "3", "Fewer than 6")


def test_bennett_off_its_condition():
    with pytest.raises(SceneError) as error:
        symgen.build(bennett(1.05))
    says(error, "theta1 = 50 deg", "rank 3", "R R R R")


def test_link_without_mass_where_a_force_is_asked():
    scene = data()
    del scene["loop"]["links"]["rod"]
    with pytest.raises(SceneError) as error:
        symgen.build(symgen.Scene(**scene))
    says(error, "'rod'", "row 2", "mass")
    scene["analysis"]["outputs"] = ["S4", "S4.rate", "theta2"]
    assert symgen.build(symgen.Scene(**scene)).inverse_dynamics(samples=5).closure < 1e-13


@pytest.mark.parametrize(
    ("drives", "count"),
    [
        ({"theta1": "?", "s1": "0 lbf", "S4": "0 lbf"}, "got 1"),
        ({"theta1": "?", "s1": "?", "S4": "?"}, "got 3"),
    ],
)
def test_number_of_unknown_drives(drives, count):
    scene = data()
    scene["loop"]["drives"] = drives
    with pytest.raises(SceneError) as error:
        symgen.build(symgen.Scene(**scene))
    says(error, "2 (theta1, s1)", count)


def test_idle_spin_of_a_rod_that_is_not_round():
    scene = data()
    scene["loop"]["links"]["rod"]["centre"] = ["-a2/2", "1 in", 0]
    with pytest.raises(SceneError) as error:
        symgen.build(symgen.Scene(**scene))
    says(error, "rod", "rotational symmetry", "free")
