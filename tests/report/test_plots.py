"""Plots of results and sweeps: their panels, units, legends, and colours in both schemes of a page."""

import base64

import numpy as np
import pytest
import xarray
from matplotlib import colormaps
from PIL import Image
from shared.browsing import browser, in_chromium

import symgen
from symgen.report.page.figures import plain_figure, run_figure
from symgen.report.page.sweep_plots import plot as plot_sweep


@pytest.fixture(scope="module")
def slider():
    return symgen.build("elastic_slider_crank").quasi_static(samples=13)


def texts(panel):
    return [text.get_text() for text in panel.get_legend().get_texts()]


def test_strains_and_stresses_are_in_microstrain_and_mpa(slider):
    panels = slider.plot().axes
    by_label = {
        panel.get_ylabel(): {line.get_label(): line.get_ydata() for line in panel.lines} for panel in panels
    }
    strain = next(name for name in slider if name.endswith(".bending_strain"))
    stress = strain.replace("bending_strain", "stress")
    assert by_label["bending strain\n[microstrain]"][strain] == pytest.approx(1e6 * slider[strain].values)
    assert by_label["stress\n[MPa]"][stress] == pytest.approx(1e-6 * slider[stress].values)
    assert slider[stress].units == "Pa" and slider[strain].units == "1"  # results are in SI
    shown = {v.name: v.unit for v in slider.shown}
    assert (shown[strain], shown[stress]) == ("microstrain", "MPa")


def test_units_of_the_scene_come_first():
    run = symgen.build("elastic_slider_crank", set={"units.stress": "psi"}).quasi_static(samples=3)
    stress = next(v for v in run.shown if v.name.endswith(".stress"))
    assert stress.unit == "psi"
    assert stress.values * 6894.757293168 == pytest.approx(run[stress.name].values, rel=1e-9)


def test_a_default_plot_has_at_most_six_panels_and_names_the_rest():
    run = symgen.build("elastic_four_bar").quasi_static(samples=3)
    figure = run.plot()
    assert len(figure.axes) == 6
    title = figure.get_suptitle().replace("\n", " ")
    assert "Also recorded: " in title and "curvature [1/m]" in title and "microstrain" not in title
    assert len(run.plot(*run).axes) > 6
    assert "Also recorded" not in run.plot("A").get_suptitle()
    assert "curvature [1/m]" in run_figure(run).caption


def test_panels_are_by_quantity():
    run = symgen.build("four_bar").simulate(0.5, samples=9)
    panels = {panel.get_ylabel(): texts(panel) for panel in run.plot().axes}
    assert set(panels["tension\n[N]"]) == {"crank.tension", "coupler.tension", "rocker.tension"}
    assert "O.reaction.x" in panels["reaction\n[N]"] and "A.position.x" in panels["position\n[m]"]
    energies = symgen.build(
        "four_bar", set={"analysis.outputs": ["kinetic_energy", "potential_energy", "energy"]}
    ).simulate(0.5, samples=9)
    (energy,) = energies.plot("kinetic_energy", "potential_energy", "energy").axes
    assert energy.get_ylabel() == "energy\n[J]" and len(texts(energy)) == 3


def test_energies_have_no_axis_offset():
    """A pendulum 1e5 m above the datum: its potential energy varies by a millionth."""
    scene = {"points.O.at": ["0 m", "100 km"], "points.A.at": ["1 m", "100 km"]}
    run = symgen.build(_pendulum(**scene)).simulate(0.3, samples=9)
    figure = run.plot("potential_energy")
    figure.canvas.draw()
    (panel,) = figure.axes
    assert np.ptp(run["potential_energy"].values) < 1e-5 * abs(run["potential_energy"].values[0])
    assert panel.yaxis.get_major_formatter().get_offset() in ("", "1e6")
    ticks = [text.get_text() for text in panel.get_yticklabels()]
    assert len({*ticks}) == len(ticks) > 1


def _pendulum(**changes):
    data = {
        "symgen": 1,
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "points": {
            "O": {"at": changes["points.O.at"], "ground": True},
            "A": {"at": changes["points.A.at"]},
        },
        "links": {"rod": {"points": ["O", "A"], "mass": "1 kg"}},
        "analysis": {"outputs": ["potential_energy"]},
    }
    return symgen.Scene(**data)


def test_every_compared_curve_has_a_colour_and_a_legend():
    model = symgen.build("four_bar")
    run, other = model.simulate(0.5, samples=9), model.simulate(0.4, samples=9)
    for panel in run.plot("crank.tension", "energy", compare={"short": other}).axes:
        assert len({line.get_color() for line in panel.lines}) == len(panel.lines) == 2
        assert texts(panel) == [line.get_label() for line in panel.lines]
        assert texts(panel)[1].endswith(", short")


def _sweep():
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    runs = {"x": ("run", x.ravel()), "y": ("run", y.ravel())}
    return xarray.Dataset({"F.peak": ("run", np.arange(12.0))}, runs, {"title": "sweep"})


@in_chromium
def test_maps_keep_their_colours_in_dark_mode_and_ink_does_not(tmp_path):
    figure = plain_figure(lambda: plot_sweep(_sweep(), "F.peak"), "map")
    page = tmp_path / "page.html"
    page.write_text(
        '<!DOCTYPE html><meta name="color-scheme" content="light dark">'
        f'<body style="margin: 0"><img src="{figure.uri}" style="width: 560px">'
    )
    pixels = {}
    for scheme in ("light", "dark"):
        file = tmp_path / f"{scheme}.png"
        browser.picture(page, file, 600, 500, dark=scheme == "dark")
        pixels[scheme] = {*map(tuple, np.asarray(Image.open(file).convert("RGB")).reshape(-1, 3).tolist())}
    of_cells = {tuple(int(c) for c in 255 * np.array(colormaps["viridis"](k / 11)[:3])) for k in range(12)}
    for scheme, found in pixels.items():
        near = [min(max(abs(a - b) for a, b in zip(c, p, strict=True)) for p in found) for c in of_cells]
        assert max(near) <= 2, scheme
    ink = {"light": (0x1C, 0x1F, 0x23), "dark": (0xE4, 0xE6, 0xE9)}
    for scheme, colour in ink.items():
        assert colour in pixels[scheme]
    assert ink["light"] not in pixels["dark"]


def test_notebooks_have_white_paper(slider):
    def svg(**options):
        return base64.b64decode(run_figure(slider, **options).uri.partition(",")[2]).decode()

    assert "prefers-color-scheme" in svg() and "prefers-color-scheme" not in svg(schemes=False)
    assert "#ffffff" in svg(schemes=False) and "#ffffff" not in svg()


def test_notebooks_show_plots_as_pictures():
    figure = symgen.build("four_bar").simulate(0.1, samples=3).plot("energy")
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert plot_sweep(_sweep(), "F.peak")._repr_png_().startswith(b"\x89PNG")


def test_a_plot_of_a_sweep_has_at_most_six_panels_and_names_the_rest():
    runs = _sweep()
    for k in range(7):
        runs[f"G{k}.peak"] = runs["F.peak"]
    figure = plot_sweep(runs)
    assert len([panel for panel in figure.axes if panel.get_xlabel()]) == 6
    assert figure.get_suptitle().endswith("Also recorded: G5.peak, G6.peak.")
    selected = plot_sweep(runs, *(f"G{k}.peak" for k in range(7)))
    assert len([panel for panel in selected.axes if panel.get_xlabel()]) == 7
