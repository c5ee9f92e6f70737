"""Forward dynamics of loops against an integration of the independent vector model by another method."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from shared.crank_vectors import Crank, Jet
from shared.inches import in_inches
from shared.jets import Real
from shared.loop_scenes import crank_scene, guess_of

import symgen

A4, ALPHA4 = 20.0, np.deg2rad(250.0)
SAMPLES = 21
GENERAL = Crank(
    a4=A4,
    alpha4=ALPHA4,
    rod_centre=(-22.0, 1.5, -0.75),
    rod_inertia=np.array([[2.0, -0.6, 0.4], [-0.6, 25.0, 0.7], [0.4, 0.7, 26.0]]),
    gravity=(0.0, -386.4, 0.0),
)
EFFORTS = ("theta1.drive", "S1.drive", "spin.drive")


class Free:
    """The vector model with some of theta1, S1 and the rod's spin free: efforts are linear in accelerations.

    The torque about the line of the balls has to be zero; the others are those of the drives.
    """

    def __init__(self, crank, free, fixed, efforts):
        self.crank, self.free, self.fixed, self.efforts = crank, free, fixed, efforts

    def motion(self, q, u, a):
        """All columns at once: ``a`` has one row a case."""
        n = len(a)
        moves = {}
        for i, name in enumerate(("theta1", "S1", "spin")):
            if i in self.free:
                k = self.free.index(i)
                moves[name] = Jet(np.full(n, q[k]), np.full(n, u[k]), a[:, k])
            else:
                moves[name] = Jet(np.full(n, self.fixed[i]))
        return self.crank.motion(**moves)

    def __call__(self, t, state):
        n = len(self.free)
        q, u = state[:n], state[n:]
        cases = np.vstack([np.zeros(n), np.eye(n)])
        found = self.motion(q, u, cases).forces(S4_drive=Real(0))
        needed = np.array([found[EFFORTS[i]] for i in self.free], dtype=float)
        matrix = needed[:, 1:] - needed[:, :1]
        return np.concatenate([u, np.linalg.solve(matrix, self.efforts(t, q, u) - needed[:, 0])])

    def energy(self, q, u):
        """Kinetic energy, and potential energy of the weights."""
        moved = self.motion(q, u, np.zeros((1, len(q))))
        m1, m2, m3 = self.crank.masses
        centre1 = moved.p2 - moved.frame2[..., 0] * (Real(self.crank.a1) / 2)
        centre2, _ = moved.rod()
        weights = zip((m1, m2, m3), (centre1, centre2, moved.p3), strict=True)
        gravity = np.array(self.crank.gravity, dtype=Real)
        potential = -sum(m * c.value[0] @ gravity for m, c in weights)
        return float(moved.kinetic_energy()[0]), float(potential)


def integrated(model, q, u, t_end):
    times = np.linspace(0, t_end, SAMPLES)
    run = solve_ivp(model, (0, t_end), [*q, *u], "DOP853", times, rtol=1e-12, atol=1e-12)
    assert run.success
    n = len(q)
    return run.y[:n], run.y[n:]


def agrees(run, names, q, u, tolerance=1e-9):
    for i, name in enumerate(names):
        for recorded, expected in ((name, q[i]), (f"{name}.rate", u[i])):
            values = run.variable(recorded).values
            assert np.max(np.abs(values - expected)) <= tolerance * max(1.0, np.max(np.abs(expected)))


def same_energy(run, model, q, u, tolerance=1e-9):
    expected = np.array([model.energy(q[:, i], u[:, i]) for i in range(q.shape[1])])
    kinetic = run.variable("kinetic_energy").values
    assert np.max(np.abs(kinetic - expected[:, 0])) <= tolerance * np.max(expected[:, 0])
    if np.any(expected[:, 1]):
        potential = run.variable("potential_energy").values - expected[:, 1]
        assert np.ptp(potential) <= tolerance * np.max(np.abs(expected[:, 1]))


def run_of(scene, t_end, method):
    model = symgen.build(scene)
    return in_inches(model.simulate(t_end=t_end, method=method, rtol=1e-12, atol=1e-14, samples=SAMPLES))


both = pytest.mark.parametrize("method", ["dop853", "taylor"])


@both
def test_crank_torque_given(method):
    """A constant torque on the crank: its work is the kinetic energy."""
    crank = Crank(a4=A4, alpha4=ALPHA4)
    model = Free(crank, (0,), (0, 3.5, 0), lambda t, q, u: np.array([40.0]))
    t_end = 0.15
    q, u = integrated(model, [0.75], [5.0], t_end)
    scene = crank_scene(
        crank,
        S1="3.5 in",
        guess=guess_of(crank.motion(Jet([0.75]), Jet([3.5]))),
        free={"theta1": {"at": "0.75", "rate": "5 rad/s"}},
        drives={"theta1": "40 lbf*in"},
        outputs=["theta1", "theta1.rate", "S4", "kinetic_energy", "power", "crank.joint1.force"],
    )
    run = run_of(scene, t_end, method)
    agrees(run, ["theta1"], q, u)
    same_energy(run, model, q, u)
    kinetic, angle = run.variable("kinetic_energy").values, run.variable("theta1").values
    work = 40.0 * (angle - angle[0])
    assert np.max(np.abs(kinetic - kinetic[0] - work)) <= 1e-9 * np.max(kinetic)
    # and the forces while it moves so: the thrust on the guide of the crank's shaft included
    for i in (0, SAMPLES // 2, SAMPLES - 1):
        rate = model(0.0, np.array([q[0, i], u[0, i]]))
        expected = model.motion(q[:, i], u[:, i], rate[None, 1:]).forces(S4_drive=Real(0))
        assert expected["theta1.drive"][0] == pytest.approx(40.0, rel=1e-11)
        found = run.variable("crank.joint1.force").values[i]
        assert np.allclose(found, expected["F1"][0].astype(float), rtol=1e-8, atol=1e-7)


@both
def test_crank_and_its_shaft_free_on_a_spring(method):
    """Two free coordinates in one joint; S1 against a spring and a damper."""
    crank = Crank(a4=A4, alpha4=ALPHA4, gravity=(0.0, -386.4, 0.0))
    t_end = 0.15

    def efforts(t, q, u):
        return np.array([30.0 * np.cos(3 * t), -8.0 * q[1] - 0.05 * u[1]])

    model = Free(crank, (0, 1), (0, 0, 0), efforts)
    q, u = integrated(model, [0.75, 3.0], [8.0, 0.0], t_end)
    scene = crank_scene(
        crank,
        S1="S1",
        guess=guess_of(crank.motion(Jet([0.75]), Jet([3.0]))),
        free={"theta1": {"at": "0.75", "rate": "8 rad/s"}, "S1": {"at": "3 in", "rate": "0 in/s"}},
        drives={"theta1": "torque*cos(w*t)", "S1": "-stiffness*S1 - damping*S1.rate"},
        parameters={
            "torque": "30 lbf*in",
            "w": "3 rad/s",
            "stiffness": "8 lbf/in",
            "damping": "0.05 lbf*s/in",
        },
        gravity=np.array(crank.gravity) * 0.0254,
        outputs=["theta1", "theta1.rate", "S1", "S1.rate", "kinetic_energy", "potential_energy"],
    )
    run = run_of(scene, t_end, method)
    agrees(run, ["theta1", "S1"], q, u)
    same_energy(run, model, q, u)


@both
def test_spin_of_a_general_rod_is_a_coordinate(method):
    """An unsymmetrical rod between two balls swings about their line; no drive, so the energy stays."""
    t_end = 0.15
    model = Free(GENERAL, (0, 2), (0, 2.0, 0), lambda t, q, u: np.zeros(2))
    q, u = integrated(model, [0.75, 0.3], [8.0, -1.0], t_end)
    assert np.ptp(u[1]) > 0.3
    scene = crank_scene(
        GENERAL,
        S1="2 in",
        spin="spin",
        guess=guess_of(GENERAL.motion(Jet([0.75]), Jet([2.0]), Jet([0.3]))),
        free={"theta1": {"at": "0.75", "rate": "8 rad/s"}, "spin": {"at": "0.3", "rate": "-1 rad/s"}},
        gravity=np.array(GENERAL.gravity) * 0.0254,
        outputs=[
            "theta1",
            "theta1.rate",
            "spin",
            "spin.rate",
            "kinetic_energy",
            "potential_energy",
            "energy",
        ],
    )
    run = run_of(scene, t_end, method)
    agrees(run, ["theta1", "spin"], q, u)
    same_energy(run, model, q, u)
    energy = run.variable("energy").values
    assert np.ptp(energy) <= 1e-9 * np.max(run.variable("kinetic_energy").values)


def test_inertia_is_twice_the_energy_at_unit_speed():
    """Of the reference itself: Eksergian's reduced inertia, from energy and from forces."""
    crank = Crank(a4=A4, alpha4=ALPHA4)
    angles = np.linspace(0, 6, 13)
    held = Jet(np.full(13, 3.5))
    energy = crank.motion(Jet(angles, 1.0), held).kinetic_energy()
    efforts = [crank.motion(Jet(angles, 1.0, a), held).forces()["theta1.drive"] for a in (0.0, 1.0)]
    assert np.allclose((efforts[1] - efforts[0]).astype(float), (2 * energy).astype(float), rtol=1e-13)
