"""``symgen report``, ``animate``, ``live`` and ``draw``: pages and drawings of a scene."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, until, wrote

if TYPE_CHECKING:
    from symgen.scene.loading import SceneText


@command("symgen report peaucellier --out page.html")
def report(
    scene: o.Inspected,
    out: Annotated[
        Path | None, typer.Option(help="Output file: .html; default: SCENE.html in this folder.")
    ] = None,
    speed: Annotated[
        bool,
        typer.Option("--speed/--no-speed", help="Measure speed against error (some seconds)."),
    ] = True,
    set_: o.Set = None,
) -> None:
    """Write an HTML page on a scene, a user-defined system, or a building block.

    The page contains the mechanism, its derivation, its kernels and a run with its errors. It works offline.
    """
    from symgen.atomic import writable, write_text
    from symgen.errors import ModelError
    from symgen.inspection.page import block_page, scene_page, system_page
    from symgen.models import BLOCKS
    from symgen.pipeline.user_system import is_user_file, name_of
    from symgen.report.page.page import render
    from symgen.scene.loading import override, read_scene

    text = None if is_user_file(scene) or scene in BLOCKS else override(read_scene(scene), changes(set_))
    if text is None and set_:
        raise ModelError(f"{scene} is no scene: it has no values to set")
    name = text.name if text else scene if scene in BLOCKS else name_of(Path(scene))
    file = out or Path(f"{name}.html")
    writable(file, (".html",), "page")
    with _status(f"report of {name}") as status:
        page = (
            scene_page(text, speed=speed, progress=status)
            if text
            else block_page(scene, progress=status)
            if scene in BLOCKS
            else system_page(Path(scene), progress=status)
        )
    write_text(file, render(page))
    wrote(file)


@command("symgen animate crank_rocker --out crank_rocker.gif")
def animate(
    scene: o.Scene,
    out: Annotated[
        Path | None,
        typer.Option(help="Output file: .html, .gif or .mp4; default: SCENE_moving.html in this folder."),
    ] = None,
    t_end: o.TEnd = None,
    samples: o.Samples = None,
    mode: Annotated[
        int | None, typer.Option(metavar="N", help="Show this mode of vibration (from 1), not the motion.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE", help="Crank angle of modes of elastic links: 60 or '1 rad'; default: start."
        ),
    ] = None,
    set_: o.Set = None,
) -> None:
    """Write an animation of the mechanism as an HTML page, a GIF or an MP4.

    The page has controls for playback and plots of the scene's outputs; it works offline.
    """
    from symgen.errors import ModelError
    from symgen.inspection.film import FRAMES, film_of, film_of_mode
    from symgen.inspection.values import of_crank
    from symgen.report.page.movie import film_file, save

    text, name, file = _scene(scene, set_, out, "_moving.html")
    film_file(file)
    frames = FRAMES if samples is None else samples
    if mode is None and at is not None:
        raise ModelError("--at selects the pose of a mode: give --mode N")
    if mode is not None and t_end is not None:
        raise ModelError("give --mode or --t-end, not both")
    with _status(f"animation of {name}") as status:
        options = {} if t_end is None else {"t_end": t_end}
        angle = None if at is None else of_crank(None, [at], "--at")[0][0]
        if mode is None:
            film = until(t_end, lambda set: film_of(_set(text, set), frames, **options), {})
        else:
            film = film_of_mode(text, mode, angle, frames)
        status("writing")
        save(film, file, status)
    wrote(file)


@command("symgen live crank_rocker --vary 'links.coupler.length=32 cm:45 cm'")
def live(
    scene: o.Scene,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=LOW:HIGH",
            help="A slider for a parameter or key, with its range; default: all tunable parameters, or the "
            "lengths of links. May be repeated.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Output file: .html; default: SCENE_live.html in this folder.")
    ] = None,
    samples: o.Samples = None,
    set_: o.Set = None,
) -> None:
    """Write an HTML page that recomputes the motion when a slider moves.

    The page holds the scene's own kernels, compiled to WebAssembly, and works offline. The extra "live"
    of symgen installs the compiler, Zig.
    """
    from symgen.atomic import writable, write_text
    from symgen.errors import ModelError
    from symgen.inspection.film import FRAMES
    from symgen.inspection.live import live_of
    from symgen.report.page.live import live as page_of
    from symgen.study.sweeps import of_options

    text, name, file = _scene(scene, set_, out, "_live.html")
    writable(file, (".html",), "page")
    if isinstance(text, str):
        raise ModelError(f"{scene} is a user-defined system: pages that compute are of scenes")
    with _status(f"live page of {name}") as status:
        page = live_of(text, of_options(vary or ()), FRAMES if samples is None else samples)
        status("writing")
    write_text(file, page_of(page))
    wrote(file)


@command("symgen draw crank_rocker --at 0,60,120 --of B --out poses.dxf --unit mm")
def draw(
    scene: o.Scene,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VALUE,...",
            help='Values of the input at which poses are drawn, "0,60" (bare: degrees, or a loop\'s unit of '
            'length), "0:90:4" (from, to, count), or of the time, "0.3 s"; default: the beginning.',
        ),
    ] = None,
    of: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...",
            callback=o.separated,
            help="Points, or joints of a loop, whose paths are drawn; default: all that move.",
        ),
    ] = None,
    no_paths: Annotated[bool, typer.Option("--no-paths", help="Draw no paths.")] = False,
    unit: Annotated[
        str | None,
        typer.Option(
            help="Unit of length of DXF and of the scale bar; default: that of the scene's \\[units], else m."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Output file: .svg or .dxf; default: SCENE.svg in this folder.")
    ] = None,
    t_end: o.TEnd = None,
    samples: o.Samples = None,
    set_: o.Set = None,
) -> None:
    """Draw the mechanism in poses, with the paths of its points, as SVG or DXF.

    DXF has true coordinates and a layer each for links, joints, ground and paths. The extra "dxf" of symgen
    installs ezdxf, which writes it.
    """
    from symgen.atomic import writable
    from symgen.errors import ModelError
    from symgen.inspection.film import FRAMES, poses_of, sheet_of
    from symgen.report.page.sheet import DRAWN_AS

    if of and no_paths:
        raise ModelError("give --of or --no-paths, not both")
    text, name, file = _scene(scene, set_, out, ".svg")
    writable(file, DRAWN_AS, "drawing")
    with _status(f"drawing of {name}"):
        options: dict[str, Any] = {} if t_end is None else {"t_end": t_end}
        poses = poses_of(at, "--at") if at else None
        options["samples"] = FRAMES if samples is None else samples
        options |= {"of": () if no_paths else of or None, "unit": unit}
        until(t_end, lambda set: sheet_of(_set(text, set), poses, **options), {}).save(file)
    wrote(file)


def _scene(
    scene: str, set_: list[str] | None, out: Path | None, ending: str
) -> tuple[SceneText | str, str, Path]:
    """Return a scene with its changes or a user's file, its name, and the file to write."""
    from symgen.errors import ModelError
    from symgen.pipeline.user_system import is_user_file, name_of
    from symgen.scene.loading import override, read_scene

    if is_user_file(scene):
        if set_:
            raise ModelError(f"{scene} is no scene: pictures of it have no values to set")
        name = name_of(Path(scene))
        return scene, name, out or Path(f"{name}{ending}")
    text = override(read_scene(scene), changes(set_))
    return text, text.name, out or Path(f"{text.name}{ending}")


def _set(text: SceneText | str, settings: dict[str, Any]) -> SceneText | str:
    """Return a scene with further changes; a user's file, which has no values to set, as it is."""
    from symgen.scene.loading import override

    return text if isinstance(text, str) else override(text, settings)


@contextmanager
def _status(title: str) -> Iterator[Callable[[str], None]]:
    """Show the current step on a terminal; yield a callback that receives it."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console

    with Console(stderr=True).status(title) as status:
        yield lambda stage: status.update(f"{title}: {stage}")
