"""Tangents of the motion of a linkage with elastic links in space along directions of its parameters.

Every stage of a step obeys M a + F + J^T lambda = 0 and J v + Phi_t = 0. The differentials of all stages are
one linear system: its matrix has the slopes of these equations at the stages, its right-hand side the
tangents of forces and constraints by the parameters alone. At the end of the step, the projection of places
and rates on the constraints is differentiated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.methods import BeamMethod
from symgen.runtime.elastic.large.collocation import PART, MotionState, SystemSlopes, stacked
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.kernels.evaluate import UNIT


@dataclass(frozen=True, slots=True)
class ByParameters:
    """Tangents at held motions: of forces (moments, unknowns), errors and rates of constraints."""

    forces: Array
    errors: Array
    rates: Array


def constraints(of: LinkageInSpace, t: Array, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return errors and rates of the constraints (times, multipliers), and slopes of those on directions.

    They have tangents where places and rates (times, unknowns) or prescribed motions have them.
    """
    (places, moving), rigid = of.prescribed_with_tangents(t), len(of.rows)
    errors, rates = np.zeros((2, len(t), of.multipliers), np.result_type(q, v, places, moving))
    if rigid:
        state = t, *(x[:, : of.rigid.description.coordinates] for x in (q, v))
        for to, name in ((errors, "constraints"), (rates, "velocity_constraints")):
            to[:, :rigid] = of.of_rigid(name, *state)[name][:, of.rows] / of.sizes
    for k, (coordinates, point) in enumerate(of.pins):
        pinned, ground = slice(rigid + 3 * k, rigid + 3 * k + 3), slice(3 * point, 3 * point + 3)
        errors[:, pinned] = q[:, coordinates] - places[:, ground]
        rates[:, pinned] = v[:, coordinates] - moving[:, ground]
    products = of.directed(np.hstack([q, places]), np.hstack([v, moving]))
    first = rigid + 3 * len(of.pins)
    errors[:, first:], rates[:, first:] = products[..., 0], products[..., 1]
    return errors, rates, products[..., 2:]


def input_power(of: LinkageInSpace, t: Array, q: Array, v: Array, a: Array, multipliers: Array) -> Array:
    """Return the power of prescribed motions and of loads without potential [W], (times,), with tangents.

    The multipliers do work on the prescribed rates of their constraints, the other forces at moving ground
    on its velocity.
    """
    points, d = of.rigid.description.coordinates, of.rigid.description
    power: Array = np.sum(multipliers * constraints(of, t, q, np.zeros_like(v))[1], axis=1)
    work = np.pad(a[:, :points], ((0, 0), (0, len(d.constraints))))
    of_rigid = of.of_joints("energy", t, q[:, :points], v[:, :points], work)
    return power + of_rigid["power"].reshape(len(t)) if "power" in of_rigid else power


def by_parameters(of: LinkageInSpace, moments: Sequence[MotionState]) -> ByParameters:
    """Return the tangents along the direction of a linkage with its motion held at each of the moments."""
    n, rigid = of.unknowns, len(of.rows)
    t, *moved, multipliers = stacked(moments)
    q, v, a = (x.astype(complex) for x in moved)
    errors, speeds, slopes = constraints(of, t, q, v)
    forces = np.zeros((len(t), n + of.prescribed_with_tangents(t)[0].shape[1]), complex)
    for link in of.links:
        np.add.at(forces.T, link.elements, np.moveaxis(link.values("residual", q, v, a), 0, -1))
    d = of.rigid.description
    points = d.coordinates
    work = np.zeros((len(t), points + len(d.constraints)))
    work[:, :points] = moved[2][:, :points]
    work[:, [points + row for row in of.rows]] = multipliers[:, :rigid] / of.sizes
    joints = of.of_joints("joints", t, q[:, :points], v[:, :points], work)
    forces[:, :points] -= joints["load"]
    if rigid:
        forces[:, :points] += np.einsum("tr,trn->tn", multipliers[:, :rigid], joints["jacobian"])
    pushed = slopes * multipliers[:, rigid + 3 * len(of.pins) :, None]
    np.add.at(forces.T, of.vectors, np.moveaxis(pushed, 0, -1))
    return ByParameters(*(x.imag / UNIT for x in (forces[:, :n], errors, speeds)))


def matrices(of: LinkageInSpace, at: MotionState) -> tuple[Array, Array, Array]:
    """Return mass, stiffness (unknowns, unknowns) and constraint Jacobian at rest, dense, with tangents."""
    n, rigid, t = of.unknowns, len(of.rows), np.array([at.t])
    places, still = of.prescribed_with_tangents(t)[0], np.zeros((1, n))
    size, first = n + places.shape[1], rigid + 3 * len(of.pins)
    mass, stiffness = np.zeros((2, size, size), complex)
    bound = np.zeros((of.multipliers, size), complex)
    for link in of.links:
        unknowns = link.elements
        blocks = link.values("tangent", at.q[None], still, still).reshape(-1, 3, 24, 24)
        for to, slopes in ((mass, blocks[:, 0]), (stiffness, blocks[:, 2])):
            np.add.at(to, (unknowns[:, :, None], unknowns[:, None]), slopes)
    d = of.rigid.description
    points = d.coordinates
    work = np.zeros((1, points + len(d.constraints)), complex)
    work[:, [points + row for row in of.rows]] = at.multipliers[:rigid] / of.sizes
    joints = of.of_joints("joints", t, at.q[None, :points], still[:, :points], work)
    for name, to in (("mass_matrix", mass), ("stiffness", stiffness)):
        if len(of.entries[name]):
            np.add.at(to, tuple(of.entries[name].T), joints[name][0])
    if rigid:
        bound[:rigid, :points] = joints["jacobian"][0]
    for k, (unknowns, _) in enumerate(of.pins):
        bound[rigid + 3 * k + np.arange(3), unknowns] = 1.0
    q = np.hstack([at.q[None], places])
    slopes = of.directed(q, np.zeros_like(q))[0, :, 2:]
    np.add.at(bound, (first + np.arange(len(slopes))[:, None], of.vectors), slopes)
    curved = of.directed(q, np.zeros_like(q), "curvature", 21 * 21).reshape(-1, 21, 21)
    pushed = curved * at.multipliers[first:, None, None]
    np.add.at(stiffness, (of.vectors[:, :, None], of.vectors[:, None]), pushed)
    return mass[:n, :n], stiffness[:n, :n], bound[:, :n]


class RunTangents:
    """Tangents of places and rates (unknowns, directions) along a run from its start.

    Parameters
    ----------
    linkage
        The linkage.
    along
        The same along every direction.
    method, h
        Method and length of the steps [s].
    """

    def __init__(
        self, linkage: LinkageInSpace, along: Sequence[LinkageInSpace], method: BeamMethod, h: float
    ) -> None:
        self._of, self._along, self._method, self._h = linkage, along, method, h
        count, block = linkage.unknowns + linkage.multipliers, np.arange(len(method.c))
        self._row, self._column = linkage.pattern.places
        #: Slots of the rows of constraints.
        self._bound = self._row >= linkage.unknowns
        self._one = Compressed(self._row, self._column, count)
        rows = count * block[:, None, None] + np.broadcast_to(
            self._row, (len(block), len(block), len(self._row))
        )
        columns = count * block[:, None] + np.broadcast_to(self._column, rows.shape)
        self._all = Compressed(rows.ravel(), columns.ravel(), count * len(block))
        self.q, self.v = self._start()
        #: After every step.
        self.directions = [(self.q, self.v)]

    def _held(self, *moments: MotionState) -> ByParameters:
        """Return the tangents at held motions along all directions, which are the last axis."""
        parts_of_links = [by_parameters(of, moments) for of in self._along]
        names = "forces", "errors", "rates"
        return ByParameters(
            *(np.stack([getattr(x, name) for x in parts_of_links], axis=-1) for name in names)
        )

    def _slopes(self, moment: MotionState) -> SystemSlopes:
        return self._of.slopes(moment.t, moment.q, moment.v, moment.a, moment.multipliers)

    def _start(self) -> tuple[Array, Array]:
        """Return the tangents of the start, which satisfies M (v - v0) + J^T w = 0 and J v + Phi_t = 0."""
        of, n = self._of, self._of.unknowns
        (q, v), still, none = of.straight, np.zeros(of.unknowns), np.zeros(of.multipliers)
        dq, dv = (np.array([x.straight[k].imag for x in self._along]).T / UNIT for k in range(2))
        before = self._slopes(MotionState(0.0, q, v, still, none))
        solve = of.pattern.factorised(before.mass + before.jacobian)
        over = of.rates(np.zeros(1), q[None], v[None])[0]
        spin, w = np.split(-solve(np.append(still, over)), [n])
        start = MotionState(0.0, q, v, still, none)
        rows = self._rows(replace(start, v=v + spin), dq, dv)
        return dq, dv - solve(np.vstack([self._pushed(start, spin, w, dq), rows]))[:n]

    def _pushed(self, at: MotionState, change: Array, multipliers: Array, dq: Array) -> Array:
        """Return the differential of M c + J^T lambda for a held change c of places or rates."""
        still, none = np.zeros_like(change), np.zeros_like(multipliers)
        pushed, rest = replace(at, a=change, multipliers=multipliers), replace(at, a=still, multipliers=none)
        curved = self._one.matrix(self._slopes(pushed).stiffness - self._slopes(rest).stiffness)
        by, without = self._held(pushed, rest).forces
        return by - without + curved[: len(dq), : len(dq)] @ dq

    def _rows(self, at: MotionState, dq: Array, dv: Array) -> Array:
        """Return the differentials of the rates of the constraints."""
        jacobian = self._one.matrix(self._slopes(at).jacobian)[self._of.unknowns :, : self._of.unknowns]
        return jacobian @ dv + self._of.jacobian_rate(at) @ dq + self._held(at).rates[0]

    def step(self, before: MotionState, a: Array, multipliers: Array, after: MotionState) -> None:
        """Go one step on, which has these second rates and multipliers at its stages."""
        of, method, h, n = self._of, self._method, self._h, self._of.unknowns
        v = before.v + h * method.a @ a
        q = before.q + h * np.outer(method.c, before.v) + h * h * (method.a @ (method.a @ a))
        matrix, right = np.zeros((len(a), len(a), len(self._row))), []
        stages = [MotionState(*x) for x in zip(before.t + h * method.c, q, v, a, multipliers, strict=True)]
        derivatives = self._held(*stages)
        for k, (c, moment) in enumerate(zip(method.c.tolist(), stages, strict=True)):
            slopes, turning = self._slopes(moment), np.zeros(len(self._row))
            places = self._row[self._bound] - n, np.minimum(self._column[self._bound], n)
            turning[self._bound] = np.pad(of.jacobian_rate(moment), ((0, 0), (0, 1)))[places]
            by_rates = slopes.damping + np.where(self._bound, slopes.jacobian, 0.0)
            by_places = slopes.stiffness + turning
            matrix[k] = (
                h * method.a[k, :, None] * by_rates + h * h * (method.a[k] @ method.a)[:, None] * by_places
            )
            matrix[k, k] += slopes.mass + np.where(self._bound, 0.0, slopes.jacobian)
            moved = self._one.matrix(by_places)[:, :n] @ (self.q + h * c * self.v)
            right.append(
                np.vstack([derivatives.forces[k], derivatives.rates[k]])
                + self._one.matrix(by_rates)[:, :n] @ self.v
                + moved
            )
        solution = -_solved(self._all.matrix(matrix.ravel()), np.concatenate(right))
        da = solution.reshape(len(a), n + of.multipliers, -1)[:, :n]
        dq = self.q + h * self.v + h * h * np.tensordot(method.b @ method.a, da, 1)
        dv = self.v + h * np.tensordot(method.b, da, 1)
        # The end of the step before its projection.
        q = before.q + h * before.v + h * h * (method.b @ method.a) @ a
        self._project(replace(after, q=q, v=before.v + h * method.b @ a), after, dq, dv)
        self.directions.append((self.q, self.v))

    def _project(self, ended: MotionState, after: MotionState, dq: Array, dv: Array) -> None:
        """Project tangents of places and rates as the end of a step: with M and J before the projection."""
        of, n, still = self._of, self._of.unknowns, np.zeros(self._of.unknowns)
        slopes, placed = self._slopes(ended), replace(ended, q=after.q)
        jacobian, bound = self._one.matrix(slopes.jacobian)[n:, :n], self._slopes(placed).jacobian
        metric = of.pattern.factorised(slopes.mass + slopes.jacobian)

        def pushed(change: Array) -> Array:
            right = np.append(np.zeros(n), jacobian @ change)
            return self._pushed(ended, change, metric(right)[n:], dq)

        opened = self._one.matrix(bound)[n:, :n] @ dq + self._held(placed).errors[0]
        both = self._one.matrix(slopes.mass + np.where(self._bound, bound, slopes.jacobian))
        self.q = dq - _solved(both, np.vstack([pushed(after.q - ended.q), opened]))[:n]
        # The rates are corrected once, with the Jacobian before the projection of the places.
        change = after.v - ended.v
        turned = of.jacobian_rate(replace(ended, v=change)) - of.jacobian_rate(replace(ended, v=still))
        by, without = self._held(replace(ended, v=change), replace(ended, v=still)).rates
        rows = by - without + turned @ dq + self._rows(placed, self.q, dv)
        self.v = dv - metric(np.vstack([pushed(change), rows]))[:n]

    def settled(self, at: MotionState, dq: Array, dv: Array) -> tuple[Array, Array]:
        """Return the tangents of second rates and multipliers that ``collocation.settled`` found."""
        of, n = self._of, self._of.unknowns
        slopes, changes = self._slopes(at), np.zeros((of.multipliers, dq.shape[1]))
        for k, weight in ((-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)):
            later = PART * self._h * k
            v, q = at.v + later * at.a, at.q + later * at.v + later**2 / 2 * at.a
            near = MotionState(at.t + later, q, v, at.a, at.multipliers)
            changes = changes + weight / (12 * PART * self._h) * self._rows(near, dq + later * dv, dv)
        forces = self._held(at).forces[0] + self._one.matrix(slopes.damping)[:n, :n] @ dv
        forces = forces + self._one.matrix(slopes.stiffness)[:n, :n] @ dq
        solution = -of.pattern.factorised(slopes.mass + slopes.jacobian)(np.vstack([forces, changes]))
        return solution[:n], solution[n:]


class Compressed:
    """The structure of a sparse matrix whose entries have these rows and columns, of so many of each."""

    def __init__(self, row: Indices, column: Indices, count: int) -> None:
        self._order = np.lexsort((row, column))
        self._rows = row[self._order]
        self._starts = np.searchsorted(column[self._order], np.arange(count + 1))

    def matrix(self, entries: Array) -> Any:
        """Return the matrix, compressed by columns, with these entries."""
        from scipy.sparse import csc_array

        count, entries = len(self._starts) - 1, entries[self._order]
        nonzero = np.flatnonzero(entries)
        data = entries[nonzero], self._rows[nonzero], np.searchsorted(nonzero, self._starts)
        return csc_array(data, shape=(count, count))


def _solved(matrix: Any, right: Array) -> Array:
    """Return the solution of sparse equations, refined once."""
    from scipy.sparse.linalg import splu

    factors = splu(matrix)
    solution: Array = factors.solve(right)
    return solution + factors.solve(right - matrix @ solution)
