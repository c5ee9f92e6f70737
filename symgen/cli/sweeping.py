"""``symgen sweep``: steady states of elastic linkages over the speed of the crank."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    JsonOption,
    OutOption,
    PlotOption,
    SceneArgument,
    SetOption,
    app,
    changes,
    check_files,
    console,
    print_json,
    progress_bar,
    write_files,
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
    out: OutOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Find steady states of elastic links at many crank speeds.

    Peaks, critical speeds and stability are shown.
    """
    from symgen.errors import ModelError
    from symgen.pipeline import build_scene as build_model
    from symgen.runs import crank_speeds
    from symgen.runtime.elastic_model import ElasticModel

    check_files(out, plot)
    asked = crank_speeds(speeds)
    model = build_model(scene, set=changes(set_), backend=backend)
    if not isinstance(model, ElasticModel):
        raise ModelError(f"{model.name} has no elastic links: 'symgen sweep' is for those")
    with progress_bar(model.description.title, as_json) as progress:
        found = model.sweep(asked, rtol=rtol, progress=progress)
    write_files(found, out, plot)
    if as_json:
        print_json(found.summary())
    else:
        from symgen.report.elastic import print_sweep

        print_sweep(found, console())
