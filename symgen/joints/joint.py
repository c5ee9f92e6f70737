"""Definition of a joint: the variable entries of its row of the link-joint table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint, by the entries of its row T = Z(theta + eps S) Y(eta) X(alpha + eps a).

    Attributes
    ----------
    letter, name
        Letter in the table, and name.
    varies
        The entries that are its degrees of freedom, in the order of their motions. All others are constant.
    zero
        The entries that must be zero, because the centre of the joint is at the origin of its frame.
    coupled
        Pairs (entry, freedom): the entry is the pitch times that freedom, plus its constant.
    """

    letter: str
    name: str
    varies: tuple[str, ...]
    zero: tuple[str, ...] = ()
    coupled: tuple[tuple[str, str], ...] = ()

    @property
    def freedoms(self) -> int:
        """Number of independent motions that it permits."""
        return len(self.varies)

    @property
    def is_ball(self) -> bool:
        """Whether it permits all rotations, so that it transmits no moment unless a drive does."""
        return {*self.varies} == {"theta", "eta", "alpha"}
