"""From a resolved scene, or a building block's name, to a System."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from symgen.elements import ELEMENTS
from symgen.registry import load

if TYPE_CHECKING:
    from symgen.mechanics.rods.recursion import Recursion
    from symgen.symbolic.system import System

# Derivations are imported on first use, since kernels depend on all loaded modules.


def _call_entry(entry: str, *arguments: Any) -> Any:
    """Return the System that the function ``module:name`` of symgen derives."""
    return load(f"symgen.{entry}")(*arguments)


def element(name: str) -> System:
    """Return the System of a beam element by name."""
    return _call_entry("models.elastic.element:elastic_element_system", ELEMENTS[name])


def tangents(block: str, kernels: Sequence[str], groups: Sequence[str]) -> System:
    """Return the System of the tangents of kernels of a building block, by its name."""
    return _call_entry("models.forward_mode:tangents_of", BLOCKS[block](), kernels, groups)


#: Conditions of synthesis.
SYNTHESIS = (
    "synthesis_limits", "synthesis_slider_limits",
    "synthesis_dyad", "synthesis_slide", "synthesis_spherical_dyad",
    "synthesis_function", "synthesis_slider_function", "synthesis_spherical_function",
)  # fmt: skip
#: Kernels of an element, all of which have tangents.
_OF_ELEMENTS = ("mass", "gyroscopic", "stiffness", "geometric", "load", "shape")
_OF_LOOPS = ("loop_row", "loop_screws", "loop_inertia")

#: Building blocks by name: one line each, and one for each element.
BLOCKS: dict[str, Callable[[], System]] = {
    **{f"element_{name}": partial(element, name) for name in ELEMENTS},
    **{
        f"element_{name}_tangents": partial(tangents, f"element_{name}", _OF_ELEMENTS, ("q", "u"))
        for name in ELEMENTS
    },
    "elastic_place_tangents": partial(tangents, "elastic_place", ("point",), ("q",)),
    "rod": partial(_call_entry, "models.rod:rod_system", 2),
    "rod_spatial": partial(_call_entry, "models.rod:rod_system", 3),
    "rigid_element": partial(_call_entry, "models.elastic.rigid_element:rigid_element_system"),
    "elastic_place": partial(_call_entry, "models.elastic.place:elastic_place_system"),
    "corotational_beam": partial(_call_entry, "models.elastic.corotational:corotational_beam_system"),
    "corotational_node": partial(_call_entry, "models.elastic.corotational:corotational_node_system"),
    "spatial_beam": partial(_call_entry, "models.elastic.spatial:spatial_beam_system"),
    "director_beam": partial(_call_entry, "models.directors:director_beam_system"),
    "director_beam_tangents": partial(
        tangents, "director_beam", ("residual", "tangent", "energies", "section"), ("q", "u", "p")
    ),
    "direction": partial(_call_entry, "models.directions:direction_system"),
    "direction_tangents": partial(tangents, "direction", ("row", "curvature"), ("q", "u")),
    **{name: partial(_call_entry, f"models.loop.blocks:{name}_system") for name in _OF_LOOPS},
    **{name: partial(_call_entry, f"models.synthesis:{name}_system") for name in SYNTHESIS},
}

#: Building blocks that runs call: their kernels are committed under ``generated/`` and compiled at install.
#: The others are for inspection, and compiled nowhere.
SHIPPED_BLOCKS = (
    *(f"element_{name}{ending}" for name in ELEMENTS for ending in ("", "_tangents")),
    "rigid_element", "elastic_place", "elastic_place_tangents", "corotational_beam", "corotational_node",
    "spatial_beam", "director_beam", "director_beam_tangents", "direction", "direction_tangents", "loop_row",
    *SYNTHESIS,
)  # fmt: skip

#: Steps of the derivation of a building block, for inspection, by the block's name.
DERIVATIONS: dict[str, Callable[[], System]] = dict.fromkeys(
    (f"element_{name}" for name in ELEMENTS),
    partial(_call_entry, "models.elastic.derivation:elastic_derivation_system"),
)

#: Recursions over rods, shipped as loops with the number of rods as an argument, by name.
RECURSIONS: dict[str, Callable[[], Recursion]] = {
    "chain": partial(_call_entry, "mechanics.rods.recursion:chain_recursion", 2),
    "chain_spatial": partial(_call_entry, "mechanics.rods.recursion:chain_recursion", 3),
}

#: Shipped scenes whose kernels are committed under ``generated/`` and compiled at install.
SHIPPED_SCENES = ("peaucellier", "slider_crank")
