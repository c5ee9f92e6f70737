"""``symgen stability``: hard cases for every method, with bounds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import command, console, print_json, progress_bar


@command("symgen stability --cases rods")
def stability(
    cases: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[,NAME...]", help="Cases or families (rods, loops, elastic links); default: all."
        ),
    ] = None,
    as_json: o.Json = False,
    out: Annotated[Path | None, typer.Option(help="Write the documentation page: .md.")] = None,
) -> None:
    """Run the hard cases with every method.

    The cases are built in. 'symgen periodic SCENE' determines the stability of elastic links.

    The exit code is 1 if an error exceeds its bound.
    """
    from symgen.atomic import replacing, writable
    from symgen.study.stability import chosen, run_suite
    from symgen.study.stability.page import page, print_suite

    file = writable(out, (".md",), "page") if out else None
    cases_to_run = chosen([name.strip() for name in cases.split(",")] if cases else [])
    with progress_bar("hard cases", as_json) as progress:
        outcomes = run_suite(cases_to_run, progress)
    if file:
        with replacing(file) as temporary:
            temporary.write_text(page(outcomes), encoding="utf-8")
    if as_json:
        print_json({"holds": all(o.holds for o in outcomes), "outcomes": [o.as_dict() for o in outcomes]})
    else:
        print_suite(outcomes, console())
    if not all(o.holds for o in outcomes):
        raise typer.Exit(1)
