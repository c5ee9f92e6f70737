"""docs/slider_crank_study.md: curves against the closed form, and every table."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import bisect, brentq
from shared.closed_slider_crank import Closed, Offsets
from shared.inches import INCH, in_inches

import symgen
from symgen.errors import InitialStateError, SimulationError
from symgen.report.sweeps import plot

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "slider_crank_study.md").read_text()
SOURCE = {"crank.joint1.force": "F1", "crank.joint1.moment": "T1", "crank.joint2.force": "F2"}
SOURCE |= {"slider.joint3.force": "F3", "slider.joint4.force": "F4"}
BY_OFFSET = [Offsets(a4, S1=3.5) for a4 in (0, 10, 20, 30)]
LOADED = [
    *BY_OFFSET,
    *(Offsets(30, S1=S1) for S1 in (0, 3, 6, 9)),
    *(Offsets(20, alpha4) for alpha4 in (232, 270, 310)),
]
TORQUE = {"loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"}
TO_SI = {"a4": INCH, "alpha4": math.pi / 180, "S1": INCH}


def si(offsets):
    return {name: getattr(offsets, name) * size for name, size in TO_SI.items()}


@pytest.fixture(scope="module")
def crank():
    return symgen.build("slider_crank")


@pytest.fixture(scope="module")
def loaded():
    return symgen.build("slider_crank", set=TORQUE)


@pytest.fixture(scope="module")
def curves(crank, loaded):
    """Revolutions by model and offsets, in inches."""
    found = {}
    for kind, model, cases in (("loaded", loaded, LOADED), ("unloaded", crank, BY_OFFSET)):
        found[kind] = [(o, in_inches(model.with_parameters(**si(o)).inverse_dynamics())) for o in cases]
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


def test_curves(curves):
    for kind, cases in curves.items():
        for offsets, turn in cases:
            assert turn.closure < 1e-14
            theta = turn.coordinate.values
            closed = Closed(offsets, theta)
            assert turn.variable("S4").values == pytest.approx(closed.S4, rel=1e-12)
            off = np.all([np.abs(theta - p.at) > np.radians(0.6) for p in turn.poles] or [theta > -1], axis=0)
            right = closed.forces(load=0.0) if kind == "unloaded" else closed.forces(torque=100.0)
            for output, of in SOURCE.items():
                values = turn.variable(output).values[off]
                size = np.maximum(1.0, np.max(np.abs(right[of][off]), axis=-1, keepdims=True))
                assert np.max(np.abs(values - right[of][off]) / size) < 1e-9, (kind, offsets, output)
            if kind == "unloaded":
                assert turn.variable("theta1.drive").values == pytest.approx(right["T1"][:, 2], abs=1e-9)


def test_displacement_table(curves):
    rows = [
        [o.a4, o.alpha4, o.S1, np.min(turn.variable("S4").values), np.max(turn.variable("S4").values)]
        for o, turn in curves["loaded"]
    ]
    written("displacement", rows, 4)


def test_poles_are_where_the_slider_stands_still(curves):
    rows = []
    for o, turn in curves["loaded"]:
        poles = [p.at for p in turn.poles]
        for at in poles:
            exact = brentq(lambda x, o=o: Closed(o, np.asarray(x)).S4_rate, at - 0.05, at + 0.05, xtol=1e-15)
            assert at == pytest.approx(exact, abs=1e-11)
        rows.append([o.a4, o.alpha4, o.S1, *np.degrees(poles)])
    written("poles", rows, 6)


def test_torque_table(curves):
    rows = []
    for o, turn in curves["unloaded"]:
        values = turn.variable("theta1.drive").values
        rows.append([o.a4, np.min(values), np.max(values)])
        assert not turn.poles
    written("torque", rows, 3)


def test_panels_of_efforts_with_poles_are_scaled_to_the_curves(loaded):
    """The largest sample next to a pole is thousands of times the values between the poles."""
    offsets = [o.a4 * INCH for o in BY_OFFSET]
    outputs = ["S4", "slider.joint4.force"]
    runs = loaded.sweep({"a4": offsets, "S1": [3.5 * INCH]}, outputs=outputs, reduce="history")
    displacement, force = plot(runs).axes
    assert max(np.nanmax(line.get_ydata()) for line in force.lines) > 1e4
    assert 50 < force.get_ylim()[1] < 100
    assert displacement.get_ylim()[1] > 61.8773  # the greatest displacement of the page


def reach(model, name, stop):
    """Return the value of a parameter [in] up to which the crank revolves, by bisection, and its model."""

    def closes(value):
        try:
            return model.with_parameters(**{name: value}).kinematics() is not None
        except (InitialStateError, SimulationError):
            return False

    at = bisect(lambda x: 1.0 if closes(x) else -1.0, 0.0, stop * INCH, xtol=1e-10, rtol=1e-14)
    return at / INCH, model.with_parameters(**{name: at - math.copysign(2e-10, stop)})


def test_limits(crank):
    source = {0: 1.5, 10: 3.5, 20: math.nan, 30: 9.0}
    rows = []
    for a4, printed in source.items():
        exact = math.sqrt(50**2 - (12 + a4) ** 2)
        found, close = reach(crank.with_parameters(a4=a4 * INCH), "S1", 60)
        turn = close.kinematics()
        assert abs(found - exact) < 1.2e-7 and turn.closure < 1e-14
        assert 1e-7 < turn.statistics["least_singular"] < 1e-4
        rows.append([a4, found, exact, printed])
    written("limits", rows, 6)
    with pytest.raises(SimulationError, match="cannot be followed .*towards theta1 = 0 deg"):
        crank.with_parameters(a4=30 * INCH, S1=(found + 1e-6) * INCH).kinematics()


def test_limit_of_an_offset_to_the_other_side(crank):
    found, _ = reach(crank.with_parameters(S1=9 * INCH), "a4", -60)
    assert found == pytest.approx(12 - math.sqrt(50**2 - 9**2), abs=1e-6)


def test_the_line_of_the_slider_may_have_any_angle(crank):
    angles = np.radians(np.linspace(90.0, 450.0, 25))
    runs = crank.sweep({"alpha4": angles, "a4": [20 * INCH]}, analysis="kinematics", outputs=["S4"])
    assert not any(runs["error"].values)


def test_pictures_of_the_page():
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", PAGE)
    assert len(pictures) == 3 and all((DOCS / name).read_bytes().startswith(b"\x89PNG") for name in pictures)
