"""What a kinematic analysis gives: a result over time, with dead centres and ranges out of reach."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.calls import checked
from symgen.runtime.result.result import Result

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class SingularPose:
    """A pose in which the drives do not determine the motion.

    Attributes
    ----------
    kind
        ``dead centre``: the drive cannot pass, the linkage turns back there; ``bifurcation``: branches of
        the motion cross there, and the one that goes on smoothly was followed.
    t
        Time [s].
    drives
        Value of every drive by name [rad or m].
    positions
        Position of every point by name [m].
    collinear
        Pairs of links that lie in one line there, if that is how it locks.
    """

    kind: str
    t: float
    drives: dict[str, float]
    positions: dict[str, list[float]]
    collinear: tuple[tuple[str, str], ...]

    def describe(self) -> str:
        """Return it as one line."""
        where = ", ".join(f"{name} = {value:.9g}" for name, value in self.drives.items())
        lines = "; ".join(f"{a} and {b} in line" for a, b in self.collinear)
        return f"{self.kind} at t = {self.t:.12g} s, {where}{f': {lines}' if lines else ''}"


@checked
class Motion(Result):
    """The result of a kinematic analysis: a :class:`Result` over the times that could be reached.

    ``drift.constraint`` and ``drift.velocity`` are the largest residuals of the recorded samples.
    """

    KIND = "kinematics"

    @property
    def singular_poses(self) -> tuple[SingularPose, ...]:
        """All dead centres and bifurcations met, in the order in which they were met."""
        return tuple(
            SingularPose(**{**p, "collinear": tuple((a, b) for a, b in p["collinear"])})
            for p in self.statistics["singular_poses"]
        )

    @property
    def dead_centres(self) -> tuple[SingularPose, ...]:
        """Poses that the drive cannot pass."""
        return tuple(p for p in self.singular_poses if p.kind == "dead centre")

    @property
    def bifurcations(self) -> tuple[SingularPose, ...]:
        """Poses in which branches of the motion cross."""
        return tuple(p for p in self.singular_poses if p.kind == "bifurcation")

    @property
    def unassemblable(self) -> tuple[Range, ...]:
        """Ranges of time [s] in which no assembly was found."""
        return tuple((a, b) for a, b in self.statistics["unassemblable"])

    @property
    def out_of_reach(self) -> tuple[Range, ...]:
        """Ranges of time [s] that have assemblies, none of which the motion can reach."""
        return tuple((a, b) for a, b in self.statistics["out_of_reach"])

    @property
    def headline(self) -> str:
        """What a plot says of the analysis."""
        return f"kinematics, {self.count} poses; constraints within {self.drift.constraint:.1e} m"
