"""Revolute joint (hinge): the link rotates about k."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("R", "revolute", varies=("theta",))
