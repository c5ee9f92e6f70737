"""The page on a scene: its content, and its display in a real browser."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest
from shared.browsing import browser, in_chromium
from shared.shipped import derived
from typer.testing import CliRunner

from symgen.cli import app
from symgen.errors import SceneError, SymgenError
from symgen.inspection.measured import speed_caption, speed_figure, speed_table
from symgen.inspection.page import scene_page
from symgen.pipeline.systems import derive
from symgen.report.page.page import render
from symgen.scene.loading import override, read_scene, shipped_scene, shipped_scenes
from symgen.study.speed.work_precision import WorkPrecision, WorkPrecisionPoint

FOLDER = Path(__file__).parents[2] / "benchmarks"
README = Path(__file__).parents[2] / "README.md"
#: One of rods, one of them in space, one loop, one with links that bend.
SCENES = ("four_bar", "vertical_rods", "slider_crank", "elastic_slider_crank")


@pytest.fixture(scope="module")
def gathered():
    return {name: scene_page(read_scene(name), speed=False, progress=lambda _: None) for name in SCENES}


@pytest.fixture(scope="module")
def pages(gathered, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    made = {name: folder / f"{name}.html" for name in gathered}
    for name, page in gathered.items():
        made[name].write_text(render(page))
    return made


def test_names_between_backticks_are_code_and_escaped(gathered):
    page = render(replace(gathered["four_bar"], about="As `a<b` of `four_bar`, a<b."))
    assert "As <code>a&lt;b</code> of <code>four_bar</code>, a&lt;b.</p>" in page


@pytest.mark.parametrize("name", SCENES)
def test_a_page_is_whole_and_needs_nothing_else(pages, name):
    text = pages[name].read_text()
    assert len(text) < 1_000_000
    assert not re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', text)
    assert text.count("<script") == 1  # the buttons that copy
    assert "url(http" not in text and "@import" not in text
    for anchor in re.findall(r'href="#([^"]+)"', text):
        assert f'id="{anchor}"' in text
    for section in ("mechanism", "derivation", "symbols", "kernels", "run", "sources"):
        assert f'<section id="{section}">' in text
    assert text.count("<math") > 20 and "<svg" in text and "data:image/svg+xml;base64" in text
    assert "restrict q" in text and "{{" not in text
    framed = unescape(re.search(r'class="moving"><iframe srcdoc="([^"]*)"', text)[1])
    film = json.loads(re.search(r'id="data"[^>]*>(.*?)</script>', framed)[1])
    assert len(film["frames"]) > 50 and film["curves"] == [] and "<h1>" not in framed
    moving, still = text.index('class="moving"'), text.index('<figure class="drawing">')
    assert moving < still and not re.findall(r"\.drawing[^{}]*\{[^}]*display: none", text)


WIDTHS = (390, 1440)


@pytest.fixture(scope="module")
def seen(pages, tmp_path_factory):
    """All pages at both widths, and one with faults, in one browser."""
    folder = tmp_path_factory.mktemp("browser")
    bad = folder / "bad.html"
    bad.write_text(
        "<!DOCTYPE html><html><body><script>console.error('broken'); missing();</script>"
        "<p style='width: 2000px'>wide</p><math style='display: none'><mi>x</mi></math>"
        "<img src='nothing.png'></body></html>"
    )
    return browser.look([*pages.values(), bad], WIDTHS, folder)


@in_chromium
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("width", WIDTHS)
def test_a_page_in_a_browser(seen, name, width):
    """No script or console error, every equation visible, nothing wider than the window, no overlap."""
    found = seen[name, width]
    assert found.width == width
    assert found.math > 20 and found.faults == []


@in_chromium
@pytest.mark.full
@pytest.mark.parametrize("name", [name for name in shipped_scenes() if name not in SCENES])
def test_every_page_in_a_browser(name, tmp_path):
    page = tmp_path / f"{name}.html"
    page.write_text(render(scene_page(read_scene(name), speed=False, progress=lambda _: None)))
    assert page.stat().st_size < 2_000_000
    assert [found.faults for found in browser.look([page], WIDTHS, tmp_path).values()] == [[], []]


@in_chromium
def test_buttons_copy_matrices(pages, tmp_path):
    """As LaTeX and as Python, from a file on disk."""
    click = (
        "<script>navigator.clipboard.writeText = async (text) => console.error(`copied ${text}`);"
        "document.querySelectorAll('button[data-copy]:not([hidden])').forEach((button) => button.click());</script>"
    )
    page = tmp_path / "copied.html"
    page.write_text(pages["four_bar"].read_text().replace("</body>", f"{click}</body>"))
    faults = " | ".join(browser.look([page], WIDTHS[1:], tmp_path)["copied", WIDTHS[1]].faults)
    assert r"copied \[" in faults and "copied from sympy import *" in faults


@in_chromium
def test_the_browser_sees_what_is_wrong(seen):
    """A page with faults is distinguished from one without."""
    faults = " | ".join(seen["bad", 390].faults)
    for word in ("broken", "missing is not defined", "px wide in 390", "P.", "1 of 1 equations", "pictures"):
        assert word in faults


def test_a_page_shows_what_was_derived(pages):
    """Its numbers are those of the model, its symbols those of the system."""
    import symgen

    model, system = symgen.build("four_bar"), derived("four_bar")
    text = pages["four_bar"].read_text()
    assert f"{model.operations['accelerations']['flops']} for the accelerations" in text
    for group in system.groups:
        for quantity in group.quantities:
            assert f"<code>{quantity.name}</code>" in text and quantity.description in text
    for name in ("crank_lambda", "O_reaction_x"):  # those of the momentum rows too
        assert f"<code>{name}</code>" in text
    assert model.description.equations in text
    assert "Attia, Eqs. (12)-(16)" in text and "Attia (14)" in text


def test_matrices_that_a_page_leaves_out_in_part_have_their_command(tmp_path):
    file = tmp_path / "page.html"
    assert CliRunner().invoke(app, ["report", "cssp", "--out", str(file)]).exit_code == 0
    places = file.read_text().split('<div class="matrix">')[1:]
    short = [p for p in places if "too long for a page" in p or re.search(r"<summary>\d+ of \d+ entries", p)]
    assert short
    for place in short:
        name = re.search(r"<code>(.*?)</code>", place)[1]
        assert f"All entries: <code>symgen show cssp {name}</code>" in place


def test_words_of_a_scene_are_escaped(gathered):
    odd = replace(gathered["four_bar"], title="<script>alert(1)</script> & co", about="a < b")
    text = render(odd)
    assert "<script>alert" not in text and "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in text
    assert "a &lt; b" in text


def test_a_page_of_a_driven_linkage_has_no_curves_of_rounding(tmp_path):
    """Drives prescribe its motion; B slides on a rail without mass, at y = 0."""
    file, (code,) = tmp_path / "slider.toml", re.findall("```toml\n(.*?)```", README.read_text(), re.DOTALL)
    file.write_text(code.replace("0.2 s", "0.13 s"))
    page = scene_page(read_scene(file), speed=True, progress=lambda _: None)
    assert page.measured.speed_figure is None and "errors of rounding" in page.measured.speed_caption
    assert re.search(r"differs by \S+ m from", page.measured.speed_caption)
    (end,) = [row for row in page.measured.final.rows if row[0] == "B"]
    assert end[2] == end[4] == "0" and float(end[1]) > 0.15
    (rail,) = page.left_out
    assert rail == "link rail: both ends are ground, so it does not move"
    heavy = override(read_scene(file), {"links.rail.mass": "1 kg"})
    assert derive(heavy).left_out == (f"{rail}; its weight goes into the reactions",)


def test_report_writes_a_page_or_one_error(tmp_path):
    def call(*arguments):
        return CliRunner().invoke(app, ["report", *map(str, arguments)])

    file = tmp_path / "page.html"
    done = call("four_bar", "--out", file, "--set", "t_end=0.5 s")
    assert isinstance(done.exception, SceneError) and not file.exists()
    done = call("four_bar", "--out", tmp_path / "page.pdf")
    assert isinstance(done.exception, SymgenError) and ".html" in str(done.exception)
    done = call("four_bar", "--out", file, "--no-speed")
    assert done.exit_code == 0 and file.read_text().count("<h2>") == 8
    assert "taylor" in file.read_text() and "Speed and error" not in file.read_text()


def test_speed_stands_beside_error():
    """Of each method the loosest, a middle and the tightest setting; errors that say nothing are marked."""
    points = [
        WorkPrecisionPoint(
            method, "float64", f"rtol 1e-{k}", 10.0**-k, 10.0**-k, k * 1e-4, k * 1e-4, 10 * k, None, k < 9
        )
        for method in ("dop853", "rk4")
        for k in range(2, 10)
    ]
    found = WorkPrecision("x", 1.0, 11, "m", "error", "reference", 1e-9, tuple(points), (), ())
    table = speed_table(found)
    assert [row[0] for row in table.rows[:3]] == [
        "dop853, rtol 1e-2",
        "dop853, rtol 1e-6",
        "dop853, rtol 1e-9",
    ]
    assert table.rows[2][1:] == ("~1.0e-09", "900 µs", "90") and len(table.rows) == 6
    assert "~ marks errors" in speed_caption(found)
    assert speed_figure(found).uri.startswith("data:image/svg+xml;base64,")
    assert speed_figure(found) == speed_figure(found)  # the same bytes


@pytest.mark.parametrize("name", ["mine", "four_bar"])
def test_the_code_of_a_page_names_the_file_of_its_scene(name, tmp_path):
    """Also where the file is called as a shipped scene is."""
    file = tmp_path / f"{name}.toml"
    file.write_text(shipped_scene("four_bar"))
    page = scene_page(read_scene(file), speed=False, progress=lambda _: None)
    assert f'symgen.build("{name}.toml")' in unescape(render(page))


def test_the_code_of_a_page_names_a_shipped_scene_with_changes():
    text = override(read_scene("four_bar"), {"analysis.t_end": "0.1 s"})
    page = scene_page(text, speed=False, progress=lambda _: None)
    assert 'symgen.build("four_bar")' in unescape(render(page))
