"""Limit of a parameter up to which a driven loop can traverse its whole range, by bisection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from symgen.errors import InitialStateError, ModelError, SimulationError
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.turn import Turn
from symgen.study.plan import Search

#: Maximum number of evaluations: both ends of the search, and bisection to 1e-9 of its range.
STEPS = 32


@dataclass(frozen=True, slots=True)
class Limit:
    """The limit of a parameter.

    Attributes
    ----------
    value
        Last value at which the loop traverses its range [SI]; None if it does so up to the end of the
        search.
    width
        Distance to the first value at which it does not [SI].
    closure
        Largest closure defect over the range, at ``value``.
    least_singular
        Least singular value of the screws relative to the largest, at ``value``: small close to a limit.
    cause
        Error message just beyond the limit; empty if there is no limit.
    """

    search: Search
    value: float | None
    width: float
    closure: float
    least_singular: float
    cause: str


def find_limit(model: LoopModel, search: Search, done: Callable[[], None]) -> Limit:
    """Return the limit of a parameter within a search range, which must contain a single limit.

    ``done`` is called after every evaluation, at most ``STEPS`` times.

    Raises
    ------
    ModelError
        If the loop cannot traverse its range at the start of the search.
    """

    def through(value: float) -> Turn | str:
        try:
            changed = model.with_parameters(**{search.parameter: value})
            return cast(Turn, changed.inverse_dynamics())
        except (SimulationError, InitialStateError) as error:
            return str(error).partition("\n")[0]
        finally:
            done()

    good, bad = search.start, search.stop
    turn = through(good)
    if isinstance(turn, str):
        raise ModelError(
            f"the search for a limit of {search.parameter} starts at {search.in_unit(good):g} {search.unit}, "
            f"where the loop cannot go through its range: {turn}\n  Start from a value at which it can."
        )
    beyond = through(bad)
    if not isinstance(beyond, str):
        return Limit(search, None, 0.0, beyond.closure, beyond.statistics["least_singular"], "")
    for _ in range(STEPS - 2):
        middle = (good + bad) / 2
        found = through(middle)
        if isinstance(found, str):
            bad, beyond = middle, found
        else:
            good, turn = middle, found
    return Limit(search, good, abs(bad - good), turn.closure, turn.statistics["least_singular"], beyond)
