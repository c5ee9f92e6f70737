"""The mathematics of a model as text and numbers, stored for later comparison."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import sympy as sp

    from symgen.symbolic.system import NamedMatrix, System

#: Digits of the value of an entry, and digits of its computation.
DIGITS, _WORKING = 20, 40
#: Names in mpmath of functions and constants that have other names in SymPy.
_FUNCTIONS = {"Abs": "fabs"}
_CONSTANTS = {"pi": "+mpmath.pi", "oo": "mpmath.inf", "zoo": "mpmath.nan", "nan": "mpmath.nan"}
#: A name, with the bracket behind that of a function, or a number.
_TOKEN = re.compile(r"([^\W\d]\w*)(\()?|(\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)")


@dataclass(frozen=True, slots=True)
class RecordedMatrix:
    """A derived matrix: its unit and size, and its nonzero entries as text by the names of row and column."""

    unit: str
    rows: int
    columns: int
    entries: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Record:
    """The mathematics of one model: constants, shared subexpressions, matrices, operations of each kernel.

    ``systems`` has the prefix of the names of each system that the model consists of.
    """

    name: str
    title: str
    definitions: Mapping[str, str]
    matrices: Mapping[str, RecordedMatrix]
    operations: Mapping[str, int]
    constants: Mapping[str, str] = field(default_factory=dict)
    systems: tuple[str, ...] = ("",)

    def to_json(self) -> str:
        """Return the record as JSON text, one line per entry, so that a change shows as a changed line."""
        return json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n"


def read_record(text: str) -> Record:
    """Parse the text of ``to_json``; any fault raises KeyError, TypeError or ValueError."""
    data: dict[str, Any] = json.loads(text)
    matrices = {name: RecordedMatrix(**m) for name, m in data["matrices"].items()}
    return Record(**{**data, "matrices": matrices, "systems": tuple(data["systems"])})


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
    constants: dict[str, str] = {}
    definitions: dict[str, str] = {}
    matrices: dict[str, RecordedMatrix] = {}
    for prefix, system in systems.items():
        constants |= {f"{prefix}{c.quantity.name}": _text(c.expression) for c in system.constants}
        definitions |= {f"{prefix}{d.quantity.name}": _text(d.expression) for d in system.definitions}
        matrices |= {prefix + m.name: _recorded(m) for m in system.matrices}
    return Record(name, title, definitions, matrices, operations, constants, tuple(systems))


def _recorded(m: NamedMatrix) -> RecordedMatrix:
    entries = {p: _text(e) for p, e in zip(places(m), m.matrix, strict=True) if e != 0}
    return RecordedMatrix(m.unit, m.matrix.rows, m.matrix.cols, entries)


def _text(expression: sp.Expr) -> str:
    """Return an expression as text."""
    return str(_printer().doprint(expression))


@lru_cache(maxsize=1)
def _printer() -> Any:
    from sympy.printing.str import StrPrinter

    class Printer(StrPrinter):
        def _print_Exp1(self, expr: sp.Expr) -> str:
            return "exp(1)"  # an E is a modulus

    return Printer()


def places(m: NamedMatrix) -> list[str]:
    """Return the name of each entry, row by row: the names of row and column, or numbers from 0."""
    rows, columns = (_named(names, n) for names, n in zip((m.rows, m.columns), m.matrix.shape, strict=True))
    return [", ".join(part for part in (r, c) if part) or "0" for r in rows for c in columns]


def _named(names: tuple[str, ...], size: int) -> Iterable[str]:
    if len(set(names)) == size:
        return names
    return [""] if size == 1 else [str(i) for i in range(size)]


class EntryValues:
    """Values of the entries of a record, at arguments between 1/2 and 3/2 derived from their names."""

    def __init__(self, record: Record) -> None:
        self._record = record
        self._known: dict[str, _Known] = {}

    def of(self, matrix: str) -> dict[str, str]:
        """Return the value of each entry of a matrix that has one."""
        import mpmath

        entries = self._record.matrices[matrix].entries if matrix in self._record.matrices else {}
        with mpmath.workdps(_WORKING):
            known = self._known_terms(matrix)
            found = {place: _value(text, known) for place, text in entries.items()}
            return {place: str(mpmath.nstr(x, DIGITS)) for place, x in found.items() if _is_real(x)}

    def _known_terms(self, matrix: str) -> _Known:
        prefix = _prefix(self._record, matrix)
        if prefix not in self._known:
            self._known[prefix] = known = _Known()
            for name, term in terms_of(self._record, matrix).items():
                known[name] = _value(term, known)
        return self._known[prefix]


def terms_of(record: Record, matrix: str) -> dict[str, str]:
    """Return the shared subexpressions of the system of a matrix, in the order of their use."""
    prefix = _prefix(record, matrix)
    return {n.removeprefix(prefix): d for n, d in record.definitions.items() if n.startswith(prefix)}


def _prefix(record: Record, matrix: str) -> str:
    return max((p for p in record.systems if matrix.startswith(p)), key=len, default="")


class _Known(dict[str, Any]):
    """Values by name; those of arguments are made when first asked for."""

    def __missing__(self, name: str) -> Any:
        import mpmath

        digest = hashlib.sha256(name.encode()).digest()[:4]
        self[name] = value = mpmath.mpf(0.5 + int.from_bytes(digest, "big") / 2**32)
        return value


def _value(text: str, known: _Known) -> Any:
    """Return the value of an expression, or nan if it has none."""
    import mpmath

    scope = {"__builtins__": {}, "mpmath": mpmath, "number": mpmath.mpf, "known": known}
    try:
        return eval(_TOKEN.sub(_in_python, text), scope)  # noqa: S307 - names, numbers and operators only
    except (ArithmeticError, ValueError, TypeError, AttributeError, RecursionError, SyntaxError):
        return mpmath.nan  # a pole, or no function of numbers


def _in_python(token: re.Match[str]) -> str:
    """Return a token of an expression as Python evaluates it with many digits."""
    name, bracket, number = token.groups()
    if number:
        return f"number('{number}')"
    if bracket:
        return f"mpmath.{_FUNCTIONS.get(name, name)}("
    return _CONSTANTS.get(name) or f"known['{name}']"


def _is_real(value: Any) -> bool:
    import mpmath

    return isinstance(value, mpmath.mpf) and bool(mpmath.isfinite(value))
