"""Bushings against equations of motion of their own, in the plane by angles and in space by quaternions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import symgen
from symgen.errors import SceneError

PLANE = {
    "symgen": 1,
    "parameters": {
        "k": {"value": "900 N/m", "tunable": True},
        "kr": {"value": "7 N*m", "tunable": True},
    },
    "points": {
        "O": {"at": ["0 m", "0 m"], "ground": True},
        "A": {"at": ["0.4 m", "0.3 m"]},
        "B": {"at": ["0.42 m", "0.29 m"]},
        "C": {"at": ["1.02 m", "-0.51 m"]},
    },
    "links": {
        "OA": {"points": ["O", "A"], "mass": "1.2 kg"},
        "BC": {"points": ["B", "C"], "mass": "0.8 kg"},
    },
    "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    "bushings": [
        {
            "between": ["A", "B"],
            "link": "BC",
            "against": "OA",
            "stiffness": ["k", "400 N/m"],
            "damping": ["3 N*s/m", "5 N*s/m"],
            "angular_stiffness": "kr",
            "angular_damping": "0.2 N*m*s",
            "angle": -1.2,
        }
    ],
    "start": {"rates": {"OA": "2 rad/s", "BC": "-3 rad/s"}},
    "analysis": {"t_end": "0.6 s", "outputs": ["A.position", "B.position", "C.position"]},
}


#: Independent coordinates, and their values and rates at the start: velocities that rates of links leave open vanish
#: by least kinetic energy, so that the centre of BC is at rest.
FREE = ["OA.angle", "BC.angle", "B.position.x", "B.position.y"]
START = [np.arctan2(0.3, 0.4), np.arctan2(-0.8, 0.6), 0.42, 0.29, 2.0, -3.0, 1.2, 0.9]


def plane_motion(times, k=900.0, kr=7.0, *start):
    """Places of A, B and C at the times by the angles of both links and the centre of BC."""
    l1, l2, m1, m2, g, slack = 0.5, 1.0, 1.2, 0.8, 9.81, -1.2

    def unit(x):
        e = np.array([np.cos(x), np.sin(x)])
        return e, np.array([-e[1], e[0]])

    def rate(_, y):
        a, b, centre, wa, wb, v = y[0], y[1], y[2:4], y[4], y[5], y[6:8]
        (e1, n1), (e2, n2) = unit(a), unit(b)
        d = centre - l2 / 2 * e2 - l1 * e1
        moving = v - l2 / 2 * wb * n2 - l1 * wa * n1
        along, across = d @ e1, d @ n1
        force = (-k * along - 3 * (moving @ e1 + wa * across)) * e1
        force = force + (-400 * across - 5 * (moving @ n1 - wa * along)) * n1
        torque = -kr * (b - a - slack) - 0.2 * (wb - wa)
        at = centre - l2 / 2 * e2
        of_bc = torque - l2 / 2 * (e2[0] * force[1] - e2[1] * force[0])
        of_oa = -torque - (at[0] * force[1] - at[1] * force[0]) - m1 * g * l1 / 2 * e1[0]
        fast = [of_oa / (m1 * l1**2 / 3), of_bc / (m2 * l2**2 / 12)]
        return np.concatenate([[wa, wb], v, fast, force / m2 - [0, g]])

    y0 = np.array(start or START)
    e2, n2 = unit(y0[1])
    y0[2:4], y0[6:] = y0[2:4] + l2 / 2 * e2, y0[6:] + l2 / 2 * y0[5] * n2
    found = solve_ivp(rate, (0, times[-1]), y0, t_eval=times, rtol=1e-12, atol=1e-12, method="DOP853").y
    ends = [unit(x) for x in found[:2]]
    of_a, centre, e2 = l1 * ends[0][0], found[2:4], ends[1][0]
    return of_a.T, (centre - l2 / 2 * e2).T, (centre + l2 / 2 * e2).T


@pytest.mark.parametrize("method", ["dop853", "radau5"])
def test_two_links_in_the_plane_move_as_by_their_angles(method):
    run = symgen.build(symgen.Scene(**PLANE)).simulate(method=method, rtol=1e-11, samples=7)
    for point, places in zip("ABC", plane_motion(run.time), strict=True):
        assert np.asarray(run[f"{point}.position"]) == pytest.approx(places, abs=2e-8)


def test_many_runs_in_the_plane_are_those_of_one():
    model, values = symgen.build(symgen.Scene(**PLANE)), [700.0, 900.0, 1500.0]
    many = model.simulate_many(parameters={"k": np.array(values)}, t_end=0.6, step=1e-3, samples=2)
    ends = np.array([0.0, 0.6])
    for k, places in zip(values, np.asarray(many["C.position"]), strict=True):
        assert places[-1] == pytest.approx(plane_motion(ends, k)[2][-1], abs=1e-6)


@pytest.mark.parametrize("outputs", [["C.position.x"], ["C.position.x", "C.position.y"]])
def test_derivatives_along_a_run_are_those_of_the_minimal_equations(outputs):
    """One output by ten directions is taken back along the steps, two go forward."""
    by = ["k", "kr", *FREE, *(f"{name}'" for name in FREE)]
    options = {"coordinates": FREE, "t_end": 0.6, "rtol": 1e-12, "atol": 1e-13}
    found = symgen.build(symgen.Scene(**PLANE)).sensitivity(outputs, by, **options).derivatives[0]
    ends, values = np.array([0.0, 0.6]), np.array([900.0, 7.0, *START])
    for j, h in enumerate(1e-3 * np.abs(values)):
        at = (plane_motion(ends, *(values + s * h * np.eye(10)[j]))[2][-1] for s in (-2, -1, 1, 2))
        expected = np.array([1, -8, 8, -1]) @ np.array([*at]) / (12 * h)
        assert found[:, j] == pytest.approx(expected[: len(outputs)], rel=1e-7, abs=1e-9)


def test_the_softest_bushing_that_holds_a_link_is_found_by_exact_gradients():
    """Its stiffness is that at which the minimal equations reach the bound."""
    bound = 0.5 * sum(plane_motion(np.array([0.0, 0.2]), k)[2][-1][1] for k in (300.0, 900.0))
    model = symgen.build(symgen.Scene(**PLANE))
    run = {"t_end": 0.2, "rtol": 1e-10, "atol": 1e-12, "samples": 2}
    found = model.optimise(
        {"k": (300.0, 900.0)}, "k", {"C.position.final.y": (bound, None)}, "simulate", **run
    )
    expected = brentq(lambda k: plane_motion(np.array([0.0, 0.2]), k)[2][-1][1] - bound, 300.0, 900.0)
    assert found.converged and found.gradients == "exact"
    assert found.parameters["k"] == pytest.approx(expected, rel=1e-7)


def body(name, points, centre, mass, moments):
    return {
        "points": points,
        "mass": f"{mass} kg",
        "centre": [f"{c} m" for c in centre],
        "inertia": [f"{j} kg*m^2" for j in moments],
    }


def at(*place, **more):
    return {"at": [f"{c} m" for c in place], **more}


#: Two bodies in space: mass, moments about the centre, centre, joined point.
FIRST = 2.0, (0.03, 0.05, 0.04), (0.1, 0.2, -0.1), (0.3, 0.1, 0.2)
SECOND = 1.5, (0.02, 0.01, 0.025), (0.5, 0.0, 0.3), (0.33, 0.12, 0.17)
STIFF, DAMPED = (800.0, 500.0, 1200.0), (2.0, 3.0, 1.0)
TURNING, DRAGGED = (12.0, 5.0, 30.0), (0.1, 0.3, 0.2)
SPINS = (1.0, -2.0, 1.5), (-2.0, 3.0, 4.0)


def in_space(grounded=False, damping=True):
    """The scene of two free bodies, or of the second one on the ground."""
    points = {
        "P": at(*FIRST[3]), "Q": at(*SECOND[3]), "R": at(0.1, 0.4, 0.0), "S": at(0.6, 0.2, 0.3),
        "T": at(0.2, 0.1, 0.5), "U": at(0.4, -0.2, 0.4),
    }  # fmt: skip
    links = {"first": body("first", ["P", "R", "T"], FIRST[2], FIRST[0], FIRST[1])}
    links["second"] = body("second", ["Q", "S", "U"], SECOND[2], SECOND[0], SECOND[1])
    bushing = {
        "between": ["P", "Q"],
        "link": "second",
        "stiffness": [f"{k} N/m" for k in STIFF],
        "angular_stiffness": [f"{k} N*m" for k in TURNING],
    }
    if damping:
        bushing |= {
            "damping": [f"{c} N*s/m" for c in DAMPED],
            "angular_damping": [f"{c} N*m*s" for c in DRAGGED],
        }
    rates = {"first": SPINS[0], "second": SPINS[1]}
    if grounded:
        del links["first"], points["R"], points["T"], rates["first"]
        points["P"]["ground"] = True
    else:
        bushing["against"] = "first"
    return {
        "symgen": 1,
        "points": points,
        "links": links,
        "bushings": [bushing],
        "start": {"rates": {k: [f"{w} rad/s" for w in spin] for k, spin in rates.items()}},
        "analysis": {"t_end": "0.4 s", "outputs": ["Q.position", "S.position", "U.position", "energy"]},
    }


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def unskew(m):
    return np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2


def rotation(q):
    w, v = q[0], q[1:]
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * skew(v)


def bushing_wrench(turned, offset, moving, spin):
    """Force on the second body, and couple, by the axes of the first: all arguments are on these.

    V = 2 sum k_i q_i^2 with the vector part of the quaternion, whose rate is (q0 w + w x q)/2.
    """
    angle = np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))
    axis = unskew(turned) / np.sin(angle) if angle > 1e-9 else np.zeros(3)
    q0, q = np.cos(angle / 2), np.sin(angle / 2) * axis
    couple = -2 * (q0 * np.array(TURNING) * q + np.cross(q, np.array(TURNING) * q))
    slopes = np.array([unskew(skew(e) @ turned - (skew(e) @ turned).T) / 2 * 2 / 2 for e in np.eye(3)]).T
    couple = couple - slopes.T @ (np.array(DRAGGED) * (slopes @ spin))
    return -np.array(STIFF) * offset - np.array(DAMPED) * moving, couple


def space_motion(times, grounded):
    """Places of the points of the second body at the times, by quaternions and Newton-Euler equations."""
    bodies = [FIRST, SECOND]
    arms = [np.subtract(b[3], b[2]) for b in bodies]

    def split(y):
        for k in range(2):
            part = y[13 * k : 13 * k + 13]
            yield part[:3], part[3:7], part[7:10], part[10:]

    def rate(_, y):
        (c1, q1, v1, w1), (c2, q2, v2, w2) = split(y)
        r1, r2 = rotation(q1), rotation(q2)
        p1, p2 = c1 + r1 @ arms[0], c2 + r2 @ arms[1]
        d = p2 - p1
        moving = v2 + np.cross(w2, r2 @ arms[1]) - v1 - np.cross(w1, r1 @ arms[0]) - np.cross(w1, d)
        force, couple = bushing_wrench(r1.T @ r2, r1.T @ d, r1.T @ moving, r1.T @ (w2 - w1))
        force, couple = r1 @ force, r1 @ couple
        loads = [
            (-force, -couple - np.cross(p2 - c1, force)),
            (force, couple + np.cross(p2 - c2, force)),
        ]
        rates = []
        for (mass, moments, *_), (_, q, v, w), r, (f, m) in zip(
            bodies, split(y), (r1, r2), loads, strict=True
        ):
            inertia = r @ np.diag(moments) @ r.T
            turning = np.linalg.solve(inertia, m - np.cross(w, inertia @ w))
            spun = np.concatenate([[-q[1:] @ w], q[0] * w + np.cross(w, q[1:])]) / 2
            rates.append(np.concatenate([v, spun, f / mass, turning]))
        if grounded:
            rates[0][:] = 0
        return np.concatenate(rates)

    y0 = [[*b[2], 1, 0, 0, 0, 0, 0, 0, *w] for b, w in zip(bodies, SPINS, strict=True)]
    if grounded:
        y0[0][10:] = [0, 0, 0]
    y = solve_ivp(
        rate, (0, times[-1]), np.ravel(y0), t_eval=times, rtol=1e-12, atol=1e-13, method="DOP853"
    ).y.T
    points = {"Q": SECOND[3], "S": (0.6, 0.2, 0.3), "U": (0.4, -0.2, 0.4)}
    return {
        name: np.array([row[13:16] + rotation(row[16:20]) @ np.subtract(place, SECOND[2]) for row in y])
        for name, place in points.items()
    }


@pytest.mark.parametrize("grounded", [False, True])
def test_bodies_in_space_move_as_by_quaternions(grounded):
    run = symgen.build(symgen.Scene(**in_space(grounded))).simulate(rtol=1e-11, samples=5)
    for point, places in space_motion(run.time, grounded).items():
        assert np.asarray(run[f"{point}.position"]) == pytest.approx(places, abs=1e-8)


def test_frequencies_on_a_bushing_at_the_centre():
    """m d'' + c d' + k d = 0 of every offset and rotation: 1 - cos a and 2 q^2 are a^2/2 for small a."""
    scene = in_space(grounded=True)
    for name in ("P", "Q"):
        scene["points"][name] |= at(*SECOND[2])
    model = symgen.build(symgen.Scene(**scene))
    inertia = np.array([SECOND[0]] * 3 + [*SECOND[1]])
    stiff, damped = np.array([*STIFF, *TURNING]) / inertia, np.array([*DAMPED, *DRAGGED]) / inertia
    expected = np.sqrt(stiff - damped**2 / 4)
    assert np.sort(model.modes().frequencies) == pytest.approx(np.sort(expected) / (2 * np.pi), rel=1e-9)
    poles = model.linearise(at=model.equilibrium()).poles
    for pole in -damped / 2 + 1j * expected:
        assert np.min(np.abs(poles - pole)) < 1e-7 * np.abs(pole)


def test_torque_that_turns_a_crank_against_a_bushing():
    """The crank carries a point on a circle about its bushing: M = V'(angle) + c l^2 w, at a constant speed."""
    scene = {
        "symgen": 1,
        "points": {"O": at(0, 0, ground=True), "G": at(0.3, 0.1, ground=True), "A": at(0.2, 0.0)},
        "links": {"OA": {"points": ["O", "A"], "mass": "1 kg"}},
        "drivers": [{"link": "OA", "angle": "0.5*w*t"}],
        "parameters": {"w": "2 rad/s"},
        "bushings": [
            {
                "between": ["G", "A"], "link": "OA", "stiffness": ["300 N/m", "700 N/m"],
                "damping": ["4 N*s/m", "9 N*s/m"], "angular_stiffness": "2 N*m", "angular_damping": "0.3 N*m*s",
            }
        ],
        "analysis": {"t_end": "1 s"},
    }  # fmt: skip
    found = symgen.build(symgen.Scene(**scene)).inverse_dynamics(samples=9)
    c, s = np.cos(found.time), np.sin(found.time)
    x, y = 0.2 * c - 0.3, 0.2 * s - 0.1
    expected = -0.2 * s * (300 * x - 4 * 0.2 * s) + 0.2 * c * (700 * y + 9 * 0.2 * c) + 2 * found.time + 0.3
    assert np.asarray(found["OA.torque"]) == pytest.approx(expected, rel=1e-10)


#: A bushing that is the same as a spring of length zero, with a torsion spring, in the plane.
SAME = {
    "springs": [{"between": ["F", "E"], "stiffness": "4e4 N/m", "length": 0}],
    "torsion_springs": [{"link": "rocker", "stiffness": "60 N*m", "angle": 1.4}],
}
BUSHED = [
    {
        "between": ["F", "E"], "link": "rocker", "stiffness": ["4e4 N/m", "4e4 N/m"],
        "angular_stiffness": "60 N*m", "angle": 1.4,
    }
]  # fmt: skip
STEEL = {"density": "7850 kg/m^3", "section": {"width": "10 mm", "thickness": "2 mm"}}


def elastic_four_bar(**loads):
    return symgen.Scene(
        points={
            "A": at(0, 0, ground=True), "B": at(0.05, 0), "C": at(0.25, 0.2), "D": at(0.3, 0, ground=True),
            "E": {"on": "rocker", "fraction": 0.5}, "F": at(0.3, 0.12, ground=True),
        },
        links={
            "crank": {"points": ["A", "B"], "mass": "0.1 kg"},
            "coupler": {"points": ["B", "C"], **STEEL, "elastic": {"E": "200 GPa", "elements": 3}},
            "rocker": {"points": ["D", "C"], "mass": "0.2 kg"},
        },
        crank={"link": "crank", "speed": "200 rpm"},
        analysis={"outputs": ["C.position", "coupler.C.force", "crank.torque"]},
        **loads,
    )  # fmt: skip


@pytest.mark.parametrize("verb", ["simulate", "quasi_static", "large_rotation"])
def test_a_bushing_beside_an_elastic_link_is_the_same_as_two_springs(verb):
    options = {"samples": 5} | ({"t_end": 0.05, "elements": 3} if verb == "large_rotation" else {})
    runs = [
        getattr(symgen.build(elastic_four_bar(**loads)), verb)(**options)
        for loads in (SAME, {"bushings": BUSHED})
    ]
    for name in ("C.position", "coupler.C.force", "crank.torque"):
        spring, bushing = (np.asarray(run[name]) for run in runs)
        assert bushing == pytest.approx(spring, rel=1e-9, abs=1e-9 * np.max(np.abs(spring)))


def test_derivatives_of_an_elastic_linkage_with_a_bushing_are_those_with_two_springs():
    """The stiffness of the spring is that of the bushing along both axes."""
    tunable = {
        name: {"value": x, "tunable": True}
        for name, x in {"k": "4e4 N/m", "across": "4e4 N/m", "kr": "60 N*m"}.items()
    }
    of_springs = {
        "springs": [SAME["springs"][0] | {"stiffness": "k"}],
        "torsion_springs": [SAME["torsion_springs"][0] | {"stiffness": "kr"}],
    }
    bushing = BUSHED[0] | {"stiffness": ["k", "across"], "angular_stiffness": "kr"}
    spring, bushed = (
        symgen.build(elastic_four_bar(parameters=tunable, **loads))
        for loads in (of_springs, {"bushings": [bushing]})
    )
    outputs = ["C.displacement", "coupler.C.curvature"]
    for find in (
        lambda model, by: model.sensitivity(["frequencies"], by, at=0.05).derivatives,
        lambda model, by: model.simulate(samples=5).gradient(outputs, by).derivatives,
        lambda model, by: model.periodic(samples=5).gradient(outputs, by).derivatives,
    ):
        expected, found = find(spring, ["k", "kr"]), find(bushed, ["k", "across", "kr"])
        both = np.stack([found[..., 0] + found[..., 1], found[..., 2]], axis=-1)
        assert both == pytest.approx(expected, rel=1e-9, abs=1e-10 * np.max(np.abs(expected[..., 0])))


def test_a_bushing_on_the_section_of_an_elastic_link():
    """It is a spring of length zero and a torsion spring on the section."""
    tables = {
        "points": {"O": at(0, 0, ground=True), "T": at(0.4, 0), "G": at(0.4, 0.01, ground=True)},
        "links": {"beam": {"points": ["O", "T"], **STEEL, "elastic": {"E": "200 GPa", "elements": 3}}},
        "crank": {"link": "beam", "speed": "0 rpm"},
    }
    bushing = {"between": ["G", "T"], "link": "beam", "stiffness": ["2e4 N/m", "2e4 N/m"]}
    same = {
        "springs": [{"between": ["G", "T"], "stiffness": "2e4 N/m", "length": 0}],
        "torsion_springs": [{"link": "beam", "point": "T", "stiffness": "5 N*m"}],
    }
    found = [
        symgen.build(symgen.Scene(**tables, **loads))
        for loads in (same, {"bushings": [bushing | {"angular_stiffness": "5 N*m"}]})
    ]
    spring, bushed = (model.modes(0.0).frequencies for model in found)
    assert bushed == pytest.approx(spring, rel=1e-12)


def test_a_bushing_at_the_tip_of_an_elastic_link_in_space():
    """Of equal stiffness on all axes it is a spring of length zero."""
    section = {"width": "8 mm", "thickness": "4 mm", "width_along": [0, 0, 1]}
    of = {"E": "210 GPa", "elements": 2, "shear": {"poisson": 0.3}}
    tables = {
        "points": {"A": at(0, 0, 0, ground=True), "B": at(0.4, 0, 0), "G": at(0.4, 0.02, 0.01, ground=True)},
        "links": {
            "beam": {"points": ["A", "B"], "density": "7850 kg/m^3", "section": section, "elastic": of}
        },
        "welds": [{"point": "A", "links": ["beam"]}],
        "analysis": {"t_end": "0.01 s", "outputs": ["B.position"]},
        "parameters": {"k": {"value": "3e3 N/m", "tunable": True}},
    }
    loads = (
        {"springs": [{"between": ["G", "B"], "stiffness": "k", "length": 0}]},
        {"bushings": [{"between": ["G", "B"], "link": "beam", "stiffness": ["k"] * 3}]},
    )
    models = [symgen.build(symgen.Scene(**tables, **x)) for x in loads]
    runs = [model.simulate(samples=3) for model in models]
    spring, bushed = (np.asarray(run["B.position"]) for run in runs)
    assert bushed == pytest.approx(spring, rel=1e-12, abs=1e-12)
    held = {"coordinates": ["B.position.y", "B.position.z"]}
    spring, bushed = (run.gradient(["B.position"], ["k"], **held).derivatives for run in runs)
    assert bushed == pytest.approx(spring, rel=1e-9, abs=1e-9 * np.max(np.abs(spring)))
    spring, bushed = (model.sensitivity(["frequencies"], ["k"], **held).derivatives for model in models)
    assert bushed == pytest.approx(spring, rel=1e-9, abs=1e-9 * np.max(np.abs(spring)))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"between": ["A", "A"]}, "expected a point of BC, got A"),
        ({"between": ["C", "B"]}, "expected a point of OA, got C"),
        ({"against": None}, "expected a ground point first, got A"),
        ({"against": "BC"}, "a bushing of a link against itself does nothing"),
        ({"stiffness": ["1 N/m"]}, "at least 2"),
        ({"stiffness": ["1 N/m", "-1 N/m"]}, "of at least zero"),
        ({"angular_stiffness": ["1 N*m", "1 N*m", "1 N*m"]}, "expected one number in the plane"),
    ],
)
def test_faults_are_named(change, expected):
    bushing = {k: v for k, v in (PLANE["bushings"][0] | change).items() if v is not None}
    with pytest.raises(SceneError) as failure:
        symgen.build(symgen.Scene(**PLANE | {"bushings": [bushing]}))
    assert expected in str(failure.value) and "bushings.0" in str(failure.value)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"between": ["C", "E"], "link": "rocker", "against": "coupler"}, "coupler is elastic, and the axes"),
        ({"between": ["E", "C"], "link": "coupler", "against": "rocker"}, "between the section of coupler"),
    ],
)
def test_faults_next_to_elastic_links_are_named(change, expected):
    with pytest.raises(SceneError) as failure:
        symgen.build(elastic_four_bar(bushings=[BUSHED[0] | change]))
    assert expected in str(failure.value) and "Name the point" not in str(failure.value)


def test_a_rod_in_space_has_no_axes():
    scene = in_space(grounded=True)
    scene["links"]["second"] = {"points": ["Q", "S"], "mass": "1 kg"}
    del scene["points"]["U"], scene["analysis"]["outputs"][2]
    with pytest.raises(SceneError, match="second is a rod, which has no axes across it"):
        symgen.build(symgen.Scene(**scene))
