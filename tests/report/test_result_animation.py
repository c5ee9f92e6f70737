"""Animations of results: their frames at the samples of the result, and what notebooks show."""

from __future__ import annotations

import json
import re
from html import unescape

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, ResultError
from symgen.report.notebook import displays


def places(film, name):
    """Return the places of a point, (frames, axes)."""
    return np.array([next(n.at for n in sketch.nodes if n.name == name) for sketch in film.sketches])


@pytest.mark.parametrize("verb", ["kinematics", "inverse_dynamics"])
def test_frames_are_the_values_in_their_order(verb):
    angles = np.array([2.0, 0.3, 1.1])
    film = getattr(symgen.build("crank_rocker"), verb)(at=angles).animate()
    assert places(film, "A") == pytest.approx(0.1 * np.array([np.cos(angles), np.sin(angles)]).T, abs=1e-9)
    assert places(film, "C") == pytest.approx(np.array([[0.4, 0.0]] * 3))
    assert film.result.coordinate.values == pytest.approx(angles)


def test_frames_of_long_results_are_evenly_spaced():
    """361 poses by default, of which 241 frames at most cannot be: every second one is shown."""
    film = symgen.build("crank_rocker").inverse_dynamics().animate()
    times = np.linspace(0.0, 1.0, 181)
    assert film.result.time == pytest.approx(times)
    tip = 0.1 * np.array([np.cos(2 * np.pi * times), np.sin(2 * np.pi * times)]).T
    assert places(film, "A") == pytest.approx(tip, abs=1e-9)


def test_frames_of_a_run_have_its_state_and_its_times(tmp_path):
    """A run from another start: the crank is where its own output says, at chosen samples."""
    model = symgen.build("four_bar", set={"analysis.outputs": ["crank.angle"]})
    later = model.simulate(0.4, samples=2).final
    free = model.description.free
    state = model.state(*({p: later[p][k] for p in free} for k in ("position", "velocity")))
    run = model.simulate(0.5, state=state, samples=9)
    film = run.animate(tmp_path / "run.html", frames=5)
    angle = run["crank.angle"].values[::2]
    crank = places(film, "A") - places(film, "O")
    directions = np.arctan2(crank[:, 1], crank[:, 0])
    assert np.exp(1j * directions) == pytest.approx(np.exp(1j * angle), abs=1e-9)
    data = json.loads(re.search(r'id="data"[^>]*>(.*?)</script>', (tmp_path / "run.html").read_text())[1])
    assert data["along"]["values"] == pytest.approx(run.time[::2], abs=1e-5)
    assert data["curves"][0]["values"] == pytest.approx(angle, abs=1e-4)


def test_frames_of_tuned_loops_and_of_elastic_runs():
    offset = 4.0 * 0.0254
    turn = symgen.build("slider_crank").with_parameters(a4=offset).kinematics(at=[0.2, 2.0])
    assert np.abs(places(turn.animate(), "S3")[:, 0]) == pytest.approx([offset, offset])
    run = symgen.build("thesis_four_bar").simulate(0.01, samples=5)
    film = run.animate()
    crank = np.array([next(line.at[1] for line in s.lines if line.kind == "rail") for s in film.sketches])
    angle = run.time * 2 * np.pi * 373 / 60  # at constant speed, from the direction of x
    assert crank == pytest.approx(0.1778 * np.column_stack([np.cos(angle), np.sin(angle)]), abs=1e-6)
    assert places(film, "A") == pytest.approx(crank + run["A.displacement"].values, abs=1e-4)
    assert "in their own size" in film.caption  # this scene bends far


def test_notebooks_play_a_result_in_a_frame_of_its_own(monkeypatch):
    assert "<iframe srcdoc=" in symgen.build("crank_rocker").kinematics(samples=5)._repr_html_()
    run = symgen.build("four_bar").simulate(0.2, samples=5)
    page = re.search(r'<iframe srcdoc="([^"]*)"', run._repr_html_())
    data = json.loads(re.search(r'id="data"[^>]*>(.*?)</script>', unescape(page[1]))[1])
    assert len(data["frames"]) == 5
    assert not re.search(r"(src|href)=\"(?!data:)", unescape(page[1]))
    monkeypatch.setattr(displays, "QUICK", 0.0)  # a run that took long is not repeated
    text = run._repr_html_()
    assert "<iframe" not in text and "<img" in text


def test_what_does_not_move_is_refused(tmp_path):
    run = symgen.build("four_bar").simulate(0.1, samples=2)
    loaded = symgen.load_result(run.save(tmp_path / "run.npz"))
    with pytest.raises(
        ResultError, match="has no model: it was loaded, copied or taken from an error\n.*animate"
    ):
        loaded.animate()
    assert "<iframe" not in loaded._repr_html_()
    with pytest.raises(ResultError, match="1 sample: expected at least 2"):
        symgen.build("crank_rocker").kinematics(at=[0.5]).animate()
    with pytest.raises(ResultError, match="for the animation"):
        run.animate("run.png")
    with pytest.raises(ModelError, match="whole number for frames, got 'many'"):
        run.animate(frames="many")
    with pytest.raises(ModelError, match="at least 2 frames, got 1"):
        run.animate(frames=1)
