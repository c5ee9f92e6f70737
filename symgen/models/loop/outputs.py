"""Outputs of a scene with a loop; one line each in the tables below."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.symbolic.dual import Triple
from symgen.symbolic.quantity import AXES, Entries, Quantity, parted, resolved
from symgen.symbolic.system import NamedMatrix
from symgen.symbolic.vectors import cross

if TYPE_CHECKING:
    from symgen.models.loop.derivation import LoopDerivation
    from symgen.scene.loop.loop import JointVariable


def _of(quantity: Quantity) -> Entries:
    return [quantity.symbol], quantity.unit, quantity.description


def _drive(model: LoopDerivation, j: int) -> Entries:
    v = model.variables[j]
    turns = v.quantity.unit == "rad"
    return (
        [model.joints[1][j]],
        "N*m" if turns else "N",
        f"{'torque' if turns else 'force'} of the drive at {v.name}",
    )


def _power(model: LoopDerivation, j: int) -> Entries:
    v = model.variables[j]
    return [model.joints[1][j] * v.rate.symbol], "W", f"power of the drive at {v.name}"


def _force(model: LoopDerivation, joint: int, sign: int, link: str) -> Entries:
    wrench = model.joints[0][joint - 1]
    return [sign * x for x in wrench.real], "N", f"force on {link} at joint {joint}, in frame {{{joint}}}"


def _force_in_ground(model: LoopDerivation, joint: int, sign: int, link: str) -> Entries:
    force, unit, _ = _force(model, joint, sign, link)
    return model.frame(joint - 1).vector(force), unit, f"force on {link} at joint {joint}, in the first frame"


def _moment(model: LoopDerivation, joint: int, sign: int, link: str) -> Entries:
    wrench = model.joints[0][joint - 1]
    about = f"moment on {link} at joint {joint} about the origin of frame {{{joint}}}, in that frame"
    return [sign * x for x in wrench.dual], "N*m", about


def _place(model: LoopDerivation, joint: int, sign: int, link: str) -> Entries:
    along = model.loop.rows[joint - 1].S if sign > 0 else sp.Integer(0)
    return model.frame(joint - 1).point((0, 0, along)), "m", f"point of {link} on the axis of joint {joint}"


def _velocity(model: LoopDerivation, k: int) -> Entries:
    velocity = model.frame(k).vector(model.velocity(k).dual)
    return velocity, "m/s", f"velocity of the origin of the frame of {model.links[k - 1]}"


def _link_acceleration(model: LoopDerivation, k: int) -> Entries:
    velocity, rate = model.velocity(k), model.acceleration(k)
    turned = cross(velocity.real, velocity.dual)
    acceleration = model.frame(k).vector([a + x for a, x in zip(rate.dual, turned, strict=True)])
    return acceleration, "m/s^2", f"acceleration of the origin of the frame of {model.links[k - 1]}"


def _angular_velocity(model: LoopDerivation, k: int) -> Entries:
    w = model.velocity(k).real
    if _idle(model, k):  # the frame spins, the link does not
        w = (sp.Integer(0), w[1], w[2])
    return model.frame(k).vector(w), "rad/s", f"angular velocity of {model.links[k - 1]}"


def _angular_acceleration(model: LoopDerivation, k: int) -> Entries:
    w, rate = model.velocity(k).real, model.acceleration(k).real
    if _idle(model, k):
        relative = (sp.Integer(0), w[1], w[2])
        turned = cross(w, relative)
        rate = (turned[0], rate[1] + turned[1], rate[2] + turned[2])
    return model.frame(k).vector(rate), "rad/s^2", f"angular acceleration of {model.links[k - 1]}"


def _centre(model: LoopDerivation, k: int) -> Entries:
    link = model.links[k - 1]
    if model.loop.body(k - 1) is None:
        raise SceneError(f"link {link!r} has no mass, so no centre of mass", where=f"loop.links.{link}.mass")
    return model.centre(k), "m", f"centre of mass of {link}"


def _idle(model: LoopDerivation, k: int) -> bool:
    body = model.loop.body(k - 1)
    return body is not None and body.idle


def _on_ground(model: LoopDerivation) -> list[tuple[Triple, Triple]]:
    """Return force and moment about the origin of {1} of weight and loads less inertia, of each link."""
    pairs = []
    for k, net in enumerate(model.net, 1):
        frame = model.frame(k)
        force, turning = (frame.vector([-x for x in part]) for part in (net.real, net.dual))
        moment = [a + b for a, b in zip(turning, cross(frame.origin, force), strict=True)]
        pairs.append((force, tuple(moment)))
    return pairs


def _shaking(model: LoopDerivation, part: int) -> list[sp.Expr]:
    """Return the force (0) or the moment (1) on the ground: by Newton's laws of all links together."""
    return [sp.Add(*c) for c in zip(*(pair[part] for pair in _on_ground(model)), strict=True)]


#: Outputs of a variable, of a joint of a link, of a link, and of the whole loop, by word.
OF_VARIABLES: dict[str, Callable[[LoopDerivation, int], Entries]] = {
    "": lambda model, j: _of(model.variables[j].quantity),
    "rate": lambda model, j: _of(model.variables[j].rate),
    "acceleration": lambda model, j: _of(model.variables[j].acceleration),
    "drive": _drive,
    "power": _power,
}
OF_JOINTS: dict[str, Callable[[LoopDerivation, int, int, str], Entries]] = {
    "force": _force,
    "force_in_ground": _force_in_ground,
    "moment": _moment,
    "position": _place,
    "axis": lambda model, joint, sign, link: (
        model.frame(joint - 1).vector((0, 0, 1)),
        "1",
        f"direction of the axis of joint {joint}",
    ),
}
OF_LINKS: dict[str, Callable[[LoopDerivation, int], Entries]] = {
    "position": lambda model, k: (
        model.frame(k).origin,
        "m",
        f"origin of the frame of {model.links[k - 1]}",
    ),
    "velocity": _velocity,
    "acceleration": _link_acceleration,
    "angular_velocity": _angular_velocity,
    "angular_acceleration": _angular_acceleration,
    "centre": _centre,
}
OF_THE_WHOLE: dict[str, Callable[[LoopDerivation], Entries]] = {
    "kinetic_energy": lambda model: ([model.kinetic_energy], "J", "kinetic energy"),
    "potential_energy": lambda model: ([model.potential_energy], "J", "potential of gravity"),
    "energy": lambda model: (
        [model.kinetic_energy + model.potential_energy],
        "J",
        "kinetic plus potential energy",
    ),
    "power": lambda model: ([model.power], "W", "power of drives and loads"),
    "shaking_force": lambda model: (_shaking(model, 0), "N", "force of the loop on the ground, in {1}"),
    "shaking_moment": lambda model: (
        _shaking(model, 1),
        "N*m",
        "moment of the loop on the ground about the origin of {1}",
    ),
}
#: Outputs of a first-order state by word.
OF_STATES: dict[str, Callable[[LoopDerivation, int], Entries]] = {
    "": lambda model, j: _of(model.variables[j].rate),
    "rate": lambda model, j: _of(model.variables[j].acceleration),
    "integral": lambda model, j: _of(model.variables[j].quantity),
}


def words_of(variable: JointVariable) -> dict[str, Callable[[LoopDerivation, int], Entries]]:
    """Return the outputs of a joint variable, or of a first-order state, by word."""
    return OF_STATES if variable.is_state else OF_VARIABLES


#: Other words for outputs of a variable.
INSTEAD = {"speed": "rate", "velocity": "rate", "torque": "drive", "force": "drive"}
#: Words that hold masses, and those that hold the closing wrench, so the forces of the loop.
INERTIAL = {"kinetic_energy", "potential_energy", "energy", "shaking_force", "shaking_moment"}
WRENCHES = ("force", "moment")
DYNAMIC = {"drive", "power", *WRENCHES, "force_in_ground"}


def requested_outputs(model: LoopDerivation) -> list[NamedMatrix]:
    """Return one matrix for each output the scene asks for, or for each that it has by default.

    Raises
    ------
    SceneError
        For an unknown or repeated output, and for a link without mass where a force is requested.
    """
    listed = model.loop.outputs
    names = tuple(default(model)) if listed is None else listed
    matrices = []
    for i, name in enumerate(names):
        where = "" if listed is None else f"analysis.outputs.{i}"
        try:
            if name in names[:i]:
                raise SceneError(f"{name!r} is listed twice")
            matrices.append(output(model, name))
        except SceneError as error:
            raise (error if error.where else error.located(where=where)) from None
    return matrices


def output(model: LoopDerivation, name: str) -> NamedMatrix:
    """Return the matrix of an output or a component; raise SceneError as :func:`requested_outputs`."""
    entries, unit, description = resolved(name, AXES, lambda whole: _entries(model, whole))
    rows = tuple(AXES) if len(entries) == 3 else ()
    matrix = sp.ImmutableMatrix(len(entries), 1, list(entries))
    return NamedMatrix(name, matrix, unit, description, rows)


def sources_of(model: LoopDerivation) -> Iterator[tuple[str, str]]:
    """Yield what the motion of each variable, a symbol in its output, follows from."""
    for v in model.variables:
        for word, origin in _ORIGINS[v.role].items():
            yield v.name + word, origin.format(v.name)


#: Equations of the motion of variables and states, by their role and the word of the output.
_ORIGINS = {
    "input": {
        word: f"row {{}}, column {column} of inputs"
        for word, column in (("", "value"), (".rate", "rate"), (".acceleration", "acceleration"))
    },
    "dependent": {
        "": "zero of closure_defect",
        ".rate": "row {} of the solution of A q' = V: closure_matrix, closure_rhs",
        ".acceleration": "row {} of the solution of screws * accelerations + screw_drift = 0",
    },
    "free": {
        "": "integral of {0}.rate",
        ".rate": "integral of {0}.acceleration",
        ".acceleration": "solution of inverse_efforts = given_efforts along motions of the closed loop",
    },
    "state": {
        "": "integral of {0}.rate",
        ".rate": "row {0} of given_efforts",
        ".integral": "integral of {0}",
    },
}


def default(model: LoopDerivation) -> list[str]:
    """Return the outputs of a scene without a list: all motions, and all forces where there are any."""
    joints = [v for v in model.variables if not v.is_state]
    names = [f"{v.name}{word}" for v in joints for word in ("", ".rate", ".acceleration")]
    names += [f"{v.name}{word}" for v in model.variables if v.is_state for word in ("", ".rate")]
    if model.has_dynamics:
        names += [f"{v.name}.drive" for v in joints if v.effort is None or v.effort != 0]
        links = [*model.links, model.loop.rows[-1].link]
        names += [f"{link}.joint{k}.{word}" for k, link in enumerate(links, 1) for word in WRENCHES]
    return names


def needs(name: str) -> set[str]:
    """Return the needs of an output besides motion: ``mass``, and ``forces`` for the closing wrench."""
    word = parted(name)[0].rpartition(".")[2]
    return ({"mass"} if word in INERTIAL | DYNAMIC else set()) | ({"forces"} if word in DYNAMIC else set())


def _entries(model: LoopDerivation, name: str) -> Entries:
    if needs(name):
        model.check_masses(f"the output {name!r}")
    if name in OF_THE_WHOLE:
        return OF_THE_WHOLE[name](model)
    owner, _, word = name.partition(".")
    variable = model.variable(owner)
    of_variable = {} if variable is None else words_of(model.variables[variable])
    if variable is not None and word in of_variable:
        return of_variable[word](model, variable)
    if owner in model.links and word in OF_LINKS:
        return OF_LINKS[word](model, model.links.index(owner) + 1)
    if INSTEAD.get(word) in of_variable:
        raise SceneError(f"there is no output {name!r}", hint=f"Record {owner}.{INSTEAD[word]}.")
    joint, _, word = word.partition(".")
    sides = _sides(model)
    if (owner, joint) in sides and word in OF_JOINTS:
        return OF_JOINTS[word](model, *sides[owner, joint], owner)
    known = [*OF_THE_WHOLE]
    known += [f"{v.name}.{w}".rstrip(".") for v in model.variables for w in words_of(v)]
    known += [f"{k}.{w}" for k in model.links for w in OF_LINKS]
    known += [f"{link}.{joint}.{w}" for link, joint in sides for w in OF_JOINTS]
    raise SceneError(f"there is no output {name!r}", hint=nearest(name, known))


def _sides(model: LoopDerivation) -> dict[tuple[str, str], tuple[int, int]]:
    """Return joint and sign by link and joint: the wrench is that on the link after the joint."""
    ground = model.loop.rows[-1].link
    links = [ground, *model.links, ground]
    names = {}
    for k in range(1, len(links)):
        names[links[k - 1], f"joint{k}"] = (k, -1)
        names[links[k], f"joint{k}"] = (k, 1)
    return names
