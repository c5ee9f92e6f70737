"""What the commands share: the application, its options, and how arguments are read."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.errors import ModelError, SceneError

if TYPE_CHECKING:
    from rich.console import Console

    from symgen.runtime.model import Model
    from symgen.runtime.motion import Motion
    from symgen.runtime.result import Result

app = typer.Typer(
    help="Derive the equations of a mechanism, print them as C, and run them compiled.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
SceneArgument = Annotated[
    str, typer.Argument(help="A name that 'symgen scenes' lists, or the path of a TOML file.")
]
SourceArgument = Annotated[
    str, typer.Argument(help="A scene (name or TOML file), or a Python file that returns a System.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help='A parameter or dotted key: rho="2 kg/m", links.OA.mass="1 kg".'
    ),
]
BackendOption = Annotated[str, typer.Option(help="auto, c, numpy or mpmath.")]
PrecisionOption = Annotated[
    str, typer.Option(help="Type of runs of rods and of batches: float32, float64, longdouble or float128.")
]
DigitsOption = Annotated[int | None, typer.Option(help="Digits of the backend mpmath (40).")]
ContractionOption = Annotated[
    str, typer.Option(help="off, or fast: products and sums in one rounding where the processor has that.")
]
VectorOption = Annotated[
    str, typer.Option(help="none (runs on any processor of this kind), or native: for this one.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
DifferenceOption = Annotated[
    str, typer.Option("--format", help="text, or latex (amsmath): how entries before and after are written.")
]
OutOption = Annotated[Path | None, typer.Option(help="Save the result: .nc or .npz.")]
PlotOption = Annotated[Path | None, typer.Option(help="Save a plot: .png, .svg or .pdf.")]


#: The most digits of a whole number behind --set; more are left as text.
_DIGITS = 15


def check_files(out: Path | None, plot: Path | None) -> None:
    """Raise ResultError where a result or a plot could not be written, before anything is computed."""
    from symgen.atomic import writable
    from symgen.report.plots import DRAWN_AS
    from symgen.runtime.result import SAVED_AS

    for file, endings, what in ((out, SAVED_AS, "result"), (plot, DRAWN_AS, "plot")):
        if file:
            writable(file, endings, what)


def write_files(result: Result, out: Path | None, plot: Path | None) -> None:
    """Save a result and a plot of it where they are asked for."""
    if out:
        result.save(out)
    if plot:
        result.plot(file=plot)


def progress_bar(title: str, as_json: bool) -> AbstractContextManager[Callable[[float], None] | None]:
    """Show a bar on a terminal, and nothing elsewhere."""
    if as_json or not sys.stderr.isatty():
        return nullcontext()
    from symgen.report.progress import bar

    return bar(title)


def console() -> Console:
    """Return what tables are printed on."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 110, highlight=False)


def changes(options: list[str] | None) -> dict[str, Any]:
    """Return what --set asks for, by key: whole numbers, true, false, lists as in TOML; all else as text."""
    result: dict[str, Any] = {}
    for change in options or []:
        name, equals, value = change.partition("=")
        if not equals or not name.strip():
            raise SceneError(f"expected --set KEY=VALUE, got {change!r}")
        bare = value.strip()
        quoted = len(bare) > 1 and bare[0] == bare[-1] and bare[0] in "\"'"
        result[name.strip()] = bare[1:-1] if quoted else _plain(bare)
    return result


def _plain(text: str) -> Any:
    if text.startswith("["):
        with suppress(tomllib.TOMLDecodeError):
            return tomllib.loads(f"value = {text}")["value"]
    return {"true": True, "false": False}.get(text, int(text) if _is_whole(text) else text)


def _is_whole(text: str) -> bool:
    digits = text.removeprefix("-")
    return digits.isascii() and digits.isdecimal() and len(digits) <= _DIGITS


def linkage(scene: str, options: list[str] | None, backend: str, command: str) -> Model:
    """Build a linkage of points and links, which some analyses are for; elastic links taken as rigid."""
    from symgen.pipeline import build_scene as build_model
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.model import Model

    model = build_model(scene, set=changes(options), backend=backend)
    if isinstance(model, ElasticModel):
        return model.rigid
    if not isinstance(model, Model):
        raise ModelError(
            f"'symgen {command}' is for linkages of points and links, and {scene} is a link-joint table\n"
            f"  'symgen run {scene}' evaluates it."
        )
    return model


def show_motion(motion: Motion, as_json: bool) -> None:
    """Print a kinematic analysis: as one JSON object, or as tables."""
    if as_json:
        print_json(motion.summary())
        return
    from symgen.report.analyses import print_motion

    print_motion(motion, console())


def print_json(data: dict[str, Any]) -> None:
    """Print one JSON object."""
    import json

    print(json.dumps(data, allow_nan=False))
