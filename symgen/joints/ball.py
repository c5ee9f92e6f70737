"""Ball: the link rotates about a point, by three successive rotations."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("S", "ball", varies=("theta", "eta", "alpha"), zero=("S",))
