"""Evaluation plans from the ``studies`` of a scene, with values parsed and names checked."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from symgen.errors import SceneError, nearest
from symgen.scene.reading import Values
from symgen.scene.schema import Scene
from symgen.scene.units import is_quantity, parse_quantity


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter value, as text and in SI units."""

    parameter: str
    text: str
    value: float

    def __str__(self) -> str:
        return f"{self.parameter} = {self.text}"


@dataclass(frozen=True, slots=True)
class Search:
    """Search range for the limit of a parameter, and the display unit: its name and size in SI."""

    parameter: str
    start: float
    stop: float
    unit: str
    size: float

    def in_unit(self, value: float) -> float:
        """Return a value in the display unit."""
        return value / self.size


@dataclass(frozen=True, slots=True)
class Plan:
    """A study: one case for every combination of the varied values."""

    name: str
    about: str
    changes: Mapping[str, Any]
    cases: tuple[tuple[Setting, ...], ...]
    plots: tuple[str, ...]
    searches: tuple[Search, ...]


def plans(scene: Scene) -> tuple[Plan, ...]:
    """Return the studies of a scene.

    Raises
    ------
    SceneError
        If there are none, two have the same name, a parameter is unknown or not tunable, or a value is
        invalid; with table and key.
    """
    try:
        if not scene.studies:
            raise SceneError(
                "there are no studies in this scene",
                where="studies",
                hint="Write [[studies]] with name, vary, and plots or limits; slider_crank has some.",
            )
        read = Values(scene)
        found: list[Plan] = []
        for i, study in enumerate(scene.studies):
            where = f"studies.{i}"
            if any(study.name == other.name for other in found):
                raise SceneError(f"there are two studies called {study.name!r}", where=f"{where}.name")
            if not study.plots and not study.limits:
                raise SceneError("expected plots to draw, or limits to look for", where=f"{where}.plots")
            varied = [
                [_setting(read, name, text, f"{where}.vary.{name}.{k}") for k, text in enumerate(texts)]
                for name, texts in study.vary.items()
            ]
            found.append(
                Plan(
                    study.name,
                    study.about or study.name,
                    study.set,
                    tuple(itertools.product(*varied)),
                    tuple(dict.fromkeys(study.plots)),
                    tuple(
                        _search(read, limit, study.vary, f"{where}.limits.{k}")
                        for k, limit in enumerate(study.limits)
                    ),
                )
            )
    except SceneError as error:
        raise error.located(file=scene.file) from None
    return tuple(found)


def _setting(read: Values, parameter: str, text: Any, where: str) -> Setting:
    """Parse the value of a tunable parameter."""
    tunable = {p.quantity.name: p.quantity for p in read.parameters}
    if parameter not in tunable:
        known = parameter in read.names
        problem = "is not tunable" if known else "is not there"
        hint = "Write 'tunable = true' at it under [parameters]." if known else nearest(parameter, tunable)
        raise SceneError(f"the parameter {parameter!r} {problem}", where=where.rpartition(".")[0], hint=hint)
    value = read.value(text, read.names[parameter][1], where)
    return Setting(parameter, str(text), read.number(value))


def _search(read: Values, limit: Any, varied: Mapping[str, Any], where: str) -> Search:
    if limit.parameter in varied:
        raise SceneError(
            f"{limit.parameter!r} varies in this study, so its limit cannot be looked for",
            where=f"{where}.parameter",
        )
    start = _setting(read, limit.parameter, limit.start, f"{where}.start")
    stop = _setting(read, limit.parameter, limit.stop, f"{where}.stop")
    if start.value == stop.value:
        raise SceneError(
            f"expected another value than that of start, got {limit.stop!r}", where=f"{where}.stop"
        )
    unit, size = _unit_of(stop.text) or _unit_of(start.text) or (read.names[limit.parameter][1].unit, 1.0)
    return Search(limit.parameter, start.value, stop.value, unit, size)


def _unit_of(text: str) -> tuple[str, float] | None:
    """Return the unit of a quantity and its size in SI units; None if it has no unit."""
    unit = text.strip().lstrip("+-.0123456789").strip()
    if not is_quantity(text) or not unit or not is_quantity(f"1 {unit}"):
        return None
    return unit, float(parse_quantity(f"1 {unit}")[0])
