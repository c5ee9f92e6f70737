"""Bounds on linkages and their classes: against lists without them, and grids of closed forms."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from shared.commands import call

import symgen
from symgen.errors import NoLinkageError, SceneError

CASE_1 = {"kind": "limits", "fixed_link": "1 m", "swing": "60 deg", "rocker_folded": "40 deg"}
SLIDER = {"kind": "limits", "linkage": "slider-crank", "stroke": "20 cm", "time_ratio": 1.2}


def pose(crank):
    """Return place and angle of the coupler AB of a drawn four-bar, by the intersection of two circles."""
    joint = 0.4 * np.array([math.cos(crank), math.sin(crank)])
    along = np.array([1.0, 0.0]) - joint
    e = np.hypot(*along)
    x = (e * e + 1.1**2 - 0.9**2) / (2 * e)
    x, y = (x * along + math.sqrt(1.1**2 - x * x) * np.array([-along[1], along[0]])) / e
    return [f"{float(v)!r} m" for v in joint], math.atan2(y, x)


PLACES, ANGLES = zip(*(pose(x) for x in (0.3, 0.9, 1.6, 2.4, 3.5)), strict=True)
POSES = {"kind": "motion", "points": [*PLACES], "angles": [*ANGLES], "starts": 60}


def lengths(designs):
    return [tuple(d.linkage.lengths.values()) for d in designs]


def test_generated_linkages_are_those_of_the_list_without_constraints():
    every = symgen.synthesise(POSES).designs
    bounded = [d for d in every if -0.5 <= d.linkage.O[1] <= 0.5]
    within = [d for d in bounded if d.linkage.lengths["coupler"] < 2.0]
    classes = sorted({d.linkage.grashof for d in within})[:1]
    wanted = [d for d in within if d.linkage.grashof in classes]
    assert 0 < len(wanted) < len(within) < len(every)
    task = {
        **POSES,
        "constraints": {"Oy": {"least": "-50 cm", "greatest": "0.5 m"}, "coupler": {"greatest": "2 m"}},
        "classes": classes,
    }
    found = symgen.synthesise(task)
    assert lengths(found.designs) == lengths(wanted)
    assert found.omitted["Oy"] == len(every) - len(bounded) and found.omitted["classes"] > 0


def best_of_case_1(least_ratio):
    """Return crank, coupler, rocker of best transmission over a grid of rockers, of a least time ratio."""
    c = np.linspace(0.05, 3.0, 400_001)
    far, near = (np.sqrt(c * c + 1 - 2 * c * math.cos(math.radians(x))) for x in (100, 40))
    a, b = (far - near) / 2, (far + near) / 2
    with np.errstate(invalid="ignore"):
        ends = [np.arccos((b * b + c * c - x * x) / (2 * b * c)) for x in (1 - a, 1 + a)]
        extended, folded = (np.arccos((s * s + 1 - c * c) / (2 * s)) for s in (a + b, b - a))
        ratio = (np.pi + folded - extended) / (np.pi - folded + extended)
        off = np.maximum(abs(ends[0] - np.pi / 2), abs(ends[1] - np.pi / 2))
    off[~((a < np.minimum(b, c)) & (a < 1) & (ratio >= least_ratio) & (ends[0] >= math.radians(30)))] = np.inf
    top = int(np.nanargmin(off))
    return a[top], b[top], c[top]


@pytest.mark.parametrize("ratio", [1.1, 1.19])
def test_the_best_transmission_under_a_bound_that_it_reaches(ratio):
    task = {**CASE_1, "transmission_least": ["30 deg", "90 deg"], "starts": 30}
    free = symgen.synthesise(task).designs[0]
    assert free.quantities["time_ratio"] < ratio
    (design,) = symgen.synthesise({**task, "constraints": {"time_ratio": {"least": ratio}}}).designs
    assert lengths([design])[0][:3] == pytest.approx(best_of_case_1(ratio), abs=3e-5)
    assert design.quantities["time_ratio"] == pytest.approx(ratio, abs=1e-6)


@pytest.mark.parametrize(
    ("task", "missed"),
    [
        ({**CASE_1, "transmission_least": "40 deg", "constraints": {"coupler/crank": {"greatest": 2.5}}},
         "the four-bar found does not meet the constraints: coupler/crank is 2.79966 at best, expected at most 2.5"),
        ({**CASE_1, "transmission_least": "40 deg", "constraints": {"max(crank, rocker)": {"greatest": "0.5 m"}}},
         "rocker\\) is 0.760219 m at best, expected at most 0.5 m"),
        ({**CASE_1, "transmission_least": "40 deg", "constraints": {"transmission_minimum": {"least": "45 deg"}}},
         "transmission_minimum is 40 deg at best, expected at least 45 deg"),
        ({**CASE_1, "transmission_least": "40 deg", "classes": ["double-crank"]},
         "classes are crank-rocker, expected double-crank"),
        ({**SLIDER, "transmission_least": "45 deg", "constraints": {"stroke/coupler": {"greatest": 0.5}}},
         "none of 2 slider-cranks found meets the constraints: stroke.coupler is"),
    ],
)  # fmt: skip
def test_without_a_linkage_the_nearest_values_are_named(task, missed):
    with pytest.raises(NoLinkageError, match=missed):
        symgen.synthesise(task)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"constraints": {"time_ratios": {"greatest": 1.1}}}, "unknown name 'time_ratios'\n  Did you mean 'time_ratio'"),
        ({"constraints": {"time_ratio": {"greatest": "1 m"}}}, "constraints.time_ratio\\] greatest: expected a plain"),
        ({"constraints": {"time_ratio": {}}}, "expected least, greatest or both"),
        ({"constraints": {"time_ratio": {"least": 2, "greatest": 1}}}, "up to the greatest, got 2 and 1"),
        ({"constraints": {"2": {"least": 2}}}, "expected a quantity of the linkages, got '2'"),
        ({"constraints": {"crank": {"most": 2}}}, "unknown key 'most'"),
        ({"constraints": {"crank + swing": {"least": 2}}}, "adds a length and"),
        ({"classes": ["crank-roker"]}, "expected a class of four-bar, got 'crank-roker'\n  Did you mean"),
    ],
)  # fmt: skip
def test_wrong_constraints_are_refused(more, message):
    with pytest.raises(SceneError, match=message):
        symgen.synthesise({**CASE_1, "transmission_least": "40 deg", **more})


def test_a_rocking_crank_has_no_transmission_over_a_revolution():
    """Such linkages are omitted where that is bounded; the command prints how many."""
    task = {**POSES, "constraints": {"transmission_minimum": {"least": "1 deg"}}}
    every = symgen.synthesise(POSES).designs
    least = math.radians(1)
    turning = [d for d in every if d.quantities.get("transmission_minimum", 0.0) >= least]
    assert lengths(symgen.synthesise(task).designs) == lengths(turning)


def test_the_command_prints_what_is_omitted_and_charts_have_bounds(tmp_path):
    file = tmp_path / "task.toml"
    table = "\n".join(f"{k} = {json.dumps(v)}" for k, v in {**CASE_1, "transmission_least": "40 deg"}.items())
    bounds = '[synthesis.constraints]\n"coupler/crank" = { greatest = 3 }\n'
    file.write_text(f"symgen = 1\n[synthesis]\n{table}\n{bounds}")
    assert "1 without a fault" in call("synthesise", file)
    data = json.loads(call("synthesise", file, "--vary", "swing=50deg:90deg:5", "--json"))
    for row in data["rows"]:
        ratios = [d["coupler"] / d["crank"] for d in row["designs"]]
        assert (ratios and max(ratios) <= 3) or "coupler/crank is" in row["reason"]
    assert {bool(row["designs"]) for row in data["rows"]} == {True, False}
