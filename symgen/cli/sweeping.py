"""``symgen sweep``: steady states of elastic linkages over the crank speed."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    JsonOption,
    MaxWallOption,
    OutOption,
    PlotOption,
    SceneArgument,
    SetOption,
    app,
    changes,
    console,
    kept_of_a_failure,
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
    rtol: Annotated[float, typer.Option(help="Error relative to the peak stress.")] = 1e-4,
    max_wall: MaxWallOption = None,
    set_: SetOption = None,
    out: OutOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Find steady states of elastic links at many crank speeds.

    Peak values, critical speeds and stability are printed.
    """
    from symgen.errors import ModelError
    from symgen.inspection.runs import crank_speeds
    from symgen.pipeline.build import build_scene as build_model
    from symgen.runtime.elastic.model import ElasticModel

    asked = crank_speeds(speeds)
    model = build_model(scene, set=changes(set_), backend=backend)
    if not isinstance(model, ElasticModel):
        raise ModelError(f"{model.name} has no elastic links: 'symgen sweep' applies to elastic links only")
    with progress_bar(model.description.title, as_json) as progress, kept_of_a_failure(out):
        found = model.sweep(asked, rtol=rtol, max_wall=max_wall, progress=progress)
    write_files(found, out, plot)
    if as_json:
        print_json(found.summary())
    else:
        from symgen.report.elastic import print_sweep

        print_sweep(found, console())
