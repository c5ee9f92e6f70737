"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.text import Text

from symgen.runtime.result.result import Result

#: Blanks between columns.
_GAP = 2
#: Line below the headings.
_RULE = "\N{BOX DRAWINGS LIGHT HORIZONTAL}"
#: A column of text is not wrapped to fewer characters.
_TEXT = 24


def table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[Any]],
    texts: Collection[int] = (0,),
    keys: int = 1,
    apart: int = 0,
) -> Group:
    """Return a table of plain text; columns of numbers are right-aligned, those numbered in ``texts`` left.

    A table that is wider than the terminal becomes several, one below the other. Each repeats the first
    ``keys`` columns; the last ``apart`` columns are then one of them. Text and headings are wrapped between
    words; numbers are never broken. The title is a line of its own: a title of the table would be broken at
    the width of its columns.
    """
    cells = [tuple(map(cell_text, row)) for row in rows]
    fitted = _Fitted(tuple(columns), cells, frozenset(texts), keys, apart)
    return Group(Text(title, style="table.title"), fitted) if title else Group(fitted)


class _Fitted:
    """A table as one or several blocks of columns, whichever fits the width of the terminal."""

    def __init__(
        self,
        columns: tuple[str, ...],
        rows: Sequence[tuple[str, ...]],
        texts: frozenset[int],
        keys: int,
        apart: int,
    ) -> None:
        self.columns, self.rows, self._texts, self._keys, self._apart = columns, rows, texts, keys, apart
        by_column = [[row[i] for row in rows] for i in range(len(columns))]
        self._widths = [max(map(cell_len, (head, *of))) for head, of in zip(columns, by_column, strict=True)]
        self._least = [self._narrowest(i, of) for i, of in enumerate(by_column)]

    def _narrowest(self, i: int, cells: Sequence[str]) -> int:
        """Return the least width of a column: its longest number or word, and some text."""
        text = i in self._texts
        words = [word for line in (self.columns[i], *(cells if text else ())) for word in line.split()]
        longest = max(map(cell_len, (*words, *(() if text else cells))), default=0)
        return max(longest, min(self._widths[i], _TEXT)) if text else longest

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for block in self._blocks(options.max_width):
            widths = dict(zip(block, self._shares(block, options.max_width), strict=True))
            if any(self.columns):
                yield Text("\n".join(self._lines(self.columns, widths, console, bottom=True)), "bold")
                yield Text(("-" if options.ascii_only else _RULE) * self._total(block, widths))
            if self.rows:
                yield Text("\n".join(line for row in self.rows for line in self._lines(row, widths, console)))

    def _lines(
        self, row: Sequence[str], widths: Mapping[int, int], console: Console, bottom: bool = False
    ) -> Iterator[str]:
        """Yield the lines of a row, its cells wrapped to the ``widths`` of their columns.

        ``bottom`` aligns cells of fewer lines with the last line.
        """
        cells = [
            [row[i]]
            if cell_len(row[i]) <= width
            else [line.plain.rstrip() for line in Text(row[i]).wrap(console, width, overflow="fold")]
            for i, width in widths.items()
        ]
        most = max(map(len, cells))
        blank = ([""] * (most - len(cell)) for cell in cells)
        full = ([*no, *cell] if bottom else [*cell, *no] for no, cell in zip(blank, cells, strict=True))
        for parts in zip(*full, strict=True):
            line = []
            for (i, width), part in zip(widths.items(), parts, strict=True):
                blanks = " " * (width - cell_len(part))
                line.append(part + blanks if i in self._texts else blanks + part)
            yield (" " * _GAP).join(line).rstrip()

    def _total(self, block: Sequence[int], widths: Sequence[int] | Mapping[int, int]) -> int:
        return sum(widths[i] for i in block) + _GAP * (len(block) - 1)

    def _shares(self, block: Sequence[int], width: int) -> Iterator[int]:
        """Yield widths of columns: whole if they fit, else headings are wrapped, and text has the rest.

        On a terminal that is too narrow for the longest words, columns of text have half their width.
        """
        whole = self._total(block, self._widths) <= width
        room = width - self._total(block, self._least)
        for i in block:
            more = min(self._widths[i] - self._least[i], room) if whole or i in self._texts else 0
            more = max(more, -(self._least[i] // 2))
            room -= more
            yield self._least[i] + more

    def _blocks(self, width: int) -> list[list[int]]:
        """Return the columns of the fewest blocks that fit a width, of about as many columns each."""
        keys, count = [*range(self._keys)], len(self.columns)
        if self._apart and self._total(range(count), self._least) > width:
            parts = [range(self._keys, count - self._apart), range(count - self._apart, count)]
        else:
            parts = [range(self._keys, count)]
        return [block for part in parts for block in self._divided(keys, part, width)]

    def _divided(self, keys: list[int], part: range, width: int) -> list[list[int]]:
        blocks: list[list[int]] = []
        for number in range(1, max(len(part), 1) + 1):
            ends = [-(-i * len(part) // number) for i in range(number + 1)]
            blocks = [[*keys, *part[a:b]] for a, b in pairwise(ends)]
            if all(self._total(block, self._least) <= width for block in blocks):
                break
        return blocks


def cell_text(value: Any) -> str:
    """Return a value as the text of a cell: numbers with six digits, without a minus before zero."""
    return f"{value + 0.0:.6g}" if isinstance(value, float) else str(value)


def print_notes(notes: Iterable[str], console: Console) -> None:
    """Print the notes of a result, a line each."""
    for note in notes:
        console.print(f"Note: {note}.")


#: Maximum number of modes listed on the terminal.
MODES = 10
#: How an event passes zero.
_WAYS = {True: "rising", False: "falling", None: "touching"}
#: Maximum number of events listed on the terminal.
_EVENTS = 20


def events_table(result: Result) -> Group:
    """Return a table of the events of a run, truncated if long."""
    rows = [(e.name, f"{e.time:.12g}", _WAYS[e.rising]) for e in result.events[:_EVENTS]]
    more = len(result.events) - _EVENTS
    return table("Events" + (f" (and {more} more)" if more > 0 else ""), ("event", "t [s]", "passing"), rows)


def _type(result: Result) -> tuple[str, ...]:
    """Return the number type of a run; empty for results saved before it was recorded."""
    precision = result.provenance.get("precision")
    return (precision,) if precision else ()


def run_table(result: Result, more: Sequence[tuple[str, str]] = ()) -> Group:
    """Return a table of run statistics: cost and errors, after ``more`` rows."""
    drift, statistics = result.drift.measured, result.statistics
    return table(
        "The run",
        ("", ""),
        (
            *more,
            ("method", result.provenance["method"]),
            ("backend", ", ".join((result.provenance["backend"], *_type(result)))),
            *(  # solvers from elsewhere tell few or none
                (label, text.format(**statistics, ms=1e3 * statistics.get("wall_s", 0)))
                for name, label, text in (
                    ("steps", "steps (rejected)", "{steps} ({rejected})"),
                    ("evaluations", "evaluations", "{evaluations}"),
                    ("wall_s", "wall time", "{ms:.3g} ms"),
                )
                if name in statistics
            ),
            *(
                (label, f"{drift[name]:.2e} {unit}")
                for name, label, unit in (
                    ("constraint", "constraint drift", "m"),
                    ("energy", "energy drift", "J"),
                    ("energy_exchanged", "energy exchanged", "J"),
                )
                if name in drift
            ),
        ),
    )
