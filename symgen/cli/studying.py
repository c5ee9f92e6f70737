"""``symgen study``: the parameter studies that a scene defines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, console, print_json, progress_bar


@command("symgen study slider_crank results")
def study(
    scene: o.Scene,
    folder: Annotated[Path, typer.Argument(help="Folder for plots and tables.")],
    set_: o.Set = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Run the parameter studies of a driven loop.

    The scene defines the studies. Plots, tables and their data are written to the folder.
    """
    from symgen.study import run_studies

    with progress_bar(f"studies of {Path(scene).stem}", as_json) as progress:
        report = run_studies(scene, folder, set=changes(set_), backend=backend, progress=progress)
    if as_json:
        print_json(report.summary())
    else:
        from symgen.study.terminal import print_report

        print_report(report, console())
