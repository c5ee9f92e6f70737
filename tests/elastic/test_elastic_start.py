"""Runs that start from the quasi-static shape, against closed forms and the motion without vibration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared import elastic_scenes as bars

import symgen
from symgen.errors import ModelError
from symgen.runtime import _beams
from symgen.runtime.elastic.static import quasi_static

CASES = Path(__file__).parents[1] / "cases"

WEIGHT = '[gravity]\nacceleration = ["0 m/s^2", "-9.81 m/s^2"]\n[analysis]\nt_end = "0.1 s"\n'
LOAD = bars.RHO * bars.AREA * 9.81
SAG = LOAD * bars.LENGTH**4 / (8 * bars.E * bars.INERTIA)


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    return bars.cantilever(tmp_path_factory.mktemp("heavy"), ", elements = 1", more=WEIGHT)


def test_shapes_do_not_depend_on_the_way_to_their_pose():
    """Near a flat pose, where entries of stretching exceed those of bending 10,000 times."""
    motion = symgen.build("elastic_four_bar").motion(True)
    times = motion.period * np.array([0.0, 0.004, 0.983, 0.992])
    first = quasi_static(motion, motion.equations(), times)
    for t, shape in zip(times, first, strict=True):
        equations = motion.equations()
        equations.matrices(0.517 * motion.period - t, _beams.QUASI_STATIC)
        again = quasi_static(motion, equations, np.array([t]))[0]
        assert np.max(np.abs(again - shape)) < 1e-13 * np.max(np.abs(shape))


@pytest.mark.parametrize("method", ["gauss", "newmark", "dop853"])
def test_a_cantilever_stays_in_its_static_shape(heavy, method):
    options = {"rtol": 1e-3} if method != "newmark" else {"steps": 400}
    run = heavy.simulate(method=method, initial="quasi-static", samples=21, **options)
    tip = run["tip.displacement"].values[:, 1]
    assert tip == pytest.approx(-SAG, rel=1e-6)
    assert run["kinetic_energy"].values == pytest.approx(0, abs=1e-9 * np.max(run["strain_energy"].values))


def test_undeformed_it_overshoots_to_twice_the_sag(heavy):
    tip = heavy.simulate(rtol=1e-3, samples=201)["tip.displacement"].values[:, 1]
    assert tip[0] == 0 and np.min(tip) < -1.8 * SAG


def test_a_rotating_strip_starts_with_the_rates_of_its_stretch(tmp_path):
    """Stretched by its rotation, with nothing to vibrate but the centrifugal force of the stretch itself."""
    speed = 20.0
    model = bars.cantilever(tmp_path, ", elements = 2", speed=f"{speed} rad/s")
    run = model.simulate(initial="quasi-static", steps=2000, samples=41, revolutions=0.1)
    change = run["bar.length_change"].values
    still = bars.RHO * speed**2 * bars.LENGTH**3 / (3 * bars.E)
    # The square of the speed over that of the first frequency of stretching.
    vibrates = speed**2 * bars.RHO / bars.E * (2 * bars.LENGTH / np.pi) ** 2
    assert change == pytest.approx(still, rel=3 * vibrates + 1e-7)
    tip, angle = run["tip.displacement"].values, run.coordinate.values
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    assert tip == pytest.approx(still * along, abs=1e-4 * still)


@pytest.mark.parametrize("t_end", ["1 s", "1000 s"])
def test_rates_follow_a_load_however_long_the_run(tmp_path, t_end):
    """Of a tip force F sin(w t): F w L^3 / (3 E I), at the start."""
    load = '[parameters]\nw = "12.6 rad/s"\nF = "1 N"\n[[forces]]\npoint = "tip"\nforce = ["0 N", "F*sin(w*t)"]\n'
    model = bars.cantilever(tmp_path, ", elements = 1", more=f'{load}[analysis]\nt_end = "{t_end}"\n')
    run = model.simulate(initial="quasi-static", t_eval=[0.0, 1e-7], steps=10, t_end=1e-6)
    tip = run["tip.displacement"].values[:, 1]
    exact = 12.6 * bars.LENGTH**3 / (3 * bars.E * bars.INERTIA)
    assert (tip[1] - tip[0]) / 1e-7 == pytest.approx(exact, rel=1e-3)


def test_loads_that_jump_at_the_start_have_no_quasi_static_rates(tmp_path):
    load = '[parameters]\nw = "1 rad/s"\nF = "1 N"\n[[forces]]\npoint = "tip"\nforce = ["0 N", "F*sign(w*t)"]\n[analysis]\nt_end = "1 s"\n'
    model = bars.cantilever(tmp_path, ", elements = 1", more=load)
    with pytest.raises(ModelError, match="the loads jump at the start"):
        model.simulate(initial="quasi-static")


def test_an_unknown_start_is_refused(heavy):
    with pytest.raises(ModelError, match="no initial state 'static' of elastic links"):
        heavy.simulate(initial="static")


def test_a_free_crank_has_no_quasi_static_shape():
    model = symgen.build("elastic_four_bar_free")
    with pytest.raises(ModelError, match="its crank is free, so that loads"):
        model.simulate(initial="quasi-static", revolutions=0.01)
    with pytest.raises(ModelError, match="its crank is free, so that loads"):
        model.quasi_static()


def test_release_from_modes(tmp_path):
    """A cantilever at rest swings in both modes at once, w = a cos(w1 t) + b cos(w2 t) at its tip."""
    model = bars.cantilever(tmp_path, ", elements = 3", more='[analysis]\nt_end = "0.1 s"\n')
    a, b = 2e-3, -3e-4
    run = model.simulate(initial=[a, b], rtol=1e-7, samples=31, t_end=0.05)
    roots, t = np.array([1.8751040687, 4.6940911330]), run.coordinate.values
    speeds = roots**2 * np.sqrt(bars.E * bars.INERTIA / (bars.RHO * bars.AREA)) / bars.LENGTH**2
    expected = a * np.cos(speeds[0] * t) + b * np.cos(speeds[1] * t)
    assert np.abs(run["tip.displacement"].values[:, 1] - expected).max() < 1e-5 * a
    # Largest displacements of one at the tip: the modal masses are a quarter of the mass.
    energy = bars.RHO * bars.AREA * bars.LENGTH / 8 * (speeds**2 @ [a**2, b**2])
    total = run["kinetic_energy"].values + run["strain_energy"].values
    assert total == pytest.approx(energy, rel=1e-5)
    assert run.mesh_error < 4 / 3 * 1e-3  # four thirds of the change by halved elements


def test_modes_are_carried_along_by_the_rigid_motion(tmp_path):
    """At the start nothing moves relative to a strip that rotates."""
    model = bars.cantilever(tmp_path, ", elements = 2", speed="20 rad/s")
    times = [0.0, 1e-6, 2e-6]
    run = model.simulate(initial=[1e-3], steps=2000, t_eval=times, t_end=2e-6)
    deflection = run["bar.deflection"].values
    displacement = run["tip.displacement"].values
    assert displacement[0] == pytest.approx([0.0, 1e-3], abs=1e-12)
    with pytest.raises(ModelError, match=r"far below the length of the links, .* m, got 1e\+300 m"):
        model.simulate(initial=[1e300])
    # The tip turns with the strip, and no faster.
    rate = np.array([-3.0, 4.0, -1.0]) @ displacement[:, 0] / 2e-6
    assert rate == pytest.approx(-20.0 * 1e-3, rel=1e-4)
    assert abs(deflection[1] - deflection[0]) < 1e-6 * abs(deflection[0])


@pytest.mark.parametrize(
    ("given", "words"),
    [([0.0] * 9, "at most 4 modes"), ([float("nan")], "finite numbers"), ("bent", "no initial")],
)
def test_bad_initial_states(heavy, given, words):
    with pytest.raises(ModelError, match=words):
        heavy.simulate(initial=given)


def hanging_bar_axial_force(end, steps=2000):
    """Return the axial force [N] at the middle of the bar of ``elastic_hanging_bar``, rigid, by plain RK4.

    theta'' = -3/(2 L) (a . t), with a the acceleration of the pivot less gravity and t across the bar.
    """
    crank, speed, length, gravity = 0.1, 20 * np.pi / 30, 0.5, np.array([0.0, -9.81])
    mass = 7850 * 0.015 * 0.003 * length

    def felt(t):
        return -crank * speed**2 * np.array([np.cos(speed * t), np.sin(speed * t)]) - gravity

    def rates(t, y):
        return np.array([y[1], -1.5 / length * (felt(t) @ [-np.sin(y[0]), np.cos(y[0])])])

    # The bar begins with the velocities of least kinetic energy: the pivot moves up, the bar along itself.
    y, h, found = np.array([-np.pi / 2, 0.0]), end / steps, []
    for k in range(steps + 1):
        t = k * h
        along = np.array([np.cos(y[0]), np.sin(y[0])])
        found.append(-mass / 2 * (felt(t) @ along - y[1] ** 2 * 0.75 * length))
        k1 = rates(t, y)
        k2 = rates(t + h / 2, y + h / 2 * k1)
        k3 = rates(t + h / 2, y + h / 2 * k2)
        k4 = rates(t + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(found)


def test_coordinates_that_the_crank_does_not_determine():
    """Joint forces of a hanging elastic bar came to four times its weight, with an error estimate of 1e-6."""
    model = symgen.build(CASES / "elastic_hanging_bar.toml")
    for analysis in (lambda: model.simulate(method="newmark"), model.periodic):
        with pytest.raises(
            ModelError, match="does not determine the rigid motion of B.*\n.*symgen large-rotation"
        ):
            analysis()
    with pytest.raises(ModelError, match="rigid motion of B"):
        symgen.build(CASES / "elastic_chain.toml").quasi_static()
    run = model.large_rotation(elements=4, revolutions=0.5, samples=2001, rtol=1e-6)
    force = run["bar.axial_strain"].values * 210e9 * 0.015 * 0.003
    expected = hanging_bar_axial_force(float(run.time[-1]))
    # Its weight, put on at once, stretches it to twice the force at rest, about which it vibrates undamped.
    assert np.mean(force) == pytest.approx(np.mean(expected), rel=2e-3)
    assert np.max(force) < 2.3 * np.max(expected)
    assert np.max(np.abs(run["B.displacement"].values)) < 1e-3
