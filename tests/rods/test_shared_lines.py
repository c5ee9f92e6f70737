"""Forces along the line between two points that a body in space has in common with a rod, another body or the ground."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shared.in_numpy import build

import symgen

AT = {"A": (0, 0, 0), "B": (1, 0.1, 0.2), "C": (0.6, 0.9, -0.1), "D": (0.3, 0.4, 0.8), "F": (2, 0.3, 0.4)}
CENTRE, MASS, G = (0.4, 0.3, 0.2), 2.0, np.array([1.0, 2.0, -9.81])
INERTIA = np.array([[0.1, 0.01, -0.02], [0.01, 0.12, 0.015], [-0.02, 0.015, 0.15]])


def texts(values, unit):
    return [f"{float(x)!r} {unit}" for x in values]


def moments(turn):
    full = turn @ INERTIA @ turn.T
    return texts([*np.diag(full), full[0, 1], full[0, 2], full[1, 2]], "kg*m^2")


def scene(turn, points, shared, kinds="r", reverse=False):
    """A body on the ground at A, with rods ("r") and other bodies ("b") on some of its points, and an arm."""
    body = {"mass": f"{MASS} kg", "centre": texts(turn @ CENTRE, "m"), "inertia": moments(turn)}
    others = {}
    for i, kind in enumerate(kinds):
        others[f"other{i}"] = {"points": list(shared), "mass": f"{0.5 + i} kg"}
        if kind == "b":
            centre = turn @ (0.6 * np.array(AT[shared[0]]) + 0.4 * np.array(AT[shared[1]]) + 0.1 * (i + 1))
            others[f"other{i}"] |= {"centre": texts(centre, "m"), "inertia": moments(turn)}
    links = others | {
        "body": {"points": list(points), **body},
        "arm": {"points": [shared[1], "F"], "mass": "0.3 kg"},
    }
    outputs = [f"{name}.{p}.force" for name, link in links.items() if name != "arm" for p in link["points"]]
    outputs += [f"{p}.acceleration" for p in points]
    outputs += ["other0.tension"] if kinds == "r" else []
    names = [*points, "F"]
    if reverse:
        names, links = names[::-1], dict(reversed(links.items()))
        for link in links.values():
            link["points"].reverse()
    return symgen.Scene(
        points={p: {"at": texts(turn @ AT[p], "m"), "ground": p == "A"} for p in names},
        links=links,
        gravity={"acceleration": texts(turn @ G, "m/s^2")},
        start={"rates": {"body": texts(turn @ [1.0, 2.0, -1.0], "rad/s")}},
        analysis={"outputs": [*outputs, "A.reaction"]},
    )


def outputs(turn, *of, **options):
    """The outputs at the start, with vectors turned back."""
    run = build(scene(turn, *of, **options)).simulate(1e-3, step=1e-3, samples=2)
    values = {str(name): run[name].values[0] for name in run.dataset.data_vars}
    return {k: v @ turn if np.ndim(v) else v for k, v in values.items()}


CASES = [
    ("ABC", "BC", "r"),
    ("ABCD", "CD", "r"),
    ("ABC", "AB", "b"),
    ("ABCD", "BC", "b"),
    ("ABCD", "BC", "bb"),
    ("ABCD", "BC", "rb"),
    ("ABCD", "BCD", "b"),
]


@pytest.mark.parametrize("case", CASES)
def test_forces_along_shared_lines_do_not_depend_on_axes_and_order(case):
    drawn = outputs(np.eye(3), *case)
    size = max(np.max(np.abs(v)) for k, v in drawn.items() if "acceleration" not in k)
    others = [
        outputs(Rotation.random(random_state=0).as_matrix(), *case),
        outputs(np.eye(3), *case, reverse=True),
    ]
    for other in others:
        for name, value in drawn.items():
            np.testing.assert_allclose(other[name], value, atol=1e-10 * size, err_msg=name)


@pytest.mark.parametrize(("points", "shared", "kinds"), CASES)
def test_forces_along_shared_lines_are_of_least_norm(points, shared, kinds):
    """No stress between two links reduces the sum of squares; the rest satisfies Newton's and Euler's equations."""
    of = outputs(np.eye(3), points, shared, kinds)
    links = ["body", *(f"other{i}" for i in range(len(kinds)))]
    for first, second in combinations(shared, 2):
        along = np.array(AT[second]) - AT[first]
        uneven = [(of[f"{k}.{second}.force"] - of[f"{k}.{first}.force"]) @ along for k in links]
        np.testing.assert_allclose(uneven, uneven[0], atol=1e-9)
    if "A" not in shared:  # the ground is no link
        total = sum(of[f"body.{p}.force"] for p in points)
        arms = np.array([np.array(AT[p]) - AT["A"] for p in points[1:4]])
        # accelerations are a0 + B r, with B of three edges from the ground point, which is at rest
        edges = np.array([of[f"{p}.acceleration"] for p in points[1:4]])
        slope = np.linalg.lstsq(arms, edges, rcond=None)[0].T
        if len(points) == 4:
            np.testing.assert_allclose(total, MASS * (slope @ CENTRE - G), atol=1e-10)
        if kinds == "r":
            middle = 0.25 * sum(of[f"{p}.acceleration"] for p in shared)
            ends = [of[f"other0.{p}.force"] for p in shared]
            np.testing.assert_allclose(sum(ends), middle - 0.5 * G, atol=1e-10)


def test_the_tension_of_a_rod_on_a_body_does_not_depend_on_the_points_of_the_body():
    few, many = (outputs(np.eye(3), points, "BC") for points in ("ABC", "ABCD"))
    assert few["other0.tension"] == pytest.approx(many["other0.tension"], rel=1e-10)
    np.testing.assert_allclose(few["other0.B.force"], many["other0.B.force"], atol=1e-10)
