"""The constraints of a model as numbers: residual, Jacobian and right-hand sides, each in metres."""

from __future__ import annotations

import numpy as np

from symgen.runtime import _core
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.integrate.redundancy import extent
from symgen.runtime.kernels.evaluate import Evaluator, part
from symgen.runtime.rods.poses import Poses


class Constraints:
    """Constraints Phi(q, t) = 0 of a model, every row divided by its scale, so that errors are in metres.

    Parameters
    ----------
    evaluator
        The kernels of the equations of motion.
    kinematics
        Those of the analysis ``kinematics``.
    """

    def __init__(self, evaluator: Evaluator, kinematics: Evaluator) -> None:
        self.evaluator, self.kinematics = evaluator, kinematics
        self.description = evaluator.description
        self.n, self.m = self.description.coordinates, len(self.description.constraints)
        self._rest = np.zeros(self.n)
        self._arguments = np.zeros(1), np.zeros(self.n + 1), np.zeros(self.n + 1)
        self._work = np.zeros(evaluator.work_size + 1)
        self._calls: dict[str, tuple[int, _core.Sizes, Array, Array]] = {}

    @property
    def slopes(self) -> Indices:
        """Constraint, coordinate and index in the result of ``closure`` of each slope of Phi: (slopes, 3)."""
        d = self.description
        block = next(b for b in self.kinematics.info("closure").blocks if b.name == "constraint_slopes")
        return np.array(block.places(d.constraints, d.of_coordinates()), dtype=np.intp)

    def residual(self, q: Array, t: float) -> Array:
        """Return Phi over its scale [m], shape (m,)."""
        return self._scaled("constraints", q, self._rest, t)

    def jacobian(self, q: Array, t: float) -> Array:
        """Return dPhi/dq over the scale [1], shape (m, n)."""
        return self._scaled("constraint_jacobian", q, self._rest, t, self.n).reshape(self.m, self.n)

    def drift(self, q: Array, t: float) -> Array:
        """Return dPhi/dt at fixed q over the scale [m/s], shape (m,)."""
        return self._scaled("velocity_constraints", q, self._rest, t)

    def gamma(self, q: Array, u: Array, t: float) -> Array:
        """Return the right-hand side of J a = gamma over the scale [m/s^2], shape (m,)."""
        return self._scaled("acceleration_rhs", q, u, t)

    def _scaled(self, kernel: str, q: Array, u: Array, t: float, columns: int = 1) -> Array:
        if not self.m:
            return np.zeros(0)
        blocks = self._call("constraints", q, u, t)
        value, scale = blocks[: self.m], blocks[self.m : 2 * self.m]
        if kernel != "constraints":
            value = self._call(kernel, q, u, t)[: self.m * columns]
        return (value.reshape(self.m, columns) / scale[:, None]).ravel()

    def _call(self, kernel: str, q: Array, u: Array, t: float) -> Array:
        """Call a kernel with stored arrays, since a curve takes thousands of calls."""
        if kernel not in self._calls:
            source = self.kinematics if kernel == "acceleration_rhs" else self.evaluator
            address, sizes = source.call(kernel)
            self._calls[kernel] = address, sizes, source.parameters, np.zeros(sizes[-1] + 1)
        address, sizes, parameters, out = self._calls[kernel]
        self._arguments[0][0] = t
        self._arguments[1][: self.n] = q
        self._arguments[2][: self.n] = u
        _core.call(address, sizes, *self._arguments, parameters, self._work, out)
        return out

    def drives(self, t: float) -> dict[str, float]:
        """Return the value of every drive by name [rad or m]."""
        if not self.kinematics.has("drives"):
            return {}
        blocks = self.kinematics.blocks("drives", t, self._rest, self._rest)
        return {name: float(value[0]) for name, value in blocks.items()}

    def units(self) -> dict[str, str]:
        """Return the unit of every drive."""
        info = self.kinematics.description.kernel("drives")
        return {b.name: b.unit for b in info.blocks} if info else {}

    def length(self, q: Array) -> float:
        """Return the size of the linkage [m]: the largest extent of its points."""
        return extent(self.evaluator, q)

    def places(self, q: Array, t: float) -> Array:
        """Return the positions of all points [m], shape (points, axes)."""
        return self.evaluator.blocks("points", t, q, self._rest)["positions"]

    def drawn_places(self, q: Array) -> Array:
        """Return the positions of the points of the scene at the time 0 [m], shape (points, axes)."""
        return self.places(q, 0.0)[: self.description.drawn]

    def errors(self, poses: Poses) -> tuple[float, float]:
        """Return the largest of Phi over its scale [m] and of its rate [m/s] at many poses."""
        closure = self.kinematics.many("closure", poses.times, poses.q, poses.u)
        values, scale, rates = np.split(closure[:, : 3 * self.m], 3, axis=1)
        place, rate = (float(np.max(np.abs(x / scale), initial=0.0)) for x in (values, rates))
        return place, rate

    def moving(self, poses: Poses) -> tuple[Array, Array]:
        """Return positions [m] and velocities [m/s] of all points at many poses, (poses, points, axes)."""
        blocks = self.evaluator.many_blocks("points", poses.times, poses.q, poses.u)
        return blocks["positions"], blocks["velocities"]

    def accelerating(self, poses: Poses) -> Array:
        """Return the accelerations [m/s^2] of all points at many poses, (poses, points, axes)."""
        states = poses.times, poses.q, poses.u, poses.accelerations
        return self.evaluator.many_blocks("point_accelerations", *states)["point_accelerations"]

    def turning(self, poses: Poses) -> dict[str, tuple[Array, Array]]:
        """Return angular velocity [rad/s] and acceleration [rad/s^2] of links in the plane, (poses,) each."""
        states = poses.times, poses.q, poses.u, poses.accelerations
        return rotations_of(self.kinematics, self.kinematics.many("rotations", *states))

    def driving(self, times: Array) -> dict[str, Array]:
        """Return the values of every drive [rad or m] at many times, by name."""
        if not self.kinematics.has("drives"):
            return {}
        still = np.zeros((len(times), self.n))
        blocks = self.kinematics.many_blocks("drives", times, still, still)
        return {name: values.reshape(len(times)) for name, values in blocks.items()}

    def turned_over(self, q: Array, t: float) -> bool:
        """Return True if a driven link points against its prescribed direction, as its constraint allows."""
        if not self.kinematics.has("along_drives"):
            return False
        blocks = self.kinematics.blocks("along_drives", t, q, self._rest)
        return bool(np.any(blocks["along_drives"] < 0))


def rotations_of(kinematics: Evaluator, out: Array) -> dict[str, tuple[Array, Array]]:
    """Return angular velocity and acceleration of each link from rows of the kernel ``rotations``."""
    rates, second = (part(out, block) for block in kinematics.info("rotations").blocks)
    links = kinematics.info("rotations").blocks[0].rows
    return {link: (rates[..., i], second[..., i]) for i, link in enumerate(links)}
