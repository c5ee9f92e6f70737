"""The notation of a print, typed as it stands: ``3x4/2L2`` is 3 x^4/(2 L^2); see ``elastic_print``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache

import sympy as sp

UNREADABLE = "?"


@dataclass(frozen=True)
class Printed:
    """A matrix: its entries row by row, and the meaning of its letters."""

    rows: tuple[tuple[str, ...], ...]
    letters: dict[str, str] = field(default_factory=dict)


def listed(text: str) -> dict[str, str]:
    """Read ``name = entry`` from lines, or parts of lines between semicolons."""
    pairs = (part.split("=") for part in re.split(r"[;\n]", text) if part.strip())
    return {name.strip(): entry.strip() for name, entry in pairs}


def matrix(text: str, letters: str = "") -> Printed:
    return Printed(tuple(tuple(line.split()) for line in text.strip().splitlines()), listed(letters))


def value(text: str, letters: dict[str, str] | None = None) -> sp.Expr:
    """Return an entry as an expression in plain symbols."""
    return _plain(text).xreplace({sp.Symbol(k): _plain(v) for k, v in (letters or {}).items()})


@cache
def _plain(text: str) -> sp.Expr:
    return sp.sympify(_spelled(text), locals=_Symbols())


class _Symbols(dict):
    """Every name is a symbol, E, I, N, S and Q too."""

    def __contains__(self, name):
        return name.isidentifier()

    def __getitem__(self, name):
        return {"Rational": sp.Rational, "Integer": sp.Integer}.get(name, sp.Symbol(name))


def _spelled(text: str) -> str:
    below = re.sub(r"/([0-9A-Za-z]+)", lambda m: f"/({_factors(m[1])})", text)
    parts = re.split(r"(/\([^)]*\))", below)
    spelled = "".join(part if part.startswith("/(") else _factors(part) for part in parts)
    return re.sub(r"(?<=[0-9)A-Za-z])\s+(?=[0-9(A-Za-z])", "*", spelled)


def _factors(text: str) -> str:
    """Write out powers and products of a run of letters and digits."""

    def run(match):
        tokens = re.findall(r"EA|EI|[A-Za-z]\d*|\d+", match[0])
        return "*".join(
            t if t.isdigit() or t in ("EA", "EI") or len(t) == 1 else f"{t[0]}**{t[1:]}" for t in tokens
        )

    return re.sub(r"[0-9A-Za-z]+", run, text)
