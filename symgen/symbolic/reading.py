"""Expressions parsed from the text of a record."""

from __future__ import annotations

import ast

import sympy as sp
from sympy.core.parameters import distribute

from symgen.symbolic.switch import Sign

#: Functions by their name in a record; other calls stay functions of that name.
_KNOWN = [sp.Abs, sp.sqrt, sp.exp, sp.log, sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.atan2]
_KNOWN += [sp.sinh, sp.cosh, sp.tanh, sp.sign, sp.Min, sp.Max, sp.Piecewise, Sign]
_FUNCTIONS = {function.__name__: function for function in _KNOWN}
_NAMES = {"pi": sp.pi, "E": sp.E, "True": sp.true}
_BINARY = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}
_RELATIONS = {ast.Lt: sp.Lt, ast.LtE: sp.Le, ast.Gt: sp.Gt, ast.GtE: sp.Ge, ast.Eq: sp.Eq, ast.NotEq: sp.Ne}


def expression(text: str) -> sp.Expr | None:
    """Return the expression of a text in a record; None if the text is not an expression.

    The text is parsed as data, never executed. Sums keep their factors: nothing is multiplied out.
    """
    try:
        with distribute(False):
            return _read(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, TypeError, KeyError, AttributeError, RecursionError, MemoryError):
        return None


def _read(node: ast.expr) -> sp.Expr:
    match node:
        case ast.Constant(value=bool() as value):
            return _NAMES[str(value)]
        case ast.Constant(value=int() as value):
            return sp.Integer(value)
        case ast.Constant(value=float() as value):
            return sp.Float(value)
        case ast.Name(id=name):
            return _NAMES.get(name) or sp.Symbol(name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_read(operand)
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](_read(left), _read(right))
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return _RELATIONS[type(op)](_read(left), _read(right))
        case ast.Tuple(elts=parts):
            return sp.Tuple(*map(_read, parts))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _FUNCTIONS.get(name, sp.Function(name))(*map(_read, arguments))
    raise ValueError("no expression")
