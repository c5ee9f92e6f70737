"""Results of runs: labelled arrays over one coordinate with units, drift, statistics and provenance."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from symgen.calls import checked
from symgen.display import seconds
from symgen.errors import ResultError
from symgen.runtime.arrays import Array
from symgen.runtime.digest import digest
from symgen.runtime.result.findings import Findings, Pictures
from symgen.runtime.result.records import (
    Coordinate,
    Drift,
    LocatedEvent,
    Variable,
    columns,
    converted,
    found,
    labelled,
    plain,
    quantity_of,
    unknown,
)

if TYPE_CHECKING:
    import xarray

FORMAT = 2
#: Name of the digest of a file.
DIGEST = "symgen_digest"
#: Version of the summary that the command line prints as JSON.
SUMMARY = 1

#: Units of a coordinate in tables and plots, and their sizes in SI.
_SHOWN_IN = {"rad": ("deg", math.pi / 180), "rad/s": ("rpm", math.pi / 30)}


@checked
@dataclass(frozen=True, eq=False)
class Result(Findings, Pictures):
    """The result of a run. ``result["C.position"]`` is a labelled array with its unit.

    Attributes
    ----------
    coordinate
        Coordinate of all outputs: the time, an input, the angle or the speed of a crank.
    variables
        Recorded outputs; the coordinate is not one of them.
    drift
        Drift of the constraints and of the energy; nan if it was not measured.
    notes
        Remarks on the numbers: redundant constraints, losses of rank.
    events
        Events that the scene defines, in the order of time.
    times
        Times [s] of the samples if the coordinate is not the time; None if there are none.
    units
        Units of tables and plots by unit in SI: their name and size. SI where one is missing.
    """

    #: Name of this kind of result in files and JSON.
    KIND: ClassVar[str] = "run"
    #: Whether the dataset of many runs has the notes of each.
    NOTED_IN_MANY: ClassVar[bool] = False

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
    events: tuple[LocatedEvent, ...] = field(default_factory=tuple)
    times: Array | None = None
    units: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    _cache: dict[str, Any] = field(init=False, default_factory=dict, repr=False)

    @classmethod
    def _later(cls, source: Any, **known: Any) -> Self:
        """Return a result whose fields methods of ``source`` with the same names compute at first access.

        In short runs most fields are never read, and computing them would take longer than the steps.
        ``known`` are fields that exist already.
        """
        instance = object.__new__(cls)
        instance.__dict__.update(known, _source=source, _cache={})
        return instance

    def __getstate__(self) -> dict[str, Any]:
        known = {name: getattr(self, name) for name in _FIELDS}
        return {**known, "statistics": dict(self.statistics), "_cache": {}}

    def completed(self) -> dict[str, Any]:
        """Return ``statistics`` and ``notes``, including those that are computed at the first request."""
        return {"statistics": dict(self.statistics), "notes": self.notes}

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
        """Times of the samples [s]; raise ResultError for results that have none, such as speed responses."""
        if self.coordinate.name == "time":
            return self.coordinate.values
        if self.times is None:
            raise ResultError(f"the result is over {self.coordinate.about} and has no times")
        return self.times

    def __getitem__(self, name: str) -> xarray.DataArray:
        """Return an output, a component such as ``C.position.x``, or the coordinate, with its unit."""
        variable, component = self._find(name)
        of = [] if name == self.coordinate.name else [variable]
        array = (self.dataset if "variables" in self.__dict__ else self._labelled(of))[variable.name]
        return array.isel(axis=variable.components.index(component)).rename(name) if component else array

    def __contains__(self, name: object) -> bool:
        """Return True if an output, a component of one, or the coordinate has this name."""
        known = (n for v in self.variables for n in v.names)
        return isinstance(name, str) and name in (self.coordinate.name, *known)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the outputs."""
        return (v.name for v in self.variables)

    def variable(self, name: str) -> Variable:
        """Return an output, a component of one, or the coordinate, else raise ResultError."""
        whole, component = self._find(name)
        return whole.component(component) if component else whole

    def _find(self, name: str) -> tuple[Variable, str]:
        """Return an output, or the coordinate, and the component of it that has the name; else raise."""
        known = self.__dict__.get("variables")
        if known is None:  # outputs of one kind are computed only when they are reached
            known = getattr(self.__dict__["_source"], "outputs", lambda: self.variables)()
        by_name = found(known, [name])
        if name in by_name:
            return by_name[name]
        along = self.coordinate
        if along.name == name:
            return Variable(name, along.unit, along.about, (), along.values), ""
        raise ResultError(
            f"the result holds no {name!r}. {unknown(name, self.variables)}\n"
            "  The outputs of a run are listed under [analysis] outputs in the scene."
        )

    @property
    def dataset(self) -> xarray.Dataset:
        """All outputs, labelled by coordinate and component; the times are a second coordinate."""
        if "dataset" not in self._cache:
            self._cache["dataset"] = self._labelled(self.variables)
        return cast("xarray.Dataset", self._cache["dataset"])

    def _labelled(self, variables: Iterable[Variable]) -> xarray.Dataset:
        return labelled(variables, self.coordinate, self.times, tuple(self.axes), self.title)

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
        return converted(self.variables, self.units)

    def panel(self, variable: Variable) -> str:
        """Return the panel of a plot for an output: its quantity and unit, which label the axis."""
        name, shown = variable.name, variable.unit
        unit = next((si for si, (text, _) in self.units.items() if text == shown), shown)
        return quantity_of(name, unit) + ("" if shown == "1" else f" [{shown}]")

    @property
    def headline(self) -> str:
        """Title line of plots: method, steps if they are known, and drift."""
        measured = self.drift.measured
        units = (("constraint", "constraints", "m"), ("energy", "energy", "J"))
        drift = [f"{word} {measured[name]:.1e} {unit}" for name, word, unit in units if name in measured]
        drift_text = f"; drift: {', '.join(drift)}" if drift else ""
        steps = f", {self.statistics['steps']} steps" if "steps" in self.statistics else ""
        return f"{self.provenance['method']}{steps}{drift_text}"

    @property
    def facts(self) -> tuple[tuple[str, str], ...]:
        """Names and values of facts about the run; error measures come last."""
        known, drift = self.statistics, self.drift.measured
        facts = [("method", str(self.provenance["method"]))]
        if self.coordinate.name == "time" and "t" in known:
            facts.append(("to", f"t = {known['t']:g} s"))
        if "steps" in known:
            rejected = f", {known['rejected']} rejected" if "rejected" in known else ""
            facts.append(("steps", f"{known['steps']}{rejected}"))
        if "wall_s" in known:
            facts.append(("time", seconds(float(known["wall_s"]))))
        if "energy" in drift:
            lost, exchanged = (f"{drift[name]:.1e} J" for name in ("energy", "energy_exchanged"))
            facts.append(("energy drift", f"{lost} of {exchanged} exchanged"))
        if "constraint" in drift:
            facts.append(("constraint drift", f"{drift['constraint']:.1e} m"))
        return tuple(facts)

    def at(self, times: ArrayLike) -> Result:
        """Return the run at other times [s]: dense output.

        The run is repeated in the same steps and recorded at these times. Values between its samples
        therefore have the accuracy of the interpolant of the method, on the constraints; values at its
        samples have the same bits. A call takes the time of a run: pass all times in one call. Runs of
        elastic links end a step at every time and are accurate to their ``rtol``.

        Parameters
        ----------
        times
            One time, or increasing times, from the start of the run to its end.

        Raises
        ------
        ModelError
            For times that do not increase, or are outside of the run.
        ResultError
            For results that were not returned by ``simulate`` in this process, for runs of elastic links in
            space, and for times beyond an event that ended the run.
        """
        from symgen.runtime.model.verbs import accepted

        model, verb, arguments = self.origin or (None, "", {})
        if model is None or verb != "simulate" or "t_eval" not in accepted(model, verb):
            raise ResultError(
                "only runs by simulate() of this process, if it accepts t_eval, have values at other times"
            )
        same = {name: value for name, value in arguments.items() if name not in ("samples", "t_eval", "at")}
        result: Result = model.simulate(**same, t_eval=np.atleast_1d(np.asarray(times, dtype=float)))
        if result.count < np.size(times):
            raise ResultError(
                f"the run ended at t = {self.statistics['t']:.9g} s, before the last of these times"
            )
        return result

    def summary(self) -> dict[str, Any]:
        """Return the result without its samples, in SI units: see ``docs/results.md``, JSON."""
        along, outputs = self.coordinate, columns(self.variables)
        ends = {"first": along.values[0], "last": along.values[-1]} if self.count else {}
        return plain(
            {
                "version": SUMMARY,
                "scene": self.name,
                "title": self.title,
                "kind": self.KIND,
                "method": self.provenance["method"],
                "coordinate": {"name": along.name, "unit": along.unit, "count": self.count, **ends},
                "outputs": {v.name: {"unit": v.unit, **self._extremes(v.values)} for v in outputs},
                "final": self.final,
                "drift": self.drift.measured,
                **self.completed(),
                "events": [{"name": e.name, "time": e.time, "rising": e.rising} for e in self.events],
                "provenance": self.provenance,
            }
        )

    def _extremes(self, values: Array) -> dict[str, Any]:
        """Return the last, least and greatest value, and where the extremes occur; None without values."""
        known, along = ~np.isnan(values), self.coordinate.values
        if not known.any():
            return dict.fromkeys(("final", "minimum", "minimum_at", "maximum", "maximum_at"))
        low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
        return {
            "final": values[-1],
            "minimum": values[low],
            "minimum_at": along[low],
            "maximum": values[high],
            "maximum_at": along[high],
        }

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save to ``.nc`` (netCDF) or ``.npz``, which :func:`symgen.load_result` reads back, or to ``.csv``.

        CSV has a column for the coordinate, one for the times if the coordinate is another, and one per
        component, in SI, with all digits; its first line has names and units. It has neither drift nor
        provenance, and is not read back.

        Raises
        ------
        ResultError
            When the ending is another one, or the file cannot be written; no broken file is left.
        """
        from symgen.atomic import replacing, writable

        path = writable(file, SAVED_AS, "result")
        with replacing(path, "result") as temporary:
            _WRITERS[path.suffix.lower()](self, temporary)
        return path

    def meta(self) -> str:
        """Return everything but the arrays, as JSON."""
        from symgen.version import __version__

        return json.dumps(
            {
                "symgen_result": FORMAT,
                "symgen_version": __version__,
                "kind": self.KIND,
                "name": self.name,
                "title": self.title,
                "axes": list(self.axes),
                "coordinate": [self.coordinate.name, self.coordinate.unit, self.coordinate.about],
                "drift": self.drift.measured,
                "final": {k: dict(v) for k, v in self.final.items()},
                **self.completed(),
                "provenance": dict(self.provenance),
                "events": [asdict(e) for e in self.events],
                "variables": [[v.name, v.unit, v.about, list(v.components)] for v in self.variables],
                "units": {unit: list(shown) for unit, shown in self.units.items()},
            }
        )


def _write_netcdf(result: Result, path: Path) -> None:
    dataset, meta = result.dataset.copy(), result.meta()
    dataset.attrs |= {"symgen": meta, DIGEST: digest(_arrays(result), meta)}
    dataset.to_netcdf(path, engine="scipy")


def _write_npz(result: Result, path: Path) -> None:
    arrays, meta = _arrays(result), result.meta()
    texts: dict[str, Any] = {"symgen": np.array(meta), DIGEST: np.array(digest(arrays, meta))}
    with path.open("wb") as stream:
        np.savez_compressed(stream, **texts, **arrays)


def _arrays(result: Result) -> dict[str, Any]:
    """Return the arrays of a result by their names in files."""
    times = {} if result.times is None else {"time": result.times}
    outputs = {v.name: v.values for v in result.variables}
    return {**outputs, **times, result.coordinate.name: result.coordinate.values}


def _write_csv(result: Result, path: Path) -> None:
    along = result.coordinate
    written = [(along.name, along.unit, along.values)]
    if result.times is not None:
        written.append(("time", "s", result.times))
    written += [(v.name, v.unit, v.values) for v in columns(result.variables)]
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(f"{name} [{unit}]" for name, unit, _ in written)
        writer.writerows(zip(*(values.tolist() for *_, values in written), strict=True))


_WRITERS = {".nc": _write_netcdf, ".npz": _write_npz, ".csv": _write_csv}
#: Endings of files that a result can be saved to.
SAVED_AS = tuple(_WRITERS)


class _OnAccess:
    """A field that the source of a result computes at first access; the result then stores it."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, result: Result | None, owner: type[Result]) -> Any:
        if result is None:
            return self
        source = result.__dict__.get("_source")
        if source is None:
            raise AttributeError(f"a {owner.__name__} without {self.name!r}")
        value = result.__dict__[self.name] = getattr(source, self.name)()
        return value


_FIELDS = tuple(f.name for f in fields(Result) if f.name != "_cache")
for _name in _FIELDS:
    setattr(Result, _name, _OnAccess(_name))
