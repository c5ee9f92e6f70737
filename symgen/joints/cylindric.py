"""Cylindric joint: the link rotates about k and moves along it."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("C", "cylindric", varies=("theta", "S"))
