"""Derived matrices as Python that SymPy alone runs, for the clipboard."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from itertools import chain, count
from typing import Any

import sympy as sp

from symgen.symbolic.switch import PieceFunction, PiecewisePolynomial, Sign
from symgen.symbolic.system import NamedMatrix

#: Numbers of pieces as :class:`symgen.symbolic.switch.PieceNumbers` finds them.
_NUMBERS = '''
class _Numbers(Function):
    """The number 2*i + 1 of the piece from knot i on, or the branch if it is one; or an entry of a piece."""
    def fdiff(self, argindex=1):
        return S(0)
    @classmethod
    def eval(cls, x, branch=None):
        n = len(cls.numbers)
        if not x.is_number or not (branch is None or branch.is_number):
            return None
        if branch is None:
            if not cls.period:
                return S(cls.numbers[min(max((int(x) + 1)//2, 0), n - 1)])
            turns, place = divmod((int(x) - 1)//2, n)
            return S(cls.numbers[place]) + turns*cls.step
        turns = int(floor((x - cls.numbers[0])/cls.period)) if cls.period else 0
        behind = sum(1 for knot in cls.numbers if x - turns*cls.period >= knot)
        return branch if branch % 2 else S(2*(turns*n + behind) - 1)
'''.strip()


def in_python(m: NamedMatrix) -> str:
    """Return a matrix as Python that SymPy alone runs, behind the definitions of its tables and profiles."""
    shown = (m.equation if m.in_letters else sp.Matrix(m.matrix)).replace(Sign, sp.sign)
    symbols: dict[str, list[str]] = {}
    called = {s: re.sub(r"\W", "_", s.name).lstrip("_") for s in shown.free_symbols if not s.is_commutative}
    for name, s in sorted((called.get(s, s.name), s) for s in shown.free_symbols):
        symbols.setdefault("commutative=False" if s in called else "real=True", []).append(name)
    declared = [f"{', '.join(x)} = symbols({' '.join(x)!r}, {kind})" for kind, x in symbols.items()]
    letters = {s: sp.Symbol(name, commutative=False) for s, name in called.items()}
    name = re.sub(r"[^0-9A-Za-z_]", "_", m.name)
    shown, defined = _with_pieces(shown.xreplace(letters), {name, *(n for x in symbols.values() for n in x)})
    return "\n".join(["from sympy import *", *defined, *declared, f"{name} = {_text(shown)}"])


def _with_pieces(shown: sp.Basic, taken: set[str]) -> tuple[sp.Basic, list[str]]:
    """Return an expression with own names for tables and profiles, and the lines that define these."""
    arguments = sp.symbols("x branch", real=True)
    polynomials = {kind: kind(*arguments).in_terms for kind in _kinds(shown, PiecewisePolynomial)}
    lines, names = [_NUMBERS], dict[type, sp.Function]()
    for kind in _kinds(sp.Tuple(shown, *polynomials.values()), PieceFunction):
        name, column = _unused(kind.__name__, taken), kind.column
        names[kind] = sp.Function(name)
        numbers = ", ".join(map(_number, column.numbers))
        lines += [f"class {name}(_Numbers):", f"    numbers = [{numbers}]"]
        lines += [f"    period, step = {_number(column.period)}, {_number(column.step)}"]
    for kind, terms in polynomials.items():
        name = _unused(kind.__name__, taken)
        lines += [f"def {name}(x, branch):", f"    return {_text(_renamed(terms, names))}"]
        names[kind] = sp.Function(name)
    return (_renamed(shown, names), lines) if names else (shown, [])


def _kinds(shown: sp.Basic, of: type[sp.Function]) -> list[Any]:
    """Return the classes of the functions of a kind, in the order of their names."""
    kinds = {type(f): f for f in sorted(shown.atoms(of), key=sp.default_sort_key)}
    return sorted(kinds, key=lambda kind: kind.__name__)


def _renamed(shown: Any, names: Mapping[type, sp.Function]) -> Any:
    for kind, function in names.items():
        shown = shown.replace(kind, function)
    return shown


def _unused(name: str, taken: set[str]) -> str:
    """Return a name, with a number where it is taken, and take it."""
    found = next(n for n in chain([name], map(f"{name}_{{}}".format, count(2))) if n not in taken)
    taken.add(found)
    return found


def _number(x: Fraction) -> str:
    """Return a number: exactly, or to the digits of a double."""
    return (
        str(x)
        if x.denominator == 1
        else f"S({x.numerator})/{x.denominator}"
        if len(str(x)) < 9
        else repr(float(x))
    )


def _text(shown: Any) -> str:
    return str(sp.sstr(shown, sympy_integers=True))
