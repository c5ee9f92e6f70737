"""A reader of the LaTeX and of the one-line text that ``symgen show`` prints: back to SymPy."""

from __future__ import annotations

import re

import sympy as sp

from symgen.symbolic.notation import latex_name, text_name

_FUNCTIONS = {
    "sin": sp.sin, "cos": sp.cos, "tan": sp.tan, "asin": sp.asin, "acos": sp.acos, "atan": sp.atan, "exp": sp.exp, "atan}_{2": sp.atan2,
    "log": sp.log, "sign": sp.sign, "cosh": sp.cosh, "sinh": sp.sinh, "tanh": sp.tanh, "min": sp.Min, "max": sp.Max,
}  # fmt: skip
_FUNCTION = re.compile(
    r"\\operatorname\{(\w+(?:\}_\{2)?)\}|\\(sin|cos|tan|log|exp|sinh|cosh|tanh|min|max)(?![a-zA-Z])"
)
_NUMBER = re.compile(r"\d+(\.\d+)?")


class _Reader:
    def __init__(self, text: str, symbols: dict[str, sp.Symbol]) -> None:
        self.text, self.at = text, 0
        self.symbols = sorted(symbols.items(), key=lambda pair: -len(pair[0]))

    def skip(self) -> None:
        while self.at < len(self.text) and self.text[self.at] in " \n":
            self.at += 1

    def taken(self, word: str) -> bool:
        self.skip()
        found = self.text.startswith(word, self.at)
        self.at += len(word) * found
        return found

    def need(self, word: str) -> None:
        assert self.taken(word), f"expected {word!r} at {self.text[self.at : self.at + 40]!r}"

    def sum(self) -> sp.Expr:
        sign = -1 if self.taken("-") else 1
        total = sign * self.product()
        while True:
            if self.taken("+"):
                total += self.product()
            elif self.taken("-"):
                total -= self.product()
            else:
                return total

    def product(self) -> sp.Expr:
        value = None
        while True:
            self.taken(r"\cdot")
            self.skip()
            rest = self.text[self.at :]
            if not rest or rest[0] in "+-})&," or rest.startswith((r"\\", r"\right", r"\end", "]")):
                assert value is not None, f"expected a factor at {rest[:40]!r}"
                return value
            factor = self.power()
            value = factor if value is None else value * factor

    def power(self) -> sp.Expr:
        base = self.base()
        return base ** self.braced() if self.taken("^") else base

    def braced(self) -> sp.Expr:
        self.need("{")
        value = self.sum()
        self.need("}")
        return value

    def base(self) -> sp.Expr:
        self.skip()
        for written, symbol in self.symbols:
            if self.text.startswith(written, self.at):
                self.at += len(written)
                return symbol
        if number := _NUMBER.match(self.text, self.at):
            self.at = number.end()
            return sp.Rational(number[0])
        if function := _FUNCTION.match(self.text, self.at):
            self.at = function.end()
            power = self.braced() if self.taken("^") else 1
            return self.arguments(_FUNCTIONS[function[1] or function[2]]) ** power
        if self.taken(r"\frac"):
            return self.braced() / self.braced()
        if self.taken(r"\sqrt"):
            return sp.sqrt(self.braced())
        if self.taken(r"\left|"):
            value = self.braced()
            self.need(r"\right|")
            return sp.Abs(value)
        if self.taken(r"\left("):
            value = self.sum()
            self.need(r"\right)")
            return value
        if self.taken(r"\pi"):
            return sp.pi
        if self.taken("e"):
            return sp.E
        if self.taken("{"):
            value = self.sum()
            self.need("}")
            return value
        raise AssertionError(f"cannot read {self.text[self.at : self.at + 40]!r}")

    def arguments(self, function: object) -> sp.Expr:
        inside = self.taken("{")
        self.need(r"\left(")
        values = [self.sum()]
        while self.taken(","):
            values.append(self.sum())
        self.need(r"\right)")
        if inside:
            self.need("}")
        return function(*values)


def from_latex(text: str, symbols: dict[str, sp.Symbol]) -> sp.Expr:
    """Return the expression that LaTeX stands for; ``symbols`` by their LaTeX."""
    reader = _Reader(text, symbols)
    value = reader.sum()
    reader.skip()
    assert reader.at == len(text), f"left over: {text[reader.at :][:40]!r}"
    return value


def matrix_from_latex(shown: str, m, system) -> sp.Matrix:
    """Return the matrix ``m`` of a system from the LaTeX in which it is shown."""
    symbols = {latex_name(x.name): x.symbol for x in system.quantities()}
    found = sp.zeros(*m.matrix.shape)
    body = "\n".join(
        line for line in shown.split("\n% with\n", maxsplit=1)[0].splitlines() if not line.startswith("%")
    )
    if r"\begin{align*}" in body:
        places = {
            rf"\left({', '.join(name)}\right)": (i, j)
            for i in range(m.matrix.rows)
            for j in range(m.matrix.cols)
            for name in [
                [latex_name(m.rows[i]) if m.rows else str(i + 1)]
                + ([latex_name(m.columns[j]) if m.columns else str(j + 1)] if m.matrix.cols > 1 else [])
            ]
        }
        inner = body.partition(r"\begin{align*}")[2].partition(r"\end{align*}")[0]
        for row in inner.split(r"\\" + "\n"):
            left, _, right = " ".join(row.split()).partition(" &= ")
            found[places[left]] = from_latex(right, symbols)
        return found
    inner = body.partition(r"\[")[2].partition(r"\]")[0].strip().removeprefix("0 = ")
    if m.matrix.shape == (1, 1):
        found[0, 0] = from_latex(inner, symbols)
        return found
    inner = re.sub(r"\\left\[\\begin\{(matrix|array)\}(\{c*\})?", "", inner)
    inner = re.sub(r"\\end\{(matrix|array)\}\\right\]", "", inner)
    for i, row in enumerate(inner.split(r"\\")):
        for j, entry in enumerate(row.split("&")):
            found[i, j] = from_latex(entry.strip(), symbols)
    return found


_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")


def from_text(text: str, system) -> sp.Expr:
    """Return the expression that one line of text stands for, by SymPy's own parser."""
    names = {text_name(x.name): x.symbol for x in system.quantities()}
    text = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda match: "**" + match[0].translate(_SUPERSCRIPTS), text)
    places = {}
    for k, written in enumerate(sorted(names, key=len, reverse=True)):
        pattern = rf"(?<![\w\u0307\u0308]){re.escape(written)}(?![\w\u0307\u0308])"
        text, count = re.subn(pattern, f" zz{k}z ", text)
        if count:
            places[f"zz{k}z"] = names[written]
    text = text.replace("⋅", "*").replace("^", "**").replace("π", "pi")
    text = re.sub(r"(?<![\w.])(\d+\.\d+|\d+)(?![\w.])", r"Rational('\1')", text)
    return sp.parse_expr(text, local_dict=places)
