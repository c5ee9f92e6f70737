"""State-space models of loops with free variables, in these and their rates.

Closure and its rate give the tangents of dependent variables and rates along each state. Those of
accelerations and closing wrench solve the tangents of the accelerations of closure and of the balance of
efforts, which are linear in both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.closure.start import Closed
from symgen.runtime.linearisation.loops import RANK, LoopPose, null_space
from symgen.runtime.linearisation.record import Linearisation
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.loop.motion import rates_at_start

Array = NDArray[np.float64]


def free_state_space(loop: LoopKernels, tangents: LoopKernels, begin: Closed) -> Linearisation:
    """Return A and C at the start, in free variables and their rates; inputs follow their motion in time.

    Parameters
    ----------
    tangents
        The kernels of the analysis ``loop_linearisation``.

    Raises
    ------
    ModelError
        When accelerations are not determined there, or an output is not.
    """
    u = rates_at_start(loop, begin)
    pose = _Free(loop, tangents, begin.t, begin.q, u, np.zeros_like(u))
    d, free = loop.description, loop.description.having("free")
    directions = [pose.direction(order, i) for order in (0, 1) for i in free]
    count, n = len(free), len(u)
    accelerations = [2 * n + i for i in free]
    slopes = np.array(directions)[:, accelerations].T
    names = [d.variables[i].name for i in free]
    states = (*names, *(f"{name}'" for name in names))
    units = [d.variables[i].unit for i in free]
    shown = [pose.along("slopes", x) for x in directions] if pose.outputs else np.zeros((2 * count, 0))
    rates = u[free]
    return Linearisation(
        A=np.vstack([np.hstack([np.zeros((count, count)), np.eye(count)]), slopes]),
        B=np.zeros((2 * count, 0)),
        C=np.array(shown).T,
        D=np.zeros((len(pose.outputs), 0)),
        states=states,
        inputs=(),
        outputs=tuple(pose.outputs),
        units=dict(zip(states, [*units, *(f"{unit}/s" for unit in units)], strict=True)) | pose.outputs,
        t=begin.t,
        x=np.concatenate([begin.q[free], rates]),
        u=np.zeros(0),
        y=pose.values,
        rates=np.concatenate([rates, pose.acceleration[free]]),
    )


class _Free(LoopPose):
    """A pose in unforced motion, with its accelerations and closing wrench."""

    def __init__(
        self, loop: LoopKernels, tangents: LoopKernels, t: float, q: Array, u: Array, acceleration: Array
    ) -> None:
        super().__init__(loop, tangents, t, q, u, acceleration)
        n = len(q)
        self.moving = [i for i in range(n) if i not in self.inputs]
        units = np.zeros((n, self.size))
        units[:, 2 * n : 3 * n] = np.diag(self.columns)
        #: Directions of the accelerations that are not prescribed, and of the closing wrench.
        accelerating = units[self.moving]
        # rank must not depend on masses: the largest effort by an acceleration is the unit of efforts
        self.effort = max((float(np.max(np.abs(self._efforts(x)))) for x in accelerating), default=0.0) or 1.0
        self.unknowns = np.vstack([accelerating, self.wrenches])
        self.matrix = np.array([self._equations(x) for x in self.unknowns]).T
        undetermined, count = null_space(self.matrix), len(self.moving)
        if np.max(np.abs(undetermined[:, :count]), initial=0.0) > 1e-6:
            raise ModelError(
                f"{loop.description.name}: accelerations are not determined at the start: links that move "
                f"freely have no mass, or less than {RANK:g} of that of the others"
            )
        self.check_determined(undetermined[:, count:] @ self.wrenches)
        if self.inputs:
            self.acceleration = acceleration.copy()
            self.acceleration[self.inputs] = loop.prescribed(t)[:, 2]
        motion = loop("motion", t, q, u)
        drift = motion["screw_drift"].ravel() + motion["screws"] @ self.acceleration
        left = self.called("efforts", np.zeros(self.size))["efforts_left"].ravel()
        left = (left * self.columns)[self.known] / self.effort
        solved = self._solved(np.concatenate([drift / self.lengths, left]))
        self.acceleration = self.acceleration + solved[2 * n : 3 * n]
        self.wrench = solved[self.places[2] : self.places[3]]

    def _equations(self, direction: Array) -> Array:
        """Return the tangents of accelerations of closure and of known efforts, scaled."""
        closure = self.along("motion", direction)[6:] / self.lengths
        return np.concatenate([closure, self._efforts(direction) / self.effort])

    def _efforts(self, direction: Array) -> Array:
        """Return the tangents of known efforts [N m]."""
        efforts: Array = (self.along("efforts", direction) * self.columns)[self.known]
        return efforts

    def _solved(self, left: Array) -> Array:
        """Return the direction of accelerations and wrench that changes the equations by minus these."""
        found: Array = -np.linalg.lstsq(self.matrix, left, rcond=RANK)[0] @ self.unknowns
        return found

    def direction(self, order: int, variable: int) -> Array:
        """Return the direction of everything by a free variable (order 0) or its rate (1)."""
        direction = np.zeros(self.size)
        direction[order * len(self.q) + variable] = 1.0
        name = self.loop.description.variables[variable].name
        for k in range(order, 2):
            self.carry(direction, k, name)
        return direction + self._solved(self._equations(direction))
