"""State-space models of loops with free variables, in these and their rates, or in other joint variables.

Closure and its rate give the tangents of dependent variables and rates along each state. Those of
accelerations and closing wrench solve the tangents of the accelerations of closure and of the balance of
efforts, which are linear in both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import ModelError, nearest
from symgen.runtime.arrays import Array
from symgen.runtime.linearisation.record import Linearisation
from symgen.runtime.loop.derivatives.poses import RANK, LoopPose, check_poles, null_space
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.result.state import State

#: Part of the size of the loop, and of its speeds, by which a state may be open.
_CLOSED = 1e-6
#: Coordinates whose motions are closer to dependent than this do not determine the motion.
_DEPENDENT = 1e-9


class FreePose(LoopPose):
    """A loop in unforced motion at a state, with its accelerations and closing wrench.

    Parameters
    ----------
    tangents
        The kernels of the analysis ``loop_linearisation``.

    Raises
    ------
    ModelError
        For a state that does not close; when accelerations are not determined there, or an output is not.
    """

    def __init__(self, loop: LoopKernels, tangents: LoopKernels, state: State) -> None:
        check_closed(loop, state)
        super().__init__(loop, tangents, state.t, state.q, state.u, np.zeros_like(state.u))
        self.free = loop.description.having("free")
        n = len(state.q)
        self.moving = [i for i in range(n) if i not in self.inputs]
        units = np.zeros((n, self.size))
        units[:, 2 * n : 3 * n] = np.diag(self.columns)
        #: Directions of the accelerations that are not prescribed, and of the closing wrench.
        accelerating = units[self.moving]
        # rank must not depend on masses: the largest effort by an acceleration is the unit of efforts
        self.effort = float(np.max(np.abs(self._efforts(accelerating)), initial=0.0)) or 1.0
        self.unknowns = np.vstack([accelerating, self.wrenches])
        self.matrix = self._equations(self.unknowns).T
        undetermined, count = null_space(self.matrix), len(self.moving)
        if np.max(np.abs(undetermined[:, :count]), initial=0.0) > 1e-6:
            raise ModelError(
                f"{loop.description.name}: accelerations are not determined at t = {state.t:g} s: links that "
                f"move freely have no mass, or less than {RANK:g} of that of the others"
            )
        self.check_determined(undetermined[:, count:] @ self.wrenches)
        if self.inputs:
            self.acceleration[self.inputs] = loop.prescribed(state.t)[:, 2]
        motion = loop("motion", state.t, state.q, state.u)
        drift = motion["screw_drift"].ravel() + motion["screws"] @ self.acceleration
        left = self.called("efforts", np.zeros(self.size))["efforts_left"].ravel()
        left = (left * self.columns)[self.known] / self.effort
        solved = self._solved(np.concatenate([drift / self.lengths, left]))
        self.acceleration = self.acceleration + solved[2 * n : 3 * n]
        self.wrench = solved[self.places[2] : self.places[3]]

    def _equations(self, direction: Array) -> Array:
        """Return the tangents of accelerations of closure and of known efforts, scaled, in rows for many."""
        closure = self.along("motion", direction)[..., 6:] / self.lengths
        return np.concatenate([closure, self._efforts(direction) / self.effort], axis=-1)

    def _efforts(self, direction: Array) -> Array:
        """Return the tangents of known efforts [N m]."""
        return (self.along("efforts", direction) * self.columns)[..., self.known]

    def _solved(self, left: Array) -> Array:
        """Return the direction of accelerations and wrench that changes the equations by minus these."""
        return -np.linalg.lstsq(self.matrix, left.T, rcond=RANK)[0].T @ self.unknowns

    def started(self, order: int, variable: int) -> Array:
        """Return the direction of everything by a free variable (order 0) or its rate (1)."""
        direction = np.zeros(self.size)
        direction[order * len(self.q) + variable] = 1.0
        name = self.loop.description.variables[variable].name
        for k in range(order, 2):
            self.carry(direction, k, name)
        return direction + self._solved(self._equations(direction))

    def by_parameter(self, name: str) -> Array:
        """Return the direction of places and rates by a parameter; free variables keep theirs."""
        direction, change = self.of_parameter(name)
        self._prescribe(direction)
        for order in range(2):
            self.carry(direction, order, name, change)
        return direction

    def _prescribe(self, direction: Array) -> None:
        """Set the tangents of prescribed motions by the parameters of a direction, or of each in rows."""
        if self.inputs:
            n, prescribed = len(self.q), self.along("prescribed", direction)
            for order in range(3):
                direction[..., order * n + np.array(self.inputs)] = prescribed[..., order::3]

    def by_state(self, moved: Array, parameters: Sequence[str], seeds: Array) -> Array:
        """Return the tangents of outputs (outputs, columns) along tangents of the state and of parameters.

        Parameters
        ----------
        moved
            Tangents of places and rates, (2n, columns).
        seeds
            Tangents of the parameters, (parameters, columns).
        """
        names = [p.name for p in self.loop.description.parameters]
        directions = np.zeros((moved.shape[1], self.size))
        directions[:, self.places[-1] + np.array([names.index(x) for x in parameters], dtype=int)] = seeds.T
        self._prescribe(directions)
        directions[:, : len(moved)] = moved.T
        return self._outputs(directions + self._solved(self._equations(directions)))

    def _driven(self, name: str) -> Array:
        """Return the direction of accelerations and wrench by an input of the scene."""
        direction, _ = self.of_parameter(name)
        return direction + self._solved(self._equations(direction))

    def _chosen(self, coordinates: Sequence[str] | None) -> tuple[list[int], Array]:
        """Return the numbers of independent coordinates, and their motions by the free variables.

        Raises
        ------
        ModelError
            For names that are not joint variables; for coordinates that do not determine the motion.
        """
        d, count = self.loop.description, len(self.free)
        if coordinates is None:
            return self.free, np.eye(count)
        known = [d.variables[i].name for i in self.moving]
        for name in coordinates:
            if name not in known:
                raise ModelError(
                    f"expected joint variables of {d.name} that are not prescribed, got {name!r}. "
                    f"{nearest(name, known)}"
                )
        if len(set(coordinates)) != count or len(coordinates) != count:
            raise ModelError(
                f"expected {count} different coordinates of {d.name}, one for each degree of freedom, got "
                f"{len(coordinates)}: {', '.join(coordinates) or 'none'}"
            )
        chosen = [[v.name for v in d.variables].index(name) for name in coordinates]
        moved = np.array([self._moved(i) for i in self.free]).T[chosen]
        sizes = self.columns[chosen, None] / self.columns[self.free]
        if np.linalg.svd(moved / sizes, compute_uv=False)[-1] < _DEPENDENT:
            raise ModelError(
                f"the coordinates {', '.join(coordinates)} do not determine the motion of {d.name} at this "
                "state: some combination of them is constant there\n  Choose other coordinates."
            )
        return chosen, moved

    def _moved(self, variable: int) -> Array:
        """Return the motion of all variables by a free one."""
        direction = np.zeros(self.size)
        direction[variable] = 1.0
        self.carry(direction, 0, self.loop.description.variables[variable].name)
        return direction[: len(self.q)]

    def mass_matrix(self, coordinates: Sequence[str] | None) -> Array:
        """Return the mass matrix of independent coordinates, the free variables when absent."""
        _, turned = self._chosen(coordinates)
        whole = self.loop("inverse", self.t, self.q, self.u)["mass_matrix"]
        basis = np.array([self._moved(i) for i in self.free])
        inverse = np.linalg.inv(turned)
        return inverse.T @ basis @ whole @ basis.T @ inverse

    def state_space(self, inputs: Sequence[str], coordinates: Sequence[str] | None) -> Linearisation:
        """Return A, B, C and D in independent coordinates, the free variables when absent.

        Prescribed motions follow their course in time.
        """
        d, n, count = self.loop.description, len(self.q), len(self.free)
        chosen, _ = self._chosen(coordinates)
        by_free = np.array([self.started(order, i) for order in (0, 1) for i in self.free])
        places = [*chosen, *(n + i for i in chosen)]
        directions = np.linalg.solve(by_free[:, places].T, by_free)
        driven = np.array([self._driven(name) for name in inputs]).reshape(len(inputs), self.size)
        accelerations = [2 * n + i for i in chosen]
        names = [d.variables[i].name for i in chosen]
        states = (*names, *(f"{name}'" for name in names))
        units = [d.variables[i].unit for i in chosen]
        of_inputs = {p.name: p.unit for p in d.tunable if p.name in inputs}
        return Linearisation(
            A=np.vstack(
                [np.hstack([np.zeros((count, count)), np.eye(count)]), directions[:, accelerations].T]
            ),
            B=np.vstack([np.zeros((count, len(inputs))), driven[:, accelerations].T]),
            C=self._outputs(directions),
            D=self._outputs(driven),
            states=states,
            inputs=tuple(inputs),
            outputs=tuple(self.outputs),
            units=dict(zip(states, [*units, *(f"{unit}/s" for unit in units)], strict=True))
            | self.outputs
            | of_inputs,
            t=self.t,
            x=np.concatenate([self.q[chosen], self.u[chosen]]),
            u=np.array([self.loop.parameter_values[[p.name for p in d.parameters].index(x)] for x in inputs]),
            y=self.values,
            rates=np.concatenate([self.u[chosen], self.acceleration[chosen]]),
        )

    def _outputs(self, directions: Array) -> Array:
        """Return the tangents of outputs along directions, (outputs, directions)."""
        if not self.outputs:
            return np.zeros((0, len(directions)))
        return self.along("slopes", directions).T


def check_closed(loop: LoopKernels, state: State) -> None:
    """Raise ModelError for a state that violates closure, or prescribed motions."""
    d, n = loop.description, loop.description.coordinates
    if state.q.shape != (n,) or state.u.shape != (n,):
        raise ModelError(
            f"expected a state of {d.name} of {n} joint variables and rates, got {len(state.q)} and "
            f"{len(state.u)}\n  model.state({{...}}) returns one."
        )
    blocks = loop("position", state.t, state.q, state.u)
    lengths = np.array([1.0, 1.0, 1.0, d.size, d.size, d.size])
    prescribed = loop.prescribed(state.t)
    off = (state.q[loop.inputs] - prescribed[:, 0]) / loop.scale[loop.inputs]
    defect = max(float(np.max(np.abs(blocks["closure_defect"] / lengths[[0, 0, 0, 3]]))), *np.abs(off), 0.0)
    opening = blocks["closure_jacobian"] @ state.u / lengths
    off = (state.u[loop.inputs] - prescribed[:, 1]) / loop.scale[loop.inputs]
    speed = max(float(np.max(np.abs(state.u / loop.scale))), 1e-300)
    rate = max(float(np.max(np.abs(opening))), *np.abs(off), 0.0)
    closed = defect <= max(_CLOSED, 2.0 * loop.tolerance)
    if closed and rate > _CLOSED * speed:
        check_poles(loop, state.t, state.q)
    if not (closed and rate <= _CLOSED * speed):
        raise ModelError(
            f"the state at t = {state.t:g} s does not close {d.name}: by {defect:.1e} (rotation in rad, "
            f"displacement over {d.size:.4g} m), and its rates by {rate:.1e} 1/s\n"
            "  model.state({...}) returns closed states, model.rhs.project(t, y) closes one y = (q, u)."
        )
