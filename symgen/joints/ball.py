"""Ball: the link turns about a point, as three turns in a row."""

from __future__ import annotations

from symgen.joints.joint import Joint

JOINT = Joint("S", "ball", varies=("theta", "eta", "alpha"), zero=("S",))
