# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The kernels of a model behind function pointers: solved, watched and projected without Python."""

import numpy as np

from libc.float cimport DBL_EPSILON
from libc.math cimport INFINITY, fabs, fmax, isfinite
from libc.stdint cimport uintptr_t
from libc.string cimport memcpy, memset

#: What a step, a projection or a factorisation answers.
DONE, MORE, NOT_FINITE, STEP_TOO_SMALL, SINGULAR, PROJECTION_FAILED, CONTRADICTED = range(7)

# A coordinate's pivot that keeps no more than this of its own-signed terms has no mass. Much may cancel
# before: rods a million million times heavier than their neighbours leave 1e-12.
cdef double NO_MASS = 1e-15
cdef int REFINEMENTS = 2
# Iterations of the projection: with the same factor it converges by the step's own error each time.
cdef int PROJECTIONS = 10


cdef kernel_t kernel_of(object addresses, str name):
    """Return a kernel by name; NULL where the model has none."""
    return <kernel_t><uintptr_t>addresses.get(name, 0)


def call(uintptr_t address, const double[::1] t, const double[::1] q, const double[::1] u, const double[::1] p,
         double[::1] work, double[::1] out):
    """Call one kernel with arrays of at least the sizes it needs (not checked here)."""
    (<kernel_t>address)(&t[0], &q[0], &u[0], &p[0], &work[0], &out[0])


def call_many(uintptr_t address, const double[::1] t, const double[:, ::1] y, Py_ssize_t n, const double[::1] p,
              double[:, ::1] work, double[:, ::1] out):
    """Call a kernel for every row of ``y`` = (q, u, ...) and of ``work``."""
    cdef Py_ssize_t i
    for i in range(y.shape[0]):
        (<kernel_t>address)(&t[i], &y[i, 0], &y[i, n], &p[0], &work[i, 0], &out[i, 0])


def call_repeatedly(uintptr_t address, Py_ssize_t times, const double[:, ::1] y, Py_ssize_t n, const double[::1] p,
                    double[::1] work, double[:, ::1] out):
    """Call a kernel ``times`` times over all rows of ``y``: for measuring it without Python around it."""
    cdef Py_ssize_t i, k
    cdef double t = 0.0
    with nogil:
        for k in range(times):
            for i in range(y.shape[0]):
                (<kernel_t>address)(&t, &y[i, 0], &y[i, n], &p[0], &work[0], &out[i, 0])


cdef class Equations:
    """The kernels of one model with its parameters and scratch memory; one per thread of work.

    Parameters
    ----------
    addresses
        Address of each kernel by name; ``accelerations`` and ``energy`` are required.
    n, m
        Number of coordinates and of constraints.
    extra
        1 when the work of loads without potential is integrated along, else 0.
    p
        Parameters.
    work_size
        Doubles of work memory that the largest kernel needs.
    first_pivot
        Where 'factor' leaves the pivots in its work memory.
    rank_tolerance
        What a multiplier's pivot keeps at most of its own-signed terms where rank is lost; the kernels set such a
        multiplier to zero.
    redundant
        Number of constraints that follow from the others in every configuration: so many pivots must be lost.
    slack
        By how much [m] a redundant constraint may contradict the others.
    """

    def __init__(self, addresses, Py_ssize_t n, Py_ssize_t m, Py_ssize_t extra, p, Py_ssize_t work_size,
                 Py_ssize_t first_pivot, double rank_tolerance, Py_ssize_t redundant,
                 double slack):
        self.accelerations = kernel_of(addresses, "accelerations")
        self.factor = kernel_of(addresses, "factor")
        self.solve = kernel_of(addresses, "solve")
        self.constraints = kernel_of(addresses, "constraints")
        self.velocity_constraints = kernel_of(addresses, "velocity_constraints")
        self.energy = kernel_of(addresses, "energy")
        self.residual = kernel_of(addresses, "residual")
        if self.accelerations == NULL or self.energy == NULL:
            raise ValueError("a model without the kernels 'accelerations' and 'energy' cannot be stepped")
        self.n, self.m, self.extra, self.dim = n, m, extra, 2 * n + extra
        self.p = np.array([*p, 0.0])
        self.work, self.factors = np.zeros(work_size + 1), np.zeros(work_size + 1)
        self.out, self.rates = np.zeros(2 * (n + m) + 1), np.zeros(m + 1)
        self.rhs, self.before, self.energies = np.zeros(n + m + 1), np.zeros(n + 1), np.zeros(3)
        self.zero = np.zeros(n + 1)
        self.weakest, self.soundness, self.first_pivot = -1, INFINITY, first_pivot
        self.rank_tolerance, self.slack, self.missed = rank_tolerance, slack, 0.0
        self.lost, self.redundant, self.dropped = 0, redundant, np.zeros(m + 1, dtype=np.int8)

    cdef void accelerate(self, double t, const double *y) noexcept nogil:
        """Leave accelerations and multipliers in ``out``, refined where the model has a residual."""
        cdef Py_ssize_t i
        cdef int k
        self.accelerations(&t, y, y + self.n, &self.p[0], &self.work[0], &self.out[0])
        if self.residual == NULL:
            return
        for k in range(REFINEMENTS):
            self.residual(&t, y, y + self.n, &self.p[0], &self.out[0], &self.rhs[0])
            self.solve(&t, y, y + self.n, &self.p[0], &self.work[0], &self.rhs[0])
            for i in range(self.n + self.m):
                self.out[i] += self.rhs[i]

    cdef void derivative(self, double t, const double *y, double *dy) noexcept nogil:
        """Write dy/dt of y = (q, u[, work done by loads without potential])."""
        cdef Py_ssize_t n = self.n
        self.accelerate(t, y)
        memcpy(dy, y + n, n * sizeof(double))
        memcpy(dy + n, &self.out[0], n * sizeof(double))
        if self.extra:
            self.energy(&t, y, y + n, &self.p[0], &self.out[0], &self.energies[0])
            dy[2 * n] = self.energies[2]
        self.evaluations += 1

    cdef double position_error(self, double t, const double *y) noexcept nogil:
        """Return the largest error of an independent constraint over its scale; leave -Phi in ``rhs``."""
        cdef Py_ssize_t i
        cdef double worst = 0.0, error
        self.constraints(&t, y, y + self.n, &self.p[0], &self.work[0], &self.out[0])
        memset(&self.rhs[0], 0, self.n * sizeof(double))
        self.missed = 0.0
        for i in range(self.m):
            self.rhs[self.n + i] = -self.out[i]
            error = fabs(self.out[i]) / self.out[self.m + i]
            if self.dropped[i]:
                self.missed = fmax(self.missed, error)
            elif not error <= worst:
                worst = error
        return worst

    cdef double velocity_error(self, double t, const double *y) noexcept nogil:
        """Return the largest constraint rate over its scale; leave its negative in ``rhs``.

        The scales are those that ``position_error`` left in ``out`` the call before.
        """
        cdef Py_ssize_t i
        cdef double worst = 0.0, error
        self.velocity_constraints(&t, y, y + self.n, &self.p[0], &self.work[0], &self.rates[0])
        memset(&self.rhs[0], 0, self.n * sizeof(double))
        for i in range(self.m):
            self.rhs[self.n + i] = -self.rates[i]
            error = fabs(self.rates[i]) / self.out[self.m + i]
            if not error <= worst and not self.dropped[i]:
                worst = error
        return worst

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Factorise at y and watch the pivots: their signs, and what cancellation left of them.

        As many multipliers as there are redundant constraints must be lost, no more and no fewer.
        """
        cdef Py_ssize_t i
        cdef double sign, ratio
        cdef bint finite = True
        cdef double *pivots = &self.factors[self.first_pivot]
        self.factor(&t, y, y + self.n, &self.p[0], &self.factors[0], &self.out[0])
        self.factorisations += 1
        self.weakest, self.soundness, self.lost = -1, INFINITY, 0
        for i in range(self.n + self.m):
            sign = 1.0 if i < self.n else -1.0
            # A pivot's own-signed terms, whose sum is never zero unless the unknown itself is undetermined.
            ratio = sign * pivots[2 * i] / fabs(pivots[2 * i + 1]) if pivots[2 * i + 1] != 0.0 else 0.0
            if i >= self.n:
                self.dropped[i - self.n] = ratio <= self.rank_tolerance
            if not isfinite(ratio):
                finite = False
            elif i >= self.n and ratio <= self.rank_tolerance and self.lost < self.redundant:
                self.lost += 1
            elif i < self.n and ratio <= NO_MASS:
                self.weakest, self.soundness = i, ratio
                return _SINGULAR
            elif i >= self.n and ratio < self.soundness:
                self.weakest, self.soundness = i, ratio
        if not finite:
            return _NOT_FINITE
        return _SINGULAR if self.soundness <= self.rank_tolerance or self.lost < self.redundant else _DONE

    cdef int project(self, double t, double *y) noexcept nogil:
        """Bring positions and velocities back onto the constraints, by mass-weighted steps of one factor."""
        cdef Py_ssize_t i, n = self.n
        cdef int k, status
        cdef double worst, previous = INFINITY, size = 0.0
        if self.m == 0:
            return _DONE
        status = self.factorise(t, y)
        if status != _DONE:
            return status
        for i in range(n):
            size = fmax(size, fabs(y[i]))
        for k in range(PROJECTIONS):
            worst = self.position_error(t, y)
            if not isfinite(worst):
                return _NOT_FINITE
            if worst <= DBL_EPSILON * size:
                break
            if k and worst > 0.5 * previous:
                if worst > 1e4 * DBL_EPSILON * size:
                    return _PROJECTION_FAILED
                if worst > previous:
                    memcpy(y, &self.before[0], n * sizeof(double))
                    self.position_error(t, y)
                break
            previous = worst
            memcpy(&self.before[0], y, n * sizeof(double))
            self.solve(&t, y, y + n, &self.p[0], &self.factors[0], &self.rhs[0])
            for i in range(n):
                y[i] += self.rhs[i]
        if self.redundant and not self.missed <= self.slack:
            return _CONTRADICTED
        previous = INFINITY
        for k in range(3):
            worst = self.velocity_error(t, y)
            if not isfinite(worst):
                return _NOT_FINITE
            if worst == 0.0 or worst > 0.5 * previous:
                break
            previous = worst
            self.solve(&t, y, y + n, &self.p[0], &self.factors[0], &self.rhs[0])
            for i in range(n):
                y[n + i] += self.rhs[i]
        return _DONE

    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil:
        """Take from e, a change of q or of u at y, what the constraints do not allow, with the last factor."""
        cdef Py_ssize_t i, n = self.n
        self.velocity_constraints(&t, y, e, &self.p[0], &self.work[0], &self.rhs[n])
        self.velocity_constraints(&t, y, &self.zero[0], &self.p[0], &self.work[0], &self.rates[0])
        memset(&self.rhs[0], 0, n * sizeof(double))
        for i in range(self.m):
            self.rhs[n + i] = self.rates[i] - self.rhs[n + i]
        self.solve(&t, y, e, &self.p[0], &self.factors[0], &self.rhs[0])
        for i in range(n):
            e[i] += self.rhs[i]

    cdef void measure_energy(self, double t, const double *y) noexcept nogil:
        """Leave kinetic and potential energy, and the power of loads without potential, in ``energies``."""
        self.energy(&t, y, y + self.n, &self.p[0], &self.work[0], &self.energies[0])

    def solutions(self, const double[::1] t, const double[:, ::1] y):
        """Return accelerations and multipliers at every row of y = (q, u, ...)."""
        found = np.zeros((y.shape[0], self.n + self.m + 1))
        cdef double[:, ::1] rows = found
        cdef Py_ssize_t i
        for i in range(y.shape[0]):
            self.accelerate(t[i], &y[i, 0])
            memcpy(&rows[i, 0], &self.out[0], (self.n + self.m) * sizeof(double))
        return found

    def lost_rows(self):
        """Return the numbers of the constraints that the last factorisation found to follow from others."""
        return [i for i in range(self.m) if self.dropped[i]]

    def check(self, double t, const double[::1] y):
        """Factorise at y; return the status, the unknown of least pivot in ``weakest``, and in ``soundness``
        what cancellation left of that pivot."""
        return self.factorise(t, &y[0])
