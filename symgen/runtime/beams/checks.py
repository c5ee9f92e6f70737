"""Limits of the linear theory of elastic links: notes on every result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from symgen.runtime._beams import APPLIED, BeamEquations
from symgen.runtime.beams.data import BeamInfo, Properties
from symgen.runtime.beams.elements import at, meshed, names, segments
from symgen.runtime.beams.forces import Motion, crank_rotation
from symgen.runtime.beams.links import Beam
from symgen.runtime.beams.second_order import SECOND_ORDER, omitted
from symgen.runtime.elastic.motion import ElasticMotion

Array = NDArray[np.float64]

#: Largest angle [rad] that the centre line makes with its rigid direction. Linear theory has sin a = a and
#: cos a = 1: the neglected 1 - cos a is a/2 of the sin a that it keeps, one part in twenty.
SLOPE = 0.1
#: Largest compression over Euler's load P. Deflections are amplified by 1/(1 - N/P), so that an error in the
#: axial force, which is that of the rigid motion, counts (N/P)/(1 - N/P) times: fully from one half on.
COMPRESSION = 0.5
#: The same limit, for tension too, for links without geometric stiffness.
WITHOUT_STIFFENING = 0.05
_JUDGE = "compare with large rotation"
#: The most places along a link that are looked at, and the elements on which Euler's load is found.
_PLACES, _EULER = 65, 8


def warnings(motion: ElasticMotion, recorded: Motion, moments: Sequence[str]) -> list[str]:
    """Return a note for every elastic link and limit of linear theory that it passes.

    Parameters
    ----------
    motion
        The linkage.
    recorded
        Its elastic motion at the recorded times.
    moments
        What to call each of these: ``"crank angle 45 degrees"``.
    """
    found = []
    for k, beam in enumerate(motion.beams):
        own = recorded.own(motion, k)
        places = np.linspace(0.0, 1.0, min(4 * beam.info.elements + 1, _PLACES))
        table = beam.table(places.tolist())
        found += _of_slope(beam, own @ table["slope"].T, moments)
        strain = own @ table["axial_strain"].T
        rigid = _rigid_axial_force(motion, k, recorded, places)
        found += _of_axial_force(motion, k, rigid, places, strain, moments)
        found += _of_stress(beam, own, moments)
    return found


def _of_slope(beam: Beam, slopes: Array, moments: Sequence[str]) -> list[str]:
    time, _, value = _peak(np.abs(slopes))
    if value <= SLOPE:
        return []
    return [
        f"{beam.info.link}: its centre line turns by {value:.3g} rad from its rigid direction "
        f"at {moments[time]}, beyond the {SLOPE:g} rad of linear theory; {_JUDGE}"
    ]


def second_order(motion: ElasticMotion, equations: BeamEquations, recorded: Motion) -> dict[str, float]:
    """Return the strain that terms of second order add to each link, over its peak strain, an estimate."""
    shares = omitted(motion, equations, recorded, _rigid_axial_force)
    return {beam.info.link: share for beam, share in zip(motion.beams, shares, strict=True)}


def of_second_order(shares: Mapping[str, float]) -> list[str]:
    """Warn of links to which terms of second order add more than linear theory allows."""
    return [
        f"{link}: terms of second order that linear theory omits are estimated at {share:.2g} "
        f"times its peak strain; {_JUDGE}"
        for link, share in shares.items()
        if share > SECOND_ORDER
    ]


def _rigid_axial_force(motion: ElasticMotion, k: int, recorded: Motion, places: Array) -> Array:
    """Return the axial force of the rigid motion [N], tension positive, (times, places)."""
    axes, beam = recorded.axes(k), motion.beams[k]
    found = axes.axial_force(beam, places)
    own = [i for i, name in enumerate(motion.info.loads) if name == beam.info.link]
    for i, profile in zip(own, motion.profiles(beam.info.link), strict=True):
        weight = recorded.loads[:, i, APPLIED.index("stiffness_geometric_force")]
        found += weight[:, None] * profile.before(places * beam.properties.length)
    return found


def _of_axial_force(
    motion: ElasticMotion, k: int, rigid: Array, places: Array, strain: Array, moments: Sequence[str]
) -> list[str]:
    """Compare the axial force, that of the rigid motion and that of the strain found, with Euler's load."""
    beam = motion.beams[k]
    stiffness = [at(beam.properties.axial, x) for x in (places * beam.properties.length).tolist()]
    found = rigid if not beam.info.axial else strain * stiffness
    limit = euler_load(motion, k)
    if beam.info.geometric_stiffness:
        bound, kind, candidates = COMPRESSION, "compression", (-rigid, -found)
    else:
        bound, kind, candidates = WITHOUT_STIFFENING, "axial force", (np.abs(rigid), np.abs(found))
    time, place, value = max((_peak(c) for c in candidates), key=lambda peak: peak[2])
    if value <= bound * limit:
        return []
    remedy = _JUDGE if kind == "compression" else "run with geometric stiffness"
    return [
        f"{beam.info.link}: its {kind} comes to {value:.4g} N at {places[place]:.3g} of its length at "
        f"{moments[time]}, {value / limit:.3g} of its Euler load of {limit:.4g} N; "
        f"linear theory is not to be trusted beyond {bound:g} of it; {remedy}"
    ]


def _of_stress(beam: Beam, own: Array, moments: Sequence[str]) -> list[str]:
    p = beam.properties
    if math.isinf(p.yield_stress):
        return []
    stresses, places = beam.greatest_stress(own)
    time = int(np.argmax(stresses))
    if stresses[time] <= p.yield_stress:
        return []
    where = f"at {places[time]:.3g} of its length at {moments[time]}"
    return [
        f"{beam.info.link}: the stress comes to {stresses[time]:.4g} Pa {where}, "
        f"beyond its yield stress of {p.yield_stress:.4g} Pa: it would not spring back; "
        "make it stronger or the crank slower"
    ]


def _peak(values: Array) -> tuple[int, int, float]:
    """Return index and value of the largest of finite values."""
    time, place = np.unravel_index(int(np.argmax(values)), values.shape)
    return int(time), int(place), float(values[time, place])


def euler_load(motion: ElasticMotion, k: int) -> float:
    """Return the least axial load [N] under which a link alone buckles, K phi = P KG phi.

    Its ends are held across; it turns freely at both, or is held at the shaft of a held crank. A tip that
    nothing else is joined to is free.
    """
    beam = motion.beams[k]
    info = meshed(replace(beam.info, elements=_EULER, nodes=()), beam.properties.length, (), ())
    return _buckling_load(info, beam.properties, frozenset(held_alone(motion, info) - {f"u@{info.elements}"}))


@lru_cache(maxsize=64)
def _buckling_load(info: BeamInfo, properties: Properties, held: frozenset[str]) -> float:
    """Return the same for the unknowns that are held; every run of a linkage asks for it again."""
    from scipy.linalg import eigh

    dofs = names(info)
    stiffness, pulled = (np.zeros((len(dofs), len(dofs))) for _ in range(2))
    for part in segments(info, properties):
        there = np.ix_(part.dofs, part.dofs)
        stiffness[there] += part.matrix("stiffness")
        pulled[there] += part.matrix("geometric", 3)[0]
    free = [i for i, dof in enumerate(dofs) if dof not in held]
    there = np.ix_(free, free)
    last = len(free) - 1
    largest = eigh(pulled[there], stiffness[there], eigvals_only=True, subset_by_index=(last, last))[0]
    return 1.0 / float(largest)


def held_alone(motion: ElasticMotion, info: BeamInfo) -> set[str]:
    """Return the unknowns of a link alone that its joints hold: both ends, and the shaft of a held crank.

    A tip that nothing else is joined to is free, and joints before it hold the link instead.
    """
    clamped = info.link == motion.info.crank and motion.info.mode == "held"
    held = {"u@0", "w@0", *(("theta@0",) if clamped else ())}
    if not ((clamped or info.between) and _has_a_free_tip(motion, info)):
        return held | {f"u@{info.elements}", f"w@{info.elements}"}
    return held | {f"w@{i}" for i in info.joint_nodes[:-1]}


def _has_a_free_tip(motion: ElasticMotion, own: BeamInfo) -> bool:
    """Return True if no other link, guide or ground holds the second point of a link."""
    d = motion.rigid.description
    others = [points for name, points in d.links.items() if name != own.link]
    guided = any(label.startswith(f"the guide of {own.end} ") for label in d.labels)
    return own.end in d.free and not guided and not any(own.end in points for points in others)


def moments(motion: ElasticMotion, times: Array) -> list[str]:
    """Return the names of the recorded times in notes."""
    if not motion.speed:
        return [f"{t:.6g} s" for t in times.tolist()]
    return [f"crank angle {angle:.6g} degrees" for angle in np.degrees(motion.angle_at(times)).tolist()]


def of_crank(motion: ElasticMotion, found: Motion) -> list[str]:
    """Report a crank, not held, that turns away from its rigid motion."""
    if motion.info.mode == "held":
        return []
    ahead = crank_rotation(motion, found)
    k = int(np.argmax(np.abs(ahead)))
    if abs(ahead[k]) <= SLOPE:
        return []
    of = (
        "that of the rigid linkage with its motor"
        if motion.has_motor
        else "the constant speed of a free crank"
    )
    return [
        f"{motion.info.crank}: at {moments(motion, found.times[k : k + 1])[0]} the crank is {ahead[k]:.3g} "
        f"rad off its rigid motion, {of}, beyond the {SLOPE:g} rad of linear theory; "
        "compare with large rotation"
    ]


def of_lengths(motion: ElasticMotion) -> list[str]:
    """Return the note on links whose stress omits that of the axial force."""
    kept = [b.info.link for b in motion.beams if not b.info.axial]
    if not kept:
        return []
    return [f"{', '.join(kept)}: kept at constant length, so that stress is that of bending only"]


def of_reductions(motion: ElasticMotion) -> list[str]:
    """Return the note on links whose error estimate is incomplete."""
    return [
        f"{info.link}: reduced ({info.reduction}): what that leaves out is not in the estimated error"
        + ("; loads between its ends do not bend it" if info.reduction == "guyan" else "")
        for info in (beam.info for beam in motion.beams)
        if info.reduction
    ]
