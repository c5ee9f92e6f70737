"""``symgen scenes``, ``show``, ``explain``, ``schema`` and ``diff``: scenes and their derived equations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, console, print_json, wrote
from symgen.errors import ModelError

if TYPE_CHECKING:
    from symgen.pipeline.subject import Chosen, Subject


@command("symgen scenes crank_rocker")
def scenes(
    name: Annotated[
        str | None,
        typer.Argument(help="A shipped scene whose file is printed; default: list all names."),
    ] = None,
) -> None:
    """List the shipped scenes, or print one of them."""
    from symgen.report.tables import table
    from symgen.scene.loading import machines, read_scene, shipped_scene, shipped_scenes

    if name is not None:
        print(shipped_scene(name), end="")
        return
    for title, names in (("Shipped scenes", shipped_scenes()), ("Machines of the trades", machines())):
        rows = [(name, read_scene(name).data.get("title", "")) for name in names]
        console().print(table(title, ("name", "mechanism"), rows, texts=(0, 1)))


@command("symgen new linkage.toml --from crank_rocker")
def new(
    file: Annotated[Path, typer.Argument(help="The scene file to write: .toml.")],
    source: Annotated[
        str, typer.Option("--from", metavar="SCENE", help="The shipped scene to copy.")
    ] = "four_bar",
) -> None:
    """Copy a shipped scene to a file that you can edit."""
    from symgen.atomic import writable, write_text
    from symgen.errors import ResultError
    from symgen.scene.loading import shipped_scene

    text = shipped_scene(source)
    writable(file, (".toml",), "scene")
    if file.exists():
        raise ResultError(f"{file} exists\n  Give another name, or remove it.")
    write_text(file, text)
    wrote(file)
    print(f"  Change it, then: symgen run {file}, symgen animate {file}")


@command("symgen units")
def units() -> None:
    """List the units of scenes, which may be combined as in lbf/in and kg*m^2."""
    from symgen.report.tables import table
    from symgen.scene.units import units as known

    rows = [(names, f"{float(value):.10g}", dim.unit) for names, value, dim in known()]
    console().print(table("Units", ("unit", "value", "SI"), rows, texts=(0, 2)))
    print("Prefixes of SI: n, u or µ, m, c, d, k, M, G.")


@command("symgen show peaucellier constraint_jacobian --format latex")
def show(
    model: Annotated[
        str | None,
        typer.Argument(
            help="A scene, a Python file with system(), or a building block: rod, ...; if absent, they are "
            "listed."
        ),
    ] = None,
    matrix: Annotated[
        str | None,
        typer.Argument(
            help="A matrix, kernel, shared term or argument (if absent, matrices are listed); the number of "
            "an equation of the papers, '(47)'; derivation for all steps, momentum_rows for all momentum "
            "rows, momentum_rows.NAME for one."
        ),
    ] = None,
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help="unicode, latex (amsmath), shared (after elimination of common subexpressions), c, or "
            "numeric.",
        ),
    ] = "unicode",
    rows: Annotated[
        str | None, typer.Option(metavar="NAME[,NAME...]", help="Only these rows, by name or number from 1.")
    ] = None,
    columns: Annotated[str | None, typer.Option(metavar="NAME[,NAME...]", help="Only these columns.")] = None,
    by: Annotated[
        str | None, typer.Option(metavar="NAME", help="Derivative with respect to a parameter or symbol.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE",
            help='State for numeric values: a time "0.3 s", or a driven loop\'s input "45"; default: start.',
        ),
    ] = None,
    with_: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="NAME=VALUE",
            help='Value of a symbol: a number in SI units, "90 deg" or "pi/2", which is exact.',
        ),
    ] = None,
    cut: Annotated[
        str | None,
        typer.Option(
            metavar="LINK.POINT[,...]",
            help="Joints to cut in momentum_rows; default: a loop is cut where a point is reached twice.",
        ),
    ] = None,
    numeric: Annotated[
        bool, typer.Option("--numeric", help="Values instead of the letters of the scene's constants.")
    ] = False,
    set_: o.Set = None,
) -> None:
    """Show the derived equations in a selected format.

    Without a matrix name, all matrices are listed; without a model, all scenes and building blocks.
    """
    if model is None:
        _list_models()
        return
    _check_model(model, matrix)
    from symgen.report.mathematics.equations import check_form, check_letters

    check_form(form)
    from symgen.inspection.assembled import is_assembled, numbers
    from symgen.pipeline.subject import RECORD, Subject, parts

    subject = Subject(model, changes(set_))
    given = {"--by": by, "--with": with_, f"--format {form}": form not in ("unicode", "numeric")}
    symbolic = [option for option, is_given in given.items() if is_given]
    if is_assembled(matrix, subject, numeric=bool(at) or form == "numeric", symbolic=symbolic):
        print(numbers(subject, matrix, at, rows, columns))
        return
    if form != "numeric" and at:
        raise ModelError("--at selects a state for numeric values: it requires --format numeric")
    if matrix in (None, RECORD) and (rows or columns or by):
        raise ModelError("--rows, --columns and --by apply to one matrix: name it")
    if matrix in (None, RECORD) and cut:
        raise ModelError("--cut applies to momentum_rows and momentum_rows.NAME: name them")
    if matrix is None and (numeric or with_):
        raise ModelError("--numeric and --with apply to a matrix or to the derivation: name it")
    if matrix is None:
        _list(subject)
    elif matrix == RECORD:
        _show_record(subject, form, with_ or (), numeric)
    else:
        cuts = [x.strip() for x in cut.split(",")] if cut else []
        found = subject.found(matrix, numbers=form == "numeric", cuts=cuts)
        for i, part in enumerate(parts([x.by(by) for x in found] if by else found, rows, columns)):
            check_letters(part.matrices, form)
            print("\n" * bool(i), end="")
            if form == "numeric":
                _show_numbers(subject, part, at, with_ or ())
            else:
                _show_equations(part, form, with_ or (), numeric)


def _check_model(model: str, matrix: str | None) -> None:
    """Raise ModelError for the number of an equation in the place of a model, with commands that show it."""
    from symgen.pipeline.citations import PAPERS, as_equation, elsewhere

    number = f"{model} {matrix}" if model in PAPERS and matrix else "" if matrix else model
    if (equation := as_equation(number)) and not Path(model).exists():
        raise ModelError(f"{equation} is the number of an equation: name a model\n  {elsewhere(equation)}")


def _list_models() -> None:
    """Print the shipped scenes and the building blocks."""
    from symgen.models import BLOCKS
    from symgen.report.tables import table

    scenes()
    blocks = [(name, block.about) for name, block in BLOCKS.items()]
    console().print(table("Building blocks", ("name", "content"), blocks, texts=(0, 1)), width=_width())
    print("A scene of your own is named by its file: symgen show my_linkage.toml")


def _list(subject: Subject) -> None:
    """Print the list of matrices."""
    from symgen.inspection.assembled import assembled_names
    from symgen.report.mathematics.equations import overview, used_constants
    from symgen.report.mathematics.layout import wrapped
    from symgen.report.mathematics.numbers import alike_in_one
    from symgen.report.tables import table

    for prefix, part in subject.parts:
        if (values := used_constants(part, part.matrices)) and not prefix:
            columns = ("constant", "unit", "value", "meaning")
            rows = alike_in_one(values)
            console().print(table("Constants of the scene", columns, rows, texts=(0, 3)), width=_width())
            if part.absent:
                absent = f"Zero, so that their terms are absent: {', '.join(part.absent)}."
                print("\n".join(wrapped(absent, _width(), "  ")))
        listed = [(prefix + name, *more) for name, *more in overview(part.matrices)]
        _print_names(part.title, listed)
    if assembled := assembled_names(subject):
        about = "Assembled equations of the elastic motion; numbers with --at ANGLE"
        _print_names(about, [(name, "", *more) for name, *more in assembled])
    if subject.recorded:
        _print_names("Steps of the derivation", [*overview(subject.recorded)])


def _print_names(title: str, listed: Sequence[Sequence[str]]) -> None:
    """Print name, source, and meaning with unit and shape; a unit by unknowns, such as per angle, once."""
    from symgen.elements.element import entry_unit
    from symgen.report.mathematics.layout import wrapped
    from symgen.report.tables import table

    by_unknown = entry_unit("")
    rows = [
        (
            name,
            source,
            f"{meaning} [{unit.removesuffix(by_unknown)}]" + (f", {shape.replace(' ', '')}" if shape else ""),
        )
        for name, shape, unit, meaning, source in listed
    ]
    print("\n".join(wrapped(title, _width(), "  ")))
    console().print(table("", ("matrix", "source", "meaning"), rows, texts=(0, 1, 2)), width=_width())
    if any(unit.endswith(by_unknown) for _, _, unit, *_ in listed):
        note = f"Units of elements are {by_unknown.lstrip('; ')}, of rows and of columns."
        print("\n".join(wrapped(note, _width(), "  ")))


def _show_record(subject: Subject, form: str, given: Sequence[str], numeric: bool) -> None:
    """Print the derivation step by step."""
    from symgen.inspection.values import of_symbols
    from symgen.report.mathematics.record import record_in_latex, record_in_text

    if form not in ("unicode", "latex"):
        raise ModelError(
            f"the derivation is shown as unicode or latex, not as {form}: name a matrix for this format"
        )
    steps = subject.record
    if given or numeric:
        values = of_symbols(given, (x for step in steps for x in step.system.symbols()))
        steps = subject.record_with(values, constants=numeric)
    print(
        record_in_latex(subject.system.title, steps, _width())
        if form == "latex"
        else record_in_text(steps, _width())
    )


def _show_equations(chosen: Chosen, form: str, given: Sequence[str], numeric: bool) -> None:
    """Print matrices as equations, with the ``given`` values of some symbols, or all constants in numbers."""
    from symgen.inspection.values import of_symbols
    from symgen.report.mathematics.equations import show as print_matrices

    if given or numeric:
        values = of_symbols(given, chosen.system.symbols())
        chosen = chosen.valued(values, constants=numeric)
    print(print_matrices(chosen.system, chosen.matrices, form, width=_width()))


def _show_numbers(subject: Subject, chosen: Chosen, at: str | None, given: Sequence[str]) -> None:
    """Print matrices as numbers, at a state of a scene, with the ``given`` values of some symbols."""
    from symgen.inspection.assembled import check_independent
    from symgen.inspection.state import NOWHERE, state_of
    from symgen.inspection.values import of_symbols
    from symgen.pipeline.build import build_scene as build_model
    from symgen.report.mathematics.equations import show as print_matrices

    has_symbols = any(m.matrix.free_symbols for m in chosen.matrices)
    if not subject.is_scene and (at or (has_symbols and not given)):
        kind = "a building block" if subject.is_block else "not a scene"
        raise ModelError(
            f"{subject.name} is {kind}: it has no state for numeric values\n"
            f"  Give a value for each symbol with --with NAME=VALUE, in SI units."
        )
    state = state_of(build_model(subject.text), at) if subject.is_scene else NOWHERE
    values = state.of(chosen.system, of_symbols(given, chosen.system.symbols()))
    label = ", otherwise ".join(filter(None, (f"with {', '.join(given)}" if given else "", state.label)))
    check_independent(chosen, values, state.label)
    print(print_matrices(chosen.system, chosen.matrices, "numeric", values, label, _width()))
    if chosen.is_square:
        from symgen.report.mathematics.numbers import solution

        print(f"\n{solution(chosen.system, values, label)}")


def _width() -> int:
    """Return the width of the terminal, or that of files."""
    import sys

    from symgen.report.mathematics.layout import WIDTH

    return console().width if sys.stdout.isatty() else WIDTH


@command("symgen explain peaucellier")
def explain(scene: o.Scene, set_: o.Set = None) -> None:
    """Explain topology, degrees of freedom and cost of the equations.

    The report lists retained and omitted parts, saved operations, and the elimination order.
    """
    from symgen.inspection.explanation import explanation
    from symgen.report.mathematics.layout import wrapped

    for line in explanation(scene, changes(set_)):
        for part in wrapped(line, _width()):
            console().print(part)


@command("symgen schema --explain links.NAME.mass")
def schema(
    explain: Annotated[
        str | None,
        o.option(
            "--explain", metavar="KEY", help="Explain a key or a table of scene files, such as drivers."
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of scene files, for use in editors, or explain a key."""
    import json

    from symgen.inspection.explanation import explained, keys_of
    from symgen.report.tables import table
    from symgen.scene.schema import Scene

    schema = Scene.model_json_schema()
    if explain is None:
        print(json.dumps(schema, indent=2))
        return
    rows = explained(keys_of(schema), explain)
    console().print(
        table(f"Keys of scene files: {explain}", ("key", "values", "if absent", "meaning"), rows, range(4))
    )


_SOURCE = "A scene, a Python file with a function system(), or a building block: see symgen show."


@command('symgen diff four_bar four_bar --set links.crank.mass="2 kg"')
def diff(
    before: Annotated[str, typer.Argument(help=_SOURCE)],
    after: Annotated[str, typer.Argument(help="The second source, or the first one changed by --set.")],
    set_: o.Set = None,
    as_json: o.Json = False,
) -> None:
    """Show the differences between the equations of two models.

    The operation counts of their kernels are compared as well.
    """
    from dataclasses import asdict

    from symgen.regeneration.sources import compare
    from symgen.report.mathematics.difference import difference_lines
    from symgen.report.mathematics.layout import wrapped

    old, new, difference = compare(before, after, changes(set_))
    if as_json:
        print_json({"before": old.name, "after": new.name, **asdict(difference)})
        return
    lines = (f"- {old.name}: {old.title}", f"+ {new.name}: {new.title}", *difference_lines(difference))
    console().print(*(part for line in lines for part in wrapped(line, indent="      ")), sep="\n")
