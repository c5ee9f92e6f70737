"""``symgen export``: a scene as C, for programs that know nothing of Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli.common import SceneArgument, SetOption, app, changes


@app.command()
def export(
    scene: SceneArgument,
    c: Annotated[
        Path,
        typer.Option("--c", metavar="FOLDER", help="Write C there: a folder that is empty or not there."),
    ],
    set_: SetOption = None,
) -> None:
    """Write a scene as C, for other programs.

    The folder holds kernels, the core that runs them, an example, and a test of the numbers.
    """
    from symgen.export import export_c

    for name in export_c(scene, c, set=changes(set_)):
        print(c / name)
