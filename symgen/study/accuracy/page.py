"""Error reports of kernels for the terminal and as a Markdown table."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console

from symgen.atomic import write_text
from symgen.report.tables import print_notes, table
from symgen.study.accuracy.accuracy import Accuracy
from symgen.study.accuracy.cancelling import Cancelling
from symgen.study.accuracy.kernel_errors import OutputAccuracy, Worst

#: File name extensions of saved reports.
SAVED_AS = (".json", ".md")
_KINDS = {"run": "along the run", "closed": "at random on the constraints", "open": "at random off them"}
#: Columns of the table of several scenes.
COLUMNS = (
    "scene",
    "outputs",
    "accelerations over largest",
    "condition of equations",
    "beyond condition",
    "in",
    "beyond largest",
    "in",
    "lost by",
)


def print_accuracy(accuracy: Accuracy, console: Console) -> None:
    """Print a report: states, errors of every output, and the sums with the largest cancellation."""
    console.print(head(accuracy))
    rows = [(o, o.worst) for o in accuracy.outputs]
    shown = table(
        "",
        ("output", "ulps", "of entry", "of largest", "condition", "beyond", "entry and state", "lost by"),
        (_row(o, worst) for o, worst in rows if worst),
        texts=(0, 6, 7),
    )
    console.print(shown)
    exact = ", ".join(_name(o) for o, worst in rows if not worst)
    if exact:
        console.print(f"Without any error: {exact}.")
    console.print(_MEANING)
    if accuracy.condition:
        size, where = accuracy.condition
        console.print(f"Condition of the equations of motion, scaled: at most {size:.2g} ({where}).")
    print_cancelling(accuracy.cancelling, console)
    print_notes(accuracy.notes, console)


_MEANING = """\
ulps: the largest error in units in the last place of its entry; of entry, of largest: that error over the
entry, the largest error over the largest entry of the output; condition: sum |x df/dx| / |f| over all inputs;
beyond: the largest error relative to the effect of input rounding, epsilon times condition."""


def head(accuracy: Accuracy) -> str:
    """Return one line with the kernels, states and number types compared."""
    states = ", ".join(f"{n} {_KINDS[kind]}" for kind, n in accuracy.states.items())
    kernels = len(dict.fromkeys(o.kernel for o in accuracy.outputs))
    return (
        f"{accuracy.title}: {len(accuracy.outputs)} outputs of {kernels} kernels in {accuracy.precision} "
        f"against {accuracy.digits} digits, at {sum(accuracy.states.values())} states "
        f"({states}; seed {accuracy.seed})"
    )


def _row(o: OutputAccuracy, worst: Worst) -> Sequence[str]:
    return (
        _name(o),
        _short(worst.ulps),
        f"{worst.relative:.1e}",
        f"{o.of_largest:.1e}",
        _short(worst.condition),
        _short(o.beyond),
        f"{worst.entry}; {worst.state}" if worst.entry else worst.state,
        o.verdict,
    )


def print_cancelling(entries: Sequence[Cancelling], console: Console) -> None:
    """Print the sums with the largest loss of digits."""
    if not entries:
        console.print("No sum cancels.")
        return
    shown = table(
        "Sums that cancel",
        ("of output", "digits", "in output", "needless", "sum"),
        (
            (c.output, *map(_digits, (c.digits, c.in_output, c.needless)), f"{c.name} = {c.expression}")
            for c in entries
        ),
        texts=(0, 4),
    )
    console.print(shown)
    console.print(
        "digits: lost in the sum itself; in output: lost in the output as a result, near its largest error;\n"
        "needless: part of these that the condition does not explain. Sorted by this column."
    )


def _digits(x: float) -> str:
    return f"{max(0.0, x):.1f}"


def _short(x: float) -> str:
    return f"{x:.1f}" if x < 100 else f"{x:.1e}"


def print_summaries(results: Iterable[Accuracy], console: Console) -> None:
    """Print a table with one row per report."""
    console.print(table("Errors of kernels", COLUMNS, map(summary_row, results)))


def markdown(results: Iterable[Accuracy]) -> str:
    """Return the Markdown table of several reports."""
    lines = [f"| {' | '.join(COLUMNS)} |", f"|{'---|' * len(COLUMNS)}"]
    lines += [f"| {' | '.join(summary_row(a))} |" for a in results]
    return "\n".join(lines) + "\n"


def summary_row(accuracy: Accuracy) -> tuple[str, ...]:
    """Return the table row of a scene: its solution, and its largest errors relative to their conditions."""
    by_largest = max(accuracy.outputs, key=lambda o: o.beyond_largest)
    solved = next((o for o in accuracy.outputs if o.output == "accelerations"), None)
    verdicts = {o.verdict for o in accuracy.outputs}
    return (
        accuracy.scene,
        str(len(accuracy.outputs)),
        f"{solved.of_largest:.1e}" if solved else "",
        _short(accuracy.condition[0]) if accuracy.condition else "",
        _short(accuracy.worst.beyond),
        _name(accuracy.worst),
        _short(by_largest.beyond_largest),
        _name(by_largest),
        next((v for v in ("code", "small entry", "problem") if v in verdicts), ""),
    )


def _name(o: OutputAccuracy) -> str:
    return o.output if o.kernel in (o.output, "outputs") else f"{o.kernel}: {o.output}"


def save(results: Sequence[Accuracy], file: Path) -> None:
    """Write reports as JSON or as a Markdown table, depending on the file name extension.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    if file.suffix.lower() == ".md":
        text = markdown(results)
    else:
        data = [a.summary() for a in results]
        text = json.dumps(data[0] if len(data) == 1 else {"scenes": data}, indent=1, allow_nan=False) + "\n"
    write_text(file, text)
