"""``symgen study``: parameter studies; ``symgen synthesise``: four-bars with prescribed properties."""

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


@command("symgen synthesise swing.toml --out four_bars")
def synthesise(
    task: Annotated[
        Path, typer.Argument(help="TOML file whose table \\[synthesis] has the prescribed properties.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for one scene for each linkage, four_bar_1.toml and so on.")
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Find all planar four-bars with prescribed properties.

    Limit positions and transmission angles, a function of the crank's angle, poses of the coupler, or points
    of its path. Each linkage is run, and faults of its motion are listed.
    """
    from symgen.study.folder import writable_folder, write
    from symgen.synthesis.synthesise import synthesise as found

    if out:
        writable_folder(out)
    result = found(task)
    if out:
        write(out, {f"four_bar_{i}.toml": d.linkage.toml().encode() for i, d in enumerate(result.designs, 1)})
    if as_json:
        print_json(result.summary())
        return
    from symgen.report.synthesis import print_synthesis

    print_synthesis(result, console())
    if out:
        print(f"{len(result.designs)} scenes in {out}")
