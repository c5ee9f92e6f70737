"""``symgen accuracy``: errors of compiled kernels against 40 digits, and their causes."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, progress_bar, show


@command("symgen accuracy peaucellier")
def accuracy(
    scene: Annotated[
        str, typer.Argument(help="A scene, a Python file with system(), or a building block: rod, ...")
    ],
    states: Annotated[
        int, typer.Option(help="States of each kind: along the run, random on and off the constraints.")
    ] = 20,
    seed: Annotated[int, typer.Option(help="Seed of the random states.")] = 0,
    run: Annotated[
        bool, typer.Option("--run/--no-run", help="Sample states along a run, or only at the start.")
    ] = True,
    precision: Annotated[str, typer.Option(help="Number type of the kernels.")] = "float64",
    top: Annotated[int, typer.Option(help="Number of cancelling sums to list.")] = 10,
    set_: o.Set = None,
    out: o.JsonFile = None,
    as_json: o.Json = False,
) -> None:
    """Compare every kernel with its matrices at 40 digits.

    The report lists errors, condition numbers and cancellation.
    """
    from symgen.study.accuracy import accuracy as study
    from symgen.study.accuracy.page import print_accuracy

    with progress_bar(f"accuracy of {scene}", as_json) as progress:
        report = study.accuracy(
            scene,
            set=changes(set_),
            states=states,
            seed=seed,
            run=run,
            precision=precision,
            top=top,
            progress=progress,
        )
    show(report.summary(), as_json, out, lambda console: print_accuracy(report, console))
