"""``symgen build``, ``generate`` and ``cache``: what is compiled, and where it is kept."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    ContractionOption,
    DigitsOption,
    PrecisionOption,
    SceneArgument,
    SetOption,
    VectorOption,
    app,
    changes,
    console,
)

cache_app = typer.Typer(help="The folder of compiled scenes.", no_args_is_help=True)
app.add_typer(cache_app, name="cache")


@app.command()
def generate(
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; fail where a file is not current.")
    ] = False,
) -> None:
    """Write the shipped kernels under generated/ anew."""
    from symgen.errors import GenerationError
    from symgen.shipped import generate as write
    from symgen.shipped import not_current

    if check:
        found = not_current()
        if found:
            print("".join(found), end="")
            raise GenerationError(f"{len(found)} generated files are not current: run 'symgen generate'")
        print("generated/ is current")
        return
    for name in write():
        print(f"generated/{name}")


@app.command()
def build(
    scene: SceneArgument,
    set_: SetOption = None,
    backend: BackendOption = "auto",
    precision: PrecisionOption = "float64",
    digits: DigitsOption = None,
    contraction: ContractionOption = "off",
    vector: VectorOption = "none",
) -> None:
    """Derive, emit and compile a scene into the cache."""
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
