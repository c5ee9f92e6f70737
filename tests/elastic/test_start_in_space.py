"""Initial states of elastic links in space: statics, steady rotation, free vibrations, roughness of runs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from shared.commands import call
from shared.in_numpy import build
from shared.shipped import IN_SPACE

import symgen
from symgen.errors import ModelError
from symgen.runtime.elastic.space.initial import initial
from symgen.runtime.elastic.space.linkage import LinkageInSpace

LENGTH, WIDTH, THICKNESS, E, DENSITY = 0.4, 8e-3, 4e-3, 210e9, 7850.0
MU, G = DENSITY * WIDTH * THICKNESS, 9.81
ROD = {
    "density": f"{DENSITY} kg/m^3",
    "section": {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m", "width_along": [0, 1, 0]},
    "elastic": {"E": f"{E} Pa", "elements": 4, "shear": {"poisson": 0.3}},
}


def at(*place, **more):
    return {"at": [f"{x} m" for x in place], **more}


def cantilever():
    return symgen.build(
        symgen.Scene(
            points={"O": at(0, 0, 0, ground=True), "P": at(LENGTH, 0, 0)},
            links={"rod": {"points": ["O", "P"], **ROD}},
            welds=[{"point": "O", "links": ["rod"]}],
            gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"-{G} m/s^2"]},
            analysis={"t_end": "0.02 s"},
        )
    )


def test_a_cantilever_in_gravity_stays_at_rest():
    """Its end sinks by mu g L^4/8 E I, and its root has the moment mu g L^2/2."""
    run = cantilever().simulate(0.02, samples=11, initial="quasi-static")
    sunk = MU * G * LENGTH**4 / (8 * E * WIDTH * THICKNESS**3 / 12)
    assert -run["P.position"].values[:, 2] == pytest.approx(np.full(11, sunk), rel=2e-4)
    moments = np.linalg.norm(run["rod.O.moment"].values, axis=1)
    assert moments == pytest.approx(np.full(11, MU * G * LENGTH**2 / 2), rel=1e-3)
    assert np.max(run["kinetic_energy"].values) < 1e-12 * run["strain_energy"].values[0]


def test_a_rotating_rod_starts_with_its_centrifugal_force():
    """N = mu w^2 ((r + L)^2 - (r + x)^2)/2 in a rod on a crank of length r, at x = L/2, all the time."""
    arm, speed = 0.1, 100.0
    scene = symgen.Scene(
        points={"O": at(0, 0, 0, ground=True), "A": at(arm, 0, 0), "P": at(arm + LENGTH, 0, 0)},
        links={"crank": {"points": ["O", "A"], "mass": "0 kg"}, "rod": {"points": ["A", "P"], **ROD}},
        joints=[{"point": "O", "links": ["crank"], "kind": "revolute", "axis": [0, 0, 1]}],
        welds=[{"point": "A", "links": ["rod", "crank"]}],
        parameters={"speed": f"{speed} rad/s"},
        drivers=[{"link": "crank", "angle": "speed*t"}],
        analysis={"t_end": "2*pi/speed"},
    )
    model = symgen.build(scene)
    force = MU * speed**2 * ((arm + LENGTH) ** 2 - (arm + LENGTH / 2) ** 2) / 2
    expected = force / (E * WIDTH * THICKNESS)
    steady, abrupt = (
        model.simulate(0.002, samples=21, initial=state)["rod.axial_strain"].values
        for state in ("quasi-static", "undeformed")
    )
    assert steady == pytest.approx(np.full(21, expected), rel=1e-2)
    assert np.ptp(steady) < 1e-2 * np.ptp(abrupt)


@pytest.mark.parametrize("end", [60.0, 1e-6])
def test_rates_of_a_start_do_not_depend_on_the_duration_of_the_scene(end):
    """A force F sin(w t) at the end of a cantilever of w_1: its rate F w L^3/3 E I, and that of the inertia of this.

    Parts of the longer duration are multiples of its period; those of the shorter one are lost in round-off.
    """
    speed, force = 10 * np.pi, 1.0
    model = build(
        symgen.Scene(
            points={"O": at(0, 0, 0, ground=True), "P": at(LENGTH, 0, 0)},
            links={"rod": {"points": ["O", "P"], **ROD}},
            welds=[{"point": "O", "links": ["rod"]}],
            forces=[{"point": "P", "force": ["0 N", "0 N", "F*sin(speed*t)"]}],
            parameters={"F": f"{force} N", "speed": f"{speed!r} rad/s"},
            analysis={"t_end": f"{end} s"},
        )
    )
    flexible = LENGTH**3 / (3 * E * WIDTH * THICKNESS**3 / 12)
    first = (1.8751 / LENGTH) ** 2 * np.sqrt(E * THICKNESS**2 / (12 * DENSITY))
    expected = force * speed * flexible * (1 + (speed / first) ** 2)
    run = model.simulate(1e-3, samples=3, rtol=0.1, initial="quasi-static")
    assert run["P.position"].values[:, 2] == pytest.approx(expected * run.time, rel=5e-3, abs=1e-8)


@pytest.mark.parametrize("scene", IN_SPACE)
def test_a_quasi_static_start_leaves_few_vibrations(scene):
    """Second differences of a stress are those of vibrations, far above those of the slow motion."""
    model, link = symgen.build(scene), "rod" if scene == "spatial_slider_crank" else "coupler"
    end = 0.1 * 2 * np.pi / model.parameters["rate"]
    rough = {}
    for state in ("undeformed", "quasi-static"):
        values = model.simulate(end, samples=101, initial=state)[f"{link}.bending_strain_y"].values
        rough[state] = np.sqrt(np.mean(np.diff(values, 2) ** 2))
    assert rough["quasi-static"] < rough["undeformed"] / 5


def test_modes_vibrate_freely():
    """The crank is held: a mode decays as exp(-z w t) (cos v t + z w/v sin v t), v = w sqrt(1 - z^2)."""
    model, size = symgen.build("spatial_slider_crank").with_parameters(rate=1e-9), 1e-5
    modes = model.modes()
    w, z = 2 * np.pi * modes.frequencies[0], modes.ratios[0]
    run = model.simulate(2 / modes.frequencies[0], samples=81, initial=[size])
    still = model.simulate(1e-6, samples=2)["rod.position"].values[0]
    moved = run["rod.position"].values - still
    assert np.linalg.norm(moved[0]) == pytest.approx(size, rel=1e-2)
    assert np.max(moved[0]) == np.max(np.abs(moved[0]))
    v = w * np.sqrt(1 - z**2)
    expected = np.exp(-z * w * run.time) * (np.cos(v * run.time) + z * w / v * np.sin(v * run.time))
    assert moved @ moved[0] / (moved[0] @ moved[0]) == pytest.approx(expected, abs=2e-3)
    assert run.provenance["initial"] == (size,)


@pytest.mark.parametrize(
    ("section", "ends", "amplitudes", "expected"),
    [
        # Of a round cantilever every transverse direction has these frequencies: the first is along y.
        ({"diameter": "4 mm"}, "clamped", [1e-3], [0, 9.728e-5, 0]),
        ({"diameter": "4 mm"}, "clamped", [0, 1e-3], [0, 0, 9.728e-5]),
        # sin(2 pi x/L): the half that is displaced to the positive side is the first one.
        (ROD["section"], "pinned", [0, 0, 1e-3], [0, 0, 1e-3]),
        (ROD["section"], "pinned", [0, 0, 0, -1e-3], [0, -1e-3, 0]),
    ],
)
def test_modes_of_one_start_have_signs_and_directions(section, ends, amplitudes, expected):
    """At a quarter of the length, with any number of elements; a cantilever has 0.0973 of its end there.

    This is (cosh b - cos b - s (sinh b - sin b))/2 with b = 1.8751/4, s = 0.7341.
    """
    pinned = ends == "pinned"
    scene = symgen.Scene(
        points={
            "O": at(0, 0, 0, ground=True), "P": at(LENGTH, 0, 0),
            **({x: at(LENGTH + s, 0, 0, ground=True) for x, s in (("B", -0.1), ("C", 0.1))} if pinned else {}),
        },
        links={
            "rod": {"points": ["O", "P"], **ROD, "section": section},
            **({"rail": {"points": ["B", "C"]}} if pinned else {}),
        },
        welds=[] if pinned else [{"point": "O", "links": ["rod"]}],
        joints=[{"point": "O", "links": ["rod"], "kind": "universal", "axis": [0, 0, 1]}] if pinned else [],
        guides=[{"points": ["P"], "along": "rail"}] if pinned else [],
        analysis={"t_end": "0.01 s"},
    )  # fmt: skip
    rigid = build(scene).rigid
    for divided in (1, 2, 3):
        linkage = LinkageInSpace(rigid, divided)
        start = initial(linkage, amplitudes)
        state = (x[None] for x in (start.q, start.v, start.a))
        place = linkage.links[0].resultants(*state, 0.25)[0, -3:] - [LENGTH / 4, 0, 0]
        np.testing.assert_allclose(place, expected, atol=5e-7)


def test_a_run_without_work_has_no_balance_of_powers():
    """Nothing does work on free vibrations without damping: their energy drift is all there is to compare."""
    scene = symgen.Scene(
        points={"O": at(0, 0, 0, ground=True), "P": at(LENGTH, 0, 0)},
        links={"rod": {"points": ["O", "P"], **ROD}},
        welds=[{"point": "O", "links": ["rod"]}],
        analysis={"t_end": "0.01 s"},
    )
    run = build(scene).simulate(1e-3, samples=3, initial=[1e-4])
    assert run.statistics["power_balance"] is None
    assert run.drift.energy < 1e-6 * run.drift.energy_exchanged


def test_the_command_takes_initial_states():
    asked = ("spatial_slider_crank", "--t-end", "1e-3", "--samples", "3", "--json")
    printed = json.loads(call("simulate", *asked, "--initial", "quasi-static"))
    run = symgen.build("spatial_slider_crank").simulate(1e-3, samples=3, initial="quasi-static")
    assert printed["outputs"]["rod.stress"]["final"] == run["rod.stress"].values[-1]


@pytest.mark.parametrize(
    ("initial", "words"),
    [
        ("at rest", "no initial state 'at rest'"),
        ([1e-5] * 500, "amplitudes of at most"),
        ([1.0], "far below the length of the links"),
        ([float("nan")], "amplitudes of modes"),
    ],
)
def test_bad_initial_states(initial, words):
    with pytest.raises(ModelError, match=words):
        symgen.build("spatial_slider_crank").simulate(1e-3, samples=2, initial=initial)


@pytest.mark.parametrize("force", ["F*t/s", "F*sign(t/s)"])
def test_loads_that_move_the_linkage_or_jump_leave_no_quasi_static_shape(force):
    """A rod on a ball joint with a force across it from the start on: nothing holds it."""
    scene = symgen.Scene(
        points={"O": at(0, 0, 0, ground=True), "P": at(LENGTH, 0, 0)},
        links={"rod": {"points": ["O", "P"], **ROD}},
        forces=[{"point": "P", "force": ["0 N", force, "0 N"]}],
        parameters={"F": "0.1 N", "s": "1 s"},
        welds=[{"point": "O", "links": ["rod"]}] if "sign" in force else [],
        analysis={"t_end": "0.01 s"},
    )
    with pytest.raises(ModelError, match="the quasi-static shape has no rate"):
        symgen.build(scene).simulate(1e-3, samples=2, initial="quasi-static")


def test_derivatives_are_those_of_undeformed_starts():
    run = symgen.build("spatial_slider_crank").simulate(1e-4, samples=2, initial="quasi-static")
    with pytest.raises(ModelError, match="those that start undeformed"):
        run.gradient(["rod.stress"])


def test_starts_about_a_distant_equilibrium_are_refused():
    """A horizontal pendulum: the modes of its hanging pose would stretch it."""
    hanging = symgen.Scene(
        points={"O": at(0, 0, 0, ground=True), "P": at(LENGTH, 0, 0)},
        links={"rod": {"points": ["O", "P"], **ROD}},
        joints=[{"point": "O", "kind": "revolute", "links": ["rod"], "axis": [0, 1, 0]}],
        gravity={"acceleration": ["0 m/s^2", "0 m/s^2", f"-{G} m/s^2"]},
        analysis={"t_end": "0.02 s"},
    )
    model = build(hanging)
    for state, words in (([1e-3], "initial modes"), ("quasi-static", "a quasi-static start")):
        with pytest.raises(ModelError, match=f"expected an equilibrium near the drawing for {words}"):
            model.simulate(0.002, samples=2, initial=state)
