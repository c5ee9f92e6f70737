"""Shipped loops close near their first guess and have the data of their sources."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from shared.golden import reference
from shared.inches import INCH
from shared.shipped import LOOPS

from symgen.scene.loading import SceneText, check_scene, override, read_scene
from symgen.scene.loop.loop import ENTRIES
from symgen.scene.resolve import resolve


def matrix(entries):
    """The 4x4 matrix of a row, by elementary ones."""
    theta, slide, eta, alpha, a = entries

    def turn(i, j, angle):
        found = np.eye(4)
        found[[i, j], [i, j]] = math.cos(angle)
        found[i, j], found[j, i] = -math.sin(angle), math.sin(angle)
        return found

    def move(i, way):
        found = np.eye(4)
        found[i, 3] = way
        return found

    return turn(0, 1, theta) @ move(2, slide) @ turn(2, 0, eta) @ turn(1, 2, alpha) @ move(0, a)


class Closure:
    """A loop of a scene in plain numbers: how far it is from closed, and the nearest closed pose."""

    def __init__(self, loop):
        self.loop = loop
        symbols = [v.quantity.symbol for v in loop.variables]
        self.entries = sp.lambdify(
            [symbols], [[getattr(row, key).subs(loop.defaults) for key in ENTRIES] for row in loop.rows]
        )
        self.free = [i for i, v in enumerate(loop.variables) if v.role == "dependent"]

    def defect(self, q):
        found = np.linalg.multi_dot([matrix(row) for row in self.entries(q)]) - np.eye(4)
        found[:3, 3] /= self.loop.size
        return found[:3].ravel()

    def jacobian(self, q):
        steps = 1e-6 * np.eye(len(q))[self.free]
        return np.array([(self.defect(q + s) - self.defect(q - s)) / 2e-6 for s in steps]).T

    def closed(self, **given):
        """Newton's method from the scene's first guess; inputs are zero unless given."""
        q = np.array([given.get(v.name, self.loop.number(v.start)) for v in self.loop.variables])
        for _ in range(30):
            q[self.free] -= np.linalg.lstsq(self.jacobian(q), self.defect(q), rcond=1e-7)[0]
        return dict(zip([v.name for v in self.loop.variables], q, strict=True)), self.defect(q)


@pytest.mark.parametrize("name", LOOPS)
def test_shipped_loops_close_near_their_first_guess(name):
    """And what is said to follow from closure does: the rank is the number of dependent variables."""
    loop = resolve(check_scene(read_scene(name)))
    at = {v.name: loop.number(v.motion) for v in loop.having("input")}
    if loop.span:
        at[loop.having("input")[0].name] = loop.number(loop.span[0])
    closure = Closure(loop)
    q, defect = closure.closed(**at)
    assert np.abs(defect).max() < 1e-14
    for v in loop.having("dependent"):
        assert abs(q[v.name] - loop.number(v.start)) < (0.7 if v.quantity.unit == "rad" else 0.3 * loop.size)
    steep = np.linalg.svd(closure.jacobian(np.array(list(q.values()))), compute_uv=False)
    assert steep.min() > 1e-3
    assert all(loop.body(i) for i in range(len(loop.rows) - 1))


def test_rccc_is_where_it_is_quoted():
    q, _ = Closure(resolve(check_scene(read_scene("rccc")))).closed(theta1=math.radians(5))
    assert [math.degrees(q[f"theta{i}"]) for i in (2, 3, 4)] == pytest.approx(
        [145.220527, 45.784197, 141.550748], abs=1e-6
    )
    assert [100 * q[f"S{i}"] for i in (2, 3, 4)] == pytest.approx([-0.441324, -2.680383, -0.282099], abs=1e-6)


def test_slider_crank_has_the_data_of_the_reference():
    golden = reference("dual_slider_crank")
    text = read_scene("slider_crank")
    loop = resolve(check_scene(text))
    pound = loop.units["force"][1] / loop.units["length"][1]
    for body, name in zip(loop.bodies, ("m1", "m2", "m3"), strict=True):
        assert loop.number(body.mass) / pound == pytest.approx(golden["parameters"][name], rel=1e-12)
    assert loop.number(loop.variables[0].motion.diff(sp.Symbol("t", real=True))) == pytest.approx(
        golden["parameters"]["theta1_dot"], rel=1e-15
    )
    for scene in golden["scenes"]:
        values = {
            "a4": f"{scene['a4']!r} in", "alpha4": f"{scene['alpha4_deg']!r} deg",
            "S1": f"{scene['S1_or_amplitude']!r} in", "ratio": repr(scene["alpha"]),
        }  # fmt: skip
        loop = resolve(check_scene(override(text, values)))
        closure = Closure(loop)
        for position in scene["positions"][:1]:
            theta1 = math.radians(position["theta1_deg"])
            q, _ = closure.closed(theta1=theta1, s1=loop.number(loop.variables[1].motion))
            assert q["S4"] / INCH == pytest.approx(position["kin"]["S4"]["pos"], rel=1e-10)
            assert q["theta2"] == pytest.approx(position["kin"]["th2"]["pos"], rel=1e-10)


@pytest.mark.parametrize(
    "ratio, angle, share", [("0", 1.1, 1.0), ("2", 0.3, math.sin(0.6)), ("-0.5", 1.0, -math.sin(0.5))]
)
def test_the_offset_of_the_slider_crank_stands_or_swings(ratio, angle, share):
    loop = resolve(check_scene(override(read_scene("slider_crank"), {"S1": "9 in", "ratio": ratio})))
    theta1, s1 = (v.motion for v in loop.having("input"))
    time = angle / loop.number(theta1.diff(sp.Symbol("t", real=True)))
    found = s1.subs(loop.defaults).subs(sp.Symbol("t", real=True), time)
    assert float(found) / INCH == pytest.approx(9 * share, rel=1e-14)


def test_bennett_and_bricard_and_cardan_fold_their_right_angles():
    for name, angles in (
        ("bricard", {sp.pi / 2, -sp.pi / 2}),
        ("cardan", {sp.pi / 2, sp.Symbol("beta", real=True)}),
    ):
        assert {row.alpha for row in resolve(check_scene(read_scene(name))).rows} == angles


def test_a_universal_joint_is_two_hinges_at_right_angles():
    """The cross of the Cardan joint left out: its two hinges are one Hooke joint."""
    hinges = resolve(check_scene(read_scene("cardan")))
    rows = [
        {"joint": "R", "link": "input", "theta": "theta1", "alpha": "90 deg"},
        {"joint": "U", "link": "output", "theta": "?", "eta": "?", "alpha": "180 deg"},
        {"joint": "R", "link": "ground", "theta": "?", "alpha": "30 deg"},
    ]
    start = {"theta2": "90 deg", "eta2": "-60 deg", "theta3": "90 deg"}
    tables = {
        "symgen": 1,
        "parameters": {"w": "1 rad/s"},
        "loop": {"inputs": {"theta1": "w*t"}, "rows": rows, "start": start},
    }
    cross, defect = Closure(resolve(check_scene(SceneText("x", "x.toml", tables)))).closed(theta1=0.7)
    same, _ = Closure(hinges).closed(theta1=0.7)
    assert np.abs(defect).max() < 1e-14
    assert [cross["theta2"], -cross["eta2"], cross["theta3"]] == pytest.approx(
        [same["theta2"], same["theta3"], same["theta4"]], abs=1e-13
    )
    assert math.tan(0.7) * math.tan(cross["theta3"]) == pytest.approx(math.cos(math.pi / 6), rel=1e-12)
