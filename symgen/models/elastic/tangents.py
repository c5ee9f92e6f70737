"""Tangents of what elastic links take from the rigid motion, for derivatives by parameters."""

from __future__ import annotations

from symgen.models.elastic.links import joints_system, motion_system
from symgen.models.forward_mode import tangents_of
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.system import System

#: Arguments that tangents follow, in the order of their own.
_ARGUMENTS = ("q", "u", "p", "work")


def motion_tangent_system(linkage: Linkage) -> System:
    """Return the System of tangents of ``constants``, ``links``, ``loads`` and ``shaft`` of the motion."""
    return tangents_of(motion_system(linkage), ("constants", "links", "loads", "shaft"), _ARGUMENTS)


def joints_tangent_system(linkage: Linkage) -> System:
    """Return the System of tangents of ``joints``."""
    return tangents_of(joints_system(linkage), ("joints",), _ARGUMENTS)
