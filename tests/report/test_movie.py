"""Films as GIF and MP4: their pictures against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.animation import FFMpegWriter
from PIL import Image

from symgen.errors import ModelError, OutputError
from symgen.inspection.film import film_of
from symgen.report.page.drawing import Paper
from symgen.report.page.movie import ForceArrows, film_file, save
from symgen.scene.loading import override, read_scene


def dark(picture, x, y):
    """Return whether a picture is dark within a pixel of a place."""
    grey = np.array(picture.convert("L"))
    x, y = round(x), round(y)
    return bool(grey[y - 1 : y + 2, x - 1 : x + 2].min() < 90)


def test_a_gif_shows_the_crank_where_the_time_says(tmp_path):
    """The middle of the crank is found from the middle of the circle on which A moves."""
    file = tmp_path / "film.gif"
    said: list[str] = []
    save(film_of(read_scene("crank_rocker"), 5), file, said.append)
    assert said[0] == "writing frame 1 of 4" and len(said) == 4
    with Image.open(file) as film:
        # The 5 samples of one second fill the shortest film, 2 s; the last is the first again.
        assert (film.n_frames, film.info["duration"], film.info["loop"]) == (4, 500, 0)
        pictures = []
        for k in range(4):
            film.seek(k)
            pictures.append(film.convert("RGB").copy())
    colours = np.array(pictures[0]).astype(int)
    orange = (colours[..., 0] - colours[..., 2] > 60) & (colours[..., 0] > 180)
    rows, columns = np.nonzero(orange)
    left = columns < 0.5 * colours.shape[1]  # the circle of A; the arc of B is to the right of it
    radius = (columns[left].max() - columns[left].min()) / 2
    middle = columns[left].min() + radius, (rows[left].max() + rows[left].min()) / 2
    for k, picture in enumerate(pictures):
        for j in range(4):
            angle = 2 * math.pi * j / 4
            at = middle[0] + 0.5 * radius * math.cos(angle), middle[1] - 0.5 * radius * math.sin(angle)
            assert dark(picture, *at) == (j == k)


def test_a_gif_shows_forces_in_their_direction_and_scale(tmp_path):
    """The arrow of the only recorded reaction, against the run and the arrow of a round force below it."""
    file, film = tmp_path / "film.gif", film_of(read_scene("crank_rocker"), 5)
    save(film, file)
    force = film.result["C.reaction"].values
    with Image.open(file) as pictures:
        for k in range(4):
            pictures.seek(k)
            red, green, blue = np.moveaxis(np.array(pictures.convert("RGB")).astype(int), 2, 0)
            rows, columns = np.nonzero((red - green > 90) & (blue - green > 60))
            arrow = rows < 0.85 * red.shape[0]
            scale = np.ptp(columns[rows == np.bincount(rows[~arrow]).argmax()])  # of 2 N, at the bottom
            expected = np.abs(force[k]) / 2 * scale
            assert [np.ptp(columns[arrow]), np.ptp(rows[arrow])] == pytest.approx(expected, abs=9)


def test_a_film_without_ffmpeg_is_refused_before_it_is_made(monkeypatch, entry, tmp_path):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ModelError, match=r"ffmpeg, which is not found\n  Install it .*\.gif"):
        film_file("film.mp4")
    assert film_file("film.gif") == Path("film.gif")
    code, out, said = entry("animate", "crank_rocker", "--out", str(tmp_path / "film.mp4"))
    assert (code, out) == (2, "") and "apt install ffmpeg" in said and not [*tmp_path.iterdir()]


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="needs ffmpeg (apt install ffmpeg)")
def test_an_mp4_is_written(tmp_path):
    file = tmp_path / "film.mp4"
    save(film_of(override(read_scene("crank_rocker"), {"title": "A title " * 20}), 5), file)
    assert file.read_bytes()[4:8] == b"ftyp" and file.stat().st_size > 2000


@pytest.mark.parametrize(("said", "words"), [("echo 'no encoder' >&2; ", "\n  no encoder"), ("", "")])
def test_a_film_that_ffmpeg_does_not_write_has_its_message(said, words, tmp_path):
    program, file = tmp_path / "ffmpeg", tmp_path / "film.mp4"
    program.write_text(f"#!/bin/sh\ncat > /dev/null; {said}exit 13\n")
    program.chmod(0o755)
    with rc_context({"animation.ffmpeg_path": str(program)}), pytest.raises(OutputError) as refused:
        save(film_of(read_scene("crank_rocker"), 3), file)
    assert str(refused.value) == f"cannot write the film to {file}: ffmpeg ended with exit code 13{words}"
    assert [*tmp_path.iterdir()] == [program]


def test_a_force_just_below_a_power_of_ten_has_a_scale(tmp_path):
    film = film_of(read_scene("crank_rocker"), 3)
    force = next(v for v in film.result.variables if v.name == "C.reaction")
    largest = np.tile([84.32, 53.76], (3, 1))  # of 99.99999999999999 N
    changed = replace(film, result=replace(film.result, variables=(replace(force, values=largest),)))
    save(changed, tmp_path / "film.gif")
    assert ForceArrows.of(changed, Paper.of(film.sketches)).label == "100 N"


def test_arrows_of_forces_stay_on_the_paper():
    """The ground point of the pendulum is at the top of the picture, and its force points up."""
    film = film_of(read_scene("vertical_rods"), 31)
    paper = Paper.of(film.sketches)
    forces = ForceArrows.of(film, paper)
    tips = forces.at + forces.along
    assert tips.min() > 5 and (tips < (paper.width, paper.height)).all()
    assert np.isclose(np.min(tips[..., 1]), 6.0)  # the longest ends at the edge
