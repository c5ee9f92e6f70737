"""The start of a run: assembly from the drawing and consistent velocities, or an error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from symgen.errors import InitialStateError
from symgen.runtime import _start
from symgen.runtime._start import Starter
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.causes import locked, without_direction
from symgen.runtime.integrate.pace import check_wall
from symgen.runtime.integrate.redundancy import (
    ASSEMBLED,
    Redundancy,
    assembly_tolerance,
    extent,
    not_positive,
    overdriven,
    redundant_constraints,
)
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.assembly.stated import held
from symgen.runtime.rods.large_start import LARGE, least_velocities

if TYPE_CHECKING:
    from symgen.runtime.result.equilibrium import Equilibrium

#: Random poses from which a start is searched.
_TRIES = 24
#: Largest number of coordinates with a search.
_SEARCHED = 120
#: Round-off of drawn positions, over the size of the linkage.
ROUNDING = 1e-14
#: Round-off of velocities, over the prescribed ones.
CONSISTENT = 1e-9
#: End of the names of rows for rates about the line of a rod.
_SPIN = " rate along it"


@dataclass(frozen=True, slots=True)
class Start:
    """Coordinates [m] and velocities [m/s] at the start, and the numbers of the redundant constraints.

    ``rank_tolerance`` is that of the pivots which show these; ``y`` holds coordinates and velocities, one
    behind the other. ``rest`` is the equilibrium that the start is, if the scene requests one.
    """

    q: Array
    u: Array
    redundant: tuple[int, ...]
    rank_tolerance: float
    rest: Equilibrium | None = None
    y: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "y", np.concatenate((self.q, self.u)))


def start(evaluator: Evaluator) -> Start:
    """Return coordinates and velocities at the start, and the redundant constraints.

    The drawing is led step by step to the prescribed lengths and angles, so that a linkage stays on the
    assembly branch of the drawing. Velocities are those of least kinetic energy that meet the constraints
    and the prescribed start.

    Raises
    ------
    InitialStateError
        If the linkage cannot be assembled, is singular, or the prescribed velocities contradict the
        constraints.
    """
    starter = posed_starter(evaluator)
    q = starter.q
    d, moves = evaluator.description, evaluator.has("mass_matrix")
    # Elastic links in space hold a structure at rest, which rigid links would overdetermine.
    held = d.elastic is not None and len(d.axes) == 3 and not moves
    redundant = Redundancy((), d.rank_tolerance) if held else redundant_constraints(evaluator, q)
    u = _velocities(evaluator, starter, redundant.rows) if moves else np.zeros(len(q))
    if known := without_direction(evaluator, 0.0, q, u):
        raise InitialStateError(f"{known.text}\n  {known.remedy}", where="springs")
    if known := locked(evaluator, 0.0, q, u):
        raise InitialStateError(f"{known.text}\n  {known.remedy}", where="bearings")
    return Start(q, u, *redundant)


def pose(evaluator: Evaluator) -> Array:
    """Return the coordinates at the start [m].

    Raises
    ------
    InitialStateError
        When the linkage cannot be assembled.
    """
    return posed_starter(evaluator).q


def posed_starter(evaluator: Evaluator) -> Starter:
    """Return the compiled start at the assembled pose."""
    zero = np.zeros(evaluator.description.coordinates)
    drawn = evaluator("drawn", 0.0, zero, zero)
    _check_places(evaluator, drawn)
    starter = Starter(evaluator, ASSEMBLED, drawn)
    if evaluator.has("assembly"):
        starter = _assembled(evaluator, starter)
    if evaluator.has("constraints"):
        q = starter.q
        parts = evaluator.blocks("constraints", 0.0, q, zero)
        check_closed(evaluator, q, parts["constraints"], parts["constraint_scale"])
    return starter


def check_closed(evaluator: Evaluator, q: Array, values: Array, scales: Array) -> None:
    """Refuse a start that misses a constraint by more than the assembly tolerance.

    ``values`` over ``scales`` are the errors [m], evaluated by other means than those that assembled.
    """
    errors, tolerance = np.abs(values / scales), assembly_tolerance(evaluator, q)
    worst = int(np.argmax(np.nan_to_num(errors, nan=np.inf)))
    if not errors[worst] <= tolerance:
        d = evaluator.description
        raise InitialStateError(
            f"the start violates {d.labels[worst]} by {errors[worst]:.3g} m, beyond the tolerance of "
            f"{tolerance:.3g} m\n"
            "  Its assembly did not detect this: please report it, with the scene, as a fault of symgen.",
            where=d.place(worst),
        )


def _check_places(evaluator: Evaluator, q: Array) -> None:
    """Refuse points that tunable parameters draw at no place."""
    rows = evaluator.blocks("points", 0.0, q, np.zeros_like(q))["positions"]
    for name, place in zip(evaluator.description.points, rows, strict=True):
        if not np.isfinite(place).all():
            raise InitialStateError(
                f"expected a finite position of {name} at the start, got {place.tolist()} m\n"
                "  Change the parameters.",
                where=f"points.{name}",
            )


def _check_directions(evaluator: Evaluator, q: Array) -> None:
    """Refuse links whose ends tunable parameters draw at one place: they have no direction to start from."""
    d = evaluator.description
    rows = evaluator.blocks("points", 0.0, q, np.zeros_like(q))["positions"]
    places = dict(zip(d.points, rows.tolist(), strict=True))
    least = ROUNDING * extent(evaluator, q)
    for link, (first, second, *_) in d.links.items():
        if not max(abs(x - y) for x, y in zip(places[second], places[first], strict=True)) > least:
            if link in d.lugs:
                raise InitialStateError(
                    f"expected {second} off the line of its elastic link, got an offset of zero\n"
                    "  Give the offset another value, or write offset = 0 in the scene.",
                    where=f"points.{second}.offset",
                )
            raise InitialStateError(
                f"{first} and {second} are drawn at the same place: the link {link} has no direction there\n"
                "  Change the parameters, or draw them apart.",
                where=f"links.{link}",
            )


def _assembled(evaluator: Evaluator, starter: Starter) -> Starter:
    """Return the start assembled along a path from the drawing, else by closed forms, else by a search."""
    q = starter.q
    _check_directions(evaluator, q)
    if (stated := held(evaluator, q)) is not None:
        closing = Starter(evaluator, ASSEMBLED, stated)
        if closing.close() == _start.STARTED:
            return closing
    status = _start.ON_THE_WAY
    while status == _start.ON_THE_WAY:
        check_wall("assembling the linkage")
        status = starter.advance()
    if status == _start.TOO_TOLERANT:
        wide = extent(evaluator, starter.q)
        raise InitialStateError(
            f"an assembly tolerance of {assembly_tolerance(evaluator, starter.q):g} m is too large for a "
            f"linkage of {wide:g} m: redundant constraints could not be distinguished from independent ones\n"
            f"  Give at most {_start.MOST * wide:.2g} m.",
            where="analysis.assembly_tolerance",
        )
    closed = None if status == _start.STARTED else _closed(evaluator, q, status == _start.UNASSEMBLED)
    if status == _start.UNASSEMBLED and closed is None:
        end = np.append(1.0, np.zeros(len(q) - 1))
        residual = evaluator.blocks("assembly", 0.0, starter.q, end)["assembly_residual"]
        raise overdriven(evaluator, starter.q) or _unassembled(evaluator, starter.at, residual)
    return closed or starter


class _AtStart:
    """The conditions of the start: constraints, angles and places of floating parts, each row in metres."""

    def __init__(self, evaluator: Evaluator, drawn: Array) -> None:
        self.evaluator, self.n, self._drawn = evaluator, evaluator.description.coordinates, drawn
        self.m = evaluator.info("assembly").blocks[0].shape[0]

    def residual(self, q: Array, t: float) -> Array:
        """Return the errors of the conditions [m], shape (m,)."""
        return self._rows(q, 1.0)["assembly_residual"]

    def jacobian(self, q: Array, t: float) -> Array:
        """Return their derivatives by the coordinates [1], shape (m, n)."""
        return self._rows(q, 1.0)["assembly_jacobian"]

    def as_drawn(self) -> Array:
        """Return the derivatives of the conditions that the drawing meets."""
        return self._rows(self._drawn, 0.0)["assembly_jacobian"]

    def length(self, q: Array) -> float:
        """Return the size of the linkage [m]."""
        return extent(self.evaluator, q)

    def drawn_places(self, q: Array) -> Array:
        """Return the positions of the points of the scene [m], (points, axes)."""
        places = self.evaluator.blocks("points", 0.0, q, np.zeros(self.n))["positions"]
        return np.asarray(places[: self.evaluator.description.drawn])

    def turned_over(self, q: Array) -> bool:
        """Return True if a link in the plane points against its angle at the start, as its row allows."""
        halfway = self._rows(self._drawn, 0.5)["assembly_residual"]
        for row, miss in zip(_rows(self.evaluator, "assembly"), halfway, strict=True):
            name, *words = row.split(" ")
            if words[-1:] == ["angle"] and len(self.evaluator.description.axes) == 2:
                links = [name, *words[1:-1]]
                (x, y), along = self._direction(links, self._drawn), self._direction(links, q)
                turned = -2 * math.asin(max(-1.0, min(1.0, miss / math.hypot(x, y))))
                c, s = math.cos(turned), math.sin(turned)
                if along @ (c * x - s * y, s * x + c * y) < 0:
                    return True
        return False

    def _direction(self, links: Sequence[str], q: Array) -> Array:
        """Return the vector along a link [m], by the direction of a second one where there is one."""
        d = self.evaluator.description
        places = self.evaluator.blocks("points", 0.0, q, np.zeros(self.n))["positions"]
        ends = ([places[d.points.index(p)] for p in d.links[link][:2]] for link in links)
        along, *other = (complex(*(end - start)) for start, end in ends)
        turned = along * np.conj(other[0]) / abs(other[0]) if other else along
        return np.array([turned.real, turned.imag])

    def _rows(self, q: Array, fraction: float) -> Mapping[str, Array]:
        return self.evaluator.blocks("assembly", 0.0, q, np.append(fraction, np.zeros(self.n - 1)))


def _closed(evaluator: Evaluator, drawn: Array, searched: bool) -> Starter | None:
    """Return the start on the assembly mode of the drawing, if any.

    Closed forms are complete: only linkages without them are ``searched``.
    """
    from symgen.runtime.rods.assembly.assur import modes_by_drawing
    from symgen.runtime.rods.assembly.quadratics import NotInGroups

    conditions = _AtStart(evaluator, drawn)
    try:
        for q in modes_by_drawing(conditions, drawn, conditions.as_drawn()):
            closing = Starter(evaluator, ASSEMBLED, q)
            if not conditions.turned_over(q) and closing.close() == _start.STARTED:
                return closing
    except NotInGroups:
        return _closed_by_search(evaluator, drawn) if searched and evaluator.description.drawn else None
    return None


def _closed_by_search(evaluator: Evaluator, drawn: Array) -> Starter | None:
    """Return the nearest start to the drawing of those that a search from many poses finds, if any.

    There is none where the drawing leads to errors that could be permitted: those of manufacture.
    """
    from symgen.runtime.rods.search import NEARLY, search

    conditions, found = _AtStart(evaluator, drawn), list[tuple[float, Starter]]()
    poses = search(conditions, drawn, 0.0, _TRIES) if conditions.n <= _SEARCHED else iter(())
    for k, (q, missed) in enumerate(poses):
        check_wall("assembling the linkage")
        closing = Starter(evaluator, ASSEMBLED, q)
        if missed < NEARLY and not conditions.turned_over(q) and closing.close() == _start.STARTED:
            found.append((float(np.linalg.norm(closing.q - drawn)), closing))
        elif k == 0 and missed < _start.MOST:
            return None
    return min(found, key=lambda pair: pair[0])[1] if found else None


#: Errors of constraints below this part of the largest are rounding.
_MISSED = 1e-9


def _unassembled(evaluator: Evaluator, reached: float, residual: Array) -> InitialStateError:
    rows = [_label(evaluator, row) for row in _rows(evaluator, "assembly")]
    size = np.abs(residual)
    order = [i for i in np.argsort(-size)[:3] if size[i] > _MISSED * np.max(size)]
    unit = "" if evaluator.description.rates else " m"
    missing = ", ".join(f"{rows[i]} by {abs(residual[i]):.3g}{unit}" for i in order)
    if not np.all(np.isfinite(residual)):
        bad = rows[int(np.flatnonzero(~np.isfinite(residual))[0])]
        return InitialStateError(
            f"{bad} has no finite value where the linkage is drawn\n  Change {_values(evaluator)}.",
            where=_place(evaluator, bad),
        )
    if evaluator.description.rates:
        return InitialStateError(
            f"the system cannot be assembled from its values: led from these it came {reached:.0%} of the "
            f"way; from there it still misses {missing}\n"
            "  Give values of coordinates nearer to the constraints; those without a value are zero.",
            where="values",
        )
    return InitialStateError(
        f"the linkage cannot be assembled with these lengths and start angles: led from the drawing it came "
        f"{reached:.0%} of the way; from there it still misses {missing}\n"
        "  Check the lengths of these links and the start angles, or draw it nearer to where it can close. "
        "If a link is redundant and this its error of manufacture, give analysis.assembly_tolerance.",
        where=_place(evaluator, rows[order[0]]) if order else "start",
    )


def _values(evaluator: Evaluator) -> str:
    """Return the tunable parameters with their values."""
    tunable = zip(evaluator.description.tunable, evaluator.parameter_values, strict=False)
    return ", ".join(f"{p.name} = {v:g} {p.unit}" for p, v in tunable) or "the drawing"


def _label(evaluator: Evaluator, row: str) -> str:
    """Return the name of a row in messages: the label of a constraint, conditions unchanged."""
    d = evaluator.description
    return d.labels[d.constraints.index(row)] if row in d.constraints else row


def _place(evaluator: Evaluator, row: str) -> str:
    """Return the key of the scene that asks for a row of the start."""
    d = evaluator.description
    if row in d.labels:
        return d.place(d.labels.index(row))
    name, word, *_ = row.split(" ")
    if name == "the":  # place of a floating part
        return f"points.{row.split()[-3]}"
    if word in ("angle", "against") and f"{name}_drive" in d.constraints:
        return d.driver(name)
    tables = {"angle": "start.angles", "rate": "start.rates", "velocity": "start.velocities"}
    return f"{tables[word]}.{name}"


def _velocities(evaluator: Evaluator, starter: Starter, redundant: tuple[int, ...]) -> Array:
    large = evaluator.description.coordinates > LARGE
    solution = least_velocities(evaluator, starter.q, redundant) if large else starter.velocities(redundant)
    if solution is None:
        raise not_positive(evaluator)
    u, of_constraints, of_start, size = solution
    missed = float(np.max(np.concatenate((of_constraints, of_start)), initial=0.0))
    if missed <= CONSISTENT * size:
        return u
    d, causes = evaluator.description, list[tuple[str, float, str]]()
    if len(of_start):
        worst = int(np.argmax(of_start))
        row = _rows(evaluator, "start_velocity")[worst]
        if row.endswith(_SPIN):
            raise _spun(evaluator, starter.q, worst)
        causes.append((row, of_start[worst], _place(evaluator, row)))
    if len(of_constraints):
        worst = int(np.argmax(of_constraints))
        independent = np.setdiff1d(np.arange(len(d.constraints)), redundant)
        causes.append((d.labels[independent[worst]], of_constraints[worst], "drivers"))
    errors = ", ".join(f"{row} by {by:.3g} m/s" for row, by, _ in causes if not by <= CONSISTENT * size)
    raise InitialStateError(
        f"the velocities at the start contradict the constraints: {errors}\n"
        "  Prescribe fewer of them, such as rates of links in place of velocities of points: the others "
        "follow.",
        where=causes[0][2],
    )


def _spun(evaluator: Evaluator, q: Array, row: int) -> InitialStateError:
    """Return the error of a rate with a component about the line of its rod."""
    d, still = evaluator.description, np.zeros_like(q)
    rows = _rows(evaluator, "start_velocity")
    name = rows[row].removesuffix(_SPIN)
    places = evaluator.blocks("points", 0.0, q, still)["positions"]
    start, end = (places[d.points.index(p)] for p in d.links[name][:2])
    line, prescribed = end - start, evaluator.blocks("start_velocity", 0.0, q, still)["start_rates"]
    spin = float(prescribed[row]) / float(np.linalg.norm(line))
    ends = np.array([prescribed[rows.index(f"{name} rate {axis}")] for axis in "xyz"])
    rest = ", ".join(f'"{x:.15g} rad/s"' for x in np.cross(line, ends) / (line @ line) + 0.0)
    return InitialStateError(
        f"{abs(spin):.3g} rad/s of the rate are about the line of {name}, about which a rod has no rotation\n"
        f"  The rate without it is {name} = [{rest}], which moves all points alike; or give velocities of "
        "points.",
        where=f"start.rates.{name}",
    )


def _rows(evaluator: Evaluator, kernel: str) -> tuple[str, ...]:
    info = evaluator.description.kernel(kernel)
    return info.blocks[0].rows if info else ()
