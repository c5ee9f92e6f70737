"""Names that a scene may not give, because symgen gives them itself."""

from __future__ import annotations

import re
from collections.abc import Collection
from keyword import iskeyword

from symgen.errors import SceneError
from symgen.loads import LOADS
from symgen.scene.expressions import FUNCTIONS
from symgen.scene.schema import Scene

_RESERVED = {"t", "pi", *FUNCTIONS}
#: Name of a load in its own expressions.
_THIS = "this"
#: Name prefixes of guides, switching points, angles in loads and motions, and of most kinds of loads.
_OTHERS = ("guide", "switch", "turned", "motion")
#: Names of the components of points and of links in the derivation, of points added to bodies, and of lugs of
#: points off the line of an elastic link.
_OF_POINT = re.compile(r"(?P<owner>.+)_[va]?[xyz]")
_OF_LINK = re.compile(r"(?P<owner>.+)_d[xyz](_rate)?")
_ADDED = re.compile(r"(?P<owner>.+)_base[1-3]")
_OF_LUG = re.compile(r"(?P<owner>.+)_(lug|foot)")


def check_names(scene: Scene) -> None:
    """Raise SceneError for a named part of a scene whose name has a meaning already."""
    for name, parameter in scene.parameters.items():
        problem = _word(name) or (_quantity(name, scene) if parameter.tunable else "")
        _refuse(problem, f"parameters.{name}")
    for name in scene.inputs:
        twice = f"{name!r} is a parameter already" if name in scene.parameters else ""
        _refuse(_word(name) or _quantity(name, scene) or twice, f"inputs.{name}")
    for name in scene.states:
        _refuse(_word(name) or _quantity(name, scene) or _state(name, scene), f"states.{name}")
    outputs = getattr(scene, "outputs", ())
    for i, output in enumerate(outputs):
        known = [*scene.states, *(x.name for x in outputs[:i])]
        twice = f"{output.name!r} is a state or an output already" if output.name in known else ""
        _refuse(twice or _quantity(output.name, scene) or _state(output.name, scene), f"outputs.{i}.name")
    for name in scene.tables:
        kind = "a parameter" if name in scene.parameters else "an input" if name in scene.inputs else ""
        _refuse(_word(name) or (kind and f"{name!r} is {kind} already"), f"tables.{name}")
    for name in scene.points:
        _refuse(_owner(name) or _added(name, scene), f"points.{name}")
    rows = _rows(scene)
    for name in scene.links:
        row = _numbered(name) or name in rows
        of_symgen = f"{name!r} is reserved for a spring or another load, a guide, a drive or a joint"
        _refuse(_owner(name) or _added(name, scene) or (of_symgen if row else ""), f"links.{name}")


def check_word(name: str, where: str) -> None:
    """Raise SceneError for a name that has a meaning in expressions already."""
    _refuse(_word(name), where)


def is_reserved(name: str, scene: Scene) -> bool:
    """Return whether a quantity of symgen is called so."""
    return bool(_quantity(name, scene))


def _numbered(name: str) -> bool:
    """Return whether a name is that of a numbered item, or is derived from one."""
    words = [kind.noun.replace(" ", "_") for kind in LOADS.values() if kind.named]
    return bool(re.fullmatch(rf"({'|'.join((*words, *_OTHERS))})_[0-9]+(_.*)?", name))


def _refuse(problem: str, where: str) -> None:
    if problem:
        raise SceneError(problem, where=where, hint="Choose another name.")


def _word(name: str) -> str:
    if name in _RESERVED:
        meaning = ": the time" if name == "t" else ""
        return f"{name!r} already has a meaning in expressions{meaning}"
    return f"{name!r} is a word of Python, which expressions cannot use as a name" if iskeyword(name) else ""


def _owner(name: str) -> str:
    return f"{name!r} is the name of a load in its own expressions" if name == _THIS else ""


def _added(name: str, scene: Scene) -> str:
    """Return a complaint if a name is that of a point or link that symgen may add."""
    added, lug = _ADDED.fullmatch(name), _OF_LUG.fullmatch(name)
    if added and added["owner"] in scene.links:
        return f"{name!r} is reserved for a point of the link {added['owner']}"
    if lug and lug["owner"] in scene.points and any(k.elastic for k in scene.links.values()):
        return f"{name!r} is reserved for a part of the rigid joint of {lug['owner']}"
    return ""


def _quantity(name: str, scene: Scene) -> str:
    """Return a complaint if a tunable parameter or an input is called as a quantity of symgen is."""
    point, link = _OF_POINT.fullmatch(name), _OF_LINK.fullmatch(name)
    if point and (point["owner"] in scene.points or _added(point["owner"], scene)):
        return f"{name!r} is reserved for a component of the point {point['owner']}"
    if link and (link["owner"] in scene.links or link["owner"] in _rows(scene)):
        return f"{name!r} is reserved for a component of the link {link['owner']}"
    if _numbered(name) or name.endswith("_lambda"):
        return f"{name!r} is reserved for a quantity of a spring or another load, or a multiplier"
    return ""


def _state(name: str, scene: Scene) -> str:
    """Return a complaint if a state is called as another part of the scene is, or its rate or integral."""
    quantities = {**scene.parameters, **scene.inputs}
    kinds: list[tuple[str, Collection[str]]] = [("a parameter", scene.parameters), ("an input", scene.inputs)]
    for kind, known in (*kinds, ("a point", scene.points), ("a link", scene.links)):
        if name in known:
            return f"{name!r} is {kind} already"
    taken = next((x for x in (f"{name}_rate", f"{name}_integral") if x in (*quantities, *scene.states)), "")
    return f"{taken!r} is reserved for a quantity of the state {name}" if taken else ""


def _rows(scene: Scene) -> set[str]:
    """Return the names of constraints other than those derived from the name of one link."""
    rows = {f"{link}_drive" for link in scene.driven}
    rows |= {f"{link}_hinge" for joint in scene.joints for link in joint.links}
    placed: dict[str, list[str]] = {}
    for name, point in scene.points.items():
        placed.setdefault(point.on or "", []).append(name)
    for name, link in scene.links.items():
        rows |= {f"{name}_{p}_{axis}" for p in (*link.points, *placed.get(name, ())) for axis in "xyz12"}
        base = [*link.points, *(f"{name}_base{i}" for i in range(1, 4))]
        rows |= {f"{name}_{a}_{b}" for a in base for b in base}
    return rows
