"""Runtime data of a closed loop of joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from symgen.runtime.kernels.description import Described, ParameterInfo


@dataclass(frozen=True, slots=True)
class VariableInfo:
    """A joint variable of a loop: see :class:`symgen.scene.loop.loop.JointVariable`.

    ``unit`` is ``rad`` or ``m``, or that of the integral of a state; ``unknown``: the effort of its drive is
    an unknown. ``start`` is the first guess of a dependent variable; ``guessed``: the scene gives that guess.
    """

    name: str
    unit: str
    row: int
    role: str
    unknown: bool
    start: float
    start_rate: float
    guessed: bool = False

    @property
    def is_length(self) -> bool:
        """Whether it is a displacement."""
        return self.unit == "m"


@dataclass(frozen=True, slots=True)
class BallInfo:
    """A ball joint whose angles runs write otherwise near their pole.

    ``row`` is its row, counted from 0, and ``angles`` are the numbers of the variables theta, eta and alpha.
    Where alpha is constant its number is -1, and the next ball takes over the idle spin.
    """

    row: int
    angles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class LoopDescription(Described):
    """Runtime data of a closed loop.

    ``joints`` and ``links`` name each row of the table. ``span`` is the range of the first input, empty where
    variables are free; ``lead`` is the name of that input, the first written in the scene, empty where there
    is none. ``start`` are the variables at the start, at the scene's own parameters, ``rank`` is the rank
    of the screws of the dependent variables. ``begin`` is the value of the first input at the start: the
    beginning of the range, or the first value of it at which the loop closes. ``assembly_tolerance`` is the
    defect of closure [m], of rotations times the size of the loop, that dependent equations may leave.
    ``inputs`` are the parameters that are external signals, the last of the tunable ones. ``states`` are the
    first-order states, whose integrals are the last variables. The turns in front of ``balls`` and the
    branches of ``switches`` are the last parameters. ``tables``, ``series_rows`` and ``series_watched`` are
    those of :class:`~symgen.runtime.kernels.description.Description`.
    """

    method: ClassVar[str] = "loop"
    joints: tuple[str, ...]
    links: tuple[str, ...]
    variables: tuple[VariableInfo, ...]
    span: tuple[float, ...]
    lead: str
    t_end: float
    size: float
    start: tuple[float, ...]
    rank: int
    begin: float = 0.0
    assembly_tolerance: float = 0.0
    balls: tuple[BallInfo, ...] = ()
    switches: tuple[str, ...] = ()
    tables: int = 0
    inputs: tuple[str, ...] = ()
    series_rows: int = 0
    series_watched: int = 0
    states: dict[str, str] = field(default_factory=dict)

    @property
    def tunable(self) -> tuple[ParameterInfo, ...]:
        """The parameters without those that runs hold, which come last."""
        return self.parameters[: len(self.parameters) - len(self.balls) - len(self.switches)]

    @property
    def coordinates(self) -> int:
        """Number of joint variables and states."""
        return len(self.variables)

    @property
    def dynamic(self) -> list[int]:
        """Numbers of the variables that runs solve for, in order: all but inputs."""
        return self.having("dependent", "free", "state")

    @property
    def solved(self) -> list[int]:
        """The same, those that closure determines first."""
        return [*self.having("dependent"), *self.having("free", "state")]

    @property
    def extent(self) -> str:
        """Number of coordinates, and the joints, in words."""
        return f"{self.coordinates} coordinates, {' '.join(self.joints)} loop"

    def having(self, *roles: str) -> list[int]:
        """Return the numbers of the variables of these roles."""
        return [i for i, v in enumerate(self.variables) if v.role in roles]

    def row(self, index: int) -> str:
        """Return variable, row, joint and link of a variable as messages name them."""
        v = self.variables[index]
        return f"{v.name} of row {v.row + 1} (joint {self.joints[v.row]}, link {self.links[v.row]})"
