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
    "thesis_local": "in the link's axes, without geometric stiffness as in the thesis",
    "global": "in fixed axes, exact",
    "thesis": "in fixed axes as in the thesis: T constant, no geometric stiffness, not exact",
}


def fixed_axes(
    element: Element, matrices: BeamMatrices, names: Names
) -> tuple[tuple[NamedMatrix, ...], tuple[NamedMatrix, ...]]:
    """Return the matrices of the exact equation and of the constant-transformation form, over ``MOVING``.

    Entries in link axes are named and shared. The latter form has its dynamic stiffness in link axes too.
    """
    local, printed = (
        _named(form, local_equation(matrices, geometric), names)
        for form, geometric in (("local", True), ("thesis_local", False))
    )
    exact, thesis = global_equation(element, local), thesis_equation(element, printed)
    in_link = NamedMatrix(
        "thesis_local_stiffness", printed.stiffness, entry_unit("N/m"),
        f"dynamic stiffness {_FORMS['thesis_local']}", element.dofs, element.dofs,
    )  # fmt: skip
    return tuple(_turned("global", element, exact)), (in_link, *_turned("thesis", element, thesis))


def _named(form: str, equation: Equation, names: Names) -> Equation:
    """Return an equation with every entry replaced by a name; entries of several forms have one name."""
    matrices = []
    for name, unit, about in _EQUATION:
        matrix = getattr(equation, name)
        entries = [
            names.scalar(
                f"{form}_{name}_{i + 1}_{j + 1}", matrix[i, j], entry_unit(unit),
                f"{about} {_FORMS[form]}: entry ({i + 1}, {j + 1})",
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
