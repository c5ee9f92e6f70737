"""Interface from derivation to lowering: named matrices over declared quantities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from html import escape
from itertools import product

import sympy as sp

from symgen.errors import DerivationError, ModelError, check_known, nearest
from symgen.symbolic.constants import Substitution
from symgen.symbolic.quantity import Quantity, own_unit, symbols_of

#: Name of the kernel of values with a limit, which checks parameters before a run is set up.
LIMITS = "limits"
#: Source of a matrix that corresponds to no equation of the source.
NO_SOURCE = "not in the source"


@dataclass(frozen=True, slots=True)
class NamedMatrix:
    """A matrix of the model: rows and columns carry names, entries a unit.

    ``unit`` is one unit for all entries, or several in row order joined by ``", "``. ``source`` is the
    equation of the source, as in "Attia (7)", or "not in the source"; empty where it is not stated. ``left``
    is the left side of the equation in the letters of the source: that of the matrix alone, zero, or declared
    ones, or the column of those of its rows. One entry in letters of whole vectors and matrices is its right
    side.
    """

    name: str
    matrix: sp.ImmutableMatrix
    unit: str
    description: str
    rows: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    symmetric: bool = False
    source: str = ""
    left: sp.Expr | sp.ImmutableMatrix | None = None

    def __post_init__(self) -> None:
        for name in ("unit", "description"):
            if not getattr(self, name).strip():
                raise DerivationError(f"matrix {self.name} has no {name}: every matrix needs one")
        if self.rows and len(self.rows) != self.matrix.rows:
            raise DerivationError(f"matrix {self.name}: {len(self.rows)} names for {self.matrix.rows} rows")

    @property
    def in_letters(self) -> bool:
        """Whether this is an equation between whole vectors and matrices."""
        alone = self.left is not None and self.left != 0 and not self.lefts and self.matrix.shape == (1, 1)
        return alone and (self.matrix[0, 0] == 0 or not self.matrix[0, 0].is_commutative)

    @property
    def lefts(self) -> tuple[sp.Expr, ...]:
        """The left sides of the rows, if they have their own."""
        return tuple(self.left) if isinstance(self.left, sp.MatrixBase) else ()

    @property
    def composed(self) -> tuple[sp.Expr, ...]:
        """The left sides that are composed of letters of others."""
        return self.lefts or (() if self.left is None or self.left.is_Symbol else (self.left,))

    @property
    def equation(self) -> sp.Basic:
        """The matrix, or the entry of one with a single entry; where there is a left side, the equation."""
        from symgen.symbolic.notation import DerivedEquation

        right = self.matrix[0, 0] if self.matrix.shape == (1, 1) else self.matrix
        left = self.lefts[0] if len(self.lefts) == 1 else self.left
        return right if left is None else DerivedEquation(left, right)

    def part(self, rows: Sequence[str] = (), columns: Sequence[str] = ()) -> NamedMatrix:
        """Return some rows and columns, by name or by number from 1; all of them if none is given.

        Raises
        ------
        ModelError
            When there is no such row or column.
        """
        m = self.matrix
        i = self._numbers("row", rows, self.rows, m.rows)
        j = self._numbers("column", columns, self.columns, m.cols)
        in_rows = tuple(self.rows[k] for k in i) if self.rows else tuple(str(k + 1) for k in i)
        across = tuple(self.columns[k] for k in j) if self.columns else tuple(str(k + 1) for k in j)
        whole = i == j and self.symmetric
        chosen = list(product(i, j)) if rows or columns else []
        if "; " in self.unit:  # zeros have any unit
            chosen = [at for at in chosen if m[at] != 0] or chosen
        unit = own_unit(self.unit, (self.rows, self.columns), m.shape, chosen) if chosen else self.unit
        whole_left = None if self.left != 0 and (rows or columns) else self.left
        left = sp.ImmutableMatrix([self.lefts[k] for k in i]) if self.lefts else whole_left
        return replace(
            self, matrix=m.extract(i, j), unit=unit, rows=in_rows, columns=across, symmetric=whole, left=left
        )

    def _numbers(self, kind: str, selected: Sequence[str], names: Sequence[str], count: int) -> list[int]:
        numbers = []
        for name in selected:
            if name in names:
                numbers.append(names.index(name))
            elif name.isdecimal() and 0 < int(name) <= count:
                numbers.append(int(name) - 1)
            else:
                known = nearest(name, names) if names else f"They are numbered from 1 to {count}."
                raise ModelError(f"matrix {self.name} has no {kind} {name!r}. {known}")
        return numbers or list(range(count))

    def _repr_latex_(self) -> str:
        from symgen.symbolic.notation import latex

        return f"$\\displaystyle {latex(self.matrix if self.left is None else self.equation)}$"


@dataclass(frozen=True, slots=True)
class Definition:
    """A shared subexpression that the derivation names; ``rate_of``: that whose rate it is in all motions."""

    quantity: Quantity
    expression: sp.Expr
    rate_of: sp.Expr | None = None


@dataclass(frozen=True, slots=True)
class Group:
    """One argument array of the kernels (``t``, ``q``, ``u``, ``p``, ``work``) and its entries' meaning.

    ``per_run`` states that the entries are constant from call to call: quantities that depend only on them
    are then computed once, before the first call (:mod:`symgen.lowering.binding_times`).
    """

    name: str
    description: str
    quantities: tuple[Quantity, ...]
    per_run: bool = False


@dataclass(frozen=True, slots=True)
class Export:
    """A kernel to generate, with the matrices that it writes one after the other, each row by row."""

    kernel: str
    description: str
    matrices: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SaddlePoint:
    """Names of the matrices of [M J^T; J 0] [a; lam] = [f; gamma], and the order of its elimination.

    ``order`` lists unknowns: numbers below the count of coordinates are coordinates, the others multipliers.
    A multiplier whose pivot is at most ``rank_tolerance`` of its terms of equal sign is zero; callers of
    kernels may pass another tolerance. If rows of J are ``independent`` everywhere, no pivot is compared.
    ``costs``: counted costs by orders, the chosen one first; ``couples``: matrices of couples by forces in f.
    ``efforts``: matrix of the forces by unknowns that make the multipliers of the rows ``motions`` zero.
    """

    mass: str
    jacobian: str
    force: str
    rhs: str
    order: tuple[int, ...]
    rank_tolerance: str
    independent: bool = False
    costs: tuple[tuple[str, int], ...] = ()
    couples: tuple[str, ...] = ()
    efforts: str = ""
    motions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class System:
    """Everything derived for one model.

    ``constants`` are the letters of the scene with their values, ``absent`` those that are zero. ``values``
    are, of a user's that moves, those of parameters and, unless zero, of coordinates and rates at the start.

    ``sources`` lists patterns of names of matrices with their equations in the source; the first that matches
    becomes the source of a matrix that states none. Where nothing matches, it is not in the source.
    ``residual`` vanishes along a motion, row by row for ``work``, where there is no saddle point.

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
    residual: str = ""
    references: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    sources: tuple[tuple[str, str], ...] = ()
    constants: tuple[Definition, ...] = ()
    absent: tuple[str, ...] = ()
    values: Mapping[str, float] | None = None
    _index: dict[str, NamedMatrix] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.sources:
            sourced = tuple(m if m.source else replace(m, source=self._source(m)) for m in self.matrices)
            object.__setattr__(self, "matrices", sourced)
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
        sides = {m.name: (m.matrix, *m.composed) for m in self.matrices}
        unknown = symbols_of(e for both in sides.values() for e in both) - known
        for matrix in self.matrices if unknown else ():
            there = sorted(str(s) for s in symbols_of(sides[matrix.name]) & unknown)
            if there:
                raise DerivationError(
                    f"{self.name}: matrix {matrix.name} holds undeclared symbols: {', '.join(there)}"
                )

    def with_constants(
        self,
        groups: tuple[Group, ...],
        definitions: tuple[Definition, ...],
        constants: Iterable[Definition],
        absent: Iterable[str],
    ) -> System:
        """Return the system with some arguments as constants; nothing new is declared, or to be checked."""
        system = copy(self)
        fields = {"constants": tuple(constants), "absent": tuple(absent)}
        for name, value in ({"groups": groups, "definitions": definitions} | fields).items():
            object.__setattr__(system, name, value)
        return system

    def _source(self, m: NamedMatrix) -> str:
        """Return the equations of a matrix, without those of rows such as ``guide_*`` that it lacks."""
        source = next((s for pattern, s in self.sources if fnmatchcase(m.name, pattern)), NO_SOURCE)
        parts = source.split("; ")
        rows = [part.partition(" ")[0] for part in parts]
        there = ["*" not in row or any(fnmatchcase(name, row) for name in m.rows) for row in rows]
        return "; ".join(part for part, is_there in zip(parts, there, strict=True) if is_there)

    def arguments(self) -> Iterator[Quantity]:
        """Yield the arguments of the kernels."""
        for group in self.groups:
            yield from group.quantities

    def symbols(self) -> Iterator[Quantity]:
        """Yield the arguments and the constants."""
        yield from self.arguments()
        yield from (c.quantity for c in self.constants)

    def quantities(self) -> Iterator[Quantity]:
        """Yield every declared quantity: arguments, constants, shared subexpressions."""
        yield from self.symbols()
        yield from (d.quantity for d in self.definitions)

    def __contains__(self, name: str) -> bool:
        return name in self._index

    def __getitem__(self, name: str) -> NamedMatrix:
        """Return the matrix called ``name``; raise ModelError with the nearest name otherwise."""
        check_known(name, self._index, f"{self.name} has no matrix")
        return self._index[name]

    def named(self, name: str) -> tuple[NamedMatrix, ...]:
        """Return what a name stands for: a matrix, the matrices of a kernel, a shared term or an argument.

        Terms and arguments are matrices of one entry. The result is empty for an unknown name.
        """
        from symgen.symbolic.notation import text_name

        if name in self._index:
            return (self._index[name],)
        for export in self.exports:
            if export.kernel == name:
                return tuple(self._index[m] for m in export.matrices)
        entries = {d.quantity: d.expression for d in self.definitions}
        return tuple(
            NamedMatrix(
                x.name, sp.ImmutableMatrix([[entries.get(x, x.symbol)]]), x.unit, x.description, (x.name,)
            )
            for x in self.quantities()
            if name in (x.name, text_name(x.name))
        )

    def names(self) -> Iterator[str]:
        """Yield every name that :meth:`named` knows."""
        yield from self._index
        yield from (export.kernel for export in self.exports)
        yield from (x.name for x in self.quantities())

    def group(self, name: str) -> Group:
        """Return the argument group called ``name``; an empty one if the system has none."""
        return next((g for g in self.groups if g.name == name), Group(name, "", ()))

    def by_name(self) -> Matrices:
        """Return the bare SymPy matrices by name."""
        return Matrices((m.name, m.matrix) for m in self.matrices)

    def _repr_html_(self) -> str:
        rows = [
            (m.name, f"{m.matrix.rows} × {m.matrix.cols}", m.unit, m.description, m.source)
            for m in self.matrices
        ]
        return html_table(self.title, ("matrix", "shape", "unit", "meaning", "source"), rows)

    def substituted(self, values: Mapping[sp.Symbol, sp.Expr]) -> System:
        """Return the system with values for arguments, constants or shared subexpressions.

        Subexpressions that become numbers or symbols are no longer named.
        """
        if not values:
            return self
        put = substitution = Substitution(values)
        known, definitions = substitution.values, []
        for d in self.definitions:
            if d.quantity.symbol in known:
                continue
            e = substitution(d.expression)
            if e != d.expression and (e.is_number or e.is_Atom or (-e).is_Atom):
                known[d.quantity.symbol] = e
            else:
                definitions.append(replace(d, expression=e, rate_of=d.rate_of and put(d.rate_of)))
        return replace(
            self,
            groups=tuple(
                replace(g, quantities=tuple(x for x in g.quantities if x.symbol not in known))
                for g in self.groups
            ),
            matrices=tuple(
                replace(m, matrix=m.matrix.applyfunc(put), left=m.left if m.lefts else m.left and put(m.left))
                for m in self.matrices
            ),
            definitions=tuple(definitions),
            constants=tuple(
                replace(c, expression=substitution(c.expression))
                for c in self.constants
                if c.quantity.symbol not in known
            ),
        )

    def in_numbers(self) -> System:
        """Return the system with the values of its constants."""
        return self.substituted({c.quantity.symbol: c.expression for c in self.constants})

    def expanded(self, name: str) -> sp.ImmutableMatrix:
        """Return the matrix with every shared subexpression substituted, over the arguments alone."""
        values: dict[sp.Symbol, sp.Expr] = {}
        for definition in self.definitions:
            values[definition.quantity.symbol] = definition.expression.xreplace(values)
        return self[name].matrix.xreplace(values)


class Matrices(dict[str, sp.ImmutableMatrix]):
    """SymPy matrices by name; a missing name is a ModelError with the nearest name."""

    def __missing__(self, name: str) -> sp.ImmutableMatrix:
        raise ModelError(f"there is no matrix {name!r}. {nearest(name, self)}")

    def _repr_html_(self) -> str:
        rows = [(name, f"{m.rows} × {m.cols}") for name, m in self.items()]
        return html_table("Derived matrices", ("matrix", "shape"), rows)


def html_table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table for notebooks."""
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    caption = f"<caption>{escape(title)}</caption>"
    return f"<table>{caption}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a derivation: description, source, and its matrices of ``system``."""

    title: str
    about: str
    source: str
    system: System
    names: tuple[str, ...] = ()

    @property
    def matrices(self) -> tuple[NamedMatrix, ...]:
        """Matrices of the step."""
        return tuple(self.system[name] for name in self.names)
