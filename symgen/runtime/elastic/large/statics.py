"""Equilibria of linkages with elastic links with their input held, in the plane and in space."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.modal.structure import modes_at_rest
from symgen.runtime.beams.selection import none, note_of_omitted, selected
from symgen.runtime.elastic.large.collocation import ConstrainedSystem, MotionState, stacked
from symgen.runtime.linearisation.eigenvalues import eigenvalues
from symgen.runtime.newton import corrected
from symgen.runtime.result.equilibrium import Equilibrium, Linearised
from symgen.runtime.result.records import Variable
from symgen.runtime.result.state import state_at
from symgen.runtime.rods.model.rods import RodModel

#: Most iterations of Newton's method.
_ITERATIONS = 40
#: Last change of an iteration, over the sizes of the unknowns.
_CLOSE = 1e-11
#: Largest first correction under a part of the loads, over the sizes of the unknowns.
_LARGEST = 0.3
#: Smallest part of the loads.
_LEAST = 2.0**-12
#: Most steps of heavily damped motion.
_SETTLING = 400
#: Change in the last of them, over the sizes of the unknowns.
_ALMOST = 1e-3
#: Largest correction over the sizes of the unknowns, beyond which Newton's method has diverged.
_AWAY = 1e9
#: Largest part of loads with a push, so that corrections do not leave its path for an unstable shape.
_PUSHED = 1 / 16
#: Times by which the input is moved to that of a pose.
_POSES = 64


#: Largest corrections that count as round-off where they no longer decrease.
_ROUNDED = 1e-8
#: Force that leads from an unstable shape, over the largest of the loads.
_PUSH = 1e-2
#: Difference between a stiffness and its transpose, over the sizes of its terms, that is round-off.
_UNSYMMETRIC = 1e-10
#: Work of loads on a motion, over the sum of sizes of its terms, that is round-off.
_WORK = 1e-9


class RestingSystem(ConstrainedSystem):
    """A linkage with elastic links that may be at rest with its input held.

    Attributes
    ----------
    rigid
        The linkage with all links rigid.
    translations
        Unknowns that are positions.
    states
        Unknowns that are integrals of first-order states. At rest the states, their rates, are not zero.
    rows, sizes
        Numbers of its constraints among those of the linkage with rigid links, which come first, and their
        scales.
    shift
        Part of the mass matrix, with largest entries as those of the stiffness, that is added to this in
        corrections: keeps what nothing holds from moving by round-off.
    """

    rigid: RodModel
    translations: Indices
    states: Indices
    rows: list[int]
    sizes: Array
    shift: float

    def matrices(self, at: MotionState, rates: bool = True) -> tuple[Any, Any, Any]:
        """Return M, C and K at a motion, each with the Jacobian J of the constraints: [M, J^T; J, 0].

        Without ``rates``, C need not have all slopes.
        """
        of = self.slopes(at.t, at.q, at.v, at.a, at.multipliers)
        entries = (of.mass, of.damping, of.stiffness)
        mass, damping, stiffness = (self.pattern.matrix(x + of.jacobian) for x in entries)
        return mass, damping, stiffness


@dataclass(frozen=True, slots=True)
class AtRest:
    """M y'' + C y' + K y = 0 about an equilibrium, with changes B y of the unknowns, B the ``basis``.

    ``sizes`` are roots of the sums of sizes of the terms of the diagonal of K.
    """

    basis: Array
    mass: Array
    damping: Array
    stiffness: Array
    sizes: Array


def resting(
    system: RestingSystem, t: float, stable: bool, start: MotionState | None = None
) -> tuple[MotionState, AtRest]:
    """Return an equilibrium at a time [s] and the equations about it.

    Where loads bend the start to an unstable shape, a ``stable`` one is looked for with a force along its
    lowest mode in addition, a hundredth of the loads, which is removed in the end. With first-order states
    an equilibrium is unstable by its controllers, and ``stable`` has no effect.

    Raises
    ------
    ModelError
        As :func:`equilibrium`.
    """
    from scipy.linalg import eigh

    at = equilibrium(system, t, start=start)
    of = linearised(system, at)
    leads = stable and not len(system.states)
    if leads and np.any(eigenvalues(of.mass, of.stiffness, of.damping)[0].real > 0.0):
        begin = start or system.start()
        loads = unbalanced(system, replace(at, q=begin.q, multipliers=0 * at.multipliers))
        symmetric = (of.stiffness + of.stiffness.T) / 2
        push = of.basis @ of.mass @ eigh(symmetric, of.mass)[1][:, 0]
        push *= _PUSH * np.max(np.abs(loads[system.translations])) / np.max(np.abs(push))
        at = equilibrium(system, t, push, start)
        of = linearised(system, at)
    return at, of


def equilibrium(
    system: RestingSystem, t: float, push: Array | None = None, start: MotionState | None = None
) -> MotionState:
    """Return places and multipliers at rest, in equilibrium with the loads at a time [s].

    ``push`` (unknowns,) is a force that acts on the way there, and not in the end. ``start`` is a motion at
    this time from which loads bend the links; by default the input moves from that of the system.

    Raises
    ------
    ModelError
        Where corrections do not converge, as for a linkage that its loads move.
    """
    moment = start or system.start()
    rates, still = np.zeros(system.unknowns), np.zeros(system.unknowns)
    rates[system.states] = moment.v[system.states]
    end = system.rigid.description.t_end
    times = [t] if start else np.linspace(0.0, t, 2 + int(_POSES * abs(t / end))).tolist()
    for time in times:
        moment = at_rest(system, replace(moment, t=time, v=rates, a=still), push)
        rates = moment.v
    return moment if push is None else at_rest(system, moment)


def at_rest(system: RestingSystem, moment: MotionState, push: Array | None = None) -> MotionState:
    """Return a motion with the places and multipliers of equilibrium with its rates and second rates.

    The forces that are unbalanced at ``moment`` are applied in parts, as small as the displacements require,
    so that the equilibrium is the one to which the loads bend this shape.

    Raises
    ------
    ModelError
        As :func:`equilibrium`.
    """
    left, reached, most = unbalanced(system, moment), 0.0, 1.0 if push is None else _PUSHED
    now, part = moment, most
    pushed = np.zeros_like(left)
    if push is not None:
        pushed[: system.unknowns] = push
    while reached < 1.0 and part >= _LEAST:
        then = min(1.0, reached + part)
        found = _corrected(system, now, (1.0 - then) * left + then * pushed, _LARGEST)
        if found is None:
            part /= 2
        else:
            now, part, reached = found, min(2 * part, most), then
            system.follow(now.t, now.q, now.v)
    if reached < 1.0:
        # A linkage that its loads move may find its pose at once.
        found = _corrected(system, moment, pushed, _AWAY) or _settled(system, moment)
        if found is None:
            integrals = "\n  An integral rests only where its rate is zero." if len(system.states) else ""
            raise ModelError(
                f"{system.name}: no equilibrium with the input held at t = {moment.t:g} s, or none to which "
                f"loads bend the drawing: they were increased to {reached:.3g} of their size\n"
                f"  Loads must not move a linkage whose input is held.{integrals}"
            )
        now = found
    return now


def _settled(system: RestingSystem, at: MotionState) -> MotionState | None:
    """Return the equilibrium to which heavily damped motion leads, or None where it does not end.

    Loads that follow the links may have no equilibria at parts of their size next to the start. A step
    solves (K + damping M) dq = f, with as little damping as keeps it short.
    """
    damping = 1.0
    for _ in range(_SETTLING):
        step = held(system, at, damping)(-unbalanced(system, at))
        moves = np.abs(step[: system.unknowns]) / system.scale
        moved = float(np.max(np.delete(moves, system.states)))
        if not moved <= _LARGEST:
            damping *= 8.0
            continue
        at = _placed(system, at, _found(system, at) + step)
        system.follow(at.t, at.q, at.v)
        if damping <= system.shift and moved <= _ALMOST:
            return _corrected(system, at, np.zeros(len(step)), _AWAY)
        damping /= 4.0 if moved <= _LARGEST / 4 else 1.0
    return None


def unbalanced(system: RestingSystem, at: MotionState) -> Array:
    """Return the unbalanced forces and the errors of the constraints, (unknowns + multipliers,)."""
    state = (x[None] for x in (at.q, at.v, at.a, at.multipliers))
    return np.concatenate([system.residual(np.array([at.t]), *state)[0], system.errors(at.t, at.q)])


def _corrected(system: RestingSystem, at: MotionState, left: Array, largest: float) -> MotionState | None:
    """Return a motion with these unbalanced forces and errors by Newton's method, or None if it fails."""
    begin = _found(system, at)
    size = np.concatenate([system.scale, np.full(len(at.multipliers), np.inf)])
    of_states = np.isin(np.arange(len(size)), system.states)

    def sizes(x: Array) -> Array:
        return np.where(of_states, np.maximum(1.0, np.abs(x)), size)  # multipliers follow from places

    def change(x: Array, _: Array) -> Array | None:
        now = _placed(system, at, x)
        step = held(system, now)(left - unbalanced(system, now))
        moved = np.where(of_states, 0.0, np.abs(step) / size)
        return step if x is not begin or np.max(moved) <= largest else None

    x = corrected(begin, change, sizes, _ITERATIONS, close=_CLOSE, rounded=_ROUNDED, far=_AWAY)
    return None if x is None else _placed(system, at, x)


def _found(system: RestingSystem, at: MotionState) -> Array:
    """Return the unknowns of equilibrium: places, states in the place of their integrals, multipliers."""
    x = np.concatenate([at.q, at.multipliers])
    x[system.states] = at.v[system.states]
    return x


def _placed(system: RestingSystem, at: MotionState, x: Array) -> MotionState:
    """Return a motion with these unknowns of equilibrium; nothing depends on integrals of states."""
    q, v, n = x[: system.unknowns].copy(), at.v.copy(), system.unknowns
    v[system.states], q[system.states] = q[system.states], 0.0
    return replace(at, q=q, v=v, multipliers=x[n:])


def held(system: RestingSystem, at: MotionState, damping: float = 0.0) -> Callable[[Array], Array]:
    """Return the change of places and multipliers at rest by a change of forces and errors of constraints.

    ``damping`` is a further part of the mass matrix as that of ``shift``.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    n, states = system.unknowns, system.states
    mass, of_rates, stiffness = system.matrices(at, rates=bool(len(states)))
    of_mass = mass[:n, :n]
    if len(states):  # their columns are the slopes by states; those that no rate depends on stay
        of_states = np.isin(np.arange(stiffness.shape[1]), states).astype(float)
        stiffness = stiffness + of_rates @ diags_array(of_states)
        least = system.shift * max(1.0, abs(stiffness).tocsr()[states].max())
        stiffness = stiffness + diags_array(least * of_states)
        of_mass = diags_array(1.0 - of_states[:n]) @ of_mass
    shift = (system.shift + damping) * abs(stiffness[:n, :n]).max() / abs(of_mass).max()
    of_mass.resize(stiffness.shape)
    try:
        solve: Callable[[Array], Array] = splu((stiffness + shift * of_mass).tocsc()).solve
    except RuntimeError:
        return lambda right: np.full_like(right, np.nan)
    return solve


def linearised(system: RestingSystem, at: MotionState) -> AtRest:
    """Return the equations about an equilibrium, on the changes that the constraints leave."""
    from scipy.linalg import null_space

    n, states = system.unknowns, system.states
    mass, damping, stiffness = (x.toarray() for x in system.matrices(at))
    # In lengths of the linkage: units of metres would mix stiff and soft motions of small linkages.
    mechanism = np.delete(np.arange(n), states)
    rows = (mass[n:, :n] * system.scale)[:, mechanism]
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    free = null_space(rows)
    basis = np.zeros((n, free.shape[1] + len(states)))
    basis[np.ix_(mechanism, np.arange(free.shape[1]))] = system.scale[mechanism, None] * free
    basis[states, free.shape[1] + np.arange(len(states))] = 1.0
    sizes = np.sqrt(np.sum(np.abs(basis) * (np.abs(stiffness[:n, :n]) @ np.abs(basis)), axis=0))
    mass, damping, stiffness = (basis.T @ x[:n, :n] @ basis for x in (mass, damping, stiffness))
    of_places = stiffness[: free.shape[1], : free.shape[1]]
    size = sizes[: free.shape[1]]
    if np.max(np.abs(of_places - of_places.T) / np.outer(size, size), initial=0.0) <= _UNSYMMETRIC:
        of_places[:] = (of_places + of_places.T) / 2
    return AtRest(basis, mass, damping, stiffness, sizes)


def moved_by_loads(system: RestingSystem) -> bool:
    """Return whether loads do work on motions of the undeformed linkage that do not strain it."""
    start, n = system.start(), system.unknowns
    start = replace(start, v=0 * start.v)
    of, loads = linearised(system, start), unbalanced(system, start)[:n]
    _, shapes, rigid = modes_at_rest(system.name, of.mass, of.stiffness, of.sizes)
    free = of.basis @ shapes[:, :rigid]
    return bool(np.any(np.abs(loads @ free) > _WORK * (np.abs(loads) @ np.abs(free))))


def described(
    system: RestingSystem,
    at: MotionState,
    of: AtRest,
    forces: Sequence[Array],
    outputs: Sequence[Variable],
    positions: Mapping[str, Array],
    of_runs: Callable[[], Iterable[Variable]] = none,
) -> Equilibrium:
    """Return an equilibrium with the equations about it.

    Parameters
    ----------
    forces
        Forces on the elastic links [N], of whatever shape.
    outputs
        Outputs at this motion.
    positions
        Places [m] of points that are not those of the linkage with rigid links.
    of_runs
        Function that returns the outputs of runs by linear theory.
    """
    d, n = system.rigid.description, system.rigid.description.coordinates
    times, q, v, a, multipliers = stacked([at])
    unbalanced = system.residual(times, q, v, a, multipliers)[0]
    scale, left = (
        float(max(np.max(np.abs(x), initial=0.0) for x in some))
        for some in (forces, [unbalanced[system.translations]])
    )
    about = Linearised(
        of.basis,
        of.mass,
        of.damping,
        of.stiffness,
        multipliers[0],
        unbalanced,
        scale,
        left,
        integrals=len(system.states),
    )
    state = state_at(system.rigid.evaluator, at.t, q[0, :n], v[0, :n])
    state.positions.update(positions)
    on_points = (multipliers[0, : len(system.rows)] / system.sizes).tolist()
    shown = selected(outputs, d, of_runs)
    return Equilibrium(
        state,
        about.stability(),
        freedoms=about.freedoms,
        residual=left,
        scale=scale,
        multipliers=dict(zip([d.constraints[row] for row in system.rows], on_points, strict=True)),
        reactions={},
        outputs={x.name: x.values[0] for x in shown},
        units={x.name: x.unit for x in shown},
        linearised=about,
        notes=tuple(note_of_omitted(shown, d)),
    )
