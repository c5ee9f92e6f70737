"""Tables that ``symgen run`` prints: they fit a terminal, and hold the range of every output."""

from __future__ import annotations

import io
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray
from rich.console import Console
from rich.table import Table
from shared.commands import call

import symgen
from symgen.cli import inspection, request
from symgen.report import sweeps
from symgen.report.elastic import print_elastic_result
from symgen.report.extremes import Components
from symgen.report.page.study import print_study
from symgen.report.synthesis import synthesis_study
from symgen.report.tables import table
from symgen.runtime.result.records import Variable

WIDE = 2000


class Terminals:
    """A narrow terminal and a wide one, on which the same is printed."""

    def __init__(self, width=80):
        self.both = [Console(width=w, highlight=False, file=io.StringIO()) for w in (width, WIDE)]

    def print(self, *objects, **how):
        for console in self.both:
            console.print(*objects, **how)

    @property
    def texts(self):
        return [console.file.getvalue() for console in self.both]

    def check(self):
        """Check that lines fit, and that no word or number is on one terminal alone."""
        narrow, wide = self.texts
        assert max(map(len, narrow.splitlines())) <= self.both[0].width
        words = [{w for w in text.split() if set(w) != {"─"}} for text in (narrow, wide)]
        assert words[0] == words[1] and words[0]


#: Commands with tables of every kind, over all kinds of scenes.
COMMANDS = [
    "run slider_crank",
    "run peaucellier",
    "run elastic_four_bar",
    "run tumbling_body --t-end 0.1",
    "run rssr --t-end 0.1",
    "kinematics crank_rocker --samples 13",
    "kinematics rssr --at 0,10,20,30,40",
    "inverse-dynamics crank_rocker --at 0,10,20,30,40,50,60,70,80",
    "inverse-dynamics screw_jack --at 0,10,20,30",
    "inverse-dynamics crank_rocker",
    "equilibrium four_bar",
    "modes triple_pendulum",
    "modes elastic_four_bar --at 0,60,120,180,240 --moving",
    "linearise four_bar",
    "sensitivity peaucellier --at equilibrium --outputs O.reaction",
    "assemblies rssr",
    "assemblies crank_rocker",
    "quasi-static elastic_four_bar --at 0,60,120,180",
    "show rod",
    "scenes",
]


@pytest.mark.parametrize("line", COMMANDS)
def test_tables_fit_80_columns(line, monkeypatch):
    terminals = Terminals()
    for module in (request, inspection):
        monkeypatch.setattr(module, "console", lambda: terminals)
    call(*line.split())
    terminals.check()


def test_notes_on_energies_beyond_linear_theory_and_on_a_slow_method():
    """Deflections of thesis_four_bar are far beyond linear theory, which elastic_four_bar keeps to."""
    for scene, options, found in (
        ("thesis_four_bar", {"method": "newmark", "rtol": 0.02}, True),
        ("elastic_four_bar", {"rtol": 0.02}, False),
    ):
        model = symgen.build(scene, set={"analysis.outputs": ["kinetic_energy"]})
        result = model.simulate(**options)
        assert (np.min(result["kinetic_energy"].values) < 0.0) == found
        console = Console(width=WIDE, file=io.StringIO())
        print_elastic_result(result, model, console)
        text = console.file.getvalue()
        assert ("kinetic_energy falls to" in text) == found
        assert any("kinetic_energy falls to" in note for note in result.notes) == found
        slow = re.search(r"newmark took (\d+) steps .* gauss, of order 12, takes far fewer", text)
        assert bool(slow) == found
        assert not slow or int(slow[1]) == result.statistics["steps"] > 25_600


def test_four_bars_fit_80_columns():
    """Long lengths, and a crank that makes no revolution, which has no least transmission angle."""
    lengths = dict.fromkeys(("crank", "coupler", "rocker", "fixed"), 0.000338105)
    linkage = SimpleNamespace(grashof="triple-rocker", lengths=lengths, error=1.7e-15)
    designs = [
        SimpleNamespace(linkage=linkage, quantities=angles, faults=())
        for angles in ({}, {"transmission_minimum": 0.7, "transmission_maximum": 2.5})
    ]
    terminals = Terminals()
    print_study(
        synthesis_study(
            SimpleNamespace(
                title="",
                linkage="four-bar",
                designs=designs,
                omitted={},
                units={},
                search=SimpleNamespace(incomplete=""),
            )
        ),
        terminals,
    )
    terminals.check()
    assert re.search(r" - +- ", terminals.texts[1]) and "143.24" in terminals.texts[0]


def test_extremes_of_a_sweep_fit_80_columns():
    values = xarray.Variable("run", [-1.2345678e-5, 2.3456789e-5], {"units": "kg*m^2/s"})
    varied = {f"links.coupler{k}.section.width": ("run", [0.0123456 * k, 0.0234567]) for k in range(1, 4)}
    runs = xarray.Dataset(
        {"links.coupler.angular_momentum.peak": values, "error": ("run", ["", ""])},
        varied,
        {"title": "a sweep"},
    )
    terminals = Terminals()
    print_study(sweeps.sweep_study(runs, sweeps.summary(runs)), terminals)
    terminals.check()


@pytest.mark.parametrize("width", [40, 60, 80, 100])
def test_a_table_of_any_width_is_blocks_of_columns(width):
    """Numbers of up to 12 characters below headings of several words: no heading fits with all others."""
    heads = [f"angular velocity number {i} [rad/s]" for i in range(9)]
    rows = [
        (f"link{k}", "rad/s", *(f"{-1.2345678e-5 * (i + k + 1):.6g}" for i in range(9))) for k in range(3)
    ]
    terminals = Terminals(width)
    terminals.print(table("a title", ("output", "unit", *heads), rows, keys=2))
    terminals.check()
    narrow, wide = terminals.texts
    assert narrow.count("link2") > 1 and wide.count("link2") == 1
    assert len(re.findall(r"-\d\S+", narrow)) == 27


def test_a_faulty_table_is_noticed():
    """The check of these tests fails for a table whose cells are folded."""
    made = Table(*"ab")
    made.add_row("-1.234567e-05", "rocker.angular_velocity")
    terminals = Terminals(30)
    terminals.print(made)
    with pytest.raises(AssertionError):
        terminals.check()


def printed(scene, width, monkeypatch):
    """Return the output of ``symgen run`` on a terminal of this width."""
    monkeypatch.setattr(request, "console", lambda: Console(width=width, highlight=False))
    return call("run", scene)


def test_points_of_the_ground_are_not_listed(monkeypatch):
    text = printed("peaucellier", 80, monkeypatch)
    assert "E.position" not in text and "\nO " not in text


def columns(text):
    return [line.split() for line in text.splitlines()]


def show(table, width=80):
    console = Console(width=width, highlight=False)
    with console.capture() as capture:
        console.print(table)
    return columns(capture.get())


def test_least_and_greatest_values_and_where_they_are():
    angle = np.radians(np.arange(0, 361, 5))
    values = np.column_stack([3 * np.cos(angle), 1e-16 * np.sin(7 * angle)])
    outputs = Components(
        [
            Variable("P.position", "m", "", ("x", "y"), values),
            Variable("s", "1", "", (), np.sin(angle) + 1 / 3),
            Variable("turn", "rad", "", (), 1e-14 * np.cos(angle)),
            Variable("pole", "N", "", (), 1 / np.where(angle == math.pi, np.nan, np.cos(angle / 2))),
        ],
        len(angle),
        missing="pole",
    )
    rows = show(outputs.extremes("a title", np.degrees(angle), "deg", end=True))
    assert rows[1] == [
        "output",
        "unit",
        "at",
        "the",
        "end",
        "least",
        "at",
        "[deg]",
        "greatest",
        "at",
        "[deg]",
    ]
    assert rows[3:6] == [
        ["P.position.x", "m", "3", "-3", "180", "3", "0"],
        ["P.position.y", "m", "0", "0", "0", "0", "0"],
        ["s", "1", "0.333333", "-0.666667", "270", "1.33333", "90"],
    ]
    assert rows[6] == ["turn", "rad", "0", "0", "0", "0", "0"]
    # 1/cos(87.5 deg) = 22.9256
    assert rows[7] == ["pole", "N", "-1", "-22.9256", "185", "22.9256", "175"]
    rows = show(outputs.values("values", [f"a = {a} deg" for a in range(0, 361, 5)]))
    heads = [i for i, row in enumerate(rows) if row[:2] == ["output", "unit"]]
    assert len(heads) == 15 and rows[1][:6] == ["output", "unit", "a", "=", "0", "deg"]
    numbers = [x for i in heads for x in rows[i + 2][2:]]
    assert rows[3][:2] == ["P.position.x", "m"]
    assert numbers == [f"{3 * math.cos(x) + 0.0:.6g}" if abs(math.cos(x)) > 1e-9 else "0" for x in angle]


MOVING_GROUND = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true, motion = ["v*t", "0 m"] }
A = { at = ["0.6 m", "0.8 m"] }
Q = { at = ["2 m", "0 m"], ground = true }
B = { at = ["2 m", "-1 m"] }
[parameters]
v = "1 cm/s"
[links]
OA = { points = ["O", "A"], mass = "1 kg" }
QB = { points = ["Q", "B"], mass = "1 kg" }
[gravity]
acceleration = ["0 m/s^2", "-9.81 m/s^2"]
[analysis]
t_end = "0.5 s"
"""


def test_ground_that_moves_is_shown(tmp_path, monkeypatch):
    """A pendulum from a point that moves to one side, and one at rest below a point that rests."""
    file = tmp_path / "moving.toml"
    file.write_text(MOVING_GROUND)
    table = {row[0]: row[1:] for row in columns(printed(file, 80, monkeypatch)) if row}
    assert table["O"] == ["0.005", "0", "0.01", "0"]
    assert table["B"] == ["2", "-1", "0", "0"] and "Q" not in table


def test_tables_and_plots_show_the_units_of_the_scene_and_values_stay_in_si():
    tables = {
        "parameters": {"w": "60 rpm"},
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["20 mm", "0 m"]}},
        "links": {"arm": {"points": ["O", "A"], "mass": "3 kg", "centre": 1, "inertia": 0}},
        "drivers": [{"link": "arm", "angle": "w*t"}],
        "gravity": {"acceleration": ["0 m/s^2", "-10 m/s^2"]},
        "analysis": {
            "t_end": "1 s",
            "outputs": ["A.position", "A.velocity", "arm.angle", "arm.torque", "energy", "arm.power"],
        },
    }
    units = {"length": "mm", "force": "kN", "angle": "deg"}
    plain, named = (symgen.build(symgen.Scene(units=u, **tables)).simulate(0.125) for u in ({}, units))
    assert [v.unit for v in plain.shown] == ["m", "m/s", "rad", "N*m", "J", "W"]
    assert [v.unit for v in named.shown] == ["mm", "mm/s", "deg", "kN*mm", "J", "W"]
    final = {v.name: v.values[-1] for v in named.shown}
    rate, half = 2 * math.pi, math.sqrt(0.5)
    assert final["A.position"] == pytest.approx([20 * half, 20 * half], rel=1e-9)
    assert final["A.velocity"] == pytest.approx([-20 * rate * half, 20 * rate * half], rel=1e-9)
    assert final["arm.angle"] == pytest.approx(45.0, rel=1e-9)
    assert final["arm.torque"] == pytest.approx(3 * 10 * 0.02 * half, rel=1e-9)  # N m are kN mm
    turned = symgen.build(symgen.Scene(units=units | {"torque": "N*mm"}, **tables)).simulate(0.125)
    shown = {v.name: v for v in turned.shown}
    assert [shown[name].unit for name in ("arm.torque", "energy")] == ["N*mm", "J"]
    assert shown["arm.torque"].values[-1] == pytest.approx(3 * 10 * 20 * half, rel=1e-9)
    larger = symgen.build(symgen.Scene(units=units | {"energy": "kJ", "power": "kW"}, **tables)).simulate(
        0.125
    )
    shown = {v.name: v for v in larger.shown}
    assert [shown[name].unit for name in ("arm.torque", "energy", "arm.power")] == ["kN*mm", "kJ", "kW"]
    assert shown["arm.power"].values[-1] == pytest.approx(3e-3 * 10 * 0.02 * half * rate, rel=1e-9)
    height, speed = -0.02 * half, 0.02 * rate  # of a point mass that the drive turns; gravity is along -y
    kinetic_and_potential = 3e-3 * (speed**2 / 2 - 10 * height)
    assert abs(shown["energy"].values[-1]) == pytest.approx(abs(kinetic_and_potential), rel=1e-9)
    for name in plain:
        assert named[name].attrs["units"] == plain[name].attrs["units"]
        assert np.array_equal(named[name].values, plain[name].values)
