"""Frequencies and shapes of elastic links in one pose; assembled matrices."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import Shown
from symgen.errors import ModelError, nearest
from symgen.runtime.arrays import Array

#: Error by elements above which a frequency is not to be trusted.
COARSE = 0.05


def relative(values: Array, exact: Array) -> Array:
    """Return found/exact - 1; zero where exact is zero."""
    return np.asarray(np.divide(values, exact, out=np.ones_like(exact), where=exact > 0.0) - 1.0)


@checked
@dataclass(frozen=True, repr=False)
class ElasticModes(Shown):
    """Modes of the structure in one pose of its rigid links, by rising frequency.

    Attributes
    ----------
    angle, t
        Angle of the crank [rad]; in space, without a crank, the time of the pose [s].
    frequencies
        [Hz].
    shapes
        (unknowns, modes) in the order of ``names``, on fixed axes: of unit modal mass; in motion complex,
        with the largest component 1.
    growth
        Growth rate of each mode in motion [1/s], negative if it decays; empty at rest.
    without_reduction
        If links are reduced: as many of the lowest frequencies [Hz] without reduction, and the number of
        unknowns without it. Otherwise empty, and the same number.
    estimate
        Function that computes ``errors_of_elements``.
    rigid
        Number of rigid modes, which come first: the nullity of the stiffness at rest.
    ratios
        Damping of each mode at rest over its critical damping, without coupling of modes; zero for rigid
        modes. The ``damping.ratio`` of a link refers to modes of the link with free ends.
    elements
        Number of elements of each elastic link, before a reduction.
    """

    name: str
    angle: float
    frequencies: Array
    shapes: NDArray[Any]
    names: tuple[str, ...]
    growth: Array = field(default_factory=lambda: np.zeros(0))
    without_reduction: tuple[Array, int] | None = None
    estimate: Callable[[], Array] | None = None
    rigid: int = 0
    ratios: Array = field(default_factory=lambda: np.zeros(0))
    t: float | None = None
    elements: Mapping[str, int] = field(default_factory=dict)

    @property
    def pose(self) -> str:
        """The pose in words."""
        return f"{math.degrees(self.angle):.6g} deg" if self.t is None else f"{self.t:.6g} s"

    def __repr__(self) -> str:
        first_three = ", ".join(f"{f:.6g}" for f in self.frequencies[:3].tolist())
        more = ", ..." if len(self.frequencies) > 3 else ""
        count = len(self.frequencies)
        return f"<ElasticModes {self.name!r} at {self.pose}: {first_three}{more} Hz, {count} modes>"

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "errors_of_elements": self.errors_of_elements, "estimate": None}

    @cached_property
    def errors_of_elements(self) -> Array:
        """Relative errors of frequencies by elements: ratio to those of halved elements, less one.

        The first request, also by printing, solves the structure with halved elements. The error of a zero
        frequency is zero. Empty beyond 400 unknowns.
        """
        return self.estimate() if self.estimate else np.zeros(0)

    @property
    def coarse(self) -> NDArray[np.bool_]:
        """Whether the error of each frequency by elements exceeds 5 %; False where it is unknown."""
        exceeds = np.zeros(len(self.frequencies), dtype=bool)
        exceeds[: len(self.errors_of_elements)] = np.abs(self.errors_of_elements) > COARSE
        return exceeds

    @property
    def errors(self) -> Array:
        """Relative errors of frequencies by the reduction of links; empty if no link is reduced.

        The error of a zero frequency is zero.
        """
        if self.without_reduction is None:
            return np.zeros(0)
        exact = self.without_reduction[0]
        return relative(self.frequencies[: len(exact)], exact)

    def summary(self) -> dict[str, Any]:
        """Return the modes in plain numbers: the output of ``symgen modes --json``."""
        content: dict[str, Any] = {
            "scene": self.name,
            "analysis": "modes",
            **({"angle": self.angle} if self.t is None else {"t": self.t}),
            "elements": dict(self.elements),
            "unknowns": len(self.frequencies),
            "frequencies_hz": self.frequencies.tolist(),
        }
        if np.any(self.ratios):
            content["damping_ratios"] = self.ratios.tolist()
        if len(self.growth):
            content["growth_per_s"] = self.growth.tolist()
        if len(self.errors_of_elements):
            content["errors_of_elements"] = self.errors_of_elements.tolist()
        if self.without_reduction is not None:
            content["unknowns_without_reduction"] = self.without_reduction[1]
            content["errors_of_reduction"] = self.errors.tolist()
        return content


#: Units of unknowns by their letter; those of joints are displacements.
_UNITS = {"u": "m", "w": "m", "mid": "m", "theta": "rad", "gamma": "rad", "kappa": "1/m"}


@dataclass(frozen=True, slots=True)
class LabelledMatrix:
    """A matrix or vector with the names and units of its rows and columns; a vector has no columns.

    ``unit`` is that of entries between displacements, with the factors for others.
    """

    name: str
    values: Array
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    unit: str
    about: str

    @property
    def row_units(self) -> tuple[str, ...]:
        """Unit of each row's unknown."""
        return tuple(map(unit_of, self.rows))

    @property
    def column_units(self) -> tuple[str, ...]:
        """Unit of each column's unknown."""
        return tuple(map(unit_of, self.columns))

    def part(self, rows: Sequence[str] = (), columns: Sequence[str] = ()) -> LabelledMatrix:
        """Return some rows and columns, by name or by number from 1; all of them if none is given.

        Raises
        ------
        ModelError
            When there is no such row or column.
        """
        i = self._numbers("row", rows, self.rows)
        j = self._numbers("column", columns, self.columns)
        values = self.values[np.ix_(i, j)] if self.columns else self.values[i]
        return replace(
            self,
            values=values,
            rows=tuple(self.rows[k] for k in i),
            columns=tuple(self.columns[k] for k in j),
        )

    def _numbers(self, kind: str, selected: Sequence[str], names: Sequence[str]) -> list[int]:
        for name in selected:
            if name not in names and not (name.isdecimal() and 0 < int(name) <= len(names)):
                raise ModelError(f"matrix {self.name} has no {kind} {name!r}. {nearest(name, names)}")
        return [names.index(x) if x in names else int(x) - 1 for x in selected] or [*range(len(names))]

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.values.shape))
        return f"<{self.name}: {self.about}, {shape} [{self.unit}]>"


class AssembledMatrices(dict[str, LabelledMatrix]):
    """Matrices by name; a missing name is a ModelError with the nearest one."""

    def __missing__(self, name: str) -> LabelledMatrix:
        raise ModelError(f"there is no assembled matrix {name!r}. {nearest(name, self)}")


def unit_of(unknown: str) -> str:
    """Return the unit of an unknown, ``A.x`` or ``coupler.theta@1``; empty of a station."""
    if "." not in unknown:
        return ""
    last = unknown.rpartition(".")[2] if "@" not in unknown else unknown.partition("@")[0].rpartition(".")[2]
    return "m" if last in ("x", "y") else _UNITS.get(last.rstrip("0123456789"), "1")
