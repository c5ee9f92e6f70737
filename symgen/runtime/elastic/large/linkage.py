"""A linkage whose elastic links are beam elements in large rotation: its equations, assembled and stepped.

The unknowns are the coordinates of the linkage's free points and, for every elastic link, positions and
rotations of its nodes; nodes at free points share their coordinates. Rigid links, guides, ends on the ground
and the direction of a held crank are constraints with multipliers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError, SimulationError
from symgen.runtime.beams.elements import meshed
from symgen.runtime.beams.layout import entries_of
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.elastic.large.links import LargeLink, Moment, cross, element_properties
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.integrate.pace import OutOfTime, Pace

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Newton's method ends with a correction this small over the lengths of the links, and rotations in radians.
_CLOSE, _MOST = 1e-7, 12
#: Matrices that the kernel ``joints`` gives, in the order of weights from the last: M, C, K.
_SLOPES = ("mass_matrix", "damping", "stiffness")
_METHOD = BEAM_METHODS["generalized-alpha"]


class LargeLinkage:
    """The equations of a linkage with elastic links in large rotation: M a + ... + J^T lambda = f, Phi = 0.

    Parameters
    ----------
    motion
        The elastic motion of the linkage, whose kernels give its rigid parts.
    elements
        Number of elements of each elastic link, between its ends.
    """

    def __init__(self, motion: ElasticMotion, elements: int) -> None:
        _check(motion)
        d = motion.rigid.description
        self.motion, self._points = motion, d.coordinates
        self._rigid, self._joints = motion.rigid.evaluator, motion._joints
        names = motion.constraints
        self._rows = np.array([d.constraints.index(name) for name in names], dtype=np.intp)
        gravity = self._gravity()
        self.links: list[LargeLink] = []
        size = d.coordinates
        #: Ends on the ground: their two unknowns and their point.
        self._pins: list[tuple[int, str]] = []
        for beam in motion.beams:
            info = meshed(replace(beam.info, elements=elements, nodes=()), beam.properties.length, (), ())
            count = info.elements + 1
            places = np.arange(size, size + 3 * count, dtype=np.intp).reshape(count, 3)
            for node, point in zip(info.joint_nodes, info.points, strict=True):
                if point in d.free:
                    k = 2 * d.free.index(point)
                    places[node, :2] = k, k + 1
                else:
                    self._pins.append((int(places[node, 0]), point))
            nodes = tuple(info.node(k) for k in range(count))
            self.links.append(
                LargeLink(beam, nodes, places, element_properties(beam.properties, nodes, gravity))
            )
            size += 3 * count
        self._used(size)
        held = (k for k in self.links if motion.info.mode == "held" and k.beam.info.link == motion.info.crank)
        self._shaft = next((int(link.places[0, 2]) for link in held), None)
        of_joints = {b.name: b for b in self._joints.info("joints").blocks}
        labels = [f"{p}_{axis}" for p in d.free for axis in d.axes]
        place = {label: i for i, label in enumerate(labels)}
        self._entries = {
            name: np.array(entries_of(of_joints, name, place), dtype=np.intp).reshape(-1, 2)
            for name in _SLOPES
        }
        y = motion._start[: self._points]
        found = self._rigid.blocks("constraints", 0.0, y, np.zeros_like(y)) if names else {}
        self._sizes = found["constraint_scale"][self._rows] if names else np.ones(0)
        self.multipliers = len(self._rows) + 2 * len(self._pins) + (self._shaft is not None)
        #: Entries of the constraint Jacobian that are one; those of rigid parts follow.
        self._fixed = np.zeros((self.multipliers, self.unknowns))
        rows, columns = self._bound
        self._fixed[rows, columns] = rows >= len(self._rows)
        self._of_elements = [link.elements for link in self.links]
        self.scale = np.ones(self.unknowns)
        self.scale[self._lengths] = max(link.beam.properties.length for link in self.links)

    def _used(self, size: int) -> None:
        """Renumber the unknowns without those that nodes at free points do not have."""
        used = np.zeros(size, dtype=bool)
        used[: self._points] = True
        for link in self.links:
            used[link.places] = True
        new = np.cumsum(used) - 1
        self.links = [replace(link, places=new[link.places]) for link in self.links]
        self._pins = [(int(new[k]), point) for k, point in self._pins]
        self.unknowns = int(np.sum(used))
        self._lengths = np.ones(self.unknowns, dtype=bool)
        for link in self.links:
            self._lengths[link.places[:, 2]] = False

    def _gravity(self) -> Array:
        """Return the acceleration of free fall [m/s^2], which the kernels have in the axes of the links."""
        y, kernels_of = self.motion._start, self.motion._motion
        q, u = y[: self._points], y[self._points :]
        columns = next(b.columns for b in kernels_of.info("energies").blocks if b.name == "energies")
        at = [columns.index(f"potential_load_{axis}") for axis in "xy"]
        along, across = -np.atleast_2d(kernels_of.blocks("energies", 0.0, q, u)["energies"])[0][at]
        cosine, sine = np.atleast_2d(kernels_of.blocks("links", 0.0, q, u)["links"])[0][:2]
        return np.array([cosine * along - sine * across, sine * along + cosine * across])

    def start(self) -> Moment:
        """Return the motion at t = 0: straight links that move as rigid ones."""
        y = np.asarray(self.motion._start)
        n = self._points
        q, u = y[:n], y[n:]
        found = np.zeros((3, self.unknowns))
        solution = self._rigid("accelerations", 0.0, q, u)
        for row, part in zip(found, (q, u, solution[:n]), strict=True):
            row[:n] = part
        d = self.motion.rigid.description
        points = self._rigid.blocks("points", 0.0, q, u)
        second = self._rigid.blocks("point_accelerations", 0.0, q, u, solution)["point_accelerations"]
        moved = np.array([points["positions"], points["velocities"], second])
        for link in self.links:
            info = link.beam.info
            first, last = (moved[:, list(d.points).index(p)] for p in (info.start, info.end))
            apart = last - first
            # d x d' = omega d.d and d x d'' = alpha d.d, for d keeps its length.
            rate, second_rate = (cross(apart[0], x) / float(apart[0] @ apart[0]) for x in apart[1:])
            angle = math.atan2(apart[0, 1], apart[0, 0])
            if self._shaft in link.places[:, 2]:
                angle = float(self.motion.angle_at(np.array(0.0)))
            for node, share in zip(link.places, link.nodes, strict=True):
                found[:, node[:2]] = (1 - share) * first + share * last
                found[:, node[2]] = angle, rate, second_rate
        return Moment(0.0, found[0], found[1], *self._settled(*found))

    def _settled(self, q: Array, v: Array, rigid: Array) -> list[Array]:
        """Return second rates and multipliers of straight links with the constraints of the rigid motion."""
        zero = np.zeros(self.multipliers)
        still = np.zeros(self.unknowns)
        residual = self.system(0.0, q, v, still, zero, (1.0, 0.0, 0.0))[0]
        matrix = self.system(0.0, q, v, still, zero, (0.0, 0.0, 1.0))[1]
        right = np.concatenate([-residual[: self.unknowns], self._constraints(0.0, q)[0] @ rigid])
        return np.split(solved(matrix, right), [self.unknowns])

    def system(
        self,
        t: float,
        q: Array,
        v: Array,
        a: Array,
        multipliers: Array,
        weights: tuple[float, float, float],
    ) -> tuple[Array, Any]:
        """Return (w r, Phi) and its sparse slope [k K + c C + m M, J^T; J, 0], where r is the residual.

        r = M a + internal forces - f + J^T lambda, and Phi are the constraints in metres and radians.
        ``weights`` are k, which is also w, c and m.
        """
        scale = weights[0]
        factors = np.array(weights[::-1])
        found, values = np.zeros(self.unknowns), []
        for link in self.links:
            at = link.elements
            place, rates = q[at], np.hstack([v[at], a[at]])
            found += np.bincount(at.ravel(), link.call("residual", place, rates).ravel(), self.unknowns)
            tangents = link.call("tangent", place, rates).reshape(-1, 3, 36)
            values.append((factors @ tangents).ravel())
        parts = self._parts(t, q, v, a, multipliers)
        found[: self._points] -= parts["load"]
        for name, factor in zip(_SLOPES, factors, strict=True):
            if name in parts:
                values.append(factor * parts[name].ravel())
        jacobian, phi = self._constraints(t, q)
        found += jacobian.T @ multipliers
        of_constraints = jacobian[self._bound]
        slots, matrix = self._pattern
        data = np.concatenate([*values, of_constraints, of_constraints])
        matrix.data[:] = np.bincount(slots, data, len(matrix.data))
        return np.concatenate([scale * found, phi]), matrix

    @cached_property
    def _bound(self) -> tuple[Indices, Indices]:
        """Rows and columns of the entries of the constraint Jacobian that may not be zero."""
        rigid, pins = len(self._rows), 2 * len(self._pins)
        rows = np.concatenate([np.repeat(np.arange(rigid), self._points), rigid + np.arange(pins)])
        places = [k + axis for k, _ in self._pins for axis in range(2)]
        columns = np.concatenate([np.tile(np.arange(self._points), rigid), places])
        if self._shaft is not None:
            rows, columns = np.append(rows, rigid + pins), np.append(columns, self._shaft)
        return rows.astype(np.intp), columns.astype(np.intp)

    @cached_property
    def _pattern(self) -> tuple[Indices, Any]:
        """The place of every contribution among the entries of the sparse matrix, and that matrix."""
        from scipy.sparse import csc_array

        pairs = [np.stack(np.broadcast_arrays(k[:, :, None], k[:, None, :])) for k in self._of_elements]
        joined = [pair.reshape(2, -1) for pair in pairs]
        joined += [self._entries[name].T for name in _SLOPES]
        rows, columns = self._bound
        rows = rows + self.unknowns
        joined += [np.stack([rows, columns]), np.stack([columns, rows])]
        size = self.unknowns + self.multipliers
        row, column = np.concatenate(joined, axis=1)
        order, slots = np.unique(column * size + row, return_inverse=True)
        starts = np.searchsorted(order, np.arange(size + 1) * size)
        return slots, csc_array((np.zeros(len(order)), order % size, starts), shape=(size, size))

    def _parts(self, t: float, q: Array, v: Array, a: Array, multipliers: Array) -> dict[str, Array]:
        """Return load and slopes of rigid links, particles and loads at their places, by name."""
        n = self._points
        work = np.zeros(self._joints.work_size + n + len(self.motion.rigid.description.constraints))
        work[:n] = a[:n]
        work[n + self._rows] = multipliers[: len(self._rows)] / self._sizes
        return self._joints.blocks("joints", t, q[:n], v[:n], work)

    def energies(self, moment: Moment) -> Array:
        """Return kinetic, strain and potential energy [J] and the power dissipated by links [W]."""
        q, v, n, found, dissipated = moment.q, moment.v, self._points, np.zeros(3), 0.0
        for link in self.links:
            at = link.elements
            found += np.sum(link.call("energies", q[at], np.hstack([v[at], moment.a[at]])), axis=0)
            damping = link.end_forces(moment) - link.undamped.end_forces(moment)
            dissipated += float(np.sum(damping * v[at]))
        kinetic, potential = self._joints("energy", moment.t, q[:n], v[:n])[:2]
        return np.append(found + np.array([kinetic, 0.0, potential]), dissipated)

    def torque(self, moment: Moment) -> float | None:
        """Return the torque of the shaft on a held crank [N m], counter-clockwise; None if it is not held."""
        if self._shaft is not None:
            return -float(moment.multipliers[-1])
        info, d = self.motion.info, self.motion.rigid.description
        drive = f"{info.crank}_drive"
        if drive not in self.motion.constraints:
            return None
        row = self.motion.constraints.index(drive)
        slopes = self._constraints(moment.t, moment.q)[0][row, : self._points].reshape(-1, 2)
        places = self._rigid.blocks("points", moment.t, moment.q[: self._points], np.zeros(self._points))
        shaft = next(p for p in d.links[info.crank][:2] if p not in d.free)
        arms = moment.q[: self._points].reshape(-1, 2) - places["positions"][d.points.index(shaft)]
        # The power of J^T lambda at the unit rate of the crank.
        return -float(moment.multipliers[row] * np.sum(slopes * np.stack([-arms[:, 1], arms[:, 0]], axis=1)))

    def _constraints(self, t: float, q: Array) -> tuple[Array, Array]:
        """Return the constraint Jacobian, (multipliers, unknowns), and Phi, in metres and radians."""
        n, d = self._points, self.motion.rigid.description
        jacobian, phi, rigid = self._fixed.copy(), np.zeros(self.multipliers), len(self._rows)
        still = np.zeros(n)
        if rigid:
            found = self._rigid.blocks("constraints", t, q[:n], still)["constraints"]
            phi[:rigid] = found[self._rows] / self._sizes
            found = self._rigid.blocks("constraint_jacobian", t, q[:n], still)["constraint_jacobian"]
            jacobian[:rigid, :n] = found.reshape(-1, n)[self._rows] / self._sizes[:, None]
        if self._pins:
            places = self._rigid.blocks("points", t, q[:n], still)["positions"]
            for i, (k, point) in enumerate(self._pins):
                row = rigid + 2 * i
                phi[row : row + 2] = q[k : k + 2] - places[d.points.index(point)]
        if self._shaft is not None:
            phi[-1] = q[self._shaft] - float(self.motion.angle_at(np.array(t)))
        return jacobian, phi


def moved(
    linkage: LargeLinkage,
    times: Array,
    steps: int,
    pace: Pace,
    progress: Callable[[float], None] | None = None,
) -> list[Moment]:
    """Return the motion at times, by so many steps of the generalized-alpha method between two of them.

    Of second order, also in the multipliers; the spectral radius at infinite frequency is 0.9, so that
    vibrations that steps do not resolve decay. Applied to constraints of index 3 as by Arnold and Bruels,
    Convergence of the generalized-alpha scheme for constrained mechanical systems, Multibody System Dynamics
    18 (2007).

    Raises
    ------
    SimulationError
        Where Newton's method does not converge.
    OutOfTime
        When the wall time is spent.
    """
    now = linkage.start()
    found, auxiliary = [now], now.a
    for start, end in pairwise(times.tolist()):
        if pace.spent(start):
            raise OutOfTime(start, found, np.arange(len(found)))
        for k in range(steps):
            h = (end - start) / steps
            now, auxiliary = _step(linkage, now, auxiliary, start + (k + 1) * h, h)
        found.append(now)
        if progress is not None:
            progress(end / float(times[-1]))
    return found


def _step(linkage: LargeLinkage, at: Moment, auxiliary: Array, t: float, h: float) -> tuple[Moment, Array]:
    """Return the motion one step on, and the auxiliary accelerations of the method there."""
    alpha_m, alpha_f = _METHOD.inertia[0], 1 - _METHOD.at
    gamma, beta = _METHOD.gamma, _METHOD.beta
    to_a, to_v = (1 - alpha_m) / (h * h * beta * (1 - alpha_f)), gamma / (h * beta)

    def advanced(a: Array) -> Array:
        return (alpha_f * at.a + (1 - alpha_f) * a - alpha_m * auxiliary) / (1 - alpha_m)

    a, after = at.a, advanced(at.a)
    q = at.q + h * at.v + h * h * ((0.5 - beta) * auxiliary + beta * after)
    v = at.v + h * ((1 - gamma) * auxiliary + gamma * after)
    multipliers, n = at.multipliers, linkage.unknowns
    for _ in range(_MOST):
        residual, matrix = linkage.system(t, q, v, a, multipliers, (1 / to_a, to_v / to_a, 1.0))
        change = -solved(matrix, residual)
        dq = change[:n]
        if not np.all(np.isfinite(dq)):
            break
        q, v, a = q + dq, v + to_v * dq, a + to_a * dq
        multipliers = multipliers + to_a * change[n:]
        if np.max(np.abs(dq) / linkage.scale) < _CLOSE:
            return Moment(t, q, v, a, multipliers), advanced(a)
    raise SimulationError(
        f"{linkage.motion.rigid.name}: Newton's method does not converge in a step of {h:.3g} s", time=at.t
    )


def solved(matrix: Any, right: Array) -> Array:
    """Return the solution of a sparse system; nan where the matrix is singular."""
    from scipy.sparse.linalg import splu

    try:
        found: Array = splu(matrix).solve(right)
    except RuntimeError:
        return np.full(len(right), math.nan)
    return found


def _check(motion: ElasticMotion) -> None:
    """Refuse what elements in large rotation do not support."""
    name, info = motion.rigid.name, motion.info
    refused = {
        "a crank with a motor": info.mode == "motor",
        "couples on sections of elastic links": bool(info.couples),
        "welds": any(beam.welds for beam in info.beams),
        "moments of inertia on elastic links, or masses between their ends": bool(info.lumps),
        "forces along elastic links": not all(info.joints),
        "loads by angles counted over revolutions": bool(motion.rigid.description.windings),
    }
    for what, given in refused.items():
        if given:
            raise ModelError(
                f"{name}: elements in large rotation do not support {what}\n"
                "  Run it in rods with springs between them: segments in place of elements."
            )
