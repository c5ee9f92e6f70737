"""Hooke joint: the link turns about k, then about j; the two axes meet at right angles."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("U", "universal", varies=("theta", "eta"), zero=("S",))
