"""``symgen build``, ``generate`` and ``cache``: compilation and its cache."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import app, changes, command, console, progress_bar
from symgen.cli.request import analysis

#: Number of matrix entries printed without --all.
_SHOWN = 8

cache_app = typer.Typer(help="Show or empty the cache of compiled scenes.", no_args_is_help=True)
app.add_typer(cache_app, name="cache", rich_help_panel="Kernels")


@command("symgen generate --check")
def generate(
    source: Annotated[
        str | None,
        typer.Argument(
            help="Generate the kernels of this scene, or of a Python file with system(); default: the "
            "shipped kernels under generated/."
        ),
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Derive all of generated/ without writing; fail if it differs."),
    ] = False,
    every: Annotated[bool, typer.Option("--all", help="Print every changed entry.")] = False,
    build: Annotated[
        bool, typer.Option("--build", help="Compile the kernels of generated/ that have changed, too.")
    ] = False,
) -> None:
    """Regenerate outdated kernels and report the changes.

    Changed matrix entries are shown before and after.
    """
    from symgen.errors import GenerationError, ModelError
    from symgen.report.mathematics.regeneration import generated_lines, regenerated_lines

    shown = None if every else _SHOWN
    if build and (check or source is not None):
        raise ModelError("--build applies to changes of generated/: leave --check and the source out")
    if source is not None:
        if check:
            raise ModelError("--check applies to generated/ and cannot be combined with a scene or a file")
        from symgen.regeneration.sources import generate as generate_source

        print(*generated_lines(generate_source(source), shown), sep="\n")
        return
    from symgen.regeneration.generate import compile_again, not_current, regenerate

    if not check:
        with progress_bar("generated/", as_json=False) as progress:
            regenerated = regenerate(progress)
        print(*regenerated_lines(regenerated, shown), sep="\n")
        if build:
            with progress_bar("compiling", as_json=False):
                compile_again()
        elif any(name.endswith((".c", ".h", ".pyx")) for name in regenerated.written):
            print("to compile what has changed: symgen generate --build, or pip install -e .")
        return
    with progress_bar("generated/", as_json=False) as progress:
        differing = not_current(progress)
    if differing:
        print("".join(differing), end="")
        raise GenerationError(f"{len(differing)} generated files are not current: run 'symgen generate'")
    print("generated/ is current")


@analysis(
    "symgen build four_bar --vector native",
    f"set_ {o.COMPILED}",
    scene=o.Source,
)
def build(ctx: typer.Context) -> None:
    """Compile a scene or a user-defined system into the cache."""
    from symgen.pipeline.build import build as build_model
    from symgen.report.summary import model_lines

    arguments = dict(ctx.params)
    model = build_model(arguments.pop("scene"), set=changes(arguments.pop("set_")), **arguments)
    console().print(*model_lines(model), sep="\n")


@command("symgen cache info", cache_app, "info")
def cache_info() -> None:
    """Show the location and contents of the cache."""
    from symgen.report.tables import table
    from symgen.toolchain.cache import Cache

    store = Cache()
    entries = store.entries()
    total = sum(size for _, size in entries)
    rows = [(name, f"{size / 1024:.0f} KiB") for name, size in entries]
    print(f"{store.root}: {len(entries)} entries, {total / 1024:.0f} KiB")
    if rows:
        console().print(table("", ("entry", "size"), rows))


@command("symgen cache clear", cache_app, "clear")
def cache_clear() -> None:
    """Remove every compiled scene from the cache."""
    from symgen.toolchain.cache import Cache

    store = Cache()
    print(f"removed {store.clear()} entries from {store.root}")
