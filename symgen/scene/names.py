"""Names that a scene may not give, because symgen gives them itself."""

from __future__ import annotations

import re
from keyword import iskeyword

from symgen.errors import SceneError
from symgen.scene.expressions import FUNCTIONS
from symgen.scene.schema import Scene

_RESERVED = {"t", "pi", *FUNCTIONS}
#: What springs and guides, which have no names of their own, are called, and what is made from that.
_NUMBERED = re.compile(r"(spring|guide)_[0-9]+(_.*)?")
#: What the derivation calls the components of points and of links.
_OF_POINT = re.compile(r"(?P<owner>.+)_[va]?[xyz]")
_OF_LINK = re.compile(r"(?P<owner>.+)_d[xyz](_rate)?")


def check_names(scene: Scene) -> None:
    """Raise SceneError for a parameter or a link whose name has a meaning already."""
    for name, parameter in scene.parameters.items():
        problem = _word(name) or (_quantity(name, scene) if parameter.tunable else "")
        if problem:
            raise SceneError(problem, where=f"parameters.{name}", hint="Choose another name.")
    for name in scene.links:
        if _NUMBERED.fullmatch(name) or name in _rows(scene):
            raise SceneError(
                f"{name!r} is what symgen calls a spring, a guide, a drive or a joint",
                where=f"links.{name}",
                hint="Choose another name.",
            )


def _word(name: str) -> str:
    if name in _RESERVED:
        return f"{name!r} already has a meaning in expressions"
    return f"{name!r} is a word of Python, which expressions cannot use as a name" if iskeyword(name) else ""


def _quantity(name: str, scene: Scene) -> str:
    """Say so when a tunable parameter is called like a quantity of a point, a link or a spring."""
    point, link = _OF_POINT.fullmatch(name), _OF_LINK.fullmatch(name)
    if point and point["owner"] in scene.points:
        return f"{name!r} is what symgen calls a component of the point {point['owner']}"
    if link and link["owner"] in scene.links:
        return f"{name!r} is what symgen calls a component of the link {link['owner']}"
    if _NUMBERED.fullmatch(name) or name.endswith("_lambda"):
        return f"{name!r} is what symgen calls a quantity of a spring, or a multiplier"
    return ""


def _rows(scene: Scene) -> set[str]:
    """Return the names of constraints that are not made from the name of one link alone."""
    joints = {f"{k}_{p}_{axis}" for k, link in scene.links.items() for p in link.points[2:] for axis in "xyz"}
    return joints | {f"{driver.link}_drive" for driver in scene.drivers}
