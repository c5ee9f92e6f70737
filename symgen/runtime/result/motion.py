"""Result of a kinematic analysis over time, with dead centres and ranges out of reach."""

from __future__ import annotations

from symgen.calls import checked
from symgen.runtime.result.result import Result

Range = tuple[float, float]


@checked
class Motion(Result):
    """The result of a kinematic analysis: a :class:`Result` over the times that could be reached.

    ``drift.constraint`` and ``drift.velocity`` are the largest residuals of the recorded samples.
    """

    KIND = "kinematics"

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
        """Title line of plots: poses and constraint error."""
        return f"kinematics, {self.count} poses; constraints within {self.drift.constraint:.1e} m"
