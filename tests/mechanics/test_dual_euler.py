"""Dual-Euler: binor, momentum and inertia wrench of a body in any motion, against rates taken by difference."""

from __future__ import annotations

import mpmath as mp
import pytest
import sympy as sp

from symgen.mechanics.loop.dual_euler import BodyMotion, Inertia
from symgen.symbolic.dual import DualVector
from symgen.symbolic.names import Names

DIGITS = 40
MASS, CENTRE = sp.Rational(7, 3), (sp.Rational(1, 5), sp.Rational(-2, 7), sp.Rational(1, 3))
INERTIA = sp.ImmutableMatrix(
    [[3, -1, sp.Rational(1, 2)], [-1, 4, sp.Rational(1, 3)], [sp.Rational(1, 2), sp.Rational(1, 3), 5]]
)


def numbers(names, matrix, values=None):
    known = dict(values or {})
    for definition in names.definitions:
        known[definition.quantity.symbol] = definition.expression.xreplace(known)
    return mp.matrix([mp.mpf(str(x.evalf(DIGITS))) for x in sp.Matrix(matrix).xreplace(known)])


def skew(a):
    return mp.matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def vee(m):
    return mp.matrix([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2


def pose(t):
    """Some motion of a frame: turn and origin."""

    def about(i, x):
        m = mp.eye(3)
        j, k = (i + 1) % 3, (i + 2) % 3
        m[j, j] = m[k, k] = mp.cos(x)
        m[k, j], m[j, k] = mp.sin(x), -mp.sin(x)
        return m

    turned = about(2, t + t**2 / 3) * about(1, mp.sin(2 * t)) * about(0, mp.mpf(1) / 3 - t)
    return turned, mp.matrix([mp.cos(t), t**3 - t, mp.exp(-t)])


def differentiated(function, t, order=1):
    size = function(t)
    return mp.matrix(
        [
            [
                mp.diff(lambda x, i=i, j=j: function(x)[i, j], t, order, h=mp.mpf(10) ** -10)
                for j in range(size.cols)
            ]
            for i in range(size.rows)
        ]
    )


def velocity(t):
    """(w; v) of the frame, by its own components."""
    turned, _ = pose(t)
    w = vee(turned.T * differentiated(lambda x: pose(x)[0], t))
    v = turned.T * differentiated(lambda x: pose(x)[1], t)
    return mp.matrix([*w, *v])


def dual(column):
    exact = [sp.Float(str(x), DIGITS) for x in column]
    return DualVector(tuple(exact[:3]), tuple(exact[3:]))


@pytest.mark.parametrize("t", ["0.3", "-0.9"])
def test_wrench_is_the_rate_of_the_momentum_in_space(t):
    with mp.workdps(DIGITS):
        t = mp.mpf(t)
        names = Names()
        body = Inertia(MASS, CENTRE, INERTIA)
        moving = BodyMotion(body, dual(velocity(t)), dual(differentiated(velocity, t)), names, "body")
        c = mp.matrix([mp.mpf(x.p) / x.q for x in CENTRE])
        j = mp.matrix(3, 3)
        for i in range(9):
            j[i // 3, i % 3] = mp.mpf(sp.Rational(INERTIA[i]).p) / sp.Rational(INERTIA[i]).q
        m = mp.mpf(7) / 3

        def centre(x):
            turned, origin = pose(x)
            return origin + turned * c

        def spin(x):
            turned = pose(x)[0]
            return turned * j * velocity(x)[:3]

        turned, _ = pose(t)
        p = turned.T * m * differentiated(centre, t)
        h = turned.T * spin(t) + skew(c) * p
        found = numbers(names, moving.momentum.column)
        assert mp.norm(found - mp.matrix([*p, *h])) < 1e-15
        by_binor = numbers(names, body.binor * sp.Matrix(dual(velocity(t)).column))
        assert mp.norm(by_binor - found) < 1e-30
        force = turned.T * m * differentiated(centre, t, 2)
        moment = turned.T * differentiated(spin, t) + skew(c) * force
        found = numbers(names, moving.wrench.column)
        assert mp.norm(found - mp.matrix([*force, *moment])) < 1e-13
        v = differentiated(centre, t)
        w = turned * velocity(t)[:3]
        energy = m * (v.T * v)[0] / 2 + (w.T * spin(t))[0] / 2
        assert abs(numbers(names, [moving.kinetic_energy])[0] - energy) < 1e-15
        assert abs(energy - (found.T * found)[0]) > 1


def test_binor_is_equation_46():
    """Centre of mass on the axis i, principal axes: the printed matrix with K^2 about the origin."""
    m, g, kx, ky, kz = sp.symbols("m g K_x K_y K_z", real=True)
    zero = sp.Integer(0)
    central = sp.ImmutableMatrix(sp.diag(m * kx**2, m * (ky**2 - g**2), m * (kz**2 - g**2)))
    printed = m * sp.Matrix(
        [
            [0, 0, 0, 1, 0, 0],
            [0, 0, g, 0, 1, 0],
            [0, -g, 0, 0, 0, 1],
            [kx**2, 0, 0, 0, 0, 0],
            [0, ky**2, 0, 0, 0, -g],
            [0, 0, kz**2, 0, g, 0],
        ]
    )
    assert sp.simplify(Inertia(m, (g, zero, zero), central).binor - printed).is_zero_matrix


def test_a_body_of_revolution_does_not_feel_the_spin_of_its_frame():
    """Its axial inertia left out, the wrench in a spinning frame is that of the body that does not spin."""
    across, along = sp.Rational(5, 2), sp.Rational(1, 4)
    centre = (sp.Rational(-2, 3), sp.Integer(0), sp.Integer(0))
    with mp.workdps(DIGITS):
        t = mp.mpf("0.45")
        names = Names()
        body = Inertia(MASS, centre, sp.ImmutableMatrix(sp.diag(0, across, across)))
        found = BodyMotion(body, dual(velocity(t)), dual(differentiated(velocity, t)), names, "rod").wrench
        turned, _ = pose(t)

        def axis(x):
            return pose(x)[0][:, 0]

        def momentum(x):
            return mp.mpf(5) / 2 * skew(axis(x)) * differentiated(axis, x)

        def place(x):
            return pose(x)[1] - mp.mpf(2) / 3 * axis(x)

        force = mp.mpf(7) / 3 * differentiated(place, t, 2)
        moment = differentiated(momentum, t) - skew(mp.mpf(2) / 3 * axis(t)) * force
        expected = mp.matrix([*(turned.T * force), *(turned.T * moment)])
        assert mp.norm(numbers(names, found.column) - expected) < 1e-12
        with_spin = BodyMotion(
            Inertia(MASS, centre, sp.ImmutableMatrix(sp.diag(along, across, across))),
            dual(velocity(t)), dual(differentiated(velocity, t)), Names(), "rod",
        )  # fmt: skip
        assert mp.norm(numbers(with_spin.names, with_spin.wrench.column) - expected) > 1e-2
