"""Values of a scene with a limit, over its tunable parameters: the kernel ``limits``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import sympy as sp

from symgen.scene.limit import Limit
from symgen.symbolic.system import LIMITS, Export, NamedMatrix


class Limited(Protocol):
    """A resolved scene."""

    @property
    def limits(self) -> Sequence[Limit]:
        """Its values with a limit."""
        ...


def limits_of(scene: Limited) -> tuple[list[NamedMatrix], list[Export]]:
    """Return the values that must be above zero, and those of at least zero, with their kernel.

    Rows are keys of the scene, and units those of the rows. Positive factors are omitted, and of values that
    occur twice the first is checked.
    """
    matrices, names = [], {True: "above_zero", False: "at_least_zero"}
    seen: set[sp.Expr] = set()
    for strict, name in names.items():
        chosen = []
        for limit in scene.limits:
            _, bare = limit.value.as_coeff_Mul()
            if limit.strict == strict and bare not in seen:
                seen.add(bare)
                chosen.append(limit)
        if chosen:
            values, units = [k.value for k in chosen], [k.unit for k in chosen]
            unit = ", ".join(units) if len(set(units)) > 1 else units[0]
            about = f"values of the scene that must be {name.replace('_', ' ')}"
            rows = tuple(k.where for k in chosen)
            matrices.append(NamedMatrix(name, sp.ImmutableMatrix(values), unit, about, rows))
    about = "values with a limit, over the tunable parameters"
    return matrices, [Export(LIMITS, about, tuple(m.name for m in matrices))] if matrices else []
