"""From a resolved scene, or a building block's name, to a System."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
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


def derivation(name: str) -> System:
    """Return the System of the steps by which a beam element is derived."""
    return _call_entry("models.elastic.derivation:elastic_derivation_system", ELEMENTS[name])


def tangents(block: str, kernels: Sequence[str], groups: Sequence[str]) -> System:
    """Return the System of the tangents of kernels of a building block, by its name."""
    return _call_entry("models.forward_mode:tangents_of", BLOCKS[block](), kernels, groups)


#: Kernels of an element, all of which have tangents.
_OF_ELEMENTS = ("mass", "gyroscopic", "stiffness", "geometric", "load", "shape")


@dataclass(frozen=True, slots=True)
class BuildingBlock:
    """A building block: its content in one line, and the function that derives its System."""

    about: str
    derive: Callable[[], System]

    def __call__(self) -> System:
        """Return the derived System."""
        return self.derive()


def _block(about: str, entry: str, *arguments: Any) -> BuildingBlock:
    return BuildingBlock(about, partial(_call_entry, entry, *arguments))


def _tangents(of: str, block: str, kernels: Sequence[str], groups: Sequence[str]) -> BuildingBlock:
    return BuildingBlock(f"tangents of the kernels of {of}", partial(tangents, block, kernels, groups))


_SYNTHESIS_ABOUT = {
    "limits": "limit positions of a crank-rocker",
    "spherical_limits": "limit positions of a spherical crank-rocker",
    "slider_limits": "limit positions of a slider-crank",
    "dyad": "a dyad in one pose of the coupler",
    "slide": "a slider in one pose of the coupler",
    "spherical_dyad": "a spherical dyad in one pose of the coupler",
    "function": "crank and rocker at one precision point",
    "slider_function": "crank and slider at one precision point",
    "spherical_function": "crank and rocker on a sphere at one precision point",
}

#: Building blocks by name: one line each, and one for each element.
BLOCKS: dict[str, BuildingBlock] = {
    "rod": _block("one rigid rod in the plane", "models.rod:rod_system", 2),
    "rod_spatial": _block("one rigid rod in space", "models.rod:rod_system", 3),
    "chain": _block(
        "steps of the recursion over a chain of rods in the plane", "mechanics.rods.chain:chain_system", 2
    ),
    "chain_spatial": _block(
        "steps of the recursion over a chain of rods in space", "mechanics.rods.chain:chain_system", 3
    ),
    "loop_row": _block("transform of a row of a link-joint table", "models.loop.blocks:loop_row_system"),
    "loop_screws": _block("screws of a row of a link-joint table", "models.loop.blocks:loop_screws_system"),
    "loop_inertia": _block("momentum and inertia of a link", "models.loop.blocks:loop_inertia_system"),
    "four_bar_motion": _block(
        "motion of a planar four-bar in closed form", "models.loop.four_bar:four_bar_motion_system"
    ),
    **{
        f"element_{x}": BuildingBlock(f"beam element {x} of elastic links", partial(element, x))
        for x in ELEMENTS
    },
    **{
        f"element_{x}_tangents": _tangents(f"element_{x}", f"element_{x}", _OF_ELEMENTS, ("q", "u"))
        for x in ELEMENTS
    },
    "elastic_place": _block(
        "mass, load or force at one place of an elastic link", "models.elastic.place:elastic_place_system"
    ),
    "elastic_place_tangents": _tangents("elastic_place", "elastic_place", ("point",), ("q",)),
    "rigid_element": _block(
        "one rigid element of a link in the plane", "models.elastic.rigid_element:rigid_element_system"
    ),
    "corotational_beam": _block(
        "beam element in large rotation", "models.elastic.corotational:corotational_beam_system"
    ),
    "corotational_node": _block(
        "bodies, forces and directions at a node in large rotation",
        "models.elastic.corotational:corotational_node_system",
    ),
    "director_beam": _block(
        "beam element in space in large rotation", "models.directors:director_beam_system"
    ),
    "director_beam_tangents": _tangents(
        "director_beam", "director_beam", ("residual", "tangent", "energies", "section"), ("q", "u", "p")
    ),
    "direction": _block("constraint on the directions of two sections", "models.directions:direction_system"),
    "direction_tangents": _tangents("direction", "direction", ("row", "curvature"), ("q", "u")),
    **{
        f"synthesis_{name}": _block(f"synthesis: {about}", f"models.synthesis:synthesis_{name}_system")
        for name, about in _SYNTHESIS_ABOUT.items()
    },
}

_COMMITTED = {
    "elements": (
        *(f"element_{name}{ending}" for name in ELEMENTS for ending in ("", "_tangents")),
        *("rigid_element", "elastic_place", "elastic_place_tangents"),
    ),
    "large_rotation": (
        *("corotational_beam", "corotational_node", "director_beam", "director_beam_tangents"),
        *("direction", "direction_tangents"),
    ),
    "loops": ("loop_row",),
    "synthesis": tuple(f"synthesis_{name}" for name in _SYNTHESIS_ABOUT),
}
#: Building blocks that runs call, with the folder of ``generated/`` that holds their kernels, which are
#: compiled at install. The other blocks are for inspection, and compiled nowhere.
SHIPPED_BLOCKS = {name: folder for folder, names in _COMMITTED.items() for name in names}

#: Steps of the derivation of a building block, for inspection, by the block's name.
DERIVATIONS: dict[str, Callable[[], System]] = {
    **{f"element_{x}": partial(derivation, x) for x in ELEMENTS},
    "synthesis_limits": partial(_call_entry, "models.synthesis:synthesis_limits_derived"),
}

#: Recursions over rods, shipped as loops with the number of rods as an argument, by name.
RECURSIONS: dict[str, Callable[[], Recursion]] = {
    "chain": partial(_call_entry, "mechanics.rods.recursion:chain_recursion", 2),
    "chain_spatial": partial(_call_entry, "mechanics.rods.recursion:chain_recursion", 3),
}

#: Shipped scenes whose kernels are committed under ``generated/`` and compiled at install.
SHIPPED_SCENES = ("peaucellier", "slider_crank")
