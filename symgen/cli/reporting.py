"""``symgen report``: one page on a scene."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from symgen.cli.common import SceneArgument, SetOption, app, changes


@app.command()
def report(
    scene: SceneArgument,
    out: Annotated[
        Path | None, typer.Option(help="Where to write: .html; SCENE.html in this folder when absent.")
    ] = None,
    speed: Annotated[
        bool,
        typer.Option("--speed/--no-speed", help="Measure speed against error, which takes some seconds."),
    ] = True,
    set_: SetOption = None,
) -> None:
    """Write one HTML page on a scene.

    It shows a picture, the derivation, kernels, and a run with its errors, and needs no network.
    """
    from symgen.atomic import writable, write_text
    from symgen.inspection.page import scene_page
    from symgen.report.page import render
    from symgen.scene.loading import override, read_scene

    text = override(read_scene(scene), changes(set_))
    file = out or Path(f"{text.name}.html")
    writable(file, (".html",), "page")
    with _status(f"report of {text.name}") as told:
        page = scene_page(text, speed=speed, told=told)
    write_text(file, render(page))
    print(file)


@contextmanager
def _status(title: str) -> Iterator[Callable[[str], None]]:
    """Show on a terminal what is being done; give a function that takes it."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True).status(title) as status:
        yield lambda what: status.update(f"{title}: {what}")
