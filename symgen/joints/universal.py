"""Universal joint (Hooke joint): the link rotates about k, then about j; the two axes are perpendicular."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("U", "universal", varies=("theta", "eta"), zero=("S",))
