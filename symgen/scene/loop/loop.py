"""Resolved scene of a link-joint table: one closed loop of links, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import sympy as sp

from symgen.scene.limit import Limit
from symgen.scene.rods.linkage import number
from symgen.scene.rods.run_parameters import Parameter, Switch, Written, defaults
from symgen.scene.units import Shown
from symgen.symbolic.quantity import Quantity

Vector = tuple[sp.Expr, sp.Expr, sp.Expr]

#: The entries of a row, in the order of their motions: T = Z(theta + eps S) Y(eta) X(alpha + eps a).
ENTRIES = ("theta", "S", "eta", "alpha", "a")


@dataclass(frozen=True, slots=True)
class JointVariable:
    """A joint variable, or the integral of a first-order state.

    Such an integral is a coordinate of mass 1 that moves no link; its effort is the rate of the state.

    Attributes
    ----------
    quantity, rate, acceleration
        Its symbols, with units; the rate is called ``NAME_rate``, the acceleration ``NAME_acceleration``. Of
        a state its integral, itself and its rate: ``NAME_integral``, ``NAME``, ``NAME_rate``.
    row
        Its row, counted from 0; -1 of a state.
    role
        ``input``: its motion is prescribed; ``free``: an independent coordinate of the motion;
        ``dependent``: follows from closure; ``state``: the integral of a first-order state.
    motion
        Of an input: its value by the time t.
    start, start_rate
        Of a free variable: where it starts and how fast. Of a dependent one: a first guess (and zero).
    effort
        Torque or force of a drive between the link before and the link after the joint, positive where it
        drives the variable up; may hold t, and the variables and their rates. None where it is unknown.
    guessed
        Of a dependent variable: whether ``start`` is given.
    """

    quantity: Quantity
    rate: Quantity
    acceleration: Quantity
    row: int
    role: Literal["input", "free", "dependent", "state"]
    motion: sp.Expr
    start: sp.Expr
    start_rate: sp.Expr
    effort: sp.Expr | None
    guessed: bool = False

    @property
    def name(self) -> str:
        """Its name in the scene."""
        return self.rate.name if self.is_state else self.quantity.name

    @property
    def is_state(self) -> bool:
        """Whether it is the integral of a first-order state."""
        return self.role == "state"

    @property
    def unit_of_effort(self) -> str:
        """Unit of the effort; of a state that of its rate."""
        if self.is_state:
            return self.acceleration.unit
        return "N*m" if self.quantity.unit == "rad" else "N"


@dataclass(frozen=True, slots=True)
class Row:
    """Row i of the table: joint i, and the link from it to joint i + 1.

    The entries are exact expressions over the tunable parameters, linear in the joint variables.
    ``joint`` is a key of the registry of joints, ``link`` the link the row ends on; that of the last row is
    the frame. ``ahead`` is a leading rotation about i: see ``Ball``.
    """

    joint: str
    link: str
    theta: sp.Expr
    S: sp.Expr
    eta: sp.Expr
    alpha: sp.Expr
    a: sp.Expr
    ahead: sp.Expr = sp.S.Zero


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball joint with a leading rotation, which runs use near the pole of its angles.

    Attributes
    ----------
    row
        Its row, counted from 0.
    angles
        Numbers of the variables theta, eta and alpha. Where alpha is constant its number is -1, and the next
        ball, which takes over the idle spin of the link between, has all three.
    turn
        The parameter that runs hold: 0, or 90 deg.
    """

    row: int
    angles: tuple[int, int, int]
    turn: Quantity


@dataclass(frozen=True, slots=True)
class LoopBody:
    """Mass properties of the link of a row, in the frame that its row places (origin at its distal joint).

    Attributes
    ----------
    mass, centre, inertia
        Mass [kg], centre of mass [m], inertia matrix about the centre of mass [kg m^2], row by row.
    idle
        Whether the joints leave it free to spin about the line of its two balls, and a constant entry holds
        that spin: then it is axisymmetric, and its inertia about that line is omitted.
    """

    link: str
    row: int
    mass: sp.Expr
    centre: Vector
    inertia: tuple[Vector, Vector, Vector]
    idle: bool


@dataclass(frozen=True, slots=True)
class LoopLoad:
    """A force [N] at a point [m] of a link, and a couple [N m].

    The point is given in the frame of the link, force and couple in that frame or, where ``in_ground``, in
    the frame {1}; they may hold t, and the variables and their rates.
    """

    name: str
    link: str
    row: int
    at: Vector
    force: Vector
    torque: Vector
    in_ground: bool


@dataclass(frozen=True)
class Loop:
    """A single closed loop, resolved.

    ``variables`` are in the order of the rows, and of their entries; behind them are the integrals of states.

    ``span`` is the range of the first input over which it is evaluated when nothing else is asked; None
    where variables are free. ``lead`` is that input, the first written in the scene, empty where there is
    none. ``size`` is a length typical of it [m]. ``outputs`` is what to record, None for everything.
    ``assembly_tolerance`` is the defect of closure [m] that is tolerated where its equations are dependent.
    The turns of ``balls`` and the branches of ``switches`` are the last of the parameters. ``written`` has
    the values as the scene writes them.
    """

    method: ClassVar[str] = "loop"
    #: Loops are always resolved with their forces.
    kinematic: ClassVar[bool] = False
    name: str
    file: str
    title: str
    parameters: tuple[Parameter, ...]
    rows: tuple[Row, ...]
    variables: tuple[JointVariable, ...]
    bodies: tuple[LoopBody, ...]
    gravity: Vector
    loads: tuple[LoopLoad, ...]
    span: tuple[sp.Expr, sp.Expr] | None
    lead: str
    t_end: sp.Expr
    size: float
    units: Shown
    outputs: tuple[str, ...] | None
    assembly_tolerance: sp.Expr = sp.S.Zero
    balls: tuple[Ball, ...] = ()
    switches: tuple[Switch, ...] = ()
    limits: tuple[Limit, ...] = ()
    written: Written = field(default_factory=Written, compare=False, repr=False)

    @property
    def unit_of_length(self) -> tuple[str, float]:
        """Name and size [m] of the unit of length of its results."""
        return self.units.get("length", ("m", 1.0))

    @cached_property
    def defaults(self) -> Mapping[sp.Symbol, sp.Expr]:
        """Value of every parameter in the scene."""
        return defaults(self.parameters)

    def number(self, expression: sp.Expr) -> float:
        """Return the value of an expression at the scene's own parameters and t = 0."""
        return number(expression, self.defaults)

    def body(self, row: int) -> LoopBody | None:
        """Return the mass properties of the link of a row, where it has any."""
        return next((b for b in self.bodies if b.row == row), None)

    def having(self, role: str) -> tuple[JointVariable, ...]:
        """Return the variables of one role."""
        return tuple(v for v in self.variables if v.role == role)
