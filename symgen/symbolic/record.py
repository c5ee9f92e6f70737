"""The mathematics of a model as text and numbers, stored for later comparison."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mpmath
    import sympy as sp

    from symgen.symbolic.system import NamedMatrix, System

#: Stored digits of the value of an entry, and digits of its computation.
DIGITS, _WORKING = 20, 40
#: Functions with other names in mpmath than in SymPy.
_FUNCTIONS = {"Abs": "fabs", "Sign": "sign"}


@dataclass(frozen=True, slots=True)
class RecordedMatrix:
    """A derived matrix: its unit and size, and its nonzero entries by the names of row and column.

    ``entries`` holds each entry as text, ``values`` its value at argument values derived from their names;
    empty where it has no value there.
    """

    unit: str
    rows: int
    columns: int
    entries: Mapping[str, str]
    values: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Record:
    """The mathematics of one model: constants, shared subexpressions, matrices, operations of each kernel."""

    name: str
    title: str
    definitions: Mapping[str, str]
    matrices: Mapping[str, RecordedMatrix]
    operations: Mapping[str, int]
    constants: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the record as JSON text, one line per entry, so that a change shows as a changed line."""
        return json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n"


def read_record(text: str) -> Record:
    """Parse the text of ``to_json``; any fault raises KeyError, TypeError or ValueError."""
    data: dict[str, Any] = json.loads(text)
    matrices = {name: RecordedMatrix(**m) for name, m in data["matrices"].items()}
    return Record(**{**data, "matrices": matrices})


def record(name: str, title: str, systems: Mapping[str, System], operations: Mapping[str, int]) -> Record:
    """Return the record of a model that consists of these systems.

    Parameters
    ----------
    name, title
        Name and title of the model.
    systems
        Derived systems by the prefix of the names of their matrices; empty for a single system.
    operations
        Operation count of each kernel.
    """
    from sympy import sstr

    constants: dict[str, str] = {}
    definitions: dict[str, str] = {}
    matrices: dict[str, RecordedMatrix] = {}
    for prefix, system in systems.items():
        constants |= {f"{prefix}{c.quantity.name}": sstr(c.expression) for c in system.constants}
        definitions |= {f"{prefix}{d.quantity.name}": sstr(d.expression) for d in system.definitions}
        values = _values(system)
        for m in system.matrices:
            matrices[prefix + m.name] = _recorded(m, values[m.name])
    return Record(name, title, definitions, matrices, operations, constants)


def _recorded(m: NamedMatrix, texts: list[str]) -> RecordedMatrix:
    from sympy import sstr

    there = [(p, e, v) for p, e, v in zip(places(m), m.matrix, texts, strict=True) if e != 0]
    entries, values = {p: sstr(e) for p, e, _ in there}, {p: v for p, _, v in there if v}
    return RecordedMatrix(m.unit, m.matrix.rows, m.matrix.cols, entries, values)


def places(m: NamedMatrix) -> list[str]:
    """Return the name of each entry, row by row: the names of row and column, or numbers from 0."""
    rows, columns = (_named(names, n) for names, n in zip((m.rows, m.columns), m.matrix.shape, strict=True))
    return [", ".join(part for part in (r, c) if part) or "0" for r in rows for c in columns]


def _named(names: tuple[str, ...], size: int) -> Iterable[str]:
    if len(set(names)) == size:
        return names
    return [""] if size == 1 else [str(i) for i in range(size)]


def _values(system: System) -> dict[str, list[str]]:
    """Return every entry at arguments between 1/2 and 3/2, derived from their names and so reproducible."""
    import mpmath

    arguments = [x for group in system.groups for x in group.quantities]
    arguments += [c.quantity for c in system.constants]
    known: dict[sp.Basic, Any] = {x.symbol: _argument(x.name) for x in arguments}
    with mpmath.workdps(_WORKING):
        for definition in system.definitions:
            known[definition.quantity.symbol] = _value(definition.expression, known)
        return {m.name: [_text(_value(e, known)) for e in m.matrix] for m in system.matrices}


def _argument(name: str) -> mpmath.mpf:
    import mpmath

    return mpmath.mpf(0.5 + int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") / 2**32)


def _value(expression: sp.Expr, known: dict[sp.Basic, Any]) -> Any:
    """Return the value of an expression, or nan if it has none; every subexpression is evaluated once."""
    import mpmath

    if expression not in known:
        parts = [_value(x, known) for x in expression.args]
        try:
            known[expression] = _combined(expression, parts)
        except (ArithmeticError, ValueError, TypeError, AttributeError):  # a pole, or no function of numbers
            known[expression] = mpmath.nan
    return known[expression]


def _combined(expression: sp.Expr, parts: list[Any]) -> Any:
    import mpmath

    if expression.is_Rational:
        return mpmath.mpf(expression.p) / expression.q
    if expression.is_Add:
        return mpmath.fsum(parts)
    if expression.is_Mul:
        return mpmath.fprod(parts)
    if expression.is_Pow:
        return mpmath.power(*parts)
    if expression.is_number and not parts:
        return mpmath.mpf(expression.evalf(_WORKING)._mpf_)
    return getattr(mpmath, _FUNCTIONS.get(expression.func.__name__, expression.func.__name__))(*parts)


def _text(value: Any) -> str:
    """Return the stored digits of a real number; empty for any other value."""
    import mpmath

    real = isinstance(value, mpmath.mpf) and mpmath.isfinite(value)
    return str(mpmath.nstr(value, DIGITS)) if real else ""
