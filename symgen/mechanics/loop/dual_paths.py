"""Closure of a closed loop of rows, and motion propagated along it from both of its ends.

Source: S. Rahman, *Dynamic Analysis of the Generalized Slider Crank* (1991), Eqs. (5)-(18) for positions,
(29)-(45) for velocities, in the corrected form: every relative motion about its own axis.

The frame after the last row is that of the ground, as is the one before the first. So every link can be
reached from either end (the mixed form of the source): motions before ``meet`` are propagated outward from
the first frame, the others backward from the last. Both paths give the same result on a closed loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import accumulate

import sympy as sp

from symgen.mechanics.loop.dual_rows import (
    GROUND,
    Frame,
    JointMotion,
    derivative_operator,
    name_functions,
    onward,
    row_transform,
)
from symgen.symbolic.dual import DualMatrix, DualVector, identity
from symgen.symbolic.names import Names

_ZERO = sp.Integer(0)
NOTHING = DualVector((_ZERO,) * 3, (_ZERO,) * 3)

#: Letter, unit and meaning of the parts of dual vectors.
VELOCITY = (("w", "rad/s", "angular velocity,"), ("v", "m/s", "velocity at the origin,"))
ACCELERATION = (
    ("dw", "rad/s^2", "rate of the angular velocity,"),
    ("dv", "m/s^2", "rate of the velocity at the origin,"),
)
WRENCH = (("f", "N", "force,"), ("n", "N*m", "moment about the origin,"))


class Paths:
    """Loop of rows, each a sequence of motions; intermediates are named as they arise.

    Parameters
    ----------
    rows
        The motions of every row.
    rates
        Rates of all joint variables.
    names
        Collector of the intermediates.
    meet
        Number of motions propagated outward: by default half of the variable ones, and constant ones after
        them. With all motions, every link is reached by the forward path, with none by the backward one.
    """

    def __init__(
        self,
        rows: Sequence[Sequence[JointMotion]],
        rates: Sequence[sp.Expr],
        names: Names,
        meet: int | None = None,
    ) -> None:
        self.rows, self.rates, self.names = rows, tuple(rates), names
        self.motions = [m for row in rows for m in row]
        #: Number of motions up to the end of each row: frame i + 1 follows ends[i - 1] of them.
        self.ends = [sum(len(row) for row in rows[: i + 1]) for i in range(len(rows))]
        self.meet = self._halfway if meet is None else meet
        for m in self.motions:
            name_functions(m, names)

    @property
    def _halfway(self) -> int:
        varying = [i for i, m in enumerate(self.motions) if m.slopes]
        return varying[(len(varying) + 1) // 2] if len(varying) > 1 else len(self.motions)

    @cached_property
    def transforms(self) -> list[DualMatrix]:
        """Return the dual matrix of every row, Eqs. (1)-(4)."""
        return [row_transform(row) for row in self.rows]

    @cached_property
    def outward(self) -> list[Frame]:
        """Return the frame before every motion and after the last, from the first frame outward."""
        frames = [GROUND]
        for m in self.motions:
            frames.append(onward(frames[-1], m, self.names, m.name))
        return frames

    @property
    def closure(self) -> Frame:
        """Return B = T_1 ... T_n, Eq. (18): the frame after the last row, which must equal the first."""
        return self.outward[-1]

    @property
    def exact_screws(self) -> list[DualVector]:
        """Return the screws in the first frame by the forward path: the exact derivative of the closure."""
        return [frame.screw(m.screw) for frame, m in zip(self.outward, self.motions, strict=False)]

    def operator(self, variable: int) -> DualMatrix:
        """Return the operator H of a joint variable, Eqs. (12)-(17): dB/dq = H B."""
        before = (frame.dual for frame in self.outward)
        return _operator(variable, zip(self.motions, before, strict=False))

    def row_operator(self, variable: int) -> DualMatrix | None:
        """Return the operator Q of a joint variable of one row, Eqs. (2a)-(4a), (8)-(10): dT/dq = Q T."""
        rows = {m.row for m in self.motions for j, _ in m.slopes if j == variable}
        if len(rows) != 1:
            return None
        row = self.rows[rows.pop() - 1]
        before = accumulate((m.matrix for m in row), DualMatrix.__matmul__, initial=identity())
        return _operator(variable, zip(row, before, strict=False))

    def step(self, variables: Sequence[int]) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix]:
        """Return A and V of Newton's step A dq = V of some variables, Eqs. (20)-(26), corrected.

        Rows are the entries above the diagonal, of real and of dual parts: of the operators H in A, and of
        the skew part of B^T in V. To the first order, the sum of H dq is B^T - 1, and both are skew.
        """
        b = self.closure.dual
        left = [_above(self.operator(j)) for j in variables]
        right = _above(b.T + DualMatrix(-b.real, -b.dual)) / 2
        return sp.ImmutableMatrix.hstack(sp.zeros(6, 0), *left), sp.ImmutableMatrix(right)

    @cached_property
    def frames(self) -> list[Frame]:
        """Return the same frames, each by the shorter path."""
        behind = [GROUND] if self.meet < len(self.motions) else []
        for m in reversed(self.motions[self.meet + 1 :]):
            behind.append(onward(behind[-1], m, self.names, f"{m.name}_back", back=True))
        return [*self.outward[: self.meet + 1], *reversed(behind)]

    @cached_property
    def screws(self) -> list[DualVector]:
        """Return the screw of every motion in the first frame, each by the shorter path."""
        return [self.frames[i if i < self.meet else i + 1].screw(m.screw) for i, m in enumerate(self.motions)]

    @property
    def meeting_screws(self) -> list[DualVector]:
        """Return the screws in the frame where both paths meet, about its origin: the columns of Eq. (38).

        Each is carried along its own path; those of constant motions are zero.
        """
        ahead: list[DualVector] = []
        for m in self.motions[: self.meet]:
            ahead = [*(m.matrix.T.times(screw) for screw in ahead), m.screw if m.slopes else NOTHING]
        behind: list[DualVector] = []
        for m in reversed(self.motions[self.meet :]):
            behind = [*(m.matrix.times(screw) for screw in behind), m.screw if m.slopes else NOTHING]
        return [*ahead, *reversed(behind)]

    def columns(self, screws: Sequence[DualVector], variables: int) -> sp.ImmutableMatrix:
        """Return the 6xN matrix of the screws of the joint variables, from the screws of the motions."""
        matrix = sp.zeros(6, variables)
        for m, screw in zip(self.motions, screws, strict=True):
            for j, slope in m.slopes:
                matrix[:, j] += slope * screw.column
        return sp.ImmutableMatrix(matrix)

    def joint_velocity(self, number: int) -> DualVector:
        """Return the velocity of the link behind a joint relative to that before it, Eqs. (29)-(32).

        It is given in the frame before the row of the joint, which carries the axes of its motions.
        """
        total, before = NOTHING, identity()
        for m in self.rows[number - 1]:
            total = total + before.times(m.screw) * m.rate(self.rates)
            before = before @ m.matrix
        return total

    @cached_property
    def velocities(self) -> list[DualVector]:
        """Return the velocity of the frame before every motion and after the last, by the shorter path."""
        outward = [NOTHING]
        for m in self.motions[: self.meet]:
            moved = self._named(outward[-1] + m.screw * m.rate(self.rates), VELOCITY, f"{m.name}_sum", m)
            outward.append(self._named(m.matrix.T.times(moved), VELOCITY, m.name, m))
        back = [NOTHING] if self.meet < len(self.motions) else []
        for m in reversed(self.motions[self.meet + 1 :]):
            seen = self._named(m.matrix.times(back[-1]), VELOCITY, f"{m.name}_turned", m)
            back.append(self._named(seen - m.screw * m.rate(self.rates), VELOCITY, m.name, m))
        return [*outward, *reversed(back)]

    def accelerations(self, second: Sequence[sp.Expr], ground: DualVector, label: str) -> list[DualVector]:
        """Return the acceleration of every frame as ``velocities`` does.

        It is d(w, v)/dt by components in the frame: the sum of $ q'' + [V, $] q' along the path.

        Parameters
        ----------
        second
            Accelerations of all joint variables.
        ground
            Acceleration of the ground in the first frame: zero, or minus that of gravity to obtain
            accelerations relative to free fall.
        label
            Prefix of the names.
        """
        outward = [ground]
        for m, velocity in zip(self.motions[: self.meet], self.velocities, strict=False):
            of_joint = m.screw * m.rate(second) + velocity.cross(m.screw * m.rate(self.rates))
            moved = self._named(outward[-1] + of_joint, ACCELERATION, f"{label}{m.name}_sum", m)
            outward.append(self._named(m.matrix.T.times(moved), ACCELERATION, f"{label}{m.name}", m))
        back = [ground] if self.meet < len(self.motions) else []
        for i in range(len(self.motions) - 1, self.meet, -1):
            m = self.motions[i]
            of_joint = m.screw * m.rate(second) + self.velocities[i].cross(m.screw * m.rate(self.rates))
            seen = self._named(m.matrix.times(back[-1]), ACCELERATION, f"{label}{m.name}_turned", m)
            back.append(self._named(seen - of_joint, ACCELERATION, f"{label}{m.name}", m))
        return [*outward, *reversed(back)]

    @property
    def parting(self) -> DualVector:
        """Return the rate of closure: the velocity by the outward path less that by the other.

        It is that of the frame where both meet, and zero along a motion.
        """
        m = self.motions[self.meet]
        of_joint = m.screw * m.rate(self.rates)
        parting = self.velocities[self.meet] + of_joint - m.matrix.times(self.velocities[self.meet + 1])
        return self._named(parting, VELOCITY, "parting", m)

    def parting_rate(self, second: Sequence[sp.Expr], accelerations: Sequence[DualVector]) -> DualVector:
        """Return the rate of ``parting``, by accelerations of all frames as from ``accelerations``."""
        m, behind = self.motions[self.meet], self.meet + 1
        turned = m.matrix.times(self.velocities[behind]).cross(m.screw * m.rate(self.rates))
        rate = accelerations[self.meet] + m.screw * m.rate(second) + turned
        return self._named(rate - m.matrix.times(accelerations[behind]), ACCELERATION, "parting", m)

    def screw_rates(self) -> list[DualVector]:
        """Return the rate [V, $] of every motion's screw, in the first frame.

        Times the rates of the motions, they sum to the velocity part of the second derivative of the
        closure: sum of $ q'' + sum of [V, $] q' = 0.
        """
        ahead: list[DualVector] = []
        velocity = NOTHING
        for i, m in enumerate(self.motions[: self.meet]):
            ahead.append(velocity.cross(self.screws[i]))
            moved = velocity + self._fixed(i) * m.rate(self.rates)
            velocity = self._named(moved, VELOCITY, f"{m.name}_fixed", m)
        velocity, behind = NOTHING, []
        for i in range(len(self.motions) - 1, self.meet - 1, -1):
            m = self.motions[i]
            behind.append(velocity.cross(self._fixed(i)))
            moved = velocity - self._fixed(i) * m.rate(self.rates)
            velocity = self._named(moved, VELOCITY, f"{m.name}_fixed", m)
        return [*ahead, *reversed(behind)]

    def _fixed(self, i: int) -> DualVector:
        kinds = (("e", "1", "axis,"), ("l", "m", "moment of the axis about the first origin,"))
        return self._named(self.screws[i], kinds, f"{self.motions[i].name}_fixed", self.motions[i])

    def _named(
        self,
        vector: DualVector,
        kinds: tuple[tuple[str, str, str], tuple[str, str, str]],
        name: str,
        motion: JointMotion,
    ) -> DualVector:
        where = f"of the frame at {motion.entry} of row {motion.row}"
        return self.names.screw(name, vector, kinds, where)


def _operator(variable: int, motions: Iterable[tuple[JointMotion, DualMatrix]]) -> DualMatrix:
    """Return the sum of the operators of motions by a joint variable, each with the product before it."""
    total = DualMatrix(sp.ImmutableMatrix(sp.zeros(3)), sp.ImmutableMatrix(sp.zeros(3)))
    for m, before in motions:
        for j, slope in m.slopes:
            if j == variable:
                h = derivative_operator(m, before)
                total = total + DualMatrix(slope * h.real, slope * h.dual)
    return total


def _above(matrix: DualMatrix) -> sp.Matrix:
    """Return the entries above the diagonal, of the real part and of the dual part."""
    return sp.Matrix([part[i, k] for part in (matrix.real, matrix.dual) for i, k in ((0, 1), (0, 2), (1, 2))])
