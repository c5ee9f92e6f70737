"""What a run gives: labelled arrays over time with units, drift, statistics and provenance."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import display
from symgen.errors import ResultError, nearest

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
FORMAT = 1


@dataclass(frozen=True, slots=True)
class Variable:
    """One recorded output: ``values[i]`` at time i, with as many components as ``components`` has names."""

    name: str
    unit: str
    about: str
    components: tuple[str, ...]
    values: Array


@dataclass(frozen=True, slots=True)
class Drift:
    """How far a run strayed from what must be conserved, the largest over all steps.

    Attributes
    ----------
    constraint
        Error of a link's length [m].
    velocity
        Rate of change of a link's length [m/s].
    energy
        Change of the energy less the work of loads without potential [J].
    energy_exchanged
        Range of the kinetic or of the potential energy, the larger [J]: what to measure ``energy`` by.
    """

    constraint: float
    velocity: float
    energy: float
    energy_exchanged: float

    @property
    def relative_energy(self) -> float:
        """Energy drift over the energy exchanged; zero when none was exchanged and none drifted."""
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

    ``notes`` says in words what a reader of the numbers must know: redundant constraints, lost rank passed.
    ``events`` are those that the scene asks for, in the order of time.
    """

    name: str
    title: str
    axes: tuple[str, ...]
    time: Array
    variables: tuple[Variable, ...]
    drift: Drift
    final: Mapping[str, Mapping[str, Any]]
    statistics: Mapping[str, Any]
    provenance: Mapping[str, Any]
    notes: tuple[str, ...] = field(default_factory=tuple)
    events: tuple[Event, ...] = field(default_factory=tuple)
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
            f"<{type(self).__name__} {self.name!r}: {len(self.time)} times, {len(self.variables)} outputs, "
            f"{self.provenance['method']}>"
        )

    def __getitem__(self, name: str) -> xarray.DataArray:
        """Return one output as a labelled array over time, its unit in ``attrs["units"]``."""
        self.variable(name)
        return self.dataset[name]

    def __contains__(self, name: object) -> bool:
        """Tell whether an output of this name was recorded."""
        return any(isinstance(name, str) and v.name == name for v in self.variables)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the outputs."""
        return (v.name for v in self.variables)

    def variable(self, name: str) -> Variable:
        """Return one output as it was recorded; raise ResultError with the nearest name otherwise."""
        for variable in self.variables:
            if variable.name == name:
                return variable
        known = [v.name for v in self.variables]
        raise ResultError(
            f"the result holds no {name!r}. {nearest(name, known)}\n"
            "  What a run records is listed under [analysis] outputs in the scene."
        )

    @property
    def dataset(self) -> xarray.Dataset:
        """All outputs, labelled by time and component."""
        if "dataset" not in self._cache:
            import xarray

            data = {}
            for v in self.variables:
                dims = ("time",) if v.values.ndim == 1 else ("time", "axis")
                data[v.name] = (dims, v.values, {"units": v.unit, "long_name": v.about})
            coordinates: dict[str, Any] = {"time": ("time", self.time, {"units": "s", "long_name": "time"})}
            if any(v.values.ndim == 2 for v in self.variables):
                coordinates["axis"] = list(self.axes)
            self._cache["dataset"] = xarray.Dataset(data, coords=coordinates, attrs={"title": self.title})
        dataset: xarray.Dataset = self._cache["dataset"]
        return dataset

    @property
    def over(self) -> tuple[Array, str]:
        """What plots have along their axis, and what it is called."""
        return self.time, "time [s]"

    def panel(self, variable: Variable) -> str:
        """Return the panel of a plot that an output is drawn in, by what is written beside it."""
        return variable.unit

    @property
    def headline(self) -> str:
        """What a plot says of the run."""
        return (
            f"{self.provenance['method']}, {self.statistics['steps']} steps; "
            f"drift: constraints {self.drift.constraint:.1e} m, energy {self.drift.energy:.1e} J"
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
            "energy_drift": self.drift.energy,
            "energy_exchanged": self.drift.energy_exchanged,
            "constraint_drift": self.drift.constraint,
            "velocity_drift": self.drift.velocity,
            "equations": self.provenance["equations"],
            "parameters": dict(self.provenance["parameters"]),
            "notes": list(self.notes),
            "events": [{"name": e.name, "time": e.time, "rising": e.rising} for e in self.events],
            **(
                {"undetermined": self.statistics["undetermined"]} if "undetermined" in self.statistics else {}
            ),
            "final": {point: dict(motion) for point, motion in self.final.items()},
        }

    def plot(self, *names: str, file: str | os.PathLike[str] | None = None) -> Any:
        """Draw outputs over time; see :func:`symgen.report.page.plots.plot`."""
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
                "drift": asdict(self.drift),
                "final": {k: dict(v) for k, v in self.final.items()},
                "statistics": self.all_statistics(),
                "provenance": dict(self.provenance),
                "notes": list(self.notes),
                "events": [asdict(e) for e in self.events],
                "variables": [[v.name, v.unit, v.about, list(v.components)] for v in self.variables],
            }
        )


def _write_netcdf(result: Result, path: Path) -> None:
    dataset = result.dataset.copy()
    dataset.attrs["symgen"] = result.meta()
    dataset.to_netcdf(path, engine="scipy")


def _write_npz(result: Result, path: Path) -> None:
    arrays: dict[str, Any] = {v.name: v.values for v in result.variables}
    with path.open("wb") as stream:
        np.savez_compressed(stream, time=result.time, symgen=np.array(result.meta()), **arrays)


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
