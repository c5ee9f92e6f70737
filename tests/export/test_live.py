"""The page that computes: its code against runs of symgen, and its picture against that of a run."""

from __future__ import annotations

import ctypes
import json
import re
import shutil
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

import symgen
from symgen.errors import BuildError, CapabilityError, ModelError
from symgen.export.live import sources_of
from symgen.inspection import live as inspected
from symgen.inspection.film import film_of
from symgen.inspection.loops import LoopView
from symgen.inspection.picture import pose_of_loop
from symgen.inspection.view import drawn_scene
from symgen.pipeline.build import build_selected
from symgen.report.page.animation import places_of
from symgen.report.page.live import live
from symgen.scene.loading import check_scene, override, read_scene
from symgen.scene.resolve import resolve
from symgen.toolchain.wasm import compile_wasm

FRAMES = 25
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")


class Code:
    """The code of a page as a shared library."""

    def __init__(self, folder, files, outputs):
        for file in files:
            (folder / file.name).parent.mkdir(exist_ok=True)
            (folder / file.name).write_text(file.text, encoding="utf-8")
        sources = [f.name for f in files if f.name.endswith(".c")]
        flags = ["-std=c11", "-O0", "-ffp-contract=off", "-fPIC", "-shared"]
        subprocess.run(["cc", *flags, "-o", "live.so", *sources, "-lm"], cwd=folder, check=True)
        self.library, self.outputs = ctypes.CDLL(str(folder / "live.so")), outputs
        for name in ("parameters", "times", "outputs"):
            getattr(self.library, f"live_{name}").restype = ctypes.POINTER(ctypes.c_double)
        self.library.live_words.restype = ctypes.c_char_p

    def follow(self, *parameters):
        """Return status, times and outputs."""
        for i, value in enumerate(parameters):
            self.library.live_parameters()[i] = value
        status, reached = self.library.live_follow(), self.library.live_reached()
        times = np.ctypeslib.as_array(self.library.live_times(), (FRAMES,))[:reached].copy()
        outputs = np.ctypeslib.as_array(self.library.live_outputs(), (FRAMES, self.outputs))
        return status, times, outputs[:reached].copy()


@pytest.fixture
def page_of(monkeypatch, tmp_path):
    """Return the page of a scene, its data and its code, compiled for this machine."""

    def made(name, vary=None, changes=None):
        text, files = override(read_scene(name), changes or {}), []
        monkeypatch.setattr(inspected, "wasm_of", lambda x, n: files.extend(sources_of(x, n)) or b"\0asm")
        page = inspected.live_of(text, vary or {}, FRAMES)
        data = json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', live(page), re.DOTALL)[1])
        return page, data, Code(tmp_path, files, len(page.outputs))

    return made


def draws_the_animation(data, outputs, film):
    """Whether the vertices of each frame are those of the animation."""
    for row, sketch in zip(outputs, film.sketches, strict=True):
        own = np.array(data["constant"])
        for vertex, output, weight in data["weights"]:
            own[vertex] += weight * row[output]
        if np.max(np.abs(own - places_of(sketch).ravel())) > 1e-12:
            return False
    return True


def test_a_linkage_with_other_lengths_is_that_of_symgen(page_of):
    page, data, code = page_of("crank_rocker")
    assert [s.name for s in page.sliders] == [f"links.{k}.length" for k in ("crank", "coupler", "rocker")]
    assert (page.sliders[0].low, page.sliders[0].value, page.sliders[0].high) == pytest.approx(
        (0.05, 0.1, 0.15)
    )
    keys = {f"links.{k}.length": "{} m" for k in ("crank", "coupler", "rocker")}
    rng = np.random.default_rng(3)
    names = [name for name, _, _ in page.outputs]
    for _ in range(3):
        lengths = rng.uniform((0.05, 0.33, 0.28), (0.1, 0.4, 0.35))
        status, times, outputs = code.follow(*lengths)
        assert status == 0 and len(times) == FRAMES
        changes = {key: form.format(x) for (key, form), x in zip(keys.items(), lengths, strict=True)}
        model = symgen.build("crank_rocker", set=changes)
        motion, forces = model.kinematics(samples=FRAMES), model.inverse_dynamics(samples=FRAMES)
        assert motion.time == pytest.approx(times, abs=1e-15)
        for name, found in (("B.position", motion), ("B.acceleration", motion), ("C.reaction", forces)):
            own = outputs[:, [names.index(f"{name}.{c}") for c in "xy"]]
            truth = found.variable(name).values
            assert np.max(np.abs(own - truth)) < 1e-12 * np.max(np.abs(truth)), name
        torque = forces.variable("crank.torque").values
        own = outputs[:, names.index("crank.torque")]
        assert np.max(np.abs(own - torque)) < 1e-12 * np.max(np.abs(torque))
    _, _, outputs = code.follow(*(s.value for s in page.sliders))
    assert draws_the_animation(data, outputs, film_of(read_scene("crank_rocker"), FRAMES))
    # Without a solution the code says so, and has no frames.
    status, times, _ = code.follow(0.1, 1.0, 0.3)
    assert status != 0 and len(times) == 0 and code.library.live_words(status)
    assert data["frames"] == FRAMES and data["outputs"] == len(names)


def test_starts_far_from_that_of_the_scene_are_reached(page_of):
    """Lengths at which a projection of the scene's start alone does not meet the constraints."""
    page, _, code = page_of("crank_rocker")
    names = [name for name, _, _ in page.outputs]
    status, times, outputs = code.follow(0.076, 0.279, 0.394)
    assert status == 0 and len(times) == FRAMES
    b = outputs[:, [names.index(f"B.position.{c}") for c in "xy"]]
    a = 0.076 * np.stack([np.cos(2 * np.pi * times), np.sin(2 * np.pi * times)], axis=1)
    assert np.linalg.norm(b - a, axis=1) == pytest.approx(np.full(FRAMES, 0.279), abs=1e-14)
    assert np.linalg.norm(b - [0.4, 0.0], axis=1) == pytest.approx(np.full(FRAMES, 0.394), abs=1e-14)
    (bx, by), (ax, ay) = (b - [0.4, 0.0]).T, (a - [0.4, 0.0]).T
    assert len({*np.sign(bx * ay - by * ax)}) == 1  # on one branch


def test_a_loop_with_other_parameters_is_that_of_symgen(page_of):
    page, data, code = page_of("slider_crank", {"a4": "0 in:20 in", "S1": "0 in:9 in"})
    assert ("S4", "in", 0.0254) in page.outputs
    assert {s.name: s.high for s in page.sliders if s.high is not None} == pytest.approx(
        {"a4": 20 * 0.0254, "S1": 9 * 0.0254}
    )
    values = [s.value for s in page.sliders]
    model = symgen.build("slider_crank")
    names, rng = [name for name, _, _ in page.outputs], np.random.default_rng(4)
    for _ in range(3):
        given = {"a4": rng.uniform(0.0, 0.3), "S1": rng.uniform(0.0, 0.1)}
        parameters = [given.get(s.name, x) for s, x in zip(page.sliders, values, strict=True)]
        status, times, outputs = code.follow(*parameters)
        assert status == 0
        found = model.with_parameters(**given).inverse_dynamics(
            start=0.0, stop=times[-1], over="time", samples=FRAMES
        )
        for name in ("theta1.drive", "S4"):
            own, truth = outputs[:, names.index(name)], found.variable(name).values
            assert np.max(np.abs(own - truth)) < 1e-12 * np.max(np.abs(truth)), name
    _, _, outputs = code.follow(*values)
    assert draws_the_animation(data, outputs, film_of(read_scene("slider_crank"), FRAMES))


def test_a_slider_of_an_expression_is_in_si_units(monkeypatch):
    monkeypatch.setattr(inspected, "wasm_of", lambda *_: b"\0asm")
    for value, unit, size in (("1 * base", "kg/m", 1.0), ("10 g/cm", "g/cm", 0.1)):
        base = {"parameters.base": "1 kg/m"} if "base" in value else {}
        changes = {**base, "parameters.rho.value": value}
        (slider,) = inspected.live_of(override(read_scene("peaucellier"), changes), {}, 2).sliders
        assert slider.unit == unit and slider.size == pytest.approx(size)


def test_elastic_links_at_another_speed_are_those_of_symgen(page_of):
    page, data, code = page_of("elastic_four_bar")
    assert [(s.name, s.low / s.value, s.high / s.value) for s in page.sliders] == [("speed", 0.5, 1.5)]
    assert page.sliders[0].unit == "rpm" and page.sliders[0].value / page.sliders[0].size == pytest.approx(95)
    of = drawn_scene(read_scene("elastic_four_bar"))
    model, names = build_selected(of.text, backend="c"), [name for name, _, _ in page.outputs]
    assert {*page.plotted} == {names.index(name) for name in of.plotted} and "crank.torque" in of.plotted
    units = {name: (unit, size) for name, unit, size in page.outputs}
    assert units["crank.bending_strain"] == ("microstrain", 1e-6)
    assert units["crank.stress"] == ("psi", pytest.approx(6894.757, rel=1e-6))
    for speed in (5.3, 9.0, 14.9):
        status, times, rows = code.follow(speed)
        run = model.with_parameters(speed=speed).quasi_static(samples=FRAMES)
        assert status == 0 and times == pytest.approx(run.time, abs=1e-15)
        sizes = {}
        for v in run.variables:
            sizes[v.unit] = max(sizes.get(v.unit, 0.0), np.max(np.abs(v.values)))
        for v in run.variables:
            columns = [f"{v.name}.{c}" for c in v.components] or [v.name]
            own = rows[:, [names.index(c) for c in columns]].reshape(v.values.shape)
            assert np.max(np.abs(own - v.values)) < 1e-12 * sizes[v.unit], v.name
    run = model.quasi_static(samples=FRAMES)
    sketches = of.view.sketches(of.resolved, model, run)
    _, _, rows = code.follow(page.sliders[0].value)
    assert draws_the_animation(data, rows, SimpleNamespace(sketches=sketches))
    assert "6.1 times the peak stress of the quasi-static one" in page.caption
    assert "magnified 20 times" in page.caption
    status, times, _ = code.follow(0.0)
    assert status != 0 and len(times) == 0


def test_elastic_links_that_c_does_not_hold_are_refused():
    with pytest.raises(ModelError, match="elastic_four_bar_free has no live page: its crank is free"):
        inspected.live_of(read_scene("elastic_four_bar_free"), {}, FRAMES)
    with pytest.raises(ModelError, match=r"which depend on thickness, are fixed in C\n.*; --vary"):
        inspected.live_of(read_scene("elastic_four_bar"), {"thickness": "0.3 in:0.5 in"}, FRAMES)


def test_other_tunable_parameters_of_elastic_links_are_held(monkeypatch):
    text = override(read_scene("elastic_four_bar"), {"parameters.width": {"value": "1 in", "tunable": True}})
    monkeypatch.setattr(inspected, "wasm_of", lambda code, frames: code.name.encode())
    page = inspected.live_of(text, {"speed": "80 rpm:100 rpm"}, FRAMES)
    assert [slider.name for slider in page.sliders] == ["speed"]


def test_places_of_joints_are_products_of_matrices():
    """Outputs of joints against 4x4 transformations of the rows of the link-joint table."""
    text = read_scene("slider_crank")
    resolved = resolve(check_scene(text))
    film = film_of(override(text, {"parameters.a4.value": "6 in"}), 7)
    model = symgen.build("slider_crank", set={"a4": "6 in"})
    found = model.kinematics(samples=7)
    q = np.stack(
        [
            found.variable(v.name).values if v.name in found else found.coordinate.values
            for v in model.description.variables
        ],
        axis=1,
    )
    for sketch, t, x in zip(film.sketches, found.time, q, strict=True):
        truth = LoopView().sketch_at(resolved, pose_of_loop(resolved, model, float(t), x))
        assert places_of(sketch) == pytest.approx(places_of(truth), abs=1e-12)


def test_refusals(monkeypatch):
    with pytest.raises(ModelError, match="elastic has no live page: it has no outputs"):
        sources_of(SimpleNamespace(name="elastic", outputs=(), specific={}), FRAMES)
    with pytest.raises(CapabilityError, match="spatial_slider_crank has no export to C and no live page"):
        inspected.live_of(read_scene("spatial_slider_crank"), {}, FRAMES)
    with pytest.raises(ModelError, match="expected the range of the slider of links_coupler_length"):
        inspected.live_of(read_scene("crank_rocker"), {"links.coupler.length": "1 m"}, FRAMES)
    with pytest.raises(ModelError, match="links_crank_length moves the start of four_bar"):
        inspected.live_of(read_scene("four_bar"), {"links.crank.length": "0.9 m:1.1 m"}, FRAMES)
    with pytest.raises(ModelError, match="expected at least 2 frames of a page, got 1"):
        inspected.live_of(read_scene("crank_rocker"), {}, 1)
    monkeypatch.setattr("symgen.toolchain.compiler.find_spec", lambda _: None)
    with pytest.raises(BuildError, match=r"pip install 'symgen\[live\]'"):
        compile_wasm([])
