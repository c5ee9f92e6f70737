"""What notebooks show of models and of the records of analyses."""

import pickle
import re
from html import unescape

import numpy as np
import pytest

import symgen


@pytest.fixture(scope="module")
def four_bar():
    return symgen.build("four_bar")


def cells(html):
    """The rows of all tables."""
    rows = re.findall(r"<tr>(.*?)</tr>", html, re.S)
    return [[unescape(cell) for cell in re.findall(r"<t[dh]>(.*?)</t[dh]>", row)] for row in rows]


def test_a_model_shows_its_drawing_freedoms_outputs_and_parameters(four_bar):
    html = four_bar._repr_html_()
    drawing, rows = html.partition("</svg>")[0], dict(row for row in reversed(cells(html)) if len(row) == 2)
    assert all(f">{name}</text>" in drawing for name in ("O", "A", "B", "C", "crank", "coupler", "rocker"))
    assert rows["degrees of freedom"] == "1" and "A.position, B.position" in rows["outputs"]
    tuned = symgen.build("slider_crank").with_parameters(a4=0.125)
    parameters = {row[0]: row for row in cells(tuned._repr_html_()) if len(row) == 3}
    assert parameters["a4"] == ["a4", "0.125 m", "offset of the slider's line from the axis of the crank"]


def test_an_equilibrium_shows_its_pose_and_stability(four_bar):
    rest = four_bar.equilibrium()
    html = rest._repr_html_()
    row = next(row for row in cells(html) if row[0] == "A")
    assert [float(x) for x in row[1:3]] == pytest.approx(rest.state.positions["A"], rel=1e-5)
    assert "stable equilibrium, 1 degree of freedom" in html
    assert pickle.loads(pickle.dumps(rest))._repr_html_() is None  # without its model: shown as text


def test_modes_linear_models_and_derivatives_show_their_numbers(four_bar):
    modes = four_bar.modes()
    (row,) = [row for row in cells(modes._repr_html_()) if "oscillation" in row]
    assert float(row[2]) == pytest.approx(modes.frequencies[0], rel=1e-5)
    linear = four_bar.linearise(four_bar.equilibrium(), coordinates=["crank.angle"])
    last = next(row for row in cells(linear._repr_html_()) if row[:2] == ["2", "crank.angle'"])
    assert [float(x) for x in last[2:]] == pytest.approx(linear.A[1], rel=1e-5)
    elastic = symgen.build("elastic_slider_crank").modes()
    first = next(row for row in cells(elastic._repr_html_()) if row[0] == "1")
    assert float(first[1]) == pytest.approx(elastic.frequencies[0], rel=1e-5)


def test_an_optimum_shows_its_variables():
    optimum = symgen.build("slider_crank").optimise(
        objective="theta1.drive.peak", variables={"a4": (0.0, 0.2)}, samples=13
    )
    rows = {row[0]: row for row in cells(optimum._repr_html_()) if row}
    assert float(rows["a4"][-2]) * 0.0254 == pytest.approx(optimum.parameters["a4"], rel=1e-4, abs=1e-9)
    assert np.isfinite(float(rows["theta1.drive.peak"][-2]))


def test_a_sweep_shows_its_map_and_extremes():
    model = symgen.build("slider_crank")
    vary = {"a4": [0.0, 0.0508, 0.1016], "S1": [0.0, 0.0508]}
    runs = model.sweep(vary, outputs=["theta1.drive"])
    html = runs._repr_html_()
    (alt,) = re.findall(r'<img src="data:image/svg[^"]*" alt="([^"]*)"', html)
    assert alt == "Outputs over a4 and S1" and "xr-wrap" in html  # and the variables, as xarray shows them
    greatest = next(row for row in cells(html) if "greatest" in row)
    at = int(np.argmax(runs["theta1.drive.peak"].values))
    a4, s1 = (f"{float(runs[name][at]) / 0.0254:g}" for name in ("a4", "S1"))
    assert greatest[-1] == f"a4 = {a4} in, S1 = {s1} in"
    part = pickle.loads(pickle.dumps(runs.isel(run=slice(0, 2))))
    assert "<img" in part._repr_html_()  # parts of it, and copies
    for other in (runs.isel(run=0), runs[["theta1.drive.peak"]].drop_attrs()):
        assert "<img" not in other._repr_html_()
    curves = model.sweep({"a4": [0.0, 0.05]}, outputs=["theta1.drive"], reduce="history")._repr_html_()
    assert 'alt="Curves of the runs"' in curves


def test_large_maps_are_pictures():
    """A path for each of 22,500 cells would take some 5 MB."""
    import xarray

    from symgen.report.page.figures import plain_figure
    from symgen.report.sweeps import plot

    x, y = np.meshgrid(np.arange(150.0), np.arange(150.0))
    data = {"f": ("run", (x * y).ravel(), {"units": "m"}), "error": ("run", np.full(x.size, ""))}
    runs = xarray.Dataset(data, {"a": ("run", x.ravel()), "b": ("run", y.ravel())}, {"title": "map"})
    assert len(plain_figure(lambda: plot(runs, "f"), "map").uri) < 300_000


def test_drawings_and_films_are_named_in_a_line(four_bar):
    assert re.fullmatch(r"<Sheet '.*': \d+ joints and points, \d+ lines>", repr(four_bar.draw()))
    assert repr(four_bar.simulate(0.1, samples=7).animate()) == "<Film 'four_bar': 7 pictures>"
