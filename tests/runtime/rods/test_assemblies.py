"""Assembly modes by signs of dyads and roots of triads, against circles placed one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq
from shared.linkages import at, circles, ground, stephenson

import symgen

CRANK = 0.2 * np.array([np.cos(0.4), np.sin(0.4)])


def same_poses(found, expected):
    """Each expected pose, positions by point, is found once, and no other."""
    assert len(found) == len(expected)
    for pose in expected:
        away = [max(np.abs(s.positions[p] - x).max() for p, x in pose.items()) for s in found]
        assert min(away) < 1e-12, pose


def test_dyads_have_two_signs_each():
    """A slider-crank and a Watt linkage on one crank; the coupler A B E is rigid: its mirror image is no mode."""
    c, h, height = np.array([0.6, 0.0]), np.array([0.9, 0.5]), 0.05
    places = {"A": CRANK, "B": circles(CRANK, c, 0.5, 0.45)}
    places["E"] = circles(CRANK, places["B"], 0.35, 0.3)
    places["G"] = circles(places["E"], h, 0.5, 0.55)
    reach = np.sqrt(0.5**2 - (CRANK[1] - height) ** 2)
    places["S"] = np.array([CRANK[0] + reach, height])
    fixed = {"O": (0, 0), "C": c, "H": h, "P": (-2, height), "Q": (2, height)}
    pairs = {"crank": "OA", "rocker": "CB", "EG": "EG", "HG": "HG", "rod": "AS", "rail": "PQ"}
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={p: ground(*x) for p, x in fixed.items()} | {p: at(*x) for p, x in places.items()},
        links={name: {"points": [*ends]} for name, ends in {**pairs, "coupler": "ABE"}.items()},
        guides=[{"points": ["S"], "along": "rail"}],
        drivers=[{"link": "crank", "angle": "0.4 + w*t"}],
        analysis={"kind": "kinematics", "t_end": "1 s"},
    )
    expected = []
    for first, second, side in product((1.0, -1.0), repeat=3):
        b = circles(CRANK, c, 0.5, 0.45, first)
        g = circles(circles(CRANK, b, 0.35, 0.3), h, 0.5, 0.55, second)
        expected.append({"B": b, "G": g, "S": np.array([CRANK[0] + side * reach, height])})
    model = symgen.build(scene)
    found = model.assemblies()
    same_poses(found, expected)
    assert found.complete and found.incomplete == ""
    assert found[0].positions["G"] == pytest.approx(places["G"])  # the drawn one first
    motion = model.kinematics(0, 0.1, samples=2, of=["G"], state=found[5])
    assert motion["G.position"].values[0] == pytest.approx(found[5].positions["G"], abs=1e-14)


def on_the_curve_of_the_coupler(scene, tip):
    """Poses A, B, P of the four-bar O A B C whose point P is as far from ``tip`` as drawn, by bisection."""
    places = {name: np.array([float(x.split()[0]) for x in p["at"]]) for name, p in scene["points"].items()}

    def length(x, y):
        return float(np.hypot(*(places[x] - places[y])))

    d = places["B"] - places["A"]
    p = places["P"] - places["A"]
    along, across = np.array([d @ p, d[0] * p[1] - d[1] * p[0]]) / (d @ d)

    def pose(angle, side):
        a = places["O"] + length("O", "A") * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        b = circles(a, np.broadcast_to(places["C"], a.shape), length("A", "B"), length("C", "B"), side)
        ab = b - a
        left = np.stack([-ab[..., 1], ab[..., 0]], axis=-1)
        return {"A": a, "B": b, "P": a + along * ab + across * left}

    def gap(angle, side):
        return np.hypot(*(pose(angle, side)["P"] - tip).T) - length("P", "E")

    angles, found = np.linspace(0.0, 2 * np.pi, 20001), []
    for side in (1.0, -1.0):
        with np.errstate(invalid="ignore"):
            values = gap(angles, side)
        for i in np.flatnonzero(values[:-1] * values[1:] < 0):
            found.append(pose(brentq(gap, angles[i], angles[i + 1], args=(side,), xtol=1e-15), side))
    return found


def test_a_stephenson_linkage_has_the_roots_of_its_sextic():
    scene = stephenson(kind="kinematics")
    tip = np.array([0.9, 0.3]) + np.hypot(0.03, 0.03) * np.array([np.cos(2.0), np.sin(2.0)])
    expected = on_the_curve_of_the_coupler(scene.model_dump(), tip)
    assert len(expected) == 6
    found = symgen.build(scene).assemblies(at=2.0)
    same_poses(found, expected)
    assert found.complete


def test_a_search_is_told_with_its_reason():
    """Three parallel links of one length: one constraint is redundant."""
    fixed = {"O": (0.0, 0.0), "C": (0.6, 0.0), "F": (0.3, 0.1)}
    moving = {p: np.add(x, CRANK) for p, x in zip("ABE", fixed.values(), strict=True)}
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points={p: ground(*x) for p, x in fixed.items()} | {p: at(*x) for p, x in moving.items()},
        links={
            "crank": {"points": ["O", "A"]},
            "rocker": {"points": ["C", "B"]},
            "third": {"points": ["F", "E"]},
        }
        | {"coupler": {"points": ["A", "B", "E"]}},
        drivers=[{"link": "crank", "angle": "0.4 + w*t"}],
        analysis={"kind": "kinematics", "t_end": "1 s"},
    )
    found = symgen.build(scene).assemblies()
    assert not found.complete and found.incomplete.startswith("constraints are redundant: searched")
