"""Any loop of a link-joint table by rotation matrices, positions and Newton's and Euler's laws: no screws.

An independent check of results of loops. Links are placed by products of rotation matrices, whose rates follow by
Taylor arithmetic; the recorded motion must close the loop, with its rates and accelerations. Each link must obey
Newton's and Euler's laws under the recorded joint forces, joint wrenches must do no work on the freedoms, and the
power of the drives must balance the energy. No equations are solved. Units are SI, in extended doubles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy as sp
from shared.jets import Jet, Real, about_x, about_y, about_z, angular_velocity, cross, dot

from symgen.scene.loop.loop import ENTRIES, Loop
from symgen.scene.rods.linkage import TIME


@dataclass
class Frame:
    """A frame: rotation matrix (..., 3, 3) and origin (..., 3), in the frame {1}."""

    turn: Jet
    origin: Jet

    def axis(self, i):
        return self.turn[..., :, i]


class TableMotion:
    """Frames {1} .. {n+1} of a loop whose variables move as given: arrays of values, rates and accelerations."""

    def __init__(self, loop: Loop, moving: dict[str, Jet], values: dict[str, float] | None = None) -> None:
        self.loop, self.moving = loop, moving
        known = dict(loop.defaults)
        for p in loop.parameters:
            if p.quantity.name in (values or {}):
                known[p.quantity.symbol] = values[p.quantity.name]
        self.known = known
        shape = next(iter(moving.values())).value.shape
        zero = Jet(np.zeros(shape))
        frame = Frame(about_z(zero), Jet(np.zeros((*shape, 3))))
        self.frames, self.axes = [frame], {}
        for row in loop.rows:
            entry = {name: zero + self._entry(getattr(row, name)) for name in ENTRIES}
            before = frame
            turned = frame.turn @ about_z(entry["theta"])
            moved = frame.origin + frame.axis(2) * entry["S"][..., None]
            mid = Frame(turned, moved)
            bent = Frame(turned @ about_y(entry["eta"]), moved)
            frame = Frame(bent.turn @ about_x(entry["alpha"]), moved + bent.axis(0) * entry["a"][..., None])
            along = {"theta": before.axis(2), "S": before.axis(2), "eta": mid.axis(1)}
            along |= {"alpha": bent.axis(0), "a": bent.axis(0)}
            places = {"theta": moved, "S": moved, "eta": moved, "alpha": moved, "a": moved}
            for name in ENTRIES:
                for v in loop.variables:
                    slope = sp.diff(getattr(row, name), v.quantity.symbol)
                    if slope != 0:
                        self.axes.setdefault(v.name, []).append(
                            (name, float(self._number(slope)), along[name].value, places[name].value)
                        )
            self.frames.append(frame)

    def _number(self, expression):
        return Real(str(sp.N(sp.sympify(expression).xreplace(self.known), 25)))

    def _entry(self, expression):
        """Entries are linear in the variables."""
        expression = sp.sympify(expression)
        symbols = {v.quantity.symbol: self.moving[v.name] for v in self.loop.variables}
        total = Jet(self._number(expression.xreplace(dict.fromkeys(symbols, sp.S.Zero))))
        for symbol, motion in symbols.items():
            slope = sp.diff(expression, symbol)
            if slope != 0:
                total = total + motion * self._number(slope)
        return total

    # --- conditions ---------------------------------------------------------------------------------------

    def closure(self) -> tuple[float, float, float]:
        """Deviation of frame {n+1} from {1} in pose (radians, sizes of the loop), rate and acceleration."""
        last, size = self.frames[-1], Real(self.loop.size)
        gaps = []
        for i in range(3):
            turn, place = last.turn.parts[i], last.origin.parts[i] / size
            gaps.append(
                float(max(np.max(np.abs(turn - (np.eye(3) if i == 0 else 0))), np.max(np.abs(place))))
            )
        return tuple(gaps)

    def inertia_wrench(self, row: int):
        """Force, and moment about the origin of {1}, that moves the link of a row; zero where it has no mass."""
        body, frame = self.loop.body(row), self.frames[row + 1]
        shape = frame.origin.value.shape
        if body is None:
            return np.zeros(shape, dtype=Real), np.zeros(shape, dtype=Real)
        mass, centre, own = self._of(body, frame)
        gravity = np.array([self._number(g) for g in self.loop.gravity], dtype=Real)
        force = mass * centre.second
        moment = own + cross(centre.value, force)
        return force - mass * gravity, moment - cross(centre.value, mass * gravity)

    def _of(self, body, frame):
        """Mass, centre of mass, and rate of the angular momentum about it, without idle spin."""
        spin, spin_rate, inertia, centre = self._body(body, frame)
        own = _times(inertia, spin_rate)
        if not body.idle:
            own = own + cross(spin, _times(inertia, spin))
        return self._number(body.mass), centre, own

    def _body(self, body, frame):
        local = np.array([[self._number(x) for x in r] for r in body.inertia], dtype=Real)
        centre = frame.origin + (frame.turn @ Jet(np.array([[self._number(x)] for x in body.centre])))[..., 0]
        if body.idle:
            u, u1, u2 = frame.axis(0).parts
            return cross(u, u1), cross(u, u2), local[1, 1] * np.eye(3, dtype=Real), centre
        spin, spin_rate = angular_velocity(frame.turn)
        turn = frame.turn.value
        return spin, spin_rate, turn @ local @ np.swapaxes(turn, -1, -2), centre

    def kinetic_power(self):
        """Rate of the kinetic energy, less the power of gravity; and the largest power of a single link."""
        total, largest = 0.0, 0.0
        for row in range(len(self.loop.rows) - 1):
            body = self.loop.body(row)
            if body is None:
                continue
            spin, spin_rate, inertia, centre = self._body(body, self.frames[row + 1])
            gravity = np.array([self._number(g) for g in self.loop.gravity], dtype=Real)
            force = self._number(body.mass) * (centre.second - gravity)
            power = dot(force, centre.rate) + dot(spin, _times(inertia, spin_rate))
            total, largest = total + power, np.maximum(largest, np.abs(power))
        return total, largest

    def kinetic_energy(self):
        total = 0.0
        for row in range(len(self.loop.rows) - 1):
            body = self.loop.body(row)
            if body is not None:
                spin, _, inertia, centre = self._body(body, self.frames[row + 1])
                total = total + self._number(body.mass) * dot(centre.rate, centre.rate) / 2
                total = total + dot(spin, _times(inertia, spin)) / 2
        return total

    def joint_wrench(self, row: int, force, moment):
        """A wrench on the link of a row at its joint, given in the frame before it: in {1} about its origin."""
        frame = self.frames[row]
        turned = _times(frame.turn.value, np.asarray(force, dtype=Real))
        about = _times(frame.turn.value, np.asarray(moment, dtype=Real))
        return turned, about + cross(frame.origin.value, turned)

    def effort(self, name: str, force, moment):
        """Power of a wrench in {1} for one unit of the rate of a variable."""
        total = 0.0
        for entry, slope, axis, place in self.axes[name]:
            if entry in ("S", "a"):
                total = total + slope * dot(axis, force)
            else:
                total = total + slope * dot(axis, moment - cross(place, force))
        return total


def _times(m, v):
    return np.einsum("...ij,...j->...i", m, v)


def moving(loop: Loop, result, sizes) -> dict[str, Jet]:
    """Joint variables of a result as jets in SI: ``sizes`` maps a unit to its size."""
    made = {}
    for v in loop.variables:
        parts = []
        for suffix in ("", ".rate", ".acceleration"):
            recorded = result.variable(v.name + suffix)
            parts.append(np.asarray(recorded.values, dtype=Real) * sizes(recorded.unit))
        made[v.name] = Jet(*parts)
    return made


def load_wrench(motion: TableMotion, row: int, times) -> tuple[np.ndarray, np.ndarray]:
    """Force, and moment about the origin of {1}, of the loads on the link of a row, without gravity."""
    loop, frame = motion.loop, motion.frames[row + 1]
    force = np.zeros_like(frame.origin.value)
    moment = np.zeros_like(force)
    known = {TIME.symbol: np.asarray(times, dtype=Real)}
    for v in loop.variables:
        known[v.quantity.symbol], known[v.rate.symbol] = motion.moving[v.name].parts[:2]

    def of(components):
        made = []
        for c in components:
            function = sp.lambdify(list(known), sp.sympify(c).xreplace(motion.known), "numpy")
            made.append(np.broadcast_to(np.asarray(function(*known.values()), dtype=Real), force.shape[:-1]))
        return np.stack(made, axis=-1)

    for load in loop.loads:
        if load.row == row:
            f, m = of(load.force), of(load.torque)
            if not load.in_ground:
                f, m = _times(frame.turn.value, f), _times(frame.turn.value, m)
            place = frame.origin.value + _times(frame.turn.value, of(load.at))
            force, moment = force + f, moment + m + cross(place, f)
    return force, moment


def link_power(motion: TableMotion, row: int, force, moment):
    """Power of a wrench in {1} about its origin on the link of a row."""
    frame = motion.frames[row + 1]
    spin, _ = angular_velocity(frame.turn)
    return dot(force, frame.origin.rate) + dot(moment - cross(frame.origin.value, force), spin)
