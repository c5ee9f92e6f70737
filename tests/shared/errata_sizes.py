"""The sizes of the source's errors, as docs/errata_dual_euler.md gives them: one table per function, rows by scene."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from shared import printed_slider_crank as printed
from shared.closed_slider_crank import A1, A2, M1, M2, SPEED, Closed, Offsets

TURN = np.radians(np.arange(0.0, 360.0, 0.25))
#: Scenes of the source's study: a4, alpha4, S1.
STUDY = (
    (0, 270, 0), (30, 270, 0), (10, 270, 3.5), (20, 270, 3.5), (30, 270, 3.5),
    (30, 270, 3), (30, 270, 6), (30, 270, 9), (20, 232, 0), (20, 310, 0),
)  # fmt: skip
#: Largest S1, in steps of 0.25 in, up to which the printed iteration completes a revolution, by a4.
LAST_GOOD = {0: 0.0, 10: 2.5, 20: 6.0, 30: 9.5}
LAST_GOOD_LOOSE = {0: 0.0, 10: 2.25, 20: 5.5, 30: 9.0}


def key(scene):
    return tuple(f"{v:g}" for v in scene)


def printed_turns():
    """Run the printed iteration for all scenes needed, batched."""
    wanted = [Offsets(*s) for s in STUDY]
    for a4, last in LAST_GOOD.items():
        wanted += [Offsets(a4, 270, last), Offsets(a4, 270, last + 0.25)]
    wanted += [Offsets(20, alpha4, 0) for alpha4 in (231, 232, 311, 312)]
    return dict(zip(wanted, printed.turns(wanted), strict=True))


def displacement(turns):
    rows = {}
    for scene in STUDY:
        offsets = Offsets(*scene)
        turn = turns[offsets]
        alpha3 = np.degrees(Closed(offsets, TURN).angles()[4]) - 90
        error = np.max(np.abs(turn.S4 - Closed(offsets, turn.theta).S4))
        reached = len(turn.unknowns) - 1
        rows[key(scene)] = (reached, error, np.max(turn.residual), np.max(np.abs((alpha3 + 180) % 360 - 180)))
    return rows


def rates():
    rows = {}
    for scene in ((30, 270, 3.5), (30, 270, 9), (20, 232, 0), (20, 310, 0)):
        closed = Closed(Offsets(*scene), np.radians(60.0))
        theta2, eta2, theta3, *_ = closed.angles()
        found = printed.rates(theta2, eta2, theta3)
        left = printed.velocity_mismatch(theta2, eta2, theta3)
        rows[key(scene)] = (found[2], closed.angle_rates()[1], found[4], closed.S4_rate, left)
    return rows


def assembly_limit(a4):
    """Largest S1 [in] with a full revolution, alpha4 = 270: the least discriminant is zero, by bisection."""
    return brentq(lambda S1: np.min(Closed(Offsets(a4, 270, S1), TURN).discriminant), 0.0, 60.0, xtol=1e-13)


def limits():
    claims = {0: 1.5, 10: 3.5, 20: np.nan, 30: 9.0}
    return {
        (f"{a4}",): (assembly_limit(a4), claims[a4], LAST_GOOD[a4], LAST_GOOD_LOOSE[a4]) for a4 in LAST_GOOD
    }


def planar_forces(a4, degrees, *, signs=False, centres=False):
    """Return printed joint forces of a planar scene, and the largest error of a component.

    ``signs`` repairs the signs of (62) and (64), ``centres`` the mass centres.
    """
    closed = Closed(Offsets(a4), np.radians(degrees))
    theta2, eta2, theta3, eta3, _ = closed.angles()
    motion = {
        "theta3": theta3,
        "theta3_rate": closed.angle_rates()[2],
        "theta3_acceleration": _second_rate(a4, degrees),
        "eta3_rate": 0.0,
        "eta3_acceleration": 0.0,
        "S4_rate": closed.S4_rate,
        "S4_acceleration": closed.S4_acceleration,
    }
    f1, f2, f3 = printed.inertia_forces(motion, g_sign=-1 if centres else 1)
    if signs:
        f1, f3 = tuple(tuple(-part for part in f) for f in (f1, f3))
    found = printed.joint_forces(np.radians(degrees), (theta2, eta2, theta3, eta3), f1, f2, f3, 0.0)
    right = closed.forces(torque=100.0)
    components = {f"{name}{axis}": v for name, of in right.items() for v, axis in zip(of, "ijk", strict=True)}
    return found, max(abs(found[name] - value) for name, value in components.items())


def _second_rate(a4, degrees):
    """Second rate of theta3 in the plane: the direction of the rod turns by u x u''."""
    closed = Closed(Offsets(a4), np.radians(degrees))
    u, a = closed.along, closed.along_acceleration
    return -(u[0] * a[1] - u[1] * a[0])  # theta1 + theta2 + theta3 = 0, and |u| = 1 leaves no other term


def forces():
    return {
        (f"{a4}", f"{degrees}"): tuple(
            planar_forces(a4, degrees, signs=signs, centres=centres)[1]
            for signs, centres in ((False, False), (True, False), (False, True))
        )
        for a4, degrees in ((0, 0), (0, 45), (0, 100), (30, 0), (30, 45), (30, 100))
    }


def centres():
    rows = {}
    for scene in ((0, 270, 0), (30, 270, 0), (20, 232, 0), (30, 270, 9)):
        closed = Closed(Offsets(*scene), TURN)
        rod = M2 * A2 * np.max(np.linalg.norm(closed.along_acceleration, axis=-1))
        rows[key(scene)] = (M1 * A1 * SPEED**2, rod)
    return rows


def thrust():
    rows = {}
    for scene in ((0, 270, 3.5), (30, 270, 3.5), (30, 270, 9), (20, 232, 0), (20, 310, 0), (0, 250, 0)):
        offsets = Offsets(*scene)
        at = Closed(offsets, np.radians(45.0)).forces(torque=100.0)
        lost = A1 * np.abs(at["F1"][2])
        rows[key(scene)] = (at["F1"][2], lost, np.max(np.abs(Closed(offsets, TURN).gauge_moment())))
    return rows


def dead_centres():
    rows = {}
    for scene, brackets in (
        ((0, 270, 0), ((80, 95), (260, 275))),
        ((30, 270, 0), ((110, 130), (310, 330))),
        ((30, 270, 9), ((110, 130), (310, 335))),
        ((20, 232, 0), ((100, 125), (295, 320))),
    ):
        offsets = Offsets(*scene)
        for bracket in brackets:
            theta = brentq(
                lambda x, o=offsets: Closed(o, np.asarray(x)).S4_rate, *np.radians(bracket), xtol=1e-14
            )
            closed = Closed(offsets, np.asarray(theta))
            T1 = closed.forces(load=0.0)["T1"][2]
            residue = (100 - T1) * SPEED**2 / closed.S4_acceleration
            rows[(*key(scene), f"{np.degrees(theta):.6f}")] = (T1, residue)
    return rows
