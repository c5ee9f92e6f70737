"""One closed loop of links by dual numbers: the derivation, each property one step of it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics.loop.dual_euler import BodyMotion, Inertia, along, joint_wrenches
from symgen.mechanics.loop.dual_paths import NOTHING, WRENCH, Paths
from symgen.mechanics.loop.dual_rows import Frame, JointMotion, motions
from symgen.scene.loop.loop import Loop, LoopLoad, Row
from symgen.scene.rods.linkage import TIME
from symgen.symbolic.dual import DualVector, Triple
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import Quantity, quantity
from symgen.symbolic.system import NamedMatrix
from symgen.symbolic.vectors import cross, dot

REFERENCE = (
    "S. Rahman, Dynamic Analysis of the Generalized Slider Crank (1991), Eqs. (1)-(68), in the corrected form"
)
#: Columns of a dual matrix, real part and dual part, and of axes and origin of a frame; rows of a screw.
DUAL = ("x", "y", "z", "dual_x", "dual_y", "dual_z")
PLACED = ("i", "j", "k", "p")
SCREW = ("wx", "wy", "wz", "vx", "vy", "vz")
_ZERO = sp.Integer(0)


class LoopDerivation:
    """Derivation of a loop: each property is one step, and an input of outputs.

    Links are numbered from 1; link k is placed by row k, and the last row places the ground.
    """

    def __init__(self, loop: Loop) -> None:
        self.loop, self.variables = loop, loop.variables
        state = [x for v in loop.variables for x in (v.quantity, v.rate, v.acceleration)]
        self.names = Names(x.name for x in (*state, *(p.quantity for p in loop.parameters)))
        symbols = [v.quantity.symbol for v in self.variables]
        self.rates = [v.rate.symbol for v in self.variables]
        self.second = [v.acceleration.symbol for v in self.variables]
        self.rows: list[tuple[JointMotion, ...]] = [
            motions(i + 1, entries(row), symbols, row.ahead) for i, row in enumerate(loop.rows)
        ]
        self.paths = Paths(self.rows, self.rates, self.names)
        #: The moving links, in order.
        self.links = [row.link for row in loop.rows[:-1]]

    @cached_property
    def closing(self) -> tuple[Quantity, ...]:
        """The wrench of the last moving link on the ground, in frame {1}."""
        about = f"of {self.links[-1]} on the ground, in the first frame"
        return tuple(
            quantity(f"closing_{letter}{a}", unit, f"{a} component of the {noun} {about}")
            for letter, unit, noun in (("f", "N", "force"), ("m", "N*m", "moment about its origin"))
            for a in "xyz"
        )

    def frame(self, link: int) -> Frame:
        """Return the pose of the frame of a link in {1}; for link 0 and the last one, that of the ground."""
        return self.paths.frames[self._end(link)]

    def velocity(self, link: int) -> DualVector:
        """Return (w; v) of the frame of a link, in it."""
        return self.paths.velocities[self._end(link)]

    def _end(self, link: int) -> int:
        return self.paths.ends[link - 1] if link else 0

    def acceleration(self, link: int) -> DualVector:
        """Return d(w; v)/dt of the frame of a link by components in it."""
        return self._accelerations[self._end(link)]

    @cached_property
    def _accelerations(self) -> list[DualVector]:
        accelerations = self.paths.accelerations(self.second, NOTHING, "")
        for acceleration, velocity in zip(accelerations, self.paths.velocities, strict=True):
            self.names.relate(acceleration, velocity)
        return accelerations

    @cached_property
    def _still(self) -> Paths:
        """The loop at rest."""
        return Paths(self.rows, [_ZERO] * len(self.variables), self.names)

    @cached_property
    def _at_rest(self) -> list[DualVector]:
        """Accelerations at rest less that of free fall: the ground carries gravity along the loop."""
        x, y, z = (-g for g in self.loop.gravity)
        return self._still.accelerations(self._still.rates, DualVector(NOTHING.real, (x, y, z)), "fall_")

    @cached_property
    def _from_free_fall(self) -> list[DualVector]:
        """Accelerations less that of free fall."""
        return [a + b for a, b in zip(self._accelerations, self._at_rest, strict=True)]

    def inertia(self, link: int) -> Inertia:
        """Return the inertia of a moving link; without mass where the scene gives none."""
        body = self.loop.body(link - 1)
        if body is None:
            return Inertia(_ZERO, NOTHING.real, sp.ImmutableMatrix(sp.zeros(3)))
        matrix = sp.Matrix(body.inertia)
        if body.idle:  # it does not take part in the spin of its frame
            matrix[0, 0] = _ZERO
        return Inertia(body.mass, body.centre, sp.ImmutableMatrix(matrix))

    @cached_property
    def bodies(self) -> list[BodyMotion]:
        """The moving links as bodies in motion, which is taken from free fall."""
        return [
            BodyMotion(
                self.inertia(k),
                self.velocity(k),
                self._from_free_fall[self._end(k)],
                self.names,
                f"link{k}",
            )
            for k in range(1, len(self.links) + 1)
        ]

    def load(self, load: LoopLoad) -> DualVector:
        """Return the wrench of a load in the frame of its link, about its origin."""
        force, torque = load.force, load.torque
        if load.in_ground:
            frame = self.frame(load.row + 1)
            force, torque = frame.seen(force), frame.seen(torque)
        name = f"load{self.loop.loads.index(load) + 1}"
        force = self.names.vector(f"f_{name}", force, "N", f"force of {load.name}")
        moment = tuple(n + x for n, x in zip(torque, cross(load.at, force), strict=True))
        return DualVector(
            force, self.names.vector(f"n_{name}", moment, "N*m", f"moment of {load.name} about the origin")
        )

    @cached_property
    def net(self) -> list[DualVector]:
        """Inertia wrench less the applied wrench of each moving link, in its frame."""
        wrenches = []
        for k, body in enumerate(self.bodies, 1):
            wrench = body.wrench if self.loop.body(k - 1) is not None else NOTHING
            for load in self.loop.loads:
                if load.row == k - 1:
                    wrench = wrench - self.load(load)
            wrenches.append(self.names.screw(f"link{k}", wrench, WRENCH, f"of inertia less loads, link {k}"))
        return wrenches

    @cached_property
    def inverse_efforts(self) -> list[sp.Expr]:
        """What motion and loads alone ask of every variable: all but the closing wrench."""
        _, efforts = joint_wrenches(self.rows, self.net, NOTHING, self.names, "own_")
        return self._by_variable(efforts, self.second)

    @cached_property
    def joints(self) -> tuple[list[DualVector], list[sp.Expr]]:
        """Wrench of each link on the next in the frame before the joint; effort at every variable."""
        fx, fy, fz, mx, my, mz = (x.symbol for x in self.closing)
        last = DualVector((fx, fy, fz), (mx, my, mz))
        wrenches, efforts = joint_wrenches(self.rows, self.net, last, self.names, "")
        return wrenches, self._by_variable(efforts, self.second)

    def _by_variable(self, efforts: list[list[sp.Expr]], second: Sequence[sp.Expr]) -> list[sp.Expr]:
        """Return the efforts of all variables: by rows those of joints, of states of mass 1 their rates."""
        terms: list[list[sp.Expr]] = [
            [a] if v.is_state else [] for v, a in zip(self.variables, second, strict=True)
        ]
        for row, effort in zip(self.rows, efforts, strict=True):
            for m, value in zip(row, effort, strict=True):
                for j, slope in m.slopes:
                    terms[j].append(slope * value)
        return [sp.Add(*t) for t in terms]

    @cached_property
    def given_efforts(self) -> list[sp.Expr]:
        """The known efforts, zero where one is to be found."""
        return [_ZERO if v.effort is None else v.effort for v in self.variables]

    @property
    def residual(self) -> list[sp.Expr]:
        """What vanishes along a free motion: efforts, for inputs their accelerations, and closure.

        Closure is that where both paths meet: it takes half of the products of closure in the first frame.
        """
        rows = [
            given - effort if v.role != "input" else jet(v.motion)[2] - v.acceleration.symbol
            for v, given, effort in zip(self.variables, self.given_efforts, self.joints[1], strict=True)
        ]
        parting = self.paths.parting
        rate = self.paths.parting_rate(self.second, self._accelerations)
        self.names.relate(rate, parting)
        return [*rows, *-rate.column]

    @property
    def free_motion(self) -> list[sp.Expr]:
        """The motion of one freedom, with accelerations from rest that are scaled to unit inertia.

        One less the inertia and the accelerations of closure, negative, vanish; the last is the power on it.
        """
        motion = self._still.accelerations(self.second, NOTHING, "free_")
        closure = self._still.parting_rate(self.second, motion)
        inertias, powers = (
            [],
            [v.effort * a for v, a in zip(self.variables, self.second, strict=True) if v.effort is not None],
        )
        for k in range(1, len(self.links) + 1):
            end = self._end(k)
            inertia, power = along(
                self.inertia(k), motion[end], self._at_rest[end], self.names, f"free_link{k}"
            )
            inertias.append(inertia)
            powers.append(power)
        powers += [self.load(x).dot(motion[self._end(x.row + 1)]).dual for x in self.loop.loads]
        return [1 - sp.Add(*inertias), *-closure.column, sp.Add(*powers)]

    @cached_property
    def mass_matrix(self) -> list[list[sp.Expr]]:
        """Derivative of the inverse efforts by the accelerations, one column for each of them.

        Links behind the meeting point move by the variables behind it alone, so it is the derivative on the
        surface of the closed loop, where it is contracted with motions of the loop.
        """
        columns = []
        for j, v in enumerate(self.variables):
            unit = [sp.Integer(int(i == j)) for i in range(len(self.variables))]
            accelerations = self._still.accelerations(unit, NOTHING, f"{v.name}_")
            net = [
                self.names.screw(
                    f"{v.name}_link{k}",
                    BodyMotion(
                        self.inertia(k), NOTHING, accelerations[self._end(k)], self.names, f"{v.name}_link{k}"
                    ).wrench,
                    WRENCH,
                    f"of inertia of link {k} at a unit of {v.acceleration.name}",
                )
                for k in range(1, len(self.links) + 1)
            ]
            _, efforts = joint_wrenches(self.rows, net, NOTHING, self.names, f"{v.name}_")
            columns.append(self._by_variable(efforts, unit))
        return [list(row) for row in zip(*columns, strict=True)]

    @cached_property
    def kinetic_energy(self) -> sp.Expr:
        """Kinetic energy [J]."""
        return sp.Add(*(body.kinetic_energy for body in self.bodies))

    def centre(self, link: int) -> Triple:
        """Return the centre of mass of a link in {1}."""
        return self.frame(link).point(self.inertia(link).centre)

    @cached_property
    def potential_energy(self) -> sp.Expr:
        """Potential of gravity, zero where all centres of mass are at the origin of {1} [J]."""
        if not any(self.loop.gravity):
            return _ZERO
        return sp.Add(
            *(
                -self.inertia(k).mass
                * self.names.scalar(f"fall{k}", dot(self.loop.gravity, self.centre(k)), "m^2/s^2", "g . r")
                for k in range(1, len(self.links) + 1)
                if self.inertia(k).mass != 0
            )
        )

    @cached_property
    def power(self) -> sp.Expr:
        """Power of drives and of the loads, without that of gravity [W]."""
        _, powers = self.joints
        efforts = [e if v.effort is None else v.effort for v, e in zip(self.variables, powers, strict=True)]
        given = zip(self.variables, efforts, self.rates, strict=True)
        terms = [e * u for v, e, u in given if not v.is_state]
        terms += [self.load(x).dot(self.velocity(x.row + 1)).dual for x in self.loop.loads]
        return sp.Add(*terms)

    @property
    def has_dynamics(self) -> bool:
        """Whether there is any mass or load."""
        return bool(self.loop.bodies or self.loop.loads)

    def check_masses(self, purpose: str) -> None:
        """Raise SceneError for a link without mass if forces are requested."""
        for k, link in enumerate(self.links, 1):
            if self.loop.body(k - 1) is None:
                raise SceneError(
                    f"link {link!r}, which row {k} ends on, has no mass, and {purpose} needs its inertia",
                    where=f"loop.links.{link}.mass",
                    hint='Give it a mass, or mass = "0 kg" to neglect it; or ask for motions alone '
                    "in analysis.outputs.",
                )

    def variable(self, name: str) -> int | None:
        """Return the number of a variable, if there is one of this name."""
        return next((j for j, v in enumerate(self.variables) if v.name == name), None)


def jet(motion: sp.Expr) -> list[sp.Expr]:
    """Return value, rate and acceleration of a prescribed motion."""
    t = TIME.symbol
    rate = sp.diff(motion, t)
    return [motion, rate, sp.diff(rate, t)]


def entries(row: Row) -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """Return the entries of a row in the order of their motions."""
    return row.theta, row.S, row.eta, row.alpha, row.a


def named(
    name: str,
    entries: sp.MatrixBase,
    unit: str,
    description: str,
    rows: Sequence[str] = (),
    columns: Sequence[str] = (),
    left: Sequence[sp.Expr] | sp.Expr = (),
) -> NamedMatrix:
    """Return a NamedMatrix of any matrix, with its left side or those of its rows."""
    sides = left if isinstance(left, sp.Expr) else sp.ImmutableMatrix(left) if left else None
    matrix = sp.ImmutableMatrix(entries)
    return NamedMatrix(name, matrix, unit, description, tuple(rows), tuple(columns), left=sides)
