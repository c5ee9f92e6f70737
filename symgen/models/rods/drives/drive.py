"""What a derivation asks of a drive: its value, its constraint, its effort, its outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from symgen.mechanics.rods import drive
from symgen.mechanics.rods.particles import Vector
from symgen.scene.rods.linkage import TIME
from symgen.scene.rods.rotations import Driver
from symgen.symbolic.calculus import ONE, partial
from symgen.symbolic.quantity import Entries
from symgen.symbolic.vectors import dot


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A quantity that is prescribed as a function of the time.

    Attributes
    ----------
    owner
        The link or ground point whose outputs are those of the drive.
    name, value, unit, about
        Name of the quantity, its value, and its unit and description.
    effort
        Word, unit and description of the output that is its torque or force on the linkage.
    row, lever
        Name of its constraint, and minus the slope of that by the value: the effort is minus the force of the
        constraint times the lever. No row where the ground moves: its effort is the reaction.
    shown
        Words of the outputs that are the value and its rate; "" for none.
    """

    owner: str
    name: str
    value: sp.Expr
    unit: str
    about: str
    effort: tuple[str, str, str] = ("", "", "")
    row: str = ""
    lever: sp.Expr = ONE
    shown: tuple[str, str] = ("", "")

    @property
    def rate(self) -> sp.Expr:
        """The rate that it prescribes."""
        return partial(self.value, TIME.symbol)

    def outputs(self, effort: sp.Expr) -> dict[str, Entries]:
        """Return the outputs of its owner by word, with its effort [N m or N]."""
        (word, unit, about), (value, rate) = self.effort, self.shown
        found: dict[str, Entries] = {
            word: ([effort], unit, about),
            value: ([self.value], self.unit, self.about),
            rate: ([self.rate], f"{self.unit}/s", f"rate of the {self.about}"),
            "power": ([effort * self.rate], "W", f"power of the drive of {self.owner}"),
        }
        return {word: entries for word, entries in found.items() if word}


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleDrive(Drive):
    """A drive of the angle of an arm a, a.n = 0: see ``mechanics/rods/drive.py``.

    Attributes
    ----------
    driver
        The table of the scene.
    arm, x, y
        The arm [m], and the unit vectors along which it is at the angle zero, and a quarter turn on.
    slopes, ends
        Slopes of a.n by the vector along each other link, or by the arms of bodies; the parts with which base
        points count in the arm of each body.
    torques
        Torques on links in the plane over the multiplier [m]: on the driven one, and the reaction.
    """

    driver: Driver
    arm: Vector
    x: Vector
    y: Vector
    slopes: Mapping[str, Vector] = field(default_factory=dict)
    ends: Mapping[str, Mapping[str, sp.Expr]] = field(default_factory=dict)
    torques: Mapping[str, sp.Expr] = field(default_factory=dict)

    @property
    def across(self) -> Vector:
        """The unit vector n, the slope of a.n by the arm."""
        return drive.across(self.value, self.x, self.y)

    @property
    def components(self) -> tuple[sp.Expr, sp.Expr]:
        """The components of the arm by the unit vectors [m]."""
        return dot(self.arm, self.x), dot(self.arm, self.y)


def of_driver(driver: Driver, sense: str, about: str, shown: str = "") -> dict[str, Any]:
    """Return what the drives of all drivers have alike.

    ``sense`` is how the torque acts, in descriptions; ``about`` describes the angle, and ``shown`` is the
    word of the output that is the angle.
    """
    name = driver.link
    effort = "torque", "N*m", f"torque of the drive on {name}{sense}"
    return {
        "owner": name, "name": driver.output, "value": driver.angle, "unit": "rad", "about": about,
        "effort": effort, "row": driver.row, "shown": (shown, ""), "driver": driver,
    }  # fmt: skip
