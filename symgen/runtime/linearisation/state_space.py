"""State-space models from the slopes of the equations of motion, by implicit differentiation.

The slopes are derived in :mod:`symgen.models.linearisation`. Independent coordinates z(q) with rates z' = G u
determine the motion: J dq = 0 and G dq = dz give dq, the differential of the constraints' rates and of z'
gives du, and that of the equations of motion the accelerations and multipliers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, islice
from typing import Any

import numpy as np

from symgen.errors import ModelError, check_known
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.description import Description
from symgen.runtime.linearisation.record import Linearisation
from symgen.runtime.linearisation.sensitivity import moved_pose
from symgen.runtime.linearisation.switching import notes_of
from symgen.runtime.linearisation.tangents import Tangents

#: Most sets of angles that are tested as independent coordinates.
_TRIED = 20
#: Singular values of a constraint Jacobian, over the largest, below which they count as zero.
_DEPENDENT = 1e-9


def state_space(
    tangents: Tangents,
    coordinates: Sequence[str],
    independent: bool,
    inputs: Mapping[str, float],
    outputs: Sequence[str],
) -> Linearisation:
    """Return the state-space model of these coordinates, of inputs with their values, and of outputs.

    Parameters
    ----------
    tangents
        The linearised motion, with kernels of ``derivatives(coordinates)`` and of the outputs.
    independent
        Whether the coordinates are independent; otherwise they are those of all moving points.

    Raises
    ------
    ModelError
        As :meth:`Tangents.directions`; for a state that violates the constraints; for forces that
        redundant constraints leave open; for Cartesian coordinates of redundant constraints.
    """
    integrals = tangents.description.integrals
    shown_coordinates = [name for name in coordinates if name not in integrals]
    coordinates = [*shown_coordinates, *integrals]
    slopes, d, n = tangents.slopes, tangents.description, tangents.n
    if tangents.redundant and not independent:
        raise ModelError(
            f"the constraints of {d.name} are redundant, so that they contradict each other where Cartesian "
            "coordinates deviate one by one\n  Give independent coordinates."
        )
    dq, du = np.eye(n, 2 * n), np.eye(n, 2 * n, n)
    if independent:
        if tangents.free.shape[1] == len(integrals) and shown_coordinates:
            raise ModelError(
                f"{d.name} has no degree of freedom at this state, so no independent coordinates: its drives "
                "and constraints determine the motion\n  Without coordinates, A is the Jacobian of "
                "accelerations by positions and velocities of all moving points; its poles show no stability."
            )
        tangents.check_closed()
        by = [*coordinates, *(f"{name}'" for name in coordinates)]
        dq, du = moved_pose(tangents, by, coordinates)
    moved = slopes.residual[:, tangents.by_q] @ dq + slopes.residual[:, tangents.by_u] @ du
    dw, driven = tangents.solved(moved), tangents.solved(tangents.direct(slopes.residual, [*inputs]))
    k = len(coordinates)

    def linear(names: Sequence[str]) -> tuple[Array, Array]:
        rows = slopes.rows(names)
        by = rows[:, tangents.by_solution]
        state = rows[:, tangents.by_q] @ dq + rows[:, tangents.by_u] @ du + by @ dw
        return state, by @ driven + tangents.direct(rows, [*inputs])

    shown = [x for name in outputs if name not in integrals for x in slopes.scalars(name)]
    tangents.check_unique(shown)
    second, by_inputs = linear([f"{name}''" for name in coordinates])
    c, direct = linear(shown)
    x, first, accelerations, y = (
        np.array([slopes.values[f"{name}{mark}"] for name in of])
        for of, mark in ((coordinates, ""), (coordinates, "'"), (coordinates, "''"), (shown, ""))
    )
    # Nothing depends on the integrals of states; their rates are these states.
    kept = np.delete(np.arange(2 * k), np.arange(len(shown_coordinates), k))
    moving = [*shown_coordinates, *(f"{name}'" for name in shown_coordinates)]
    units = {name: slopes.units[name] for name in (*moving, *shown)}
    of_states = [x.removesuffix(".integral") for x in integrals]
    units |= {name: d.states[name] for name in of_states}
    return Linearisation(
        A=np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), second])[np.ix_(kept, kept)],
        B=np.vstack([np.zeros((k, len(inputs))), by_inputs])[kept],
        C=c[:, kept],
        D=direct,
        states=(*moving, *of_states),
        inputs=tuple(inputs),
        outputs=tuple(shown),
        units=units | {p.name: p.unit for p in d.tunable if p.name in inputs},
        t=tangents.state.t,
        x=np.concatenate([x, first])[kept],
        u=np.array([*inputs.values()], dtype=float),
        y=y,
        rates=np.concatenate([first, accelerations])[kept],
        freedoms=tangents.free.shape[1] - len(integrals),
        notes=notes_of(tangents, [*inputs]),
    )


def derivatives(d: Description, coordinates: Sequence[str]) -> list[str]:
    """Return the outputs that coordinates need: themselves and their first two derivatives.

    Raises
    ------
    ModelError
        For a name that is not that of a quantity of a point or a link, or of a user's coordinate.
    """
    coordinates = [*dict.fromkeys((*coordinates, *d.integrals))]
    for name in coordinates:
        if name in d.integrals:
            continue
        if d.rates:
            check_known(name, d.free, f"{d.name} has no coordinate")
            continue
        owner, dot, rest = name.partition(".")
        if not dot or owner not in (*d.points, *d.links) or rest in d.axes:
            links = f", or the angle of a link: {', '.join(d.links)}" if len(d.axes) == 2 else ""
            raise ModelError(
                f"expected independent coordinates of {d.name}, got {name!r}\n  A coordinate is a "
                f"component of the position of a point, such as "
                f"{owner if owner in d.points else d.points[-1]}.position.x: "
                f"{', '.join(d.points)}{links}."
            )
    return [f"{name}{mark}" for name in coordinates for mark in ("", "'", "''")]


def coordinate_choices(model: Any) -> Iterator[tuple[str, ...]]:
    """Yield sets of coordinates that may determine the start of a linkage, or of a user-defined system.

    They are angles of links, then coordinates of points, those that move most with the others held.
    """
    from scipy.linalg import null_space, qr

    d = model.description
    yield from islice(combinations([f"{link}.angle" for link in d.links], d.freedom), _TRIED)
    free = null_space(model.jacobian()[:, : d.of_points], rcond=_DEPENDENT)
    chosen = qr(free.T, mode="r", pivoting=True)[1][: free.shape[1]]
    yield tuple(d.coordinate_outputs[i] for i in sorted(chosen))
