"""Starts of rods: lengths as drawn, floating parts, points drawn at one place."""

from __future__ import annotations

import itertools
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from shared.linkages import at, ground, rod

import symgen
from symgen.errors import InitialStateError, RangeError, SceneError
from symgen.lowering import straight_line
from symgen.runtime._start import size_of_points

CASES = Path(__file__).parents[1] / "cases"


@pytest.mark.parametrize("name", ["start_length_planar", "start_length_space", "start_length_space_tunable"])
def test_a_length_that_the_drawing_has_through_sines_is_kept(name):
    """The rod starts where it is drawn; a uniform rod about its end has the angular acceleration 3 r x g/(2 l^2)."""
    length, azimuth, elevation = 1.2, 0.7, 0.0 if name.endswith("planar") else -0.5
    level = length * math.cos(elevation)
    drawn = np.array([level * math.cos(azimuth), level * math.sin(azimuth), length * math.sin(elevation)])
    gravity = np.array([0.0, -9.81, 0.0] if name.endswith("planar") else [0.0, 0.0, -9.81])
    expected = np.cross(1.5 * np.cross(drawn, gravity) / length**2, drawn)
    model = symgen.build(CASES / f"{name}.toml", backend="numpy")
    axes = len(model.description.shown_axes)
    np.testing.assert_allclose(model.initial_state().positions["A"], drawn[:axes], atol=1e-15)
    np.testing.assert_allclose(model.accelerations()["A"], expected[:axes], atol=1e-13)


@pytest.mark.parametrize("start", [{}, {"angles": {"OA": "0.3 rad"}}])
def test_linkages_are_assembled_from_the_origin(start):
    links = {"OA": {"points": ["O", "A"], "mass": "1 kg"} | ({} if start else {"length": "0.9 m"})}
    points = {"O": {"at": ["1 m", "0 m"], "ground": True}, "A": {"at": ["0 m", "0 m"]}}
    scene = symgen.Scene(points=points, links=links, start=start).called("from_the_origin")
    place = symgen.build(scene, backend="numpy").initial_state().positions["A"]
    expected = [1 + math.cos(0.3), math.sin(0.3)] if start else [0.1, 0.0]
    assert place == pytest.approx(expected, abs=1e-15)


def test_a_start_is_checked_by_the_equations_as_derived(monkeypatch):
    """With constants folded to noise of one bit, the start is an error that names the link."""

    def to_noise(expression, *_):
        if expression.is_Symbol or expression.is_Rational:
            return expression
        if not expression.free_symbols:
            return expression.evalf(40)
        return expression.func(*map(to_noise, expression.args))

    monkeypatch.setattr(straight_line, "fold", to_noise)
    with pytest.raises(SceneError, match=r"\[links\] rod: the start violates the length of link rod by 0\.1"):
        symgen.build(CASES / "start_length_planar.toml", backend="numpy", set={"parameters.l": "1.2000 m"})


def test_ends_of_a_link_at_one_place_are_named():
    """Drawn so in the scene, or by a parameter."""
    with pytest.raises(SceneError, match=r"\[links.r\] points: O and A are drawn at the same place"):
        symgen.build(CASES / "coincident_points.toml", backend="numpy")
    data = tomllib.loads((CASES / "coincident_points.toml").read_text())
    data["parameters"] = {"x": {"value": "0.5 m", "tunable": True}}
    data["points"]["A"]["at"] = ["x", "0 m"]
    model = symgen.build(symgen.Scene(**data), backend="numpy")
    assert model.initial_state().positions["A"] == pytest.approx([1, 0])
    with pytest.raises(InitialStateError, match="O and A are drawn at the same place: the link r"):
        model.with_parameters(x=0.0).initial_state()


@pytest.mark.parametrize("length", [None, "2.5 m"])
@pytest.mark.parametrize("order", ["ABC", "CBA", "BAC"])
def test_the_mean_of_a_floating_part_stays_where_it_is_drawn(length, order):
    """In any order of its points and links."""
    data = tomllib.loads((CASES / "floating_start.toml").read_text())
    drawn = {"A": (0.3, -0.2), "B": (1.3, -0.2), "C": (1.3, 0.5)}
    data["points"] = {p: {"at": [f"{x} m" for x in drawn[p]]} for p in order}
    data["links"]["tail"] = {"points": ["B", "C"], "mass": "1 kg"}
    data["start"]["angles"]["tail"] = "0 deg"
    if length:
        data["links"]["rod"]["length"] = length
    if order != "ABC":
        data["links"] = dict(reversed(data["links"].items()))
        data["start"]["angles"]["tail"] = "180 deg"
        data["links"]["tail"]["points"] = ["C", "B"]
    places = symgen.build(symgen.Scene(**data), backend="numpy").initial_state().positions
    reach = float(length.split()[0]) if length else 1.0
    shape = {"A": np.zeros(2), "B": np.array([0, reach]), "C": np.array([0.7, reach])}
    mean, of_shape = (sum(np.array(x) for x in at.values()) / 3 for at in (drawn, shape))
    for point, place in shape.items():
        np.testing.assert_allclose(places[point], place - of_shape + mean, atol=1e-14)
    alone = symgen.build(CASES / "floating_start.toml", backend="numpy").initial_state().positions["A"]
    np.testing.assert_allclose(alone, [0.5, -0.5], atol=1e-15)


def test_a_length_that_a_parameter_makes_zero_is_named(tmp_path):
    scene = tmp_path / "zero.toml"
    scene.write_text("""
symgen = 1
[parameters]
l = { value = "0.3 m", tunable = true }
w = "10 rad/s"
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.3 m", "0 m"] }
B = { at = ["0.6 m", "0.1 m"] }
[links]
crank = { points = ["O", "A"], mass = "1 kg", length = "l" }
rod = { points = ["A", "B"], mass = "1 kg", length = "l" }
[[drivers]]
link = "crank"
angle = "w*t"
""")
    model = symgen.build(scene, backend="numpy")
    with pytest.raises(RangeError, match="links.crank.length: expected a value above zero, got 0 m"):
        model.with_parameters(l=0.0)


@pytest.mark.parametrize("length", [1e-6, 100.0, 1e3, 1e6])
def test_a_length_far_from_the_drawing_is_reached(length):
    model = symgen.build(
        symgen.Scene(
            parameters={"l": {"value": "1 m", "tunable": True}},
            points={"O": ground(0, 0), "A": at(0.6, -0.8)},
            links={"rod": rod("O", "A", length="l")},
        ),
        backend="numpy",
    )
    place = model.with_parameters(l=length).initial_state().positions["A"]
    assert place == pytest.approx([0.6 * length, -0.8 * length], rel=1e-12)


@pytest.mark.parametrize("length", [1e-3, 100.0, 1e3])
def test_one_of_two_lengths_far_from_the_drawing_is_reached(length):
    model = symgen.build(
        symgen.Scene(
            parameters={"l": {"value": "1 m", "tunable": True}},
            points={"O": ground(0, 0), "A": at(0.6, -0.8), "B": at(0.6, -1.8)},
            links={"upper": rod("O", "A", length="l"), "lower": rod("A", "B")},
        ),
        backend="numpy",
    )
    places = model.with_parameters(l=length).initial_state().positions
    assert np.linalg.norm(places["A"]) == pytest.approx(length, rel=1e-13)
    assert np.linalg.norm(places["B"] - places["A"]) == pytest.approx(1.0, rel=1e-13 * max(1.0, length))


def test_the_size_of_a_linkage_is_undefined_where_a_point_is_not_finite():
    assert size_of_points(np.array([[0.0, 0.0], [3.0, 4.0], [1.5, 2.0]])) == 5.0
    for order in itertools.permutations(([0.0, 0.0], [np.inf, 0.0], [1.0, 2.0])):
        assert math.isnan(size_of_points(np.array(order)))


@pytest.mark.parametrize("name", ["universal_joint.toml", "guide_direction.toml", "lift_table.toml"])
def test_places_of_constraints_are_keys_of_the_scene(name):
    scene = symgen.load_scene(CASES / name)
    d = symgen.build(scene, backend="numpy").description
    for i, label in enumerate(d.labels):
        table = scene.model_dump()
        for key in d.place(i).split("."):
            table = table[int(key) if isinstance(table, list) else key]
        assert table, label
