"""Events: read from a scene, computed by a kernel of their own."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import G, at, ground, rod

import symgen
from symgen.errors import SceneError


def scene(*events, **tables):
    """A pendulum of length 1 m that is let go level."""
    tables = {
        "points": {"O": ground(0, 0), "A": at(1, 0)},
        "links": {"OA": rod("O", "A")},
        "gravity": {"acceleration": ["0 m/s^2", f"{-G!r} m/s^2"]},
        "events": list(events),
    } | tables
    return symgen.Scene(**tables)


def gaps(model, positions, velocities=(0, 0), t=0.0):
    return model.evaluator("events", t, np.array(positions, float), np.array(velocities, float))


def test_no_events_no_kernel():
    model = symgen.build(scene())
    assert "events" not in model.operations
    assert model.description.events == ()


def test_what_passes_zero():
    """Names of outputs and of loads, expressions, parameters; value and dimension."""
    model = symgen.build(
        scene(
            {"name": "low", "of": "A.position.y", "value": "-0.5 m", "direction": "rising"},
            {"name": "same", "of": "A.y", "value": "-50 cm"},
            {"name": "fast", "of": "A.velocity.x**2 + A.vy**2", "value": "v**2"},
            {"name": "down", "of": "OA.angle", "value": "-90 deg", "ends_run": True},
            {"name": "turning", "of": "OA.angular_velocity - OA.rate/2"},
            {"name": "late", "of": "t", "value": "300 ms", "direction": "falling"},
            parameters={"v": {"value": "2 m/s", "tunable": True}},
        )
    )
    found = gaps(model, [0.6, -0.8], [1.6, 1.2], 0.5)
    angle = np.arctan2(-0.8, 0.6) + np.pi / 2
    assert found == pytest.approx([-0.3, -0.3, 4 - 4, angle, 1.0, 0.2], abs=1e-15)
    other = model.with_parameters(v=1.0)
    assert gaps(other, [0.6, -0.8], [1.6, 1.2], 0.5)[2] == pytest.approx(3)
    events = model.description.events
    assert [e.name for e in events] == ["low", "same", "fast", "down", "turning", "late"]
    assert [e.direction for e in events] == [1, 0, 0, 0, 0, -1]
    assert [e.ends_run for e in events] == [False, False, False, True, False, False]
    assert [e.unit for e in events] == ["m", "m", "m^2/s^2", "1", "1/s", "s"]
    assert events[0].about == "A.position.y passes -0.5 m"


def test_the_kernel_is_described():
    model = symgen.build(scene({"name": "low", "of": "A.y"}))
    block = model.description.kernel("events").blocks[0]
    assert (block.rows, block.unit, block.about) == (("low",), "m", "low: A.y passes 0")
    assert symgen.build(scene({"name": "low", "of": "A.y"})).description == model.description


def test_in_space():
    model = symgen.build(
        symgen.Scene(
            points={"O": ground(0, 0, 0), "A": at(1, 0, 0)},
            links={"OA": rod("O", "A")},
            events=[{"name": "e", "of": "A.position.z + A.y", "value": "1 m"}],
            analysis={"motion": "space"},
        )
    )
    assert gaps(model, [0, 2, 3], [0, 0, 0]) == pytest.approx([4.0])


@pytest.mark.parametrize(
    ("event", "where", "words"),
    [
        ({"of": "A.y"}, r"\[events.0\] name", "missing"),
        ({"name": "a"}, r"\[events.0\] of", "missing"),
        ({"name": "a b", "of": "A.y"}, r"\[events.0\] name", "letters, digits"),
        ({"name": "a", "of": "A.y", "when": 1}, r"\[events.0\] when", "unknown key"),
        ({"name": "a", "of": "A.y", "direction": "up"}, r"\[events.0\] direction", "'rising'.*'falling'.*'both'"),
        ({"name": "a", "of": "A.y", "ends_run": "yes"}, r"\[events.0\] ends_run", "true or false"),
        ({"name": "a", "of": "A.y", "value": "1 s"}, r"\[events.0\] value", "expected a length"),
        ({"name": "a", "of": "A.y + OA.angle"}, r"\[events.0\] of", "adds a length and"),
        ({"name": "a", "of": "A.positon.y"}, r"\[events.0\] of", "'A.position.y'"),
        ({"name": "a", "of": "A.position"}, r"\[events.0\] of", "unknown name 'A.position'"),
        ({"name": "a", "of": "B.y"}, r"\[events.0\] of", "unknown name 'B.y'"),
        ({"name": "a", "of": "OA.tension"}, r"\[events.0\] of", "positions and velocities alone"),
        ({"name": "a", "of": "2 m"}, r"\[events.0\] of", "the same at all times"),
        ({"name": "a", "of": "A.__class__.y"}, r"\[events.0\] of", "unknown name"),
        ({"name": "a", "of": "A.y.x.y"}, r"\[events.0\] of", "unknown name 'A.y.x.y'"),
        ({"name": "a", "of": "A.y", "value": "nan m"}, r"\[events.0\] value", "finite"),
    ],
)  # fmt: skip
def test_a_wrong_event_is_refused(event, where, words):
    with pytest.raises(SceneError, match=f"(?s){where}.*{words}"):
        symgen.build(scene(event))


def test_two_of_one_name():
    with pytest.raises(SceneError, match=r"\[events.1\] name: two events are called 'a'"):
        symgen.build(scene({"name": "a", "of": "A.y"}, {"name": "a", "of": "A.x"}))


def test_not_where_links_are_elastic():
    from symgen.scene.loading import read_scene

    data = read_scene("rotating_cantilever").data
    data["events"] = [{"name": "a", "of": "t", "value": "1 s"}]
    with pytest.raises(SceneError, match=r"\[events\]: .*elastic links has no events"):
        symgen.build(symgen.Scene(**data))


def test_not_for_a_loop():
    from symgen.scene.loading import read_scene

    data = read_scene("bennett").data
    data["events"] = [{"name": "a", "of": "t", "value": "1 s"}]
    with pytest.raises(SceneError, match=r"\[events\].*a scene with a loop has no events"):
        symgen.build(symgen.Scene(**data))
