"""What the studies of a scene ask for: combinations, units, and every fault named with its place."""

from __future__ import annotations

import pytest

import symgen
from symgen.errors import SceneError
from symgen.scene.loading import read_scene
from symgen.study.plan import plans

INCH = 0.0254


def scene(*studies, **changes):
    """Return the shipped slider-crank with these studies instead of its own."""
    data = {**read_scene("slider_crank").data, "studies": list(studies), **changes}
    return symgen.Scene(**data).called("crank", "crank.toml")


def test_every_combination_in_the_order_written():
    study = {
        "name": "both",
        "vary": {"S1": ["9 in", "0 in"], "a4": ["1 ft", 0]},
        "set": {"rpm": "60 rpm"},
        "plots": ["S4", "theta2", "S4"],
    }
    (plan,) = plans(scene(study))
    found = [[(s.parameter, s.text, s.value) for s in case] for case in plan.cases]
    assert [[text for _, text, _ in case] for case in found] == [
        ["9 in", "1 ft"],
        ["9 in", "0"],
        ["0 in", "1 ft"],
        ["0 in", "0"],
    ]
    assert [value for _, _, value in found[0]] == pytest.approx([9 * INCH, 12 * INCH], rel=1e-15)
    assert plan.about == "both" and plan.plots == ("S4", "theta2") and plan.changes == {"rpm": "60 rpm"}


def test_values_may_be_expressions_over_parameters():
    (plan,) = plans(scene({"name": "part", "vary": {"a4": ["a1/2"]}, "plots": ["S4"]}))
    assert plan.cases[0][0].value == pytest.approx(6 * INCH, rel=1e-15)


def test_without_anything_that_varies_there_is_one_case():
    (plan,) = plans(scene({"name": "plain", "plots": ["S4"]}))
    assert plan.cases == ((),)


def test_a_limit_is_given_in_the_unit_it_is_written_in():
    limits = [
        {"parameter": "S1", "start": 0, "stop": "2 ft"},
        {"parameter": "a4", "start": "1 in", "stop": "a1"},
        {"parameter": "ratio", "start": 0, "stop": 3},
        {"parameter": "rpm", "start": "1 rpm", "stop": "2*pi*rpm"},
    ]
    (plan,) = plans(scene({"name": "far", "limits": limits}))
    assert [s.unit for s in plan.searches] == ["ft", "in", "1", "rpm"]
    assert plan.searches[0].stop == pytest.approx(24 * INCH) and plan.searches[0].in_unit(
        24 * INCH
    ) == pytest.approx(2)


@pytest.mark.parametrize(
    "study, where, words",
    [
        ({"name": "x"}, "[studies[0]] plots", "expected plots to draw, or limits"),
        ({"name": "x", "vary": {"a5": ["1 in"]}}, "vary", "'a5' is not there"),
        ({"name": "x", "vary": {"a1": ["1 in"]}}, "vary", "'a1' is not tunable"),
        ({"name": "x", "vary": {"a4": ["1 in", "1 lbf"]}}, "a4[1]", "expected a length"),
        ({"name": "x", "vary": {"a4": []}}, "a4", "expected at least 1"),
        ({"name": "x", "varies": {}}, "varies", "unknown key 'varies'"),
        ({"name": "no name"}, "name", "expected a name of letters"),
        (
            {"name": "x", "limits": [{"parameter": "S1", "start": "1 in", "stop": "1 in"}]},
            "stop",
            "another value than that of start",
        ),
        (
            {"name": "x", "limits": [{"parameter": "S1", "start": "1 in", "stop": "1 s"}]},
            "stop",
            "expected a length",
        ),
        (
            {
                "name": "x",
                "vary": {"S1": ["1 in"]},
                "limits": [{"parameter": "S1", "start": 0, "stop": "1 in"}],
            },
            "parameter",
            "'S1' varies in this study",
        ),
    ],
)
def test_faults(study, where, words):
    with pytest.raises(SceneError) as caught:
        plans(scene({"plots": ["S4"], **study} if "x" not in study.values() or len(study) > 1 else study))
    text = str(caught.value)
    assert words in text and where.rpartition("] ")[2] in text, text


def test_nearest_names_are_told():
    with pytest.raises(SceneError, match="Did you mean 'a4'"):
        plans(scene({"name": "x", "vary": {"A4": ["1 in"]}, "plots": ["S4"]}))
    with pytest.raises(SceneError, match="Did you mean 'limits'"):
        scene({"name": "x", "limit": []})


def test_two_studies_of_one_name():
    one = {"name": "x", "plots": ["S4"]}
    with pytest.raises(
        SceneError, match=r"crank.toml: \[studies\.1\] name: there are two studies called 'x'"
    ):
        plans(scene(one, one))


def test_a_scene_without_studies():
    with pytest.raises(SceneError, match="there are no studies in this scene"):
        plans(scene())


def test_studies_go_with_scenes_of_points_and_links_in_the_schema_only():
    data = {**read_scene("four_bar").data, "studies": [{"name": "x", "plots": ["energy"]}]}
    assert symgen.Scene(**data).studies[0].name == "x"
