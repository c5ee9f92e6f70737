"""Equation of an element in fixed axes: exact form and constant-transformation form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

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
from symgen.symbolic.quantity import whole
from symgen.symbolic.system import Group, NamedMatrix

#: Arguments of the equation besides the matrices of the element.
MOVING = Group("p", "rigid motion of the link, for the matrices in fixed axes", (COSINE, SINE, *MOTION))
#: Meaning of the load, and of a matrix in fixed axes in which the rates of T make no difference.
LOAD = "load of the rigid motion (a_x = x1'' - y1' theta', a_y = y1'' + x1' theta', less gravity)"
TURNED = "in fixed axes: T times that in the link's axes, with T constant or not"
#: Matrices of an equation with their units and descriptions.
_EQUATION = (
    ("mass", "kg", "mass matrix"),
    ("damping", "kg/s", "factor of the rates"),
    ("stiffness", "N/m", "dynamic stiffness"),
    ("load", "N", LOAD),
)
_FORMS = {
    "local": "in the link's axes",
    "thesis_local": "in the link's axes, without geometric stiffness as in the thesis",
    "global": "in fixed axes, exact",
    "thesis": "in fixed axes as in the thesis: T constant, no geometric stiffness, not exact",
}


def fixed_axes(
    element: Element, matrices: BeamMatrices, uniform: Mapping[sp.Symbol, int], names: Names
) -> Iterator[NamedMatrix]:
    """Yield the matrices of the exact equation and of the constant-transformation form, over ``MOVING``.

    Entries in link axes are named and shared. The latter form has its dynamic stiffness in link axes too, and
    both for a constant section, where the terms of ``uniform`` vanish: first, [KD], (Q) and [KT].
    """
    local, printed = (
        _named(element, form, local_equation(matrices, geometric), names)
        for form, geometric in (("local", True), ("thesis_local", False))
    )
    about = "of a constant section"

    def stiffness(name: str, matrix: sp.ImmutableMatrix, about: str) -> NamedMatrix:
        return NamedMatrix(
            name, matrix, entry_unit("N/m"), f"dynamic stiffness {about}", element.dofs, element.dofs,
            left=whole(f"[{name}]") if name in ("KD", "KT") else None,
        )  # fmt: skip

    complete = local_equation(matrices, geometric=False)
    kd = sp.ImmutableMatrix(complete.stiffness.xreplace(dict(uniform)))
    yield stiffness("KD", kd, f"[KD] {_FORMS['thesis_local']}, {about}")
    load = sp.ImmutableMatrix(complete.load.xreplace(dict(uniform)))
    about_load = f"(Q) {LOAD} {_FORMS['local']}, {about}"
    yield NamedMatrix("Q", load, entry_unit("N"), about_load, element.dofs, left=whole("(Q)"))
    in_letters = _entries(element, "KD", kd, "N/m", f"[KD] {about}", names)
    kt = thesis_equation(element, replace(complete, stiffness=in_letters)).stiffness
    yield stiffness("KT", kt, f"[KT] {_FORMS['thesis']}, {about}")
    exact, thesis = global_equation(element, local), thesis_equation(element, printed)
    yield from _turned("global", element, exact)
    yield stiffness("thesis_local_stiffness", printed.stiffness, _FORMS["thesis_local"])
    yield from _turned("thesis", element, thesis)


def _named(element: Element, form: str, equation: Equation, names: Names) -> Equation:
    """Return an equation with every entry replaced by a name; entries of several forms have one name."""
    return Equation(
        *(
            _entries(
                element, f"{form}_{name}", getattr(equation, name), unit, f"{about} {_FORMS[form]}", names
            )
            for name, unit, about in _EQUATION
        )
    )


def _entries(
    element: Element, name: str, matrix: sp.ImmutableMatrix, unit: str, about: str, names: Names
) -> sp.ImmutableMatrix:
    """Return a matrix or column with every entry replaced by a name with its unknowns, of row and column."""

    def named(i: int, j: int) -> sp.Expr:
        place = element.dofs[i : i + 1] + element.dofs[j : j + 1] * (matrix.cols > 1)
        text = f"{about}: entry {', '.join(place)}"
        return names.scalar("_".join((name, *place)), matrix[i, j], entry_unit(unit), text)

    return sp.ImmutableMatrix(*matrix.shape, named)


def _turned(form: str, element: Element, equation: Equation) -> Iterator[NamedMatrix]:
    for name, unit, about in _EQUATION:
        matrix = getattr(equation, name)
        columns = element.dofs if matrix.cols > 1 else ()
        in_axes = TURNED if name in ("mass", "load") else _FORMS[form]
        yield NamedMatrix(
            f"{form}_{name}", matrix, entry_unit(unit),
            f"{about} {in_axes}", element.dofs, columns, name == "mass",
        )  # fmt: skip
