"""``symgen diff``: differences in the mathematics of two scenes or of two versions of a scene."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, print_json

_SOURCE = "A scene, a Python file that returns a System, or a building block."


@command('symgen diff four_bar four_bar --set links.crank.mass="2 kg"')
def diff(
    before: Annotated[str, typer.Argument(help=_SOURCE)],
    after: Annotated[str, typer.Argument(help="Another one, or the same with --set, which applies to it.")],
    set_: o.Set = None,
    form: o.Difference = "text",
    as_json: o.Json = False,
) -> None:
    """Show the differences between the equations of two models.

    The operation counts of their kernels are compared as well.
    """
    from dataclasses import asdict

    from symgen.regeneration.sources import compare
    from symgen.report.mathematics.difference import check_form, difference_lines

    check_form(form)

    old, new, found = compare(before, after, changes(set_))
    if as_json:
        print_json({"before": old.name, "after": new.name, **asdict(found)})
        return
    words = "% " if form == "latex" else ""
    print(f"{words}- {old.name}: {old.title}\n{words}+ {new.name}: {new.title}")
    print(*difference_lines(found, form=form), sep="\n")
