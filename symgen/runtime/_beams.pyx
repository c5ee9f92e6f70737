# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The equations of the elastic motion at any time, M S'' + C S' + K S = Q, assembled without Python.

Superelements have constant matrices in the axes of their links; what changes is how the links move. End
displacements are resolved on fixed axes, with both derivatives of that rotation. Constraints that are left
are met by a basis R(t) of the motions they allow, with R' and R''.
"""

import numpy as np

from libc.math cimport INFINITY, fabs, fmax, hypot, isfinite
from libc.string cimport memcpy, memset

from symgen.runtime._core cimport _DONE, _NOT_FINITE, _SINGULAR
from symgen.runtime._bands cimport factor_band, solve_band
from symgen.runtime._rigid_motion cimport MOTION

# What a pivot of the constraints keeps at least of the largest.
cdef double RANK = 1e-9
# Matrices of a superelement, each n x n, and behind them its load vectors; then of each force two and a matrix.
cdef enum:
    MATRICES = 8
    LOADS = 4


cdef class BeamEquations(ForeignEquations):
    """The elastic motion of one linkage; one per thread of work.

    Parameters
    ----------
    motion
        The rigid motion.
    layout
        A :class:`symgen.runtime.beam_layout.Layout`: unknowns, superelements and where they go.
    thesis
        Take the rotation of end displacements, and the basis of the constraints, as constant in time.
    """

    def __init__(self, motion, layout, bint thesis):
        cdef Py_ssize_t n = layout.unknowns, m = layout.constraints
        self.motion, self.thesis, self.resting = motion, thesis, False
        self.whole, self.m, self.extra = n, m, 0
        self.n, self.dim = n, 2 * n
        self.pieces = len(layout.sizes)
        self.sizes, self.constants_at = layout.sizes, layout.constants_at
        self.link_of, self.ends, self.constants = layout.link_of, layout.ends, layout.constants
        self.places, self.places_at = layout.places, layout.places_at
        self.slots, self.slots_at = layout.slots, layout.slots_at
        self.coordinates, self.joint_places = len(layout.joint_places) - 1, layout.joint_places
        self.mass_slots, self.damping_slots = layout.mass_slots, layout.damping_slots
        self.stiffness_slots, self.joint_at = layout.stiffness_slots, layout.joint_at
        self.loads_at = layout.loads_at
        self.shaft, self.shaft_slot, self.flywheel = layout.shaft, layout.shaft_slot, layout.flywheel
        self.full_rows, self.full_columns = layout.rows, layout.columns
        self.entries, self.band = len(layout.rows), layout.band
        self.full_mass, self.full_damping, self.full_stiffness = (np.zeros(self.entries + 1) for _ in range(3))
        self.full_load = np.zeros(n + 1)
        largest = max(layout.sizes)
        self.local = np.zeros(3 * largest * largest + largest)
        free = n - m
        if m:
            self.rows = np.repeat(np.arange(free), free)
            self.columns = np.tile(np.arange(free), free)
            self.entries, self.band = free * free, free - 1
            self.mass, self.damping, self.stiffness = (np.zeros(self.entries + 1) for _ in range(3))
            self.load = np.zeros(free + 1)
            self.basis, self.product = np.zeros((3, n, free)), np.zeros((n, free))
        else:
            self.rows, self.columns = self.full_rows, self.full_columns
            self.mass, self.damping, self.stiffness = self.full_mass, self.full_damping, self.full_stiffness
            self.load = self.full_load
        self.bound, self.pivoted = np.zeros((3 * m + 1, n)), np.zeros((m + 1, n))
        self.dependent, self.independent = np.zeros(m + 1, dtype=np.intp), np.zeros(n + 1, dtype=np.intp)
        self.banded = np.zeros((3 * self.band + 1) * max(free, 1))
        self.solution, self.pivots = np.zeros(n + 1), np.zeros(n + 1, dtype=np.intc)
        self.out, self.energies = np.zeros(n + m + 1), np.zeros(3)
        self.rhs, self.before = np.zeros(2 * n + 1), np.zeros(2 * n + 1)
        self.weakest, self.soundness, self.rank_tolerance, self.missed = -1, INFINITY, RANK, 0.0
        self.lost, self.redundant, self.dropped = 0, 0, np.zeros(m + 1, dtype=np.int8)
        self.p = np.zeros(1)

    cdef int assemble(self, double t, bint choose) noexcept nogil:
        """Leave mass, damping, stiffness and load of the unknowns that are free at a time.

        With ``choose`` the dependent unknowns are chosen anew, else they are those of the time before.
        """
        cdef Py_ssize_t k
        cdef int status = self.motion.at_rest(t) if self.resting else self.motion.at(t)
        if status != _DONE:
            return status
        memset(&self.full_mass[0], 0, self.full_mass.shape[0] * sizeof(double))
        memset(&self.full_damping[0], 0, self.full_damping.shape[0] * sizeof(double))
        memset(&self.full_stiffness[0], 0, self.full_stiffness.shape[0] * sizeof(double))
        memset(&self.full_load[0], 0, self.full_load.shape[0] * sizeof(double))
        for k in range(self.pieces):
            self._piece(k)
        self._joints()
        self.evaluations += 1
        return self._reduce(choose) if self.m else _DONE

    cdef void _piece(self, Py_ssize_t k) noexcept nogil:
        """Add one superelement, Eq. (7.27) with the rotation of its ends to second order."""
        cdef Py_ssize_t i, j, e, at, n = self.sizes[k], nn = n * n
        cdef double *x = &self.motion.motion[MOTION * self.link_of[k]]
        cdef double length = hypot(x[0], x[1])
        cdef double c = x[0] / length, s = x[1] / length
        cdef double w = (c * x[3] - s * x[2]) / length
        cdef double turn = (c * x[5] - s * x[4]) / length - 2 * w * (c * x[2] + s * x[3]) / length
        cdef double along = c * x[6] + s * x[7], across = c * x[7] - s * x[6]
        cdef double pull = -(c * x[8] + s * x[9])
        cdef double ww = w * w, a, b, sign
        cdef double *constant = &self.constants[self.constants_at[k]]
        cdef double *mass = constant
        cdef double *centrifugal = mass + nn
        cdef double *gyroscopic = centrifugal + nn
        cdef double *stiffness = gyroscopic + nn
        cdef double *damping = stiffness + nn
        cdef double *tension = damping + nn
        cdef double *loads = constant + MATRICES * nn
        cdef double *force = loads + LOADS * n
        cdef double *m = &self.local[0]
        cdef double *d = m + nn
        cdef double *g = d + nn
        cdef double *q = g + nn
        cdef Py_ssize_t *places = &self.places[self.places_at[k]]
        cdef Py_ssize_t *slots = &self.slots[self.slots_at[k]]
        memcpy(m, mass, nn * sizeof(double))
        for i in range(nn):
            d[i] = damping[i] - 2 * w * gyroscopic[i]
            g[i] = (stiffness[i] - ww * centrifugal[i] - turn * gyroscopic[i] + pull * tension[i]
                    + along * tension[nn + i] - ww * tension[2 * nn + i])
        for i in range(n):
            q[i] = -along * loads[i] - across * loads[n + i] + ww * loads[2 * n + i] - turn * loads[3 * n + i]
        for e in range(self.loads_at[self.link_of[k]], self.loads_at[self.link_of[k] + 1]):
            a = c * self.motion.loads[2 * e] + s * self.motion.loads[2 * e + 1]
            b = c * self.motion.loads[2 * e + 1] - s * self.motion.loads[2 * e]
            for i in range(n):
                q[i] += a * force[i] + b * force[n + i]
            for i in range(nn):
                g[i] -= a * force[2 * n + i]
            force += 2 * n + nn
        for e in range(2):
            at = self.ends[k, 2 * e]
            if at < 0:
                continue
            for j in range(2):  # columns u and w of this end: X J^T is -X's column w, and X's column u
                at, b = self.ends[k, 2 * e + j], -1.0 if j == 0 else 1.0
                if self.thesis:
                    continue
                for i in range(n):
                    sign = b * mass[n * i + self.ends[k, 2 * e + 1 - j]]
                    d[n * i + at] += 2 * w * sign
                    g[n * i + at] += (turn * sign - ww * mass[n * i + at]
                                      - 2 * ww * b * gyroscopic[n * i + self.ends[k, 2 * e + 1 - j]]
                                      + w * b * damping[n * i + self.ends[k, 2 * e + 1 - j]])
        for e in range(2):
            if self.ends[k, 2 * e] >= 0:
                _turn(m, n, self.ends[k, 2 * e], self.ends[k, 2 * e + 1], c, s)
                _turn(d, n, self.ends[k, 2 * e], self.ends[k, 2 * e + 1], c, s)
                _turn(g, n, self.ends[k, 2 * e], self.ends[k, 2 * e + 1], c, s)
                i, j = self.ends[k, 2 * e], self.ends[k, 2 * e + 1]
                a, b = q[i], q[j]
                q[i], q[j] = c * a - s * b, s * a + c * b
        for i in range(n):
            if places[i] >= 0:
                self.full_load[places[i]] += q[i]
        for i in range(nn):
            if slots[i] >= 0:
                self.full_mass[slots[i]] += m[i]
                self.full_damping[slots[i]] += d[i]
                self.full_stiffness[slots[i]] += g[i]

    cdef void _joints(self) noexcept nogil:
        """Add what is not elastic, and flywheel and motor on an elastic crank."""
        cdef Py_ssize_t i
        cdef double *found = &self.motion.joined[0]
        for i in range(self.coordinates):
            if self.joint_places[i] >= 0:
                self.full_load[self.joint_places[i]] += found[self.joint_at[0] + i]
        for i in range(self.mass_slots.shape[0] - 1):
            self.full_mass[self.mass_slots[i]] += found[self.joint_at[1] + i]
        for i in range(self.damping_slots.shape[0] - 1):
            self.full_damping[self.damping_slots[i]] += found[self.joint_at[2] + i]
        for i in range(self.stiffness_slots.shape[0] - 1):
            self.full_stiffness[self.stiffness_slots[i]] += found[self.joint_at[3] + i]
        if self.shaft >= 0:
            self.full_mass[self.shaft_slot] += self.flywheel
            if self.motion.torque != NULL:
                self.full_load[self.shaft] += self.motion.turning[0]
                self.full_stiffness[self.shaft_slot] -= self.motion.turning[1]
                self.full_damping[self.shaft_slot] -= self.motion.turning[2]

    # -- constraints -----------------------------------------------------------------------------------------

    cdef int _choose(self) noexcept nogil:
        """Choose the unknowns that depend on the others by complete pivoting of the constraints' rows."""
        cdef Py_ssize_t i, j, k, row, column, m = self.m, n = self.whole
        cdef double best, first = 0.0, factor
        memcpy(&self.pivoted[0, 0], &self.bound[0, 0], m * n * sizeof(double))
        for j in range(n):
            self.independent[j] = 1
        self.soundness = INFINITY
        for k in range(m):
            best, row, column = 0.0, k, 0
            for i in range(k, m):
                for j in range(n):
                    if self.independent[j] and fabs(self.pivoted[i, j]) > best:
                        best, row, column = fabs(self.pivoted[i, j]), i, j
            if k == 0:
                first = best
            if first == 0.0 or best / first < self.soundness:
                self.weakest, self.soundness = row, best / first if first > 0.0 else 0.0
            if not self.soundness > RANK:
                return _SINGULAR
            self.dependent[k], self.independent[column] = column, 0
            for j in range(n):
                self.pivoted[row, j], self.pivoted[k, j] = self.pivoted[k, j], self.pivoted[row, j]
            for i in range(k + 1, m):
                factor = self.pivoted[i, column] / self.pivoted[k, column]
                for j in range(n):
                    self.pivoted[i, j] -= factor * self.pivoted[k, j]
        i = 0
        for j in range(n):
            if self.independent[j]:
                self.independent[i] = j
                i += 1
        return _DONE

    cdef int _reduce(self, bint choose) noexcept nogil:
        """Find R, R' and R'' of S = R p, and write the equations of p."""
        cdef Py_ssize_t i, j, k, e, r, m = self.m, n = self.whole, free = n - m
        cdef double total
        cdef int status
        cdef double *found = &self.motion.joined[0]
        if self.resting:
            memset(&found[self.joint_at[5]], 0, 2 * m * self.coordinates * sizeof(double))
        memset(&self.bound[0, 0], 0, 3 * m * n * sizeof(double))
        for k in range(3):
            for i in range(m):
                for j in range(self.coordinates):
                    if self.joint_places[j] >= 0:
                        self.bound[k * m + i, self.joint_places[j]] = found[
                            self.joint_at[4 + k] + i * self.coordinates + j]
        if choose:
            status = self._choose()
            if status != _DONE:
                return status
        memset(&self.basis[0, 0, 0], 0, 3 * n * free * sizeof(double))
        for j in range(free):
            self.basis[0, self.independent[j], j] = 1.0
        if self._dependent_rows() == 0:
            return _SINGULAR
        self._project(&self.full_mass[0], 0, NULL, 0, 0.0, NULL, 0, &self.mass[0])
        if self.thesis:
            self._project(&self.full_damping[0], 0, NULL, 0, 0.0, NULL, 0, &self.damping[0])
            self._project(&self.full_stiffness[0], 0, NULL, 0, 0.0, NULL, 0, &self.stiffness[0])
        else:
            self._project(&self.full_damping[0], 0, &self.full_mass[0], 1, 2.0, NULL, 0, &self.damping[0])
            self._project(&self.full_stiffness[0], 0, &self.full_damping[0], 1, 1.0, &self.full_mass[0], 2,
                          &self.stiffness[0])
        for r in range(free):
            total = 0.0
            for i in range(n):
                total += self.basis[0, i, r] * self.full_load[i]
            self.load[r] = total
        return _DONE

    cdef int _dependent_rows(self) noexcept nogil:
        """Fill the rows of R, R' and R'' of the dependent unknowns, from J R = 0 and its rates; 0 when singular."""
        cdef Py_ssize_t i, j, k, r, row, m = self.m, n = self.whole, free = n - m, last = 0 if self.thesis else 2
        cdef double total, factor, best
        # The right-hand sides of all three need those before: solve one after the other.
        for k in range(last + 1):
            for i in range(m):
                for r in range(free):
                    total = 0.0
                    for j in range(n):
                        if k == 0:
                            total -= self.bound[i, j] * self.basis[0, j, r]
                        elif k == 1:
                            total -= self.bound[m + i, j] * self.basis[0, j, r]
                        else:
                            total -= (self.bound[2 * m + i, j] * self.basis[0, j, r]
                                      + 2 * self.bound[m + i, j] * self.basis[1, j, r])
                    self.product[i, r] = total
            for i in range(m):
                for j in range(m):
                    self.pivoted[i, j] = self.bound[i, self.dependent[j]]
            for j in range(m):
                row, best = j, 0.0
                for i in range(j, m):
                    if fabs(self.pivoted[i, j]) > best:
                        row, best = i, fabs(self.pivoted[i, j])
                if best == 0.0:
                    return 0
                for i in range(m):
                    self.pivoted[j, i], self.pivoted[row, i] = self.pivoted[row, i], self.pivoted[j, i]
                for r in range(free):
                    self.product[j, r], self.product[row, r] = self.product[row, r], self.product[j, r]
                for i in range(m):
                    if i != j:
                        factor = self.pivoted[i, j] / self.pivoted[j, j]
                        for row in range(j, m):
                            self.pivoted[i, row] -= factor * self.pivoted[j, row]
                        for r in range(free):
                            self.product[i, r] -= factor * self.product[j, r]
            for j in range(m):
                for r in range(free):
                    self.basis[k, self.dependent[j], r] = self.product[j, r] / self.pivoted[j, j]
        return 1

    cdef void _project(self, const double *a, Py_ssize_t of_a, const double *b, Py_ssize_t of_b, double times,
                       const double *c, Py_ssize_t of_c, double *out) noexcept nogil:
        """Write R^T (A R_a + times B R_b + C R_c)."""
        cdef Py_ssize_t e, i, j, r, q, n = self.whole, free = n - self.m
        cdef double left
        memset(&self.product[0, 0], 0, n * free * sizeof(double))
        for e in range(self.full_rows.shape[0]):
            i, j = self.full_rows[e], self.full_columns[e]
            for r in range(free):
                self.product[i, r] += a[e] * self.basis[of_a, j, r]
            if b != NULL:
                for r in range(free):
                    self.product[i, r] += times * b[e] * self.basis[of_b, j, r]
            if c != NULL:
                for r in range(free):
                    self.product[i, r] += c[e] * self.basis[of_c, j, r]
        memset(out, 0, free * free * sizeof(double))
        for i in range(n):
            for q in range(free):
                left = self.basis[0, i, q]
                if left != 0.0:
                    for r in range(free):
                        out[free * q + r] += left * self.product[i, r]

    cdef void expand(self, Py_ssize_t derivative, const double *p, const double *v, const double *a,
                     Py_ssize_t columns, double *out) noexcept nogil:
        """Write S, S' or S'' (``derivative`` 0, 1, 2) of all unknowns from p, p', p'', ``columns`` of each."""
        cdef Py_ssize_t i, r, c, n = self.whole, free = n - self.m
        cdef const double *top = p if derivative == 0 else v if derivative == 1 else a
        if self.m == 0:
            memcpy(out, top, n * columns * sizeof(double))
            return
        memset(out, 0, n * columns * sizeof(double))
        for i in range(n):
            for r in range(free):
                for c in range(columns):
                    out[i * columns + c] += self.basis[0, i, r] * top[r * columns + c]
                    if derivative == 1:
                        out[i * columns + c] += self.basis[1, i, r] * p[r * columns + c]
                    elif derivative == 2:
                        out[i * columns + c] += (2 * self.basis[1, i, r] * v[r * columns + c]
                                                 + self.basis[2, i, r] * p[r * columns + c])

    # -- what the step loop asks -----------------------------------------------------------------------------

    cdef int _factor_mass(self) noexcept nogil:
        """Factorise the mass matrix; 0 when it has no inverse."""
        cdef Py_ssize_t e, free = self.whole - self.m, width = 3 * self.band + 1
        memset(&self.banded[0], 0, free * width * sizeof(double))
        for e in range(self.entries):
            self.banded[self.columns[e] * width + 2 * self.band + self.rows[e] - self.columns[e]] = self.mass[e]
        return factor_band(free, self.band, &self.banded[0], &self.pivots[0]) == 0

    cdef void accelerate(self, double t, const double *y) noexcept nogil:
        """Leave S'' in ``out``, not a number where the motion cannot be."""
        cdef Py_ssize_t e, i, free = self.whole - self.m
        cdef double *p = &self.before[0]
        cdef double *v = p + free
        if self.assemble(t, True) != _DONE or not self._factor_mass():
            self.out[0] = INFINITY
            return
        for i in range(free):
            e = self.independent[i] if self.m else i
            p[i], v[i] = y[e], y[self.whole + e]
            self.solution[i] = self.load[i]
        for e in range(self.entries):
            self.solution[self.rows[e]] -= (self.damping[e] * v[self.columns[e]]
                                            + self.stiffness[e] * p[self.columns[e]])
        solve_band(free, self.band, 1, &self.banded[0], &self.pivots[0], &self.solution[0])
        self.expand(2, p, v, &self.solution[0], 1, &self.out[0])

    cdef double position_error(self, double t, const double *y) noexcept nogil:
        """Return zero: what the constraints allow is all there is."""
        return 0.0

    cdef double velocity_error(self, double t, const double *y) noexcept nogil:
        """Return zero: what the constraints allow is all there is."""
        return 0.0

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Assemble at a time; DONE, or what is wrong there."""
        self.factorisations += 1
        return self.assemble(t, True)

    cdef int project(self, double t, double *y) noexcept nogil:
        """Bring dependent unknowns to what the constraints make of the others."""
        cdef Py_ssize_t i, free = self.whole - self.m
        cdef int status
        cdef double *p = &self.before[0]
        if self.m == 0:
            return _DONE
        status = self.factorise(t, y)
        if status != _DONE:
            return status
        for i in range(free):
            p[i], p[free + i] = y[self.independent[i]], y[self.whole + self.independent[i]]
        self.expand(0, p, p + free, NULL, 1, y)
        self.expand(1, p, p + free, NULL, 1, y + self.whole)
        return _DONE

    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil:
        """Make a change of the unknowns one that the constraints allow."""
        cdef Py_ssize_t i, free = self.whole - self.m
        cdef double *p = &self.before[0]
        if self.m == 0:
            return
        for i in range(free):
            p[i] = e[self.independent[i]]
        self.expand(0, p, NULL, NULL, 1, e)

    cdef void measure_energy(self, double t, const double *y) noexcept nogil:
        """Leave zeros: the energy of a motion that is prescribed in part is not kept."""
        memset(&self.energies[0], 0, 3 * sizeof(double))

    # -- for Python ------------------------------------------------------------------------------------------

    def matrices(self, double t, bint resting=False):
        """Return status, mass, damping, stiffness (dense) and load of the free unknowns, and R, R', R'' or None.

        With ``resting`` they are those of the structure at rest in its pose, without loads of motion.
        """
        status, rows, columns, entries = self.sparse(t, resting)
        free = self.whole - self.m
        made = []
        for values in entries:
            matrix = np.zeros((free, free))
            matrix[rows, columns] = values
            made.append(matrix)
        basis = np.array(self.basis) if self.m else None
        return status, *made, np.array(self.load[:free]), basis

    def sparse(self, double t, bint resting=False):
        """Return status, rows, columns, and the entries there of mass, damping and stiffness."""
        self.resting = resting
        cdef int status = self.assemble(t, True)
        self.resting = False
        whole = [np.array(self.mass), np.array(self.damping), np.array(self.stiffness)]
        made = [values[:self.entries] for values in whole]
        return status, np.asarray(self.rows), np.asarray(self.columns), made

    def accelerations(self, double t, const double[::1] y):
        """Return S'' of a state (S, S') at a time."""
        self.accelerate(t, &y[0])
        return np.array(self.out[:self.whole])

    def residual(self, double t, s, v, a, bint resting=False):
        """Return status, M S'' + C S' + K S - Q of all unknowns, and the rows of their constraints, (m, n).

        With ``resting`` for the structure at rest in its pose, without loads of motion.
        """
        self.resting = resting
        cdef int status = self.assemble(t, True)
        self.resting = False
        found = -np.array(self.full_load[:self.whole])
        rows, columns = np.asarray(self.full_rows), np.asarray(self.full_columns)
        for values, by in ((self.full_mass, a), (self.full_damping, v), (self.full_stiffness, s)):
            found += np.bincount(rows, np.asarray(values)[:len(rows)] * np.asarray(by)[columns], self.whole)
        return status, found, np.array(self.bound[:self.m])


cdef void _turn(double *a, Py_ssize_t n, Py_ssize_t u, Py_ssize_t w, double c, double s) noexcept nogil:
    """Turn the rows and columns of one end's displacements from the link's axes to fixed axes."""
    cdef Py_ssize_t i
    cdef double x, y
    for i in range(n):
        x, y = a[n * u + i], a[n * w + i]
        a[n * u + i], a[n * w + i] = c * x - s * y, s * x + c * y
    for i in range(n):
        x, y = a[n * i + u], a[n * i + w]
        a[n * i + u], a[n * i + w] = c * x - s * y, s * x + c * y
