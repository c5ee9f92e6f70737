"""The steps of a recursion over rods as one System, for inspection."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symgen.mechanics.rods.recursion import chain_recursion
from symgen.symbolic.quantity import Quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

#: Names of arguments of kernels, which no term has.
_ARRAYS = ("t", "q", "u", "p", "work", "out")


def chain_system(dimension: int) -> System:
    """Return the steps of the recursion over rods in the plane (2) or in space (3) as one System.

    Matrices carry the name of their step, as in ``inward.factors``. A symbol that has another
    meaning in an earlier step carries the name of its step as well.
    """
    recursion = chain_recursion(dimension)
    known: dict[str, object] = dict.fromkeys(_ARRAYS)
    arguments: dict[str, Quantity] = {}
    definitions: list[Definition] = []
    matrices: list[NamedMatrix] = []
    exports: list[Export] = []
    for step in recursion.steps:
        new = _distinct(step, known)
        symbols = {x.symbol: y.symbol for x, y in new.items()}
        arguments |= {(y := new[x]).name: y for group in step.groups for x in group.quantities}
        definitions += (Definition(new[d.quantity], d.expression.xreplace(symbols)) for d in step.definitions)
        own = [_of_step(m, step, symbols) for m in step.matrices]
        matrices += own
        exports.append(Export(step.name, step.title, tuple(m.name for m in own)))
    return System(
        name=recursion.name,
        title=recursion.title,
        groups=(Group("p", "arguments of the steps", tuple(arguments.values())),),
        matrices=tuple(matrices),
        exports=tuple(exports),
        definitions=tuple(definitions),
        references=recursion.references,
    )


def _distinct(step: System, known: dict[str, object]) -> dict[Quantity, Quantity]:
    """Return the quantities of a step under names that no earlier step uses with another meaning."""
    defined = {d.quantity: d.expression for d in step.definitions}
    new = {}
    for x in step.quantities():
        meaning = x.unit, x.description, defined.get(x)
        free = x in defined and x.name in known  # a term is defined once
        same = known.setdefault(x.name, meaning) == meaning and not free
        name = x.name if same else f"{x.name}_{step.name}"
        new[x] = x if same else replace(x, symbol=sp.Symbol(name, real=True))
    return new


def _of_step(m: NamedMatrix, step: System, symbols: dict[sp.Symbol, sp.Symbol]) -> NamedMatrix:
    about = f"{step.title}: {m.description}"
    return replace(m, name=f"{step.name}.{m.name}", matrix=m.matrix.xreplace(symbols), description=about)
