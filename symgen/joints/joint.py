"""What a joint is: which entries of its row of the link-joint table vary."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint, by the entries of its row T = Z(theta + eps S) Y(eta) X(alpha + eps a).

    Attributes
    ----------
    letter, name
        Its letter in the table, and its name.
    varies
        The entries that are its freedoms, in the order of their motions. Every other one is constant.
    zero
        The entries that must be zero, because its centre stands at the origin of its frame.
    coupled
        Pairs (entry, freedom): the entry is the pitch times that freedom, plus the constant it is given.
    """

    letter: str
    name: str
    varies: tuple[str, ...]
    zero: tuple[str, ...] = ()
    coupled: tuple[tuple[str, str], ...] = ()

    @property
    def freedoms(self) -> int:
        """Number of independent motions that it leaves."""
        return len(self.varies)
