"""Description of a compiled model but its equations: names, sizes, units and the start; stored as JSON."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field

from symgen.runtime.kernels.elastic_description import ElasticInfo


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """A parameter that may be changed without compiling again."""

    name: str
    unit: str
    about: str
    default: float


@dataclass(frozen=True, slots=True)
class BlockInfo:
    """A named part of a kernel's ``out``: ``shape`` entries from ``offset`` on, row by row."""

    name: str
    offset: int
    shape: tuple[int, int]
    unit: str
    about: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]

    def places(
        self, rows: Sequence[str], columns: Sequence[str], partly: bool = False
    ) -> list[tuple[int, int, int]]:
        """Return row, column and place in ``out`` of each entry of a matrix; its rows read ``ROW COLUMN``.

        ``partly``: without those of other columns.
        """
        number, along = ({name: i for i, name in enumerate(names)} for names in (rows, columns))
        entries = enumerate(map(str.split, self.rows), self.offset)
        return [(number[r], along[c], place) for place, (r, c) in entries if c in along or not partly]


@dataclass(frozen=True, slots=True)
class EventInfo:
    """A zero of an entry of the kernel 'events': rising (1), falling (-1) or in either direction (0).

    ``revolves``: the entry is an angle, which runs continue over revolutions. ``probed``: it has no power
    series.
    """

    name: str
    unit: str
    direction: int
    ends_run: bool
    about: str
    revolves: bool = False
    probed: bool = False


@dataclass(frozen=True, slots=True)
class PlaneInfo:
    """Where a linkage written in space stays: its coordinate [m] on the axis of this number is constant."""

    across: int
    level: float


@dataclass(frozen=True, slots=True)
class KernelInfo:
    """Sizes, results and cost of a kernel, and whether it reads velocities."""

    name: str
    work_size: int
    reads_rates: bool
    out_size: int
    operations: dict[str, int]
    blocks: tuple[BlockInfo, ...]


@dataclass(frozen=True, slots=True)
class Described(ABC):
    """Runtime data of any model, without its code.

    ``units`` are those of tables by the keys of the table ``units`` of a scene, with their sizes in SI.
    """

    name: str
    file: str
    title: str
    units: dict[str, tuple[str, float]]
    equations: str
    parameters: tuple[ParameterInfo, ...]
    kernels: tuple[KernelInfo, ...]
    references: tuple[str, ...]
    left_out: tuple[str, ...]

    @property
    @abstractmethod
    def method(self) -> str:
        """Name of the method, a row of ``symgen.methods``."""

    @property
    @abstractmethod
    def coordinates(self) -> int:
        """Number of coordinates."""

    @property
    def extent(self) -> str:
        """Numbers of unknowns and constraints, in words."""
        return f"{self.coordinates} coordinates"

    @property
    def states(self) -> Mapping[str, str]:
        """The first-order states, with their units."""
        return {}

    @property
    def integrals(self) -> list[str]:
        """Names of the outputs that are integrals of first-order states."""
        return [f"{name}.integral" for name in self.states]

    @property
    def held(self) -> int:
        """Number of trailing parameters that runs hold during a step and users do not see."""
        return 0

    @property
    def tunable(self) -> tuple[ParameterInfo, ...]:
        """The parameters that users can change."""
        return self.parameters[: len(self.parameters) - self.held]

    @property
    def derived(self) -> int:
        """Number of doubles that the kernel 'setup' writes behind the parameters; 0 without that kernel."""
        setup = self.kernel("setup")
        return setup.out_size if setup else 0

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Number of doubles in the arrays t, q, u and p of every kernel: p ends with the rank tolerance."""
        return 1, self.coordinates, self.coordinates, len(self.parameters) + self.derived + 1

    def kernel(self, name: str) -> KernelInfo | None:
        """Return name and sizes of a kernel; None if the model has no such kernel."""
        return next((k for k in self.kernels if k.name == name), None)

    def sizes_of(self, kernel: str) -> tuple[int, int, int, int, int, int]:
        """Return how many doubles of t, q, u, p, work and out a kernel may read or write."""
        info = self.kernel(kernel)
        work, out = (info.work_size, info.out_size) if info else (0, 0)
        return (*self.sizes, work, out)

    @property
    def work_size(self) -> int:
        """Number of doubles of work memory that the largest kernel needs."""
        return max((k.work_size for k in self.kernels), default=0)

    def to_json(self) -> str:
        """Return the description as JSON text."""
        return json.dumps({"method": self.method, **asdict(self)}, indent=1)


@dataclass(frozen=True, slots=True)
class Description(Described):
    """Runtime data of a linkage of points and links.

    ``free`` are the points with coordinates, along ``axes``: those of ``plane`` if it moves in a plane.
    ``links`` holds the points of each link, ``labels`` the constraints in messages. ``steady`` are ground
    points and drives of constant velocity, ``prescribed`` constraints of drives. ``inputs``, external
    signals, are the last tunable parameters. ``kinematic``: no dynamics; ``selects``: it selects outputs.
    Of a user-defined system ``free`` names the coordinates, ``rates`` their rates, ``given`` the coordinates
    with a value at the start, and ``size`` [m] is in place of that of a drawing. ``lugs`` are rigid joints
    of points off elastic links, with points on the line ("" if named). ``drawn`` is the number of points of
    the scene, the first. ``gears`` are teeth by link, and of the carrier. ``first_pivot`` is a place in
    ``work`` of 'factor'. ``series_rows`` counts the coefficients of one order of power series in time,
    ``series_watched`` those of the kernel 'events'. ``tables`` counts the ``switches`` that are knots of
    tables, the last. ``states`` are first-order states, behind the points, with their units.
    ``at_equilibrium``: from ``start`` runs come to rest, and start there. ``start_remarks`` are those on the
    start, for runs from it.
    """

    axes: tuple[str, ...]
    points: tuple[str, ...]
    free: tuple[str, ...]
    ground: tuple[str, ...]
    links: dict[str, list[str]]
    constraints: tuple[str, ...]
    labels: tuple[str, ...]
    work_of_loads: bool
    first_pivot: int
    start: tuple[float, ...]
    redundant: tuple[int, ...]
    t_end: float
    assembly_tolerance: float
    rank_tolerance: float
    plane: PlaneInfo | None = None
    kinematic: bool = False
    selects: bool = False
    scene_outputs: tuple[str, ...] = ()
    elastic: ElasticInfo | None = None
    events: tuple[EventInfo, ...] = ()
    windings: int = 0
    turns: tuple[str, ...] = ()
    gears: tuple[dict[str, int], ...] = ()
    switches: tuple[str, ...] = ()
    tables: int = 0
    pulses: tuple[int, ...] = ()
    steady: tuple[str, ...] = ()
    prescribed: tuple[int, ...] = ()
    remarks: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    lugs: dict[str, str] = field(default_factory=dict)
    drawn: int = 0
    rates: tuple[str, ...] = ()
    given: tuple[str, ...] = ()
    size: float = 0.0
    series_rows: int = 0
    series_watched: int = 0
    states: dict[str, str] = field(default_factory=dict)
    at_equilibrium: bool = False
    start_remarks: tuple[str, ...] = ()

    @property
    def method(self) -> str:
        """``elastic`` with elastic links, ``spatial`` in space; ``general`` of a user's; else ``rods``."""
        if not self.elastic:
            return "general" if self.rates else "rods"
        return "elastic" if len(self.axes) == 2 else "spatial"

    @property
    def held(self) -> int:
        """Number of the last parameters: references of angles, then branches of switching points."""
        return self.windings + len(self.switches)

    @property
    def of_held(self) -> slice:
        """Where the references of angles and the branches of switching points are among the parameters."""
        return slice(len(self.tunable), len(self.tunable) + self.held)

    @property
    def coordinates(self) -> int:
        """Number of coordinates."""
        return self.of_points + len(self.states)

    @property
    def of_points(self) -> int:
        """Number of coordinates without integrals of states."""
        return len(self.free) * (1 if self.rates else len(self.axes))

    @property
    def freedom(self) -> int:
        """Degrees of freedom that constraints and drives leave; redundant constraints prescribe nothing."""
        return self.of_points - len(self.constraints) + len(self.redundant)

    @property
    def extent(self) -> str:
        """Numbers of coordinates and constraints, in words."""
        counts = {"coordinate": self.of_points, "constraint": len(self.constraints)}
        counts |= {"first-order state": len(self.states)} if self.states else {}
        drives = f" ({_count(len(self.prescribed), 'drive')})" if self.prescribed else ""
        return ", ".join(_count(n, word) + drives * (word == "constraint") for word, n in counts.items())

    @property
    def shown_axes(self) -> tuple[str, ...]:
        """Names of the axes that the scene is written in, and that results have."""
        return ("x", "y", "z") if self.plane else self.axes

    def of_coordinates(self, rate: str = "") -> list[str]:
        """Return the names of the coordinates in labels; of their rates with "v", accelerations with "a"."""
        if self.rates:
            return list({"": self.free, "v": self.rates}.get(rate, [f"{name}_{rate}" for name in self.free]))
        of_state = {"": "{}_integral", "v": "{}", "a": "{}_rate"}[rate]
        names = [f"{point}_{rate}{axis}" for point in self.free for axis in self.axes]
        return [*names, *map(of_state.format, self.states)]

    @property
    def coordinate_outputs(self) -> list[str]:
        """Names of the outputs that are the coordinates."""
        if self.rates:
            return list(self.free)
        return [*(f"{p}.position.{x}" for p in self.free for x in self.axes), *self.integrals]

    def unknown(self, index: int) -> str:
        """Return the name of an unknown of the equations of motion in messages."""
        axes, n = self.axes, self.coordinates
        if index < n and self.rates:
            return f"the coordinate {self.free[index]}"
        if self.of_points <= index < n:
            return f"the state {[*self.states][index - self.of_points]}"
        if index < n:
            return f"the {axes[index % len(axes)]} motion of point {self.free[index // len(axes)]}"
        return self.labels[index - n]

    @property
    def drives(self) -> tuple[int, ...]:
        """Numbers of the constraints that drive a link."""
        return tuple(i for i, label in enumerate(self.labels) if label.startswith("the drive"))

    def place(self, constraint: int) -> str:
        """Return the key of the scene that makes a constraint."""
        label = self.labels[constraint]
        last = label.rpartition(" ")[2]
        if label.startswith("the drive "):
            return self.driver(last)
        if label.startswith("the motion of "):
            return f"motions.{self.constraints[constraint].rpartition('_')[2]}"
        if " link " in label:
            return f"links.{last}" if label.startswith("the length ") else f"links.{last}.points"
        if label.startswith("the guide "):
            return f"guides.{self.constraints[constraint].split('_')[1]}"
        if label.startswith("the rigid joint "):  # of a point off an elastic link
            return f"points.{last}"
        return "welds" if label.startswith("the weld ") else "joints"

    def driver(self, link: str) -> str:
        """Return the key of the scene that drives a link."""
        driven = [self.constraints[i] for i in self.drives].index(f"{link}_drive")
        return "crank" if self.elastic and self.elastic.crank == link else f"drivers.{driven}"


def _count(n: int, word: str) -> str:
    return f"{n} {word}{'s' * (n != 1)}"
