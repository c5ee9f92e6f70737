"""``symgen diff``: what is different in the mathematics of two scenes, or two versions of one."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.common import DifferenceOption, JsonOption, SetOption, app, changes, print_json

_SOURCE = "A scene, a Python file that returns a System, or a building block."


@app.command()
def diff(
    before: Annotated[str, typer.Argument(help=_SOURCE)],
    after: Annotated[str, typer.Argument(help="Another, or the same: --set is for this one.")],
    set_: SetOption = None,
    form: DifferenceOption = "text",
    as_json: JsonOption = False,
) -> None:
    """Show what is different in the equations of two models.

    The operations of their kernels are compared as well.
    """
    from dataclasses import asdict

    from symgen.report.difference import check_form, difference_lines
    from symgen.sources import compare

    check_form(form)

    old, new, found = compare(before, after, changes(set_))
    if as_json:
        print_json({"before": old.name, "after": new.name, **asdict(found)})
        return
    words = "% " if form == "latex" else ""
    print(f"{words}- {old.name}: {old.title}\n{words}+ {new.name}: {new.title}")
    print(*difference_lines(found, form=form), sep="\n")
