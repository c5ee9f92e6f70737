"""Loops at change points, where all links of a parallelogram are in one line."""

from __future__ import annotations

from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import symgen

CASES = Path(__file__).parents[2] / "cases"


class Antiparallelogram:
    """The linkage of par4.toml and free_par.toml: cranks of 10 cm at O and 30 cm to its left, coupler 30 cm.

    On the branch in which the cranks turn against each other, tan(psi/2) = -tan(q/2)/2.
    """

    @staticmethod
    def inertia(q):
        """The kinetic energy at a rate q' = 1 is half of this [kg m^2]."""
        c = -mp.mpf(1) / 2
        psi, rate = (
            2 * mp.atan2(c * mp.sin(q / 2), mp.cos(q / 2)),
            c / (mp.cos(q / 2) ** 2 + (c * mp.sin(q / 2)) ** 2),
        )
        a, b = mp.expj(q) / 10, mp.expj(psi) / 10 - mp.mpf(3) / 10
        va, vb = mp.mpc(0, 1) * mp.expj(q) / 10, mp.mpc(0, rate) * mp.expj(psi) / 10
        assert abs(abs(a - b) - mp.mpf(3) / 10) < 1e-14
        turning = (mp.conj(a - b) * (va - vb)).imag / mp.mpf("0.09")
        rods = abs(va / 2) ** 2 + abs(vb / 2) ** 2 + 3 * abs((va + vb) / 2) ** 2
        return rods + mp.mpf("8e-4") * (1 + rate**2) + mp.mpf("225e-4") * turning**2

    @staticmethod
    def potential(q):
        psi = 2 * mp.atan2(-mp.sin(q / 2) / 2, mp.cos(q / 2))
        return mp.mpf("9.81") * (2 * mp.sin(q) + 2 * mp.sin(psi)) / 10

    def torque(self, q, rate=0):
        """The torque that keeps the crank at a constant rate [N m]."""
        step = mp.mpf(10) ** -6
        return mp.diff(self.potential, q, h=step) + rate**2 / 2 * mp.diff(self.inertia, q, h=step)


def test_forces_near_a_change_point():
    """The drive of a parallelogram of 10 and 30 cm near 180 deg, where all its links are in one line."""
    model, exact = symgen.build(CASES / "par4.toml"), Antiparallelogram()
    degrees = np.array([170, 179, 179.9, 179.99, 179.999, 179.9999, 180.0001, 180.001, 180.1])
    turn = model.inverse_dynamics(at=np.radians(degrees))
    with mp.workdps(40):
        expected = [float(exact.torque(mp.radians(mp.mpf(x)), 2 * mp.pi)) for x in degrees.tolist()]
    assert turn.variable("q.drive").values == pytest.approx(expected, rel=1e-8)
    assert not any("rounding" in note for note in turn.notes)
    through = model.inverse_dynamics(*np.radians([179.9, 180.1]), samples=57, through=True)
    with mp.workdps(40):
        expected = [float(exact.torque(mp.mpf(x), 2 * mp.pi)) for x in through.coordinate.values]
    known = ~np.isnan(through.variable("q.drive").values)
    assert np.sum(known) > 50
    assert through.variable("q.drive").values[known] == pytest.approx(np.array(expected)[known], rel=1e-8)


@pytest.mark.parametrize("method", ["dop853", "taylor"])
def test_free_loops_pass_change_points_with_a_note(method):
    """A released parallelogram swings through 180 deg; by its reduced equation, I q'' + I' q'^2/2 + V' = 0."""
    model, exact = symgen.build(CASES / "free_par.toml"), Antiparallelogram()

    def motion(_, y):
        inertia = float(exact.inertia(mp.mpf(y[0])))
        return [y[1], -float(exact.torque(mp.mpf(y[0]), mp.mpf(y[1]))) / inertia]

    with mp.workdps(40):
        done = solve_ivp(motion, (0, 0.5), [np.radians(120), 6.0], "DOP853", rtol=1e-9, atol=1e-10)
    for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
        run = model.simulate(0.5, method=method, rtol=rtol, atol=rtol / 100)
        assert run.final["q"]["value"] == pytest.approx(done.y[0, -1], abs=2e-6)
        assert any("passed 2 losses of rank" in note for note in run.notes)


@pytest.mark.parametrize(("method", "least"), [("dop853", -12.9), ("taylor", -13.6)])
def test_change_points_are_passed_at_every_tolerance(method, least):
    """Four of them; energy by the reduced equation, which rounding errors of the poses near them disturb.

    Below 1e-12.8 one run by dop853 in several hundred ends next to one, where its steps are at rounding.
    """
    model, exact = symgen.build(CASES / "free_par.toml"), Antiparallelogram()

    def energy(q, rate):
        return float(exact.inertia(mp.mpf(q))) * rate**2 / 2 + float(exact.potential(mp.mpf(q)))

    start = energy(np.radians(120), 6.0)
    for exponent in np.arange(-5.0, least, -0.2).tolist():
        run = model.simulate(2.0, method=method, rtol=10**exponent, samples=2)
        assert any("passed 4 losses of rank" in note for note in run.notes), exponent
        end = run["q"].values[-1], run["q.rate"].values[-1]
        assert energy(*end) == pytest.approx(start, abs=3e-7 + 2 * 10**exponent), exponent
