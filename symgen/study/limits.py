"""Up to which value of a parameter a driven loop can go through its whole range: bisection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from symgen.errors import InitialStateError, ModelError, SimulationError
from symgen.runtime.loop_model import LoopModel
from symgen.runtime.turn import Turn
from symgen.study.plan import Search

#: Evaluations that a limit takes at most: both ends of the search, and halvings down to 1e-9 of its range.
STEPS = 32


@dataclass(frozen=True, slots=True)
class Limit:
    """The limit of a parameter.

    Attributes
    ----------
    value
        Last value found at which the loop goes through its range [SI]; None when it does to the end of
        the search.
    width
        How far the first value is at which it does not [SI].
    closure
        Largest defect of closure over the range, at ``value``.
    least_singular
        Least singular value of the screws over the largest, there: small close to a limit.
    cause
        What the loop says just beyond; empty where it goes on.
    """

    search: Search
    value: float | None
    width: float
    closure: float
    least_singular: float
    cause: str


def find_limit(model: LoopModel, search: Search, done: Callable[[], None]) -> Limit:
    """Return the limit of a parameter between the two ends of a search, taken to be the only one there.

    ``done`` is called after every evaluation, ``STEPS`` times at most.

    Raises
    ------
    ModelError
        When the loop cannot go through its range at the start of the search.
    """

    def through(value: float) -> Turn | str:
        try:
            return model.with_parameters(**{search.parameter: value}).turn()
        except (SimulationError, InitialStateError) as error:
            return str(error).partition("\n")[0]
        finally:
            done()

    good, bad = search.start, search.stop
    turn = through(good)
    if isinstance(turn, str):
        raise ModelError(
            f"the limit of {search.parameter} is looked for from {search.in_unit(good):g} {search.unit}, "
            f"where the loop cannot go through its range: {turn}\n  Start from a value at which it can."
        )
    beyond = through(bad)
    if isinstance(beyond, Turn):
        return Limit(search, None, 0.0, beyond.closure, beyond.statistics["least_singular"], "")
    for _ in range(STEPS - 2):
        middle = (good + bad) / 2
        found = through(middle)
        if isinstance(found, Turn):
            good, turn = middle, found
        else:
            bad, beyond = middle, found
    return Limit(search, good, abs(bad - good), turn.closure, turn.statistics["least_singular"], beyond)
