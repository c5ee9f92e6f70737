"""``symgen sweep``: steady states of elastic linkages over the speed of the crank."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    JsonOption,
    SceneArgument,
    SetOption,
    app,
    changes,
    console,
    print_json,
)


@app.command()
def sweep(
    scene: SceneArgument,
    speeds: Annotated[
        str,
        typer.Option(
            metavar="FROM:TO:COUNT", help='Crank speeds in rpm: "20:400:39", or a list such as "60,95,120".'
        ),
    ],
    rtol: Annotated[float, typer.Option(help="Error over the peak stress.")] = 1e-4,
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Save the result: .nc or .npz.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Save a plot: .png, .svg or .pdf.")] = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Find the steady state of elastic links at many crank speeds: peaks, critical speeds, stability."""
    from symgen.atomic import writable
    from symgen.errors import ModelError
    from symgen.pipeline import build as build_model
    from symgen.report.plots import DRAWN_AS
    from symgen.runs import crank_speeds
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.result import SAVED_AS

    for file, endings, what in ((out, SAVED_AS, "result"), (plot, DRAWN_AS, "plot")):
        if file:
            writable(file, endings, what)
    asked = crank_speeds(speeds)
    model = build_model(scene, set=changes(set_), backend=backend)
    if not isinstance(model, ElasticModel):
        raise ModelError(f"{model.name} has no elastic links: 'symgen sweep' is for those")
    from symgen.report.progress import bar

    quiet = as_json or not sys.stderr.isatty()
    with nullcontext() if quiet else bar(model.description.title) as progress:
        found = model.sweep(asked, rtol=rtol, progress=progress)
    if out:
        found.save(out)
    if plot:
        found.plot(file=plot)
    if as_json:
        print_json(found.summary())
    else:
        from symgen.report.elastic import print_sweep

        print_sweep(found, console())
