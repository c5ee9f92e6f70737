"""Equation of an element in fixed axes: exact form and constant-transformation form."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from symgen.elements.element import Element, entry_unit
from symgen.mechanics.elastic.beam_matrices import BeamMatrices
from symgen.mechanics.elastic.hamilton import MOTION
from symgen.mechanics.elastic.turning_axes import (
    COSINE,
    SINE,
    Equation,
    global_equation,
    local_equation,
    thesis_equation,
)
from symgen.symbolic.names import Names
from symgen.symbolic.system import Group, NamedMatrix

#: Arguments of the equation besides the matrices of the element.
MOVING = Group("p", "rigid motion of the link, for the matrices in fixed axes", (COSINE, SINE, *MOTION))
#: Matrices of an equation with their units and descriptions.
_EQUATION = (
    ("mass", "kg", "mass matrix"),
    ("damping", "kg/s", "factor of the rates"),
    ("stiffness", "N/m", "dynamic stiffness"),
    ("load", "N", "load of the rigid motion"),
)
_FORMS = {
    "local": "in the link's axes",
    "global": "in fixed axes, exact",
    "thesis": "in fixed axes as the thesis has it, the turn T taken for constant: not exact",
}


def fixed_axes(
    element: Element, matrices: BeamMatrices, names: Names
) -> tuple[tuple[NamedMatrix, ...], tuple[NamedMatrix, ...]]:
    """Return the matrices of the exact equation and of the constant-transformation form, over ``MOVING``.

    Entries in link axes are named and shared.
    """
    local = _named(local_equation(matrices), names)
    exact, thesis = global_equation(element, local), thesis_equation(element, local)
    return tuple(_turned("global", element, exact)), tuple(_turned("thesis", element, thesis))


def _named(equation: Equation, names: Names) -> Equation:
    """Return an equation with every entry replaced by a name."""
    matrices = []
    for name, unit, about in _EQUATION:
        matrix = getattr(equation, name)
        entries = [
            names.scalar(
                f"local_{name}_{i + 1}_{j + 1}", matrix[i, j], entry_unit(unit),
                f"{about} {_FORMS['local']}: entry ({i + 1}, {j + 1})",
            )
            for i in range(matrix.rows)
            for j in range(matrix.cols)
        ]  # fmt: skip
        matrices.append(sp.ImmutableMatrix(*matrix.shape, entries))
    return Equation(*matrices)


def _turned(form: str, element: Element, equation: Equation) -> Iterator[NamedMatrix]:
    for name, unit, about in _EQUATION:
        matrix = getattr(equation, name)
        columns = element.dofs if matrix.cols > 1 else ()
        yield NamedMatrix(
            f"{form}_{name}", matrix, entry_unit(unit),
            f"{about} {_FORMS[form]}", element.dofs, columns, name == "mass",
        )  # fmt: skip
