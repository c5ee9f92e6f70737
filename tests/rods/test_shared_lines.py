"""Forces along the line between two points that a body in space has in common with a rod, another body or the ground."""

from __future__ import annotations

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


def scene(turn, points, shared, with_body=False):
    """A body on the ground at A, with a rod, or another body, on two of its points, and an arm."""
    body = {"mass": f"{MASS} kg", "centre": texts(turn @ CENTRE, "m"), "inertia": moments(turn)}
    other = {"points": list(shared), "mass": "0.5 kg"}
    if with_body:
        centre = turn @ (0.6 * np.array(AT[shared[0]]) + 0.4 * np.array(AT[shared[1]]) + 0.1)
        other |= {"centre": texts(centre, "m"), "inertia": moments(turn)}
    names = [*points, "F"]
    return symgen.Scene(
        points={p: {"at": texts(turn @ AT[p], "m"), "ground": p == "A"} for p in names},
        links={
            "other": other,
            "body": {"points": list(points), **body},
            "arm": {"points": [shared[1], "F"], "mass": "0.3 kg"},
        },
        gravity={"acceleration": texts(turn @ G, "m/s^2")},
        start={"rates": {"body": texts(turn @ [1.0, 2.0, -1.0], "rad/s")}},
        analysis={
            "outputs": [
                *(f"{link}.{p}.force" for link, at in (("body", points), ("other", shared)) for p in at),
                *(f"{p}.acceleration" for p in points),
                *([] if with_body else ["other.tension"]),
                "A.reaction",
            ]
        },
    )


def outputs(turn, *of):
    """The outputs at the start, with vectors turned back."""
    run = build(scene(turn, *of)).simulate(1e-3, step=1e-3, samples=2)
    values = {str(name): run[name].values[0] for name in run.dataset.data_vars}
    return {k: v @ turn if np.ndim(v) else v for k, v in values.items()}


CASES = [
    ("ABC", "BC", False),
    ("ABC", "AB", False),
    ("ABCD", "CD", False),
    ("ABC", "AB", True),
    ("ABCD", "BC", True),
]


@pytest.mark.parametrize(("points", "shared", "with_body"), CASES)
def test_forces_along_shared_lines_do_not_depend_on_the_axes(points, shared, with_body):
    drawn = outputs(np.eye(3), points, shared, with_body)
    size = max(np.max(np.abs(v)) for k, v in drawn.items() if "acceleration" not in k)
    for seed in range(2):
        turned = outputs(Rotation.random(random_state=seed).as_matrix(), points, shared, with_body)
        for name, value in drawn.items():
            np.testing.assert_allclose(turned[name], value, atol=1e-10 * size, err_msg=name)


@pytest.mark.parametrize(("points", "shared", "with_body"), CASES)
def test_bodies_have_equal_parts_along_shared_lines(points, shared, with_body):
    """And the rest satisfies Newton's and Euler's equations; the tension of a rod is what is left on it."""
    of = outputs(np.eye(3), points, shared, with_body)
    force = {p: of[f"body.{p}.force"] for p in points}
    first, second = (np.array(AT[p]) for p in shared)
    along = (second - first) / np.linalg.norm(second - first)
    assert (force[shared[0]] - force[shared[1]]) @ along == pytest.approx(0, abs=1e-10)
    arms = np.array([np.array(AT[p]) - AT["A"] for p in points[1:4]])
    # accelerations are a0 + B r, with B of three edges from the ground point, which is at rest
    slope = np.linalg.lstsq(arms, np.array([of[f"{p}.acceleration"] for p in points[1:4]]), rcond=None)[0].T
    if len(points) == 4:
        np.testing.assert_allclose(sum(force.values()), MASS * (slope @ CENTRE - G), atol=1e-10)
    if not with_body:
        middle = 0.25 * (of[f"{shared[0]}.acceleration"] + of[f"{shared[1]}.acceleration"])
        ends = [of[f"other.{p}.force"] for p in shared]
        np.testing.assert_allclose(sum(ends), middle - 0.5 * G, atol=1e-10)


def test_the_tension_of_a_rod_on_a_body_does_not_depend_on_the_points_of_the_body():
    few, many = (outputs(np.eye(3), points, "BC", False) for points in ("ABC", "ABCD"))
    assert few["other.tension"] == pytest.approx(many["other.tension"], rel=1e-10)
    np.testing.assert_allclose(few["other.B.force"], many["other.B.force"], atol=1e-10)
