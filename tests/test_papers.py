"""docs/papers.md: every equation, figure and table of the papers has a row, and its command prints what it says."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import shared.elastic_golden as golden
from shared.commands import call
from shared.equations import found
from shared.golden import reference
from shared.thesis_assembly import BOUNDARY, HELD, assembled

from symgen.cli.common import changes
from symgen.errors import ModelError
from symgen.mechanics import sources
from symgen.pipeline.citations import LAST, elsewhere
from symgen.pipeline.subject import Subject

DOCS = Path(__file__).parent.parent / "docs"
PAGE = (DOCS / "papers.md").read_text("utf-8")
PAPERS = {"Attia": "Attia", "Rahman": "Rahman", "thesis": "The thesis"}
#: Of the copies at hand: figures, tables.
FIGURES = {"Attia": 5, "Rahman": 38, "thesis": 46}
TABLES = {
    "Attia": (),
    "Rahman": ("table 1",),
    "thesis": [f"Table {n}" for n in ("I", "II", "III", "IV", "V", "VI")],
}

_EQUATION = re.compile(r"\((?:([A-Z]|\d+)\.)?(\d+)([a-z]?)\)")
_RANGE = re.compile(rf"{_EQUATION.pattern}(?:-{_EQUATION.pattern})?")
_FIGURES = re.compile(r"Figs?\. (\d+[a-z]?(?:(?:, | to )\d+[a-z]?)*)")
_CODE = re.compile(r"`([^`]+)`")
_NUMBER = re.compile(r"-?\d+\.?\d*")

Equation = tuple[str, int, str]


class Row(NamedTuple):
    """A row of a table of the page."""

    paper: str
    place: str
    module: str
    commands: tuple[str, ...]
    agreement: str
    outputs: tuple[str, ...]

    @property
    def numbers(self) -> list[str]:
        """Numbers that the commands print."""
        return [x for x in _CODE.findall(self.agreement) if _NUMBER.fullmatch(x)]


@cache
def rows() -> tuple[Row, ...]:
    found: list[Row] = []
    for paper, heading in PAPERS.items():
        (section,) = re.findall(rf"^## {heading}.*?(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
        names: list[str] = []
        one = ""
        for line in section.splitlines():
            one = line.strip() if line.startswith("    symgen ") else one
            cells = [x.strip() for x in line.strip("|").split("|")] if line.startswith("|") else []
            if not cells:
                names = []
            elif not names:
                names = cells
            elif not set(cells[0]) <= {"-"}:
                by = dict(zip(names, cells, strict=True))
                commands = tuple(
                    x for x in _CODE.findall(by.get("command", f"`{one}`")) if x.startswith("symgen ")
                )
                if by.get("command") == "as in the row above":
                    commands = found[-1].commands
                found.append(
                    Row(paper, cells[0], by.get("derived in", ""), commands, by["agreement"],
                        tuple(_CODE.findall(by.get("output", ""))))
                )  # fmt: skip
    return tuple(found)


def equations(text: str) -> Iterator[tuple[Equation, Equation]]:
    """Yield first and last of every equation or range of equations."""
    for *first, chapter, number, letter in _RANGE.findall(text):
        start = (first[0], int(first[1]), first[2])
        yield start, (chapter, int(number), letter) if number else start


def covered(equation: Equation, ranges: list[tuple[Equation, Equation]]) -> bool:
    return any(a[0] == equation[0] == b[0] and a[1:] <= equation[1:] <= b[1:] for a, b in ranges)


def of(paper: str) -> list[tuple[Equation, Equation]]:
    return [x for row in rows() if row.paper == paper for x in equations(row.place)]


@pytest.mark.parametrize("paper", PAPERS)
def test_every_equation_has_a_row(paper):
    ranges = of(paper)
    lost = [
        (chapter, n)
        for chapter, last in LAST[paper].items()
        for n in range(1, last + 1)
        if not any(a[0] == chapter and a[1] <= n <= b[1] for a, b in ranges)
    ]
    assert not lost


def test_every_number_of_a_named_matrix_has_a_row():
    tables = [x for x in vars(sources).values() if isinstance(x, tuple) and x and isinstance(x[0], tuple)]
    texts = {text for table in tables for _, text in table} | {*sources.ROWS.values()}
    checked = 0
    for text in texts:
        paper = next((p for p in PAPERS if p in text), "")
        for ends in equations(text):
            for equation in ends:
                assert covered(equation, of(paper)), (text, equation)
                checked += 1
    assert checked > 100


@pytest.mark.parametrize("paper", PAPERS)
def test_every_figure_and_table_has_a_row(paper):
    places = [row.place for row in rows() if row.paper == paper]
    found: set[int] = set()
    for text in _FIGURES.findall(" | ".join(places)):
        for part in text.split(", "):
            ends = [int(re.sub(r"\D", "", x)) for x in part.split(" to ")]
            found |= {*range(ends[0], ends[-1] + 1)}
    assert found == {*range(1, FIGURES[paper] + 1)}
    for table in TABLES[paper]:
        assert any(re.search(rf"\b{table}\b", x) for x in places), table


def test_rows_without_a_command_say_why():
    for row in rows():
        if not row.commands:
            why = ("missing", "not derived", "no counterpart", "replaced")
            assert any(x in row.agreement for x in why), row
    assert not any("planned" in r.agreement for r in rows())
    package = DOCS.parent / "symgen"
    for row in rows():
        for name in _CODE.findall(row.module):
            assert (package / "mechanics" / name).exists() or (package / name).exists(), name


SHOWN = sorted({(c, row) for row in rows() for c in row.commands if c.startswith("symgen show")})
RUN = sorted({c for row in rows() for c in row.commands})


def options_of(command: str) -> tuple[str, ...]:
    words = shlex.split(command)
    return tuple(words[i + 1] for i, x in enumerate(words) if x == "--set")


@cache
def subject(name: str, options: tuple[str, ...]) -> Subject:
    return Subject(name, changes([*options]))


@pytest.mark.parametrize("name", sorted({shlex.split(c)[2] for c, _ in SHOWN}))
def test_shown_matrices_state_an_equation_of_their_row(name):
    for command, row in SHOWN:
        _, _, scene, *rest = shlex.split(command)
        if scene != name or not rest or rest[0] == "derivation":
            continue
        matrices = found(subject(name, options_of(command)), rest[0])
        ranges = [x for m in matrices for x in equations(m.source) if row.paper in m.source]
        here = [*equations(row.place)]
        common = any(covered(a, here) or covered(b, here) for a, b in ranges)
        common = common or any(covered(a, ranges) or covered(b, ranges) for a, b in here)
        assert common or not ranges or not here, (command, row.place, [m.source for m in matrices])


@pytest.mark.parametrize("name", sorted({shlex.split(c)[2] for c, row in SHOWN if row.paper == "thesis"}))
def test_every_equation_of_the_thesis_is_found_by_its_number(name):
    """In the model whose matrix its row names; rows without a command say that they are not derived."""
    lost = []
    for command, row in SHOWN:
        _, _, scene, matrix, *_ = (*shlex.split(command), "")
        if row.paper != "thesis" or scene != name or not matrix or matrix == "derivation":
            continue
        options = options_of(command)
        for (chapter, first, letter), (_, last, _) in equations(row.place):
            for n in range(first, last + 1):
                number = f"({chapter}{'.' * bool(chapter)}{n}{letter})"
                try:
                    assert found(subject(name, options), number)
                except ModelError:
                    lost.append((row.place, number))
    assert not lost


def test_errors_name_commands_other_than_show():
    """Where a row has a command but none of `symgen show`, the error for its numbers names a command."""
    checked = 0
    for row in rows():
        if row.commands and not any(c.startswith("symgen show") for c in row.commands):
            for first, last in equations(row.place):
                chapter = f"{first[0]}." if first[0] else ""
                for number in spelled(first, last):
                    asked = f"{row.paper}({chapter}{number[1:]}"
                    assert "symgen " in elsewhere(asked.replace("(", " (")), asked
                    checked += 1
    assert checked > 50


def spelled(first: Equation, last: Equation) -> list[str]:
    """Return all numbers of a range, such as (62a), (62b) and (62c) of (62a)-(62c)."""
    (_, start, letter), (_, end, to) = first, last
    if start == end and to:
        return [f"({start}{chr(x)})" for x in range(ord(letter or "a"), ord(to) + 1)]
    return [f"({n}{letter})" for n in range(start, end + 1)]


PRINTED = sorted(
    {
        (shlex.split(command)[2], options_of(command), number, row)
        for command, row in SHOWN
        for ends in equations(row.place)
        for number in spelled(*ends)
        if row.paper in ("Attia", "Rahman") and len(shlex.split(command)) > 3
    }
)


@pytest.mark.parametrize("name", sorted({name for name, *_ in PRINTED}))
def test_numbers_of_a_row_are_found_with_its_model(name):
    """What `symgen show MODEL "(N)"` finds cites the number itself, and is what the row shows."""
    wrong = []
    for _, options, number, row in (x for x in PRINTED if x[0] == name):
        model = subject(name, options)
        try:
            shown = found(model, number)
        except ModelError:
            wrong.append((number, row.place, "not found"))
            continue
        names = {shlex.split(c)[3] for c in row.commands if c.startswith(f"symgen show {name} ")}
        if not {m.name for m in shown} & {m.name for x in names for m in found(model, x)}:
            wrong.append((number, row.place, [m.name for m in shown]))
    assert not wrong


def files(folder: Path) -> None:
    """Write the tasks that the page shows."""
    for name, text in re.findall(r"`(\w+\.toml)`:?\n\n```toml\n(.*?)```", PAGE, re.DOTALL):
        (folder / name).write_text(text, "utf-8")


@cache
def printed(command: str) -> str:
    return call(*shlex.split(command)[1:])


@pytest.mark.parametrize("command", sorted({c for row in rows() if row.numbers for c in row.commands}))
def test_numbers_of_a_row_are_printed(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files(tmp_path)
    text = printed(command)
    for row in rows():
        if command in row.commands:
            for number in row.numbers:
                lines = [
                    x for x in text.splitlines() if re.search(rf"(?<![\d.]){re.escape(number)}(?!\d)", x)
                ]
                assert any(not row.outputs or x.split()[0] in row.outputs for x in lines), (row.place, number)


@pytest.mark.full
@pytest.mark.parametrize("command", RUN)
def test_commands_of_rows_run(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files(tmp_path)
    assert printed(command)


def numbers(place: str, paper: str) -> list[str]:
    return [x for row in rows() if row.paper == paper and row.place == place for x in row.numbers]


def slider_crank(name):
    """Golden numbers of a scene: those at 45 degrees, and the angles of the dead centres."""
    (scene,) = (s for s in reference("dual_slider_crank")["scenes"] if s["name"] == name)
    (at,) = (p for p in scene["positions"] if p["theta1_deg"] == 45)
    return at["mode_T"] | {"S4": at["kin"]["S4"]["pos"]}, [c["theta1_deg"] for c in scene["dead_centres"]]


def test_numbers_are_those_computed_independently():
    """Golden numbers, or those of the print, to the digits of the page."""
    assert numbers("Fig. 5", "Attia") == ["0.06", f"{0.0012604868770946:.6g}"]
    acceleration = float(reference("rods_peaucellier_rest_horizontal")["acc"][1][1])
    assert numbers("section 3", "Attia") == [f"{acceleration:.10g}"]
    values, _ = slider_crank("a4_S1")
    keys = ("S4", "F1i", "F1j", "T1i", "T1j", "F2i", "F3i", "F3j", "F3k", "F4i", "F4j", "F4k")
    for row, key in zip((r for r in rows() if r.outputs), keys, strict=True):
        assert row.numbers == [f"{values[key]:.6g}"], row.place
    values, _ = slider_crank("planar_ideal")
    assert numbers("(69a)-(69q)", "Rahman") == [f"{values[k]:.6g}" for k in ("F3i", "F3j", "F4k")]
    _, poles = slider_crank("a4_only")
    assert numbers("section 3.2", "Rahman") == [f"{-100 / 12:.6g}", *(f"{x:.6f}" for x in poles)]
    turn = golden.KINEMATICS[golden.DEGREES.index(60)]
    assert numbers("(4.17)-(4.45)", "thesis") == [f"{x:.6g}" for x in turn[2:]]
    c, s = math.cos(math.radians(turn[1])), math.sin(math.radians(turn[1]))
    centre = [0.0254 * (11 + 6 * c), 0.0254 * 6 * s]  # half the output link of 12 in from its ground point
    assert numbers("(4.46)-(4.51)", "thesis") == [f"{x:.6g}" for x in centre]
    torque = golden.TORQUE[golden.DEGREES.index(0)] * 4.4482216152605 * 0.3048
    assert numbers("(4.16) solved", "thesis") == [f"{torque:.6g}"]
    frequencies = golden.FREQUENCIES["held", 60][:3]
    assert [float(x) for x in numbers("Chapter IX", "thesis")] == pytest.approx(frequencies, abs=5e-4)
    # 1e-4 ft in the print
    for place, words in (("Table III", (5607.360, 1607.880)), ("Table IV", (7156.710, 9795.920))):
        shown = [float(x) for x in numbers(place, "thesis")]
        assert shown == pytest.approx([x * 1e-4 for x in words], abs=5e-7)
    of = assembled(np.radians(60))
    shape = np.linalg.solve(of["elastic_stiffness"] + of["elastic_geometric_stiffness"], of["elastic_load"])
    unknowns = [k for k in range(1, 21) if k not in (*BOUNDARY, HELD)]
    nodes = [f"{shape[unknowns.index(k)]:.6g}" for k in (4, 7)]
    assert numbers("Table V", "thesis") == nodes
