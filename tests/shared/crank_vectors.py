"""An independent model of the generalized slider-crank: vectors in the ground frame, closed form, no screws.

Nothing of symgen is used: no dual numbers, no iteration, no Jacobian. The ball on the crank is at
p2 = (a1 cos theta1, a1 sin theta1, S1), the ball on the slider at p3 = -a4 i - S4 k4 with k4 = (0, sin alpha4,
cos alpha4) along the guide, and |p3 - p2| = a2 is a quadratic in S4. Rates follow by Taylor arithmetic. Forces are
Newton's and Euler's laws of each link in turn: the moments about the crank's ball give the force across the rod, the
slider along its guide (or the crank's torque) the force along it.

Lengths in inches, forces in pounds, masses in lbf s^2/in; extended doubles.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from shared.jets import (
    Jet,
    Real,
    about_x,
    about_y,
    about_z,
    angular_velocity,
    atan2,
    cos,
    cross,
    dot,
    jet,
    sin,
    sqrt,
    vector,
)

PI = 4 * np.arctan(Real(1))


def cylinder(mass, radius, length):
    """Principal moments of inertia of a cylinder about its centre, with its axis along i."""
    across = mass * (radius**2 / 4 + length**2 / 12)
    return np.array([mass * radius**2 / 2, across, across], dtype=Real)


@dataclass(frozen=True)
class Crank:
    """Dimensions and masses; by default those of Rahman's example.

    ``rod_centre`` and ``rod_inertia`` (about it, a 3x3 matrix) make a general rod, whose spin is a coordinate; with None
    the rod is uniform and round, and its spin is no coordinate.
    """

    a4: float = 0.0
    alpha4: float = 270 * float(PI) / 180
    a1: float = 12.0
    a2: float = 50.0
    density: Real = Real("0.28") / Real("386.4")
    gravity: tuple = (0.0, 0.0, 0.0)
    rod_centre: tuple | None = None
    rod_inertia: np.ndarray | None = None
    radii: tuple = (1.5, 1.0, 3.0)
    masses: tuple = field(init=False)

    def __post_init__(self):
        r1, r2, side = (Real(r) for r in self.radii)
        volumes = (PI * r1**2 * self.a1, PI * r2**2 * self.a2, side**3)
        object.__setattr__(self, "masses", tuple(self.density * v for v in volumes))

    def inertia_of_crank(self) -> np.ndarray:
        """Inertia matrix about the centre of mass, in the frame {2}; rotations involve the moment about k."""
        return np.diag(cylinder(self.masses[0], self.radii[0], self.a1))

    def inertia_of_rod(self) -> np.ndarray:
        """Inertia matrix about the centre of mass, in the frame {3}."""
        if self.rod_inertia is not None:
            return np.array(self.rod_inertia, dtype=Real)
        return np.diag(cylinder(self.masses[1], self.radii[1], self.a2))

    def motion(self, theta1: Jet, S1: Jet, spin: Jet | float = 0.0, branch: int = 1) -> Motion:
        return Motion(self, jet(theta1), jet(S1), jet(spin), branch)


class Motion:
    """All joint variables with rates, and the frames {2}, {3}, {4} of crank, rod and slider."""

    def __init__(self, crank: Crank, theta1: Jet, S1: Jet, spin: Jet, branch: int) -> None:
        self.crank, self.theta1, self.S1, self.spin = crank, theta1, S1, spin
        a1, a2, a4, alpha4 = (Real(x) for x in (crank.a1, crank.a2, crank.a4, crank.alpha4))
        zero = Jet(np.zeros_like(theta1.value))
        self.k4 = vector(zero, zero + np.sin(alpha4), zero + np.cos(alpha4))
        self.p2 = vector(a1 * cos(theta1), a1 * sin(theta1), S1)
        apart = self.p2 + np.array([a4, 0, 0], dtype=Real)
        along = apart.dot(self.k4)
        off = apart - self.k4 * along[..., None]
        self.discriminant = a2**2 - off.dot(off)
        self.S4 = -along + branch * sqrt(self.discriminant)
        self.p3 = -(self.k4 * self.S4[..., None]) - np.array([a4, 0, 0], dtype=Real)
        self.u = (self.p3 - self.p2) / a2

    @cached_property
    def _heading(self) -> Jet:
        return atan2(self.u[..., 1], self.u[..., 0])

    @cached_property
    def theta2(self) -> Jet:
        return self._heading - self.theta1

    @cached_property
    def eta2(self) -> Jet:
        ux, uy, uz = (self.u[..., i] for i in range(3))
        return -atan2(uz, sqrt(ux * ux + uy * uy))

    @cached_property
    def frame2(self) -> Jet:
        return about_z(self.theta1)

    @cached_property
    def frame3(self) -> Jet:
        return about_z(self._heading) @ about_y(self.eta2) @ about_x(self.spin)

    @cached_property
    def frame4(self) -> Jet:
        return about_x(Jet(np.full_like(self.theta1.value, -Real(self.crank.alpha4))))

    @cached_property
    def _bend(self) -> Jet:
        return self.frame3.transposed @ self.frame4

    @cached_property
    def theta3(self) -> Jet:
        return atan2(self._bend[..., 1, 0], self._bend[..., 0, 0])

    @cached_property
    def eta3(self) -> Jet:
        x, y = self._bend[..., 0, 0], self._bend[..., 1, 0]
        return -atan2(self._bend[..., 2, 0], sqrt(x * x + y * y))

    @cached_property
    def alpha3(self) -> Jet:
        return atan2(self._bend[..., 2, 1], self._bend[..., 2, 2])

    def variables(self) -> dict[str, Jet]:
        names = ("theta1", "S1", "theta2", "eta2", "theta3", "eta3", "alpha3", "S4")
        return {name: getattr(self, name) for name in names}

    def forces(self, *, S4_drive=0.0, theta1_drive=None) -> dict[str, np.ndarray]:
        """Joint forces and moments on the link before each joint's frame, and the drives.

        One of the two is given: the force on the slider along k4, or the torque on the crank.
        """
        c = self.crank
        m1, m2, m3 = c.masses
        g = np.array(c.gravity, dtype=Real)
        a2 = Real(c.a2)
        u, k4, p2 = self.u.value, self.k4.value, self.p2.value
        centre2, rod_moment = self.rod()
        push2 = m2 * (centre2.second - g)
        # moments of the rod about the crank's ball: (p3 - p2) x (-F3) = about, but for its part along u
        about = rod_moment + cross(centre2.value - p2, push2)
        across = cross(u, about) / a2
        push3 = m3 * (self.p3.second - g)
        centre1 = self.p2 - self.frame2[..., 0] * (Real(c.a1) / 2)
        push1 = m1 * (centre1.second - g)
        spin1, spin1_rate = angular_velocity(self.frame2)
        own1 = _rate_of_spin(self.frame2.value, c.inertia_of_crank(), spin1, spin1_rate)
        crank_moment = own1 + cross(centre1.value, push1)
        k = np.array([0, 0, 1], dtype=Real)
        if theta1_drive is None:
            needed = dot(push3, k4) - S4_drive - dot(across, k4)
            stretch = needed / dot(u, k4)
        else:
            needed = theta1_drive - dot(k, crank_moment + cross(p2, push2 + across))
            stretch = needed / dot(k, cross(p2, u))
        F3 = across + stretch[..., None] * u  # rod on slider
        F4 = push3 - F3  # guide on slider
        F2 = -push2 - F3  # rod on crank
        F1 = push1 - F2  # ground on crank
        T1 = crank_moment - cross(p2, F2)
        local = {
            "F1": F1,
            "T1": T1,
            "F2": _into(self.frame2, F2),
            "F3": _into(self.frame3, F3),
            "F4": _into(self.frame4, F4),
        }
        local["T4"] = np.zeros_like(F1)
        local["theta1.drive"], local["S1.drive"] = T1[..., 2], F1[..., 2]
        local["S4.drive"] = local["F4"][..., 2]
        # a torque about the line of the balls that would be needed to hold the spin
        local["spin.drive"] = dot(about, u)
        return local

    def rod(self) -> tuple[Jet, np.ndarray]:
        """Centre of mass, and the rate of the angular momentum about it."""
        c = self.crank
        if c.rod_inertia is None:
            u, _, u2 = self.u.parts
            across = c.inertia_of_rod()[1, 1]
            return (self.p2 + self.p3) / 2, across * cross(u, u2)
        spin, spin_rate = angular_velocity(self.frame3)
        arm = self.frame3 @ Jet(np.array(c.rod_centre, dtype=Real)[:, None])
        return self.p3 + arm[..., 0], _rate_of_spin(self.frame3.value, c.inertia_of_rod(), spin, spin_rate)

    def kinetic_energy(self) -> np.ndarray:
        c = self.crank
        m1, m2, m3 = c.masses
        spin1, _ = angular_velocity(self.frame2)
        inertia1 = c.inertia_of_crank()[2, 2] + m1 * (Real(c.a1) / 2) ** 2
        energy = inertia1 * spin1[..., 2] ** 2 / 2 + m1 * self.S1.rate**2 / 2
        centre, _ = self.rod()
        energy = energy + m2 * dot(centre.rate, centre.rate) / 2
        if c.rod_inertia is None:
            energy = energy + c.inertia_of_rod()[1, 1] * dot(self.u.rate, self.u.rate) / 2
        else:
            spin, _ = angular_velocity(self.frame3)
            own = _into(self.frame3, spin)
            energy = energy + dot(own, own @ c.inertia_of_rod()) / 2
        return energy + m3 * dot(self.p3.rate, self.p3.rate) / 2


def _into(frame: Jet, v):
    """Components in a frame of a vector given in the ground."""
    return np.einsum("...ji,...j->...i", frame.value, v)


def _rate_of_spin(turn, inertia, spin, spin_rate):
    """Rate of J w, with J turning along."""
    world = turn @ inertia @ np.swapaxes(turn, -1, -2)
    return _times(world, spin_rate) + cross(spin, _times(world, spin))


def _times(m, v):
    return np.einsum("...ij,...j->...i", m, v)


def driven(theta1, speed, amplitude, ratio) -> tuple[Jet, Jet]:
    """Crank angle at constant speed, and S1 = amplitude sin(ratio theta1), or the amplitude if ratio = 0."""
    theta1 = Jet(np.asarray(theta1, dtype=Real), speed, 0)
    if ratio == 0:
        return theta1, Jet(np.full_like(theta1.value, amplitude))
    return theta1, amplitude * sin(theta1 * Real(ratio))


def dead_centres(crank: Crank, S1: float) -> list[float]:
    """Crank angles [rad] at which the rod points through the crank's axis (theta2 = 0 or pi), S1 constant."""
    from scipy.optimize import brentq

    def across(angles):
        p = crank.motion(Jet(np.atleast_1d(angles)), Jet(np.full(np.size(angles), S1)))
        return cross(p.p2.value, p.u.value)[:, 2].astype(float)

    grid = np.linspace(0.05, 0.05 + 2 * float(PI), 73)
    values = across(grid)
    pairs = zip(grid, grid[1:], values, values[1:], strict=False)
    return [
        brentq(lambda x: across(x)[0], a, b, xtol=1e-15, rtol=1e-15) for a, b, fa, fb in pairs if fa * fb < 0
    ]
