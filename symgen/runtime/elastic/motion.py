"""The elastic motion of one linkage, ready to be evaluated: its links, its layout, its compiled equations."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from symgen.errors import ModelError, SimulationError, check_joints
from symgen.runtime import _beams, _core
from symgen.runtime._beams import APPLIED, MOTION, RigidMotion
from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import Lump, Profile
from symgen.runtime.beams.frames import frames
from symgen.runtime.beams.layout import BeamLayout, layout
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.path import PRESCRIBED, MotorDrivenLinkage, RigidMotionTable
from symgen.runtime.kernels.description import KernelInfo
from symgen.runtime.rods.model.rods import RodModel

#: Angle [rad] of the crank over which a pose is a good guess of the next.
_STRIDE = 0.02
#: Times of a run at which a prescribed angle is computed, for its largest rate.
_LOOKS = 1000
#: Error of the time at which a crank locks, over that time.
_LOCKED = 1e-7
#: Parts of a revolution in which this time is searched.
_SAMPLES = 64
#: Least singular value of the constraint Jacobian over the largest, and least component of a free motion.
_RANK = 1e-9


class ElasticMotion(ABC):
    """What all analyses of elastic links start from; :mod:`symgen.runtime.elastic.mesh` divides the links.

    Parameters
    ----------
    rigid
        The linkage with all links rigid, its crank driven.
    geometric_stiffness
        Leave it out where false, whatever the scene says.
    with_motor
        Gives the rigid linkage with its motor in place of the drive of the crank.
    """

    def __init__(
        self,
        rigid: RodModel,
        geometric_stiffness: bool = True,
        with_motor: Callable[[], RodModel] | None = None,
    ) -> None:
        info = rigid.description.elastic
        if info is None:
            raise ModelError(f"{rigid.name} has no elastic link")
        self.rigid, self.info = rigid, info
        self.stiffened, self._with_motor = geometric_stiffness, with_motor
        self._path: RigidMotionTable | None = None
        self._driven: ElasticMotion | None = None
        #: The last time before and the first after every jump of the loads [s], on which steps end.
        self.jumps: Array = np.zeros((0, 2))
        self._motion, self.joints = rigid.analysis("elastic_motion"), rigid.analysis("elastic_joints")
        start = rigid.initial_state()
        self._start = np.concatenate([start.q, start.u])
        constants = self._motion.blocks("constants", 0.0, start.q, start.u)
        self._tables = {name: np.atleast_2d(values) for name, values in constants.items()}
        crank = self._tables.get("crank", np.zeros((1, 2)))[0]
        self.angle, self.speed = (float(x) for x in crank)

    @cached_property
    def machine(self) -> MotorDrivenLinkage:
        """The rigid linkage with its motor."""
        if self._with_motor is None:
            raise ModelError(f"{self.rigid.name} was created without its motor: build it with symgen.build")
        return MotorDrivenLinkage(self.rigid, self.info.crank, self.angle, self.speed, self._with_motor())

    @property
    def has_motor(self) -> bool:
        """Whether a motor gives the crank its rigid motion."""
        return self.info.mode == "motor" and bool(self.speed)

    def about(self, path: RigidMotionTable) -> ElasticMotion:
        """Return the motion about a rigid motion that was integrated with the motor."""
        copied = copy.copy(self)
        copied._path, copied._driven = path, self
        return copied

    def with_constants(self, tables: Mapping[str, Array], beams: Sequence[Beam] = ()) -> ElasticMotion:
        """Return the motion with other constants, and other elastic links of the same unknowns."""
        copied = copy.copy(self)
        vars(copied).update(_tables=dict(tables), layout=self.layout, beams=tuple(beams))
        vars(copied).pop("stations", None)
        return copied

    def ending_on(self, jumps: Array) -> ElasticMotion:
        """Return the motion with steps that end on jumps of the loads (jumps, 2) [s]."""
        if not len(jumps):
            return self  # which keeps its frequencies from run to run
        copied = copy.copy(self)
        copied.jumps = jumps
        return copied

    @property
    def period(self) -> float:
        """Time of one revolution of the crank [s], at the scene's speed unless steady; infinite at rest."""
        if self._path and self._path.repeats:
            return self._path.end
        return 2 * math.pi / abs(self.speed) if self.speed else math.inf

    @property
    def without_revolutions(self) -> str:
        """Reason why the crank has no revolutions, if it has no speed."""
        if self.info.prescribed:
            return "the angle of the crank is a function of the time"
        return f"the crank stands still at {math.degrees(self.angle):g} degrees: it has no speed"

    def time_at(self, angle: float, revolutions: int = 0) -> float:
        """Return the first time [s], after a number of revolutions, at which the crank has an angle [rad]."""
        if not self.speed:
            if math.isclose(math.cos(angle - self.angle), 1.0, abs_tol=1e-12):
                return 0.0
            raise ModelError(
                f"{self.without_revolutions}; expected its angle at the start\n"
                "  Leave the angle out; give t_eval, times [s], to simulate."
            )
        if self._path:
            return self._path.time_of(angle, revolutions)
        turned = math.fmod(angle - self.angle, 2 * math.pi) / self.speed
        if turned:
            self.check_determined()
        return self.period * revolutions + (turned if turned >= 0.0 else turned + self.period)

    def angle_at(self, t: Array) -> Array:
        """Return directions of the crank [rad], from its start on, at times [s]."""
        if self._path:
            return self._path.angle_at(np.asarray(t, dtype=float))
        if self.info.prescribed:
            return np.vectorize(self._prescribed, otypes=[float])(t)
        return self.angle + self.speed * np.asarray(t)

    def _prescribed(self, t: float) -> float:
        q, u = np.split(self._start, 2)
        return float(self._motion.blocks("constants", t, q, u)["crank"].flat[0])

    @property
    @abstractmethod
    def beams(self) -> tuple[Beam, ...]:
        """The elastic links."""

    @property
    @abstractmethod
    def modal_damping(self) -> tuple[Array | None, float]:
        """Forces of modes of the structure with damping ratios, and the factor of stiffness [s]."""

    @property
    @abstractmethod
    def lowest_frequency(self) -> float:
        """The lowest frequency [Hz] of the structure at rest, over the poses of a revolution."""

    @property
    @abstractmethod
    def damping_ratios(self) -> list[float]:
        """Damping ratios of the lowest modes at the start, where links or modes have one; else empty."""

    @abstractmethod
    def unreduced(self) -> ElasticMotion | None:
        """Return the same motion without reduction; None if no link is reduced."""

    @property
    @abstractmethod
    def refined(self) -> ElasticMotion:
        """The same with every element of every link divided in two."""

    def lumps(self, link: str) -> tuple[Lump, ...]:
        """Return the masses along a link."""
        rows = zip(self.info.lumps, self._tables.get("lumps", ()), strict=True)
        return tuple(Lump(*row.tolist()) for name, row in rows if name == link)

    def profiles(self, link: str) -> tuple[Profile, ...]:
        """Return how the forces along a link lie, in the order of those in ``rigid_motion``."""
        rows = zip(self.info.loads, self._tables.get("profiles", ()), strict=True)
        return tuple(Profile(*row.tolist()) for name, row in rows if name == link)

    def between(self, link: str) -> tuple[tuple[str, float], ...]:
        """Return the joints between the ends of a link, checked: names of points, fractions of its length."""
        joints = [j for k, j in zip(self.info.loads, self.info.joints, strict=True) if k == link]
        length = float(self._tables["properties"][[b.link for b in self.info.beams].index(link)][0])
        places = [profile.at / length for profile in self.profiles(link)]
        joints_between = [(joint, at) for joint, at in zip(joints, places, strict=True) if joint]
        info = next(b for b in self.info.beams if b.link == link)
        check_joints(link, (info.start, info.end), joints_between)
        if joints_between != sorted(joints_between, key=lambda pair: pair[1]):
            names = ", ".join(joint for joint, _ in joints_between)
            raise ModelError(f"joints change their order along {link}: {names}\n  Build the scene again.")
        return tuple(joints_between)

    @cached_property
    def stations(self) -> tuple[tuple[str, int, float, float], ...]:
        """Name, number of the link, fraction of its length and fibre [m] of every station."""
        links = [b.link for b in self.info.beams]
        rows = zip(self.info.stations, self._tables.get("stations", ()), strict=True)
        return tuple((name, links.index(link), *row.tolist()) for (name, link), row in rows)

    @cached_property
    def layout(self) -> BeamLayout:
        """Layout of the equations."""
        d = self.rigid.description
        blocks = {b.name: b for b in self.joints.info("joints").blocks}
        return layout(d, self.info, self.beams, blocks, self.modal_damping[0])

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of the constraints that the elastic motion keeps."""
        blocks = self.joints.info("joints").blocks
        return next((b.rows for b in blocks if b.name == "jacobian"), ())

    @property
    def kernels_of_motion(self) -> tuple[KernelInfo, ...]:
        """Names and sizes of the kernels of the rigid motion that elastic links move about."""
        return self._motion.description.kernels

    @property
    def kernels_of_joints(self) -> tuple[KernelInfo, ...]:
        """Names and sizes of the kernels of the joints of elastic links."""
        return self.joints.description.kernels

    @property
    def kernel_sizes(self) -> dict[str, int]:
        """Output sizes of the kernels of the motion by name; 0 for absent ones."""
        of_motion = {k.name: k.out_size for k in self.kernels_of_motion}
        return {
            **{name: of_motion.get(name, 0) for name in ("links", "shaft", "loads")},
            "joints": self.joints.info("joints").out_size,
            "setup": self._motion.description.derived,
            "joints_setup": self.joints.description.derived,
        }

    @cached_property
    def stride(self) -> float:
        """The longest time [s] over which a pose is a good guess of the next."""
        fastest = abs(self.speed)
        if self.info.prescribed:
            times = np.linspace(0.0, self.rigid.description.t_end, _LOOKS)
            fastest = float(np.max(np.abs(np.diff(self.angle_at(times))))) / times[1]
        return _STRIDE / fastest if fastest else math.inf

    @property
    def identity(self) -> tuple[str, ...]:
        """Data that determine a run, in addition to the rigid linkage and its parameters."""
        hashes = self._motion.description.equations, self.joints.description.equations
        names, constants = repr(self.layout.names), self.layout.constants.tobytes().hex()
        return *hashes, repr(self.info), repr(self.stiffened), names, constants

    def equations(self, thesis: bool = False, stepping: bool = False) -> _beams.BeamEquations:
        """Return the compiled equations, at the start of the motion; for ``stepping`` in the type of runs."""
        equations_of_motion = _beams.BeamEquations(self.moved(stepping), self.layout, thesis)
        self.check(equations_of_motion, equations_of_motion.sparse(0.0)[0], 0.0)
        return equations_of_motion

    def moved(self, stepping: bool = False) -> RigidMotion:
        """Return the rigid motion at its start, to be followed in time."""
        return self._moved(self._path, stepping)

    def _moved(self, path: RigidMotionTable | None, stepping: bool = False) -> RigidMotion:
        d = self.rigid.description
        links, joints, typed = self._motion.library, self.joints.library, None
        if stepping and (typed := self.rigid.typed):
            links, joints = (self.rigid.analysis(f"elastic_{k}", True).library for k in ("motion", "joints"))
        driven = self.rigid.evaluator.equations(len(d.redundant), typed=typed)
        return RigidMotion(
            self.machine.equations() if path else driven,
            links,
            joints,
            self.kernel_sizes,
            0.0,
            self._start,
            self.stride,
            path,
        )

    def rigid_crank(self, times: Array, q: Array) -> tuple[Array, Array]:
        """Return d theta/d r [1/m] and d r/d theta [m] of a rigid crank, (times, 2) each.

        ``q`` are the coordinates of the rigid linkage at the times, (times, coordinates) [m].
        """
        rows = self._motion.many("crank_rotation", times, q, np.zeros_like(q))
        return rows[:, :2], rows[:, 2:]

    def rigid_motion(
        self, equations: _beams.BeamEquations, times: Array
    ) -> tuple[tuple[Array, Array, Array], Array, Array]:
        """Return the rigid motion at times.

        Coordinates and rates (times, coordinates) [m, m/s], and accelerations followed by the multipliers;
        then the weights of links (times, links, columns) and of forces along links (times, forces, columns):
        see :mod:`symgen.runtime.beams.frames`.
        """
        order = np.argsort(times, kind="stable")
        status, *arrays = equations.motion.along(np.ascontiguousarray(times[order]))
        self.check(equations, status, equations.motion.t)
        back = np.argsort(order)
        y, solutions, links, loads = (rows[back] for rows in arrays)
        n, count = self.rigid.description.coordinates, len(times)
        solutions = self._path.with_drive(solutions, n) if self._path else solutions
        links, loads = links.reshape(count, -1, len(MOTION)), loads.reshape(count, -1, len(APPLIED))
        return (y[:, :n], y[:, n:], solutions), links, loads

    def local_unknowns(self, k: int, links: Array, displacements: Array) -> Array:
        """Return the unknowns of a link in its own axes, (times, n).

        ``links`` is the motion of the links, (times, links, columns), ``displacements`` (times, unknowns).
        """
        local: Array = displacements[:, self.layout.of_links[k]]
        local[:, self.layout.of_links[k] < 0] = 0.0
        u, w = (list(ends) for ends in zip(*self.beams[k].joints, strict=True))
        along, across = frames(links[:, k]).local(local[:, u].T, local[:, w].T)
        local[:, u], local[:, w] = along.T, across.T
        return local

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """Points whose rigid motion the crank and the drivers leave free, at the start."""
        d = self.rigid.description
        q, still = self._start[: d.coordinates], np.zeros(d.coordinates)
        matrix = self.rigid.evaluator.blocks("constraint_jacobian", 0.0, q, still)["constraint_jacobian"]
        jacobian = matrix.reshape(-1, d.coordinates)[:, : d.of_points]
        jacobian = jacobian / np.linalg.norm(jacobian, axis=1)[:, None]
        values, right = np.linalg.svd(jacobian)[1:]
        free = right[np.count_nonzero(values > _RANK * values.max(initial=0.0)) :]
        moves = np.max(np.abs(free), axis=0, initial=0.0).reshape(-1, 2).max(axis=1)
        return tuple(p for p, size in zip(d.free, moves, strict=True) if size > _RANK)

    def check_determined(self) -> None:
        """Check that the crank and the drivers determine the rigid motion of every point, without states.

        Raises
        ------
        ModelError
            Naming the points that they leave free.
        """
        if self.rigid.description.states:
            raise ModelError(f"{self.rigid.name}: {PRESCRIBED}")
        if self.undetermined:
            raise ModelError(
                f"{self.rigid.name}: the crank, {self.info.crank}, does not determine the rigid motion of "
                f"{', '.join(self.undetermined)}: linear theory needs a rigid motion that crank and drivers "
                "prescribe\n  Large rotation integrates free coordinates: model.large_rotation(elements=4), "
                f"'symgen large-rotation {self.rigid.name} --elements 4'; or drive the free motions: rigid "
                "links by [[drivers]], elastic ones by guides or more links."
            )

    def check(self, equations: _beams.BeamEquations, status: int, t: float) -> None:
        """Raise SimulationError where the equations could not be assembled at a time, or a step failed."""
        if status == _core.DONE:
            return
        d = self.rigid.description
        locked = status in (_core.SINGULAR, _core.PROJECTION_FAILED)
        bound = status == _core.SINGULAR and equations.soundness <= equations.rank_tolerance
        if locked and not bound:
            t = self._last_near(t)
        at = f"{math.degrees(float(self.angle_at(np.array(t)))):.4g} degrees"
        if bound:
            problem = f"the rigid links and guides bind each other at crank angle {at}: they lose rank"
        elif locked:
            problem = (
                f"the crank, {self.info.crank}, cannot turn past {at}: the linkage comes to a dead centre or "
                "cannot be assembled beyond\n"
                "  Change the lengths so that it closes at every angle of the crank."
            )
        elif status in (_core.STEP_TOO_SMALL, _core.MORE):
            problem = (
                f"the steps are too short for the run to come to its end at crank angle {at}: the links are "
                "too stiff for this method, or the tolerance cannot be met\n"
                "  Take method gauss, or a larger rtol."
            )
        else:
            problem = f"a number that is not finite appeared at crank angle {at}"
        raise SimulationError(f"{d.file or d.title}: {problem}", time=t)

    def _last_near(self, t: float) -> float:
        """Return the last time [s] that the rigid motion reaches, near the time at which it was lost."""
        if not t or self._path:
            return t
        low, high, motion = 0.0, t, self.equations().motion
        # It may be the last that was reached, up to a sample before.
        step = self.period / _SAMPLES if self.speed else 0.0
        for _ in range(_SAMPLES if step else 0):
            if motion.evaluate(high)[0] != _core.DONE:
                break
            low, high = high, high + step
        while high - low > _LOCKED * t:
            motion = self.equations().motion
            middle = (low + high) / 2
            reached = motion.evaluate(middle)[0] == _core.DONE
            low, high = (middle, high) if reached else (low, middle)
        return low
