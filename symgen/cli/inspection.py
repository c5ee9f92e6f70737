"""``symgen scenes``, ``show``, ``explain`` and ``schema``: what a scene is and what was derived from it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import typer

from symgen.cli.common import SceneArgument, SetOption, app, changes, console
from symgen.errors import ModelError

if TYPE_CHECKING:
    from symgen.inspection.subject import Chosen, Subject


@app.command()
def scenes() -> None:
    """List the shipped scenes."""
    from symgen.report.tables import table
    from symgen.scene.loading import read_scene, shipped_scenes

    rows = [(name, read_scene(name).data.get("title", "")) for name in shipped_scenes()]
    shown = table("Shipped scenes", ("name", "mechanism"), rows)
    shown.columns[1].justify = "left"
    console().print(shown)


@app.command()
def show(
    model: Annotated[
        str, typer.Argument(help="A scene, a Python file that returns a System, or a block: rod, ...")
    ],
    matrix: Annotated[
        str | None,
        typer.Argument(
            help="A matrix, as listed without it; derivation for all steps, momentum_rows for those, "
            "momentum_rows.NAME for one."
        ),
    ] = None,
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help="unicode, latex (amsmath), shared (after the search for common subexpressions), c, or "
            "numeric.",
        ),
    ] = "unicode",
    rows: Annotated[
        str | None, typer.Option(metavar="NAME[,NAME...]", help="These rows alone, by name or number from 0.")
    ] = None,
    columns: Annotated[
        str | None, typer.Option(metavar="NAME[,NAME...]", help="These columns alone.")
    ] = None,
    by: Annotated[
        str | None, typer.Option(metavar="NAME", help="The derivative by a tunable parameter or a symbol.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE",
            help='State of numbers: a time "0.3 s", of a driven loop its input "45"; the start if absent.',
        ),
    ] = None,
    with_: Annotated[
        list[str] | None,
        typer.Option("--with", metavar="NAME=NUMBER", help="A symbol's value in numbers, in SI units."),
    ] = None,
    digits: Annotated[
        bool, typer.Option("--digits", help="Rank the sums of a matrix, or of all, by the digits they lose.")
    ] = False,
    set_: SetOption = None,
) -> None:
    """Show the derived equations, in any form.

    All matrices are listed; one is shown, or a part of it, where it is named.
    """
    from symgen.report.equations import check_form

    check_form(form)
    if digits:
        _show_digits(model, matrix, set_)
        return
    from symgen.inspection.subject import RECORD, Subject

    subject = Subject(model, changes(set_))
    if form != "numeric" and (at or with_):
        raise ModelError("--at and --with say where numbers are taken: they go with --format numeric")
    if matrix in (None, RECORD) and (rows or columns or by):
        raise ModelError("--rows, --columns and --by are of one matrix: name it")
    if matrix is None:
        _list(subject)
    elif matrix == RECORD:
        _show_record(subject, form)
    else:
        chosen = subject.choose(matrix, numbers=form == "numeric")
        chosen = chosen.by(by) if by else chosen
        _show_chosen(subject, chosen.part(rows, columns), form, at, with_)


def _list(subject: Subject) -> None:
    """Print what matrices there are."""
    from symgen.report.equations import overview
    from symgen.report.tables import table

    for prefix, part in subject.parts:
        listed = [(prefix + name, *more) for name, *more in overview(part)]
        shown = table(part.title, ("matrix", "shape", "unit", "meaning"), listed)
        shown.columns[3].justify = "left"
        console().print(shown)


def _show_record(subject: Subject, form: str) -> None:
    """Print the derivation step by step."""
    from symgen.report.record import record_in_latex, record_in_text

    if form not in ("unicode", "latex"):
        raise ModelError(
            f"the derivation is shown as unicode or latex, not as {form}: name a matrix for that"
        )
    steps = subject.record
    print(record_in_latex(subject.own.title, steps) if form == "latex" else record_in_text(steps))


def _show_chosen(
    subject: Subject, chosen: Chosen, form: str, at: str | None, with_: list[str] | None
) -> None:
    """Print matrices in one form, as numbers at a state."""
    from symgen.report.equations import show as shown

    if form != "numeric":
        print(shown(chosen.system, chosen.matrices, form))
        return
    from symgen.inspection.state import NOWHERE, state_of
    from symgen.pipeline import build_scene as build_model

    given = _numbers(with_)
    if not subject.is_scene and (at or not given):
        what = "a building block" if subject.is_block else "no scene"
        raise ModelError(
            f"{subject.name} is {what}: it has no state to give numbers at\n"
            "  Give its symbols, each with --with NAME=NUMBER, in SI units."
        )
    state = state_of(build_model(subject.text), at) if subject.is_scene else NOWHERE
    values = state.of(chosen.system, given)
    print(shown(chosen.system, chosen.matrices, form, values, state.label))


def _numbers(options: list[str] | None) -> dict[str, float]:
    """Return the values that --with gives, by name."""
    found = {}
    for option in options or []:
        name, _, value = option.partition("=")
        try:
            found[name.strip()] = number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise ModelError(f"expected --with NAME=NUMBER, in SI units, got {option!r}")
    return found


def _show_digits(scene: str, matrix: str | None, set_: list[str] | None) -> None:
    """Print which sums lose most digits."""
    from symgen.study import accuracy
    from symgen.study.accuracy_page import print_cancelling

    print_cancelling(accuracy.digits(scene, matrix, set=changes(set_)), console())


@app.command()
def explain(scene: SceneArgument, set_: SetOption = None) -> None:
    """Tell what became of a scene, and what its equations cost.

    What was kept and what left out, what that saves, and how the equations are solved.
    """
    from symgen.inspection.explanation import explanation

    for line in explanation(scene, changes(set_)):
        print(line, flush=True)


@app.command()
def schema() -> None:
    """Print the JSON Schema of scene files, for editors."""
    import json

    from symgen.scene.schema import Scene

    print(json.dumps(Scene.model_json_schema(), indent=2))
