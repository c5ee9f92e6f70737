"""Error reports of kernels for the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from symgen.report.tables import print_notes, table
from symgen.study.accuracy.accuracy import Accuracy
from symgen.study.accuracy.cancelling import Cancelling
from symgen.study.accuracy.kernel_errors import OutputAccuracy, Worst

_KINDS = {"run": "along the run", "closed": "at random on the constraints", "open": "at random off them"}


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
    exact = ", ".join(name_of(o) for o, worst in rows if not worst)
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
        name_of(o),
        short(worst.ulps),
        f"{worst.relative:.1e}",
        f"{o.of_largest:.1e}",
        short(worst.condition),
        short(o.beyond),
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


def short(x: float) -> str:
    """Return a ratio as text."""
    return f"{x:.1f}" if x < 100 else f"{x:.1e}"


def name_of(o: OutputAccuracy) -> str:
    """Return the name of an output, after its kernel where that differs."""
    return o.output if o.kernel in (o.output, "outputs") else f"{o.kernel}: {o.output}"
