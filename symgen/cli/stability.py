"""``symgen stability``: the hard cases of every method, and what must hold in them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli.common import JsonOption, app, console, print_json, progress_bar


@app.command()
def stability(
    cases: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[,NAME...]", help="Cases or families (rods, loops, elastic links); all if absent."
        ),
    ] = None,
    as_json: JsonOption = False,
    out: Annotated[Path | None, typer.Option(help="Write the page of the documentation: .md.")] = None,
) -> None:
    """Run the hard cases by every method.

    The exit code is 1 where something that must hold does not.
    """
    from symgen.atomic import replacing, writable
    from symgen.study.stability import chosen, run_suite
    from symgen.study.stability.page import page, print_suite

    file = writable(out, (".md",), "page") if out else None
    wanted = chosen([name.strip() for name in cases.split(",")] if cases else [])
    with progress_bar("hard cases", as_json) as progress:
        outcomes = run_suite(wanted, progress)
    if file:
        with replacing(file) as temporary:
            temporary.write_text(page(outcomes), encoding="utf-8")
    if as_json:
        print_json({"holds": all(o.holds for o in outcomes), "outcomes": [o.as_dict() for o in outcomes]})
    else:
        print_suite(outcomes, console())
    if not all(o.holds for o in outcomes):
        raise typer.Exit(1)
