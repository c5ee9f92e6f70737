"""Frequencies of whole linkages through ``symgen.build``: against closed forms, by number of elements."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shared.elastic_scenes as bars
from rich.console import Console
from shared.full import full_unless
from shared.in_numpy import build
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import ModelError
from symgen.report.elastic import print_elastic_modes
from symgen.runtime.beams.modal.structure import modes_at_rest

#: sqrt(E I / rho A) / L^2 [rad/s] of the bar of the scenes.
BENT = float(np.sqrt(bars.E * bars.INERTIA / (bars.RHO * bars.AREA)) / bars.LENGTH**2)


@pytest.fixture(autouse=True)
def bars_in_numpy(monkeypatch):
    monkeypatch.setattr(bars, "build", build)


def bending(modes, count):
    """The lowest frequencies [rad/s]; those along the bar lie far above."""
    return 2 * np.pi * modes.frequencies[:count]


def order(coarse, fine):
    return np.log2(coarse / fine)


def rotary_pinned():
    """Pinned, with rotary inertia: EI k^4 = w^2 (m + j k^2), k = pi/L."""
    k = np.pi / bars.LENGTH
    inertia = bars.RHO * bars.AREA + bars.RHO * bars.INERTIA * k**2
    return np.sqrt(bars.E * bars.INERTIA * k**4 / inertia)


def timoshenko_pinned(shear):
    """The lower root of m j w^4 - (m (EI k^2 + S) + j S k^2) w^2 + S EI k^4 = 0, S = kGA, k = pi/L."""
    k, m, j, bent = np.pi / bars.LENGTH, bars.RHO * bars.AREA, bars.RHO * bars.INERTIA, bars.E * bars.INERTIA
    middle = m * (bent * k**2 + shear) + j * shear * k**2
    return np.sqrt(2 * shear * bent * k**4 / (middle + np.sqrt(middle**2 - 4 * m * j * shear * bent * k**4)))


#: Numbers of elements, and the order of the frequency: twice (degree - 1) of the deflection.
PINNED = {
    "beam8": ((1, 2), 8),
    "beam9": ((1, 2), 8),
    "rayleigh": ((1, 2), 8),
    "cubic": ((4, 8), 4),
    "timoshenko": ((8, 16), 4),
}


def test_beam_on_three_supports(tmp_path):
    """Continuous over its middle: modes of a pinned span alternate with those of a span clamped there."""
    between = 'C = { on = "bar", fraction = 0.5 }'
    found = bending(bars.pinned(tmp_path, ", elements = 8", between=between).modes(), 4)
    roots = np.array([np.pi, 3.92660231204791883, 2 * np.pi, 7.06858274562873])  # of tan x = tanh x
    assert np.abs(found / (roots / 0.5) ** 2 / BENT - 1).max() < 1e-5


@pytest.mark.parametrize("element", full_unless(lambda e: e in ("beam8", "timoshenko"), PINNED))
def test_pinned_coupler(tmp_path, element):
    numbers, expected = PINNED[element]
    exact = np.pi**2 * BENT
    more = ""
    if element == "rayleigh":
        exact = rotary_pinned()
    if element == "timoshenko":
        more = ", shear = { poisson = 0.3 }"
        exact = timoshenko_pinned(5 / 6 * bars.E / 2.6 * bars.AREA)
    errors = []
    for n in numbers:
        model = bars.pinned(tmp_path, f', element = "{element}", elements = {n}{more}')
        errors.append(bending(model.modes(), 1)[0] / exact - 1)
    assert errors[0] > errors[1] > 0
    assert expected - 0.3 < order(*errors) < expected + 2


def test_clamped_crank(tmp_path):
    """cos x cosh x = -1: one element 2.1e-6 above, as the method has it."""
    exact = np.array([1.875104068711961, 4.694091132974175]) ** 2 * BENT
    errors = []
    for n in (1, 2, 4):
        errors.append(bending(bars.cantilever(tmp_path, f", elements = {n}").modes(), 2) / exact - 1)
    assert errors[0][0] == pytest.approx(2.1e-6, rel=0.02)
    assert 7.0 < order(errors[0][0], errors[1][0]) < 8.5
    assert np.all(np.abs(errors[2]) < 1e-7)


#: Flapping frequencies of a rotating cantilever by its speed, both over ``BENT``: Wright et al. 1982.
FLAPPING = {6: 7.3604, 12: 13.1702}


@pytest.mark.parametrize("speed", full_unless(lambda speed: speed == 12, FLAPPING))
@pytest.mark.parametrize("element, elements", [("beam8", 4), ("cubic", 16)])
def test_rotating_cantilever(tmp_path, element, elements, speed):
    """In its plane the square is less by that of the speed."""
    chosen = f', element = "{element}", elements = {elements}, axial = false'
    model = bars.cantilever(tmp_path, chosen, speed=f"{speed * BENT!r} rad/s")
    lagging = bending(model.modes(moving=True), 1)[0] / BENT
    error = 1e-5 if element == "beam8" else 1e-4
    assert np.hypot(lagging, speed) == pytest.approx(FLAPPING[speed], rel=error)


def test_order_of_a_rotating_cantilever(tmp_path):
    """Against eight elements; cubic deflections give order four."""
    exact = None
    errors = {}
    for element, n in (("beam8", 8), ("cubic", 4), ("cubic", 8)):
        chosen = f', element = "{element}", elements = {n}, axial = false'
        model = bars.cantilever(tmp_path, chosen, speed=f"{6 * BENT!r} rad/s")
        found = bending(model.modes(0.3, moving=True), 1)[0]
        exact = exact or found
        errors[n] = found / exact - 1
    assert 3.7 < order(errors[4], errors[8]) < 4.5


def test_a_turning_bar_that_stretches_feels_its_gyroscopic_forces(tmp_path):
    """Slender as it is, that lowers its frequency in the plane by little; the angle makes no difference."""
    speed = f"{6 * BENT!r} rad/s"
    stiff = bars.cantilever(tmp_path, ", elements = 4, axial = false", speed=speed)
    soft = bars.cantilever(tmp_path, ", elements = 4", speed=speed)
    exact = bending(stiff.modes(moving=True), 1)[0]
    found = [bending(soft.modes(angle, moving=True), 1)[0] for angle in (0.0, 1.0, 4.0)]
    assert 1e-7 < abs(found[0] / exact - 1) < 1e-2
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)


def test_moving_modes_of_a_linkage_that_stands_still_are_those_at_rest(tmp_path):
    model = bars.pinned(tmp_path, ", elements = 2")
    rest, moving = model.modes(), model.modes(moving=True)
    assert moving.frequencies == pytest.approx(rest.frequencies, rel=1e-9)
    assert np.max(np.abs(moving.growth)) < 1e-6 * rest.frequencies[-1]


def test_damping_of_a_bar_in_motion(tmp_path):
    """Rayleigh's a M: all modes decay by a/2."""
    model = bars.pinned(tmp_path, ', elements = 2, damping = { mass = "3 rad/s" }')
    found = model.modes(moving=True)
    assert found.growth == pytest.approx(-1.5, rel=1e-6)
    at_rest = model.modes().frequencies
    damped = np.sqrt((2 * np.pi * at_rest) ** 2 - 1.5**2) / (2 * np.pi)
    assert found.frequencies == pytest.approx(damped, rel=1e-9)


@pytest.mark.parametrize("reduction", ["", ', reduction = { kind = "craig-bampton", modes = 6 }'])
def test_frequencies_have_the_error_of_their_elements(tmp_path, reduction):
    """A pinned bar of cubic elements: mode i has the circular frequency (i pi)^2 sqrt(E I / rho A) / L^2."""
    found = bars.pinned(tmp_path, f', element = "cubic", elements = 4{reduction}').modes()
    whole = bars.pinned(tmp_path, ', element = "cubic", elements = 4').modes()
    truth = bending(whole, 3) / ((np.pi * np.arange(1, 4)) ** 2 * BENT) - 1
    assert found.errors_of_elements[:3] == pytest.approx(truth, rel=0.1)  # halved, 1/16 of it remains
    assert truth[2] > 1e-2 and len(found.errors_of_elements) == len(found.frequencies)
    assert found.summary()["errors_of_elements"] == found.errors_of_elements.tolist()


def test_frequencies_of_too_few_elements_are_marked_and_not_listed(tmp_path):
    """A pinned bar of two cubic elements: frequencies (i pi)^2 sqrt(E I / rho A) / L^2 of bending."""
    model = bars.pinned(tmp_path, ', element = "cubic", elements = 2, axial = false')
    found = model.modes()
    truth = bending(found, 4) / ((np.pi * np.arange(1, 5)) ** 2 * BENT) - 1
    assert truth[0] < 0.01 and truth[1] > 0.1  # below and above 5 %
    assert found.coarse.tolist() == (truth > 0.05).tolist() == [False, True, True, True]
    assert found.elements == {"bar": 2} == found.summary()["elements"]
    console = Console(width=100, file=io.StringIO())
    print_elastic_modes([found], model, console)
    printed = console.file.getvalue()
    assert f"{found.frequencies[0]:.6g}" in printed and f"{found.frequencies[1]:.6g}" not in printed
    assert "3 more modes" in printed and "3 of them with errors of elements above 5 %" in printed
    assert "elements: bar 2" in printed


def test_frequencies_that_are_wrong_in_one_pose_are_marked(tmp_path):
    found = bars.pinned(tmp_path, ', element = "cubic", elements = 2, axial = false').modes()
    other = replace(found, estimate=lambda: np.array([0.0, 0.0, 1.0, 1.0]))
    console = Console(width=100, file=io.StringIO())
    print_elastic_modes([found, other], SimpleNamespace(description=SimpleNamespace(title="bar")), console)
    rows = [line.split() for line in console.file.getvalue().splitlines() if line[:1].isdigit()]
    assert [row[0] for row in rows] == ["1", "2"]
    assert [row[1].endswith("*") for row in rows] == [False, True]
    assert "* error of elements above 5 %" in console.file.getvalue()


def test_reductions_say_how_small_and_how_wrong_they_are(tmp_path):
    """Craig's and Bampton's modes come near from above; Guyan's condensation leaves the bending out."""
    whole = bars.pinned(tmp_path, ", elements = 6")
    exact = whole.modes()
    assert exact.without_reduction is None and exact.errors.size == 0
    before = np.inf
    for kept in (2, 4, 6):
        text = f', elements = 6, reduction = {{ kind = "craig-bampton", modes = {kept} }}'
        found = bars.pinned(tmp_path, text).modes()
        assert found.without_reduction[1] == len(exact.frequencies) > len(found.frequencies)
        assert found.without_reduction[0] == pytest.approx(exact.frequencies[: len(found.frequencies)])
        assert np.all(found.errors > -1e-9)
        error = found.errors[0]
        assert error < before
        before = max(error, 1e-12)
        assert found.frequencies[0] == pytest.approx(exact.frequencies[0] * (1 + error))
    four_bar = "thesis_four_bar"
    changes = {f"links.{k}.elastic.elements": 3 for k in ("crank", "coupler", "output")}
    changes |= {f"links.{k}.elastic.reduction": {"kind": "guyan"} for k in ("coupler", "output")}
    found = build(four_bar, set=changes).modes(1.0)
    assert len(found.errors) and found.errors[-1] > 0.1
    assert found.errors[0] < 0.2


def test_modes_on_the_command_line():
    call = lambda *words: CliRunner().invoke(app, ["modes", *words])  # noqa: E731
    found = json.loads(call("rotating_cantilever", "--moving", "--json").stdout)
    at_rest = json.loads(call("rotating_cantilever", "--json").stdout)
    assert found["frequencies_hz"][0] > at_rest["frequencies_hz"][0]
    assert len(found["growth_per_s"]) == found["unknowns"] and "growth_per_s" not in at_rest
    shown = call("rotating_cantilever", "--moving").stdout
    assert "in motion" in shown and "growth" in shown
    refused = call("four_bar", "--moving")
    assert refused.exit_code != 0 and isinstance(refused.exception, ModelError | SystemExit)


def test_frequencies_are_found_in_the_first_run_alone(monkeypatch):
    model = symgen.build("elastic_slider_crank")
    assert model.simulate(steps=90, samples=3).statistics["damping_ratios"]
    for name in ("lowest", "elastic_modes"):  # further calls fail
        monkeypatch.setattr(f"symgen.runtime.elastic.mesh.{name}", None)
    assert model.simulate(steps=90, samples=3).statistics["damping_ratios"]


@pytest.mark.parametrize(
    "elastic, thickness, tolerance",
    [
        ("elements = 200", 5e-3, 1e-6),
        ('element = "timoshenko", shear = { poisson = 0.3 }, elements = 40', 5e-4, 1e-6),
    ],
)
def test_low_frequencies_of_fine_meshes_are_not_called_rigid(tmp_path, elastic, thickness, tolerance):
    """A clamped bar at rest has no rigid motion: cos x cosh x = -1, also where its highest frequency is 1e7 times."""
    shipped = (Path(symgen.__file__).parent / "scenes" / "rotating_cantilever.toml").read_text()
    scene = tmp_path / "cantilever.toml"
    scene.write_text(
        shipped.replace("elements = 4", elastic).replace('thickness = "5 mm"', f'thickness = "{thickness} m"')
    )
    found = symgen.build(str(scene)).modes()
    speed = np.sqrt(210e9 * thickness**2 / 12 / 7850)
    roots = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    # The Timoshenko bar is slower by shear and rotary inertia, of the order of (thickness/length)^2.
    expected = roots**2 * speed / (2 * np.pi)
    shear = 50 * thickness**2 if "timoshenko" in elastic else 0.0
    assert found.frequencies[:3] == pytest.approx(expected, rel=tolerance + shear)
    assert found.rigid == 0


def test_the_crank_left_to_itself_is_the_one_rigid_motion(tmp_path):
    """Of thin links that keep their length, on a rigid crank: large stiffnesses cancel in that motion."""
    shipped = (Path(symgen.__file__).parent / "scenes" / "elastic_four_bar_free.toml").read_text()
    text = shipped.replace('elastic = { E = "E" }', 'elastic = { E = "E", axial = false, elements = 20 }')
    crank, elastic = text.index("[links.crank]"), text.index("elastic = {")
    assert crank < elastic
    text = text[:elastic] + text[text.index("\n", elastic) :]
    scene = tmp_path / "free.toml"
    scene.write_text(text.replace('thickness = "0.125 in"', 'thickness = "0.0125 in"'))
    model = symgen.build(str(scene))
    for angle in (0.0, 1.0, 2.0):
        found = model.modes(angle)
        assert found.frequencies[0] == 0.0 and found.frequencies[1] > 1.0
        assert found.rigid == 1


def test_derivatives_number_frequencies_as_modes_do_behind_rigid_motions():
    model = symgen.build("elastic_four_bar_free")
    modes = model.modes()
    found = model.sensitivity(["frequencies"], ["speed"])
    assert modes.rigid == 1 and found.outputs[0] == "frequency.2"
    numbers = [int(name.rpartition(".")[2]) for name in found.outputs]
    assert found.values == pytest.approx(modes.frequencies[np.array(numbers) - 1], rel=1e-9)


def test_matrices_that_are_not_finite_have_no_modes():
    for mass, stiffness in ((np.nan, 1.0), (1.0, np.nan)):
        with pytest.raises(ModelError, match="not finite"):
            modes_at_rest("frame", np.diag([1.0, mass]), np.diag([1.0, stiffness]), np.ones(2))
