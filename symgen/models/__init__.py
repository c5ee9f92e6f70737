"""From a resolved scene, or a building block's name, to a System."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from symgen.elements import ELEMENTS

if TYPE_CHECKING:
    from symgen.mechanics.rods.recursion import Recursion
    from symgen.symbolic.system import System

# Derivations are imported on first use, since kernels depend on all loaded modules.


def _rod(dimension: int) -> System:
    from symgen.models.rod import rod_system

    return rod_system(dimension)


def _chain(dimension: int) -> Recursion:
    from symgen.mechanics.rods.recursion import chain_recursion

    return chain_recursion(dimension)


def _rigid_element() -> System:
    from symgen.models.elastic.rigid_element import rigid_element_system

    return rigid_element_system()


def _elastic_place() -> System:
    from symgen.models.elastic.place import elastic_place_system

    return elastic_place_system()


def _corotational_beam() -> System:
    from symgen.models.elastic.corotational import corotational_beam_system

    return corotational_beam_system()


def _of_loop(name: str) -> System:
    from symgen.models.loop import blocks as loop_blocks

    made: System = getattr(loop_blocks, f"{name}_system")()
    return made


def _of_synthesis(name: str) -> System:
    from symgen.models import synthesis

    made: System = getattr(synthesis, f"{name.removeprefix('synthesis_')}_system")()
    return made


def element(name: str) -> System:
    """Return the System of a beam element by name."""
    from symgen.models.elastic.element import elastic_element_system

    return elastic_element_system(ELEMENTS[name])


def _elastic_derivation() -> System:
    from symgen.models.elastic.derivation import elastic_derivation_system

    return elastic_derivation_system()


#: Conditions of the synthesis of four-bars.
SYNTHESIS = ("synthesis_limits", "synthesis_dyad", "synthesis_function")

#: Building blocks by name: one line each, and one for each element.
BLOCKS: dict[str, Callable[[], System]] = {
    **{f"element_{name}": partial(element, name) for name in ELEMENTS},
    "rod": lambda: _rod(2),
    "rod_spatial": lambda: _rod(3),
    "rigid_element": _rigid_element,
    "elastic_place": _elastic_place,
    "corotational_beam": _corotational_beam,
    "loop_row": lambda: _of_loop("loop_row"),
    "loop_screws": lambda: _of_loop("loop_screws"),
    "loop_inertia": lambda: _of_loop("loop_inertia"),
    **{name: partial(_of_synthesis, name) for name in SYNTHESIS},
}

#: Building blocks that runs call: their kernels are committed under ``generated/`` and compiled at install.
#: The others are for inspection, and compiled nowhere.
SHIPPED_BLOCKS = (
    *(f"element_{name}" for name in ELEMENTS), "rigid_element", "elastic_place", "corotational_beam",
    "loop_row", *SYNTHESIS,
)  # fmt: skip

#: Steps of the derivation of a building block, for inspection, by the block's name.
DERIVATIONS: dict[str, Callable[[], System]] = {f"element_{name}": _elastic_derivation for name in ELEMENTS}

#: Recursions over rods, shipped as loops with the number of rods as an argument, by name.
RECURSIONS: dict[str, Callable[[], Recursion]] = {
    "chain": lambda: _chain(2),
    "chain_spatial": lambda: _chain(3),
}

#: Shipped scenes whose kernels are committed under ``generated/`` and compiled at install.
SHIPPED_SCENES = ("peaucellier", "slider_crank")
