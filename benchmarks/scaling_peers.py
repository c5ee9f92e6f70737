"""N four-bar linkages in a row in MuJoCo: hinges in a tree, the end of every coupler connected to its crank.

MuJoCo's connections are soft: their time constant is the smallest that it accepts, twice the step. The
integrator is the faster one for these models of the two that were tried (RK4, implicitfast).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Moments of inertia of a rod of 1 m and 1 kg about its centre [kg m^2]; that about its axis is negligible.
ACROSS, ALONG = 1 / 12, 1e-6


class MuJoCo:
    """The row with upright cranks; ``run`` returns position and velocity of the first tip (times, 4)."""

    def __init__(self, n: int, step: float, rate: float, gravity: float) -> None:
        import mujoco

        self._mujoco: Any = mujoco
        hinge, bodies = '<joint type="hinge" axis="0 -1 0"/>', ""
        for k in range(n + 1):
            coupler = (
                f'<body name="coupler{k}" pos="0 0 1">{hinge}'
                f'<inertial pos="0.5 0 0" mass="1" diaginertia="{ALONG} {ACROSS} {ACROSS}"/></body>'
            )
            bodies += (
                f'<body name="crank{k}" pos="{k} 0 0">{hinge}'
                f'<inertial pos="0 0 0.5" mass="1" diaginertia="{ACROSS} {ACROSS} {ALONG}"/>'
                f"{coupler if k < n else ''}</body>"
            )
        held = "".join(
            f'<connect body1="coupler{k}" body2="crank{k + 1}" anchor="1 0 0" solref="{2 * step} 1" '
            'solimp="0.9999 0.9999 0.001"/>'
            for k in range(n)
        )
        self._model: Any = mujoco.MjModel.from_xml_string(
            f'<mujoco><option integrator="implicitfast" timestep="{step}" gravity="0 0 -{gravity}"/>'
            f"<worldbody>{bodies}</worldbody><equality>{held}</equality></mujoco>"
        )
        self._data: Any = mujoco.MjData(self._model)
        for k in range(n + 1):
            self._data.qvel[self._hinge(f"crank{k}")] = rate
            if k < n:
                self._data.qvel[self._hinge(f"coupler{k}")] = -rate
        self._step = step

    def _hinge(self, body: str) -> int:
        """Return the number of the hinge of a body, of its angle and of its rate."""
        return int(self._model.body_jntadr[self._model.body(body).id])

    def run(self, times: Array) -> Array:
        """Simulate to evenly spaced times [s]."""
        angles, rates = np.empty(len(times)), np.empty(len(times))
        first, steps = self._hinge("crank0"), round((times[1] - times[0]) / self._step)
        for i in range(len(times)):
            if i:
                self._mujoco.mj_step(self._model, self._data, steps)
            angles[i], rates[i] = self._data.qpos[first], self._data.qvel[first]
        x, y = -np.sin(angles), np.cos(angles)
        return np.stack([x, y, -rates * y, rates * x], axis=1)
