"""Recorded outputs of elastic links: strains, stresses, displacements, rotations, lengths; errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from threading import RLock
from typing import Any

import numpy as np

from symgen.errors import SimulationError
from symgen.precision import FLOAT64
from symgen.runtime import _beams
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.forces import RunMotion, crank_rotation
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.kernels.description import Description
from symgen.runtime.result.modes import ElasticModes
from symgen.runtime.result.records import Coordinate, Variable, over_time

Counts = Indices

#: Part of the largest stress below which one is round-off.
_NOISE = 1e-9
#: Steps of the run that a run is compared with, over its own.
FINER = 1.2
#: Error estimate over the error that the difference of both shows.
SAFETY = 5.0
#: Least and largest error of a run with fewer steps, over that of a run, where errors have the order of the
#: method.
FEWER = (2.2, 5.2)
#: Error estimate over the difference to such a run. So the estimates of all methods were 3.3 to 19 times the
#: error of runs of shipped scenes, those included whose steps do not resolve vibrations.
SAFETY_FEWER = 4.5
#: Runs in a row after which errors that grow are round-off, in types coarser than doubles.
_ROUNDED = 2
#: The least number of times that runs with fewer and with more steps are compared at, if not at all.
_SHARED = 60


def outputs(motion: ElasticMotion, links: Array, displacements: Array) -> list[Variable]:
    """Return strains at stations, displacements, rotations and curvatures at joints, changes of length.

    Parameters
    ----------
    links
        Motion of the links, (times, links, columns).
    displacements
        (times, unknowns).
    """
    local = [motion.local_unknowns(k, links, displacements) for k in range(len(motion.beams))]
    variables = _strains(motion, local)
    names = motion.layout.names
    for point in motion.rigid.description.free:
        columns = [names.index(f"{point}.{axis}") for axis in "xy"]
        variables.append(displacement(point, displacements[:, columns]))
    ground = set(motion.rigid.description.ground)
    for beam, values in zip(motion.beams, local, strict=True):
        info = beam.info
        # The ground holds the distance of its points: a bent link between them is stretched.
        held = {info.start, info.end} <= ground
        (u0, _), *_, (u1, _) = beam.joints
        shortened = _shortening(beam, values)
        apart = 0.0 * shortened if held else values[:, u1] - values[:, u0] - shortened
        variables.append(length_change(info.link, apart))
        about = f"change of the length of the deformed centre line of {info.link}"
        variables.append(Variable(f"{info.link}.arc_length_change", "m", about, (), apart + shortened))
        variables += _at_joints(beam, values)
    return variables


def of_states(d: Description, v: Array, a: Array) -> Iterator[Variable]:
    """Yield first-order states and their rates, by rates and second rates of all unknowns."""
    of_rates = d.elastic.states if d.elastic else ()
    for k, ((name, unit), (of_rate, about)) in enumerate(zip(d.states.items(), of_rates, strict=True)):
        at = d.of_points + k
        yield Variable(name, unit, about, (), v[:, at])
        yield Variable(f"{name}.rate", of_rate, f"rate of {about}", (), a[:, at])


def _at_joints(beam: Beam, local: Array) -> Iterator[Variable]:
    """Yield rotation and curvature of a link at its joints."""
    info = beam.info
    for point, node in zip(info.points, info.joint_nodes, strict=True):
        rows = beam.rows(info.node(node))
        about = f"rotation of the section of {info.link} at {point} from the rigid motion"
        yield Variable(f"{info.link}.{point}.rotation", "rad", about, (), local @ rows.rotation)
        about = f"curvature of {info.link} at {point}"
        yield Variable(f"{info.link}.{point}.curvature", "1/m", about, (), local @ rows.curvature)


def _strains(motion: ElasticMotion, local: Sequence[Array]) -> list[Variable]:
    """Return strains at the stations by the unknowns of each link on its axes, (times, n)."""
    variables = []
    for name, k, at, fibre in motion.stations:
        beam = motion.beams[k]
        rows = beam.rows(at)
        bending, axial = local[k] @ rows.curvature * fibre, local[k] @ rows.axial_strain
        variables += strains(name, beam, at, bending, axial)
    return variables


def coordinate_of(motion: ElasticMotion, times: Array) -> Coordinate:
    """Return the direction of the crank at times [s], or these where the crank is at rest."""
    if not motion.speed:
        return over_time(times)
    return Coordinate("angle", "rad", "crank angle", motion.angle_at(times))


def strains(name: str, beam: Beam, at: float, bending: Array, axial: Array) -> list[Variable]:
    """Return the outputs of a station at a share of a link's length, from its strains over time."""
    where = f"{beam.info.link}, at {at:g} of its length"
    stress = beam.properties.modulus * (bending + axial)
    return [
        Variable(f"{name}.bending_strain", "1", f"bending strain in the fibre of {where}", (), bending),
        Variable(f"{name}.axial_strain", "1", f"axial strain of {where}", (), axial),
        Variable(f"{name}.stress", "Pa", f"stress in the fibre of {where}", (), stress),
    ]


def displacement(point: str, values: Array) -> Variable:
    """Return the output of a point's displacement [m], (times, 2)."""
    about = f"displacement of {point} from the rigid motion"
    return Variable(f"{point}.displacement", "m", about, ("x", "y"), values)


def position(point: str, values: Array) -> Variable:
    """Return the output of a point's place [m], (times, 2)."""
    return Variable(f"{point}.position", "m", f"deformed position of {point}", ("x", "y"), values)


def length_change(link: str, values: Array) -> Variable:
    """Return the output of the change of the distance between the ends of a link [m]."""
    about = f"change of the distance between the ends of {link}"
    return Variable(f"{link}.length_change", "m", about, (), values)


def _shortening(beam: Beam, local: Array) -> Array:
    """Return by how much bending brings the ends of a link closer [m], to the second order.

    Half the integral of the square of the slope from the line between the ends: turning the link as a whole
    changes nothing, however far linear displacements go.
    """
    (_, w0), *_, (_, w1) = beam.joints
    turned = (local[:, w1] - local[:, w0]) / beam.properties.length
    whole = local if beam.expansion is None else local @ beam.expansion.T
    shortened = -beam.properties.length * turned**2
    for part in beam.segments:
        here = whole[:, list(part.dofs)]
        shortened += np.einsum("ti,ij,tj->t", here, part.matrix("geometric", 3)[0], here)
    return np.asarray(shortened / 2)


def recovered(motion: ElasticMotion, run: RunMotion) -> list[Variable]:
    """Return positions of moving joints, deflections at stations, greatest stresses, and the crank angle."""
    d, names, variables = motion.rigid.description, motion.layout.names, []
    for k, point in enumerate(d.free):
        columns = [names.index(f"{point}.{axis}") for axis in d.axes]
        place = run.q[:, 2 * k : 2 * k + 2] + run.displacements[:, columns]
        variables.append(position(point, place))
    for name, k, at, _ in motion.stations:
        beam = motion.beams[k]
        local = run.local(motion, k)
        variables.append(bow(name, beam, at, deflection(beam, local, at)))
    for k, beam in enumerate(motion.beams):
        if not any(beam.properties.fibre):  # no section is given
            continue
        local = run.local(motion, k)
        stress, place = beam.greatest_stress(local)
        link = beam.info.link
        about = f"greatest stress of both outer fibres of {link}, over its length"
        variables.append(Variable(f"{link}.greatest_stress", "Pa", about, (), stress))
        about = f"fraction of the length of {link} at which its stress is greatest"
        variables.append(Variable(f"{link}.greatest_stress_at", "1", about, (), place))
    crank, angle = motion.info.crank, motion.angle_at(run.times)
    if motion.info.mode != "held":
        angle = angle + crank_rotation(motion, run)
    about = f"angle of {crank} at its shaft: of the rigid motion, and its rotation from there"
    return [*variables, Variable(f"{crank}.shaft_angle", "rad", about, (), angle)]


def bow(name: str, beam: Beam, at: float, values: Array) -> Variable:
    """Return the output of the deflection of a station [m], (times,)."""
    about = f"deflection of {beam.info.link} from the line between its ends, at {at:g} of its length"
    return Variable(f"{name}.deflection", "m", about, (), values)


def deflection(beam: Beam, local: Array, at: float) -> Array:
    """Return the displacement across a link [m] less that of the straight line between its ends, (times,)."""
    (_, first), *_, (_, last) = beam.joints
    return local @ beam.rows(at).w - (1 - at) * local[:, first] - at * local[:, last]


def in_mode(
    motion: ElasticMotion, modes: ElasticModes, number: int, phases: Array, largest: float
) -> list[Variable]:
    """Return the outputs of a shape over the phase of its vibration, in the pose of the modes.

    Parameters
    ----------
    number
        Number of the mode, from 0.
    phases
        [rad].
    largest
        Largest displacement or deflection over the phases [m].
    """
    t, count = motion.time_at(modes.angle), len(phases)
    rigid, links, loads = motion.rigid_motion(motion.equations(), np.array([t]))
    q, links, loads = (np.repeat(x, count, axis=0) for x in (rigid[0], links, loads))

    def shaped(factor: float) -> list[Variable]:
        y = factor * np.real(np.exp(1j * phases)[:, None] * modes.shapes[:, number])
        return [
            *outputs(motion, links, y),
            *recovered(motion, RunMotion(np.full(count, t), q, links, loads, y, None)),
        ]

    sizes = (v.values for v in shaped(1.0) if v.name.endswith((".displacement", ".deflection")))
    return shaped(largest / max(float(np.max(np.abs(x))) for x in sizes))


@dataclass(frozen=True, slots=True)
class Solution:
    """Displacements and their rates (times, unknowns) at the recorded times, and their cost.

    ``rates`` is None where the elastic motion itself adds nothing: quasi-static. ``errors`` returns the error
    over the peak stress and that of the largest multiplier, ``counts`` are the steps to each time from the
    one before.
    """

    displacements: Array
    rates: Array | None
    steps: int
    errors: Callable[[], tuple[float | None, float | None]] = lambda: (None, None)
    floquet: tuple[complex, ...] = ()
    counts: Counts | None = None

    def at(self, places: Indices) -> Solution:
        """Return the results at some of the times."""
        rates = None if self.rates is None else self.rates[places]
        return replace(self, displacements=self.displacements[places], rates=rates)


def known(error: float, of_multiplier: float | None = None) -> Callable[[], tuple[float, float | None]]:
    """Return the ``errors`` of a result whose errors are known."""
    return lambda: (error, of_multiplier)


def finer_counts(counts: Counts) -> Counts:
    """Return the steps of the run that a run is compared with: at least ``FINER`` times as many."""
    return np.ceil(FINER * counts - 1e-9).astype(np.intp)


def compared_run(times: Array, counts: Counts, order: int) -> tuple[Indices, Counts, float]:
    """Return the times of a run that tells the error of a run, its steps to each, and its error over that.

    The times are places of ``times`` in rising order: all, or every so many of equally spaced ones, back from
    the last. The ratio of the errors is by the order; it is zero, and the steps are more, where no whole
    numbers of fewer steps do.
    """
    least, most = FEWER
    places = np.argsort(times, kind="stable")
    gaps = np.diff(times[places])
    even = len(gaps) and np.min(gaps) > (1 - 1e-9) * np.max(gaps)
    for every in range(1, max(1, len(times) // _SHARED if even else 1) + 1):
        shared = np.arange(len(times) - 1, -1, -every)[::-1]
        steps_between = np.diff(np.cumsum(counts)[shared], prepend=0)
        fewer = np.ceil(steps_between / most ** (1 / order) - 1e-9)
        growth = (steps_between / np.maximum(fewer, 1.0))[steps_between > 0] ** order
        least_growth = float(np.min(growth[int(every > 1) :], initial=np.inf))
        if least_growth >= least:
            return places[shared], fewer.astype(np.intp), least_growth
    return places, finer_counts(counts), 0.0


def next_factor(error: float, rtol: float, order: int, falls: bool) -> float:
    """Return by how much to multiply steps: twice at most, and twice until errors fall as the order says."""
    return min((error / rtol) ** (1 / order), 2.0) if falls else 2.0


class Once(cached_property[Any]):
    """A cached property that one thread at a time computes; from Python 3.12 on others have no lock."""

    def __get__(self, of: Any, owner: Any = None) -> Any:
        with vars(of).setdefault("lock", RLock()):
            return super().__get__(of, owner)


class Errors:
    """Errors of runs in time, over the peak stress at a station, the largest of all stations."""

    def __init__(
        self, motion: ElasticMotion, equations: _beams.BeamEquations, times: Array, order: int
    ) -> None:
        self.motion, self.equations, self.times = motion, equations, times
        self._safety = SAFETY / (1 - FINER**-order)
        self._peaks: list[float] = []
        #: Errors that grew in a row, and the least so far, by ``of``.
        self.grown, self.least, self._last = 0, math.inf, math.inf

    def of(
        self, run: Array, other: Array, places: Indices | None = None, safety: float | None = None
    ) -> Array:
        """Return the error (times,) of a run (times, unknowns) by another.

        The other has at least ``FINER`` times its steps, or fewer by ``FEWER`` with ``safety``, the estimate
        over the difference. Steps that do not resolve a vibration leave as much in both as they differ by.
        """
        errors = (safety or self._safety) * self._differences(run, other, places)
        error = float(np.max(errors))
        self.grown = self.grown + 1 if error > self._last else 0
        self.least, self._last = min(self.least, error), error
        return errors

    def check_round_off(self, method: str, rtol: float) -> None:
        """Raise SimulationError where more steps only add round-off."""
        typed = self.motion.rigid.typed
        if typed and typed.precision.epsilon > FLOAT64.epsilon and self.grown >= _ROUNDED:
            raise SimulationError(
                f"{self.motion.rigid.name}: {method} does not come within {rtol:g} of the peak stress in "
                f"{typed.precision.name}: shorter steps only add round-off, and {self.least:.1e} is the "
                "best\n"
                "  Give a larger --rtol, or take float64."
            )

    @cached_property
    def _links(self) -> Array:
        """Return the rigid motion of the links, which takes as long as many steps: once it is needed."""
        return self.motion.rigid_motion(self.equations, self.times)[1]

    def _differences(self, coarse: Array, fine: Array, places: Indices | None = None) -> Array:
        """Return the largest difference at each time, (times,), or at some places of the times."""
        largest = np.zeros(len(fine))
        if not (np.all(np.isfinite(coarse)) and np.all(np.isfinite(fine))):
            return largest + math.inf
        links = self._links if places is None else self._links[places]
        of, count = self.motion, len(self.motion.beams)
        local = ([of.local_unknowns(k, links, values) for k in range(count)] for values in (coarse, fine))
        both = (_strains(of, each) for each in local)
        pairs = [(a.values, b.values) for a, b in zip(*both, strict=True) if b.name.endswith(".stress")]
        if places is None or not self._peaks:
            self._peaks = [float(np.max(np.abs(b))) for _, b in pairs]
        least = _NOISE * max(self._peaks, default=0.0)
        for (a, b), peak in zip(pairs, self._peaks, strict=True):
            if peak > least:
                largest = np.maximum(largest, np.abs(a - b) / peak)
        return largest
