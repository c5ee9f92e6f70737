"""``symgen bench``: speed beside error, every integrator over its tolerances or steps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    app,
    changes,
    console,
    print_json,
    progress_bar,
)


@app.command()
def bench(
    scene: SceneArgument,
    methods: Annotated[
        str | None, typer.Option(metavar="NAME[,NAME...]", help="Integrators; all when absent.")
    ] = None,
    precisions: Annotated[
        str, typer.Option(metavar="NAME[,NAME...]", help="float32, float64, longdouble, float128.")
    ] = "float64",
    t_end: Annotated[
        float | None,
        typer.Option(help="Horizon [s]; the scene's own when absent. Shorten it in chaos."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Recorded times, at which errors are taken.")] = 21,
    repeats: Annotated[int, typer.Option(help="How often each setting is timed.")] = 5,
    longest: Annotated[
        float, typer.Option(help="A sweep of settings ends with the first run that takes longer [s].")
    ] = 0.5,
    peers: Annotated[
        bool, typer.Option("--peers", help="Other programs too: of open chains of rods in the plane.")
    ] = False,
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Save the numbers: .json.")] = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Measure error, time and order of every integrator.

    The errors are those against a tight reference.
    """
    import json

    from symgen.atomic import writable, write_text
    from symgen.report.plots import DRAWN_AS
    from symgen.study.work_precision import work_precision
    from symgen.study.work_report import draw, print_work_precision

    for file, endings, what in ((out, (".json",), "numbers"), (plot, DRAWN_AS, "plot")):
        if file:
            writable(file, endings, what)
    with progress_bar(f"bench of {Path(scene).stem}", as_json) as progress:
        found = work_precision(
            scene,
            set=changes(set_),
            methods=methods.split(",") if methods else None,
            precisions=precisions.split(","),
            t_end=t_end,
            samples=samples,
            repeats=repeats,
            longest=longest,
            backend=backend,
            peers=peers,
            progress=progress,
        )
    if out:
        write_text(out, json.dumps(found.summary(), indent=1, allow_nan=False) + "\n")
    if plot:
        draw(found, plot)
    if as_json:
        print_json(found.summary())
    else:
        print_work_precision(found, console())
