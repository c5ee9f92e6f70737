"""Whether gears keep their tooth from pose to pose: their constraint holds a tooth further too."""

from __future__ import annotations

import math

import numpy as np

from symgen.runtime.rods.constraints import Constraints
from symgen.runtime.rods.poses import Poses


def slips(constraints: Constraints, poses: Poses) -> bool:
    """Return whether gears mesh another tooth at some pose than at the one before.

    Between two poses no link turns by half a revolution.
    """
    d = constraints.description
    if not d.gears:
        return False
    places, _ = constraints.moving(poses)

    def turned(link: str) -> np.ndarray:
        start, end = (d.points.index(p) for p in d.links[link][:2])
        along = (places[:, end] - places[:, start]) @ np.array([1, 1j])
        return np.asarray(np.angle(along[1:] / along[:-1]))

    sums = (sum(n * turned(link) for link, n in factors.items()) for factors in d.gears)
    return any(bool(np.any(np.abs(x) > math.pi)) for x in sums)
