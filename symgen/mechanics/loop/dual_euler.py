"""Inertia of the links of a loop and the equilibrium of its joints, by dual vectors.

Source: S. Rahman, *Dynamic Analysis of the Generalized Slider Crank* (1991), Eqs. (46)-(68), with corrected
signs of action and reaction: the inertia wrench is the rate of the dual momentum, and the wrench of one link
on the next enters the two with opposite signs.

Wrenches (force; moment) and velocities (w; v) are taken in a frame about its origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.mechanics.loop.dual_paths import WRENCH
from symgen.mechanics.loop.dual_rows import JointMotion
from symgen.symbolic.dual import DualMatrix, DualVector, Triple, product, skew
from symgen.symbolic.names import Names
from symgen.symbolic.vectors import cross, dot

_ZERO = sp.Integer(0)
_MOMENTUM = (("p", "kg*m/s", "momentum,"), ("h", "kg*m^2/s", "angular momentum about the origin,"))
_AT_CENTRE = (("w", "rad/s", "angular velocity,"), ("vc", "m/s", "velocity of the centre of mass,"))
_RATE_AT_CENTRE = (
    ("dw", "rad/s^2", "rate of the angular velocity,"),
    ("ac", "m/s^2", "acceleration of the centre of mass,"),
)
_SPIN = ("kg*m^2/s", "angular momentum about the centre of mass,")


@dataclass(frozen=True, slots=True)
class Inertia:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2] of a body in a frame."""

    mass: sp.Expr
    centre: Triple
    matrix: sp.ImmutableMatrix

    @property
    def binor(self) -> sp.ImmutableMatrix:
        """Return the 6x6 matrix that maps (w; v) to the dual momentum (p; h), Eqs. (46)-(48)."""
        arm = self.mass * skew(self.centre)
        about_origin = self.matrix - arm * skew(self.centre)
        blocks = [[-arm, self.mass * sp.eye(3)], [about_origin, arm]]
        return sp.ImmutableMatrix(sp.BlockMatrix(blocks))


class BodyMotion:
    """Momentum, inertia wrench and energy of a moving body, step by step.

    Parameters
    ----------
    body
        Its inertia, in the frame.
    velocity, acceleration
        (w; v) of the frame and d(w; v)/dt by components in it. The frame may spin about the axis of a body
        of revolution, whose inertia about that axis is then omitted: the formulas hold for the frame.
    names, link
        Collector of the intermediates, and the name of the link in their names.
    """

    def __init__(
        self, body: Inertia, velocity: DualVector, acceleration: DualVector, names: Names, link: str
    ) -> None:
        self.body, self.link, self.names = body, link, names
        self.velocity = self._named(_at(velocity, body.centre), _AT_CENTRE)
        self._rate = _at(acceleration, body.centre)

    def _named(
        self, vector: DualVector, kinds: tuple[tuple[str, str, str], tuple[str, str, str]]
    ) -> DualVector:
        return self.names.screw(self.link, vector, kinds, f"of {self.link}")

    @property
    def spin(self) -> Triple:
        """Angular momentum about the centre of mass."""
        h = product(self.body.matrix, self.velocity.real)
        return self.names.vector(f"hc_{self.link}", h, *_SPIN)

    @property
    def momentum(self) -> DualVector:
        """The dual momentum (p; h) about the origin of the frame, Eqs. (49)-(53)."""
        p = tuple(self.body.mass * x for x in self.velocity.dual)
        moment = (h + x for h, x in zip(self.spin, cross(self.body.centre, p), strict=True))
        return self._named(DualVector(p, tuple(moment)), _MOMENTUM)

    @property
    def wrench(self) -> DualVector:
        """The inertia wrench: the rate of the dual momentum in space, Eqs. (59)-(61).

        p' + w x p with the moment h' + w x h about the centre of mass, where v x p vanishes; transformed to
        the origin.
        """
        w = self.velocity.real
        turned = cross(w, self.velocity.dual)
        acceleration = DualVector(
            self._rate.real, tuple(a + x for a, x in zip(self._rate.dual, turned, strict=True))
        )
        rate = self._named(acceleration, _RATE_AT_CENTRE)
        force = tuple(self.body.mass * x for x in rate.dual)
        force = self.names.vector(f"fc_{self.link}", force, "N", f"inertia force of {self.link}")
        parts = zip(
            product(self.body.matrix, rate.real),
            cross(w, self.spin),
            cross(self.body.centre, force),
            strict=True,
        )
        return DualVector(force, tuple(a + b + c for a, b, c in parts))

    @property
    def kinetic_energy(self) -> sp.Expr:
        """Kinetic energy [J]."""
        v = self.names.scalar(
            f"vc2_{self.link}", dot(self.velocity.dual, self.velocity.dual), "m^2/s^2", "speed squared"
        )
        return (self.body.mass * v + dot(self.velocity.real, self.spin)) / 2


def _at(motion: DualVector, point: Triple) -> DualVector:
    """Return (w; v + w x point): the same motion about another point."""
    moved = cross(motion.real, point)
    return DualVector(motion.real, tuple(v + x for v, x in zip(motion.dual, moved, strict=True)))


def along(
    body: Inertia, motion: DualVector, at_rest: DualVector, names: Names, link: str
) -> tuple[sp.Expr, sp.Expr]:
    """Return the inertia of a body along a motion of its frame, and the power of its weight on this motion.

    All velocities that the closure of a loop with one freedom allows are multiples q' = s n of one motion n.
    Scaled so that the inertias along n sum to 1, the kinetic energy is s^2/2. Its rate s s' is the power s F
    of weights and loads, of which F is that on n. So s' = F at every speed, also at rest.

    Parameters
    ----------
    motion
        (w; v) of the frame in n.
    at_rest
        Acceleration of the frame at rest relative to free fall.
    """
    moved = names.screw(link, _at(motion, body.centre), _RATE_AT_CENTRE, f"of {link}")
    turning = names.vector(f"free_hc_{link}", product(body.matrix, moved.real), "N*m", f"moment, {link}")
    inertia = body.mass * dot(moved.dual, moved.dual) + dot(moved.real, turning)
    return inertia, -body.mass * dot(at_rest.dual, moved.dual)


def rate_in_space(rate: DualVector, velocity: DualVector, momentum: DualVector) -> DualVector:
    """Return the rate of a dual momentum in space from that of its components in a frame, Eqs. (59)-(61)."""
    return rate + velocity.cross(momentum)


def effort(motion: JointMotion, wrench: DualVector) -> sp.Expr:
    """Return the virtual power of a wrench on a unit of a motion: the reciprocal product, force.v + moment.w.

    The wrench may be given in the frame before or after the motion; the result is the same.
    """
    return motion.screw.dot(wrench).dual


def inward(
    row: Sequence[JointMotion], wrench: DualVector, names: Names, label: str
) -> tuple[DualVector, list[sp.Expr]]:
    """Transform a wrench from after a row to before it; also return its effort at each motion."""
    efforts: list[sp.Expr] = []
    for m in reversed(row):
        where = f"in the frame before {m.entry} of row {m.row}"
        wrench = names.screw(f"{label}{m.name}", m.matrix.times(wrench), WRENCH, where)
        efforts.append(effort(m, wrench))
    return wrench, efforts[::-1]


def balance(transform: DualMatrix, before: DualVector, behind: DualVector, inertia: DualVector) -> DualVector:
    """Return what vanishes in the equilibrium of a link, in its frame, Eqs. (62)-(64).

    ``before`` and ``behind`` are the wrenches of its two joints, each of the link before the joint on the one
    behind it, in the frame before the joint; ``transform`` is that of its row.
    """
    return transform.T.times(before) - behind - inertia


def joint_wrenches(
    rows: Sequence[Sequence[JointMotion]],
    net: Sequence[DualVector],
    last: DualVector,
    names: Names,
    label: str,
) -> tuple[list[DualVector], list[list[sp.Expr]]]:
    """Return the wrench of every link on the next, and its effort at each motion of their joint.

    The equilibrium W_k - W_{k+1} + applied = inertia of link k, from the last link inward, Eqs. (62)-(64).

    Parameters
    ----------
    rows
        The motions of every row.
    net
        Inertia wrench minus the applied one of each moving link, in the frame after its row.
    last
        The wrench of the last moving link on the ground, in the first frame, which follows the last row.
        Zero gives the joint wrenches of inertia and loads alone.

    Returns
    -------
    wrenches, efforts
        For each joint: the wrench of the link before it on the link after it, in the frame before its row;
        and for each motion of the row the reciprocal product with its screw.
    """
    wrench = last
    wrenches, efforts = [], []
    for row, inertia_wrench in zip(reversed(rows), [None, *reversed(net)], strict=True):
        if inertia_wrench is not None:
            wrench = names.screw(f"{label}net{row[0].row}", wrench + inertia_wrench, WRENCH, "summed")
        wrench, effort = inward(row, wrench, names, label)
        wrenches.append(wrench)
        efforts.append(effort)
    return wrenches[::-1], efforts[::-1]
