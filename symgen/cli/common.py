"""Shared parts of the commands: the application, the values of --set, progress and output."""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from symgen.cli.streams import discard
from symgen.errors import Interrupted, ModelError, SceneError, SimulationError

if TYPE_CHECKING:
    from rich.console import Console

    from symgen.report.page.study import Study

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

#: Exit codes, which ``symgen --help`` lists; ``symgen.cli`` maps errors to them by class.
FAULT, USAGE, SCENE, RUN, INTERRUPTED = 1, 2, 3, 4, 130
_CODES = (
    "Exit codes: 0 success; 1 internal fault, or a failed check; 2 wrong usage; 3 invalid scene; "
    "4 a run that cannot continue; 130 interrupted by Ctrl-C; 143 ended by SIGTERM."
)

app = typer.Typer(
    help="Derive the equations of motion of a mechanism, generate C from them, and run it compiled.",
    epilog=_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def command(example: str, of: typer.Typer = app, name: str | None = None) -> Callable[[F], F]:
    """Register a command, with an example in its help."""
    return of.command(name, epilog=f"Example: {example}".replace("[", r"\["))


#: Maximum number of digits of an integer value of --set; longer ones remain text.
_DIGITS = 15


def until(t_end: float | None, build: Callable[..., T], settings: dict[str, Any]) -> T:
    """Return what ``build`` makes of a scene with these ``set``, for runs that end at a time [s].

    Where it refuses the scene, this end replaces that of the scene: drives may jump behind it. The kernels of
    a scene that is not refused are those for every end.
    """
    try:
        return build(set=settings)
    except SceneError as error:
        if t_end is None or not 0.0 < t_end < math.inf or error.where == "analysis.t_end":
            raise
        return build(set={**settings, "analysis.t_end": f"{t_end!r} s"})


def progress_bar(title: str, as_json: bool) -> AbstractContextManager[Callable[[float], None] | None]:
    """Return a progress bar on a terminal, a null context elsewhere."""
    if as_json or not sys.stderr.isatty():
        return nullcontext()
    from symgen.report.progress import bar

    return bar(title)


def console(*, stderr: bool = False) -> Console:
    """Return the console for tables and messages: lines are wrapped on a terminal, and whole in a file."""
    from rich.console import Console

    terminal = (sys.stderr if stderr else sys.stdout).isatty()
    return Console(stderr=stderr, soft_wrap=not terminal, markup=False, emoji=False, highlight=False)


def tell(message: str) -> None:
    """Print a message on standard error, unless that is closed or full."""
    try:
        console(stderr=True).print(f"symgen: {message}")
    except OSError:
        discard(sys.stderr)


def changes(options: list[str] | None) -> dict[str, Any]:
    """Return the values of --set by key: integers, booleans, none, TOML lists and tables, else text."""
    result: dict[str, Any] = {}
    for change in options or []:
        name, equals, value = change.partition("=")
        if not equals or not name.strip():
            raise ModelError(f"expected --set KEY=VALUE, got {change!r}")
        bare = value.strip()
        quoted = len(bare) > 1 and bare[0] == bare[-1] and bare[0] in "\"'"
        result[name.strip()] = bare[1:-1] if quoted else _plain(bare)
    return result


def _plain(text: str) -> Any:
    if text.startswith(("[", "{")):
        with suppress(tomllib.TOMLDecodeError):
            return tomllib.loads(f"value = {text}")["value"]
    return {"true": True, "false": False, "none": None}.get(text, int(text) if _is_whole(text) else text)


def _is_whole(text: str) -> bool:
    digits = text.removeprefix("-")
    return digits.isascii() and digits.isdecimal() and len(digits) <= _DIGITS


@contextmanager
def saved_on_failure(out: Path | None) -> Iterator[None]:
    """Save the samples recorded before a run ended, as by Ctrl-C, to the output file, if one is given."""
    try:
        with told_on_interrupt():
            yield
    except (SimulationError, Interrupted) as error:
        if out and error.partial is not None:
            error.partial.save(out)
            tell(f"the samples that are kept are in {out}")
        raise


@contextmanager
def told_on_interrupt() -> Iterator[None]:
    """Print where results are, or how a run continues from its checkpoint, when Ctrl-C ends it."""
    try:
        yield
    except KeyboardInterrupt as error:
        if error.args:
            tell(str(error))
        raise


def wrote(*files: Path | None) -> None:
    """Print the name of every file that a command wrote."""
    for file in filter(None, files):
        console().print(f"wrote {file}", soft_wrap=True, highlight=False)


def print_json(data: dict[str, Any]) -> None:
    """Print one JSON object."""
    import json

    print(json.dumps(data, allow_nan=False))


def show(
    data: dict[str, Any],
    as_json: bool,
    file: Path | None,
    print_tables: Callable[[Console], None],
    plot: Path | None = None,
) -> None:
    """Print results as tables or as one JSON object, and write this object to a file, if one is given.

    ``plot`` is a file that the command wrote before.
    """
    import json

    if file:
        from symgen.atomic import write_text

        write_text(file, json.dumps(data, indent=1, allow_nan=False) + "\n")
    if as_json:
        print_json(data)
    else:
        print_tables(console())
        wrote(file, plot)


def show_study(
    study: Study, name: str, data: dict[str, Any], as_json: bool, page: Path | None, *files: Path | None
) -> None:
    """Write the page of a study if requested; print the study and the files written, or one JSON object."""
    from symgen.atomic import write_text
    from symgen.report.page.study import print_study, render_study

    if page:
        write_text(page, render_study(study, name))
    if as_json:
        print_json(data)
        return
    print_study(study, console())
    wrote(*files, page)
