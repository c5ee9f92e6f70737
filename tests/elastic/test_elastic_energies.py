"""Energies, powers and greatest stresses of elastic runs, against particles, closed forms, rigid linkages and each other."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor

import mpmath
import numpy as np
import pytest
import shared.elastic_scenes as bars
import sympy as sp
from scipy.integrate import cumulative_simpson, simpson
from scipy.interpolate import make_interp_spline
from shared.elastic_linkages import FT, LBF
from shared.elastic_reference import RIG
from shared.shipped import ELASTIC, IN_SPACE

import symgen
from symgen.mechanics.elastic import hamilton
from symgen.mechanics.elastic.energies import LIFT, energy_weights, rate, rigid_energies
from symgen.mechanics.elastic.places import at_a_place
from symgen.mechanics.elastic.shaft import KINETIC, POWER, RATE, powers
from symgen.runtime.beams.energies import energies, of_joints, of_links
from symgen.runtime.beams.forces import local_motion
from symgen.runtime.elastic import run as run_of_elastic

#: Scenes, the links that are rigid in place of elastic, and bounds of the imbalance of powers, as reported and by
#: differences, at the scene's speed and at resonance: three to ten times what is seen.
BALANCES = {
    ("thesis_four_bar", ""): ((1e-9, 2e-6), (5e-10, 1e-6)),
    ("thesis_rig", ""): ((3e-12, 4e-7), (5e-11, 2e-7)),
    ("elastic_four_bar", ""): ((2e-11, 1e-6), (5e-10, 4e-7)),
    ("elastic_four_bar", "coupler"): ((1e-9, 2e-6), (3e-9, 2e-6)),
    ("elastic_slider_crank", ""): ((4e-12, 3e-8), (1e-8, 3e-6)),
    ("rotating_cantilever", ""): ((5e-9, 1e-5), (4e-8, 5e-6)),
    ("elastic_four_bar_free", ""): ((1e-9, 2e-6), (5e-10, 1e-6)),
    ("elastic_four_bar_motor", ""): ((3e-9, 2e-4), (5e-10, 5e-5)),
    ("elastic_four_bar_motor", "crank coupler"): ((3e-9, 1e-4), (1e-7, 3e-3)),
}
#: Points and lengths of the links of four-bars.
LINKS = {"crank": (["M", "A"], "a"), "coupler": (["A", "B"], "b"), "output": (["B", "Q"], "c")}
#: Torque [N m] at 0 degrees of the four-bar of rigid links at 373 rpm, with bearings.
TORQUE = RIG.motion(0.0).forces["torque"][0] * FT * LBF


def test_every_shipped_scene_is_among_those_whose_powers_balance():
    """``test_power_in_space.py`` has those in space."""
    assert {scene for scene, _ in BALANCES} | {*IN_SPACE} == {*ELASTIC}


def test_energies_of_a_point_of_a_link_are_those_of_a_particle():
    """z = z0(t) + (x + s(t)) exp(i theta(t)) of unit mass in gravity, and the rates of its energies."""
    x, g = mpmath.mpf("0.7"), mpmath.mpc("0.3", "-9.81")

    def direction(t):
        return mpmath.exp(1j * (t**3 - 2 * t))

    def origin(t):
        return mpmath.mpc(t**2, mpmath.sin(t))

    def own(t):
        return mpmath.mpc(t / 50 + t**2, mpmath.cos(3 * t) / 50)

    def place(t):
        return origin(t) + (x + own(t)) * direction(t)

    def energies(t):
        fall = g.real * place(t).real + g.imag * place(t).imag
        return {"kinetic": abs(mpmath.diff(place, t)) ** 2 / 2, "potential": -fall}

    at = mpmath.mpf("0.4")

    def local(z):
        return z * mpmath.conj(direction(at))

    omega, alpha = (mpmath.diff(lambda t: t**3 - 2 * t, at, n) for n in (1, 2))
    velocity, felt = local(mpmath.diff(origin, at)), local(mpmath.diff(origin, at, 2) - g)
    gravity, z0 = local(g), origin(at)
    motion = {
        hamilton.OMEGA: omega, hamilton.OMEGA_RATE: alpha, hamilton.VX: velocity.real, hamilton.VY: velocity.imag,
        hamilton.AX: felt.real, hamilton.AY: felt.imag, hamilton.GX: gravity.real, hamilton.GY: gravity.imag,
        LIFT: g.real * z0.real + g.imag * z0.imag, hamilton.X: x,
    }  # fmt: skip
    values = {q.symbol: sp.Float(str(v), 20) for q, v in motion.items()}
    terms = {name: term.xreplace(values) for name, term in at_a_place().items()}
    terms["centrifugal"] = terms["mass"]
    moved = [mpmath.diff(own, at, n) for n in range(3)]
    columns, none = [sp.Matrix([m.real, m.imag, 0, 0, 0, 0]) for m in moved], sp.zeros(6, 1)
    rigid = rigid_energies((), (), sp.Integer(0), [(values[hamilton.X.symbol], sp.Integer(1), sp.Integer(0))])
    found = {name: [e.xreplace(values), rate(e).xreplace(values)] for name, e in
             ((name.removesuffix("_rigid"), e) for name, e in rigid.items())}  # fmt: skip
    force = local(mpmath.diff(place, at, 2) - g)
    moment = (mpmath.conj(x + own(at)) * force).imag
    work = {"force_x": force.real, "force_y": force.imag, "moment": moment}
    totals = {name: found.pop(name)[0] for name in work}
    for w in energy_weights():
        if w.energy == "strain":
            continue
        constant = terms[w.constant]
        if len(w.orders) == 2:
            i, j = w.orders
            form = (columns[i].T * constant * columns[j])[0]
            change = (
                [*columns, none][i + 1].T * constant * columns[j] + columns[i].T * constant * columns[j + 1]
            )[0]
        else:
            form, change = ((constant.T * column)[0] for column in [*columns, none][w.orders[0] :][:2])
        if w.energy in work:
            totals[w.energy] += w.value.xreplace(values) * form
            continue
        found[w.energy][0] += w.value.xreplace(values) * form
        found[w.energy][1] += w.value.xreplace(values) * change + rate(w.value).xreplace(values) * form
    for name, (energy, change) in found.items():
        assert float(energy) == pytest.approx(float(energies(at)[name]), rel=1e-9)
        assert float(change) == pytest.approx(
            float(mpmath.diff(lambda t, name=name: energies(t)[name], at)), rel=1e-6
        )
    assert {name: float(total) for name, total in totals.items()} == pytest.approx(
        {name: float(value) for name, value in work.items()}, rel=1e-9
    )


def test_rigid_energies_of_a_tapered_link():
    """A rod of mass 2 + 6 x per length of 0.5 m with rotary inertia 0.1, and 3 kg at 0.2 m, about its first point."""
    found = rigid_energies(
        (2, 6), (sp.Rational(1, 10),), sp.Rational(1, 2), [(sp.Rational(1, 5), 3, sp.Rational(1, 4))]
    )
    w, vx, vy, gx = (q.symbol for q in (hamilton.OMEGA, hamilton.VX, hamilton.VY, hamilton.GX))
    mass, moment = 1.75 + 3, 0.25 + 0.25 + 0.6
    second = 2 / 24 + 6 / 64 + 3 * 0.04 + 0.05 + 0.25
    at = {w: 2.0, vx: 0.3, vy: -0.4, gx: 5.0, hamilton.GY.symbol: 1.0, LIFT.symbol: 7.0}
    expected = mass * 0.25 / 2 + moment * 2 * -0.4 + second * 4 / 2
    assert float(found["kinetic_rigid"].subs(at)) == pytest.approx(expected, rel=1e-12)
    assert float(found["potential_rigid"].subs(at)) == pytest.approx(-7 * mass - 5 * moment, rel=1e-12)


def test_energy_and_power_of_a_shaft_with_a_motor():
    """Those of I (omega + phi')^2 / 2 and T (omega + phi'), with T to first order in phi."""
    inertia, omega, alpha, phi, phi_t, phi_tt = 0.3, 4.0, -1.5, 0.02, 0.3, -2.0
    angle, speed = sp.symbols("angle speed", real=True)
    torque = 5 * sp.cos(angle) - speed**2 / 5
    at = {angle: 0.8, speed: omega, hamilton.OMEGA.symbol: omega, hamilton.OMEGA_RATE.symbol: alpha}
    factors = powers(sp.Float(inertia), torque, angle, speed)
    by = {"": phi, "t": phi_t, "tt": phi_tt}
    found = [
        sum(float(f.xreplace(at)) * float(np.prod([by[k] for k in m])) for f, m in zip(factors[name], of, strict=True))
        for name, of in (("kinetic", KINETIC), ("rate", RATE), ("power", POWER))
    ]  # fmt: skip
    torque_then = 5 * np.cos(0.8) - 16 / 5 - 5 * np.sin(0.8) * phi - 2 * omega / 5 * phi_t
    turned, faster = omega + phi_t, alpha + phi_tt
    assert found == pytest.approx([inertia * turned**2 / 2, inertia * turned * faster, torque_then * turned])


def test_power_of_a_motor_keeps_the_sum_of_its_torque():
    """T omega, T + omega dT/d omega and dT/d omega of a torque that falls with the speed, without a common denominator."""
    stall, still, angle, speed = sp.symbols("stall still angle speed", real=True)
    torque, omega = stall * (1 - speed / still), hamilton.OMEGA.symbol
    power = dict(zip(POWER, powers(sp.S.Zero, torque, angle, speed)["power"], strict=True))
    assert power[()] == torque * omega
    assert power["t",] == torque - stall / still * omega
    assert power["t", "t"] == -stall / still


def test_rigid_motion_needs_the_torque_of_the_rigid_linkage():
    """At the start, without deflection: the rates of all kinetic energies, and the energy of the rigid linkage."""
    model = symgen.build("thesis_four_bar")
    motion = model.motion(True)
    equations, none = motion.equations(), np.zeros((1, motion.layout.unknowns))
    q, u, solutions = motion.rigid_motion(equations, np.zeros(1))[0]
    links, _ = of_links(motion, np.zeros(1), q, u, solutions)
    joints, _, power, *_ = of_joints(motion, np.zeros(1), (q, u, solutions), (none, none, none))
    rates = sum(x["kinetic_rigid_rate"][0] for x in links) - power[0]
    assert rates == pytest.approx(TORQUE * motion.speed, rel=1e-9)
    whole = motion.rigid.evaluator.blocks("energy", 0.0, q[0], u[0])["kinetic_energy"]
    kinetic = sum(x["kinetic_rigid"][0] for x in links) + joints[0]
    assert kinetic == pytest.approx(float(whole[0]), rel=1e-12)


@pytest.mark.parametrize("speed", ["given", "second resonance"])
@pytest.mark.parametrize(("scene", "rigid"), BALANCES)
def test_imbalance_of_powers_is_as_reported(scene, rigid, speed):
    """The rate of the energies by differences: power of the shaft and omitted power = dissipation + rate."""
    section = {"width": "width", "thickness": "thickness"}
    tables = {
        f"links.{k}": {
            "points": LINKS[k][0],
            "length": LINKS[k][1],
            "density": "density",
            "section": section,
        }
        for k in rigid.split()
    }
    model = symgen.build(scene, set=tables)
    assert not {b.info.link for b in model.beams} & {*rigid.split()}
    if speed != "given":
        model = model.with_parameters(speed=2 * np.pi * float(model.modes().frequencies[1]))
    run = model.simulate(revolutions=0.005, samples=121, steps=1)
    names = {v.name for v in run.variables}
    energy = sum(run[f"{name}_energy"].values for name in ("kinetic", "strain", "potential"))
    change = make_interp_spline(run.times, energy, k=7).derivative()(run.times)
    shaft, omitted = (run[x].values if x in names else 0.0 for x in ("shaft_power", "omitted_power"))
    lost = run["dissipated_power"].values
    mode = model.rigid.description.elastic.mode
    assert ("shaft_power" in names) == (mode != "free")
    assert ("omitted_power" in names) == (mode != "held")
    assert np.all(lost >= 0.0)
    largest = max(np.max(np.abs(part)) for part in (shaft, lost, change))
    reported, differences = BALANCES[scene, rigid][speed != "given"]
    assert run.statistics["power_balance"] < reported
    assert np.max(np.abs(shaft + omitted - lost - change)[8:-8]) < differences * largest
    if mode != "held":
        assert run.statistics["omitted_power"] == pytest.approx(np.max(np.abs(omitted)) / largest, rel=1e-2)
    if mode == "motor" and "crank" in rigid:
        x, y = run["A.position"].values.T
        turned = make_interp_spline(run.times, np.unwrap(np.arctan2(y, x)), k=5).derivative()(run.times)
        torque = 10 * FT * LBF * (1.0 - turned / model.parameters["speed"])
        assert shaft[8:-8] == pytest.approx((torque * turned)[8:-8], abs=1e-4 * np.max(np.abs(shaft)))


def test_energies_of_a_slow_crank_in_gravity():
    """A bar of weight q L, clamped to its shaft: q^2 L^5 cos^2 / 40 E I + q^2 L^3 sin^2 / 6 E A, and its height."""
    modulus, density, length, side, speed = 2e11, 7800.0, 0.5, 0.01, 0.5
    elastic = {"E": f"{modulus} Pa", "elements": 2, "damping": {"stiffness": "1e-3 s"}}
    scene = symgen.Scene(
        points={
            "O": {"at": ["0.2 m", "0.1 m"], "ground": True},
            "A": {"at": [f"{0.2 + length} m", "0.1 m"]},
        },
        links={
            "crank": {
                "points": ["O", "A"],
                "density": f"{density} kg/m^3",
                "section": {"width": f"{side} m", "thickness": f"{side} m"},
                "elastic": elastic,
            }
        },
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        crank={"link": "crank", "speed": f"{speed} rad/s"},
        analysis={"outputs": ["strain_energy", "potential_energy", "dissipated_power"]},
    )
    run = symgen.build(scene).periodic(samples=25, steps=48)
    angle, area, load = run["angle"].values, side**2, density * side**2 * 9.81
    bent = load**2 * length**5 / (40 * modulus * side**4 / 12)
    stretched = load**2 * length**3 / (6 * modulus * area)
    strain = bent * np.cos(angle) ** 2 + stretched * np.sin(angle) ** 2
    assert run["strain_energy"].values == pytest.approx(strain, rel=1e-3, abs=4e-3 * bent)
    lifted = load * length * (0.1 + length / 2 * np.sin(angle)) - 2 * strain
    assert run["potential_energy"].values == pytest.approx(lifted, abs=4e-3 * 2 * bent)
    lost = 1e-3 * speed**2 * (2 * bent * np.sin(angle) ** 2 + 2 * stretched * np.cos(angle) ** 2)
    assert run["dissipated_power"].values == pytest.approx(lost, rel=5e-3, abs=5e-3 * np.max(lost))
    assert [v.name for v in run.variables] == ["strain_energy", "potential_energy", "dissipated_power"]


def test_torque_of_a_crank_alone_is_the_moment_of_its_displaced_particles(tmp_path, monkeypatch):
    """Particles at (x + u - int w'^2/2, w) of a strip in gravity on a shaft of constant speed, by Taylor's formula."""
    taken = {}

    def kept(motion, rigid, found, accelerations, acting):
        taken.update(motion=motion, found=found, accelerations=accelerations)
        return energies(motion, rigid, found, accelerations, acting)

    monkeypatch.setattr(run_of_elastic, "energies", kept)
    speed = 12.0
    bars.cantilever(tmp_path, ", elements = 2", speed=f"{speed} rad/s", height="5 mm")
    file = tmp_path / "heavy.toml"
    file.write_text((tmp_path / "scene.toml").read_text() + WEIGHT)
    run = symgen.build(str(file)).simulate(steps=4000, revolutions=0.02, samples=11)
    first, _ = run["bar.torque"].values, run["kinetic_energy"]
    motion, found = taken["motion"], taken["found"]
    places = np.linspace(0.0, 1.0, 2001)
    rows = motion.beams[0].table(places.tolist())
    states = local_motion(motion, found, taken["accelerations"], 0)
    u, w, slope = ([x @ rows[name].T for x in states] for name in ("u", "w", "slope"))
    shorter = [slope[0] ** 2 / 2, slope[0] * slope[1], slope[1] ** 2 + slope[0] * slope[2]]
    shorter = [cumulative_simpson(x, x=places, axis=1, initial=0.0) for x in shorter]
    angle = motion.angle_at(found.times)[:, None]
    weight = -9.81 * np.sin(angle), -9.81 * np.cos(angle)

    def moment(size):
        x, x_t, x_tt = (size * a - size**2 * b for a, b in zip(u, shorter, strict=True))
        y, y_t, y_tt = (size * a for a in w)
        x = places + x
        along = x_tt - 2 * speed * y_t - speed**2 * x - weight[0]
        across = y_tt + 2 * speed * x_t - speed**2 * y - weight[1]
        return bars.RHO * bars.WIDTH * 5e-3 * simpson(x * across - y * along, x=places, axis=1)

    down, still, up = moment(-0.01), moment(0.0), moment(0.01)
    expected = still + (up - down) / 0.02 + (up + down - 2 * still) / 0.02**2 * 2
    assert np.max(np.abs(expected - first)) > 1e-3 * np.max(np.abs(expected))
    torque = run["shaft_power"].values / speed
    assert torque == pytest.approx(expected, abs=1e-7 * np.max(np.abs(expected)))


WEIGHT = '[gravity]\nacceleration = ["0 m/s^2", "-9.81 m/s^2"]\n'


@pytest.mark.parametrize(("kind", "factor", "place"), [("cantilever", 1 / 2, 0.0), ("pinned", 1 / 8, 0.5)])
def test_greatest_stress_of_a_bar_under_its_own_weight(tmp_path, kind, factor, place):
    """q L^2 / 2 over the section modulus at a clamp, q L^2 / 8 in the middle between pins."""
    getattr(bars, kind)(tmp_path, ", elements = 2")
    file = tmp_path / "heavy.toml"
    file.write_text((tmp_path / "scene.toml").read_text() + WEIGHT)
    found = symgen.build(str(file)).quasi_static()
    load = bars.RHO * bars.AREA * 9.81
    expected = factor * load * bars.LENGTH**2 / (bars.WIDTH * bars.HEIGHT**2 / 6)
    assert found["bar.greatest_stress"].values == pytest.approx(expected, rel=2e-3)
    assert found["bar.greatest_stress_at"].values == pytest.approx(place, abs=0.02)


def test_greatest_stress_where_elements_of_different_moments_meet(tmp_path):
    """Cubic elements under a load q are exact at nodes; the moment at their ends is q h^2 / 12 too high."""
    bars.pinned(tmp_path, ', element = "cubic", elements = 1')
    text = (tmp_path / "scene.toml").read_text()
    assert "[links]\n" in text
    text = text.replace("[links]\n", 'X = { on = "bar", fraction = 0.6 }\n[links]\n', 1)
    file = tmp_path / "two.toml"
    file.write_text(text + WEIGHT + '[[masses]]\npoint = "X"\nmass = "1e-12 kg"\n')
    found = symgen.build(str(file)).quasi_static()
    load = bars.RHO * bars.AREA * 9.81 * bars.LENGTH**2
    expected = load * (0.6 * 0.4 / 2 + 0.6**2 / 12) / (bars.WIDTH * bars.HEIGHT**2 / 6)
    assert found["bar.greatest_stress"].values == pytest.approx(expected, rel=1e-9)
    assert found["bar.greatest_stress_at"].values == pytest.approx(0.6, abs=1e-12)


@pytest.mark.parametrize("scene", ["elastic_four_bar_motor", "elastic_slider_crank"])
def test_parts_of_a_result_are_the_same_to_the_bit_whichever_is_read_first(scene):
    """They are computed when they are read, from poses each of which is found from the one before."""
    model = symgen.build(scene)
    runs = [model.simulate(method="newmark", steps=90, samples=31) for _ in range(3)]
    assert not {"variables", "notes", "statistics"} & {*vars(runs[0])}
    _ = runs[1].notes, runs[2].mesh_error, runs[2].statistics
    assert pickle.loads(pickle.dumps(runs[0].statistics))["error"] > 0.0
    first, *others = [pickle.loads(pickle.dumps(run)) for run in runs]
    for other in others:
        assert other.notes == first.notes
        assert {**other.statistics, "wall_s": 0} == {**first.statistics, "wall_s": 0}
        for name in first:
            assert other.variable(name).values.tobytes() == first.variable(name).values.tobytes()


def test_threads_that_read_a_result_find_the_same_bits():
    """From Python 3.12 on cached properties have no lock of their own."""
    model = symgen.build("elastic_slider_crank")
    first, *others = [model.simulate(method="newmark", steps=360) for _ in range(4)]
    parts = "variables", "statistics", "notes", "mesh_error"
    for run in others:
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(lambda part, run=run: pickle.dumps(getattr(run, part)), parts))
        assert {**run.statistics, "wall_s": 0} == {**first.statistics, "wall_s": 0}
        for name in first:
            assert run.variable(name).values.tobytes() == first.variable(name).values.tobytes()
