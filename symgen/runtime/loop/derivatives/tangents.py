"""The linearised motion of a loop of joints at a state.

Its constraints are closure and the prescribed inputs; its equations of motion are the balance of the known
efforts, and the accelerations of closure and inputs, for accelerations and closing wrench. Kernels give the
tangents of all these along a direction, and along unit directions their slopes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.loop_description import LoopDescription
from symgen.runtime.linearisation.slopes import StateSlopes
from symgen.runtime.linearisation.tangents import Tangents
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.state import State

#: Singular values below this part of the largest count as zero.
_RANK = 1e-9
#: Forces of outputs below this part of the largest count as zero.
_LEFT = 1e-9
#: Singular values of dependent variables at a dead centre, over the largest: the pose is known to the root of
#: rounding only.
_SINGULAR = 1e-7
#: Part of its unit that an acceleration may be open.
_OPEN = 1e-6
#: Part of the size of the loop, and of its speeds, by which a state may be open.
_CLOSED = 1e-6


class LoopTangents(Tangents):
    """The linearised motion of a loop at a state.

    Parameters
    ----------
    loop
        Its kernels.
    kernels
        Those of the analysis ``loop_linearisation``, or ``loop_sensitivity`` of a driven loop.
    state
        The state.

    Raises
    ------
    ModelError
        For a state of a free loop that does not close; at a singular position; where free variables open
        redundant closure equations; when accelerations are not determined.
    """

    model: LoopKernels
    CHOICE = "Choose joint variables that are not prescribed."

    def __init__(self, loop: LoopKernels, kernels: LoopKernels, state: State) -> None:
        d, n, inputs, columns = loop.description, len(state.q), loop.inputs, loop.scale
        if d.having("free"):
            check_closed(loop, state)
        self.model, self._kernels, self.driven = loop, kernels, range(6, 6 + len(inputs))
        self._known = [i for i, v in enumerate(d.variables) if not v.unknown and kernels.has("efforts")]
        motion, dependent = loop("motion", state.t, state.q, state.u), d.having("dependent")
        jacobian = np.vstack([motion["screws"], np.eye(n)[inputs]])
        scale = np.append(_lengths(d), columns[inputs])
        moving = jacobian / scale[:, None] * columns
        if _rank(np.linalg.svd(moving[:6, dependent])[1], _SINGULAR) < len(dependent):
            check_poles(loop, state.t, state.q)
            raise ModelError(
                f"{d.name} is at a singular position, such as a dead centre, at {loop.value_at(state.t)}: "
                "its inputs and free variables do not determine how it moves\n"
                "  Choose a state away from it."
            )
        self.state, self.solution = state, np.zeros(n + 6)
        directions = np.eye(3 * n + 6 + len(loop.parameter_values))
        efforts = np.zeros((n, n + 6))
        if self._known:
            efforts = self._along("efforts", directions[2 * n : 3 * n + 6]).T
        names = [p.name for p in d.parameters]
        super().__init__(d, names, state, efforts[:, :n], jacobian, scale, columns, 6 - len(dependent))
        if np.max(np.abs(moving @ (self.free / columns[:, None])), initial=0.0) > _RANK:
            raise self.refusal("a change of its free variables", self.contradicts(0))
        self._balance(efforts[self._known, n:])
        # All equations are linear in accelerations and wrench: what is left without these determines them.
        left = np.concatenate([-motion["screw_drift"].ravel(), loop.prescribed(state.t)[:, 2]])
        if self._known:
            left = np.append(-self._called("efforts")["efforts_left"].ravel()[self._known], left)
        self.solution = self._solved(left[:, None])[:, 0]
        self.slopes = self._slopes(directions)

    def _balance(self, by_wrench: Array) -> None:
        """Invert the balance of known efforts, for free accelerations and closing wrench.

        Its rank must not depend on masses: the largest effort by an acceleration is the unit of efforts.
        """
        columns, known, d = self.units_of_coordinates, self._known, self.description
        sizes = np.abs(columns[known, None] * self.mass[known] * columns)
        joints, states = slice(self.n - len(d.states)), np.isin(known, d.having("state"))
        effort, count = float(np.max(sizes[~states, joints], initial=0.0)) or 1.0, self.free.shape[1]
        self._units = np.append(np.ones(count), _lengths(d) * effort / d.size)
        self._rows = np.where(states, 1.0, effort)[:, None] / columns[known, None]
        matrix = np.hstack([self.mass[known] @ self.free, by_wrench]) / self._rows * self._units
        self._inverse = np.linalg.pinv(matrix, rcond=_RANK)
        _, values, right = np.linalg.svd(matrix)
        accelerations, self._open = np.hsplit(right[_rank(values) :], [count])
        if np.max(np.abs(accelerations), initial=0.0) > _OPEN:
            raise ModelError(
                f"{d.name}: accelerations are not determined at t = {self.state.t:g} s: links that move "
                f"freely have no mass, or less than {_RANK:g} of that of the others"
            )

    def _solved(self, right: Array) -> Array:
        force, gamma = np.split(right, [len(self._known)])
        a = self.bound @ (gamma / self.scale[:, None])
        left = (force - self.mass[self._known] @ a) / self._rows
        free, wrench = np.split(self._units[:, None] * (self._inverse @ left), [self.free.shape[1]])
        return np.vstack([a + self.free @ free, wrench])

    def _called(self, kernel: str) -> dict[str, Array]:
        """Return all results of a kernel by name, without directions."""
        return self._kernels(kernel, self.state.t, self.state.q, self.state.u, self.solution)

    def rates_along(self, motion: Array) -> Array:
        """Return the slopes of the rates of closure and inputs, a row each, with the rates of a motion."""
        rates = self.slopes.rates.copy()
        directions = np.eye(rates.shape[1])
        changed = [*range(self.n), *range(self.by_solution.stop, len(directions))]
        rates[:6, changed] = self._along("motion", directions[changed], motion).T[:6]
        return rates

    def gap(self) -> float:
        """Return by how much the loop is open, in rotation [rad] and displacement over its size."""
        return _defect(self.model, self.state)

    def _along(self, kernel: str, directions: Array, rates: Array | None = None) -> Array:
        """Return the tangents that a kernel gives along directions, (directions, entries), at other rates."""
        count, (first, size) = len(directions), (len(self.solution), directions.shape[1])
        work = np.zeros((count, self._kernels.work_size + 1))
        work[:, :first], work[:, first : first + size] = self.solution, directions
        u = self.state.u if rates is None else rates
        states = np.tile(np.concatenate([self.state.q, u, [0.0]]), (count, 1))
        results = self._kernels.many(kernel, np.full(count, self.state.t), states, work)
        return next(x for name, x in results.items() if name.endswith("_tangent"))

    def _slopes(self, directions: Array) -> StateSlopes:
        """Return the slopes along unit directions."""
        d, n, inputs = self.model.description, len(self.state.q), self.model.inputs
        closure, motion = (self._along(x, directions).T for x in ("closure", "motion"))
        efforts = self._along("efforts", directions).T[self._known] if self._known else closure[:0]
        off = [directions[order * n :][inputs] for order in range(3)]
        if inputs:
            moved = self._along("prescribed", directions).T
            off = [own - moved[order::3] for order, own in enumerate(off)]
        constraints = np.vstack([closure, off[0]])
        constraints[:, :n] = self.jacobian
        residual, rates = -np.vstack([efforts, motion[6:], off[2]]), np.vstack([motion[:6], off[1]])
        outputs: dict[str, Array] = {}
        values: dict[str, float] = {}
        units: dict[str, str] = {}
        if blocks := self._kernels.blocks("values"):
            rows = iter(self._along("slopes", directions).T)
            results = self._called("values")
            for block in blocks:
                several = len(block.rows) > 1
                names = [f"{block.name}.{row}" for row in block.rows] if several else [block.name]
                units |= dict.fromkeys(names, block.unit)
                values |= dict(zip(names, results[block.name].ravel().tolist(), strict=True))
                outputs |= {name: next(rows) for name in names}
        state = np.concatenate([self.state.q, self.state.u, self.solution[:n]])
        for order, (mark, per) in enumerate((("", ""), ("'", "/s"), ("''", "/s^2"))):
            for i, variable in enumerate(d.variables, order * n):
                name = variable.name + mark
                outputs[name], values[name] = directions[i], float(state[i])
                units[name] = variable.unit + per
        return StateSlopes(residual, rates, constraints, outputs, values, units)

    def contradicts(self, row: int) -> str:
        """Return the effect of a change that violates closure equations, in words, with a remedy."""
        return (
            f"opens the redundant closure equations of {self.description.name}\n"
            "  Give parameters that keep the loop closed."
        )

    def check_unique(self, outputs: Sequence[str]) -> None:
        """Raise ModelError for an output by forces that redundant closure equations leave open."""
        for name in outputs:
            by = self.slopes.outputs[name][self.by_solution][self.n :] * self._units[-6:]
            if np.max(np.abs(self._open @ by), initial=0.0) > _LEFT * np.max(np.abs(by)):
                reason = f"is not determined: closure equations of {self.description.name} are redundant"
                raise self.refusal(name, reason)


def check_poles(loop: LoopKernels, t: float, q: Array) -> None:
    """Raise ModelError where the angles of a ball joint have a pole."""
    if names := ball_pole(loop, t, q):
        raise ModelError(
            f"{loop.description.name} at {loop.value_at(t)}: the angles {', '.join(names)} of a ball joint "
            "have a pole there, a property of these angles and not of the loop\n"
            "  Take another pose, or turn the axes of the rows next to the ball (theta, alpha) so that its "
            "pole lies elsewhere."
        )


def check_closed(loop: LoopKernels, state: State) -> None:
    """Raise ModelError for a state that violates closure, or prescribed motions."""
    d, n = loop.description, loop.description.coordinates
    if state.q.shape != (n,) or state.u.shape != (n,):
        raise ModelError(
            f"expected a state of {d.name} of {n} joint variables and rates, got {len(state.q)} and "
            f"{len(state.u)}\n  model.state({{...}}) returns one."
        )
    prescribed, defect = loop.prescribed(state.t), _defect(loop, state)
    off = (state.q[loop.inputs] - prescribed[:, 0]) / loop.scale[loop.inputs]
    defect = max(defect, *np.abs(off), 0.0)
    opening = loop("position", state.t, state.q, state.u)["closure_jacobian"] @ state.u / _lengths(d)
    off = (state.u[loop.inputs] - prescribed[:, 1]) / loop.scale[loop.inputs]
    speed = max(float(np.max(np.abs(state.u / loop.scale)[: n - len(d.states)])), 1e-300)
    rate = max(float(np.max(np.abs(opening))), *np.abs(off), 0.0)
    allowed = max(_CLOSED, 2.0 * loop.tolerance)
    if defect <= allowed < rate / speed:
        check_poles(loop, state.t, state.q)
    if not (defect <= allowed and rate <= allowed * speed):
        raise ModelError(
            f"the state at t = {state.t:g} s does not close {d.name}: by {defect:.1e} (rotation in rad, "
            f"displacement over {d.size:.4g} m), and its rates by {rate:.1e} 1/s\n"
            "  model.state({...}) returns closed states, model.rhs.project(t, y) closes one y = (q, u)."
        )


def _defect(loop: LoopKernels, state: State) -> float:
    """Return the largest rotation [rad], and displacement over the size, by which a loop is open."""
    defect = loop("position", state.t, state.q, state.u)["closure_defect"]
    return float(np.max(np.abs(defect / _lengths(loop.description)[[0, 0, 0, 3]])))


def _lengths(d: LoopDescription) -> Array:
    """Return the units of the six closure equations, and of the closing wrench of unit force."""
    return np.array([1.0, 1.0, 1.0, d.size, d.size, d.size])


def _rank(values: Array, least: float = _RANK) -> int:
    """Return the number of singular values that count."""
    return int(np.count_nonzero(values > least * values.max(initial=0.0)))
