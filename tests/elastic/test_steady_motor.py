"""Steady states of elastic linkages with a motor, against rigid machines."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import symgen

CASES = Path(__file__).parents[1] / "cases"


def four_bar_rocker(theta, a, b, c, d):
    """Return B of a four-bar with crank a, coupler b, output c, where circles about A and (d, 0) meet above."""
    x, y = a * math.cos(theta), a * math.sin(theta)
    dx, dy = d - x, -y
    reach = math.hypot(dx, dy)
    along = (b**2 - c**2 + reach**2) / (2 * reach)
    up = math.sqrt(b**2 - along**2)
    return np.array([x + (along * dx - up * dy) / reach, y + (along * dy + up * dx) / reach])


class Turned:
    """A rigid four-bar turned by stall*(1 - rate/free), its output dragged: energies of closed forms, plain RK4."""

    def __init__(self, lengths, inertia, stall, free, drag=0.0, steps=1500):
        a, arm = lengths[0], lengths[2]
        self.steps = steps

        def reduced(theta, h=1e-5):
            va = a * np.array([-math.sin(theta), math.cos(theta)])
            vb = (four_bar_rocker(theta + h, *lengths) - four_bar_rocker(theta - h, *lengths)) / (2 * h)
            return inertia(va, vb), (vb @ vb) / arm**2

        angles = np.linspace(0.0, 2 * math.pi, 2 * steps + 1)
        j, turning = np.array([reduced(x) for x in angles]).T
        slope = np.array([(reduced(x + 1e-3)[0] - reduced(x - 1e-3)[0]) / 2e-3 for x in angles])
        # dw/dtheta at angle i
        self.rate = lambda i, w: (
            (stall * (1 - w / free) - drag * turning[i] * w - slope[i] * w**2 / 2) / (j[i] * w)
        )

    def revolution(self, w):
        """Return its time [s] from the speed w, and the speed after it."""
        h, rate, period = math.pi / self.steps * 2, self.rate, 0.0
        for i in range(0, 2 * self.steps, 2):
            k1 = rate(i, w)
            k2 = rate(i + 1, w + h / 2 * k1)
            k3 = rate(i + 1, w + h / 2 * k2)
            k4 = rate(i + 2, w + h * k3)
            after = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            middle = (w + after) / 2 + h / 8 * (k1 - rate(i + 2, after))
            period += h / 6 * (1 / w + 4 / middle + 1 / after)
            w = after
        return period, w

    def steady(self, w):
        """Return the speed [rad/s] that a revolution repeats."""
        for _ in range(60):
            before, w = w, self.revolution(w)[1]
            if abs(w - before) < 1e-13 * w:
                break
        return w


def test_steady_state_with_a_motor():
    """The motor sets the speed, not the scene: 45 rpm are given, and the crank settles at 58."""
    wiper = symgen.build(CASES / "wiper.toml", set={"links.rod.elastic.elements": 1})
    run = wiper.periodic(samples=31, rtol=1e-2)
    lengths = 0.04, math.hypot(0.27, 0.07), math.hypot(0.01, 0.07), 0.3
    rod, arm = 7850 * 0.012 * 0.003 * lengths[1], lengths[2]

    def inertia(va, vb):
        blade = (0.05 / arm**2 + 0.1) * (vb @ vb)
        return 0.2 * 0.04**2 / 3 + 0.05 + rod / 3 * (va @ va + va @ vb + vb @ vb) + blade

    rigid = Turned(lengths, inertia, 12.0, 2 * math.pi, 0.3)
    period = rigid.revolution(rigid.steady(45 * math.pi / 30))[0]
    assert np.ptp(run.time) == pytest.approx(period, rel=1e-6)
    assert run.stable is True
    assert np.max(np.abs(run["B.displacement"].values)) < 1e-4
    started = wiper.simulate(revolutions=1.0, samples=31, rtol=1e-2)
    assert np.max(np.abs(started["B.displacement"].values)) < 1e-4


def test_speed_recovers_after_a_revolution_as_that_of_the_rigid_machine():
    """The four-bar was "unstable". Of stiff links the largest multiplier is that of the speed of the rigid machine."""
    assert symgen.build("elastic_four_bar_motor").periodic(samples=31, rtol=1e-2).stable is True
    stiff = symgen.build("elastic_four_bar_motor", set={"E": "1.03e11 psi"})
    run = stiff.periodic(samples=11, rtol=1e-2, steps=2048)
    inch, slug, foot = 0.0254, 14.593902937206364, 0.3048
    lengths = tuple(inch * x for x in (7.0, 10.0, 12.0, 11.0))
    crank, coupler, output = (5.292 * slug / foot**3 * inch * 0.125 * inch * x for x in lengths[:3])
    bearing, speed = 0.0040803133 * slug, 95 * math.pi / 30

    def inertia(va, vb):
        bars = coupler / 3 * (va @ va + va @ vb + vb @ vb) + output / 3 * (vb @ vb)
        own = (crank / 3 + bearing) * (va @ va) + bearing * (vb @ vb)
        return 0.5 * slug * foot**2 + own + bars

    rigid = Turned(lengths, inertia, 10 * 4.4482216152605 * foot, speed)
    w = rigid.steady(speed)
    period, _ = rigid.revolution(w)
    faster, slower = (rigid.revolution(w * (1 + by))[1] for by in (1e-4, -1e-4))
    assert np.ptp(run.time) == pytest.approx(period, rel=1e-6)
    assert run.floquet[0].imag == 0.0 and run.stable is True
    assert run.floquet[0].real == pytest.approx((faster - slower) / (2e-4 * w), rel=1e-3)


def test_the_phase_of_the_crank_does_not_hide_the_error_of_multipliers():
    """Its multiplier is near one and no vibration: it is larger than those of damped ones, which steps do not resolve."""
    damped = {f"links.{link}.elastic.damping": {"mass": "2 1/s"} for link in ("crank", "coupler", "output")}
    model = symgen.build("elastic_four_bar_motor", set={"E": "1.5e6 psi", **damped})
    coarse, fine = (model.periodic(samples=3, rtol=1e-2, steps=steps) for steps in (64, 6144))
    apart = abs(abs(coarse.floquet[0]) - abs(fine.floquet[0]))
    assert fine.statistics["floquet_error"] < apart < coarse.statistics["floquet_error"]


def test_a_crank_that_turns_away_from_its_rigid_motion_is_noted():
    run = symgen.build("elastic_four_bar_free", set={"speed": "95 rpm"}).simulate(revolutions=0.5, samples=31)
    assert any("rad off its rigid motion" in note for note in run.notes)


@pytest.mark.parametrize("rtol", [1e-7, 1e-8])
def test_estimates_include_the_steps_between_recorded_times(rtol):
    """Shooting takes 256 steps, and 360 or 720 end at recorded times: the error of these counts, too."""
    model = symgen.build("elastic_four_bar_motor")
    exact, found = model.periodic(steps=1100, samples=361), model.periodic(rtol=rtol, samples=361)
    names = [v.name for v in exact.variables if v.name.endswith(".stress")]
    error = max(
        np.max(np.abs(found[n].values - exact[n].values)) / np.max(np.abs(exact[n].values)) for n in names
    )
    assert error < found.statistics["error"] <= rtol
