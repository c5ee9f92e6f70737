"""Result of an analysis of the forces in rigid links, over the motion of the drive."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symgen.calls import checked
from symgen.runtime.result.result import Result


@checked
class Forces(Result):
    """Joint forces, section forces and driving torques over a motion of rigid links.

    ``LINK.POINT.force`` is the force on a link at a point, ``POINT.reaction`` the force of the ground on the
    linkage, ``LINK.torque`` the torque of a drive, ``LINK.POINT.guide_force`` the force of a guide on a point
    to the left of the link. At a section at a fraction s of the length, ``LINK@s.axial_force`` is positive in
    tension; a positive ``LINK@s.shear_force`` pushes the part before the section to the left; a positive
    ``LINK@s.moment`` stretches the fibres to the left of the link (thesis, Chapter IV; minus E I w'' of the
    elastic link).
    """

    KIND = "forces"

    def __repr__(self) -> str:
        return f"<Forces {self.name!r}: {self.count} poses, condition {self.condition:.3g}>"

    @property
    def condition(self) -> float:
        """Largest condition number of the equations of the joint forces; in space of the constraints."""
        return float(self.statistics["condition"])

    @property
    def greatest(self) -> Mapping[str, tuple[float, float]]:
        """Largest magnitude of every output, and the value of the coordinate [SI] at which it occurs."""
        along, greatest = self.coordinate.values, {}
        for v in self.variables:
            size = np.linalg.norm(v.values.reshape(len(along), -1), axis=1)
            greatest[v.name] = float(np.max(size)), float(along[np.argmax(size)])
        return greatest

    @property
    def headline(self) -> str:
        """Title line of plots: elements, poses and condition."""
        elements = self.statistics["elements"]  # none in space
        parts = "one element" if elements == 1 else f"{elements} elements"
        poses = "one pose" if self.count == 1 else f"{self.count} poses"
        links = f"rigid links of {parts}" if elements else "forces by multipliers"
        return f"{links}, {poses}; condition {self.condition:.3g}"

    @property
    def check(self) -> str:
        """How well forces balance; in space how well accelerations by forces are those of the drives."""
        by, size = "balance", "force"
        if not self.statistics["elements"]:
            by, size = "accelerations by drives", "acceleration"
        return f"{by} met within {self.statistics['residual']:.1e} of the largest {size}"
