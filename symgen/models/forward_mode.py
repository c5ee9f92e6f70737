"""Tangents of named quantities, expressions and whole Systems along a direction: forward mode.

Every quantity x has a tangent dx, linear in the tangents of the arguments, which follow the others in
``work``; the time is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from symgen.symbolic.calculus import partial
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

#: Ending of the names of kernels, matrices and quantities of tangents.
ENDING = "_tangent"


class ArgumentTangents:
    """Tangents of arguments, and ``definitions`` of those of all quantities that follow from them."""

    def __init__(self, inputs: Sequence[Quantity], definitions: Sequence[Definition]) -> None:
        #: Tangents of the arguments, in their order.
        self.seeds = tuple(_tangent(x) for x in inputs)
        self._known = {x.symbol: s.symbol for x, s in zip(inputs, self.seeds, strict=True)}
        self.definitions: list[Definition] = []
        for definition in definitions:
            (slope,) = self.of([definition.expression])
            if slope != 0:
                tangent = _tangent(definition.quantity)
                self.definitions.append(Definition(tangent, slope))
                self._known[definition.quantity.symbol] = tangent.symbol

    def of(self, expressions: Sequence[sp.Expr]) -> list[sp.Expr]:
        """Return the tangents of expressions that use these quantities."""
        tangents = []
        for expression in map(sp.sympify, expressions):
            used = sorted(expression.free_symbols & self._known.keys(), key=lambda s: str(s.name))
            tangents.append(sp.Add(*(partial(expression, s) * self._known[s] for s in used)))
        return tangents


def tangents_of(system: System, kernels: Sequence[str], groups: Sequence[str]) -> System:
    """Return the System of the tangents of the matrices of some kernels of another.

    Kernel ``NAME_tangent`` gives those of kernel ``NAME``, called ``MATRIX_tangent``, along the direction of
    the arguments of some groups, whose tangents follow the entries of ``work``.
    """
    inputs = [x for g in system.groups if g.name in groups for x in g.quantities]
    tangents = ArgumentTangents(inputs, system.definitions)
    matrices: dict[str, NamedMatrix] = {}
    exports = []
    for export in (e for e in system.exports if e.kernel in kernels):
        for m in (m for m in system.matrices if m.name in export.matrices):
            of = sp.ImmutableMatrix(*m.matrix.shape, tangents.of(list(m.matrix)))
            about = f"tangent of {m.description}"
            matrices[m.name] = replace(m, name=m.name + ENDING, matrix=of, description=about)
        names = tuple(matrices[name].name for name in export.matrices)
        exports.append(Export(export.kernel + ENDING, f"tangent of {export.description}", names))
    others = tuple(g for g in system.groups if g.name != "work")
    work = [x for g in system.groups if g.name == "work" for x in g.quantities]
    return replace(
        system,
        name=f"{system.name}_tangents",
        title=f"{system.title}: tangents",
        groups=(*others, Group("work", "other arguments, then tangents", (*work, *tangents.seeds))),
        matrices=tuple(matrices.values()),
        exports=tuple(exports),
        saddle_point=None,
        residual="",
        definitions=(*system.definitions, *tangents.definitions),
    )


def _tangent(x: Quantity) -> Quantity:
    return quantity(f"{x.name}{ENDING}", x.unit, f"tangent of {x.description}")
