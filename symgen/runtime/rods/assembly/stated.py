"""Starts beside their scene: stated values of a user-defined system are held; notes on what had to move."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symgen.runtime._start import size_of_points
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.newton import corrected
from symgen.runtime.result.records import converters, with_unit

#: Steps of the path from the values as stated to the constraints, and corrections of each.
_STEPS, _CORRECTIONS = 16, 12
#: Slopes below this part of the largest are zero.
_DEPENDENT = 1e-9
#: Relative change of a value that is not rounding.
_MOVED = 1e-9
#: Distance of a point from the drawing, over the size of the linkage, of which a note informs.
_OFF = 0.01


def held(evaluator: Evaluator, drawn: Array) -> Array | None:
    """Return the start at which the stated coordinates keep their values, if there is one.

    The others are led from zero along the path on which all errors of the constraints vanish alike.
    """
    d = evaluator.description
    others = [i for i, name in enumerate(d.free) if name not in d.given]
    if not (d.given and others):
        return None
    q: Array | None = drawn
    for fraction in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
        q = None if q is None else _led(evaluator, q, others, float(fraction))
    return q


def _led(evaluator: Evaluator, q: Array, others: list[int], fraction: float) -> Array | None:
    """Return the coordinates at a fraction of the path, moved by the ``others`` alone."""
    at = np.append(fraction, np.zeros(len(q) - 1))

    def residual(q: Array) -> Array:
        return evaluator.blocks("assembly", 0.0, q, at)["assembly_residual"].ravel()

    def change(q: Array, missed: Array) -> Array:
        slopes = evaluator.blocks("assembly", 0.0, q, at)["assembly_jacobian"][:, others]
        step = np.zeros_like(q)
        step[others] = -np.linalg.lstsq(slopes, missed, rcond=_DEPENDENT)[0]
        return step

    def size(q: Array) -> float:
        return max(1.0, float(np.max(np.abs(q))))

    return corrected(q, change, size, _CORRECTIONS, residual=residual)


def moved(evaluator: Evaluator, q: Array) -> Iterator[str]:
    """Yield the note on a start q that is not as the scene states or draws it."""
    if evaluator.description.given:
        yield from _moved_values(evaluator, q)
    elif evaluator.description.drawn and evaluator.has("assembly"):
        yield from _moved_points(evaluator, q)


def _moved_points(evaluator: Evaluator, q: Array) -> Iterator[str]:
    """Yield the note on points that lengths and drives move off the drawing; start angles may do so."""
    d, info, still = evaluator.description, evaluator.info("assembly"), np.zeros(len(q))
    rows = (row.split(" ") for row in info.blocks[0].rows)
    if any(words[-1] == "angle" and f"{words[0]}_drive" not in d.constraints for words in rows):
        return
    drawn, start = (
        evaluator.blocks("points", 0.0, x, still)["positions"][: d.drawn]
        for x in (evaluator("drawn", 0.0, still, still), q)
    )
    distances = np.linalg.norm(start - drawn, axis=1)
    farthest = int(np.argmax(distances))
    if distances[farthest] > _OFF * float(size_of_points(drawn)):
        unit, size = converters(d.units).get("m", ("m", 1.0))
        yield (
            f"the start is not as drawn: lengths or drives at t = 0 move {d.points[farthest]} the farthest, "
            f"by {with_unit(float(distances[farthest]) / size, unit)}"
        )


def _moved_values(evaluator: Evaluator, q: Array) -> Iterator[str]:
    d = evaluator.description
    zero = np.zeros(len(q))
    of = dict(zip(d.free, zip(evaluator("drawn", 0.0, zero, zero), q, strict=True), strict=True))
    changes = {x: (a, b) for x in d.given for a, b in [of[x]] if abs(b - a) > _MOVED * max(1, abs(a), abs(b))}
    if changes:
        outputs = d.kernel("outputs")
        units = {b.name: b.unit for b in outputs.blocks} if outputs else {}
        what = ", ".join(f"{x} from {a:.9g} to {b:.9g} {units.get(x, '')}" for x, (a, b) in changes.items())
        lacking = [x for x in d.free if x not in d.given]
        why = f", since {', '.join(lacking)} cannot follow from zero: give a value" if lacking else ""
        yield f"at the start the constraints move values of the system to the nearest pose: {what}{why}"
