"""Mathematical notation of names: as text, in LaTeX, and in MathML for pages and notebooks.

Names follow the conventions of the derivations: ``A_vx`` is v with subscripts A and x, ``ax`` a with
subscript x, ``theta1_rate`` a theta with a dot, ``OA_lambda`` a lambda of OA. Any other name is a letter or
word with the rest as its subscript.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape
from typing import Any
from xml.dom.minidom import parseString

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.pretty.pretty import PrettyPrinter
from sympy.printing.pretty.pretty_symbology import pretty_use_unicode
from sympy.printing.pretty.stringpict import prettyForm
from sympy.printing.str import StrPrinter

from symgen.symbolic.constants import Expression, with_pi

_LETTERS = """
alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon
phi chi psi omega
Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega
"""
_GREEK = dict(zip(_LETTERS.split(), "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΦΨΩ", strict=True))
_DOTS = {"_rate": 1, "_acceleration": 2, "_tt": 2, "_t": 1}
#: Names of components of velocities and accelerations of points, and of vectors of links, in derivations.
_COMPONENT = re.compile(r"(?:(?P<owner>.+)_)?(?P<letter>[vad])(?P<axis>[xyz])")
#: Letters of whole vectors and matrices, such as ``(S_t)``, ``[M]`` and ``delta(S)``.
_BRACKETED = re.compile(r"(\w*)([(\[])(.+)([)\]])")
_NUMBERED = re.compile(r"(?P<word>[^\W\d]+)(?P<number>\d+)(?P<rest>.*)")


@dataclass(frozen=True, slots=True)
class Notation:
    """A name as a letter or word, the dots above it, and its subscripts."""

    base: str
    dots: int = 0
    below: tuple[str, ...] = ()


def notation(name: str) -> Notation:
    """Return the notation of a name."""
    dots = 0
    for ending, count in _DOTS.items():
        if name.endswith(ending) and len(name) > len(ending):
            name, dots = name.removesuffix(ending), count
            break
    component = _COMPONENT.fullmatch(name)
    if component:
        owner = component["owner"].split("_") if component["owner"] else ()
        return Notation(component["letter"], dots, (*owner, component["axis"]))
    head, *rest = [part for part in name.split("_") if part] or [name]
    if rest and rest[-1] == "lambda":
        return Notation("lambda", dots, (head, *rest[:-1]))
    match = _NUMBERED.fullmatch(head)
    if match and (len(match["word"]) == 1 or match["word"] in _GREEK):
        return Notation(match["word"], dots, (match["number"], *rest))
    return Notation(head, dots, tuple(rest))


#: Digits of a number that is shown; a rational of longer numbers is shown as a decimal fraction.
_SHOWN = 15


def readable(expression: Expression) -> Expression:
    """Return an expression for readers: multiples of pi as such, long rationals as decimal fractions."""
    expression = with_pi(expression)
    sums = ((m, _whole(m)) for m in expression.atoms(sp.Mul) if m.atoms(sp.Add))
    expression = expression.xreplace({m: whole for m, whole in sums if whole is not m})
    sums = ((a, _over_one(a)) for a in expression.atoms(sp.Add) if a.is_commutative)
    expression = expression.xreplace({a: joined for a, joined in sums if joined is not a})
    long = {r: sp.Float(r, _SHOWN) for r in expression.atoms(sp.Rational) if len(str(r.q)) > _SHOWN}
    return expression.xreplace(long)


def _whole(product: sp.Expr) -> sp.Expr:
    """Return a product with common numbers and signs of sums in front.

    k (2 l - 2 l0)/2 is k (l - l0), and g (-m1 - m2)/2 is -g (m1 + m2)/2; a (m1 + m2/2) stays.
    """
    pairs = [_common(f) if f.is_Add else (sp.S.One, f) for f in product.args]
    numbers, factors = zip(*pairs, strict=True)
    return sp.Mul(sp.Mul(*numbers), *factors) if any(n != 1 for n in numbers) else product


def _over_one(total: sp.Expr) -> sp.Expr:
    """Return a sum with the terms of a denominator over it: r2 - r1/2 - r3/2 is r2 - (r1 + r3)/2."""
    groups: dict[int, list[sp.Expr]] = {}
    for term in total.args:
        number, _ = term.as_coeff_Mul()
        groups.setdefault(number.q if number.is_Rational else 1, []).append(term)
    if all(q == 1 or len(terms) == 1 for q, terms in groups.items()):
        return total
    parts = groups.pop(1, [])
    for q, terms in groups.items():
        number, rest = _common(sp.Add(*(q * term for term in terms)))
        parts.append(sp.Mul(number / q, rest, evaluate=False) if rest.is_Add else number * rest / q)
    return sp.Add(*parts)


def _common(total: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the common number of the terms of a sum, negative if all are, and the sum without it."""
    number, rest = total.primitive()
    coefficients = [term.as_coeff_Mul()[0] for term in total.args]
    if number.q != 1 and any(c.is_Integer for c in coefficients):
        number, rest = sp.S.One, total
    return (-number, -rest) if all(c.is_negative for c in coefficients) else (number, rest)


def pretty(expression: sp.Basic | sp.MatrixBase) -> str:
    """Return an expression or a matrix as text in lines."""
    before = pretty_use_unicode(True)
    try:
        return str(_Pretty({"wrap_line": False, "use_unicode": True}).doprint(readable(expression)))
    finally:
        pretty_use_unicode(before)


def pretty_entries(matrix: sp.MatrixBase) -> list[list[prettyForm]]:
    """Return the entries as :func:`pretty` shows them, each with its size and baseline in lines."""
    before = pretty_use_unicode(True)
    try:
        printer = _Pretty({"wrap_line": False, "use_unicode": True})
        forms = {e: printer._print(readable(e)) for e in {*matrix}}
        return [[forms[e] for e in row] for row in matrix.tolist()]
    finally:
        pretty_use_unicode(before)


def text(expression: sp.Expr) -> str:
    """Return an expression as text in one line, in the notation of :func:`pretty`."""
    line = str(_Text().doprint(readable(expression)))
    line = _POWER.sub(lambda match: match[1].translate(_ABOVE), line)
    return line.replace("**", "^").replace("*", "⋅")


def latex(expression: sp.Basic | sp.MatrixBase) -> str:
    """Return an expression or a matrix in LaTeX, for displayed mathematics."""
    return str(_Latex().doprint(readable(expression)))


def mathml(expression: sp.Basic | sp.MatrixBase) -> str:
    """Return the content of a ``<math>`` element, in presentation MathML Core."""
    printer = _MathML({"mat_delim": "["})
    text: str = printer._print(readable(expression)).toxml()
    for plain, typeset in _TYPESET:
        text = text.replace(plain, typeset)
    return text


#: Corrections to SymPy's printer: minus signs, and products of words without a space between them.
_TYPESET = (
    ("<mo>-</mo>", "<mo>−</mo>"),
    ("<mn>-", "<mn>−"),
    ("<mo>&InvisibleTimes;</mo>", '<mo lspace="0" rspace="0.12em">&#8290;</mo>'),
)


def text_name(name: str) -> str:
    """Return a name as text in one line: with Greek letters, dots, and digits below."""
    if bracketed := _BRACKETED.fullmatch(name):
        before, opened, inside, closed = bracketed.groups()
        return f"{before and text_name(before)}{opened}{text_name(inside)}{closed}"
    n = notation(name)
    letter = _GREEK.get(n.base, n.base)
    if n.dots and len(letter) > 1:  # no dots above words
        return name
    first, *rest = n.below or ("",)
    if not first.isdecimal():
        first, rest = "", list(n.below)
    words = (_greek(word) for word in rest)
    return (
        letter + ["", "\u0307", "\u0308"][n.dots] + first.translate(_BELOW) + "".join(f"_{w}" for w in words)
    )


def latex_name(name: str) -> str:
    """Return a name in LaTeX."""
    if bracketed := _BRACKETED.fullmatch(name):
        before, opened, inside, closed = bracketed.groups()
        return rf"{before and latex_name(before)}\left{opened}{latex_name(inside)}\right{closed}"
    n = notation(name)
    base = rf"\{n.base}" if n.base in _IN_LATEX else _upright(n.base)
    base = rf"\{'d' * n.dots}ot{{{base}}}" if n.dots else base
    return base + (rf"_{{{','.join(map(_below, n.below))}}}" if n.below else "")


def mathml_name(name: str) -> str:
    """Return a name in MathML."""
    if bracketed := _BRACKETED.fullmatch(name):
        before, opened, inside, closed = bracketed.groups()
        first = before and mathml_name(before)
        return f"<mrow>{first}<mo>{opened}</mo>{mathml_name(inside)}<mo>{closed}</mo></mrow>"
    n = notation(name)
    base = _mi(n.base)
    if n.dots:
        base = f'<mover accent="true">{base}<mo>{"˙" if n.dots == 1 else "¨"}</mo></mover>'
    if not n.below:
        return base
    below = '<mo separator="true" rspace="0">,</mo>'.join(map(_mi, n.below))
    return f"<msub>{base}<mrow>{below}</mrow></msub>"


_IN_LATEX = frozenset(_GREEK)
_BELOW, _ABOVE = (str.maketrans("0123456789", digits) for digits in ("₀₁₂₃₄₅₆₇₈₉", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
#: Whole powers in text.
_POWER = re.compile(r"\*\*(\d+)(?![\d.])")


def _upright(word: str) -> str:
    return word if len(word) == 1 else rf"\mathrm{{{_plain(word)}}}"


def _below(word: str) -> str:
    match = _NUMBERED.fullmatch(word)
    if match and match["word"] in _GREEK:
        return rf"\{match['word']}{match['number']}{_plain(match['rest'])}"
    return rf"\{word}" if word in _IN_LATEX else _upright(word)


def _plain(word: str) -> str:
    return "".join(_ESCAPED.get(letter, letter) for letter in word)


_ESCAPED = {letter: rf"\{letter}" for letter in "_#$%&{}"}
_ESCAPED |= {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}"}


def _mi(word: str) -> str:
    """Return a word as one identifier, Greek if it names a letter; a number as a number."""
    if word.isdecimal():
        return f"<mn>{word}</mn>"
    return f"<mi>{escape(_greek(word))}</mi>"


def _greek(word: str) -> str:
    """Return a word, or the Greek letter that it names, with its number."""
    match = _NUMBERED.fullmatch(word)
    if match and match["word"] in _GREEK:
        return _GREEK[match["word"]] + match["number"] + match["rest"]
    return _GREEK.get(word, word)


class _Ordered:
    """Terms of equations between whole vectors and matrices stay in the order of the source."""

    def _as_ordered_terms(self, expr: sp.Add, order: str | None = None) -> list[sp.Expr]:
        ordered: list[sp.Expr] = super()._as_ordered_terms(expr, order)  # type: ignore[misc]
        return ordered if expr.is_commutative else list(expr.args)


class _Pretty(_Ordered, PrettyPrinter):
    def _print_Symbol(self, e: sp.Symbol, bold_name: bool = False) -> prettyForm:
        return prettyForm(text_name(e.name))

    def _print_transpose(self, e: sp.Expr) -> prettyForm:
        return self._print(e.args[0]) ** prettyForm("T")


class _Text(_Ordered, StrPrinter):
    def _print_Symbol(self, expr: sp.Symbol) -> str:
        return text_name(expr.name)

    def _print_transpose(self, expr: sp.Expr) -> str:
        return f"{self._print(expr.args[0])}ᵀ"

    def _print_Mul(self, expr: sp.Mul) -> str:
        number, rest = expr.as_coeff_Mul()
        if expr.is_commutative or number.is_Integer:
            return str(super()._print_Mul(expr))
        return f"{number}*{self.parenthesize(rest, PRECEDENCE['Mul'], strict=True)}"  # in front of long sums

    def _print_Pi(self, expr: sp.Expr) -> str:
        return "π"

    def _print_Abs(self, expr: sp.Expr) -> str:
        return f"|{self._print(expr.args[0])}|"

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        *cases, last = (
            self._print(value) if condition == True else f"{self._print(value)} if {self._print(condition)}"  # noqa: E712
            for value, condition in expr.args
        )
        return f"({', '.join([*cases, f'otherwise {last}'])})"

    def _print_And(self, expr: sp.And) -> str:
        parts = ((self._print(x), isinstance(x, sp.Or)) for x in expr.args)
        return " and ".join(f"({part})" if either else part for part, either in parts)

    def _print_Or(self, expr: sp.Or) -> str:
        return " or ".join(map(self._print, expr.args))

    def _print_Relational(self, expr: sp.Rel) -> str:
        sign = {"<=": "≤", ">=": "≥", "==": "="}.get(expr.rel_op, expr.rel_op)
        return f"{self._print(expr.lhs)} {sign} {self._print(expr.rhs)}"


class _Latex(_Ordered, LatexPrinter):
    def _print_Symbol(self, expr: sp.Symbol, style: str = "plain") -> str:
        return latex_name(expr.name)

    def _print_transpose(self, expr: sp.Expr) -> str:
        return rf"{self._print(expr.args[0])}^{{T}}"


class _MathML(_Ordered, MathMLPresentationPrinter):
    """SymPy's printer, with names by their notation and cases by lines."""

    def _print_Symbol(self, sym: sp.Symbol, style: str = "plain") -> Any:
        return _parsed(mathml_name(sym.name))

    def _print_transpose(self, expr: sp.Expr) -> Any:
        whole = self.dom.createElement("msup")
        for part in (self._print(expr.args[0]), _parsed("<mi>T</mi>")):
            whole.appendChild(part)
        return whole

    def _print_Pow(self, e: sp.Pow) -> Any:
        named = notation(e.base.name) if e.base.is_Symbol else None
        if named is None or not named.below or not e.exp.is_Integer or e.exp < 2:
            return super()._print_Pow(e)
        base, below = _parsed(mathml_name(e.base.name)).childNodes
        whole = self.dom.createElement("msubsup")
        for part in (base, below, self._print(e.exp)):
            whole.appendChild(part)
        return whole

    def _print_Piecewise(self, expr: sp.Piecewise) -> Any:
        table = self.dom.createElement("mtable")
        table.setAttribute("columnalign", "left")
        for value, condition in expr.args:
            row = self.dom.createElement("mtr")
            for part in (value, condition):
                cell = self.dom.createElement("mtd")
                cell.appendChild(_parsed("<mtext>otherwise</mtext>") if part == True else self._print(part))  # noqa: E712
                row.appendChild(cell)
            table.appendChild(row)
        whole = self.dom.createElement("mrow")
        whole.appendChild(_parsed("<mo>{</mo>"))
        whole.appendChild(table)
        return whole


def _parsed(text: str) -> Any:
    return parseString(text).documentElement  # noqa: S318 - of text made here alone


class DerivedMatrix(sp.ImmutableMatrix):
    """A SymPy matrix that notebooks show in the notation of symgen."""

    @classmethod
    def of(cls, matrix: sp.ImmutableMatrix) -> DerivedMatrix:
        """Return a matrix as one of this class, which its constructor does not."""
        return cls._fromrep(matrix._rep)

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {latex(self)}$"


class DerivedEquation(sp.Equality):
    """A SymPy equation in the notation of symgen, which is never evaluated, even 0 = x for x > 0."""

    def __new__(cls, left: sp.Basic, right: sp.Basic, **options: Any) -> DerivedEquation:
        """Return the equation."""
        equation: DerivedEquation = super().__new__(cls, left, right, evaluate=False)
        return equation

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {latex(self)}$"
