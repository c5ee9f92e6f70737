"""``symgen scenes``, ``show``, ``explain`` and ``schema``: what a scene is and what was derived from it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import Annotated

import typer

from symgen.cli.common import SceneArgument, SetOption, app, changes, console


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
    model: Annotated[str, typer.Argument(help="A scene, or a building block: rod, elastic_link, ...")],
    matrix: Annotated[
        str | None,
        typer.Argument(
            help="A matrix; all are listed without it. momentum_rows for those, momentum_rows.NAME for one."
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help="unicode, latex, c, or numeric (at the start).")
    ] = "unicode",
    set_: SetOption = None,
) -> None:
    """Show the derived equations."""
    from symgen.errors import ModelError
    from symgen.models import BLOCKS, DERIVATIONS
    from symgen.pipeline import build as build_model
    from symgen.pipeline import derive
    from symgen.report import equations
    from symgen.runtime.model import Model

    asked = changes(set_)
    form_of, _, row = (matrix or "").partition(".")
    derivation = DERIVATIONS[model]() if model in DERIVATIONS else None
    if derivation and matrix and matrix in derivation:
        system = derivation
    elif model in BLOCKS:
        system = BLOCKS[model]()
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
    if matrix is None:
        from symgen.report.tables import table

        for part in (derivation, system) if derivation else (system,):
            shown = table(part.title, ("matrix", "shape", "unit", "meaning"), equations.overview(part))
            shown.columns[3].justify = "left"
            console().print(shown)
        return
    built: Model | None = None
    if form == "numeric" and model not in BLOCKS:
        made = build_model(model, set=asked)
        if not isinstance(made, Model):
            raise ModelError(f"numbers are shown of linkages; 'symgen run {model}' gives those of a loop")
        built = made
    if matrix == "momentum_rows" and model not in BLOCKS:
        print(equations.show_rows(system, form, built))
    else:
        print(equations.show(system, row if form_of == "momentum_rows" and row else matrix, form, built))


@app.command()
def explain(scene: SceneArgument, set_: SetOption = None) -> None:
    """Tell how a scene hangs together: its tree or table, its degrees of freedom, what is redundant."""
    from symgen.pipeline import build as build_model
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
