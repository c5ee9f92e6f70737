"""The deformed shape of a linkage: where its joints are, how far its links bend between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beams.forces import Motion
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.records import Variable

Array = NDArray[np.float64]


def recovered(motion: ElasticMotion, found: Motion) -> list[Variable]:
    """Return the deformed position of every joint that moves and the deflection at every station."""
    d, names, made = motion.rigid.description, motion.layout.names, []
    for k, point in enumerate(d.free):
        columns = [names.index(f"{point}.{axis}") for axis in d.axes]
        place = found.q[:, 2 * k : 2 * k + 2] + found.displacements[:, columns]
        made.append(Variable(f"{point}.position", "m", f"deformed position of {point}", ("x", "y"), place))
    for name, k, at, _ in motion.stations:
        beam = motion.beams[k]
        own = motion.own_unknowns(k, found.links, found.displacements)
        about = f"deflection of {beam.info.link} from the line between its ends, at {at:g} of its length"
        made.append(Variable(f"{name}.deflection", "m", about, (), deflection(beam, own, at)))
    return made


def deflection(beam: Beam, own: Array, at: float) -> Array:
    """Return the displacement across a link [m] less that of the straight line between its ends, (times,)."""
    (_, first), *_, (_, last) = beam.joints
    found: Array = own @ beam.rows(at).w - (1 - at) * own[:, first] - at * own[:, last]
    return found
