"""Velocities, momenta and their rates by the forward and the backward path, in letters: Rahman, (29) to (61)."""

from __future__ import annotations

from functools import cache
from unicodedata import normalize

import mpmath as mp
import pytest
import sympy as sp
from shared.commands import call
from shared.equations import found

from symgen.pipeline.subject import Subject
from symgen.symbolic.system import System

DIGITS = 40
PATHS = ("forward", "backward")


@cache
def subject(scene: str) -> Subject:
    return Subject(scene, {})


def system_of(scene: str, path: str) -> System:
    (system,) = {s.name: s for _, s in subject(scene).searched() if s.name.endswith(f"_{path}")}.values()
    return system


def numbers(scene: str) -> dict[sp.Symbol, sp.Expr]:
    """Values of joint variables with rates and accelerations, and of the parameters."""
    system = subject(scene).system
    values = {
        x.symbol: sp.Float(sp.Rational((37 * i * i + 11 * i) % 23 + 5, 29), DIGITS)
        for i, x in enumerate(system.quantities())
    }
    for c in system.constants:
        values[c.quantity.symbol] = sp.sympify(c.expression).xreplace(values).evalf(DIGITS)
    return values


def evaluated(system: System, name: str, values: dict[sp.Symbol, sp.Expr]) -> mp.matrix:
    known = dict(values)
    for d in system.definitions:
        known[d.quantity.symbol] = d.expression.xreplace(known).evalf(DIGITS)
    return mp.matrix([mp.mpf(e.xreplace(known).evalf(DIGITS)) for e in system[name].matrix])


def moved(row, state) -> mp.matrix:
    """Homogeneous matrix of a row, from its entries at a state."""
    theta, s, eta, alpha, a, ahead = (
        mp.mpf(sp.sympify(e).xreplace(state).evalf(DIGITS))
        for e in (row.theta, row.S, row.eta, row.alpha, row.a, row.ahead)
    )

    def turn(i: int, angle) -> mp.matrix:
        m, j, k = mp.eye(4), (i + 1) % 3, (i + 2) % 3
        m[j, j] = m[k, k] = mp.cos(angle)
        m[k, j] = mp.sin(angle)
        m[j, k] = -m[k, j]
        return m

    along_z, along_x = mp.eye(4), mp.eye(4)
    along_z[2, 3], along_x[0, 3] = s, a
    return turn(0, ahead) * turn(2, theta) * along_z * turn(1, eta) * turn(0, alpha) * along_x


def jet(scene: str, values, first: int, last: int):
    """Product of the rows from first to before last at the time 0, and its first and second derivative."""
    resolved = subject(scene).resolved
    symbols = {s.name: s for s in values}

    def at(t) -> mp.matrix:
        state = dict(values)
        for v in resolved.variables:
            q, u, a = (values[symbols[x.name]] for x in (v.quantity, v.rate, v.acceleration))
            time = sp.Float(t, DIGITS)
            state[v.quantity.symbol] = q + u * time + a * time**2 / 2
        product = mp.eye(4)
        for row in resolved.rows[first:last]:
            product = product * moved(row, state)
        return product

    h = mp.mpf(10) ** -12
    before, here, after = at(-h), at(0), at(h)
    return here, (after - before) / (2 * h), (after - 2 * here + before) / h**2


def motion(frames) -> tuple[mp.matrix, mp.matrix]:
    """(w; v) of a frame by components in it, and their rates, from its pose and two derivatives."""
    (r, _), (r1, p1), (r2, p2) = ((f[:3, :3], f[:3, 3]) for f in frames)
    w, v = vee(r.T * r1), r.T * p1
    return column(w, v), column(vee(r1.T * r1 + r.T * r2), r1.T * p1 + r.T * p2)


def vee(m) -> list:
    return [(m[i, j] - m[j, i]) / 2 for i, j in ((2, 1), (0, 2), (1, 0))]


def column(*parts) -> mp.matrix:
    return mp.matrix([x for part in parts for x in part])


def inverse(frames):
    """Inverse of a pose, and its derivatives."""
    f, f1, f2 = frames
    i = f**-1
    i1 = -i * f1 * i
    return i, i1, -i1 * f1 * i - i * f2 * i - i * f1 * i1


def times(a, b) -> list:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def momentum(body, values, velocity) -> mp.matrix:
    """(p; h) of a body about the origin of its frame, term by term."""
    mass, *centre = (mp.mpf(sp.sympify(e).xreplace(values).evalf(DIGITS)) for e in (body.mass, *body.centre))
    inertia = mp.matrix(3, 3)
    for i in range(3):
        for j in range(3):
            if not (body.idle and i == j == 0):
                inertia[i, j] = mp.mpf(sp.sympify(body.inertia[i][j]).xreplace(values).evalf(DIGITS))
    w, v = list(velocity[:3]), list(velocity[3:])
    p = [mass * (x + y) for x, y in zip(v, times(w, centre), strict=True)]
    h = [x + y for x, y in zip(inertia * mp.matrix(w), times(centre, p), strict=True)]
    return column(p, h)


def close(found, expected) -> bool:
    return mp.norm(found - expected, mp.inf) < mp.mpf(10) ** -12 * (1 + mp.norm(expected, mp.inf))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("scene", ["slider_crank", "cssp"])
def test_derivatives_of_the_frames_give_them(scene, path):
    """At any state, also of an open loop: frames as products of row matrices, differentiated by the time."""
    with mp.workdps(DIGITS):
        loop, system, values = subject(scene).resolved, system_of(scene, path), numbers(scene)
        count = len(loop.rows)
        for k, row in enumerate(loop.rows[:-1], 1):
            frames = jet(scene, values, 0, k) if path == "forward" else inverse(jet(scene, values, k, count))
            velocity, rate = motion(frames)
            assert close(evaluated(system, f"{row.link}_motion_{path}", values), velocity)
            body = loop.body(k - 1)
            if body is None:
                assert f"{row.link}_momentum_{path}" not in system
                continue
            for word, vector in (("", velocity), ("_rate", rate)):
                shown = evaluated(system, f"{row.link}_momentum{word}_{path}", values)
                assert close(shown, momentum(body, values, vector))


@pytest.mark.parametrize("scene", ["slider_crank", "cssp"])
def test_relative_velocities_of_joints(scene):
    with mp.workdps(DIGITS):
        loop, system, values = subject(scene).resolved, system_of(scene, "forward"), numbers(scene)
        for k in range(1, len(loop.rows) + 1):
            frame, rate, _ = jet(scene, values, k - 1, k)
            w = vee(rate[:3, :3] * frame[:3, :3].T)
            v = rate[:3, 3] - mp.matrix(times(w, frame[:3, 3]))
            assert close(evaluated(system, f"joint_{k}_velocity", values), column(w, v))
            if 1 < k < len(loop.rows):
                link, before = loop.rows[k - 1].link, loop.rows[k - 2].link
                shown = evaluated(system, f"{link}_motion_in_{k}", values)
                carried = evaluated(system, f"{before}_motion_forward", values)
                assert close(shown, carried + column(w, v))


def test_dual_euler_equations_are_the_inertia_wrenches():
    """Of the momenta by the path that the kernels take; the scene has no gravity."""
    with mp.workdps(DIGITS):
        values, whole = numbers("slider_crank"), subject("slider_crank").system
        for number, (link, path) in enumerate(
            [("crank", "forward"), ("rod", "forward"), ("slider", "backward")], 1
        ):
            system = system_of("slider_crank", path)
            letters = {
                f"{letter}{number}_{a}{part}{ending}": x
                for letter, word, ending in (("V", "motion", ""), ("H", "momentum", ""), ("H", "momentum_rate", "_rate"))
                for (part, a), x in zip(
                    [(part, a) for part in "pd" for a in "xyz"],
                    evaluated(system, f"{link}_{word}_{path}", values),
                    strict=True,
                )
            }  # fmt: skip
            (euler,) = found(subject("slider_crank"), f"({58 + number})")
            assert euler.name == f"{link}_dual_euler"
            known = {s: sp.Float(letters[s.name], DIGITS) for s in euler.matrix.free_symbols}
            shown = mp.matrix([mp.mpf(e.xreplace(known)) for e in euler.matrix])
            assert close(shown, evaluated(whole, f"{link}_inertia_wrench", values))
            assert close(
                evaluated(system, f"{link}_motion_{path}", values), evaluated(whole, f"{link}_motion", values)
            )


@pytest.mark.parametrize("scene", ["slider_crank", "cssp", "bricard"])
def test_the_closure_of_accelerations_is_the_rate_of_that_of_velocities(scene):
    """A q'' - V2 is the derivative of A q' - V by the time, at any state."""
    whole, variables = subject(scene).system, subject(scene).resolved.variables
    values = numbers(scene)
    q, u, a = (
        [sp.Symbol(x.name, real=True) for x in of]
        for of in zip(*((v.quantity, v.rate, v.acceleration) for v in variables), strict=True)
    )
    found = [i for i, v in enumerate(variables) if v.role == "dependent"]
    rates = sp.Matrix([u[i] for i in found])
    matrix = sp.Matrix(whole.expanded("closure_matrix"))
    closure = matrix * rates - sp.Matrix(whole.expanded("closure_rhs"))
    rate = closure.jacobian(q) * sp.Matrix(u) + closure.jacobian(u) * sp.Matrix(a)
    with mp.workdps(DIGITS):
        left = (rate - matrix * sp.Matrix([a[i] for i in found])).xreplace(values).evalf(DIGITS)
        system = system_of(scene, "closure")
        shown = evaluated(system, "closure_acceleration_rhs", values)
        assert close(shown, -mp.matrix([mp.mpf(x) for x in left]))
        by_matrix = [mp.mpf(x) for x in closure.xreplace(values).evalf(DIGITS)]
        assert close(evaluated(system, "closure_of_velocities", values), mp.matrix(by_matrix))


SOLVED = {
    "39": "theta2", "40": "theta3", "41": "eta2", "42": "eta3", "43": "S4",
    "38a": "theta2", "39a": "theta3", "40a": "eta2", "41a": "eta3", "42a": "S4",
}  # fmt: skip


@pytest.mark.parametrize("number", SOLVED)
def test_solved_equations_lead_to_their_variable(number):
    (m,) = found(subject("slider_crank"), number)
    assert m.name == ("joint_accelerations" if number.endswith("a") else "joint_rates")
    assert m.rows == (SOLVED[number],)
    ending = "acceleration" if number.endswith("a") else "rate"
    assert [s.name for s in m.lefts] == [f"{SOLVED[number]}_{ending}"]


#: As printed, with the axes of eta and the second dots of the errata; alpha3 is 90 degrees.
PRINTED = {
    "29": "0 0 w1 0 0 s1_rate",
    "30": "-n2*sin(theta2) n2*cos(theta2) w2 0 0 0",
    "31": "-n3*sin(theta3) n3*cos(theta3) w3 0 0 0",
    "32": "0 0 0 0 0 S4_rate",
    "32b": "0 0 0 0 0 -S4_rate",
    "33a": "0 0 w1 0 a1*w1 s1_rate",
    "34": "-n2*sin(theta2) n2*cos(theta2) w1+w2 0 a1*w1 s1_rate",
    "35a": "-(w1+w2)*sin(eta2) n2 (w1+w2)*cos(eta2) w1*a1*sin(theta2)*cos(eta2)-s1_rate*sin(eta2) "
    "w1*a1*cos(theta2)+(w1+w2)*a2*cos(eta2) s1_rate*cos(eta2)+a1*w1*sin(theta2)*sin(eta2)-n2*a2",
    "36a": "n3*sin(theta3) -n3*cos(theta3) -w3 -S4_rate*sin(theta3) S4_rate*cos(theta3) 0",
    "37": "-(w1+w2)*sin(eta2)-n3*sin(theta3) n2+n3*cos(theta3) (w1+w2)*cos(eta2)+w3 "
    "w1*a1*sin(theta2)*cos(eta2)-s1_rate*sin(eta2)+S4_rate*sin(theta3) "
    "w1*(a1*cos(theta2)+a2*cos(eta2))+w2*a2*cos(eta2)-S4_rate*cos(theta3) "
    "w1*a1*sin(theta2)*sin(eta2)-n2*a2+s1_rate*cos(eta2)",
    "37d": "w1*(a1*cos(theta2)+a2*cos(eta2))+w2*a2*cos(eta2)-S4_rate*cos(theta3)",
    "40": "-(w1+w2)*cos(eta2)",
    "43": "(s1_rate*sin(eta2)-w1*a1*sin(theta2)*cos(eta2))/sin(theta3)",
    "46": "0 0 0 m1 0 0 0 0 m1*g1_x 0 m1 0 0 -m1*g1_x 0 0 0 m1 I1_xx 0 0 0 0 0 "
    "0 I1_yy 0 0 0 -m1*g1_x 0 0 I1_zz 0 m1*g1_x 0",
    "49": "0 m1*w1*(a1+g1_x) m1*s1_rate 0 -m1*g1_x*s1_rate w1*(I1_zz+m1*g1_x*a1)",
    "52a": "-m2*S4_rate*sin(theta3) m2*(-g2_x*w3+S4_rate*cos(theta3)) m2*g2_x*n3*cos(theta3) "
    "0 -I2_yy*n3*cos(theta3) m2*g2_x*S4_rate*cos(theta3)-I2_zz*w3",
    "53a": "0 0 -m3*S4_rate 0 0 0",
    "54": "0 m1*b1*(a1+g1_x) m1*s1_acceleration 0 -m1*g1_x*s1_acceleration b1*(I1_zz+m1*g1_x*a1)",
    "66": "F2_i F2_j F2_k T2_i T2_j T2_k",
    "57": "m2*(-S4_acceleration*sin(theta3)-S4_rate*cos(theta3)*w3) "
    "m2*(S4_acceleration*cos(theta3)-S4_rate*sin(theta3)*w3-g2_x*b3) "
    "m2*g2_x*(c3*cos(theta3)-n3*sin(theta3)*w3) 0 -I2_yy*(c3*cos(theta3)-n3*sin(theta3)*w3) "
    "m2*g2_x*(S4_acceleration*cos(theta3)-S4_rate*sin(theta3)*w3)-I2_zz*b3",
    "58": "0 0 -m3*S4_acceleration 0 0 0",
    "56a": "m3*((-w3*sin(theta3)*cos(eta3)-n3*cos(theta3)*sin(eta3))*V2_xd+cos(theta3)*cos(eta3)*V2_xd_rate"
    "+(w3*cos(theta3)*cos(eta3)-n3*sin(theta3)*sin(eta3))*V2_yd+sin(theta3)*cos(eta3)*V2_yd_rate"
    "-n3*cos(eta3)*V2_zd-sin(eta3)*V2_zd_rate)",
    "56e": "m3*(w3*cos(theta3)*V2_xd+sin(theta3)*V2_xd_rate+w3*sin(theta3)*V2_yd-cos(theta3)*V2_yd_rate)",
}  # fmt: skip
SHORT = {"w": "theta{}_rate", "n": "eta{}_rate", "b": "theta{}_acceleration", "c": "eta{}_acceleration"}


@pytest.mark.parametrize("number", PRINTED)
def test_as_printed(number):
    (m,) = found(subject("slider_crank"), number)
    straight = {sp.Symbol("alpha3", real=True): sp.pi / 2}
    straight |= {sp.Symbol(f"alpha3_{x}", real=True): 0 for x in ("rate", "acceleration")}
    short = {f"{s}{k}": name.format(k) for s, name in SHORT.items() for k in (1, 2, 3)}
    for entry, text in zip(m.matrix, PRINTED[number].split(), strict=True):
        printed = sp.sympify(text)
        names = {s: sp.Symbol(short.get(s.name, s.name), real=True) for s in printed.free_symbols}
        assert sp.expand(entry.xreplace(straight) - printed.xreplace(names)) == 0


NAMES = {
    "29": "joint_1_velocity", "30": "joint_2_velocity", "31": "joint_3_velocity", "31a": "joint_3_velocity",
    "32": "joint_4_velocity", "32a": "slider_motion_backward", "32b": "slider_motion_backward",
    "33": "crank_motion_forward", "34": "rod_motion_in_2", "35": "rod_motion_forward",
    "36": "rod_motion_backward", "44": "slider_motion_in_3", "45a": "slider_motion_forward",
    "37": "closure_of_velocities", "37f": "closure_of_velocities", "38": "closure_matrix", "47": "rod_binor",
    "49": "crank_momentum_forward", "50a": "rod_momentum_forward", "51": "slider_momentum_forward",
    "52": "rod_momentum_backward", "53a": "slider_momentum_backward", "54": "crank_momentum_rate_forward",
    "55": "rod_momentum_rate_forward", "56": "slider_momentum_rate_forward",
    "57": "rod_momentum_rate_backward", "58": "slider_momentum_rate_backward", "60": "rod_dual_euler",
}  # fmt: skip
ROWS = {"56a": "px", "56b": "hx", "56c": "py", "56d": "hy", "56e": "pz", "56f": "hz"}


@pytest.mark.parametrize("number", [*NAMES, *ROWS])
def test_numbers_lead_to_them(number):
    m, *_ = found(subject("slider_crank"), number)
    assert m.name == NAMES.get(number, "slider_momentum_rate_forward")
    if number in ROWS:
        assert m.rows == (ROWS[number],)


def test_the_print_has_the_letters_that_it_uses():
    text = call("show", "slider_crank", "56a")
    assert "V̇₂_xd = " in text and "V₂_yd = " in text
    assert "θ̇₃ = α̇₃⋅sin(η₃) - (θ̇₁ + θ̇₂)⋅cos(η₂)" in normalize("NFD", call("show", "slider_crank", "40"))
    assert "T₄_k = -f₃_zd" in call("show", "slider_crank", "69f")
    assert "cos_" not in call("show", "slider_crank", "15")
    recorded = [m.name for step in subject("slider_crank").record for m in step.matrices]
    assert {"rod_momentum_rate_backward", "closure_acceleration_rhs", "rod_dual_euler"} <= {*recorded}
