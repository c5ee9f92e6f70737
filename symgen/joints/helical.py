"""Helical joint (screw): the link rotates about k and moves along it by the pitch."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("H", "helical", varies=("theta",), coupled=(("S", "theta"),))
