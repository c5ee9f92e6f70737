"""Equilibrium of each link of a loop, with letters for the wrenches of joints and inertia."""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain

from symgen.mechanics.loop.dual_euler import balance
from symgen.mechanics.loop.dual_rows import row_transform
from symgen.mechanics.sources import EQUILIBRIUM
from symgen.models.loop.derivation import REFERENCE, LoopDerivation, named
from symgen.scene.loop.loop import Loop
from symgen.symbolic.dual import DualVector
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Group, System

_ROWS = ("fx", "fy", "fz", "mx", "my", "mz")


def equilibrium_system(loop: Loop) -> System:
    """Return the equations of equilibrium of the links, which the joint wrenches of a loop meet."""
    model = LoopDerivation(loop)
    variables, parameters = [v.quantity for v in model.variables], [p.quantity for p in loop.parameters]
    taken = {str(s) for row in model.rows for m in row for s in m.value.free_symbols}
    taken |= {x.name for x in (*variables, *parameters)}
    joints = [
        _wrench(("F{0}_{1}", "T{0}_{1}"), k, "ijk", f"at joint {k}, on the link behind it", taken)
        for k in range(1, len(loop.rows) + 1)
    ]
    inertia = [
        _wrench(("f{0}_{1}p", "f{0}_{1}d"), k, "xyz", f"of {link}'s inertia less loads, in its frame", taken)
        for k, link in enumerate(model.links, 1)
    ]
    matrices = tuple(
        named(
            f"{link}_equilibrium",
            balance(row_transform(model.rows[k]), *map(_dual, (joints[k], joints[k + 1], inertia[k]))).column,
            "N, N*m",
            f"wrenches on {link} in its frame about its origin, less that of inertia; zero",
            _ROWS,
        )
        for k, link in enumerate(model.links)
    )
    return System(
        f"{loop.name}_equilibrium",
        "Equilibrium of the links",
        (
            Group("q", "joint variables", tuple(variables)),
            Group("p", "tunable parameters", tuple(parameters), per_run=True),
            Group("wrenches", "wrenches of joints and inertia", tuple(chain(*joints, *inertia))),
        ),
        matrices,
        (),
        references=(REFERENCE,),
        sources=EQUILIBRIUM,
    )


def _wrench(
    patterns: tuple[str, str], number: int, axes: str, about: str, taken: Collection[str]
) -> list[Quantity]:
    """Return the components of a force and of a moment by patterns of their names."""
    parts = zip(patterns, ("N", "N*m"), ("force", "moment"), strict=True)
    return [
        quantity(_free(pattern.format(number, axis), taken), unit, f"{axis} component of the {noun} {about}")
        for pattern, unit, noun in parts
        for axis in axes
    ]


def _free(name: str, taken: Collection[str]) -> str:
    return _free(f"{name}_", taken) if name in taken else name


def _dual(components: list[Quantity]) -> DualVector:
    fx, fy, fz, mx, my, mz = (x.symbol for x in components)
    return DualVector((fx, fy, fz), (mx, my, mz))
