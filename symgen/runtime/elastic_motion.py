"""The elastic motion of one linkage, ready to be evaluated: its links, its layout, its compiled equations."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime import _beams, _core
from symgen.runtime._beams import RigidMotion
from symgen.runtime.beam_data import Lump, Profile, Properties
from symgen.runtime.beam_layout import Layout, layout
from symgen.runtime.beams import Beam, beam
from symgen.runtime.description import KernelInfo

if TYPE_CHECKING:
    from symgen.runtime.model import Model

Array = NDArray[np.float64]

#: Angle [rad] of the crank over which a pose is a good guess of the next.
_STRIDE = 0.02
#: Poses of a turn in which frequencies are looked for.
_POSES = 24
#: How closely the time at which a crank locks is found, over that time.
_LOCKED = 1e-7
#: Parts of a turn in which it is looked for.
_SAMPLES = 64


class ElasticMotion:
    """What all analyses of elastic links start from.

    Parameters
    ----------
    rigid
        The linkage with all links rigid, its crank driven.
    geometric_stiffness
        Leave it out where false, whatever the scene says.
    """

    def __init__(self, rigid: Model, geometric_stiffness: bool = True) -> None:
        info = rigid.description.elastic
        if info is None:
            raise ModelError(f"{rigid.name} has no elastic link")
        self.rigid, self.info = rigid, info
        self._stiffened = geometric_stiffness
        self._motion, self._joints = rigid.analysis("elastic_motion"), rigid.analysis("elastic_joints")
        start = rigid.initial_state()
        self._start = np.concatenate([start.q, start.u])
        found = self._motion.blocks("constants", 0.0, start.q, start.u)
        self._tables = {name: np.atleast_2d(values) for name, values in found.items()}
        crank = self._tables.get("crank", np.zeros((1, 3)))[0]
        self.angle, self.speed, self.flywheel = (float(x) for x in crank)

    @property
    def period(self) -> float:
        """Time of one turn of the crank [s]; infinite where it stands still."""
        return 2 * math.pi / abs(self.speed) if self.speed else math.inf

    def time_at(self, angle: float) -> float:
        """Return the time from 0 to one period at which the crank has a direction [rad]."""
        if not self.speed:
            if math.isclose(math.cos(angle - self.angle), 1.0, abs_tol=1e-12):
                return 0.0
            raise ModelError(
                f"the crank stands still at {math.degrees(self.angle):g} degrees: it has no speed"
            )
        turned = math.fmod(angle - self.angle, 2 * math.pi) / self.speed
        return turned if turned >= 0.0 else turned + self.period

    def angle_at(self, t: Array) -> Array:
        """Return directions of the crank [rad], from its start on, at times [s]."""
        return self.angle + self.speed * np.asarray(t)

    @cached_property
    def beams(self) -> tuple[Beam, ...]:
        """The elastic links."""
        infos = self.info.beams
        if not self._stiffened:
            infos = tuple(replace(info, geometric_stiffness=False) for info in infos)
        rows = self._tables["properties"]
        return tuple(
            beam(info, _properties(row), self._lumps(info.link), self.profiles(info.link))
            for info, row in zip(infos, rows, strict=True)
        )

    def unreduced(self) -> ElasticMotion | None:
        """Return the same with no link reduced; None where none is."""
        if not any(info.reduction for info in self.info.beams):
            return None
        made = ElasticMotion(self.rigid, self._stiffened)
        plain = tuple(replace(info, reduction="", modes=0) for info in self.info.beams)
        made.info = replace(self.info, beams=plain)
        return made

    def _lumps(self, link: str) -> tuple[Lump, ...]:
        rows = zip(self.info.lumps, self._tables.get("lumps", ()), strict=True)
        return tuple(Lump(float(at), float(mass)) for name, (at, mass) in rows if name == link)

    def profiles(self, link: str) -> tuple[Profile, ...]:
        """Return how the forces along a link lie, in the order of those in ``rigid_motion``."""
        rows = zip(self.info.loads, self._tables.get("profiles", ()), strict=True)
        return tuple(Profile(*map(float, row)) for name, row in rows if name == link)

    @cached_property
    def stations(self) -> tuple[tuple[str, int, float, float], ...]:
        """Name, number of the link, fraction of its length and fibre [m] of every station."""
        links = [b.link for b in self.info.beams]
        rows = zip(self.info.stations, self._tables.get("stations", ()), strict=True)
        return tuple((name, links.index(link), float(at), float(h)) for (name, link), (at, h) in rows)

    @cached_property
    def layout(self) -> Layout:
        """Where everything goes."""
        d = self.rigid.description
        kernel = self._joints.info("joints")
        blocks = {b.name: b for b in kernel.blocks}
        return layout(d, self.info, self.beams, blocks, self.flywheel)

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of the constraints that the elastic motion keeps."""
        blocks = self._joints.info("joints").blocks
        return next((b.rows for b in blocks if b.name == "jacobian"), ())

    @property
    def kernels_of_motion(self) -> tuple[KernelInfo, ...]:
        """What is known of the kernels of the rigid motion that elastic links move about."""
        return self._motion.description.kernels

    @property
    def kernels_of_joints(self) -> tuple[KernelInfo, ...]:
        """What is known of the kernels of what joins elastic links."""
        return self._joints.description.kernels

    @property
    def kernel_sizes(self) -> list[int]:
        """Sizes of what the kernels of the motion write; 0 of those that are not there.

        They are links, joints, torque and loads, then the set-up of these and that of joints.
        """
        of_motion = {k.name: k.out_size for k in self.kernels_of_motion}
        joints = self._joints.info("joints").out_size
        written = [of_motion["links"], joints, of_motion.get("torque", 0), of_motion.get("loads", 0)]
        return [*written, self._motion.description.derived, self._joints.description.derived]

    @property
    def stride(self) -> float:
        """The longest time [s] over which a pose is a good guess of the next."""
        return _STRIDE / abs(self.speed) if self.speed else math.inf

    @property
    def told(self) -> tuple[str, ...]:
        """What the numbers of a run depend on, besides the rigid linkage and its parameters."""
        made = self._motion.description.equations, self._joints.description.equations
        return *made, repr(self.info), repr(self._stiffened), self.layout.constants.tobytes().hex()

    def equations(self, thesis: bool = False, stepping: bool = False) -> _beams.BeamEquations:
        """Return the compiled equations, at the start of the motion; for ``stepping`` in the type of runs."""
        d = self.rigid.description
        joined = ("elastic_motion", "elastic_joints")
        links, joints = (self.rigid.analysis(kind, stepping).library.addresses for kind in joined)
        motion = RigidMotion(
            self.rigid.evaluator.equations(len(d.redundant), typed=self.rigid.typed if stepping else None),
            links,
            joints,
            self.kernel_sizes,
            0.0,
            self._start,
            self.stride,
        )
        made = _beams.BeamEquations(motion, self.layout, thesis)
        self.check(made, made.matrices(0.0)[0], 0.0)
        return made

    def rigid_motion(self, equations: _beams.BeamEquations, times: Array) -> tuple[Array, Array, Array]:
        """Return what the rigid motion is at times.

        Coordinates (times, coordinates) [m], motion of the links (times, links, 10) and forces along links
        on fixed axes (times, forces, 2) [N].
        """
        order = np.argsort(times, kind="stable")
        status, *found = equations.motion.along(np.ascontiguousarray(times[order]))
        self.check(equations, status, equations.motion.t)
        back = np.argsort(order)
        y, links, loads = (rows[back] for rows in found)
        count = len(times)
        q = y[:, : self.rigid.description.coordinates]
        return q, links.reshape(count, -1, 10), loads.reshape(count, -1, 2)

    @cached_property
    def euler_loads(self) -> tuple[float, ...]:
        """The axial load [N] under which each elastic link buckles alone."""
        from symgen.runtime.beam_checks import euler_load

        return tuple(euler_load(self, k) for k in range(len(self.beams)))

    @cached_property
    def lowest_frequency(self) -> float:
        """The lowest frequency [Hz] of the structure at rest, over the poses of a turn."""
        from symgen.runtime.elastic_modes import lowest

        equations = self.equations()
        poses = np.linspace(0.0, self.period, _POSES, endpoint=False).tolist()
        return min(lowest(self, equations, t) for t in poses)

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
        """Return the last time [s] that the rigid motion comes to, near the one where it was lost."""
        if not t:
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
            if motion.evaluate(middle)[0] == _core.DONE:
                low = middle
            else:
                high = middle
        return low


def _properties(row: Array) -> Properties:
    """Return what a row of the table ``properties`` says."""
    x = [float(v) for v in row]
    return Properties(
        length=x[0],
        mass=(x[1], x[2], x[3]),
        rotary=(x[4], x[5], x[6], x[7], x[8]),
        axial=(x[9], x[10], x[11]),
        bending=(x[12], x[13], x[14], x[15], x[16]),
        shear=(x[17], x[18], x[19]),
        fibre=(x[20], x[21]),
        modulus=x[22],
        mass_damping=x[23],
        stiffness_damping=x[24],
        ratio=x[25],
        yield_stress=x[26] or math.inf,
    )
