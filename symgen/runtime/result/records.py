"""Records of a result: coordinate, outputs, drift and events."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import nearest, no_component
from symgen.runtime.arrays import Array

if TYPE_CHECKING:
    import xarray

    from symgen.runtime.kernels.description import Described

#: Index of a coordinate, and its variable, each by its name.
Indexed = tuple[dict[str, Any], dict[str, Any]]
#: Range of an energy over the energy exchanged below which plots show it as constant.
_FLAT = 1e-6
_SI = {"length": ("m", 1.0), "force": ("N", 1.0), "angle": ("rad", 1.0)}
#: Names of strains, also of their reductions in sweeps, and the unit in which they are shown.
_STRAIN, _MICRO = re.compile(r"(^|[._])strain(_[yz])?(\.|$)"), ("microstrain", 1e-6)
#: Unit in which stresses are shown where the scene selects none.
_STRESS = ("MPa", 1e6)
#: Quantities of outputs whose names have one word, such as joint variables.
_OF_ONE_WORD = {"rad": "angle", "m": "length"}
#: Attribute of datasets of many runs, whose values are in SI.
_DISPLAY_UNITS = "display_units"
#: Attribute of a parameter that is shown in the unit in which it is written: name, and size in SI.
WRITTEN_UNIT = "written_unit"


@dataclass(frozen=True, slots=True)
class Coordinate:
    """The coordinate of a result, over which every output is recorded.

    Attributes
    ----------
    name
        ``time``, the name of an input, ``angle`` (of a crank) or ``speed`` (of a crank).
    unit
        Its unit in SI: s, rad, m or rad/s.
    about
        Its name in the labels of plots.
    values
        Its values, in the order in which they were recorded; not necessarily increasing.
    """

    name: str
    unit: str
    about: str
    values: Array


def over_time(times: Array) -> Coordinate:
    """Return the coordinate of a result over time [s]."""
    return Coordinate("time", "s", "time", times)


@dataclass(frozen=True, slots=True)
class Variable:
    """One recorded output: ``values[i]`` at coordinate i, with a column per name in ``components``."""

    name: str
    unit: str
    about: str
    components: tuple[str, ...]
    values: Array

    def of(self, values: Array) -> Variable:
        """Return the same output with other values; ``replace`` takes three times as long."""
        return Variable(self.name, self.unit, self.about, self.components, values)

    def component(self, name: str) -> Variable:
        """Return a component as an output of its own, such as ``C.position.x``."""
        values = self.values[..., self.components.index(name)]
        return Variable(f"{self.name}.{name}", self.unit, self.about, (), values)

    @property
    def names(self) -> tuple[str, ...]:
        """Its name, and those of its components."""
        return (self.name, *(f"{self.name}.{c}" for c in self.components))


def columns(variables: Sequence[Variable]) -> tuple[Variable, ...]:
    """Return every component of outputs as an output of its own."""
    return tuple(v.component(c) if c else v for v in variables for c in v.components or ("",))


def found(variables: Iterable[Variable], names: Iterable[str]) -> dict[str, tuple[Variable, str]]:
    """Return the outputs of some names, each with its component or an empty text; without unknown names.

    Outputs behind the last one that is needed are not computed.
    """
    missing, known = {*names}, dict[str, tuple[Variable, str]]()
    for v in variables if missing else ():
        of_parts = dict(zip(v.names, ("", *v.components), strict=True))
        known.update((name, (v, of_parts[name])) for name in missing.intersection(of_parts))
        missing -= {*of_parts}
        if not missing:
            break
    return known


def of_names(variables: Iterable[Variable], names: Iterable[str]) -> dict[str, Variable]:
    """Return the outputs, and components as outputs of their own, of some names; without unknown names."""
    return {name: v.component(c) if c else v for name, (v, c) in found(variables, names).items()}


def by_owner(variables: Sequence[Variable], names: Iterable[str]) -> dict[str, dict[str, Variable]]:
    """Return the outputs of each name, by their names: of a point, link or joint all, of others those known.

    The outputs of B are B.position, B.velocity and so on.
    """
    names = tuple(names)
    named = of_names(variables, names)
    return {
        name: {name: named[name]}
        if name in named
        else {v.name: v for v in variables if v.name.startswith(f"{name}.")}
        for name in names
    }


def unknown(name: str, variables: Iterable[Variable], others: Iterable[str] = ()) -> str:
    """Return a hint on the name of an output that is not there: its components, or the nearest name."""
    known = {v.name: v for v in variables}
    owner, _, last = name.rpartition(".")
    if owner in known and len(last) == 1:
        return no_component(owner, last, known[owner].components) + "."
    return nearest(name, [*others, *known])


class LazyStatistics(dict[str, Any]):  # noqa: PLW1641 - dicts have no hash
    """Statistics of a run; values that are functions are called, without arguments, when they are read."""

    def __getitem__(self, name: str) -> Any:
        value = super().__getitem__(name)
        if callable(value):
            value = self[name] = value()
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())  # dict(...) and ** read subclasses with an iterator of their own by key

    def get(self, name: str, default: Any = None) -> Any:
        """Return a value, or the default for a name that is not there."""
        return self[name] if name in self else default  # noqa: SIM401 - dict.get does not call functions

    def items(self) -> Any:
        """Return names and values."""
        return dict(self).items()

    def values(self) -> Any:
        """Return the values."""
        return dict(self).values()

    def __eq__(self, other: object) -> bool:
        return dict(self) == other

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[type, tuple[dict[str, Any]]]:
        return dict, (dict(self),)  # functions are not pickled


@dataclass(frozen=True, slots=True)
class Drift:
    """Drift of conserved quantities, the largest over all steps; nan where it was not measured.

    Attributes
    ----------
    constraint
        Error of a link's length [m].
    velocity
        Rate of change of a link's length [m/s].
    energy
        Change of the energy less the work of loads without potential [J].
    energy_exchanged
        Range of the kinetic or of the potential energy, the larger [J]: the scale of ``energy``.
    """

    constraint: float = math.nan
    velocity: float = math.nan
    energy: float = math.nan
    energy_exchanged: float = math.nan

    @property
    def measured(self) -> dict[str, float]:
        """The values that were measured, by name."""
        return {name: value for name, value in asdict(self).items() if not math.isnan(value)}

    def scale(self, unit: str, range_: float) -> float:
        """Return the scale on which a curve of this range is flat: the energy exchanged, or zero for none."""
        return self.energy_exchanged if unit == "J" and range_ <= _FLAT * self.energy_exchanged else 0.0

    @property
    def relative_energy(self) -> float:
        """Energy drift over the energy exchanged; zero if both are zero, nan if it was not measured."""
        if self.energy_exchanged == 0.0:
            return 0.0 if self.energy == 0.0 else float("inf")
        return self.energy / self.energy_exchanged


@dataclass(frozen=True, slots=True)
class LocatedEvent:
    """An event of the scene, located in a run.

    ``rising`` is None where its value touches zero. ``motion`` has positions [m] and velocities [m/s] of the
    points at its time, as ``Result.final``.
    """

    name: str
    time: float
    rising: bool | None
    motion: Mapping[str, Mapping[str, Any]] = field(repr=False)


def plain(data: Any) -> Any:
    """Return data for JSON: numbers, text, lists and tables; None for numbers that are not finite."""
    if isinstance(data, Mapping):
        return {str(name): plain(value) for name, value in data.items()}
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    if isinstance(data, float | np.floating):
        return float(data) if math.isfinite(data) else None
    if isinstance(data, np.generic):
        return data.item()
    return data


def converters(units: Mapping[str, tuple[str, float]]) -> dict[str, tuple[str, float]]:
    """Return name and size in SI of the unit in which an SI unit is shown, by SI unit.

    Parameters
    ----------
    units
        Those of a description, by the keys of the table ``units`` of a scene. Energies and powers have units
        of their own, J and W without one: a product such as kN*mm/s is no unit of power to a reader.
    """
    if not units:
        return {}
    (length, per_length), (force, per_force), (angle, per_angle) = (
        units.get(of, si) for of, si in _SI.items()
    )
    return {
        "m": (length, per_length),
        "m/s": (f"{length}/s", per_length),
        "m/s^2": (f"{length}/s^2", per_length),
        "rad": (angle, per_angle),
        "rad/s": (f"{angle}/s", per_angle),
        "rad/s^2": (f"{angle}/s^2", per_angle),
        "N": (force, per_force),
        "N*m": units.get("torque", (f"{force}*{length}", per_length * per_force)),
        "J": units.get("energy", ("J", 1.0)),
        "W": units.get("power", ("W", 1.0)),
        **({"Pa": units["stress"]} if "stress" in units else {}),
        "1": ("1", 1.0),
    }


def shown_in(name: str, unit: str, units: Mapping[str, tuple[str, float]]) -> tuple[str, float]:
    """Return name and size in SI of the unit in which an output is shown.

    Strains are in microstrain; stresses in MPa unless ``units``, of the form of :func:`converters`, has
    another unit.
    """
    if unit == "1" and _STRAIN.search(name):
        return _MICRO
    return units.get(unit) or (_STRESS if unit == "Pa" else (unit, 1.0))


def quantity_of(name: str, unit: str) -> str:
    """Return the quantity of an output: ``position`` of ``A.position.x``, ``energy`` of ``kinetic_energy``.

    That of a joint variable follows from its unit in SI.
    """
    words = name.strip("|").split(".")
    if len(words) > 1 and words[-1] in ("x", "y", "z"):
        words.pop()
    last = words[-1].rpartition("_")[2]
    if last in ("energy", "power"):
        return last
    return words[-1].replace("_", " ") if len(words) > 1 else _OF_ONE_WORD.get(unit, name)


def parameter_of(key: str) -> str:
    """Return the name of the parameter that a key of the scene becomes, such as ``links.crank.length``."""
    return re.sub(r"\W+", "_", key)


def key_of(name: str, about: str) -> str:
    """Return the key of the scene that a parameter stands for, or the name of one of the scene's own."""
    return about if re.fullmatch(r"\S+", about) and parameter_of(about) == name else name


def in_words(d: Described, values: Mapping[str, float]) -> str:
    """Return parameters with their values, by the scene's keys and in its units."""
    shown, parts = converters(d.units), []
    for p in d.tunable:
        if p.name in values:
            unit, size = shown.get(p.unit, (p.unit, 1.0))
            parts.append(f"{key_of(p.name, p.about)} = {with_unit(values[p.name] / size, unit)}")
    return ", ".join(parts)


def with_unit(value: float, unit: str) -> str:
    """Return a number of six digits with its unit, if it has one."""
    return f"{value:.6g} {unit}".strip() if unit != "1" else f"{value:.6g}"


def attributes_of(d: Described, title: str) -> dict[str, str]:
    """Return the attributes of a dataset of many runs: its title, and the display units of the scene."""
    return {"title": f"{d.title}: {title}", _DISPLAY_UNITS: json.dumps(d.units)}


def display_units(attributes: Mapping[str, str]) -> dict[str, tuple[str, float]]:
    """Return the :func:`converters` of a dataset of many runs by its attributes."""
    return converters(
        {of: tuple(unit) for of, unit in json.loads(attributes.get(_DISPLAY_UNITS, "{}")).items()}
    )


def of_model(d: Described, values: Iterable[float] | Mapping[str, float], **options: Any) -> dict[str, Any]:
    """Return the fields of a result that a model has: name, title, units, and the provenance.

    ``values`` are the values of the tunable parameters, or parameters by name; ``options`` is the provenance
    besides the hash of the equations and the parameters.
    """
    named = values if isinstance(values, Mapping) else zip((p.name for p in d.tunable), values, strict=False)
    provenance = {"equations": d.equations, **options, "parameters": dict(named)}
    return {"name": d.name, "title": d.title, "units": converters(d.units), "provenance": provenance}


def converted(variables: Iterable[Variable], units: Mapping[str, tuple[str, float]]) -> tuple[Variable, ...]:
    """Return outputs with their values in other units; these are of the form of :func:`converters`."""
    in_units = ((v, *shown_in(v.name, v.unit, units)) for v in variables)
    return tuple(
        v if size == 1.0 and unit == v.unit else replace(v, unit=unit, values=v.values / size)
        for v, unit, size in in_units
    )


def labelled(
    variables: Iterable[Variable], along: Coordinate, times: Array | None, axes: tuple[str, ...], title: str
) -> xarray.Dataset:
    """Return outputs over a coordinate as a dataset; times [s] are a second coordinate if there are any."""
    import xarray

    data = {}
    for v in variables:
        dims = (along.name,) if v.values.ndim == 1 else (along.name, "axis")
        data[v.name] = (dims, v.values, {"units": v.unit, "long_name": v.about})
    indexes, coordinates = _indexed(along.name, along.values, {"units": along.unit, "long_name": along.about})
    if times is not None:
        coordinates["time"] = xarray.Variable(along.name, times, {"units": "s", "long_name": "time"})
    if any(values.ndim == 2 for _, values, _ in data.values()):
        index, axis = _index_of_axes(axes)
        indexes, coordinates = {**indexes, **index}, {**coordinates, **axis}
    coords = xarray.Coordinates(coordinates, indexes)
    return xarray.Dataset(data, coords=coords, attrs={"title": title})


def _indexed(name: str, values: NDArray[Any], labels: Mapping[str, str]) -> Indexed:
    """Return the index of a coordinate and its variable; xarray takes longer to infer them."""
    from xarray import Variable as Labelled
    from xarray.indexes import PandasIndex

    index = PandasIndex(values, name, coord_dtype=values.dtype)
    return {name: index}, index.create_variables({name: Labelled(name, values, labels)})


@lru_cache(maxsize=16)
def _index_of_axes(axes: tuple[str, ...]) -> Indexed:
    """Return the same for the names of axes; datasets copy it."""
    return _indexed("axis", np.array(axes), {})
