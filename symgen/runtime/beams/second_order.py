"""How far linear theory is off: the terms of second order that it omits, estimated from its own result.

The displacements S of linear theory stretch the links by w'^2/2, give them axial forces that differ from
those of the rigid motion, and violate constraints to the second order. These are put on the structure as
loads, which its stiffness alone carries: (K + K_N) S2 = -f2(S), J S2 = -c2(S).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from symgen.runtime import _beams
from symgen.runtime.beams.elements import SHAPES, at, gauss, kernels
from symgen.runtime.beams.forces import Motion, of_coordinates
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.kernels.evaluate import at_rows

Array = NDArray[np.float64]

#: Part of the peak strain of a link that the omitted terms may come to without a note.
SECOND_ORDER = 0.2
#: Points of the Gauss rule on each element, the most times that are looked at, and unknowns times these.
_GAUSS, _TIMES, _WORTH = 4, 24, 6000
#: Displacements of second order vibrate twice as fast as those of first order: inertia counts four times.
_DOUBLED = 4.0
#: Least singular value, over the largest, of a stiffness without motions that strain nothing.
_SINGULAR = 1e-10
_NOTHING = 1e-12

#: The axial force of the rigid motion [N] of link k at fractions of its length, (times, fractions).
AxialForce = Callable[[ElasticMotion, int, Motion, Array], Array]


def omitted(
    motion: ElasticMotion, equations: _beams.BeamEquations, recorded: Motion, axial_force: AxialForce
) -> list[float]:
    """Return for every link the strain that terms of second order add, over its peak strain, an estimate.

    Bending by the changed axial force counts as it is. Displacements of second order bend the links by their
    inertia; they add to the bending by elastic inertia in the proportion of the displacements.
    """
    times = _chosen(recorded, motion.layout.unknowns)
    kept = _at(recorded, times)
    loads, violated = _loads(motion, kept, axial_force), _violated(motion, kept)
    second, static = _carried(motion, equations, kept, loads, violated)
    inertia = kept.displacements - static
    return [_added(motion, k, kept, second, inertia) for k in range(len(motion.beams))]


def _added(motion: ElasticMotion, k: int, kept: Motion, second: Array, inertia: Array) -> float:
    """Return the strain that displacements of second order add to link k, over its peak strain."""
    beam = motion.beams[k]
    places = np.linspace(0.0, 1.0, 4 * beam.info.elements + 1)
    rows = beam.table(places.tolist())
    fibre = beam.fibres(places)

    def largest(own: Array, *shapes: str) -> Array:
        found: Array = np.sqrt(np.sum([(own @ rows[shape].T) ** 2 for shape in shapes], axis=0))
        return found

    first = kept.own(motion, k)
    more, elastic = (motion.own_unknowns(k, kept.links, x) for x in (second, inertia))
    bent, axial = largest(first, "curvature") * fibre, largest(first, "axial_strain")
    peak = float(np.max(bent + axial))
    if peak <= _NOTHING:
        return 0.0
    added = float(np.max(largest(more, "curvature") * fibre))
    moved = float(np.max(largest(first, "u", "w")))
    if kept.rates is not None and moved > _NOTHING * beam.properties.length:
        share = float(np.max(largest(more, "u", "w"))) / moved
        added += _DOUBLED * share * float(np.max(largest(elastic, "curvature") * fibre))
    return added / peak


def _chosen(recorded: Motion, unknowns: int) -> NDArray[np.intp]:
    count = max(3, min(_TIMES, _WORTH // unknowns, len(recorded.times)))
    return np.unique(np.linspace(0, len(recorded.times) - 1, count).round().astype(np.intp))


def _at(recorded: Motion, places: NDArray[np.intp]) -> Motion:
    rates = None if recorded.rates is None else recorded.rates[places]
    parts = recorded.times, recorded.q, recorded.links, recorded.loads, recorded.displacements
    times, q, links, loads, displacements = (x[places] for x in parts)
    return Motion(times, q, links, loads, displacements, rates, recorded.thesis)


def _loads(motion: ElasticMotion, kept: Motion, axial_force: AxialForce) -> Array:
    """Return f2 of the elastic links on all unknowns, (times, unknowns)."""
    points, weights = gauss(_GAUSS)
    found = np.zeros((len(kept.times), motion.layout.unknowns + 1))
    for k, beam in enumerate(motion.beams):
        n, length = beam.info.elements, beam.properties.length
        nodes = np.array([beam.info.node(e) for e in range(n + 1)])
        places = (nodes[:-1, None] + np.diff(nodes)[:, None] * (1 + points) / 2).ravel()
        table = beam.table(places.tolist())
        if not beam.info.axial:  # its axial force is of its constraint
            continue
        own = kept.own(motion, k)
        stiffness = [at(beam.properties.axial, x) for x in (places * length).tolist()]
        strain, slope = own @ table["axial_strain"].T, own @ table["slope"].T
        rigid = np.zeros_like(slope)
        if beam.info.geometric_stiffness:
            rigid = axial_force(motion, k, kept, places)
        state = np.stack(np.broadcast_arrays(stiffness, strain, slope, rigid), axis=-1).reshape(-1, 4)
        omits = kernels("elastic_place").ADDRESSES["second_order"]
        forces = at_rows(omits, state, 0, np.zeros(1), len(SHAPES)).reshape(*slope.shape, len(SHAPES))
        by = np.outer(np.diff(nodes), weights).ravel() * length / 2
        load = np.tensordot(forces * by[:, None], np.stack([table[name] for name in SHAPES], axis=1), axes=2)
        axes = kept.axes(k)
        for u, w in beam.joints:
            load[:, u], load[:, w] = axes.fixed(load[:, u].copy(), load[:, w].copy())
        found[:, motion.layout.of_links[k]] += load
    return found[:, :-1]


def _carried(
    motion: ElasticMotion, equations: _beams.BeamEquations, kept: Motion, loads: Array, violated: Array
) -> tuple[Array, Array]:
    """Return S2, and the displacements under the loads of the rigid motion alone, (times, unknowns) each.

    ``loads`` is f2 and ``violated`` by how much the displacements violate the constraints.
    """
    forced, own, sides, stiff = np.zeros_like(kept.displacements), [], [], []
    still = np.zeros(motion.layout.unknowns)
    order = np.argsort(kept.times, kind="stable")
    of_welds = [name in motion.info.body_welds for name in motion.constraints]
    for i in order.tolist():
        t, s, load = float(kept.times[i]), kept.displacements[i], loads[i]
        status, _, _, stiffness, rigid, basis = equations.matrices(t, _beams.QUASI_STATIC)
        motion.check(equations, status, t)
        if basis is not None:
            _, empty, rows = equations.residual(t, still, still, still, _beams.QUASI_STATIC)
            second = np.where(of_welds, 0.0, violated[i] - rows @ s)
            forced[i] = np.linalg.lstsq(rows, -second, rcond=None)[0]
            load = load + equations.residual(t, forced[i], still, still, _beams.QUASI_STATIC)[1] - empty
            own.append(basis[0])
            load = basis[0].T @ load
        sides.append((-load, rigid))
        stiff.append((stiffness + stiffness.T) / 2)
    # Least squares: nothing may hold the crank, and an axial force near the buckling load none of a link.
    found = np.linalg.pinv(np.array(stiff), _SINGULAR, hermitian=True) @ np.swapaxes(sides, 1, 2)
    second, static = np.zeros((2, *forced.shape))
    second[order], static[order] = np.moveaxis(np.array(own) @ found if own else found, 2, 0)
    return forced + second, static


def _violated(motion: ElasticMotion, kept: Motion) -> Array:
    """Return the violation of their constraints by the displacements, (times, constraints)."""
    rigid, d = motion.rigid, motion.rigid.description
    columns = of_coordinates(motion)
    still = np.zeros_like(kept.q)
    moved = kept.q + kept.displacements[:, columns]
    blocks = rigid.evaluator.many_blocks("constraints", kept.times, moved, still)
    first = rigid.evaluator.many_blocks("constraints", kept.times, kept.q, still)["constraints"]
    violated = (blocks["constraints"] - first) / blocks["constraint_scale"]
    found = np.zeros((len(kept.times), len(motion.constraints)))
    for k, name in enumerate(motion.constraints):
        if name not in motion.info.body_welds:
            found[:, k] = violated[:, d.constraints.index(name)]
    return found
