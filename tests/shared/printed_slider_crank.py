"""The slider-crank as the source prints it, mistakes included, so that they can be measured. Never used by symgen.

Source: S. Rahman, *Dynamic analysis of the generalized slider crank*, NJIT 1991; equation numbers are the source's.
Single letters and dots that its printing lost are put back (docs/errata_dual_euler.md lists them); statements are
not touched: alpha3 fixed at 90 degrees (3), least squares through the normal equations (23a), rates (39) to (43),
momenta (49), (52), (53), inertia forces (59) to (61), joint forces (69a) to (69q).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shared.closed_slider_crank import (
    A1,
    A2,
    M1,
    M2,
    M3,
    R1,
    R2,
    R3,
    SPEED,
    Offsets,
    rotation_x,
    rotation_y,
    rotation_z,
)

TURN = 360


@dataclass(frozen=True)
class Turn:
    """Results of the printed iteration (5) to (26) at 0, 1, 2 ... degrees, until it fails to converge."""

    unknowns: np.ndarray  # (degrees, 5): theta2, eta2, theta3, eta3, S4
    residual: np.ndarray  # largest entry of |B - I|, lengths over a2
    iterations: np.ndarray

    @property
    def complete(self):
        return len(self.unknowns) == TURN + 1

    @property
    def theta(self):
        return np.radians(np.arange(len(self.unknowns)))

    @property
    def S4(self):
        return self.unknowns[:, 4]


def turns(scenes: list[Offsets], *, tolerance: float = 1e-6, limit: int = 100) -> list[Turn]:
    """Follow the printed iteration over one revolution in steps of 1 degree, from the planar estimate (2.6.2).

    All scenes are batched. One that needs more than ``limit`` iterations at an angle ends there.
    """
    a4, alpha4, S1 = (np.array([getattr(o, name) for o in scenes]) for name in ("a4", "alpha4", "S1"))
    alpha4 = np.radians(alpha4)
    S4 = np.sqrt(A2**2 - (A1 + a4) ** 2)
    theta2 = np.pi - np.arctan2(S4, A1 + a4)
    x = np.stack([theta2, 0 * S4, 2 * np.pi - theta2, 0 * S4, S4], -1)
    degree, count = np.zeros(len(scenes), dtype=int), np.zeros(len(scenes), dtype=int)
    found = [([], [], []) for _ in scenes]
    at = np.arange(len(scenes))
    while len(at):  # every scene continues to its next angle once converged
        step, residual = newton_step(np.radians(degree[at]), x[at], a4[at], alpha4[at], S1[at])
        x[at] += step
        count[at] += 1
        closed = np.max(np.abs(step), axis=-1) <= tolerance
        for scene, size in zip(at[closed], residual[closed], strict=True):
            for values, value in zip(found[scene], (x[scene].copy(), size, count[scene]), strict=True):
                values.append(value)
            degree[scene], count[scene] = degree[scene] + 1, 0
        lost = (count[at] >= limit) | ~(np.max(np.abs(x[at]), axis=-1) < 1e6)
        at = at[~lost & (degree[at] <= TURN)]
    return [Turn(*(np.array(values) for values in of_scene)) for of_scene in found]


def newton_step(theta1, x, a4, alpha4, S1):
    """Return the step (23a) with A of (24) and V of (25), and the size of B - I; one row per scene.

    An operator H of (12) to (16) is the skew matrix of a screw (omega, v at O), and the dual part of B is
    [p]x R: both are written down from rotations and origins here, which is quicker; ``operators`` has the print's form.
    """
    theta2, eta2, theta3, eta3, S4 = x.T
    zero = np.zeros_like(theta2)
    R2, p2 = row(theta1 + zero, S1, zero, zero, zero + A1)
    R, p = row(theta2, zero, eta2, zero, zero + A2)
    R3, p3 = R2 @ R, p2 + apply(R2, p)
    R4 = R3 @ row(theta3, zero, eta3, zero + np.pi / 2, zero)[0]
    R, p = row(zero, S4, zero, alpha4, a4)
    B, end = R4 @ R, p3 + apply(R4, p)
    axes = np.stack(
        [
            R2[..., 2],
            apply(R2, across(theta2)),
            R3[..., 2],
            apply(R3, across(theta3)),
            zero[:, None] + 0 * p3,
        ],
        1,
    )
    moments = np.cross(np.stack([p2, p2, p3, p3, p3], 1), axes)
    moments[:, 4] = R4[..., 2]
    # Entries 12, 13, 23 of a skew matrix: -z, y, -x.
    M = np.concatenate([axes, moments], -1).swapaxes(1, 2)[:, [2, 1, 0, 5, 4, 3]]
    M[:, [0, 2, 3, 5]] *= -1
    dual = np.cross(end[:, None, :], B.swapaxes(1, 2)).swapaxes(1, 2)
    step = least_squares(M, B, dual)
    return step, np.maximum(np.abs(B - np.eye(3)).max((1, 2)), np.abs(dual).max((1, 2)) / A2)


def least_squares(M, real, dual):
    """Return (23a) with V of (25)."""
    diagonal = real[:, [0, 1, 2], [0, 1, 2]] - 1
    primary = real[:, [1, 2, 2], [0, 0, 1]] + diagonal[:, [0, 0, 1]] + diagonal[:, [1, 2, 2]]
    V = np.concatenate([primary, dual[:, [1, 2, 2], [0, 0, 1]]], -1)
    Mt = M.swapaxes(1, 2)
    return np.linalg.solve(Mt @ M, Mt @ V[..., None])[..., 0]


def row(theta, S, eta, alpha, a):
    """Rotation and origin of the frame that Z(theta + eps S) Y(eta) X(alpha + eps a) places."""
    R = rotation_z(theta) @ rotation_y(eta)
    origin = a[..., None] * R[..., 0]
    origin[..., 2] += S
    return R @ rotation_x(alpha), origin


def across(theta):
    """The axis of eta: operator (9) turns about it."""
    return np.stack([-np.sin(theta), np.cos(theta), np.zeros_like(theta)], -1)


def apply(R, v):
    return (R @ v[..., None])[..., 0]


def operators(theta1, unknowns, offsets):
    """Return A of (24) and real and dual part of B by the operators (8) to (18), as printed; one scene."""
    theta2, eta2, theta3, eta3, S4 = unknowns
    M1 = product(about_z(theta1, offsets.S1), about_x(0.0, A1))
    L2 = product(product(about_z(theta2, 0.0), about_y(eta2)), about_x(0.0, A2))
    L3 = product(product(about_z(theta3, 0.0), about_y(eta3)), about_x(np.pi / 2, 0.0))
    M4 = product(about_z(0.0, S4), about_x(np.radians(offsets.alpha4), offsets.a4))
    after2 = product(M1, L2)
    after3 = product(after2, L3)
    turn_z = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    columns = []
    for before, operator in (
        (M1, (turn_z, 0 * turn_z)),
        (M1, (turn_eta(theta2), 0 * turn_z)),
        (after2, (turn_z, 0 * turn_z)),
        (after2, (turn_eta(theta3), 0 * turn_z)),
        (after3, (0 * turn_z, turn_z)),
    ):
        H = product(product(before, operator), (before[0].T, before[1].T))
        columns.append([part[entry] for part in H for entry in ((0, 1), (0, 2), (1, 2))])
    return np.array(columns).T, *product(after3, M4)


def product(a, b):
    """Product of two dual matrices."""
    return a[0] @ b[0], a[0] @ b[1] + a[1] @ b[0]


def about_z(angle, length):
    c, s = np.cos(angle), np.sin(angle)
    return rotation_z(angle), length * np.array([[-s, -c, 0], [c, -s, 0], [0, 0, 0]])


def about_y(angle):
    return rotation_y(angle), np.zeros((3, 3))


def about_x(angle, length):
    c, s = np.cos(angle), np.sin(angle)
    return rotation_x(angle), length * np.array([[0, 0, 0], [0, -s, -c], [0, c, -s]])


def turn_eta(theta):
    """Operator (9)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[0, 0, c], [0, 0, s], [-c, -s, 0]])


def rates(theta2, eta2, theta3, w=SPEED):
    """Return the printed rates (39) to (43) for constant S1: theta2, theta3, eta2, eta3, S4."""
    c2, s2, ce, se, c3, s3 = (
        np.cos(theta2),
        np.sin(theta2),
        np.cos(eta2),
        np.sin(eta2),
        np.cos(theta3),
        np.sin(theta3),
    )
    with np.errstate(all="ignore"):
        theta2_rate = (-A1 * (w * s2 * c3 + w * c2 * s3 * ce) - A2 * w * s3) / (A2 * s3)
        theta3_rate = A1 * w * (c2 * s3 + s2 * c3 * ce) / (A2 * s3)
        eta2_rate = -se * A1 * w * (c2 * s3 + s2 * c3 * ce) / (A2 * s2 * s3)
        eta3_rate = c2 * se * w * A1 * (s2 * c3 * ce + c2 * s3) / (A2 * s2 * s3)
        S4_rate = -w * A1 * s2 * ce / s3
    return theta2_rate, theta3_rate, eta2_rate, eta3_rate, S4_rate


def velocity_mismatch(theta2, eta2, theta3, w=SPEED):
    """Return left less right side of (37f) at the printed rates [in/s]: the row that they were not solved from."""
    _, _, eta2_rate, _, _ = rates(theta2, eta2, theta3, w)
    return w * A1 * np.sin(theta2) * np.sin(eta2) - eta2_rate * A2 * np.cos(theta2)


def inertia_forces(motion, *, g_sign=+1):
    """Return dual inertia forces f1, f2, f3 of (59) to (61) for constant speed and S1: (force, moment) pairs.

    ``motion`` holds theta3, and rates and accelerations of theta3, eta3 and S4. ``g_sign`` is the sign of the mass
    centres: the source prints +a/2.
    """
    w = SPEED
    g1, g2 = g_sign * A1 / 2, g_sign * A2 / 2
    K1 = np.diag([R1**2 / 2, R1**2 / 4 + A1**2 / 3, R1**2 / 4 + A1**2 / 3])
    K2 = np.diag([R2**2 / 2, R2**2 / 4 + A2**2 / 3, R2**2 / 4 + A2**2 / 3])
    s3, c3 = np.sin(motion["theta3"]), np.cos(motion["theta3"])
    t3, e3, v = motion["theta3_rate"], motion["eta3_rate"], motion["S4_rate"]
    t3a, e3a, va = motion["theta3_acceleration"], motion["eta3_acceleration"], motion["S4_acceleration"]
    # (33a), (54); (36a), (57); (32b), (58): velocities of the frames and rates of the momenta.
    V1 = np.array([0, 0, w]), np.array([0, A1 * w, 0])
    V2 = np.array([0, -e3, -t3]), np.array([-v * s3, v * c3, 0])
    V3 = np.zeros(3), np.array([0, 0, -v])
    V2_rate = np.array([0, -e3a, -t3a]), np.array([-va * s3 - v * c3 * t3, va * c3 - v * s3 * t3, 0])
    V3_rate = np.zeros(3), np.array([0, 0, -va])
    rest = np.zeros(3), np.zeros(3)
    return (
        dual_euler(M1, g1, K1, V1, rest),
        dual_euler(M2, g2, K2, V2, V2_rate),
        dual_euler(M3, 0.0, np.diag([R3**2 / 6] * 3), V3, V3_rate),
    )


def dual_euler(m, g, K, V, V_rate):
    """Return H' + V x H with H of the inertia binor (46) to (48), as force and moment."""
    arm = np.array([g, 0, 0])

    def momentum(U):
        return m * (U[1] + np.cross(U[0], arm)), m * (K @ U[0] + np.cross(arm, U[1]))

    H, H_rate = momentum(V), momentum(V_rate)
    force = H_rate[0] + np.cross(V[0], H[0])
    moment = H_rate[1] + np.cross(V[0], H[1]) + np.cross(V[1], H[0])
    return force, moment


def joint_forces(theta1, angles, f1, f2, f3, S1, *, T1k=100.0, F1k=0.0):
    """Return the joint forces (69a) to (69q), as printed: components by name."""
    theta2, eta2, theta3, eta3 = angles
    c1, s1, c2, s2, ce2, se2 = (
        np.cos(theta1),
        np.sin(theta1),
        np.cos(theta2),
        np.sin(theta2),
        np.cos(eta2),
        np.sin(eta2),
    )
    c3, s3, ce3, se3 = np.cos(theta3), np.sin(theta3), np.cos(eta3), np.sin(eta3)
    (f1x, f1y, f1z), (f1xd, f1yd, f1zd) = f1
    (f2x, f2y, f2z), (_, f2yd, f2zd) = f2
    (f3x, f3y, f3z), (f3xd, f3yd, f3zd) = f3
    F2k = -(F1k + f1z)  # (69a)
    F3j = -(f2y + f2zd / A2)  # (69b)
    F3k = f2yd / A2 - f2z  # (69c)
    F2j = -f1y - (f1zd + T1k) / A1  # (69g)
    F2i = (F2j * A2 * c2 - f2zd) / (A2 * s2)  # (69h)
    F1i = -(F2i + f1x) * c1 - (T1k + f1zd) * s1 / A1  # (69i)
    F1j = -(F2i + f1x) * s1 + (T1k + f1zd) * c1 / A1  # (69j)
    F3i = -F2i * c2 * ce2 - F2j * s2 * ce2 + F2k * se2 - f2x  # (69l)
    F4k = F3j * c3 - F3i * s3 - f3z  # (69m)
    F4j = -(F3i * c3 * se3 + F3j * s3 * se3 + F3k * ce3 + f3y)  # (69n)
    F4i = -(F3i * c3 * ce3 + F3j * s3 * ce3 - F3k * se3 + f3x)  # (69o)
    T1j = F1i * S1 - f1xd * s1 - (F1k * A1 + f1yd) * c1  # (69p)
    T1i = -F1j * S1 - f1xd * c1 + (F1k * A1 + f1yd) * s1  # (69q)
    return {
        "F1i": F1i, "F1j": F1j, "F1k": F1k, "T1i": T1i, "T1j": T1j, "T1k": T1k, "F2i": F2i, "F2j": F2j, "F2k": F2k,
        "F3i": F3i, "F3j": F3j, "F3k": F3k, "F4i": F4i, "F4j": F4j, "F4k": F4k,
        "T4i": -f3xd, "T4j": -f3yd, "T4k": -f3zd,
    }  # fmt: skip
