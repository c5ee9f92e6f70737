"""The study that ships with the slider-crank: curves against the closed form, and every table of its page."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from shared.closed_slider_crank import Closed, Offsets
from shared.inches import INCH, in_inches

from symgen.study import run_studies

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "slider_crank_study.md").read_text()
SOURCE = {"crank.joint1.force": "F1", "crank.joint1.moment": "T1", "crank.joint2.force": "F2"}
SOURCE |= {"slider.joint3.force": "F3", "slider.joint4.force": "F4"}


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:  # plots are looked at elsewhere, and take most of the time
        patch.setattr("symgen.study.page.draw", lambda *_: b"\x89PNG")
        return run_studies("slider_crank", tmp_path_factory.mktemp("study") / "out")


@pytest.fixture(scope="module")
def cases(report):
    """Every case with a curve: study, offsets, turn."""
    found = []
    for study in report.studies:
        for case in study.cases:
            p = case.turn.provenance["parameters"]
            offsets = Offsets(
                round(p["a4"] / INCH, 9), round(math.degrees(p["alpha4"]), 9), round(p["S1"] / INCH, 9)
            )
            if study.plan.plots:
                found.append((study.plan.name, offsets, in_inches(case.turn)))
    return found


def table(name):
    found = re.search(rf"<!-- study: {name} -->\n((?:\|.*\n)+)", PAGE)
    rows = [[c.strip() for c in line.strip("|\n").split("|")] for line in found[1].splitlines()[2:]]
    return [[math.nan if c == "-" else float(c) for c in row] for row in rows]


def written(name, rows, digits):
    page = table(name)
    assert len(page) == len(rows)
    for line, row in zip(page, rows, strict=True):
        assert line == pytest.approx(row, abs=0.51 * 10.0**-digits, nan_ok=True)


def once(cases):
    """Leave out what two studies have in common."""
    found = {}
    for name, offsets, turn in cases:
        if name != "unloaded":
            found.setdefault(offsets, (offsets, turn))
    return list(found.values())


def test_closure(cases):
    assert len(cases) == 16 and max(t.closure for *_, t in cases) < 1e-14


def test_curves(cases):
    for name, offsets, turn in cases:
        theta = turn.coordinate.values
        closed = Closed(offsets, theta)
        if "S4" in turn:
            assert turn.variable("S4").values == pytest.approx(closed.S4, rel=1e-12)
        off = np.all([np.abs(theta - p.at) > np.radians(0.6) for p in turn.poles] or [theta > -1], axis=0)
        right = closed.forces(load=0.0) if name == "unloaded" else closed.forces(torque=100.0)
        for output, of in SOURCE.items():
            values = turn.variable(output).values[off]
            size = np.maximum(1.0, np.max(np.abs(right[of][off]), axis=-1, keepdims=True))
            assert np.max(np.abs(values - right[of][off]) / size) < 1e-9, (name, offsets, output)
        if name == "unloaded":
            assert turn.variable("theta1.drive").values == pytest.approx(right["T1"][:, 2], abs=1e-9)


def test_displacement_table(cases):
    rows = []
    for o, turn in once(cases):
        values = turn.variable("S4").values
        rows.append([o.a4, o.alpha4, o.S1, np.min(values), np.max(values)])
    written("displacement", rows, 4)


def test_poles_are_where_the_slider_stands_still(cases):
    rows = []
    for o, turn in once(cases):
        poles = [p.at for p in turn.poles]
        for at in poles:
            exact = brentq(lambda x, o=o: Closed(o, np.asarray(x)).S4_rate, at - 0.05, at + 0.05, xtol=1e-15)
            assert at == pytest.approx(exact, abs=1e-11)
        rows.append([o.a4, o.alpha4, o.S1, *np.degrees(poles)])
    written("poles", rows, 6)


def test_torque_table(cases):
    rows = []
    for name, o, turn in cases:
        if name == "unloaded":
            values = turn.variable("theta1.drive").values
            rows.append([o.a4, np.min(values), np.max(values)])
            assert not turn.poles
    written("torque", rows, 3)


def test_limits(report):
    study = next(s for s in report.studies if s.plan.name == "assembly")
    source = {0: 1.5, 10: 3.5, 20: math.nan, 30: 9.0}
    rows = []
    for case, a4 in zip(study.cases, source, strict=True):
        (limit,) = case.limits
        exact = math.sqrt(50**2 - (12 + a4) ** 2)
        found = limit.search.in_unit(limit.value)
        assert abs(found - exact) < 1.2e-7 and limit.closure < 1e-14
        assert 1e-7 < limit.least_singular < 1e-4
        rows.append([a4, found, exact, source[a4]])
    written("limits", rows, 6)
    twisted = next(s for s in report.studies if s.plan.name == "assembly_twist").cases[0].limits
    assert [limit.value for limit in twisted] == [None, None]


def test_the_page_shows_what_is_there(report):
    assert f"writes {sum(name.endswith('.png') for name in report.files)} plots" in PAGE
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", PAGE)
    assert len(pictures) == 5 and all((DOCS / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
    for study in report.studies:
        assert study.plan.about in (report.folder / "index.md").read_text()
