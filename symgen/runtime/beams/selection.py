"""Outputs of elastic links that a scene selects, and those of them that an analysis lacks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from itertools import tee

from symgen.errors import SceneError
from symgen.runtime.kernels.description import Description
from symgen.runtime.result.records import Variable, of_names, unknown

_EVERY: ContextVar[bool] = ContextVar("no output may be omitted", default=False)


@contextmanager
def every_output() -> Iterator[None]:
    """Refuse analyses that lack an output which the scene selects, also where others have it."""
    token = _EVERY.set(True)
    try:
        yield
    finally:
        _EVERY.reset(token)


def none() -> Iterable[Variable]:
    """Return the outputs of other analyses where there are none."""
    return ()


def selected(
    variables: Iterable[Variable], d: Description, of_runs: Callable[[], Iterable[Variable]] = none
) -> tuple[Variable, ...]:
    """Return the outputs that the scene selects, in its order; all where it selects none.

    Outputs that only ``of_runs`` has, the outputs of runs by linear theory, are omitted, unless no other is
    left. Forces at the foot of a point off the line of an elastic link have the name of this point. Other
    outputs of feet are for drawings, which select them.

    Raises
    ------
    SceneError
        When there is no such output.
    """
    names = d.elastic.outputs if d.elastic else None
    feet = {foot: d.links[lug][1] for lug, foot in d.lugs.items() if foot}
    variables, again = tee(_at_point(v, feet) for v in variables)
    if names is None:
        return tuple(v for v in variables if v.name.partition(".")[0] not in feet)
    found = of_names(variables, names)
    lacking = [name for name in names if name not in found]
    elsewhere = of_names((_at_point(v, feet) for v in of_runs()), lacking) if lacking else {}
    for name in lacking:
        if name not in elsewhere or not found or _EVERY.get():
            known = [v for v in again if v.name.partition(".")[0] not in feet]
            here = "this analysis has" if name in elsewhere else "runs of elastic links have"
            raise SceneError(
                f"{here} no output {name!r}. {unknown(name, known)}",
                where="analysis.outputs",
                hint="symgen simulate and model.simulate() have it." if name in elsewhere else "",
            )
    return tuple(found[name] for name in names if name in found)


def note_of_omitted(shown: Iterable[Variable], d: Description) -> list[str]:
    """Return the note on outputs that the scene selects and an analysis lacks, if there are any."""
    recorded = {v.name for v in shown}
    lacking = [name for name in (d.elastic.outputs if d.elastic else None) or () if name not in recorded]
    return [f"outputs that only symgen simulate has are omitted: {', '.join(lacking)}"] if lacking else []


def _at_point(variable: Variable, feet: Mapping[str, str]) -> Variable:
    """Return a force on a link at a foot as one at the point that the foot carries; others as they are."""
    link, _, rest = variable.name.partition(".")
    foot, _, word = rest.partition(".")
    if foot not in feet:
        return variable
    about = variable.about.replace(foot, f"the section of {feet[foot]}")
    return replace(variable, name=f"{link}.{feet[foot]}.{word}", about=about)
