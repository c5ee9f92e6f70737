"""``symgen export``: a scene as C code without dependency on Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, wrote


@command("symgen export four_bar --out four_bar_c")
def export(
    scene: o.Source,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Destination: an empty or new folder.")],
    method: Annotated[str, typer.Option(metavar="NAME", help="Of runs: dop853 or taylor.")] = "dop853",
    name: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Prefix of functions and files; default: the scene's name."),
    ] = None,
    set_: o.Set = None,
) -> None:
    """Write a scene, or the kernels of a user-defined system, as C for use in other programs.

    The folder contains the kernels and a check of their results, for a scene also the core that runs them
    and an example.
    """
    from symgen.export import export_c

    for file in export_c(scene, out, set=changes(set_), method=method, name=name):
        wrote(out / file)
