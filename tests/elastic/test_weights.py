"""The moving frame of an elastic link and the weights of its constants, against calculus done by mpmath."""

from __future__ import annotations

from dataclasses import fields

import mpmath
import pytest
import sympy as sp

from symgen.mechanics.elastic import hamilton
from symgen.mechanics.elastic.moving_frame import moving_frame
from symgen.mechanics.elastic.places import RIGID_FORCE, SHAPES, at_a_place, second_order
from symgen.mechanics.elastic.shaft import rigid_crank, shaft
from symgen.mechanics.elastic.turning_axes import COSINE, SINE
from symgen.mechanics.elastic.weights import rates_of_turn, turning_ends, weights
from symgen.models.elastic import columns, links
from symgen.runtime import _beams
from symgen.runtime.beams import elements, frames
from symgen.runtime.beams.data import Piece
from symgen.symbolic.names import Names


def test_columns_are_those_of_the_compiled_core():
    """The core is compiled with the header that ``symgen generate`` wrote."""
    for name in ("MOTION", "APPLIED", "BLOCKS", "MATRICES", "VECTORS", "SPREAD"):
        assert columns.COLUMNS[name][2] == getattr(_beams, name)
    assert {f.name for f in fields(frames.Frames)} == set(links.MOTION)
    assert {f.name for f in fields(Piece)} == {"at", *_beams.MATRICES, *_beams.VECTORS, *_beams.SPREAD}
    assert tuple(SHAPES) == elements.SHAPES
    assert tuple(at_a_place()) == elements.AT_A_PLACE


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
    follower = {"stiffness_follower_x": -x, "stiffness_follower_y": y}
    assert found == {"load_force_x": x, "load_force_y": y, "stiffness_geometric_force": -x} | follower


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


def test_a_point_of_a_link_has_the_acceleration_of_a_particle_in_turning_axes():
    """z = z0 + (x + s) exp(i theta), differentiated as complex numbers; s = u + i w."""
    x, omega, rate, ax, ay = 0.7, 1.3, -2.1, 0.4, 5.0
    s, v, a = 0.01 - 0.02j, 0.3 + 0.5j, -1.1 + 0.9j
    expected = complex(ax, ay) + a + 2j * omega * v + (1j * rate - omega**2) * (x + s)
    motion = {hamilton.OMEGA: omega, hamilton.OMEGA_RATE: rate, hamilton.AX: ax, hamilton.AY: ay}
    values = {q.symbol: value for q, value in motion.items()}
    terms = {name: term.xreplace({hamilton.X.symbol: x}) for name, term in at_a_place().items()}
    # What stands with displacements and omega^2 has the matrix of the mass.
    terms["centrifugal"] = terms["mass"]
    own = {"mass": a, "damping": v, "stiffness": s}
    found = sp.zeros(6, 1)
    for w in weights():
        if w.constant in terms and "geometric" not in w.constant and not w.applied:
            moved = own.get(w.into)
            column = terms[w.constant]
            if moved is not None:
                column = column * sp.Matrix([moved.real, moved.imag, 0, 0, 0, 0])
            found += (-1 if moved is None else 1) * w.value.xreplace(values) * column
    assert complex(found[0], found[1]) == pytest.approx(expected, rel=1e-12)
    assert list(found[2:]) == [0] * 4


def test_a_force_at_a_point_works_on_its_displacements_and_stiffens_its_slope():
    found = at_a_place()
    assert list(found["force_x"]) == [1, 0, 0, 0, 0, 0]
    assert list(found["force_y"]) == [0, 1, 0, 0, 0, 0]
    assert found["geometric0"] == sp.diag(0, 0, 1, 0, 0, 0)


def test_forces_of_second_order_by_the_energy_of_a_stretched_link():
    """Curvature by the size of the displacements of their virtual work, the axial force added to linear theory."""
    stiffness, strain, slope, force = (mpmath.mpf(x) for x in ("3e4", "2e-3", "0.07", "11"))
    virtual = mpmath.mpf("0.3"), mpmath.mpf("-0.8")

    def work(size):
        def energy(step):
            e, w = size * strain + step * virtual[0], size * slope + step * virtual[1]
            return stiffness / 2 * (e + w**2 / 2) ** 2

        return mpmath.diff(energy, 0)

    with mpmath.workdps(30):
        expected = mpmath.diff(work, 0, 2) / 2 - force * slope * virtual[1]
    names = {hamilton.AXIAL: stiffness, hamilton.FIELDS["u_x"]: strain, hamilton.FIELDS["w_x"]: slope}
    values = {q.symbol: sp.Float(str(v), 25) for q, v in (names | {RIGID_FORCE: force}).items()}
    found = dict(zip(SHAPES, second_order().xreplace(values), strict=True))
    done = found.pop("axial_strain") * 0.3 + found.pop("slope") * -0.8
    assert float(done) == pytest.approx(float(expected), rel=1e-12)
    assert set(found.values()) == {0}


def test_shaft_by_the_rest_of_its_equation():
    """I (theta'' + phi'') - T(theta + phi, theta' + phi'), and what is left of it by small phi."""
    inertia, theta, omega, alpha = 0.3, 0.8, 4.0, -1.5
    angle, rate = sp.symbols("angle rate", real=True)
    torque = 5 * sp.cos(angle) - sp.Rational(1, 5) * rate**2
    at = {angle: theta, rate: omega, hamilton.OMEGA.symbol: omega, hamilton.OMEGA_RATE.symbol: alpha}
    found = [float(e.xreplace(at)) for e in shaft(sp.Float(inertia), torque, angle, rate)]

    def left(phi, rate_of, second):
        driven = 5 * mpmath.cos(theta + phi) - mpmath.mpf("0.2") * (omega + rate_of) ** 2
        return inertia * (alpha + second) - driven

    by = [mpmath.diff(left, (0, 0, 0), order) for order in ((0, 0, 1), (0, 1, 0), (1, 0, 0))]
    assert found == pytest.approx([*map(float, by), -float(left(0, 0, 0))], rel=1e-9)


def test_rigid_crank_by_its_direction():
    x, y = 0.3, -0.4
    rotation, arm = rigid_crank((sp.Float(x), sp.Float(y)))
    slopes = [mpmath.diff(lambda a, b: mpmath.atan2(b, a), (x, y), n) for n in ((1, 0), (0, 1))]
    turned = [mpmath.diff(lambda t, f=f: f(t) / 2, mpmath.atan2(y, x)) for f in (mpmath.cos, mpmath.sin)]
    assert [float(e) for e in rotation] == pytest.approx([float(e) for e in slopes], rel=1e-9)
    assert [float(e) for e in arm] == pytest.approx([float(e) for e in turned], rel=1e-9)
