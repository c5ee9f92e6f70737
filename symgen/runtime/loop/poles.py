"""Where given loads cannot hold the loop, and which components of the wrenches nothing determines.

Let E be the dependent variables of unknown effort, and G = dq_E/dq_i their sensitivity to the inputs i of
given effort. The unknown efforts x solve G^T x = needed - given; where G loses rank, at a dead centre, x has
a true pole in the input. Its residue follows from the rate of G, which the rates of the screws give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.errors import ModelError
from symgen.runtime import _core, _loop
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import part
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.following import FINE, around, follow_over
from symgen.runtime.loop.kernels import LoopKernels

_RANK = 1e-8
#: Steps [rad, or sizes of the loop] of the input in which a limit at a pole is approached, four on a side.
_APART = 0.0075
#: Part of an output near a pole of efforts, over its time from there, below which it has no pole.
_SMOOTH = 1e-6
#: Units of outputs of the motion alone; directions have no unit.
OF_MOTION = {"m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "1"}


@dataclass(frozen=True, slots=True)
class PoleAt:
    """A pole: the time [s], the state there, and the residue of each output in time, SI units."""

    t: float
    q: Array
    residue: dict[str, Array]


def poles(
    kernels: LoopKernels, equations: _loop.LoopEquations, times: Array, states: Array, diagnosis: Array
) -> list[PoleAt]:
    """Return the poles met and passed between the samples of a followed loop, in order."""
    d = kernels.description
    if not kernels.has("inverse") or not any(d.variables[i].unknown for i in d.having("dependent")):
        return []
    n, before = d.coordinates, -1
    candidates: list[tuple[float, Array, tuple[float, Array]]] = []  # with a pose from which it is followed
    for i in np.argsort(times, kind="stable"):
        t, hold, status = float(times[i]), diagnosis[i, _loop.HOLD], diagnosis[i, _loop.STATUS]
        if status == _loop.POLE:
            if not candidates or candidates[-1][0] != t:
                candidates.append((t, states[i, :n], (t, states[i, :n])))
        elif before >= 0 and status == _core.DONE and diagnosis[before, _loop.HOLD] * hold < 0.0:
            start = float(times[before]), states[before, :n]
            passed = _between(kernels, equations, start, t)
            candidates += [(*passed, start)] if passed else []
        before = i if status == _core.DONE else -1
    return [PoleAt(t, q, _residue(kernels, equations, t, q, start)) for t, q, start in candidates]


def _between(
    kernels: LoopKernels, equations: _loop.LoopEquations, start: tuple[float, Array], high: float
) -> tuple[float, Array] | None:
    """Return where the hold of the drives changes its sign between two times; None where it does not."""
    low, follower = start[0], _Follower(kernels, equations, *start)
    ends = follower(low), follower(high)
    if not ends[0] * ends[1] < 0.0:
        return None  # the input turned back between the samples, or the loop could not be followed
    from scipy.optimize import brentq  # loaded only where a pole is

    at = float(brentq(follower, low, high, xtol=1e-15 * max(1.0, abs(high)), rtol=8.9e-16))
    follower(at)
    return (at, follower.q) if abs(follower.hold) < 1e-6 else None


class _Follower:
    """The hold of the drives as a function of the time, followed from a state."""

    def __init__(self, kernels: LoopKernels, equations: _loop.LoopEquations, t: float, q: Array) -> None:
        self.kernels, self.equations, self.t, self.start = kernels, equations, t, q
        self.states, self.out, self._diagnosis = kernels.empty(1)
        self.q, self.hold = q, 0.0

    def __call__(self, t: float) -> float:
        q, span = np.append(self.start, 0.0), max(abs(t - self.t), 1e-12)
        rows = self.states, self.out, self._diagnosis
        status, *_ = follow_over(self.kernels, self.equations, self.t, q, np.array([t]), span, *rows)
        self.q = self.states[0, : len(self.start)].copy()
        # Zero where a pole of the angles of a ball joint hides it: a change of sign there ends at that pole.
        self.hold = float(self._diagnosis[0, _loop.HOLD]) if status == _core.DONE else np.nan
        return self.hold


def beside_pole(
    kernels: LoopKernels, equations: _loop.LoopEquations, t: float, q: Array, out: Array
) -> Array:
    """Return the outputs at a pole: those that have none there are the limit from both sides.

    The wrenches solved for at the pole balance the loads but not the given drives, so only the motions in
    ``out`` are right. The limit is the polynomial through four values on either side.
    """
    beside = around(kernels, equations, (t, q), t, _APART)
    if beside is None:
        return np.full_like(out, np.nan)
    limit = FINE @ beside.out
    return np.where(np.abs(limit - out) <= 1e-9 * np.maximum(1.0, np.abs(out)), out, limit)


def at_state(kernels: LoopKernels, equations: _loop.LoopEquations, t: float, q: Array) -> tuple[Array, Array]:
    """Return rates, and accelerations with the closing wrench, of the closed loop at (t, q)."""
    n = kernels.description.coordinates
    states, *others = kernels.empty(1)
    status, *_ = equations.follow(t, np.append(q, 0.0), np.array([t]), 1.0, states, *others)
    if status != _core.DONE:
        return np.zeros(n), np.zeros(n + 6)
    return states[0, n : 2 * n], states[0, 2 * n : 3 * n + 6]


def _residue(
    kernels: LoopKernels, equations: _loop.LoopEquations, t: float, q: Array, start: tuple[float, Array]
) -> dict[str, Array]:
    """Return lim (t - t*) times every output, at a pole t* of the efforts."""
    d = kernels.description
    if ball_pole(kernels, t, q):
        return _limit(kernels, equations, t, start)
    solved, inputs = d.having("dependent"), d.having("input")
    unknown = [k for k, j in enumerate(solved) if d.variables[j].unknown]
    known_inputs = [j for j in inputs if not d.variables[j].unknown]
    u, work = at_state(kernels, equations, t, q)
    motion = kernels("motion", t, q, u)
    screws, rates = motion["screws"], motion["screw_rates"]
    inverse = np.linalg.pinv(screws[:, solved], rcond=_RANK)
    gain = -inverse @ screws[:, known_inputs]
    slope = -inverse @ (rates[:, known_inputs] + rates[:, solved] @ gain)
    needed = kernels("inverse", t, q, u, work[: len(q)])["inverse_efforts"]
    known = kernels("given", t, q, u)["given_efforts"] if kernels.has("given") else np.zeros(len(q))
    across = np.vstack([screws[3:], screws[:3]])  # reciprocal product with (force, moment)
    basis = np.linalg.pinv(across[:, solved].T, rcond=_RANK)
    wrench = basis @ (known - needed)[solved]
    missing = (needed + across.T @ wrench - known)[known_inputs]
    left, _, right = np.linalg.svd(gain[unknown].T)
    row, column = left[:, -1], right[-1]
    rise, size = float(row @ slope[unknown].T @ column), float(np.max(np.abs(slope))) + 1e-300
    if not abs(rise) > _RANK * size:
        names = [
            ", ".join(d.variables[j].name for j in which)
            for which in ([solved[k] for k in unknown], known_inputs)
        ]
        raise ModelError(
            f"drives at {names[0]} transmit no force to {names[1]} at {kernels.value_at(t)} and near it: "
            "they cannot balance the prescribed efforts\n  Choose other unknown drives."
        )
    strength = (row @ missing) / rise
    effort = np.zeros(len(solved))
    effort[unknown] = strength * column
    return _differences(kernels, t, q, [basis @ effort])[0]


def _limit(
    kernels: LoopKernels, equations: _loop.LoopEquations, t: float, start: tuple[float, Array]
) -> dict[str, Array]:
    """Return the same at a pole of the angles of a ball joint too, where rates of screws do not give it."""
    beside, info = around(kernels, equations, start, t, _APART), kernels.description.kernel("outputs")
    if beside is None or info is None:
        return {}
    parts = (beside.times - t)[:, None] * beside.out
    limit = FINE @ parts
    limit[np.abs(limit) < _SMOOTH * np.max(np.abs(parts), axis=0)] = 0.0
    # Efforts have poles, motions have none, although the angles of a ball change fast there.
    return {b.name: part(limit, b) * (b.unit not in OF_MOTION) for b in info.blocks}


def _differences(kernels: LoopKernels, t: float, q: Array, wrenches: list[Array]) -> list[dict[str, Array]]:
    """Return the change of the outputs due to each of these closing wrenches, in which they are affine."""
    base, u = np.zeros(len(q) + 6), np.zeros(len(q))
    without = kernels("outputs", t, q, u, base)
    differences = []
    for wrench in wrenches:
        size = float(np.max(np.abs(wrench))) or 1.0
        base[len(q) :] = wrench / size
        with_it = kernels("outputs", t, q, u, base)
        change = {name: with_it[name] - without[name] for name in without}
        noise = {name: 1e-13 * (np.abs(without[name]) + 1.0) for name in without}
        differences.append({n: size * np.where(np.abs(x) > noise[n], x, 0.0) for n, x in change.items()})
    return differences
