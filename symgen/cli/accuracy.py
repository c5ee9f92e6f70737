"""``symgen accuracy``: errors of compiled kernels against 40 digits, and their causes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, console, print_json, progress_bar


@command("symgen accuracy peaucellier")
def accuracy(
    scene: Annotated[
        str | None,
        typer.Argument(help="A scene, a Python file with system(), or a building block: rod, ..."),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="All shipped scenes and building blocks, one line each.")
    ] = False,
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
    out: Annotated[
        Path | None, typer.Option(help="Save the report: .json, or .md for its row of the table.")
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Compare every kernel with its matrices at 40 digits.

    The report lists errors, condition numbers and cancellation.
    """
    from symgen.atomic import writable
    from symgen.errors import ModelError
    from symgen.study.accuracy import accuracy as study
    from symgen.study.accuracy import page

    if (scene is None) != every:
        raise ModelError("expected one scene, or --all")
    if every and set_:
        raise ModelError("--set applies to one scene and cannot be combined with --all")
    if out:
        writable(out, page.SAVED_AS, "report")
    names = study.all_names() if scene is None else [scene]
    results = []
    for name in names:
        with progress_bar(f"accuracy of {name}", as_json) as progress:
            results.append(
                study.accuracy(
                    name,
                    set=changes(set_),
                    states=states,
                    seed=seed,
                    run=run,
                    precision=precision,
                    top=top,
                    progress=progress,
                )
            )
    if out:
        page.save(results, out)
    if as_json:
        print_json(results[0].summary() if scene else {"scenes": [a.summary() for a in results]})
    elif scene:
        page.print_accuracy(results[0], console())
    else:
        page.print_summaries(results, console())
