"""The animation: its numbers against closed forms, and what a page may contain."""

from __future__ import annotations

import json
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

import symgen
from symgen.errors import CapabilityError, ModelError
from symgen.inspection.film import film_of, film_of_mode
from symgen.inspection.picture import bent_outputs, bent_sketch
from symgen.inspection.view import View
from symgen.report.page.animation import animation, curves_of
from symgen.scene.loading import check_scene, override, read_scene
from symgen.scene.resolve import resolve


def page_of(name, samples=25, changes=None, **asked):
    film = film_of(override(read_scene(name), changes or {}), samples, **asked)
    text = animation(film)
    return text, json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL)[1])


def places(data):
    """Return the vertices of all lines and the nodes, (frames, points, axes)."""
    frames = np.array(data["frames"])
    return frames.reshape(len(frames), -1, len(data["low"]))


def nodes(data):
    first = sum(line["count"] for line in data["lines"])
    return {node["name"]: places(data)[:, first + i] for i, node in enumerate(data["nodes"])}


def test_a_crank_rocker_turns_as_two_circles_say():
    _, data = page_of("crank_rocker")
    found, t = nodes(data), np.linspace(0.0, 1.0, 25)
    assert data["along"]["values"] == pytest.approx(t, abs=1e-5)
    tip = 0.1 * np.array([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)]).T
    assert found["A"] == pytest.approx(tip, abs=1e-5)
    assert np.linalg.norm(found["B"] - tip, axis=1) == pytest.approx(np.full(25, 0.35), abs=2e-5)
    assert np.linalg.norm(found["B"] - [0.4, 0.0], axis=1) == pytest.approx(np.full(25, 0.3), abs=2e-5)
    start = next(i for i, line in enumerate(data["lines"]) if line["name"] == "coupler")
    before = sum(line["count"] for line in data["lines"][:start])
    assert places(data)[:, before] == pytest.approx(found["A"], abs=0)
    assert places(data)[:, before + 1] == pytest.approx(found["B"], abs=0)
    assert {c["name"] for c in data["curves"]} >= {"B.position.x", "crank.torque"}


@pytest.mark.parametrize("mass", [None, "1 kg"])
def test_a_motion_up_to_a_dead_centre_is_shown_there_and_back(mass):
    """The crank stops where coupler and rocker are in line: the distance AC is then the sum of their lengths."""
    scene = read_scene("crank_rocker")
    links = {"crank": ["O", "A"], "coupler": ["A", "B"], "rocker": ["C", "B"]}
    scene.data.clear()
    scene.data.update(
        symgen=1, parameters={"speed": "1 rad/s"},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True}, "C": {"at": ["0.5 m", "0 m"], "ground": True},
            "A": {"at": ["0.38 m", "0 m"]}, "B": {"at": ["0.4 m", "0.3 m"]},
        },
        links={n: {"points": ends} | ({"mass": mass} if mass else {}) for n, ends in links.items()},
        drivers=[{"link": "crank", "angle": "speed*t"}], analysis={"t_end": "6 s"}
        | ({} if mass else {"kind": "kinematics"}),
    )  # fmt: skip
    film = film_of(scene, 41)
    b, c = math.hypot(0.02, 0.3), math.hypot(0.1, 0.3)
    stop = math.acos((0.38**2 + 0.5**2 - (b + c) ** 2) / (2 * 0.38 * 0.5))
    times = film.result.time
    top = int(np.argmax(times))
    assert stop - 6 / 40 <= times[top] <= stop and "dead centre" in film.caption
    assert np.array_equal(times[top + 1 :], times[1:top][::-1])
    there, back = film.sketches[top - 1], film.sketches[top + 1]
    assert np.array_equal([n.at for n in there.nodes], [n.at for n in back.nodes])


def test_the_caption_counts_the_curves_that_are_not_drawn():
    every = [f"{p}.{word}" for p in "AB" for word in ("position", "velocity", "acceleration")]
    text, data = page_of("four_bar", 5, {"analysis.outputs": [*every, "energy"]})
    assert len(data["curves"]) == 12 and "1 more curves are recorded and not drawn." in text
    text, data = page_of("four_bar", 5, {"analysis.outputs": every})
    assert len(data["curves"]) == 12 and "not drawn" not in text


def test_arrows_of_forces_stand_at_their_joints():
    """Forces on both links of a joint are opposite; those of loops are drawn in the axes of the ground."""
    asked = ["C.reaction", "coupler.A.force", "crank.A.force", "coupler.tension", "B.velocity"]
    text, data = page_of("crank_rocker", 5, {"analysis.outputs": asked})
    forces = {force["name"]: force for force in data["forces"]}
    joints = [data["nodes"][force["node"]]["name"] for force in forces.values()]
    assert list(forces) == asked[:3] and joints == ["C", "A", "A"]
    one, other = (
        np.array([part["values"] for part in forces[name]["parts"]])
        for name in ("coupler.A.force", "crank.A.force")
    )
    assert one.shape == (2, 5) and one == pytest.approx(-other, rel=1e-4) and np.ptp(one) > 1
    assert "Arrows are the recorded forces" in text
    plotted = {"analysis.outputs": ["slider.joint3.force"]}
    text, data = page_of("slider_crank", 3, plotted)
    (force,) = data["forces"]
    assert force["name"] == "slider.joint3.force_in_ground" and "Arrows are" in text
    assert data["nodes"][force["node"]]["name"] == "S3"
    assert [c["name"] for c in data["curves"]] == [f"slider.joint3.force.{c}" for c in "xyz"]
    own, turned = (np.array([c["values"] for c in of]) for of in (data["curves"], force["parts"]))
    assert np.linalg.norm(own, axis=0) == pytest.approx(np.linalg.norm(turned, axis=0), rel=1e-4)
    text, data = page_of("slider_crank", 3, {"analysis.outputs": ["S4"]})
    assert data["forces"] == [] and "Arrows are" not in text


def test_a_loop_keeps_its_lengths_and_its_lines():
    """The nut of the screw jack stands where its rod has no length: every frame has the same lines."""
    _, data = page_of("slider_crank", samples=13)
    found = nodes(data)
    assert data["along"]["label"] == "theta1 [deg]" and len(data["frames"]) == 13
    crank = np.linalg.norm(found["S2"] - found["P4"], axis=1)
    rod = np.linalg.norm(found["S3"] - found["S2"], axis=1)
    assert crank == pytest.approx(np.full(13, crank[0]), rel=1e-4)
    assert rod == pytest.approx(np.full(13, rod[0]), rel=1e-4)
    _, jack = page_of("screw_jack", samples=5)
    assert len(places(jack)) == 5


def test_elastic_links_and_scenes_of_kinematics_move():
    _, data = page_of("elastic_four_bar", samples=9)
    assert len(data["frames"]) == 9 and "elastic" in {line["kind"] for line in data["lines"]}
    _, data = page_of(
        "crank_rocker", samples=9, changes={"analysis.kind": "kinematics", "analysis.outputs": []}
    )
    assert len(data["frames"]) == 9


def test_deflections_of_elastic_links_are_magnified_as_the_caption_says():
    """A strip clamped on its shaft leaves it along the rigid motion, and its tip is where the run has it."""
    film = film_of(read_scene("rotating_cantilever"), 11, t_end=0.02)
    times = float(re.search(r"magnified (\d+) times", film.caption)[1])
    run = symgen.build("rotating_cantilever").simulate(0.02, samples=11)
    angle = 4 * np.pi * run.time  # 120 rpm
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    left = np.column_stack([-along[:, 1], along[:, 0]])
    strip = np.array([next(x.at for x in s.lines if x.kind == "elastic") for s in film.sketches])
    rigid = np.array([next(x.at for x in s.lines if x.kind == "rail") for s in film.sketches])
    assert rigid[:, 1] == pytest.approx(along, abs=1e-9)
    moved = times * run["tip.displacement"].values
    assert strip[:, -1] == pytest.approx(along + moved, abs=1e-3 * np.abs(moved).max())
    assert 0.02 < np.abs(moved).max() <= 0.08  # of about a metre, the extent of the motion
    across = np.einsum("tpi,ti->tp", strip, left)
    last = np.argmax(np.abs(across[:, -1]))
    shape = across[last] / across[last, -1]
    x = np.linspace(0.0, 1.0, len(shape))
    assert shape == pytest.approx((3 * x**2 - x**3) / 2, abs=0.03)  # of a cantilever under a force at its tip


def test_round_off_is_not_plotted():
    _, data = page_of("planar_4r", samples=9)
    largest = {}
    for curve in data["curves"]:
        size = max(abs(x) for x in curve["values"])
        largest[curve["unit"]] = max(size, largest.get(curve["unit"], 0.0))
    for curve in data["curves"]:
        size = max(abs(x) for x in curve["values"])
        assert size == 0 or size > 1e-9 * largest[curve["unit"]]
    run = symgen.build("triple_pendulum").simulate(0.5, samples=5)
    assert np.ptp(run["energy"].values) > 0
    curves = {c["name"]: c["values"] for c in curves_of(run.variables, run.drift)}
    assert len(set(curves["energy"])) == 1 and len(set(curves["A.position.x"])) == 5


def test_a_title_cannot_end_the_script():
    text, data = page_of("crank_rocker", samples=3, changes={"title": "</script><b>Crank & rocker"})
    assert data["title"] == "</script><b>Crank & rocker"
    assert "</script><b>" not in text and "&lt;/script&gt;&lt;b&gt;Crank &amp; rocker" in text
    assert not re.search(r"(src|href)=\"(?!data:)", text)


def test_a_method_without_a_moving_picture_is_refused_by_name():
    with pytest.raises(ModelError, match="toy has no animation"):
        View().drawn_outputs(SimpleNamespace(name="toy"))


def test_the_command_writes_a_page(tmp_path, monkeypatch, entry):
    monkeypatch.chdir(tmp_path)
    assert entry("animate", "crank_rocker", "--samples", "5")[:2] == (0, "wrote crank_rocker_moving.html\n")
    assert (tmp_path / "crank_rocker_moving.html").stat().st_size < 100_000
    code, out, said = entry("animate", "crank_rocker", "--out", "page.png")
    assert (code, out) == (2, "") and ".html" in said


def test_a_mode_of_a_strip_is_that_of_a_cantilever():
    """Closed form: cosh bx - cos bx - s (sinh bx - sin bx) with cos b cosh b = -1, here of the second mode."""
    film = film_of_mode(read_scene("rotating_cantilever"), 2, None, 9)
    b = 4.694091132974175
    s = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    strips = np.array([next(k.at for k in one.lines if k.kind == "elastic") for one in film.sketches])
    count = strips.shape[1]
    assert count > 16  # places on the shape functions, between which pages draw a smooth curve
    x = b * np.linspace(0.0, 1.0, count)
    shape = np.cosh(x) - np.cos(x) - s * (np.sinh(x) - np.sin(x))
    phases = np.cos(np.linspace(0.0, 2 * np.pi, 9))
    tip = strips[0, -1, 1]
    assert strips[:, :, 1] == pytest.approx(tip * phases[:, None] * shape / shape[-1], abs=2e-3 * abs(tip))
    assert np.ptp(strips[:, :, 0], axis=0) == pytest.approx(np.zeros(count), abs=1e-12)
    bow = strips[0, :, 1] - np.linspace(0.0, tip, count)
    assert max(abs(tip), np.max(np.abs(bow))) == pytest.approx(0.08 * strips[0, -1, 0])  # of the length
    found = symgen.build("rotating_cantilever").modes().frequencies[1]
    assert f"Mode 2 of 16, {found:.6g} Hz" in film.caption
    assert film.result.time[-1] == pytest.approx(1 / found)


def test_a_mode_of_a_four_bar_keeps_the_lengths_of_its_links():
    film = film_of_mode(read_scene("four_bar"), 1, None, 5)
    first, last = ({node.name: np.array(node.at) for node in film.sketches[k].nodes} for k in (0, 2))
    moved = {name: (first[name] - last[name]) / 2 for name in first}
    rest = {name: (first[name] + last[name]) / 2 for name in first}
    largest = max(np.linalg.norm(x) for x in moved.values())
    for p, q in ("OA", "AB", "CB"):
        assert (moved[q] - moved[p]) @ (rest[q] - rest[p]) == pytest.approx(0.0, abs=1e-9 * largest)
    assert largest > 0.01 and moved["O"] == pytest.approx([0, 0], abs=0)


@pytest.mark.parametrize(
    ("scene", "number", "angle", "words"),
    [
        ("four_bar", 2, None, "there is no mode 2: four_bar has 1"),
        ("four_bar", 1, 0.5, "about its equilibrium: leave the angle out"),
        ("elastic_four_bar", 0, None, "there is no mode 0"),
        ("slider_crank", 1, None, "does not support modes"),
        ("elastic_four_bar_free", 1, None, "mode 1 of elastic_four_bar_free does not vibrate"),
    ],
)
def test_modes_without_a_picture_are_refused(scene, number, angle, words):
    with pytest.raises((ModelError, CapabilityError), match=words):
        film_of_mode(read_scene(scene), number, angle, 5)


def test_links_of_spherical_loops_are_plates_with_the_angle_of_their_axes():
    """The axes of each moving link of a Cardan joint are perpendicular; the loop has no lengths."""
    film = film_of(read_scene("cardan"), 9)
    for sketch in film.sketches:
        centre = sketch.nodes[0].at
        plates = [line for line in sketch.lines if line.kind == "body"]
        assert [plate.name for plate in plates] == ["input", "cross", "output"]
        for plate in plates:
            a, b = plate.at[0] - centre, plate.at[1] - centre
            assert abs(a @ b) < 1e-9 * (a @ a) and np.isclose(a @ a, b @ b, rtol=1e-9)
    moved = [sketch.lines[-1].at for sketch in (film.sketches[0], film.sketches[2])]
    assert np.allclose(*moved)  # the ground stays


def test_a_point_of_an_elastic_link_without_load_is_drawn_on_the_bent_link():
    """Its place is that of the same point with a mass of next to nothing, which has coordinates and outputs."""
    point = {"points.T": {"on": "coupler", "fraction": 0.5}}
    scene = read_scene("elastic_four_bar")
    masses = [*scene.data.get("masses", []), {"point": "T", "mass": "1e-9 kg"}]
    alone, weighted = (
        film_of(override(read_scene("elastic_four_bar"), changes), 7, t_end=0.05)
        for changes in (point, {**point, "masses": masses})
    )
    magnified = [re.search(r"magnified (\d+) times", film.caption)[1] for film in (alone, weighted)]
    assert magnified[0] == magnified[1]
    at, expected = (
        np.array([next(n.at for n in s.nodes if n.name == "T") for s in film.sketches])
        for film in (alone, weighted)
    )
    curves = [next(k.at for k in s.lines if k.name == "coupler") for s in weighted.sketches]
    off = expected - [(curve[0] + curve[-1]) / 2 for curve in curves]
    largest = float(np.max(np.linalg.norm(off, axis=1)))
    # The other has a node more, and steps of its own.
    assert largest > 5e-5 and at == pytest.approx(expected, abs=0.02 * largest)


def test_points_that_rigid_parts_carry_beside_elastic_links_are_drawn():
    """Z on the rigid crank and Y on the rigid part of X have no outputs: they are at complex multiples of others."""
    off = {"on": "rod", "fraction": 0.5}
    points = {
        "points.Z": {"on": "crank", "fraction": 0.5, "offset": "1 cm"},
        "points.X": {**off, "offset": "3 cm"},
        "points.Y": {**off, "offset": "-3 cm"},
    }
    linkage = resolve(check_scene(override(read_scene("elastic_slider_crank"), points)))
    places = {"A": 0.03 + 0.04j, "P": 0.22 + 0j, "X_foot": 0.12 + 0.03j, "X": 0.13 + 0.06j}
    zero = np.zeros(2)
    drawn = dict.fromkeys(bent_outputs(linkage), zero)
    drawn |= {f"{name}.position": np.array([z.real, z.imag]) for name, z in places.items()}
    start = {p.name: np.array([linkage.number(x) for x in p.at]) for p in linkage.points}
    nodes = bent_sketch(linkage, start, drawn, 1.0).nodes
    found = {n.name: complex(*n.at) for n in nodes}
    assert found["Z"] == pytest.approx(places["A"] * (0.5 + 0.2j), abs=1e-15)  # an offset of a fifth of 5 cm
    assert found["Y"] == pytest.approx(2 * places["X_foot"] - places["X"], abs=1e-15)


def test_elastic_links_in_space_bend_by_magnified_deflections():
    """The rod between its pin, on a circle, and the slider; its middle against a station of the scene's own run."""
    station = {"stations": [{"name": "mid", "link": "rod", "at": 0.5}]}
    text = override(read_scene("spatial_slider_crank"), station)
    film = film_of(text, 13)
    run = symgen.build(text).simulate(samples=13)
    times, largest = float(re.search(r"magnified (\d+) times", film.caption)[1]), 0.0
    for k, sketch in enumerate(film.sketches):
        curve = next(line.at for line in sketch.lines if line.kind == "elastic")
        angle = 2 * math.pi * k / 12
        pin = 0.05 * np.array(
            [math.sin(angle) / math.sqrt(2), math.cos(angle), math.sin(angle) / math.sqrt(2)]
        )
        assert curve[0] == pytest.approx(pin, abs=1e-9)
        ends = [run[f"{p}.position"].values[k] for p in "AP"]
        off = run["mid.position"].values[k] - np.mean(ends, axis=0)
        # Both runs have steps of their own, for stresses within 1 %.
        assert curve[len(curve) // 2] == pytest.approx(np.mean(ends, axis=0) + times * off, abs=2e-4)
        largest = max(largest, np.linalg.norm(off) * times)
    assert 0.01 < largest < 0.08 * 0.45
