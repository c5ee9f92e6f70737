"""Dual Euler equations and equilibrium of each link of a loop, with letters for momenta and wrenches."""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain, pairwise

from symgen.mechanics.loop.dual_euler import balance, rate_in_space
from symgen.mechanics.loop.dual_rows import row_transform
from symgen.mechanics.sources import EQUILIBRIUM
from symgen.models.loop.derivation import REFERENCE, LoopDerivation, named
from symgen.models.loop.solved_wrenches import is_slider_crank, solved_wrenches
from symgen.scene.loop.loop import Loop
from symgen.symbolic.dual import DualVector
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Group, System

#: Units and nouns of both parts of a dual vector.
Kinds = tuple[tuple[str, str], tuple[str, str]]
_VELOCITY: Kinds = (("rad/s", "angular velocity"), ("m/s", "velocity of the origin"))
_MOMENTUM: Kinds = (("kg*m/s", "momentum"), ("kg*m^2/s", "moment of momentum"))
_RATE: Kinds = (("N", "momentum, its rate,"), ("N*m", "moment of momentum, its rate,"))
_WRENCH: Kinds = (("N", "force"), ("N*m", "moment"))
_BALL: Kinds = (("N", "force"), ("N*m", "moment, zero at a ball joint,"))
_ROWS = ("fx", "fy", "fz", "mx", "my", "mz")


def equilibrium_system(loop: Loop) -> System:
    """Return dual Euler equations of the links, and their equilibrium, which the joint wrenches meet."""
    model = LoopDerivation(loop)
    variables, parameters = [v.quantity for v in model.variables], [p.quantity for p in loop.parameters]
    taken = taken_names(model)
    motions = [
        [
            _components(patterns, k, "xyz", f"of {link}, in its frame", taken, kinds)
            for patterns, kinds in (
                (("V{0}_{1}p", "V{0}_{1}d"), _VELOCITY),
                (("H{0}_{1}p", "H{0}_{1}d"), _MOMENTUM),
                (("H{0}_{1}p_rate", "H{0}_{1}d_rate"), _RATE),
            )
        ]
        for k, link in enumerate(model.links, 1)
    ]
    between = [
        f"of {before} on {behind} at joint {k}"
        for k, (before, behind) in enumerate(pairwise(("ground", *model.links, "ground")), 1)
    ]
    joints = [
        _components(("F{0}_{1}", "T{0}_{1}"), k, "ijk", about, taken, _BALL if turns else _WRENCH)
        for k, (about, turns) in enumerate(zip(between, _turning(loop), strict=True), 1)
    ]
    inertia = [
        _components(
            ("f{0}_{1}p", "f{0}_{1}d"),
            k,
            "xyz",
            f"of {link}'s inertia less loads, in its frame",
            taken,
            _WRENCH,
        )
        for k, link in enumerate(model.links, 1)
    ]
    euler = [
        named(
            f"{link}_dual_euler",
            rate_in_space(_dual(rate), _dual(velocity), _dual(momentum)).column,
            "N, N*m",
            f"rate of the dual momentum of {link}, by its components H and their rates",
            _ROWS,
        )
        for link, (velocity, momentum, rate) in zip(model.links, motions, strict=True)
    ]
    wrenches = [
        named(
            f"joint_{k}_letters",
            [x.symbol for x in joint],
            "N, N*m",
            f"force and moment {about}, in frame {{{k}}}",
            _ROWS,
        )
        for k, (joint, about) in enumerate(zip(joints, between, strict=True), 1)
    ]
    equilibrium = [
        named(
            f"{link}_equilibrium",
            balance(row_transform(model.rows[k]), *map(_dual, (joints[k], joints[k + 1], inertia[k]))).column,
            "N, N*m",
            f"wrenches on {link} in its frame about its origin, less that of inertia; zero",
            _ROWS,
        )
        for k, link in enumerate(model.links)
    ]
    if is_slider_crank(loop.rows, _turning(loop)):
        solved = solved_wrenches(
            loop.rows,
            [dict(zip(_ROWS, m.matrix, strict=True)) for m in equilibrium],
            {x.name.rstrip("_"): x.symbol for x in chain(*joints, *inertia)},
        )
        about = "components of the joint wrenches one after another, each by those before it and by inertia"
        equilibrium.append(named("joint_components", list(solved.values()), "N, N*m", about, tuple(solved)))
    return System(
        f"{loop.name}_equilibrium",
        "Dual Euler equations and equilibrium of the links",
        (
            Group("q", "joint variables", tuple(variables)),
            Group("p", "tunable parameters", tuple(parameters), per_run=True),
            Group("momenta", "velocities and momenta of the links", tuple(chain(*chain(*motions)))),
            Group("wrenches", "wrenches of joints and inertia", tuple(chain(*joints, *inertia))),
        ),
        (*euler, *wrenches, *equilibrium),
        (),
        references=(REFERENCE,),
        sources=EQUILIBRIUM,
    )


def _turning(loop: Loop) -> list[bool]:
    """Return which joints turn freely about two axes or three, as a ball does where an idle spin is held."""
    free = {v.quantity.symbol for v in loop.variables if v.role == "dependent"}
    return [sum(bool(e.free_symbols & free) for e in (r.theta, r.eta, r.alpha)) > 1 for r in loop.rows]


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
