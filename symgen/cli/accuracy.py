"""``symgen accuracy``: the error of compiled kernels against 40 digits, and whose fault it is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli.common import JsonOption, SetOption, app, changes, console, print_json, progress_bar


@app.command()
def accuracy(
    scene: Annotated[
        str | None,
        typer.Argument(help="A scene, a Python file that returns a System, or a building block: rod, ..."),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="All shipped scenes and building blocks, a line each.")
    ] = False,
    states: Annotated[
        int, typer.Option(help="States of each kind: along the run, random on and off the constraints.")
    ] = 20,
    seed: Annotated[int, typer.Option(help="Seed of the random states.")] = 0,
    run: Annotated[
        bool, typer.Option("--run/--no-run", help="Look along a run of the scene, not at its start alone.")
    ] = True,
    precision: Annotated[str, typer.Option(help="Number type of the kernels.")] = "float64",
    top: Annotated[int, typer.Option(help="How many sums that cancel to list.")] = 10,
    set_: SetOption = None,
    out: Annotated[
        Path | None, typer.Option(help="Save the report: .json, or .md for its line of the table.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Compare every kernel with its matrices at 40 digits.

    Condition and cancellation are shown beside the error.
    """
    from symgen.atomic import writable
    from symgen.errors import ModelError
    from symgen.study import accuracy as study
    from symgen.study import accuracy_page as page

    if (scene is None) != every:
        raise ModelError("expected one scene, or --all")
    if every and set_:
        raise ModelError("--set does not go with --all: it is for one scene")
    if out:
        writable(out, page.SAVED_AS, "report")
    names = study.all_names() if scene is None else [scene]
    found = []
    for name in names:
        with progress_bar(f"accuracy of {name}", as_json) as progress:
            found.append(
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
        page.save(found, out)
    if as_json:
        print_json(found[0].summary() if scene else {"scenes": [a.summary() for a in found]})
    elif scene:
        page.print_accuracy(found[0], console())
    else:
        page.print_summaries(found, console())
