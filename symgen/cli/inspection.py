"""``symgen scenes``, ``show``, ``explain`` and ``schema``: what a scene is and what was derived from it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import TYPE_CHECKING, Annotated

import typer

from symgen.cli.common import SceneArgument, SetOption, app, changes, console

if TYPE_CHECKING:
    from symgen.scene.loading import SceneText
    from symgen.symbolic.system import System


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
            help="A matrix, as listed without it; momentum_rows for those, momentum_rows.NAME for one."
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help="unicode, latex, c, or numeric (at the start).")
    ] = "unicode",
    digits: Annotated[
        bool, typer.Option("--digits", help="Rank the sums of a matrix, or of all, by the digits they lose.")
    ] = False,
    set_: SetOption = None,
) -> None:
    """Show the derived equations."""
    if digits:
        _show_digits(model, matrix, set_)
        return
    from symgen.errors import ModelError
    from symgen.models import BLOCKS, DERIVATIONS
    from symgen.pipeline import build_scene as build_model
    from symgen.pipeline import derive
    from symgen.report import equations
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.model import Model

    asked = changes(set_)
    form_of, _, row = (matrix or "").partition(".")
    derivation = DERIVATIONS[model]() if model in DERIVATIONS else None
    further: dict[str, System] = {}
    if derivation and matrix and matrix in derivation:
        system = derivation
    elif not _is_scene(model):
        system = BLOCKS[model]() if model in BLOCKS else derive(model)
    else:
        from symgen.scene.loading import override, read_scene

        text = override(read_scene(model), asked)
        if form_of == "momentum_rows":
            from symgen.models.momentum import momentum_system
            from symgen.scene.loading import check_scene
            from symgen.scene.resolve import resolve_linkage

            system = momentum_system(resolve_linkage(check_scene(text)))
        else:
            system = derive(text)
            further = _elastic_systems(text)
    if form_of in further and row:
        system = further[form_of]
    if matrix is None:
        from symgen.report.tables import table

        parts = [("", part) for part in (derivation, system) if part]
        for prefix, part in [*parts, *((f"{kind}.", part) for kind, part in further.items())]:
            rows = [(prefix + name, *more) for name, *more in equations.overview(part)]
            shown = table(part.title, ("matrix", "shape", "unit", "meaning"), rows)
            shown.columns[3].justify = "left"
            console().print(shown)
        return
    built: Model | None = None
    if form == "numeric" and _is_scene(model):
        made = build_model(model, set=asked)
        built = made.rigid if isinstance(made, ElasticModel) else made if isinstance(made, Model) else None
        if built is None:
            raise ModelError(f"numbers are shown of linkages; 'symgen run {model}' gives those of a loop")
    if matrix == "momentum_rows" and _is_scene(model):
        print(equations.show_rows(system, form, built))
    else:
        by_row = row and (form_of == "momentum_rows" or form_of in further)
        print(equations.show(system, row if by_row else matrix, form, built))


def _is_scene(model: str) -> bool:
    """Tell whether a model is neither a building block nor a user's own derivation."""
    from symgen.models import BLOCKS
    from symgen.own import is_own

    return model not in BLOCKS and not is_own(model)


def _show_digits(scene: str, matrix: str | None, set_: list[str] | None) -> None:
    """Print which sums lose most digits."""
    from symgen.study import accuracy
    from symgen.study.accuracy_page import print_cancelling

    print_cancelling(accuracy.digits(scene, matrix, set=changes(set_)), console())


def _elastic_systems(text: SceneText) -> dict[str, System]:
    """Return what is derived besides for elastic links, by what comes before the dot in its names."""
    from symgen.models.analyses import elastic_systems
    from symgen.scene.linkage import Linkage
    from symgen.scene.loading import check_scene
    from symgen.scene.resolve import resolve

    resolved = resolve(check_scene(text))
    return elastic_systems(resolved) if isinstance(resolved, Linkage) else {}


@app.command()
def explain(scene: SceneArgument, set_: SetOption = None) -> None:
    """Tell how a scene hangs together: its tree or table, its degrees of freedom, what is redundant."""
    from symgen.pipeline import build_scene as build_model
    from symgen.report.summary import freedom_lines
    from symgen.scene.linkage import Linkage
    from symgen.scene.loading import load_scene
    from symgen.scene.resolve import resolve

    asked = changes(set_)
    resolved = resolve(load_scene(scene, set=asked))
    if isinstance(resolved, Linkage):
        from symgen.models.structure import structure

        lines: Iterable[str] = structure(resolved)
    else:
        from symgen.models.loop import loop_system
        from symgen.models.loop_structure import general, loop_structure
        from symgen.report.saving import saving_lines

        system = loop_system(resolved)
        saved = saving_lines(system, loop_system(general(resolved)), "general offsets")
        lines = chain(loop_structure(resolved, system), saved)
    print(*lines, sep="\n", flush=True)
    print(*freedom_lines(build_model(scene, set=asked)), sep="\n")


@app.command()
def schema() -> None:
    """Print the JSON Schema of scene files, for editors."""
    import json

    from symgen.scene.schema import Scene

    print(json.dumps(Scene.model_json_schema(), indent=2))
