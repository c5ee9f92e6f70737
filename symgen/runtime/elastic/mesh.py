"""Elements along elastic links: where they meet, their default number, and the error that it leaves.

The elastic motion of a linkage with its links divided into them, and its lowest frequency.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from symgen.runtime import _beams, _core
from symgen.runtime._beams import APPLIED, MOTION
from symgen.runtime.arrays import Array
from symgen.runtime.beams.checks import held_alone
from symgen.runtime.beams.data import Properties
from symgen.runtime.beams.elements import at as value_at
from symgen.runtime.beams.elements import meshed
from symgen.runtime.beams.frames import frames
from symgen.runtime.beams.layout import layout
from symgen.runtime.beams.links import Beam, beam
from symgen.runtime.beams.modal.damping import stiffened
from symgen.runtime.beams.modal.structure import UnstableError, forces_of_modes
from symgen.runtime.beams.pieces import whole
from symgen.runtime.elastic.modes import elastic_modes, lowest
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.steps import turn
from symgen.runtime.integrate.pace import OutOfTime
from symgen.runtime.kernels.elastic_description import BeamInfo
from symgen.runtime.result.records import Variable

#: Error of the number of elements chosen by default, over the peak stress of a station and over a frequency.
ENOUGH = 1e-2
#: Most elements of a link that are chosen by default.
_MOST_ELEMENTS = 16
#: Frequencies of a link by which they are chosen.
_MODES = 2
#: Poses of a revolution in which loads are evaluated.
_POSES = 12
#: Poses of a revolution at which frequencies are computed.
_IN_A_TURN = 24
#: Modes whose damping ratios results hold.
_DAMPED = 3


class MeshedMotion(ElasticMotion):
    """An elastic motion whose links have their elements, those chosen by default included."""

    @cached_property
    def beams(self) -> tuple[Beam, ...]:
        """The elastic links."""
        factor = self.modal_damping[1]
        if not factor:
            return self.plain_beams
        return tuple(replace(plain, pieces=stiffened(plain.pieces, factor)) for plain in self.plain_beams)

    @cached_property
    def modal_damping(self) -> tuple[Array | None, float]:
        """Forces of modes of the structure with damping ratios at the start, and the factor [s]."""
        if "modal_damping" not in self._tables:
            return None, 0.0
        blocks = {b.name: b for b in self.joints.info("joints").blocks}
        plain = layout(self.rigid.description, self.info, self.plain_beams, blocks)
        equations = _beams.BeamEquations(self._moved(None), plain, False)
        self.check(equations, equations.matrices(0.0, _beams.AT_REST)[0], 0.0)
        ratios = np.ravel(self._tables["modal_damping"])
        name, every = self.rigid.name, self.info.damps_all
        return forces_of_modes(name, equations, plain, self.plain_beams, ratios, every)

    @cached_property
    def plain_beams(self) -> tuple[Beam, ...]:
        """The elastic links, without the damping of modes of the structure."""
        infos = self.info.beams
        if not self.stiffened:
            infos = tuple(replace(info, geometric_stiffness=False) for info in infos)
        rows = self._tables["properties"]
        beams = []
        for k, (info, row) in enumerate(zip(infos, rows, strict=True)):
            properties, lumps, profiles = properties_of(row), self.lumps(info.link), self.profiles(info.link)
            if not info.nodes:
                info = replace(info, between=self.between(info.link))  # noqa: PLW2901
            if not info.elements:
                info = chosen(self, k, info, properties)  # noqa: PLW2901
            elif not info.nodes:
                info = meshed(info, properties.length, lumps, profiles)  # noqa: PLW2901
            beams.append(beam(info, properties, lumps, profiles))
        return tuple(beams)

    @cached_property
    def lowest_frequency(self) -> float:
        """The lowest frequency [Hz] of the structure at rest, over the stable poses of a revolution.

        Raises
        ------
        UnstableError
            When the structure is unstable at rest in every pose.
        """
        if self._driven:
            return self._driven.lowest_frequency
        self.check_determined()
        equations = self.equations()
        # A crank that stands still has one pose.
        count = _IN_A_TURN if self.speed or self.info.prescribed else 1
        poses = np.linspace(0.0, turn(self), count, endpoint=False).tolist()
        frequencies = []
        for t in poses:
            try:
                frequencies.append(lowest(self, equations, t))
            except UnstableError as error:
                unstable = error
        if not frequencies:
            raise unstable
        return min(frequencies)

    @cached_property
    def damping_ratios(self) -> list[float]:
        """Damping ratios of the lowest modes at the start, where links or modes have one; else empty."""
        if self.modal_damping[0] is None and not any(plain.properties.ratio for plain in self.beams):
            return []
        try:
            modes = elastic_modes(self, self.equations(), 0.0)
        except UnstableError:
            return []
        return modes.ratios[modes.rigid : modes.rigid + _DAMPED].tolist()

    def unreduced(self) -> MeshedMotion | None:
        """Return the same structure without reduction; None if no link is reduced."""
        if not any(info.reduction for info in self.info.beams):
            return None
        return self._with(tuple(replace(beam.info, reduction="", modes=0) for beam in self.beams))

    @cached_property
    def refined(self) -> MeshedMotion:
        """The same structure with halved elements, computed once for all poses."""
        return self._with(tuple(halved(beam.info) for beam in self.beams))

    def __copy__(self) -> MeshedMotion:
        """Return a copy, which may be changed: without the motion of halved elements."""
        copied = object.__new__(type(self))
        vars(copied).update((name, value) for name, value in vars(self).items() if name != "refined")
        return copied

    def _with(self, beams: tuple[BeamInfo, ...]) -> MeshedMotion:
        motion = MeshedMotion(self.rigid, self.stiffened, self._with_motor)
        motion.info = replace(self.info, beams=beams)
        motion._path, motion._driven, motion.jumps = self._path, self._driven, self.jumps
        return motion


def properties_of(row: Array) -> Properties:
    """Return the properties in a row of the table ``properties``."""
    x = row.tolist()
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


def halved(info: BeamInfo) -> BeamInfo:
    """Return a link with every element divided in two."""
    nodes = tuple(x for a, b in pairwise(info.nodes) for x in (a, (a + b) / 2))
    return replace(info, elements=2 * info.elements, nodes=(*nodes, info.nodes[-1]) if nodes else ())


def chosen(motion: ElasticMotion, k: int, info: BeamInfo, properties: Properties) -> BeamInfo:
    """Return a link with enough elements: halving them changes stresses and frequencies by ``ENOUGH``.

    The link is taken alone, its ends held as in Euler's load, under the loads of the rigid motion.
    """
    lumps, profiles = motion.lumps(info.link), motion.profiles(info.link)
    poses = _loads_of_poses(motion, k)
    places = [at for _, link, at, _ in motion.stations if link == k] or [0.5]
    # The axial force of the joints does not depend on the number of elements, and counts in the peak only.
    pull = np.zeros((len(poses[0]), len(places)))
    coarse = meshed(replace(info, elements=1), properties.length, lumps, profiles)
    if f"u@{coarse.elements + 1}" in held_alone(motion, coarse):
        area = [value_at(properties.axial, at * properties.length) / properties.modulus for at in places]
        pull += np.abs(frames(poses[0]).stiffness_geometric0)[:, None] / area

    def response(info: BeamInfo) -> tuple[Array, Array]:
        full = beam(replace(info, reduction="", modes=0), replace(properties, ratio=0.0), lumps, profiles)
        return _alone(motion, full, poses, places)

    count, before = 1, response(coarse)
    while count < _MOST_ELEMENTS:
        fine = halved(coarse)
        after = response(fine)
        if _gap(before[0], after[0], pull) <= ENOUGH and np.all(np.abs(before[1] / after[1] - 1) <= ENOUGH):
            break
        count, coarse, before = 2 * count, fine, after
    return coarse


def _gap(coarse: Array, fine: Array, besides: Array | float = 0.0, least: float = 0.0) -> float:
    """Return the largest difference of stresses (poses, stations) over the peak of their station.

    ``besides`` are sizes of stresses that both leave out; lower peaks count as ``least``.
    """
    peak = np.max(np.abs(fine) + besides, axis=0, initial=least)
    largest = np.max(np.abs(coarse - fine), axis=0, initial=0.0)
    shown = peak > 1e-9 * np.max(peak, initial=0.0)
    return float(np.max(largest[shown] / peak[shown], initial=0.0))


def _loads_of_poses(motion: ElasticMotion, k: int) -> tuple[Array, Array]:
    """Return the weights of a link and those of forces along links (poses, forces, columns) in some poses."""
    moved = motion.moved()
    links, loads = [], []
    times = np.linspace(0.0, turn(motion), _POSES, endpoint=False).tolist()
    for t in [0.0] if motion.undetermined else times:
        status, _, points, _, _, forces = moved.evaluate(t)
        if status != _core.DONE:
            break  # the run says why
        links.append(points.reshape(-1, len(MOTION))[k])
        loads.append(forces.reshape(-1, len(APPLIED)))
    return np.array(links).reshape(-1, len(MOTION)), np.array(loads).reshape(len(links), -1, len(APPLIED))


def _alone(
    motion: ElasticMotion, plain: Beam, poses: tuple[Array, Array], places: Sequence[float]
) -> tuple[Array, Array]:
    """Return stresses (poses, stations) in the outer fibre and the lowest frequencies of a link alone."""
    from scipy.linalg import eigh

    info, properties = plain.info, plain.properties
    fixed = {plain.dofs[j] for j in plain.fixed} | held_alone(motion, info)
    free = [j for j, dof in enumerate(plain.dofs) if dof not in fixed]
    total = whole(plain.pieces, len(plain.dofs))
    axes = frames(poses[0])
    load = axes.load(total.load_x, total.load_y, total.load_out, total.load_turn)
    loads = [i for i, name in enumerate(motion.info.loads) if name == info.link]
    for i, x, y in zip(loads, total.force_x, total.force_y, strict=True):
        load += np.outer(poses[1][:, i, 0], x) + np.outer(poses[1][:, i, 1], y)
    there = np.ix_(free, free)
    shape = np.zeros_like(load)
    shape[:, free] = np.linalg.solve(total.stiffness[there], load[:, free].T).T
    table = plain.table(places)
    fibre = np.array([value_at(properties.fibre, x * properties.length) for x in places])
    stress = shape @ table["axial_strain"].T, fibre * (shape @ table["curvature"].T)
    count = min(_MODES, len(free))
    squares = eigh(
        total.stiffness[there], total.mass[there], eigvals_only=True, subset_by_index=(0, count - 1)
    )
    return properties.modulus * (stress[0] + stress[1]), np.sqrt(squares)


def unknown(problem: Exception) -> str:
    """Return in a line why a run with twice the elements gives no error by elements."""
    return "max_wall is spent" if isinstance(problem, OutOfTime) else str(problem).partition("\n")[0]


def mesh_error(coarse: Sequence[Variable], fine: Sequence[Variable], least: float = 0.0) -> float:
    """Return the difference of stresses of two runs over their peak at a station, the largest of all.

    Lower peaks count as ``least`` [Pa].
    """
    pairs = [(a.values, b.values) for a, b in zip(coarse, fine, strict=True) if b.name.endswith(".stress")]
    if not pairs:
        return 0.0
    before, after = (np.stack(values, axis=1) for values in zip(*pairs, strict=True))
    return _gap(before, after, least=least)
