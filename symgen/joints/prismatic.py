"""Prismatic joint (slider): the link moves along k."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("P", "prismatic", varies=("S",))
