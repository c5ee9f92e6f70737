"""A linkage with all numbers replaced by parameters, as a reference for the savings by known numbers."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symgen.scene.rods.linkage import Linkage, RigidLink
from symgen.scene.rods.run_parameters import Parameter
from symgen.symbolic.quantity import quantity

#: Properties of a link that become parameters, with their units.
_OF_LINKS = {"length": "m", "mass": "kg", "centre": "1", "offset": "m", "inertia": "kg*m^2"}


def general(linkage: Linkage) -> Linkage:
    """Return the linkage with masses, lengths, centres, inertias and gravity as tunable parameters."""
    added: list[Parameter] = []

    def parameter(name: str, unit: str, value: sp.Expr) -> sp.Expr:
        if value.free_symbols:
            return value
        variable = quantity(name, unit, f"{name} of the general model")
        added.append(Parameter(variable, value))
        return variable.symbol

    def loosened(link: RigidLink) -> RigidLink:
        values = {
            attribute: parameter(f"{attribute}_of_{link.name}", unit, getattr(link, attribute))
            for attribute, unit in _OF_LINKS.items()
            if attribute != "offset" or linkage.as_written.dimension == 2  # in space a rod has no sides
        }
        return replace(link, **values)

    links = tuple(map(loosened, linkage.links))
    masses = tuple(
        replace(m, mass=parameter(f"mass_{i}_at_{m.point}", "kg", m.mass))
        for i, m in enumerate(linkage.masses)
    )
    gravity = tuple(
        parameter(f"gravity_{axis}", "m/s^2", g)
        for axis, g in zip(linkage.axes, linkage.gravity, strict=True)
    )
    parameters = (*linkage.parameters, *added)
    return replace(linkage, links=links, masses=masses, gravity=gravity, parameters=parameters)
