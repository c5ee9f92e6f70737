"""Dual Euler equations and equilibrium of each link of a loop, with letters for momenta and wrenches."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

from symgen.joints import JOINTS
from symgen.mechanics.loop.dual_euler import balance, rate_in_space
from symgen.mechanics.loop.dual_paths import NOTHING
from symgen.mechanics.loop.dual_rows import row_transform
from symgen.mechanics.sources import EQUILIBRIUM
from symgen.models.loop.derivation import REFERENCE, LoopDerivation, named
from symgen.models.loop.solved import is_slider_crank, solved_wrenches
from symgen.scene.loop.loop import Loop
from symgen.symbolic.calculus import ZERO
from symgen.symbolic.dual import DualVector
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Group, NamedMatrix, System

#: Units and nouns of both parts of a dual vector.
Kinds = tuple[tuple[str, str], tuple[str, str]]
_VELOCITY: Kinds = (("rad/s", "angular velocity"), ("m/s", "velocity of the origin"))
_MOMENTUM: Kinds = (("kg*m/s", "momentum"), ("kg*m^2/s", "moment of momentum"))
_RATE: Kinds = (("N", "momentum, its rate,"), ("N*m", "moment of momentum, its rate,"))
_WRENCH: Kinds = (("N", "force"), ("N*m", "moment"))
_BALL: Kinds = (("N", "force"), ("N*m", "moment, zero at a ball joint,"))
_ROWS = ("fx", "fy", "fz", "mx", "my", "mz")
#: Patterns of the letters of both parts, by number and axis.
_MOTION = (
    (("V{0}_{1}p", "V{0}_{1}d"), _VELOCITY),
    (("H{0}_{1}p", "H{0}_{1}d"), _MOMENTUM),
    (("H{0}_{1}p_rate", "H{0}_{1}d_rate"), _RATE),
)
_INERTIA = ("f{0}_{1}p", "f{0}_{1}d")
_JOINT = ("F{0}_{1}", "T{0}_{1}")


@dataclass(frozen=True, slots=True)
class _Letters:
    """Components of the dual vectors of a loop.

    Of each link: velocity, momentum and its rate (``motions``), wrench of inertia. Of joint k, at index
    k - 1: its wrench, and the bodies between which it acts (``about``).
    """

    motions: list[list[list[Quantity]]]
    inertia: list[list[Quantity]]
    joints: list[list[Quantity]]
    about: list[str]


def equilibrium_system(loop: Loop) -> System:
    """Return dual Euler equations of the links, and their equilibrium, which the joint wrenches meet."""
    model, balls = LoopDerivation(loop), unloaded_balls(loop)
    letters = _letters(model, balls)
    equilibrium = _equilibrium(model, letters, balls)
    solved = []
    if is_slider_crank(loop.rows, balls):
        solved = [_joint_components(loop, letters, equilibrium)]
    return System(
        f"{loop.name}_equilibrium",
        "Dual Euler equations and equilibrium of the links",
        (
            Group("q", "joint variables", tuple(v.quantity for v in model.variables)),
            Group("p", "tunable parameters", tuple(p.quantity for p in loop.parameters), per_run=True),
            Group("momenta", "velocities and momenta of the links", tuple(chain(*chain(*letters.motions)))),
            Group(
                "wrenches", "wrenches of joints and inertia", tuple(chain(*letters.joints, *letters.inertia))
            ),
        ),
        (*_dual_euler(model, letters), *_joint_wrenches(letters), *equilibrium, *solved),
        (),
        references=(REFERENCE,),
        sources=EQUILIBRIUM,
    )


def _letters(model: LoopDerivation, balls: list[bool]) -> _Letters:
    """Return the letters of a loop, which no other quantity of it has."""
    taken = taken_names(model)
    links = list(enumerate(model.links, 1))
    about = [
        f"of {before} on {behind} at joint {k}"
        for k, (before, behind) in enumerate(pairwise(("ground", *model.links, "ground")), 1)
    ]
    return _Letters(
        [
            [
                _components(patterns, k, "xyz", f"of {link}, in its frame", taken, kinds)
                for patterns, kinds in _MOTION
            ]
            for k, link in links
        ],
        [
            _components(_INERTIA, k, "xyz", f"of {link}'s inertia less loads, in its frame", taken, _WRENCH)
            for k, link in links
        ],
        [
            _components(_JOINT, k, "ijk", of_joint, taken, _BALL if ball else _WRENCH)
            for k, (of_joint, ball) in enumerate(zip(about, balls, strict=True), 1)
        ],
        about,
    )


def _dual_euler(model: LoopDerivation, letters: _Letters) -> Iterator[NamedMatrix]:
    """Yield the rate of the dual momentum of each link."""
    for link, (velocity, momentum, rate) in zip(model.links, letters.motions, strict=True):
        yield named(
            f"{link}_dual_euler",
            rate_in_space(_dual(rate), _dual(velocity), _dual(momentum)).column,
            "N, N*m",
            f"rate of the dual momentum of {link}, by its components H and their rates",
            _ROWS,
        )


def _joint_wrenches(letters: _Letters) -> Iterator[NamedMatrix]:
    """Yield the wrench of each joint in its letters."""
    for k, (joint, about) in enumerate(zip(letters.joints, letters.about, strict=True), 1):
        yield named(
            f"joint_{k}_letters",
            [x.symbol for x in joint],
            "N, N*m",
            f"force and moment {about}, in frame {{{k}}}",
            _ROWS,
        )


def _equilibrium(model: LoopDerivation, letters: _Letters, balls: Sequence[bool]) -> list[NamedMatrix]:
    """Return the balance of wrenches on each link, without the moments that ball joints do not transmit."""
    joints = [
        DualVector(_dual(joint).real, NOTHING.dual) if ball else _dual(joint)
        for joint, ball in zip(letters.joints, balls, strict=True)
    ]
    return [
        named(
            f"{link}_equilibrium",
            balance(row_transform(model.rows[k]), joints[k], joints[k + 1], _dual(letters.inertia[k])).column,
            "N, N*m",
            f"wrenches on {link} in its frame about its origin, less that of inertia; zero",
            _ROWS,
            left=ZERO,
        )
        for k, link in enumerate(model.links)
    ]


def _joint_components(loop: Loop, letters: _Letters, equilibrium: list[NamedMatrix]) -> NamedMatrix:
    """Return the joint wrenches of a slider-crank, solved from the equilibrium of its links."""
    symbols = {x.name.rstrip("_"): x.symbol for x in chain(*letters.joints, *letters.inertia)}
    links = [dict(zip(_ROWS, m.matrix, strict=True)) for m in equilibrium]
    solved = solved_wrenches(loop.rows, links, symbols)
    about = "components of the joint wrenches one after another, each by those before it and by inertia"
    left = [symbols[name] for name in solved]
    return named("joint_components", list(solved.values()), "N, N*m", about, tuple(solved), left=left)


def unloaded_balls(loop: Loop) -> list[bool]:
    """Return which joints are balls without drives, which transmit no moment."""
    driven = {v.row for v in loop.variables if v.effort != 0}
    return [JOINTS[row.joint].is_ball and k not in driven for k, row in enumerate(loop.rows)]


def _components(
    patterns: tuple[str, str], number: int, axes: str, about: str, taken: Collection[str], kinds: Kinds
) -> list[Quantity]:
    """Return the components of both parts of a dual vector by patterns of their names."""
    return [
        quantity(
            free_name(pattern.format(number, axis), taken), unit, f"{axis} component of the {noun} {about}"
        )
        for pattern, (unit, noun) in zip(patterns, kinds, strict=True)
        for axis in axes
    ]


def taken_names(model: LoopDerivation) -> set[str]:
    """Return the names of a loop, which letters of its shown equations must not have."""
    state = [x for v in model.variables for x in (v.quantity, v.rate, v.acceleration)]
    taken = {x.name for x in (*state, *(p.quantity for p in model.loop.parameters))}
    return taken | {str(s) for row in model.rows for m in row for s in m.value.free_symbols}


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name, longer where it is taken."""
    return free_name(f"{name}_", taken) if name in taken else name


def _dual(components: list[Quantity]) -> DualVector:
    fx, fy, fz, mx, my, mz = (x.symbol for x in components)
    return DualVector((fx, fy, fz), (mx, my, mz))
