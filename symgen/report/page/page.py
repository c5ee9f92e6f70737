"""The page on a scene: its data, and rendering to a self-contained HTML file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from symgen.codegen.views import UnitView
from symgen.report.page.drawing import Drawing
from symgen.report.page.views import MatrixPattern, MatrixView, SymbolView
from symgen.runtime.result.result import Result


@dataclass(frozen=True, slots=True)
class Fact:
    """A name and a value."""

    name: str
    value: str


@dataclass(frozen=True, slots=True)
class StepView:
    """A derivation step; ``more`` counts matrices that the page omits and ``symgen show`` prints."""

    title: str
    about: str
    source: str
    matrices: tuple[MatrixView, ...]
    more: int


@dataclass(frozen=True, slots=True)
class KernelRow:
    """Operation counts of a kernel by kind, and its results."""

    name: str
    about: str
    flops: int
    kinds: tuple[int, ...]
    work: int
    out: int
    results: tuple[str, ...]
    signature: str


@dataclass(frozen=True, slots=True)
class TableView:
    """A table of text; the first column is the name."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class FigureView:
    """A figure: its data as a URI, alternative text and caption."""

    uri: str
    alt: str
    caption: str


@dataclass(frozen=True, slots=True)
class Measured:
    """A run and its cost; ``result`` is None if the run failed at once."""

    result: Result | None
    headline: tuple[Fact, ...] = ()
    facts: tuple[Fact, ...] = ()
    figure: FigureView | None = None
    notes: tuple[str, ...] = ()
    final: TableView | None = None
    speed: TableView | None = None
    speed_figure: FigureView | None = None
    speed_caption: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """All contents of the page.

    Attributes
    ----------
    kind
        Name of the part of ``templates/report/parts`` with the governing equation; none if empty.
    moving
        The mechanism in motion, in HTML; none if empty. Print and browsers without scripts show the drawing.
    """

    name: str
    title: str
    kind: str
    about: str
    facts: tuple[Fact, ...]
    drawing: Drawing | None
    drawing_caption: str
    moving: str
    steps: tuple[StepView, ...]
    structure: MatrixPattern | None
    structure_caption: str
    symbols: dict[str, tuple[SymbolView, ...]]
    shared: tuple[SymbolView, ...]
    shared_more: int
    kernels: tuple[KernelRow, ...]
    kinds: tuple[str, ...]
    in_c: str
    in_python: str
    measured: Measured
    left_out: tuple[str, ...]
    references: tuple[str, ...]
    equations: str


#: Colours of pages and drawings on white paper.
LIGHT = {
    "ink": "#1c1f23",
    "soft": "#5a626c",
    "line": "#d8dce1",
    "paper": "#ffffff",
    "accent": "#1f5c99",
    "warm": "#c2571a",
    "force": "#a3218e",
}


@lru_cache(maxsize=1)
def environment() -> Any:
    """Return the Jinja environment of pages, with autoescaping."""
    import jinja2

    result = jinja2.Environment(
        loader=jinja2.PackageLoader("symgen.templates", "report"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=True,
    )
    result.filters["unit"] = _unit
    result.globals["light"] = LIGHT
    return result


#: Superscripts for powers in units.
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def _unit(unit: str) -> str:
    """Return a unit in typographic form: kg*m^2/s as kg·m²/s."""
    raised = re.sub(r"\^(-?\d+)", lambda match: match[1].translate(_RAISED), unit)
    return raised.replace("*", "·")


def render(page: Page) -> str:
    """Return the page as one HTML file."""
    return environment().get_template("page.html.j2").render(page=page)


def example_in_c(unit: UnitView, kernel: str) -> str:
    """Return lines of a C program that call a kernel: header, arrays of the right size, the call."""
    view = next(k for k in unit.kernels if k.name == kernel)
    sizes = dict(zip(("t", "q", "u", "p", "work", "out"), view.sizes, strict=True))
    declarations = {name: f"double {name}[{size}]" for name, size in sizes.items() if size}
    passed = ", ".join(name if size else "NULL" for name, size in sizes.items())
    lines = [f'#include "{unit.name}_kernel.h"', ""]
    for name, text in declarations.items():
        start = " = {0}" if name in ("t", "q", "u", "p") else ""
        lines.append(f"{text}{start};")
    if view.after_setup and unit.tuned:
        n = len(unit.tuned.slots)
        lines.append(
            f"{unit.name}_setup(NULL, NULL, NULL, p, NULL, p + {n}); /* whenever parameters were set */"
        )
    lines.append(f"{unit.name}_{kernel}({passed});")
    lines += [
        f"/* out[{b.first}]..out[{b.last}]: {b.name} [{b.unit}] */"
        if b.first < b.last
        else f"/* out[{b.first}]: {b.name} [{b.unit}] */"
        for b in view.blocks
    ]
    return "\n".join(lines)
