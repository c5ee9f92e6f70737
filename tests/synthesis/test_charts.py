"""The best transmission in a range, and design charts over the swing, by the closed forms of the method file."""

from __future__ import annotations

import json
import math
import re
import tomllib

import numpy as np
import pytest
from shared.commands import call

import symgen
from symgen.errors import SceneError, SymgenError
from symgen.mechanics.synthesis.limits import QUANTITIES
from symgen.report.synthesis import plot_chart
from symgen.synthesis.charts import design_chart

CASE_1 = {"kind": "limits", "fixed_link": "1 m", "rocker_folded": "40 deg"}
CASE_2 = {"kind": "limits", "fixed_link": "1 m", "crank_extended": "30 deg", "crank_folded": "50 deg"}


def case_1(c, swing, folded):
    """Return crank, coupler, rocker and both extremes of the transmission angle, the fixed link being one."""
    far, near = (np.sqrt(c * c + 1 - 2 * c * np.cos(p)) for p in (folded + swing, folded))
    a, b = (far - near) / 2, (far + near) / 2
    least, greatest = (np.arccos((b * b + c * c - x * x) / (2 * b * c)) for x in (1 - a, 1 + a))
    return a, b, c, least, greatest


def case_2(swing, extended, folded):
    """Return crank, coupler and rocker, the fixed link being one."""
    k = math.sin(extended) / math.sin(folded)
    above = k * math.sin(folded - swing) - math.sin(extended)
    phi = math.atan2(above, math.cos(extended) - k * math.cos(folded - swing)) % math.pi
    c = math.sin(extended) / math.sin(phi + extended)
    far, near = c * math.sin(phi) / math.sin(extended), c * math.sin(phi - swing) / math.sin(folded)
    return (far - near) / 2, (far + near) / 2, c


def best_of_case_1(swing, folded):
    """Return lengths of the best transmission of Case I over a dense grid of rockers."""
    with np.errstate(invalid="ignore"):
        a, b, c, least, greatest = case_1(np.linspace(0.05, 3.0, 200_001), swing, folded)
    off = np.maximum(abs(least - np.pi / 2), abs(greatest - np.pi / 2))
    off[~((a < np.minimum(b, c)) & (least > math.radians(30)))] = np.inf
    top = int(np.nanargmin(off))
    return [x[top] for x in (a, b, c)], off[top]


def test_the_best_transmission_in_a_range():
    task = {**CASE_1, "swing": "60 deg", "transmission_least": ["30 deg", "90 deg"], "starts": 30}
    (design,) = symgen.synthesise(task).designs
    lengths, off = best_of_case_1(math.radians(60), math.radians(40))
    assert [*design.linkage.lengths.values()][:3] == pytest.approx(lengths, abs=1e-4)
    ends = [design.quantities[f"transmission_{end}"] for end in ("minimum", "maximum")]
    assert max(abs(x - math.pi / 2) for x in ends) == pytest.approx(off, abs=1e-4)


def test_a_chart_over_the_swing(tmp_path):
    """Case II: lengths by its closed form; no linkage where the rocker would not swing."""
    file, plot, page = tmp_path / "task.toml", tmp_path / "chart.png", tmp_path / "chart.html"
    lines = [f"{key} = {json.dumps(value)}" for key, value in CASE_2.items()]
    file.write_text(
        "\n".join(
            [
                "symgen = 1",
                "[units]",
                'length = "mm"',
                "[synthesis]",
                "starts = 20",
                'swing = "1 deg"',
                *lines,
            ]
        )
    )
    printed = json.loads(
        call("synthesise", file, "--vary", "swing=10deg:90deg:5", "--json", "--plot", plot, "--page", page)
    )
    assert plot.stat().st_size > 1000 and "<img" in page.read_text()
    assert [math.degrees(row["swing"]) for row in printed["rows"]] == pytest.approx([10, 30, 50, 70, 90])
    assert printed["rows"][0]["reason"] and not printed["rows"][0]["designs"]
    for row in printed["rows"][1:]:
        (design,) = row["designs"]
        wanted = case_2(row["swing"], math.radians(30), math.radians(50))
        assert [design[n] for n in ("crank", "coupler", "rocker")] == pytest.approx(wanted, rel=1e-8)
    legend = [t.get_text() for t in plot_chart(design_chart(file, "swing", [1.0])).axes[1].get_legend().texts]
    assert {"transmission_least", "transmission_greatest"} <= {*legend} <= {name for name, *_ in QUANTITIES}
    shown = call("synthesise", file, "--vary", "swing=50deg:60deg:2")
    assert "swing [deg]" in shown and "lengths in mm" in shown and " 1.25 " in shown  # of 200 and 160 deg
    assert f" {1000 * case_2(math.radians(60), math.radians(30), math.radians(50))[1]:.5g} " in shown
    file.write_text(file.read_text().replace('"1 deg"', '"60 deg"'))
    designs = call("synthesise", file, "--out", tmp_path / "designs")
    assert "lengths in mm" in designs
    scene = tomllib.loads((tmp_path / "designs" / "four_bar_1.toml").read_text())
    assert scene["units"] == {"length": "mm"}
    for words, message in (
        (("swing=50deg:60deg:2", "--out", tmp_path / "out"), "a design chart has no scenes"),
        (("swing=50deg:60deg:1",), "expected NAME=START:STOP:COUNT"),
    ):
        with pytest.raises(SymgenError, match=message):
            call("synthesise", file, "--vary", *words)


def test_a_length_in_a_range_gives_the_scale_of_the_linkage():
    """Angles decide the shape; those that contradict each other are named for every length of the range."""
    task = {**CASE_1, "fixed_link": ["1 m", "2 m"], "swing": "60 deg", "transmission_least": "40 deg"}
    (design,) = symgen.synthesise(task).designs
    *lengths, fixed = design.linkage.lengths.values()
    alone = symgen.synthesise({**task, "fixed_link": "1 m"}).designs[0].linkage.lengths
    assert 1.0 <= fixed <= 2.0 and lengths == pytest.approx([fixed * x for x in alone.values()][:3], rel=1e-9)
    with pytest.raises(SceneError, match="which contradict"):
        symgen.synthesise({**task, "rocker_folded": "80 deg", "transmission_least": "60 deg"})


def test_a_range_without_a_linkage_is_explained():
    """In the extended position 140 deg of the rocker leave less than 40 deg to the least transmission angle."""
    task = {
        **CASE_1,
        "rocker_folded": "80 deg",
        "swing": "60 deg",
        "transmission_least": ["50 deg", "60 deg"],
    }
    with pytest.raises(SceneError, match="which contradict.*transmission_least < transmission_extended"):
        symgen.synthesise(task)
    wider = {**task, "transmission_least": ["20 deg", "60 deg"]}
    assert 20 <= math.degrees(symgen.synthesise(wider).designs[0].quantities["transmission_minimum"]) < 40


@pytest.mark.parametrize("least", ["55 deg", ["50 deg", "90 deg"]])
def test_the_greatest_transmission_angle_is_reported(least):
    """Over all crank angles of the extended position, by the closed form of Case II."""
    swing, between = math.radians(60), math.pi * 0.2 / 2.2
    most = 0.0
    for extended in np.linspace(0.01, math.pi - between - 0.01, 5001):
        a, b, c = case_2(swing, extended, extended + between)
        cosine = (b * b + c * c - (1 - a) ** 2) / (2 * b * c)
        if 0 < a < min(b, c) and abs(cosine) < 1:
            most = max(most, math.degrees(math.acos(cosine)))
    task = {"kind": "limits", "fixed_link": "1 m", "swing": "60 deg", "time_ratio": 1.2}
    with pytest.raises(SceneError, match="miss the conditions by .*angles in rad") as error:
        symgen.synthesise({**task, "transmission_least": least})
    found = re.search(r"transmission_least found with the other values is ([\d.]+) deg", str(error.value))
    assert float(found[1]) == pytest.approx(most, abs=0.015)


@pytest.mark.parametrize(
    ("task", "vary", "message"),
    [
        ({**CASE_2, "swing": ["60 deg", "50 deg"]}, None, "expected a range of rising values"),
        ({**CASE_2, "swing": ["60 deg", "50 deg"], "crank_extended": ["1 deg", "2 deg"]}, None, "expected one range"),
        (CASE_2, "swung", "four-bar has no quantity 'swung'\n  Did you mean 'swing'"),
        (CASE_2, "rocker", "expected an angle|no linkage at any|expected a length"),
        ({"kind": "function", "input": [0, 1, 2], "output": [0, 1, 2]}, "swing", "expected a task of limit"),
    ],
)  # fmt: skip
def test_wrong_ranges_and_charts(task, vary, message):
    with pytest.raises(SceneError, match=message):
        design_chart(task, vary, [-1.0]) if vary else symgen.synthesise(task)


def test_a_chart_of_no_values_is_refused():
    with pytest.raises(SceneError, match="expected values of swing, got none"):
        design_chart(CASE_2, "swing", [])
