"""Outputs of linkages with elastic links in space; they have tangents where the motion has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.runtime.beams.energies import Energies
from symgen.runtime.elastic.large.collocation import MotionState, stacked
from symgen.runtime.elastic.large.shaking import in_space
from symgen.runtime.elastic.outputs import length_change, of_states
from symgen.runtime.elastic.space.drives import drives
from symgen.runtime.elastic.space.joints import length_of
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.elastic.space.tangents import input_power
from symgen.runtime.result.records import Variable

#: Results of the kernel ``section``, in order, with units; moments are its columns 3 to 5.
_AT_STATIONS = {
    "axial_strain": ("1", "axial strain"),
    "bending_strain_y": ("1", "strain by bending about y"),
    "bending_strain_z": ("1", "strain by bending about z"),
    "torque": ("N*m", "torque"),
    "moment_y": ("N*m", "bending moment about y"),
    "moment_z": ("N*m", "bending moment about z"),
    "stress": ("Pa", "greatest normal stress"),
    **{f"stress_{k}": ("Pa", f"normal stress of outer fibre {k}") for k in range(1, 5)},
}
_MOMENTS = slice(3, 6)


def outputs(linkage: LinkageInSpace, states: Sequence[MotionState]) -> list[Variable]:
    """Return strains and stresses at stations, joint forces and moments of links, places, energies."""
    t, q, v, a, multipliers = stacked(states)
    links, variables, axes = {k.info.link: k for k in linkage.links}, list[Variable](), ("x", "y", "z")
    for name, owner, at in linkage.stations:
        where, link = f"{name}, at {np.real(at):g} of {owner}", links[owner]
        section, first, last = (
            link.resultants(q, v, a, at),
            q[:, link.places[0, :3]],
            q[:, link.places[-1, :3]],
        )
        for k, (word, (unit, about)) in enumerate(_AT_STATIONS.items()):
            variables.append(Variable(f"{name}.{word}", unit, f"{about} at {where}", (), section[:, k]))
        place, about = section[:, -3:], f"deflection at {where} from the line between the ends"
        variables.append(
            Variable(f"{name}.deflection", "m", about, axes, place - (1 - at) * first - at * last)
        )
        variables.append(Variable(f"{name}.position", "m", f"position of {where}", axes, place))
    for name, link in links.items():
        for point, force in link.forces(q, v, a).items():
            variables.append(
                Variable(f"{name}.{point}.force", "N", f"force on {name} at {point}", axes, force)
            )
        for k, (point, sign) in enumerate(((link.info.start, -1.0), (link.info.end, 1.0))):
            about = f"moment on {name} at {point} about its line, width and thickness"
            moments = sign * link.resultants(q, v, a, float(k))[:, _MOMENTS]
            variables.append(Variable(f"{name}.{point}.moment", "N*m", about, axes, moments))
        chord = q[:, link.places[-1, :3]] - q[:, link.places[0, :3]]
        variables.append(length_change(name, length_of(chord) - link.length))
    variables += [*drives(linkage, states), *in_space(linkage, states)]
    variables += of_states(linkage.rigid.description, v, a)
    for point, place in linkage.positions(t, q).items():
        variables.append(Variable(f"{point}.position", "m", f"position of {point}", axes, place))
    kinetic, strain, potential, dissipated = linkage.energies(t, q, v, a)
    power = input_power(linkage, t, q, v, a, multipliers)
    about = "power of prescribed motions and of loads without potential"
    variables += Energies(kinetic, strain, potential, dissipated, None, None, None).variables()
    return [*variables, Variable("input_power", "W", about, (), power)]
