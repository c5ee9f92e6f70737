"""Errors of the kernels of all shipped scenes and building blocks: the table of docs/accuracy.

``python benchmarks/kernel_accuracy.py`` prints it in Markdown; names select scenes or blocks.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from symgen.models import BLOCKS
from symgen.scene.loading import shipped_scenes
from symgen.study.accuracy.accuracy import Accuracy, accuracy
from symgen.study.accuracy.page import name_of, short

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


def names() -> list[str]:
    """Return the names of all building blocks and shipped scenes."""
    return [*BLOCKS, *shipped_scenes()]


def row(found: Accuracy) -> tuple[str, ...]:
    """Return the row of a scene: its solution, and its largest errors relative to their conditions."""
    by_largest = max(found.outputs, key=lambda o: o.beyond_largest)
    solved = next((o for o in found.outputs if o.output == "accelerations"), None)
    verdicts = {o.verdict for o in found.outputs}
    return (
        found.scene,
        str(len(found.outputs)),
        f"{solved.of_largest:.1e}" if solved else "",
        short(found.condition[0]) if found.condition else "",
        short(found.worst.beyond),
        name_of(found.worst),
        short(by_largest.beyond_largest),
        name_of(by_largest),
        next((v for v in ("code", "small entry", "problem") if v in verdicts), ""),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="scenes or building blocks; default: all")
    chosen = parser.parse_args(arguments).names or names()
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for name in chosen:
        print(f"| {' | '.join(row(accuracy(name)))} |", flush=True)


if __name__ == "__main__":
    main()
