"""Rows of a link-joint table as dual matrices: transforms, paths, screws and the operators of the closure.

Source: S. Rahman, *Dynamic Analysis of the Generalized Slider Crank* (1991), Eqs. (1)-(18), for any row
T = Z(theta + eps S) Y(eta) X(alpha + eps a). T places frame {i+1} in frame {i}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.symbolic.dual import (
    Dual,
    DualMatrix,
    DualVector,
    Triple,
    beside,
    identity,
    operator,
    product,
    rotation,
    rows_of,
    skew,
)
from symgen.symbolic.names import Names
from symgen.symbolic.vectors import cross

_ZERO, _ONE = sp.Integer(0), sp.Integer(1)

#: Motions of a row in their order: the axis, and whether it is a rotation about it or a translation along it.
MOTIONS = {"theta": (2, True), "S": (2, False), "eta": (1, True), "alpha": (0, True), "a": (0, False)}
#: Constant rotation about i before the others, for ball joints: it moves the pole of their three angles.
AHEAD = "ahead"
_KINDS = {AHEAD: (0, True), **MOTIONS}


def axis(number: int) -> Triple:
    """Return the unit vector of a coordinate axis."""
    x, y, z = (_ONE if i == number else _ZERO for i in range(3))
    return x, y, z


@dataclass(frozen=True, slots=True)
class JointMotion:
    """One entry of a row: a rotation or a translation by its value.

    Attributes
    ----------
    row
        The row, counted from 1.
    entry
        theta, S, eta, alpha or a; or AHEAD.
    value
        Angle [rad] or translation [m], linear in the joint variables.
    slopes
        Pairs (number of a joint variable, derivative of the value by it); empty for a constant.
    """

    row: int
    entry: str
    value: sp.Expr
    slopes: tuple[tuple[int, sp.Expr], ...] = ()

    @property
    def name(self) -> str:
        """Name of entry and row."""
        return f"{self.entry}{self.row}"

    @property
    def angle(self) -> Dual:
        """Dual angle."""
        return Dual(self.value) if _KINDS[self.entry][1] else Dual(_ZERO, self.value)

    @property
    def matrix(self) -> DualMatrix:
        """Dual matrix."""
        return rotation(_KINDS[self.entry][0], self.angle)

    @property
    def screw(self) -> DualVector:
        """Unit screw, the same in the frames before and after the motion."""
        number, turns = _KINDS[self.entry]
        return DualVector(axis(number), axis(-1)) if turns else DualVector(axis(-1), axis(number))

    def rate(self, rates: Sequence[sp.Expr]) -> sp.Expr:
        """Return the rate of the value, from the rates of all joint variables."""
        return sp.Add(*(slope * rates[j] for j, slope in self.slopes))


def motions(
    row: int, entries: Sequence[sp.Expr], variables: Sequence[sp.Symbol], ahead: sp.Expr = _ZERO
) -> tuple[JointMotion, ...]:
    """Return the nonzero motions of a row; ``entries`` are theta, S, eta, alpha, a."""
    of_row = []
    for entry, value in zip(_KINDS, (ahead, *entries), strict=True):
        slopes = ((j, sp.diff(value, v)) for j, v in enumerate(variables))
        if value != 0:
            of_row.append(JointMotion(row, entry, value, tuple((j, k) for j, k in slopes if k != 0)))
    return tuple(of_row)


def name_functions(motion: JointMotion, names: Names) -> None:
    """Name cosine and sine of a rotation, so that equations contain the names."""
    if _KINDS[motion.entry][1]:
        for function in (sp.cos, sp.sin):
            description = f"{function.__name__} of {motion.entry} of row {motion.row}"
            names.scalar(f"{function.__name__}_{motion.name}", function(motion.value), "1", description)


def row_transform(row: Sequence[JointMotion]) -> DualMatrix:
    """Return T = Z(theta + eps S) Y(eta) X(alpha + eps a) of a row's motions, Eqs. (1)-(4)."""
    transform = identity()
    for m in row:
        if m.entry == AHEAD:
            transform = m.matrix
    for number in (2, 1, 0):
        angle = sum((m.angle for m in row if MOTIONS.get(m.entry, (-1,))[0] == number), Dual(_ZERO))
        transform = transform @ rotation(number, angle)
    return transform


def derivative_operator(motion: JointMotion, before: DualMatrix) -> DualMatrix:
    """Return the operator H = M Q M^T of a motion, Eqs. (12)-(17): dB/d(value) = H B.

    ``before`` is the product M of all matrices before the motion. Q is the operator of its own axis, Eqs. (8)
    to (10); that of eta in Eq. (9) contains the rotation by theta, which here belongs to M. Since M is
    orthogonal, H is the operator of the screw that M carries into the first frame.
    """
    return operator(before.times(motion.screw))


@dataclass(frozen=True, slots=True)
class Frame:
    """Pose of a frame: its axes as columns of ``turn``, and its origin."""

    turn: sp.ImmutableMatrix
    origin: Triple

    @property
    def dual(self) -> DualMatrix:
        """Return the frame as a dual matrix R + eps [p]x R."""
        return DualMatrix(self.turn, sp.ImmutableMatrix(skew(self.origin) * self.turn))

    @property
    def inverse(self) -> Frame:
        """Return the inverse: the reference frame relative to this frame."""
        return Frame(self.turn.T, self.seen(tuple(-x for x in self.origin)))

    def vector(self, components: Sequence[sp.Expr]) -> Triple:
        """Return a vector given by its components in the frame."""
        return product(self.turn, components)

    def point(self, components: Sequence[sp.Expr]) -> Triple:
        """Return a point given by its components in the frame."""
        x, y, z = (p + v for p, v in zip(self.origin, self.vector(components), strict=True))
        return x, y, z

    def seen(self, vector: Sequence[sp.Expr]) -> Triple:
        """Return the components of a vector in the frame."""
        return product(self.turn.T, vector)

    def screw(self, screw: DualVector) -> DualVector:
        """Return a screw given by its components in the frame."""
        real, dual = self.vector(screw.real), self.vector(screw.dual)
        moved = cross(self.origin, real)
        return DualVector(real, (dual[0] + moved[0], dual[1] + moved[1], dual[2] + moved[2]))


GROUND = Frame(sp.ImmutableMatrix(sp.eye(3)), axis(-1))


def onward(frame: Frame, motion: JointMotion, names: Names, label: str, back: bool = False) -> Frame:
    """Return the frame after a motion, or the one before it if ``back``."""
    number, turns = _KINDS[motion.entry]
    of = f"of the frame {'before' if back else 'after'} motion {motion.name}, in the first frame"
    if turns:
        angle = motion.matrix.T if back else motion.matrix
        columns = [
            names.vector(f"{letter}_{label}", frame.vector(axis), "1", f"axis {letter} {of}")
            for letter, axis in zip("ijk", rows_of(angle.T.real), strict=True)
        ]
        return Frame(beside(columns), frame.origin)
    shift = -motion.value if back else motion.value
    origin = [p + shift * x for p, x in zip(frame.origin, frame.vector(axis(number)), strict=True)]
    return Frame(frame.turn, names.vector(f"p_{label}", origin, "m", f"origin {of}"))
