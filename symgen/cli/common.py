"""Shared parts of the commands: the application, its options, and the parsing of arguments."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.errors import ModelError, SceneError, SimulationError

if TYPE_CHECKING:
    from rich.console import Console

    from symgen.runtime.model.rods import RodModel
    from symgen.runtime.result.motion import Motion
    from symgen.runtime.result.result import Result

app = typer.Typer(
    help="Derive the equations of motion of a mechanism, print them as C, and run them compiled.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
SceneArgument = Annotated[
    str, typer.Argument(help="A name listed by 'symgen scenes', or the path of a TOML file.")
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
    str, typer.Option(help="Number type of runs of rods and batches: float32, float64, longdouble, float128.")
]
DigitsOption = Annotated[int | None, typer.Option(help="Digits of the backend mpmath (40).")]
ContractionOption = Annotated[
    str, typer.Option(help="off, or fast: fused multiply-add where the processor has it.")
]
VectorOption = Annotated[
    str, typer.Option(help="none (portable), or native (instruction set of this processor).")
]
MaxWallOption = Annotated[
    float | None,
    typer.Option(help="Wall-time limit [s]; the run ends with the samples recorded so far. Default: none."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
DifferenceOption = Annotated[
    str, typer.Option("--format", help="Format of matrix entries: text, or latex (amsmath).")
]


def _result_file(file: Path | None) -> Path | None:
    """Check that a result can be written to the file before a command runs; raise ResultError if not."""
    if file:
        from symgen.atomic import writable
        from symgen.runtime.result.result import SAVED_AS

        writable(file, SAVED_AS, "result")
    return file


def _plot_file(file: Path | None) -> Path | None:
    """Check that a plot can be written to the file before a command runs."""
    if file:
        from symgen.atomic import writable
        from symgen.report.page.plots import DRAWN_AS

        writable(file, DRAWN_AS, "plot")
    return file


OutOption = Annotated[
    Path | None, typer.Option(help="Save the result: .nc, .npz or .csv.", callback=_result_file)
]
PlotOption = Annotated[
    Path | None, typer.Option(help="Save a plot: .png, .svg or .pdf.", callback=_plot_file)
]


#: Maximum number of digits of an integer value of --set; longer ones remain text.
_DIGITS = 15


def write_files(result: Result, out: Path | None, plot: Path | None) -> None:
    """Save a result and its plot if files are given."""
    if out:
        result.save(out)
    if plot:
        result.plot(file=plot)


def progress_bar(title: str, as_json: bool) -> AbstractContextManager[Callable[[float], None] | None]:
    """Return a progress bar on a terminal, a null context elsewhere."""
    if as_json or not sys.stderr.isatty():
        return nullcontext()
    from symgen.report.progress import bar

    return bar(title)


def console() -> Console:
    """Return the console for tables."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 110, highlight=False)


def changes(options: list[str] | None) -> dict[str, Any]:
    """Return the values of --set by key: integers, booleans, TOML lists and tables, else text."""
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
    if text.startswith(("[", "{")):
        with suppress(tomllib.TOMLDecodeError):
            return tomllib.loads(f"value = {text}")["value"]
    return {"true": True, "false": False}.get(text, int(text) if _is_whole(text) else text)


def _is_whole(text: str) -> bool:
    digits = text.removeprefix("-")
    return digits.isascii() and digits.isdecimal() and len(digits) <= _DIGITS


def linkage(scene: str, options: list[str] | None, backend: str, command: str) -> RodModel:
    """Build a linkage of points and links for an analysis of rigid links; refuse loops of joints."""
    from symgen.pipeline.build import build_scene as build_model
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.model.rods import RodModel

    model = build_model(scene, set=changes(options), backend=backend)
    if isinstance(model, ElasticModel):
        return model.rigid
    if not isinstance(model, RodModel):
        raise ModelError(
            f"'symgen {command}' applies to linkages of points and links; {scene} is a link-joint table\n"
            f"  Use 'symgen run {scene}'."
        )
    return model


@contextmanager
def kept_of_a_failure(out: Path | None) -> Iterator[None]:
    """Save the samples recorded before a failure to the output file, if one is given."""
    try:
        yield
    except SimulationError as error:
        if out and error.partial is not None:
            error.partial.save(out)
            print(f"symgen: the samples recorded before the failure are in {out}", file=sys.stderr)
        raise


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
