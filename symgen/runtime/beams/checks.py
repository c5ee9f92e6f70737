"""Limits of the linear theory of elastic links: notes on every result.

The terms of second order that it omits are estimated from its own result. The displacements S of linear
theory stretch the links by w'^2/2, give them axial forces that differ from those of the rigid motion, and
violate constraints to the second order. These are put on the structure as loads, which its stiffness alone
carries: (K + K_N) S2 = -f2(S), J S2 = -c2(S).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from symgen.runtime._beams import APPLIED, QUASI_STATIC, BeamEquations
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.data import Properties
from symgen.runtime.beams.elements import SHAPES, at, gauss, kernels, meshed, names, segments
from symgen.runtime.beams.forces import RunMotion, crank_rotation, of_coordinates
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.kernels.elastic_description import BeamInfo
from symgen.runtime.kernels.evaluate import at_rows

#: Largest angle [rad] that the centre line makes with its rigid direction. Linear theory has sin a = a and
#: cos a = 1: the neglected 1 - cos a is a/2 of the sin a that it keeps, one part in twenty.
SLOPE = 0.1
#: Largest compression over Euler's load P. Deflections are amplified by 1/(1 - N/P), so that an error in the
#: axial force, which is that of the rigid motion, counts (N/P)/(1 - N/P) times: fully from one half on.
COMPRESSION = 0.5
#: The same limit, for tension too, for links without geometric stiffness.
WITHOUT_STIFFENING = 0.05
_JUDGE = "compare with large rotation"
#: Most places along a link at which compression is compared.
_PLACES = 65
#: Elements by which Euler's load of a link is found.
_EULER = 8
#: Part of the peak strain of a link that the omitted terms may come to without a note.
SECOND_ORDER = 0.2
#: Points of the Gauss rule on each element.
_GAUSS = 4
#: Most times at which terms of second order are estimated.
_TIMES = 24
#: Largest product of these times and the number of unknowns.
_WORTH = 6000
#: Displacements of second order vibrate twice as fast as those of first order: inertia counts four times.
_DOUBLED = 4.0
#: Least singular value, over the largest, of a stiffness without motions that strain nothing.
_SINGULAR = 1e-10
_NOTHING = 1e-12

#: The axial force of the rigid motion [N] of link k at fractions of its length, (times, fractions).
AxialForce = Callable[[ElasticMotion, int, RunMotion, Array], Array]


def warnings(motion: ElasticMotion, recorded: RunMotion, moments: Sequence[str]) -> list[str]:
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
    messages = []
    for k, beam in enumerate(motion.beams):
        local = recorded.local(motion, k)
        places = np.linspace(0.0, 1.0, min(4 * beam.info.elements + 1, _PLACES))
        table = beam.table(places.tolist())
        messages += _of_slope(beam, local @ table["slope"].T, moments)
        strain = local @ table["axial_strain"].T
        rigid = _rigid_axial_force(motion, k, recorded, places)
        messages += _of_axial_force(motion, k, rigid, places, strain, moments)
        messages += _of_stress(beam, local, moments)
    return messages


def _of_slope(beam: Beam, slopes: Array, moments: Sequence[str]) -> list[str]:
    time, _, value = _peak(np.abs(slopes))
    if value <= SLOPE:
        return []
    return [
        f"{beam.info.link}: its centre line turns by {value:.3g} rad from its rigid direction "
        f"at {moments[time]}, beyond the {SLOPE:g} rad of linear theory; {_JUDGE}"
    ]


def second_order(motion: ElasticMotion, equations: BeamEquations, recorded: RunMotion) -> dict[str, float]:
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


def _rigid_axial_force(motion: ElasticMotion, k: int, recorded: RunMotion, places: Array) -> Array:
    """Return the axial force of the rigid motion [N], tension positive, (times, places)."""
    axes, beam = recorded.axes(k), motion.beams[k]
    axial_force = axes.axial_force(beam, places)
    loads = [i for i, name in enumerate(motion.info.loads) if name == beam.info.link]
    for i, profile in zip(loads, motion.profiles(beam.info.link), strict=True):
        weight = recorded.loads[:, i, APPLIED.index("stiffness_geometric_force")]
        axial_force += weight[:, None] * profile.before(places * beam.properties.length)
    return axial_force


def _of_axial_force(
    motion: ElasticMotion, k: int, rigid: Array, places: Array, strain: Array, moments: Sequence[str]
) -> list[str]:
    """Compare the axial force, that of the rigid motion and that of the strain found, with Euler's load."""
    beam = motion.beams[k]
    stiffness = [at(beam.properties.axial, x) for x in (places * beam.properties.length).tolist()]
    axial_force = rigid if not beam.info.axial else strain * stiffness
    limit = euler_load(motion, k)
    if beam.info.geometric_stiffness:
        bound, kind, candidates = COMPRESSION, "compression", (-rigid, -axial_force)
    else:
        bound, kind, candidates = WITHOUT_STIFFENING, "axial force", (np.abs(rigid), np.abs(axial_force))
    time, place, value = max((_peak(c) for c in candidates), key=lambda peak: peak[2])
    if value <= bound * limit:
        return []
    remedy = _JUDGE if kind == "compression" else "run with geometric stiffness"
    return [
        f"{beam.info.link}: its {kind} comes to {value:.4g} N at {places[place]:.3g} of its length at "
        f"{moments[time]}, {value / limit:.3g} of its Euler load of {limit:.4g} N; "
        f"linear theory is not to be trusted beyond {bound:g} of it; {remedy}"
    ]


def _of_stress(beam: Beam, local: Array, moments: Sequence[str]) -> list[str]:
    p = beam.properties
    if math.isinf(p.yield_stress):
        return []
    stresses, places = beam.greatest_stress(local)
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
    return _buckling_load(
        info, beam.properties, frozenset(held_alone(motion, info) - {f"u@{info.elements + 1}"})
    )


@lru_cache(maxsize=64)
def _buckling_load(info: BeamInfo, properties: Properties, fixed: frozenset[str]) -> float:
    """Return the same for the unknowns that are held; every run of a linkage asks for it again."""
    from scipy.linalg import eigh

    dofs = names(info)
    stiffness, pulled = (np.zeros((len(dofs), len(dofs))) for _ in range(2))
    for part in segments(info, properties):
        there = np.ix_(part.dofs, part.dofs)
        stiffness[there] += part.matrix("stiffness")
        pulled[there] += part.matrix("geometric", 3)[0]
    free = [i for i, dof in enumerate(dofs) if dof not in fixed]
    there = np.ix_(free, free)
    last = len(free) - 1
    largest = eigh(pulled[there], stiffness[there], eigvals_only=True, subset_by_index=(last, last))[0]
    return 1.0 / float(largest)


def held_alone(motion: ElasticMotion, info: BeamInfo) -> set[str]:
    """Return the unknowns of a link alone that its joints hold: both ends, and the shaft of a held crank.

    A tip that nothing else is joined to is free, and joints before it hold the link instead.
    """
    clamped = info.link == motion.info.crank and motion.info.mode == "held"
    fixed = {"u@1", "w@1", *(("theta@1",) if clamped else ())}
    if not ((clamped or info.between) and _has_a_free_tip(motion, info)):
        return fixed | {f"u@{info.elements + 1}", f"w@{info.elements + 1}"}
    return fixed | {f"w@{i + 1}" for i in info.joint_nodes[:-1]}


def _has_a_free_tip(motion: ElasticMotion, info: BeamInfo) -> bool:
    """Return True if no other link, guide or ground holds the second point of a link."""
    d = motion.rigid.description
    others = [points for name, points in d.links.items() if name != info.link]
    guided = any(label.startswith(f"the guide of {info.end} ") for label in d.labels)
    return info.end in d.free and not guided and not any(info.end in points for points in others)


def moments(motion: ElasticMotion, times: Array) -> list[str]:
    """Return the names of the recorded times in notes."""
    if not motion.speed:
        return [f"{t:.6g} s" for t in times.tolist()]
    return [f"crank angle {angle:.6g} degrees" for angle in np.degrees(motion.angle_at(times)).tolist()]


def of_crank(motion: ElasticMotion, run: RunMotion) -> list[str]:
    """Report a crank, not held, that turns away from its rigid motion."""
    if motion.info.mode == "held":
        return []
    ahead = crank_rotation(motion, run)
    k = int(np.argmax(np.abs(ahead)))
    if abs(ahead[k]) <= SLOPE:
        return []
    of = (
        "that of the rigid linkage with its motor"
        if motion.has_motor
        else "the constant speed of a free crank"
    )
    return [
        f"{motion.info.crank}: at {moments(motion, run.times[k : k + 1])[0]} the crank is {ahead[k]:.3g} "
        f"rad off its rigid motion, {of}, beyond the {SLOPE:g} rad of linear theory; "
        "compare with large rotation"
    ]


def of_lengths(motion: ElasticMotion) -> list[str]:
    """Return the note on links whose stress omits that of the axial force."""
    names = [b.info.link for b in motion.beams if not b.info.axial]
    if not names:
        return []
    return [f"{', '.join(names)}: kept at constant length, so that stress is that of bending only"]


def of_reductions(motion: ElasticMotion) -> list[str]:
    """Return the note on links whose error estimate is incomplete."""
    return [
        f"{info.link}: reduced ({info.reduction}): what that leaves out is not in the estimated error"
        + ("; loads between its ends do not bend it" if info.reduction == "guyan" else "")
        for info in (beam.info for beam in motion.beams)
        if info.reduction
    ]


def omitted(
    motion: ElasticMotion, equations: BeamEquations, recorded: RunMotion, axial_force: AxialForce
) -> list[float]:
    """Return for every link the strain that terms of second order add, over its peak strain, an estimate.

    Bending by the changed axial force counts as it is. Displacements of second order bend the links by their
    inertia; they add to the bending by elastic inertia in the proportion of the displacements.
    """
    times = _chosen(recorded, motion.layout.unknowns)
    rows = _at(recorded, times)
    loads, violated = _loads(motion, rows, axial_force), _violated(motion, rows)
    second, static = _carried(motion, equations, rows, loads, violated)
    inertia = rows.displacements - static
    return [_added(motion, k, rows, second, inertia) for k in range(len(motion.beams))]


def _added(motion: ElasticMotion, k: int, states: RunMotion, second: Array, inertia: Array) -> float:
    """Return the strain that displacements of second order add to link k, over its peak strain."""
    beam = motion.beams[k]
    places = np.linspace(0.0, 1.0, 4 * beam.info.elements + 1)
    rows = beam.table(places.tolist())
    fibre = beam.fibres(places)

    def largest(local: Array, *shapes: str) -> Array:
        return np.sqrt(np.sum([(local @ rows[shape].T) ** 2 for shape in shapes], axis=0))

    first = states.local(motion, k)
    more, elastic = (motion.local_unknowns(k, states.links, x) for x in (second, inertia))
    bent, axial = largest(first, "curvature") * fibre, largest(first, "axial_strain")
    peak = float(np.max(bent + axial))
    if peak <= _NOTHING:
        return 0.0
    added = float(np.max(largest(more, "curvature") * fibre))
    moved = float(np.max(largest(first, "u", "w")))
    if states.rates is not None and moved > _NOTHING * beam.properties.length:
        share = float(np.max(largest(more, "u", "w"))) / moved
        added += _DOUBLED * share * float(np.max(largest(elastic, "curvature") * fibre))
    return added / peak


def _chosen(recorded: RunMotion, unknowns: int) -> Indices:
    count = max(3, min(_TIMES, _WORTH // unknowns, len(recorded.times)))
    return np.unique(np.linspace(0, len(recorded.times) - 1, count).round().astype(np.intp))


def _at(recorded: RunMotion, places: Indices) -> RunMotion:
    rates = None if recorded.rates is None else recorded.rates[places]
    parts = recorded.times, recorded.q, recorded.links, recorded.loads, recorded.displacements
    times, q, links, loads, displacements = (x[places] for x in parts)
    return RunMotion(times, q, links, loads, displacements, rates, recorded.thesis)


def _loads(motion: ElasticMotion, rows: RunMotion, axial_force: AxialForce) -> Array:
    """Return f2 of the elastic links on all unknowns, (times, unknowns)."""
    points, weights = gauss(_GAUSS)
    loads = np.zeros((len(rows.times), motion.layout.unknowns + 1))
    for k, beam in enumerate(motion.beams):
        n, length = beam.info.elements, beam.properties.length
        nodes = np.array([beam.info.node(e) for e in range(n + 1)])
        places = (nodes[:-1, None] + np.diff(nodes)[:, None] * (1 + points) / 2).ravel()
        table = beam.table(places.tolist())
        if not beam.info.axial:  # its axial force is of its constraint
            continue
        local = rows.local(motion, k)
        stiffness = [at(beam.properties.axial, x) for x in (places * length).tolist()]
        strain, slope = local @ table["axial_strain"].T, local @ table["slope"].T
        rigid = np.zeros_like(slope)
        if beam.info.geometric_stiffness:
            rigid = axial_force(motion, k, rows, places)
        state = np.stack(np.broadcast_arrays(stiffness, strain, slope, rigid), axis=-1).reshape(-1, 4)
        omits = kernels("elastic_place").ADDRESSES["second_order"]
        forces = at_rows(omits, state, 0, np.zeros(1), len(SHAPES)).reshape(*slope.shape, len(SHAPES))
        by = np.outer(np.diff(nodes), weights).ravel() * length / 2
        load = np.tensordot(forces * by[:, None], np.stack([table[name] for name in SHAPES], axis=1), axes=2)
        axes = rows.axes(k)
        for u, w in beam.joints:
            load[:, u], load[:, w] = axes.fixed(load[:, u].copy(), load[:, w].copy())
        loads[:, motion.layout.of_links[k]] += load
    return loads[:, :-1]


def _carried(
    motion: ElasticMotion, equations: BeamEquations, states: RunMotion, loads: Array, violated: Array
) -> tuple[Array, Array]:
    """Return S2, and the displacements under the loads of the rigid motion alone, (times, unknowns) each.

    ``loads`` is f2 and ``violated`` by how much the displacements violate the constraints.
    """
    forced, local, sides, stiff = np.zeros_like(states.displacements), [], [], []
    still = np.zeros(motion.layout.unknowns)
    order = np.argsort(states.times, kind="stable")
    of_welds = [name in motion.info.body_welds for name in motion.constraints]
    for i in order.tolist():
        t, s, load = float(states.times[i]), states.displacements[i], loads[i]
        status, _, _, stiffness, rigid, basis = equations.matrices(t, QUASI_STATIC)
        motion.check(equations, status, t)
        if basis is not None:
            _, empty, (rows,) = equations.residual([t], still, still, still, QUASI_STATIC)
            second = np.where(of_welds, 0.0, violated[i] - rows @ s)
            forced[i] = np.linalg.lstsq(rows, -second, rcond=None)[0]
            load = load + equations.residual([t], forced[i], still, still, QUASI_STATIC)[1][0] - empty[0]
            local.append(basis[0])
            load = basis[0].T @ load
        sides.append((-load, rigid))
        stiff.append((stiffness + stiffness.T) / 2)
    # Least squares: nothing may hold the crank, and an axial force near the buckling load none of a link.
    spread = np.linalg.pinv(np.array(stiff), _SINGULAR, hermitian=True) @ np.swapaxes(sides, 1, 2)
    second, static = np.zeros((2, *forced.shape))
    second[order], static[order] = np.moveaxis(np.array(local) @ spread if local else spread, 2, 0)
    return forced + second, static


def _violated(motion: ElasticMotion, rows: RunMotion) -> Array:
    """Return the violation of their constraints by the displacements, (times, constraints)."""
    rigid, d = motion.rigid, motion.rigid.description
    columns = of_coordinates(motion)
    still = np.zeros_like(rows.q)
    moved = rows.q + rows.displacements[:, columns]
    blocks = rigid.evaluator.many_blocks("constraints", rows.times, moved, still)
    first = rigid.evaluator.many_blocks("constraints", rows.times, rows.q, still)["constraints"]
    violated = (blocks["constraints"] - first) / blocks["constraint_scale"]
    violations = np.zeros((len(rows.times), len(motion.constraints)))
    for k, name in enumerate(motion.constraints):
        if name not in motion.info.body_welds:
            violations[:, k] = violated[:, d.constraints.index(name)]
    return violations
