"""Bounds of quantities of the linkages found, and the classes allowed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from symgen.errors import SceneError, nearest
from symgen.scene.expressions import parse_any, parse_value
from symgen.scene.faults import at
from symgen.scene.units import LENGTH, NUMBER

#: Quantities of every linkage whose crank turns, besides those of limit positions.
_TRANSMISSION = {"transmission_minimum": "rad", "transmission_maximum": "rad"}
#: Quantities that are known without limit positions, besides lengths.
_OF_REVOLUTIONS = ("swing", "stroke", "time_ratio")
_LENGTHS = ("crank", "coupler", "rocker", "fixed_link", "offset")
#: Part of a bound by which a value may miss it: rounding of a linkage at the bound.
_ROUNDING = 1e-9
_SHOWN = {"rad": ("deg", math.radians(1.0)), "m": ("m", 1.0)}


@dataclass(frozen=True, slots=True)
class Bound:
    """A quantity of a linkage, or an expression of some, with its range.

    Attributes
    ----------
    name, needs, value
        The expression, the quantities in it, and the function of their values.
    least, greatest
        The range in SI units, infinite where there is no bound.
    unit
        That of messages, and its size in SI.
    """

    name: str
    needs: tuple[str, ...]
    value: Callable[..., float]
    least: float
    greatest: float
    unit: tuple[str, float]

    def of(self, values: Mapping[str, float]) -> float:
        """Return the value; nan where the linkage does not have all quantities."""
        if not all(name in values for name in self.needs):
            return math.nan
        with np.errstate(all="ignore"):
            return float(self.value(*(np.float64(values[name]) for name in self.needs)))

    def missed(self, value: float) -> float:
        """Return the distance of a value from the range; nan for nan."""
        off = max(self.least - value, value - self.greatest, 0.0) if not math.isnan(value) else math.nan
        return 0.0 if off <= _ROUNDING * max(1.0, abs(value)) else off

    def text(self, values: list[float]) -> str:
        """Return the nearest of the values, and the bound that it misses."""
        known = [x for x in values if not math.isnan(x)]
        if not known:
            return f"{self.name}: no crank makes a full revolution"
        best = min(known, key=self.missed)
        name, size = self.unit
        side, bound = ("least", self.least) if best < self.least else ("most", self.greatest)
        shown, required = (f"{x / size:.6g} {name}".strip() for x in (best, bound))
        return f"{self.name} is {shown} at best, expected at {side} {required}"


@dataclass(frozen=True, slots=True)
class DesignConstraints:
    """What a task requires of the linkages found, beyond the values that it prescribes."""

    bounds: tuple[Bound, ...]
    classes: tuple[str, ...]

    def missed(self, linkage: Any, quantities: Mapping[str, float]) -> list[str]:
        """Return the names of the constraints that a linkage with these measures misses."""
        values = {**linkage.lengths, **_coordinates(linkage), **quantities}
        names = [x.name for x in self.bounds if x.missed(x.of(values)) != 0.0]
        return [*names, *(["classes"] if self.classes and linkage.grashof not in self.classes else [])]

    def why(self, designs: list[Any]) -> Iterator[str]:
        """Yield, for each constraint that no linkage meets, the value that is nearest."""
        every = [{**d.linkage.lengths, **_coordinates(d.linkage), **d.quantities} for d in designs]
        for bound in self.bounds:
            values = [bound.of(x) for x in every]
            if not any(bound.missed(x) == 0.0 for x in values):
                yield bound.text(values)
        found = sorted({d.linkage.grashof for d in designs})
        if self.classes and not {*found} & {*self.classes}:
            yield f"classes are {', '.join(found)}, expected {' or '.join(self.classes)}"


def read(
    task: Any, quantities: tuple[tuple[str, str, str], ...], classes: tuple[str, ...]
) -> DesignConstraints:
    """Return the constraints of a task, whose linkages have quantities at limit positions, and classes.

    Raises
    ------
    SceneError
        For an unknown quantity or class, a bound of another dimension, or a range without values.
    """
    for i, name in enumerate(task.classes or ()):
        if name not in classes:
            hint = nearest(name, classes)
            raise SceneError(
                f"expected a class of {task.linkage}, got {name!r}", where=f"classes.{i}", hint=hint
            )
    units = {n: u for n, u, _ in quantities if task.kind == "limits" or n in (*_LENGTHS, *_OF_REVOLUTIONS)}
    on_sphere = task.linkage == "spherical"
    points = "O" if task.linkage == "slider-crank" else "OC"
    places = {p + axis: "1" if on_sphere else "m" for p in points for axis in ("xyz" if on_sphere else "xy")}
    units |= _TRANSMISSION | places
    names = {n: (sp.Symbol(n, real=True), LENGTH if unit == "m" else NUMBER) for n, unit in units.items()}
    bounds = []
    for name, bound in task.constraints.items():
        with at(f"constraints.{name}"):
            bounds.append(_bound(name, bound, names, units))
    return DesignConstraints(tuple(bounds), tuple(task.classes or ()))


def _bound(name: str, bound: Any, names: Mapping[str, Any], units: Mapping[str, str]) -> Bound:
    expression, dim = parse_any(name, names)
    needs = sorted(str(x) for x in expression.free_symbols)
    if not needs:
        raise SceneError(
            f"expected a quantity of the linkages, got {name!r}", hint=f"Known: {', '.join(units)}."
        )
    ends = [-math.inf, math.inf]
    for i, end in enumerate(("least", "greatest")):
        if getattr(bound, end) is not None:
            with at(end):
                ends[i] = float(parse_value(getattr(bound, end), {}, dim))
    if ends == [-math.inf, math.inf]:
        raise SceneError("expected least, greatest or both, got no bound")
    if ends[0] > ends[1]:
        raise SceneError(
            f"expected a least value up to the greatest, got {ends[0]:g} and {ends[1]:g} in SI units"
        )
    value = sp.lambdify([names[n][0] for n in needs], expression, [{"Sign": np.sign}, "numpy"])
    unit = units.get(name, "m" if dim == LENGTH else "1")
    return Bound(name, tuple(needs), value, ends[0], ends[1], _SHOWN.get(unit, ("", 1.0)))


def _coordinates(linkage: Any) -> dict[str, float]:
    """Return the coordinates of the ground points [m], or of ground axes on the unit sphere."""
    points = [p for p in "OC" if p in linkage.JOINTS]
    return {p + a: float(x) for p in points for a, x in zip("xyz", getattr(linkage, p), strict=False)}
