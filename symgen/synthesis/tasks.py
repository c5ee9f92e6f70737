"""The table [synthesis] of a file: prescribed properties of a four-bar, in SI units."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from symgen.errors import SceneError, nearest
from symgen.mechanics.synthesis.limits import QUANTITIES
from symgen.scene.expressions import parse_value
from symgen.scene.faults import scene_error
from symgen.scene.loading import read_scene
from symgen.scene.reading import at
from symgen.scene.table import Table, Text, Value, absent
from symgen.scene.units import LENGTH, NUMBER, Dimension

Array = NDArray[np.float64]

Starts = Annotated[int, Field(ge=1, le=1_000_000, description="Number of random starts of the search.")]
Seed = Annotated[int, Field(ge=0, description="Seed of the starts: the same seed gives the same results.")]
Pair = Annotated[list[Value], Field(min_length=2, max_length=2)]
Values = Annotated[list[Value], Field(min_length=2, max_length=100)]


class LimitTask(Table):
    """Limit positions and transmission angles of a crank-rocker: four of these quantities."""

    kind: Literal["limits"]
    crank: Value | None = None
    coupler: Value | None = None
    rocker: Value | None = None
    fixed_link: Value | None = None
    swing: Value | None = None
    crank_extended: Value | None = None
    rocker_extended: Value | None = None
    transmission_extended: Value | None = None
    crank_folded: Value | None = None
    rocker_folded: Value | None = None
    transmission_folded: Value | None = None
    transmission_least: Value | None = None
    transmission_greatest: Value | None = None
    starts: Starts = 60
    seed: Seed = 0

    def given(self) -> dict[str, float]:
        """Return the prescribed quantities [m, rad]."""
        units = {name: LENGTH if unit == "m" else NUMBER for name, unit, _ in QUANTITIES}
        return {n: value(getattr(self, n), d, n) for n, d in units.items() if getattr(self, n) is not None}


class FunctionTask(Table):
    """Rotations of the rocker that belong to rotations of the crank."""

    kind: Literal["function"]
    input: Values = Field(description="Rotations of the crank.")
    output: Values = Field(description="Rotations of the rocker.")
    fixed_link: Value = "1 m"
    crank_start: Value | None = absent("Direction of the crank where its rotation is zero.")
    rocker_start: Value | None = absent("Direction of the rocker where its rotation is zero.")
    starts: Starts = 200
    seed: Seed = 0


class _Dyads(Table):
    ground_x: Pair | None = absent("x of the ground points of crank and rocker.")
    ground_y: Pair | None = None
    joint_x: Pair | None = absent("Places of the joints along the coupler's axis.")
    joint_y: Pair | None = None
    length: Pair | None = absent("Lengths of crank and rocker.")
    starts: Starts = 200
    seed: Seed = 0
    points: Annotated[list[Pair], Field(min_length=2, max_length=100)]

    def given(self) -> dict[str, tuple[float, float]]:
        """Return the prescribed quantities of both dyads [m]."""
        read = {n: values(getattr(self, n), LENGTH, n) for n in DYAD if getattr(self, n)}
        if "length" in read and not (read["length"] > 0).all():
            raise SceneError(f"expected lengths above zero, got {read['length'].min():g} m", where="length")
        return {n: (float(v[0]), float(v[1])) for n, v in read.items()}

    def places(self) -> Array:
        """Return the precision points (n, 2) [m]."""
        return np.array([values(p, LENGTH, f"points.{i}") for i, p in enumerate(self.points)])


#: Quantities of a dyad that may be prescribed.
DYAD = ("ground_x", "ground_y", "joint_x", "joint_y", "length")


class MotionTask(_Dyads):
    """Places and rotations that the coupler takes."""

    kind: Literal["motion"]
    angles: Values = Field(description="Rotations of the coupler.")


class PathTask(_Dyads):
    """Places that a point of the coupler passes."""

    kind: Literal["path"]


Task = LimitTask | FunctionTask | MotionTask | PathTask
_KINDS: dict[str, type[Task]] = {
    "limits": LimitTask, "function": FunctionTask, "motion": MotionTask, "path": PathTask,
}  # fmt: skip


class Document(Table):
    """A file with the table [synthesis]."""

    symgen: Literal[1]
    title: Text = ""
    synthesis: dict[str, Any]


def read_task(source: str | os.PathLike[str] | Mapping[str, Any]) -> tuple[str, Task]:
    """Return title and task of a file, or of its tables in Python.

    Raises
    ------
    SceneError
        For anything wrong in it, naming file, table and key.
    """
    if isinstance(source, Mapping):
        return "", _task(dict(source), "")
    if not Path(source).is_file():
        raise SceneError(f"there is no file called {os.fspath(source)!r}", hint="See docs/synthesis.md.")
    text = read_scene(source)
    try:
        document = Document(**text.data)
        return document.title or text.name, _task(document.synthesis, "synthesis")
    except ValidationError as error:
        raise scene_error(Document, error).located(file=text.file) from None
    except SceneError as error:
        raise error.located(file=text.file) from None


def _task(table: dict[str, Any], where: str) -> Task:
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise SceneError(
            f"expected a kind of synthesis, got {kind!r}",
            where=f"{where}.kind".strip("."),
            hint=nearest(str(kind), _KINDS),
        )
    try:
        return TypeAdapter(_KINDS[kind]).validate_python(table)
    except ValidationError as error:
        raise scene_error(_KINDS[kind], error).located(where=where) from None


def value(text: str | int | float, dim: Dimension, where: str) -> float:
    """Return a quantity in SI units."""
    with at(where):
        return float(parse_value(text, {}, dim))


def values(texts: list[str | int | float], dim: Dimension, where: str) -> Array:
    """Return a list of quantities in SI units."""
    return np.array([value(text, dim, f"{where}.{i}") for i, text in enumerate(texts)])
