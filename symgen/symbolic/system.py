"""What a derivation hands to the lowering: named matrices over declared quantities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import sympy as sp

from symgen.errors import DerivationError, nearest
from symgen.symbolic.quantity import Quantity


@dataclass(frozen=True, slots=True)
class NamedMatrix:
    """A matrix of the model: rows and columns carry names, entries a unit.

    ``unit`` is one unit for all entries, or several in row order joined by ``", "`` where they differ.
    """

    name: str
    matrix: sp.ImmutableMatrix
    unit: str
    description: str
    rows: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    symmetric: bool = False

    def __post_init__(self) -> None:
        for what in ("unit", "description"):
            if not getattr(self, what).strip():
                raise DerivationError(f"matrix {self.name} has no {what}: every matrix needs one")
        if self.rows and len(self.rows) != self.matrix.rows:
            raise DerivationError(f"matrix {self.name}: {len(self.rows)} names for {self.matrix.rows} rows")


@dataclass(frozen=True, slots=True)
class Definition:
    """A shared subexpression that the derivation names, such as the vector along a rod."""

    quantity: Quantity
    expression: sp.Expr


@dataclass(frozen=True, slots=True)
class Group:
    """One argument array of the kernels (``t``, ``q``, ``u``, ``p``, ``work``) and its entries' meaning."""

    name: str
    description: str
    quantities: tuple[Quantity, ...]


@dataclass(frozen=True, slots=True)
class Export:
    """A kernel to generate: the matrices it writes one after the other, each row by row."""

    kernel: str
    description: str
    matrices: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SaddlePoint:
    """Names of the matrices of [M J^T; J 0] [a; lam] = [f; gamma], and the order of its elimination.

    ``order`` lists unknowns: below the number of coordinates a coordinate, from there on a multiplier. A
    multiplier whose pivot keeps no more than ``rank_tolerance`` of its terms of its own sign follows from
    those before it and is set to zero.
    """

    mass: str
    jacobian: str
    force: str
    rhs: str
    order: tuple[int, ...]
    rank_tolerance: str


@dataclass(frozen=True, slots=True)
class System:
    """Everything derived for one model.

    Raises
    ------
    DerivationError
        When a name is used twice, or a matrix holds a symbol that no group and no definition declares.
    """

    name: str
    title: str
    groups: tuple[Group, ...]
    matrices: tuple[NamedMatrix, ...]
    exports: tuple[Export, ...]
    definitions: tuple[Definition, ...] = ()
    saddle_point: SaddlePoint | None = None
    references: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    _index: dict[str, NamedMatrix] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", {m.name: m for m in self.matrices})
        if len(self._index) < len(self.matrices):
            raise DerivationError(f"{self.name}: two matrices have the same name")
        known: set[sp.Symbol] = set()
        names: set[str] = set()
        for quantity in self.quantities():
            if quantity.name in names:
                raise DerivationError(f"{self.name}: two quantities are called {quantity.name!r}")
            names.add(quantity.name)
            known.add(quantity.symbol)
        for matrix in self.matrices:
            unknown = sorted(str(s) for s in matrix.matrix.free_symbols - known)
            if unknown:
                raise DerivationError(
                    f"{self.name}: matrix {matrix.name} holds undeclared symbols: {', '.join(unknown)}"
                )

    def quantities(self) -> Iterator[Quantity]:
        """Yield every declared quantity: arguments first, then the shared subexpressions."""
        for group in self.groups:
            yield from group.quantities
        for definition in self.definitions:
            yield definition.quantity

    def __contains__(self, name: str) -> bool:
        return name in self._index

    def __getitem__(self, name: str) -> NamedMatrix:
        """Return the matrix called ``name``; raise DerivationError with the nearest name otherwise."""
        if name not in self._index:
            raise DerivationError(f"{self.name} has no matrix {name!r}. {nearest(name, self._index)}")
        return self._index[name]

    def group(self, name: str) -> Group:
        """Return the argument group called ``name``; an empty one when the system has none."""
        return next((g for g in self.groups if g.name == name), Group(name, "", ()))

    def by_name(self) -> Matrices:
        """Return the bare SymPy matrices by name."""
        return Matrices((m.name, m.matrix) for m in self.matrices)

    def expanded(self, name: str) -> sp.ImmutableMatrix:
        """Return the matrix with every shared subexpression put back in, over the arguments alone."""
        values: dict[sp.Symbol, sp.Expr] = {}
        for definition in self.definitions:
            values[definition.quantity.symbol] = definition.expression.xreplace(values)
        return self[name].matrix.xreplace(values)


class Matrices(dict[str, sp.ImmutableMatrix]):
    """SymPy matrices by name; a missing name is a DerivationError that tells the nearest."""

    def __missing__(self, name: str) -> sp.ImmutableMatrix:
        raise DerivationError(f"there is no matrix {name!r}. {nearest(name, self)}")
