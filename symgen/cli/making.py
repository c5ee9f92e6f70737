"""``symgen build``, ``generate`` and ``cache``: what is compiled, and where it is kept."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    ContractionOption,
    DifferenceOption,
    DigitsOption,
    PrecisionOption,
    SetOption,
    SourceArgument,
    VectorOption,
    app,
    changes,
    console,
    progress_bar,
)

#: Entries of a matrix that are printed unless all are asked for.
_SHOWN = 8

cache_app = typer.Typer(help="The folder of compiled scenes.", no_args_is_help=True)
app.add_typer(cache_app, name="cache")


@app.command()
def generate(
    source: Annotated[
        str | None,
        typer.Argument(
            help="A scene, or a Python file that returns a System, whose kernels to make; the shipped "
            "kernels under generated/ when absent."
        ),
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Derive all of generated/ anew, change nothing; fail if it differs."),
    ] = False,
    every: Annotated[bool, typer.Option("--all", help="Print every entry that changed.")] = False,
    form: DifferenceOption = "text",
) -> None:
    """Derive anew what changed, and say what it changed.

    Of the mathematics, every entry of a matrix is shown before and after.
    """
    from symgen.errors import GenerationError, ModelError
    from symgen.report.difference import check_form
    from symgen.report.regeneration import generated_lines, regenerated_lines

    check_form(form)
    shown = None if every else _SHOWN
    if source is not None:
        if check:
            raise ModelError("--check is for generated/: it does not go with a scene or a file")
        from symgen.sources import generate as generate_source

        print(*generated_lines(generate_source(source), shown, form), sep="\n")
        return
    from symgen.regeneration import not_current, regenerate

    if not check:
        with progress_bar("generated/", as_json=False) as progress:
            found = regenerate(progress)
        print(*regenerated_lines(found, shown, form), sep="\n")
        return
    with progress_bar("generated/", as_json=False) as progress:
        differing = not_current(progress)
    if differing:
        print("".join(differing), end="")
        raise GenerationError(f"{len(differing)} generated files are not current: run 'symgen generate'")
    print("generated/ is current")


@app.command()
def build(
    scene: SourceArgument,
    set_: SetOption = None,
    backend: BackendOption = "auto",
    precision: PrecisionOption = "float64",
    digits: DigitsOption = None,
    contraction: ContractionOption = "off",
    vector: VectorOption = "none",
) -> None:
    """Compile a scene, or a derivation of your own, into the cache."""
    from symgen.pipeline import build as build_model
    from symgen.report.summary import model_lines

    model = build_model(
        scene,
        set=changes(set_),
        backend=backend,
        precision=precision,
        digits=digits,
        contraction=contraction,
        vector=vector,
    )
    print(*model_lines(model), sep="\n")


@cache_app.command("info")
def cache_info() -> None:
    """Show where the cache is and what it holds."""
    from symgen.cache import Cache
    from symgen.report.tables import table

    store = Cache()
    entries = store.entries()
    total = sum(size for _, size in entries)
    rows = [(name, f"{size / 1024:.0f} KiB") for name, size in entries]
    print(f"{store.root}: {len(entries)} entries, {total / 1024:.0f} KiB")
    if rows:
        console().print(table("", ("entry", "size"), rows))


@cache_app.command("clear")
def cache_clear() -> None:
    """Remove every compiled scene from the cache."""
    from symgen.cache import Cache

    store = Cache()
    print(f"removed {store.clear()} entries from {store.root}")
