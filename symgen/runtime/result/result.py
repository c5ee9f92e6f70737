"""Results of runs: labelled arrays over one coordinate with units, drift, statistics and provenance."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import display, seconds
from symgen.errors import ResultError, nearest

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
FORMAT = 2

#: Units of a coordinate in tables and plots, and their sizes in SI.
_SHOWN_IN = {"rad": ("deg", math.pi / 180), "rad/s": ("rpm", math.pi / 30)}


@dataclass(frozen=True, slots=True)
class Coordinate:
    """The coordinate of a result, which every output is recorded over.

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

    @property
    def relative_energy(self) -> float:
        """Energy drift over the energy exchanged; zero if both are zero, nan if it was not measured."""
        if self.energy_exchanged == 0.0:
            return 0.0 if self.energy == 0.0 else float("inf")
        return self.energy / self.energy_exchanged


@dataclass(frozen=True, slots=True)
class Event:
    """A moment that the scene told the run to look for.

    ``motion`` holds positions [m] and velocities [m/s] of the points then, as ``Result.final`` does.
    """

    name: str
    time: float
    rising: bool
    motion: Mapping[str, Mapping[str, Any]]


@checked
@dataclass(frozen=True, eq=False)
class Result:
    """The result of a run. ``result["C.position"]`` is a labelled array with its unit.

    Attributes
    ----------
    coordinate
        Coordinate of all outputs: the time, an input, the angle or the speed of a crank.
    variables
        Recorded outputs; the coordinate is not one of them.
    drift
        Drift of what must be conserved; nan where it was not measured.
    notes
        Remarks on the numbers: redundant constraints, losses of rank.
    events
        Events that the scene defines, in the order of time.
    times
        Times [s] of the samples where the coordinate is not the time; None where there are none.
    units
        Units of tables and plots by unit in SI: their name and size. SI where one is missing.
    """

    name: str
    title: str
    axes: tuple[str, ...]
    coordinate: Coordinate
    variables: tuple[Variable, ...]
    drift: Drift
    final: Mapping[str, Mapping[str, Any]]
    statistics: Mapping[str, Any]
    provenance: Mapping[str, Any]
    notes: tuple[str, ...] = field(default_factory=tuple)
    events: tuple[Event, ...] = field(default_factory=tuple)
    times: Array | None = None
    units: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    _cache: dict[str, Any] = field(init=False, default_factory=dict, repr=False)

    @classmethod
    def _later(cls, source: Any) -> Self:
        """Return a result whose fields are made when first asked for, by the methods of ``source`` so named.

        In short runs most of them are not asked for, and making them would take longer than the steps.
        """
        made = object.__new__(cls)
        made.__dict__.update(_source=source, _cache={})
        return made

    def __getstate__(self) -> dict[str, Any]:
        if "_source" in self.__dict__:
            return {"_cache": {}, **{name: getattr(self, name) for name in _FIELDS}}
        return {**self.__dict__, "_cache": {}}

    def all_statistics(self) -> dict[str, Any]:
        """Return the statistics, those included that are computed when they are requested."""
        return dict(self.statistics)

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.name!r}: {self.count} samples, {len(self.variables)} outputs, "
            f"{self.provenance['method']}>"
        )

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.coordinate.values)

    @property
    def time(self) -> Array:
        """Times of the samples [s]; raise ResultError for results that have none, such as sweeps."""
        if self.coordinate.name == "time":
            return self.coordinate.values
        if self.times is None:
            raise ResultError(f"the result is over {self.coordinate.about} and has no times")
        return self.times

    def __getitem__(self, name: str) -> xarray.DataArray:
        """Return an output, or the coordinate, as a labelled array with its unit in ``attrs["units"]``."""
        self.variable(name)
        return self.dataset[name]

    def __contains__(self, name: object) -> bool:
        """Tell whether an output, or the coordinate, has this name."""
        return isinstance(name, str) and (name == self.coordinate.name or name in [*self])

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the outputs."""
        return (v.name for v in self.variables)

    def variable(self, name: str) -> Variable:
        """Return an output, or the coordinate; raise ResultError with the nearest name otherwise."""
        for variable in self.variables:
            if variable.name == name:
                return variable
        along = self.coordinate
        if along.name == name:
            return Variable(name, along.unit, along.about, (), along.values)
        known = [v.name for v in self.variables]
        raise ResultError(
            f"the result holds no {name!r}. {nearest(name, known)}\n"
            "  What a run records is listed under [analysis] outputs in the scene."
        )

    @property
    def dataset(self) -> xarray.Dataset:
        """All outputs, labelled by coordinate and component; the times are a second coordinate."""
        if "dataset" not in self._cache:
            import xarray

            along, data = self.coordinate, {}
            for v in self.variables:
                dims = (along.name,) if v.values.ndim == 1 else (along.name, "axis")
                data[v.name] = (dims, v.values, {"units": v.unit, "long_name": v.about})
            labels = {"units": along.unit, "long_name": along.about}
            coordinates: dict[str, Any] = {along.name: (along.name, along.values, labels)}
            if self.times is not None:
                coordinates["time"] = (along.name, self.times, {"units": "s", "long_name": "time"})
            if any(v.values.ndim == 2 for v in self.variables):
                coordinates["axis"] = list(self.axes)
            self._cache["dataset"] = xarray.Dataset(data, coords=coordinates, attrs={"title": self.title})
        dataset: xarray.Dataset = self._cache["dataset"]
        return dataset

    @property
    def over(self) -> tuple[Array, str]:
        """Values of the coordinate in the unit of tables and plots, and its label."""
        unit, size = self.shown_in
        return self.coordinate.values / size, f"{self.coordinate.about} [{unit}]"

    @property
    def shown_in(self) -> tuple[str, float]:
        """Unit of the coordinate in tables and plots, and its size in SI; angles are in degrees."""
        unit = self.coordinate.unit
        return _SHOWN_IN.get(unit) or self.units.get(unit, (unit, 1.0))

    @property
    def shown(self) -> tuple[Variable, ...]:
        """Outputs in the units of tables and plots."""
        known = self.units
        return tuple(
            replace(v, unit=known[v.unit][0], values=v.values / known[v.unit][1]) if v.unit in known else v
            for v in self.variables
        )

    def panel(self, variable: Variable) -> str:
        """Return the panel of a plot that an output is drawn in, by what is written beside it."""
        return variable.unit

    @property
    def headline(self) -> str:
        """What a plot says of the run."""
        measured = self.drift.measured
        units = (("constraint", "constraints", "m"), ("energy", "energy", "J"))
        drift = [f"{word} {measured[name]:.1e} {unit}" for name, word, unit in units if name in measured]
        told = f"; drift: {', '.join(drift)}" if drift else ""
        return f"{self.provenance['method']}, {self.statistics['steps']} steps{told}"

    @property
    def facts(self) -> tuple[tuple[str, str], ...]:
        """Names and values of facts about the run; error measures come last."""
        drift, errors = self.drift.measured, []
        if "energy" in drift:
            lost, exchanged = (f"{drift[name]:.1e} J" for name in ("energy", "energy_exchanged"))
            errors.append(("energy drift", f"{lost} of {exchanged} exchanged"))
        if "constraint" in drift:
            errors.append(("constraint drift", f"{drift['constraint']:.1e} m"))
        return (
            ("method", str(self.provenance["method"])),
            ("to", f"t = {self.statistics['t']:g} s"),
            ("steps", f"{self.statistics['steps']}, {self.statistics['rejected']} rejected"),
            ("time", seconds(float(self.statistics["wall_s"]))),
            *errors,
        )

    def summary(self) -> dict[str, Any]:
        """Return the run in plain numbers: what ``symgen run --json`` prints."""
        return {
            "scene": self.name,
            "method": self.provenance["method"],
            "t_end": self.provenance["t_end"],
            "backend": self.provenance["backend"],
            "precision": self.provenance.get("precision", "float64"),
            "steps": self.statistics["steps"],
            "rejected": self.statistics["rejected"],
            "evaluations": self.statistics["evaluations"],
            "wall_s": self.statistics["wall_s"],
            "drift": self.drift.measured,
            "equations": self.provenance["equations"],
            "parameters": dict(self.provenance["parameters"]),
            "notes": list(self.notes),
            "events": [{"name": e.name, "time": e.time, "rising": e.rising} for e in self.events],
            **{k: v for k, v in self.statistics.items() if k == "undetermined"},
            "final": {point: dict(motion) for point, motion in self.final.items()},
        }

    def plot(self, *names: str, file: str | os.PathLike[str] | None = None) -> Any:
        """Draw outputs over the coordinate; see :func:`symgen.report.page.plots.plot`."""
        return display("plot", self, *names, file=file)

    def _repr_html_(self) -> str:
        html: str = display("result_html", self)
        return html

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save to ``.nc`` (netCDF) or ``.npz``; :func:`symgen.load_result` reads both back.

        Raises
        ------
        ResultError
            When the ending is another one, or the file cannot be written; no broken file is left.
        """
        from symgen.atomic import replacing, writable

        path = writable(file, SAVED_AS, "result")
        try:
            with replacing(path) as temporary:
                _WRITERS[path.suffix.lower()](self, temporary)
        except OSError as error:
            raise ResultError(f"cannot write the result to {path}: {error.strerror or error}") from None
        return path

    def meta(self) -> str:
        """Return everything but the arrays, as JSON."""
        from symgen.version import __version__

        return json.dumps(
            {
                "symgen_result": FORMAT,
                "symgen_version": __version__,
                "name": self.name,
                "title": self.title,
                "axes": list(self.axes),
                "coordinate": [self.coordinate.name, self.coordinate.unit, self.coordinate.about],
                "drift": self.drift.measured,
                "final": {k: dict(v) for k, v in self.final.items()},
                "statistics": self.all_statistics(),
                "provenance": dict(self.provenance),
                "notes": list(self.notes),
                "events": [asdict(e) for e in self.events],
                "variables": [[v.name, v.unit, v.about, list(v.components)] for v in self.variables],
                "units": {unit: list(shown) for unit, shown in self.units.items()},
            }
        )


def _write_netcdf(result: Result, path: Path) -> None:
    dataset = result.dataset.copy()
    dataset.attrs["symgen"] = result.meta()
    dataset.to_netcdf(path, engine="scipy")


def _write_npz(result: Result, path: Path) -> None:
    arrays: dict[str, Any] = {v.name: v.values for v in result.variables}
    if result.times is not None:
        arrays["time"] = result.times
    arrays[result.coordinate.name] = result.coordinate.values
    with path.open("wb") as stream:
        np.savez_compressed(stream, symgen=np.array(result.meta()), **arrays)


_WRITERS = {".nc": _write_netcdf, ".npz": _write_npz}
#: Endings of files that a result can be saved to.
SAVED_AS = tuple(_WRITERS)


class _WhenAsked:
    """A field that a result's source makes when it is first asked for; the result keeps it in its place."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, made: Result | None, owner: type[Result]) -> Any:
        if made is None:
            return self
        source = made.__dict__.get("_source")
        if source is None:
            raise AttributeError(f"a {owner.__name__} without {self.name!r}")
        value = made.__dict__[self.name] = getattr(source, self.name)()
        return value


_FIELDS = tuple(f.name for f in fields(Result) if f.name != "_cache")
for _name in _FIELDS:
    setattr(Result, _name, _WhenAsked(_name))
