"""Joints of a spatial loop, one file each; a new one is a file and a line in ``JOINTS``."""

from __future__ import annotations

from symgen.joints import ball, cylindric, helical, prismatic, revolute, universal
from symgen.joints.joint import Joint
from symgen.registry import Registry

JOINTS = Registry[Joint](
    {
        "R": revolute.JOINT,
        "P": prismatic.JOINT,
        "C": cylindric.JOINT,
        "H": helical.JOINT,
        "S": ball.JOINT,
        "U": universal.JOINT,
    }
)
