"""The moving frame of an elastic link and the weights of its constants, against calculus done by mpmath."""

from __future__ import annotations

import re
from pathlib import Path

import mpmath
import pytest
import sympy as sp

import symgen
from symgen.mechanics.elastic import hamilton
from symgen.mechanics.elastic.moving_frame import moving_frame
from symgen.mechanics.elastic.turning_axes import COSINE, SINE
from symgen.mechanics.elastic.weights import rates_of_turn, turning_ends, weights
from symgen.models.elastic import links
from symgen.runtime.beams import frames
from symgen.symbolic.names import Names

CORE = Path(symgen.__file__).parent / "runtime" / "core"


def enumerated(first: str) -> tuple[str, ...]:
    """The names of a C enumeration by its first one, but for its last, which counts them."""
    text = (CORE / "rigid_motion.h").read_text()
    inside = re.search(rf"enum {{\s*({first}[^}}]*)}}", text)[1]
    return tuple(name.strip().lower() for name in inside.split(","))[:-1]


def test_columns_are_the_same_in_the_model_in_c_and_in_numpy():
    assert links.MOTION == frames.MOTION == enumerated("COSINE")
    assert links.APPLIED == frames.APPLIED == enumerated("LOAD_FORCE_X")


def test_columns_of_the_elastic_motion_itself_come_first():
    """A quasi-static motion is without them."""
    inertial = {w.name for w in (*weights(), *turning_ends()) if w.inertial and w.value != 1}
    assert set(links.MOTION[2 : 2 + len(inertial)]) == inertial


def test_what_stands_with_no_weight_is_left_as_it_is():
    assert {w.name for w in weights() if w.value == 1} == {"mass", "stiffness"}


def test_weights_of_a_force_along_a_link():
    """It works by its components on the displacements; its pull on what lies behind it lowers the axial force."""
    found = {w.name: w.value for w in weights() if w.applied}
    x, y = hamilton.PX.symbol, hamilton.PY.symbol
    assert found == {"load_force_x": x, "load_force_y": y, "stiffness_geometric_force": -x}


def test_moving_frame_of_a_vector_that_turns_and_stretches():
    def vector(t):
        return mpmath.matrix([(2 + mpmath.sin(3 * t)) * f(1 + t**2 - t) for f in (mpmath.cos, mpmath.sin)])

    def angle(t):
        return mpmath.atan2(vector(t)[1], vector(t)[0])

    at = mpmath.mpf("0.3")
    with mpmath.workdps(30):
        along = tuple(
            tuple(sp.Float(str(mpmath.diff(lambda t, i=i: vector(t)[i], at, n)), 30) for i in range(2))
            for n in range(3)
        )
        names = Names()
        found = moving_frame(
            names, "link", along, (sp.Integer(2), sp.Integer(-1)), (sp.Integer(3), sp.Integer(4))
        )
        c, s = mpmath.cos(angle(at)), mpmath.sin(angle(at))
        expected = {
            COSINE: c,
            SINE: s,
            hamilton.OMEGA: mpmath.diff(angle, at),
            hamilton.OMEGA_RATE: mpmath.diff(angle, at, 2),
            hamilton.AX: 2 * c - s,
            hamilton.AY: -c - 2 * s,
            hamilton.N0: -(3 * c + 4 * s),
        }
    known = {}
    for d in names.definitions:
        known[d.quantity.symbol] = d.expression.xreplace(known)
    for quantity, value in expected.items():
        assert float(found[quantity.symbol].xreplace(known)) == pytest.approx(float(value), rel=1e-12)


def test_rates_of_the_turn_from_fixed_axes():
    """T^T = [[c, s], [-s, c]] along theta(t), differentiated numerically."""

    def theta(t):
        return t**3 - 2 * t

    def turn(t):
        c, s = mpmath.cos(theta(t)), mpmath.sin(theta(t))
        return mpmath.matrix([[c, s], [-s, c]])

    at = mpmath.mpf("0.7")
    first, (ends, quarter) = rates_of_turn()
    rates = {
        hamilton.OMEGA.symbol: mpmath.diff(theta, at),
        hamilton.OMEGA_RATE.symbol: mpmath.diff(theta, at, 2),
    }
    a, b, c = (float(e.subs(rates)) for e in (first, ends, quarter))
    back = mpmath.matrix([[0, 1], [-1, 0]])
    for n, expected in ((1, a * back), (2, b * mpmath.eye(2) + c * back)):
        for i in range(2):
            for j in range(2):
                found = mpmath.diff(lambda t, i=i, j=j: turn(t)[i, j], at, n)
                assert float(found) == pytest.approx(float((expected * turn(at))[i, j]), rel=1e-8, abs=1e-8)


def test_axial_force_by_the_balance_of_a_uniform_link_under_a_uniform_force():
    """A link that turns about its first point, accelerates along itself, and is pushed along by p per length."""
    derived = next(step for step in hamilton.derive().steps if step.name == "axial_force").expressions[0]
    x, mu, w, a, n0, p = sp.symbols("x mu w a n0 p", positive=True)
    values = {
        hamilton.N0: n0, hamilton.AX: a, hamilton.OMEGA: w, hamilton.PX: p,
        hamilton.MASS_BEFORE: mu * x, hamilton.MOMENT_BEFORE: mu * x**2 / 2, hamilton.PROFILE_BEFORE: x,
    }  # fmt: skip
    found = derived.xreplace({q.symbol: e for q, e in values.items()})
    assert sp.expand(sp.diff(found, x) - (mu * (a - w**2 * x) - p)) == 0
    assert found.subs(x, 0) == n0
