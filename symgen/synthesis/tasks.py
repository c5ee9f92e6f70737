"""The table [synthesis] of a file: prescribed properties of a linkage, in SI units."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError, create_model

from symgen.errors import SceneError, nearest
from symgen.mechanics.synthesis.limits import QUANTITIES, SLIDER_QUANTITIES, SPHERICAL_QUANTITIES
from symgen.scene.expressions import parse_value
from symgen.scene.faults import at, scene_error
from symgen.scene.loading import read_scene
from symgen.scene.schema import Units
from symgen.scene.table import Table, Text, Value, absent
from symgen.scene.units import LENGTH, NUMBER, Dimension, Shown, shown_units

Array = NDArray[np.float64]

#: Least and greatest size of linkages [m]: beyond them powers of lengths lose their accuracy.
SIZES = 1e-9, 1e9

Starts = Annotated[int, Field(ge=1, le=1_000_000, description="Number of random starts of the search.")]
Seed = Annotated[int, Field(ge=0, description="Seed of the starts: the same seed gives the same results.")]
Pair = Annotated[list[Value], Field(min_length=2, max_length=2)]
Vector = Annotated[list[Value], Field(min_length=3, max_length=3)]
#: A prescribed value, or the ends of a range in which the best is found.
Limit = Value | Pair
Values = Annotated[list[Value], Field(min_length=2, max_length=100)]


class QuantityBounds(Table):
    """Bounds of a quantity of the linkages."""

    least: Value | None = None
    greatest: Value | None = None


class _Search(Table):
    starts: Starts = 200
    seed: Seed = 0
    constraints: dict[str, QuantityBounds] = Field(
        default_factory=dict, description="Bounds by quantity of the linkages, or expression of quantities."
    )
    classes: Annotated[list[str], Field(min_length=1)] | None = absent("Classes of the linkages allowed.")


class LimitTask(_Search):
    """Limit positions and transmission angles: as many quantities as determine the linkage."""

    QUANTITIES: ClassVar[tuple[tuple[str, str, str], ...]] = ()

    kind: Literal["limits"]
    linkage: str
    starts: Starts = 60

    def prescribed(self) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
        """Return the prescribed quantities [m, rad], and ranges of others."""
        fixed, ranges = {}, {}
        for name, unit, _ in self.QUANTITIES:
            written, dim = getattr(self, name), LENGTH if unit == "m" else NUMBER
            if isinstance(written, list):
                low, high = values(written, dim, name)
                ranges[name] = float(low), float(high)
            elif written is not None:
                fixed[name] = value(written, dim, name)
        return fixed, ranges


def _limits(quantities: tuple[tuple[str, str, str], ...], linkage: Any) -> type[LimitTask]:
    """Return the task of a linkage: each of its quantities is a key; ``linkage`` is type and default."""
    keys: dict[str, Any] = {name: (Limit | None, None) for name, *_ in quantities}
    task = create_model("LimitTask", __base__=LimitTask, linkage=linkage, **keys)
    task.QUANTITIES = quantities
    return task


class FunctionTask(_Search):
    """Rotations of the rocker that belong to rotations of the crank."""

    kind: Literal["function"]
    linkage: Literal["four-bar"] = "four-bar"
    input: Values = Field(description="Rotations of the crank.")
    output: Values = Field(description="Rotations of the rocker.")
    fixed_link: Value = "1 m"
    crank_start: Value | None = absent("Direction of the crank where its rotation is zero.")
    rocker_start: Value | None = absent("Direction of the rocker where its rotation is zero.")


class SliderFunctionTask(_Search):
    """Ways of the slider that belong to rotations of the crank."""

    kind: Literal["function"]
    linkage: Literal["slider-crank"]
    input: Values = Field(description="Rotations of the crank.")
    output: Values = Field(description="Ways of the slider.")
    crank_start: Value | None = absent("Angle of the crank from the guide where its rotation is zero.")
    slider_start: Value | None = absent("Position of the slider along the guide where its way is zero.")


class SphericalFunctionTask(_Search):
    """Rotations of the rocker of a spherical four-bar that belong to rotations of its crank."""

    kind: Literal["function"]
    linkage: Literal["spherical"]
    input: Values = Field(description="Rotations of the crank.")
    output: Values = Field(description="Rotations of the rocker.")
    crank_start: Value | None = absent("Angle of the crank from the fixed link where its rotation is zero.")
    rocker_start: Value | None = absent("Angle of the rocker where its rotation is zero.")


class _Points(_Search):
    points: Annotated[list[Pair], Field(min_length=2, max_length=100)]

    def places(self) -> Array:
        """Return the precision points (n, 2) [m]."""
        return np.array([values(p, LENGTH, f"points.{i}") for i, p in enumerate(self.points)])


class _FourBar(_Points):
    linkage: Literal["four-bar"] = "four-bar"
    ground_x: Pair | None = absent("x of the ground points of crank and rocker.")
    ground_y: Pair | None = None
    joint_x: Pair | None = absent("Places of the joints along the coupler's axis.")
    joint_y: Pair | None = None
    length: Pair | None = absent("Lengths of crank and rocker.")

    def prescribed(self) -> list[dict[str, float]]:
        """Return the prescribed quantities of both dyads [m]."""
        return _of_sides(self, DYAD)


class _SliderCrank(_Points):
    linkage: Literal["slider-crank"]
    ground_x: Value | None = absent("x of the ground point of the crank.")
    ground_y: Value | None = None
    joint_x: Value | None = absent("Place of the crank's joint along the coupler's axis.")
    joint_y: Value | None = None
    length: Value | None = absent("Length of the crank.")
    guide_angle: Value | None = absent("Direction of the guide.")
    guide_offset: Value | None = absent(
        "Distance of the guide from the origin, to the left of its direction."
    )
    slider_x: Value | None = absent("Place of the slider along the coupler's axis.")
    slider_y: Value | None = None

    def prescribed(self) -> list[dict[str, float]]:
        """Return the prescribed quantities of crank and slider [m, rad]."""
        units = dict.fromkeys((*DYAD, *SLIDE), LENGTH) | {"guide_angle": NUMBER}
        read = {n: value(getattr(self, n), d, n) for n, d in units.items() if getattr(self, n) is not None}
        _positive(read)
        return [{n: x for n, x in read.items() if n in side} for side in (DYAD, SLIDE)]


def _of_sides(task: Table, names: tuple[str, ...], dim: Dimension = LENGTH) -> list[dict[str, float]]:
    read = {n: values(getattr(task, n), dim, n) for n in names if getattr(task, n)}
    sides = [{n: float(x[side]) for n, x in read.items()} for side in (0, 1)]
    for side in sides:
        _positive(side)
    return sides


def _positive(read: dict[str, float]) -> None:
    for name, unit in (("length", "m"), ("arc", "rad")):
        if name in read and not read[name] > 0:
            raise SceneError(f"expected {name}s above zero, got {read[name]:g} {unit}", where=name)


#: Quantities of a dyad that may be prescribed; of a slider; and of a dyad on a sphere.
DYAD = ("ground_x", "ground_y", "joint_x", "joint_y", "length")
SLIDE = ("guide_angle", "guide_offset", "slider_x", "slider_y")
SPHERICAL_DYAD = ("ground_azimuth", "ground_elevation", "joint_azimuth", "joint_elevation", "arc")


class MotionTask(_FourBar):
    """Places and rotations that the coupler takes."""

    kind: Literal["motion"]
    angles: Values = Field(description="Rotations of the coupler.")


class SliderMotionTask(_SliderCrank):
    """Places and rotations that the coupler of a slider-crank takes."""

    kind: Literal["motion"]
    angles: Values = Field(description="Rotations of the coupler.")


class SphericalMotionTask(_Search):
    """Rotations in space that the coupler takes about the centre of a spherical four-bar."""

    kind: Literal["motion"]
    linkage: Literal["spherical"]
    rotations: Annotated[
        list[Annotated[list[Value], Field(min_length=3, max_length=3)]], Field(min_length=2, max_length=100)
    ]
    ground_azimuth: Pair | None = absent("Angles of the ground's axes of crank and rocker about z, from x.")
    ground_elevation: Pair | None = absent("Their angles from the plane of x and y.")
    joint_azimuth: Pair | None = absent("The same of the coupler's axes before the rotations.")
    joint_elevation: Pair | None = None
    arc: Pair | None = absent("Arcs of crank and rocker.")

    def prescribed(self) -> list[dict[str, float]]:
        """Return the prescribed quantities of both dyads [rad]."""
        return _of_sides(self, SPHERICAL_DYAD, NUMBER)


class PathTask(_FourBar):
    """Places that a point of the coupler passes."""

    kind: Literal["path"]


class SliderPathTask(_SliderCrank):
    """Places that a point of the coupler of a slider-crank passes."""

    kind: Literal["path"]


Task = (
    LimitTask | FunctionTask | SliderFunctionTask | SphericalFunctionTask
    | MotionTask | SliderMotionTask | SphericalMotionTask | PathTask | SliderPathTask
)  # fmt: skip
_KINDS: dict[str, dict[str, type[Task]]] = {
    "limits": {
        "four-bar": _limits(QUANTITIES, (Literal["four-bar"], "four-bar")),
        "slider-crank": _limits(SLIDER_QUANTITIES, (Literal["slider-crank"], ...)),
        "spherical": _limits(SPHERICAL_QUANTITIES, (Literal["spherical"], ...)),
    },
    "function": {
        "four-bar": FunctionTask,
        "slider-crank": SliderFunctionTask,
        "spherical": SphericalFunctionTask,
    },
    "motion": {"four-bar": MotionTask, "slider-crank": SliderMotionTask, "spherical": SphericalMotionTask},
    "path": {"four-bar": PathTask, "slider-crank": SliderPathTask},
}  # fmt: skip


class Document(Table):
    """A file with the table [synthesis]."""

    symgen: Literal[1]
    title: Text = ""
    units: Units = Units()
    synthesis: dict[str, Any]


class Head(NamedTuple):
    """Title of a file, and the units in which its results are shown."""

    title: str
    units: Shown


def read_task(source: str | os.PathLike[str] | Mapping[str, Any]) -> tuple[Head, Task]:
    """Return head and task of a file, or of the table in Python.

    Raises
    ------
    SceneError
        For anything wrong in it, naming file, table and key.
    """
    if isinstance(source, Mapping):
        return Head("", {}), _task(dict(source), "")
    if not Path(source).is_file():
        raise SceneError(f"there is no file called {os.fspath(source)!r}", hint="See docs/synthesis.md.")
    text = read_scene(source)
    if "synthesis" not in text.data:
        hint = "Write the table [synthesis] with its kind; see docs/synthesis.md."
        raise SceneError("there is no synthesis in this file", file=text.file, hint=hint)
    try:
        document = Document(**text.data)
        head = Head(document.title or text.name, shown_units(document.units))
        return head, _task(document.synthesis, "synthesis")
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
    linkage = table.get("linkage", "four-bar")
    if not isinstance(linkage, str) or linkage not in _KINDS[kind]:
        raise SceneError(
            f"expected a linkage for {kind!r}, got {linkage!r}",
            where=f"{where}.linkage".strip("."),
            hint=nearest(str(linkage), _KINDS[kind]),
        )
    model = _KINDS[kind][linkage]
    try:
        return TypeAdapter(model).validate_python(table)
    except ValidationError as error:
        raise scene_error(model, error).located(where=where) from None


def value(text: str | int | float, dim: Dimension, where: str) -> float:
    """Return a quantity in SI units; lengths up to the largest."""
    with at(where):
        number = float(parse_value(text, {}, dim))
    if dim == LENGTH and abs(number) > SIZES[1]:
        raise SceneError(f"expected at most {SIZES[1]:g} m, got {number:g} m", where=where)
    return number


def values(texts: list[str | int | float], dim: Dimension, where: str) -> Array:
    """Return a list of quantities in SI units."""
    return np.array([value(text, dim, f"{where}.{i}") for i, text in enumerate(texts)])
