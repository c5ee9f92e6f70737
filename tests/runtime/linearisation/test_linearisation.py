"""State-space matrices against minimal equations of motion that are differentiated at 40 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.signal import StateSpace
from shared.controlled import (
    CART,
    CART_POLE,
    FOUR_BAR,
    LINE,
    POLE,
    SPATIAL_PENDULUM,
    cart_pole,
    four_bar_with_torque,
)  # fmt: skip
from shared.in_numpy import build
from shared.linkages import GRAVITY, G, at, ground
from shared.rich_scenes import SCENES

import symgen
from symgen.errors import CapabilityError, ModelError

DIGITS = 40
g = mp.mpf(G)


def derived(of, x, u):
    """Return df/dx and df/du of a function of lists (x, u) that returns a list, at 40 digits."""
    with mp.workdps(DIGITS):
        point = [mp.mpf(v) for v in (*x, *u)]
        k = len(x)

        def slopes(i):
            def at(value):
                moved = [*point[:i], value, *point[i + 1 :]]
                return mp.matrix(of(moved[:k], moved[k:]))

            h = mp.mpf(10) ** -14  # the error is of order h^2
            return [float(v) for v in (at(point[i] + h) - at(point[i] - h)) / (2 * h)]

        columns = np.array([slopes(i) for i in range(len(point))]).T
        return columns[:, :k], columns[:, k:]


def check(found, of, outputs=None):
    """Compare A, B with z'' = of(x, u), and C, D with outputs(x, u)."""
    k = len(found.states) // 2
    a, b = derived(of, found.x, found.u)
    size = np.max(np.abs(a))
    assert found.A[:k].tolist() == np.hstack([np.zeros((k, k)), np.eye(k)]).tolist()
    assert not np.any(found.B[:k])
    assert found.A[k:] == pytest.approx(a, rel=1e-10, abs=1e-11 * size)
    assert found.B[k:] == pytest.approx(b, rel=1e-10, abs=1e-11 * np.max(np.abs(b), initial=1))
    with mp.workdps(DIGITS):
        rates = [float(v) for v in of([mp.mpf(v) for v in found.x], [mp.mpf(v) for v in found.u])]
    assert found.rates == pytest.approx([*found.x[k:], *rates], rel=1e-10, abs=1e-11 * size)
    if outputs is not None:
        c, d = derived(outputs, found.x, found.u)
        assert pytest.approx(c, rel=1e-10, abs=1e-11 * np.max(np.abs(c))) == found.C
        assert pytest.approx(d, rel=1e-10, abs=1e-11 * np.max(np.abs(d), initial=1)) == found.D


def of_cart_pole(x, u):
    """Return x'' and the angle's acceleration; the angle is from the x axis, counter-clockwise."""
    c, inertia = mp.mpf(POLE) / 4, mp.mpf(POLE) / 12
    _, angle, v, omega = x
    force, torque = u
    s = mp.sin(angle)
    mass = mp.matrix([[mp.mpf(CART) + mp.mpf(POLE), -c * s], [-c * s, inertia]])
    right = mp.matrix(
        [force - mp.mpf(0.3) * v + c * mp.cos(angle) * omega**2, -c * g * mp.cos(angle) - torque]
    )
    return list(mp.lu_solve(mass, right))


def test_a_cart_pole_has_the_matrices_of_its_closed_form():
    model = build(CART_POLE).with_parameters(F=2.0, T=-0.3)
    coordinates, outputs = ["C.position.x", "pole.angle"], ["P.position", "C.acceleration.x", "pole.angle'"]
    y, _ = cart_pole(model, 0.3, 0.7, -0.4, 2.0)
    moving = model.state({"C": y[:2], "P": y[2:4]}, {"C": y[4:6], "P": y[6:]})

    def measured(x, u):
        tip = x[0] + mp.mpf(0.5) * mp.cos(x[1]), mp.mpf(0.5) * mp.sin(x[1])
        return [*tip, of_cart_pole(x, u)[0], x[3]]

    for state in (None, moving):
        found = model.linearise(state, outputs=outputs, coordinates=coordinates)
        assert found.outputs == ("P.position.x", "P.position.y", "C.acceleration.x", "pole.angle'")
        assert found.states == ("C.position.x", "pole.angle", "C.position.x'", "pole.angle'")
        assert found.units["pole.angle'"] == "rad/s" and found.units["F"] == "N"
        check(found, of_cart_pole, measured)
    upright = model.linearise(inputs=["F"], coordinates=coordinates)
    assert upright.B.shape == (4, 1) and np.array_equal(upright.C, np.eye(4)[:2])
    system = upright.state_space
    assert isinstance(system, StateSpace) and np.array_equal(system.A, upright.A)
    assert np.array_equal(system.B, upright.B) and not np.any(system.D)


def of_four_bar(x, u):
    """Return the crank's acceleration from M(f) f'' + M'(f) f'^2/2 + V'(f) = T."""
    a, b, c, base = map(mp.mpf, FOUR_BAR)

    def pose(f):
        ax, ay = a * mp.cos(f), a * mp.sin(f)
        dx, dy = base - ax, -ay
        distance = mp.sqrt(dx**2 + dy**2)
        along = (b**2 - c**2 + distance**2) / (2 * distance)
        across = mp.sqrt(b**2 - along**2)
        return ax, ay, ax + (dx * along - dy * across) / distance, ay + (dy * along + dx * across) / distance

    def rates(f):
        with mp.extradps(DIGITS):
            return [mp.diff(lambda s, i=i: pose(s)[i], f) for i in range(4)]

    def mass(f):
        vax, vay, vbx, vby = rates(f)
        dot = vax * vbx + vay * vby
        coupler = vax**2 + vay**2 + vbx**2 + vby**2 + dot
        return LINE * (a * (vax**2 + vay**2) + b * coupler + c * (vbx**2 + vby**2)) / 3

    def potential(f):
        _, ay, _, by = pose(f)
        return LINE * g * (a * ay + b * (ay + by) + c * by) / 2

    (f, rate), (torque,) = x, u
    with mp.extradps(DIGITS):
        slope, force = mp.diff(mass, f), mp.diff(potential, f)
    return [(torque - force - slope * rate**2 / 2) / mass(f)]


def test_a_four_bar_with_torque_has_the_matrices_of_its_reduced_equation():
    model = symgen.build(four_bar_with_torque())
    start = model.initial_state()
    crank = start.positions["A"]
    along = np.array([-crank[1], crank[0], 0.0, 0.0])  # of A; the velocity of B follows
    rows = model.jacobian(start)
    rest = np.linalg.solve(rows[1:, 2:], -rows[1:] @ along)
    velocity = 1.7 * np.concatenate([along[:2], rest])
    moving = model.state(start.positions, {"A": velocity[:2], "B": velocity[2:]})
    for state in (None, moving):
        check(model.linearise(state, coordinates=["crank.angle"]), of_four_bar)


def of_spatial_pendulum(x, u):
    """Return x'' and y'' of the tip on the lower half of its sphere: T = m (x'^2 + y'^2 + z'^2)/6."""
    m, squared = mp.mpf(0.9) / 3, mp.mpf(0.2) ** 2 + mp.mpf(0.3) ** 2 + mp.mpf(0.6) ** 2
    (px, py, vx, vy), (force, other) = x, u
    z = -mp.sqrt(squared - px**2 - py**2)
    zx, zy = -px / z, -py / z
    vz = zx * vx + zy * vy
    bent = -(vx**2 + vy**2 + vz**2) / z  # the part of z'' without x'' and y''
    mass = m * mp.matrix([[1 + zx**2, zx * zy], [zx * zy, 1 + zy**2]])
    down = -mp.mpf(0.9) * g / 2 - m * bent
    return list(mp.lu_solve(mass, mp.matrix([force + zx * down, other + zy * down])))


def test_a_spatial_pendulum_has_the_matrices_of_its_closed_form():
    model = build(SPATIAL_PENDULUM)
    place = np.array([0.2, 0.3, -0.6])
    moving = model.state({"P": place}, {"P": np.cross([0.4, -1.0, 0.3], place)})
    for state in (None, moving):
        found = model.linearise(state, coordinates=["P.position.x", "P.position.y"])
        check(found, of_spatial_pendulum)


def test_cartesian_coordinates_give_the_jacobian_of_the_right_hand_side():
    """A mass on a massless rod: a = f - r (r.f + v.v)/(r.r), on the circle and off it."""
    model = build(
        symgen.Scene(
            inputs={"F": "0.5 N"},
            points={"O": ground(0, 0), "P": at(0.6, -0.8)},
            links={"OP": {"points": ["O", "P"], "mass": "0 kg"}},
            masses=[{"point": "P", "mass": "2 kg"}],
            gravity=GRAVITY,
            forces=[{"point": "P", "force": ["F", "0 N"]}],
        )
    )

    def acceleration(x, u):
        (px, py, vx, vy), f = x, (u[0] / 2, -g)
        pull = (px * f[0] + py * f[1] + vx**2 + vy**2) / (px**2 + py**2)
        return [f[0] - px * pull, f[1] - py * pull]

    def tension(x, u):
        (px, py, vx, vy), f = x, (u[0] / 2, -g)
        return [2 * (px * f[0] + py * f[1] + vx**2 + vy**2) / (px**2 + py**2)]

    off = model.state({"P": [0.5, -0.9]}, {"P": [1.0, 0.3]})
    for state in (None, off):
        found = model.linearise(state, outputs=["OP.tension"])
        assert found.states == ("P.position.x", "P.position.y", "P.position.x'", "P.position.y'")
        check(found, acceleration, tension)
        assert found.freedoms == 1 and found.summary()["freedoms"] == 1
    assert model.mass_matrix() == pytest.approx(2 * np.eye(2), abs=0)
    assert model.mass_matrix(coordinates=["OP.angle"]) == pytest.approx(np.array([[2.0]]), rel=1e-14)
    assert model.jacobian(off) == pytest.approx(np.array([[0.5, -0.9]]), rel=1e-15)


@pytest.mark.parametrize("scene", ["loaded", "tumbling_body", "car_axis"])
def test_loads_and_bodies_of_all_kinds_enter_the_slopes(scene):
    """Differences of the right-hand side, at a state in motion."""
    model = build(SCENES[scene]())
    start, f = model.initial_state(), model.rhs
    n, points = len(start.q), model.description.free
    y = np.concatenate([start.q, start.u + 0.3 * np.random.default_rng(0).standard_normal(n)])
    y = f.project(0.0, y)
    parts = (dict(zip(points, half.reshape(len(points), -1), strict=True)) for half in np.split(y, 2))
    found = model.linearise(model.state(*parts)).A
    h = 1e-5 * np.max(np.abs(y))
    columns = [
        (8 * (f(0.0, y + e) - f(0.0, y - e)) - (f(0.0, y + 2 * e) - f(0.0, y - 2 * e))) / (12 * h)
        for e in h * np.eye(2 * n)
    ]
    assert found == pytest.approx(np.array(columns).T, rel=0, abs=1e-9 * np.max(np.abs(found)))


def test_drives_and_moving_ground_enter_the_slopes():
    """A pendulum on a driven arm, whose pivot moves: the rates of constraints depend on time and place."""
    model = build(
        symgen.Scene(
            parameters={"w": "3 rad/s", "d": "0.1 m", "v": "2 rad/s"},
            points={
                "O": {**ground(0, 0), "motion": [0, "d*sin(v*t)"]},
                "A": at(1, 0),
                "B": at(1, -0.5),
            },
            links={
                "arm": {"points": ["O", "A"], "mass": "1 kg"},
                "rod": {"points": ["A", "B"], "mass": "0 kg"},
            },
            masses=[{"point": "B", "mass": "1 kg"}],
            drivers=[{"link": "arm", "angle": "w*t"}],
            gravity=GRAVITY,
        )
    )
    t, angle, rate = 0.4, -1.1, 0.9
    o, vo = np.array([0.0, 0.1 * np.sin(2 * t)]), np.array([0.0, 0.2 * np.cos(2 * t)])
    a, va = o + [np.cos(3 * t), np.sin(3 * t)], vo + [-3 * np.sin(3 * t), 3 * np.cos(3 * t)]
    rod, turned = (
        0.5 * np.array([np.cos(angle), np.sin(angle)]),
        0.5 * np.array([-np.sin(angle), np.cos(angle)]),
    )
    state = model.state({"A": a, "B": a + rod}, {"A": va, "B": va + rate * turned}, t=t)

    def pivot():
        when = mp.mpf(t)
        return -9 * mp.cos(3 * when), -9 * mp.sin(3 * when) - mp.mpf(0.4) * mp.sin(2 * when)

    def acceleration(x, u):
        ax, ay = pivot()
        return [(ax * mp.sin(x[0]) - (ay + g) * mp.cos(x[0])) / mp.mpf(0.5)]

    def tension(x, u):
        ax, ay = pivot()
        return [x[1] ** 2 / 2 - ax * mp.cos(x[0]) - (ay + g) * mp.sin(x[0])]

    found = model.linearise(state, outputs=["rod.tension"], coordinates=["rod.angle"])
    assert found.t == t and found.B.shape == (2, 0)
    check(found, acceleration, tension)
    with pytest.raises(ModelError, match=r"needs inputs(.|\n)*\[inputs\]"):
        found.state_space  # noqa: B018


def test_the_type_of_runs_leaves_the_matrices_in_doubles():
    coordinates = ["C.position.x", "pole.angle"]
    plain = build(CART_POLE).linearise(coordinates=coordinates)
    single = build(CART_POLE, precision="float32").linearise(coordinates=coordinates)
    assert np.array_equal(single.A, plain.A) and np.array_equal(single.B, plain.B)


ANGLES = {
    "triple_pendulum": ["OA.angle", "AB.angle", "BC.angle"],
    "double_four_bar": ["DC.angle"],
    "peaucellier": ["C.position.y"],
}


@pytest.mark.parametrize("scene", ANGLES)
def test_frequencies_of_a_are_those_of_the_modes(scene):
    model = build(scene)
    equilibrium = model.equilibrium()
    found = model.linearise(equilibrium, coordinates=ANGLES[scene])
    scale = np.max(np.abs(found.A))
    assert np.max(np.abs(found.rates)) <= 1e-8 * scale
    poles = [s.imag for s in found.poles if s.imag > 0]
    assert poles == pytest.approx([m.omega for m in model.modes(equilibrium)], rel=1e-9)


def test_a_linkage_in_a_plane_of_space_keeps_its_freedoms_across():
    scene = symgen.Scene(
        points={"O": {"at": [0, 0, 0], "ground": True}, "P": {"at": ["0.6 m", 0, "-0.8 m"]}},
        links={"OP": {"points": ["O", "P"], "mass": "1 kg"}},
        gravity={"acceleration": [0, 0, f"{-G!r} m/s^2"]},
    )
    model = build(scene)
    assert model.description.plane is not None
    at_rest = model.equilibrium()
    found = model.linearise(at_rest, coordinates=["P.position.x", "P.position.y"])
    assert [s.imag for s in found.poles if s.imag > 0] == pytest.approx([np.sqrt(1.5 * G)] * 2, rel=1e-9)
    assert model.linearise().A.shape == (4, 4) and model.jacobian().shape == (1, 2)
    assert model.mass_matrix() == pytest.approx(np.eye(2) / 3, rel=1e-14)


def test_redundant_constraints_leave_some_forces_open():
    model = build("double_four_bar")
    assert model.redundant
    with pytest.raises(ModelError, match="redundant(.|\n)*independent coordinates"):
        model.linearise()
    with pytest.raises(ModelError, match=r"A\.reaction\.x depends on forces of redundant constraints"):
        model.linearise(coordinates=["DC.angle"], outputs=["A.reaction"])
    assert model.linearise(coordinates=["DC.angle"], outputs=["energy"]).C[0, 1] == 0.0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"coordinates": ["C.position.x"]}, "expected 2 independent coordinates(.|\n)*got 1: C.position.x"),
        ({"coordinates": ["C.position.x", "P.position.y"]}, "do not determine the motion"),
        ({"coordinates": ["C.position", "pole.angle"]}, r"several components(.|\n)*C\.position\.x"),
        ({"coordinates": ["C.velocity.x", "pole.angle"]}, "depends on more than the pose"),
        ({"coordinates": ["C.place.x", "pole.angle"]}, "there is no output"),
        ({"coordinates": ["C.x", "pole.angle"]}, r"independent coordinates(.|\n)*such as C\.position\.x"),
        ({"outputs": ["pole.angel"]}, r"there is no output(.|\n)*pole\.angle"),
        ({"outputs": ["pole.angle.z"]}, "has no component 'z': it is one number"),
        ({"inputs": ["G"]}, "no input 'G'"),
    ],
)
def test_wrong_requests_are_refused(arguments, text):
    model = build(CART_POLE)
    with pytest.raises(ModelError, match=text):
        model.linearise(**arguments)


def test_a_parameter_among_the_arguments_is_referred_to_with_parameters():
    with pytest.raises(ModelError, match=r"no argument 'F'\. F is a parameter: model\.with_parameters"):
        build(CART_POLE).simulate(0.1, F=1.0)


def test_equilibria_of_other_models_are_refused():
    other = build("four_bar").equilibrium()
    with pytest.raises(ModelError, match=r"an equilibrium of this model, got one .* constraint crank_drive"):
        build("crank_rocker").linearise(other)


def test_a_state_off_the_constraints_has_no_independent_coordinates():
    model = build(CART_POLE)
    state = model.state({"C": [0.0, 0.1], "P": [0.0, 0.5]})
    with pytest.raises(ModelError, match=r"violates the constraints(.|\n)*rhs\.project"):
        model.linearise(state, coordinates=["C.position.x", "pole.angle"])
    (note,) = model.simulate(0.1, state=state).notes
    assert "by 1.0e-01 m and 0.0e+00 m/s: the run starts from its projection" in note
    assert not model.simulate(0.1, state=model.initial_state()).notes
    moving = model.state({"C": [0.0, 0.0], "P": [0.0, 0.5]}, {"C": [0.0, 1e-4], "P": [0.0, 1e-4]})
    with pytest.raises(ModelError, match=r"by 0\.0e\+00 m and 1\.0e-04 m/s"):
        model.linearise(moving, coordinates=["C.position.x", "pole.angle"])


def test_at_rest_round_off_of_velocities_violates_no_constraint():
    model = build(CART_POLE)
    coordinates = ["C.position.x", "pole.angle"]
    start = model.linearise(coordinates=coordinates)
    assert np.array_equal(model.linearise(0.0, coordinates=coordinates).A, start.A)
    assert pytest.approx(start.A, rel=1e-12, abs=1e-12) == model.linearise(0.5, coordinates=coordinates).A
    with pytest.raises(ModelError, match=r"expected a time t after 0 s, that of the first state, got -0\.5"):
        model.linearise(-0.5, coordinates=coordinates)


@pytest.mark.parametrize(
    ("verb", "why"),
    [
        ("linearise", "its inputs prescribe its motion"),
        ("mass_matrix", "its inputs prescribe its motion"),
    ],
)
def test_driven_loops_do_not_support_it(verb, why):
    with pytest.raises(CapabilityError, match=f"does not support {verb.replace('_', ' ')}: {why}"):
        getattr(symgen.build("slider_crank"), verb)
