# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Equations written in Cython, behind the interface of the core: loops and elastic linkages, in double."""

import numpy as np

from libc.string cimport memcpy, memset

from symgen.runtime._core cimport _DONE, behaviour, equations, kernels, sizes

from symgen.runtime._core import DOUBLE

# What the core calls. The owner outlives every run over its equations; it is only borrowed here.


cdef void _accelerate(equations *e, double t, const double *y) noexcept nogil:
    (<ForeignEquations>e.owner).accelerate(t, y)
    (<ForeignEquations>e.owner).tell()


cdef void _derivative(equations *e, double t, const double *y, double *dy) noexcept nogil:
    (<ForeignEquations>e.owner).derivative(t, y, dy)
    (<ForeignEquations>e.owner).tell()


cdef double _position_error(equations *e, double t, const double *y) noexcept nogil:
    cdef double found = (<ForeignEquations>e.owner).position_error(t, y)
    (<ForeignEquations>e.owner).tell()
    return found


cdef double _velocity_error(equations *e, double t, const double *y) noexcept nogil:
    cdef double found = (<ForeignEquations>e.owner).velocity_error(t, y)
    (<ForeignEquations>e.owner).tell()
    return found


cdef int _factorise(equations *e, double t, const double *y) noexcept nogil:
    cdef int status = (<ForeignEquations>e.owner).factorise(t, y)
    (<ForeignEquations>e.owner).tell()
    return status


cdef int _project(equations *e, double t, double *y) noexcept nogil:
    cdef int status = (<ForeignEquations>e.owner).project(t, y)
    (<ForeignEquations>e.owner).tell()
    return status


cdef void _make_tangent(equations *e, double t, const double *y, double *change) noexcept nogil:
    (<ForeignEquations>e.owner).make_tangent(t, y, change)


cdef void _measure_energy(equations *e, double t, const double *y) noexcept nogil:
    (<ForeignEquations>e.owner).measure_energy(t, y)
    memcpy(e.energies, &(<ForeignEquations>e.owner).energies[0], 3 * sizeof(double))


cdef behaviour CALLS
CALLS.accelerate = _accelerate
CALLS.derivative = _derivative
CALLS.position_error = _position_error
CALLS.velocity_error = _velocity_error
CALLS.factorise = _factorise
CALLS.project = _project
CALLS.make_tangent = _make_tangent
CALLS.measure_energy = _measure_energy


cdef class ForeignEquations(Integrable):
    """Equations whose subclass says how they are solved, watched and projected."""

    cdef int ready(self) except -1:
        """Make what the core sees of these equations, whose sizes are known by now."""
        cdef sizes wanted
        cdef kernels none
        if self.core != NULL:
            return 0
        memset(&wanted, 0, sizeof(wanted))
        memset(&none, 0, sizeof(none))
        wanted.n, wanted.m, wanted.extra, wanted.redundant = self.n, self.m, self.extra, self.redundant
        wanted.rank_tolerance = self.rank_tolerance
        self.of = DOUBLE
        self.make(&wanted, &none)
        self.core.of, self.core.owner = &CALLS, <void *>self
        return 0

    cdef void tell(self) noexcept nogil:
        """Copy what was found at the last look to where the core reads it."""
        self.core.account.soundness, self.core.account.missed = self.soundness, self.missed
        self.core.account.weakest, self.core.account.lost = self.weakest, self.lost

    cdef void accelerate(self, double t, const double *y) noexcept nogil:
        """Leave accelerations in ``out``."""

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
        """Return the largest error of a constraint [m]."""
        return 0.0

    cdef double velocity_error(self, double t, const double *y) noexcept nogil:
        """Return the largest rate of a constraint [m/s]; called after ``position_error``."""
        return 0.0

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Factorise at y and watch the rank."""
        return _DONE

    cdef int project(self, double t, double *y) noexcept nogil:
        """Bring positions and velocities back onto the constraints."""
        return _DONE

    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil:
        """Take from e, a change of q or of u at y, what the constraints do not allow, with the last factor."""

    cdef void measure_energy(self, double t, const double *y) noexcept nogil:
        """Leave kinetic and potential energy, and the power of loads without potential, in ``energies``."""

    def solutions(self, const double[::1] t, const double[:, ::1] y):
        """Return accelerations and multipliers at every row of y = (q, u, ...)."""
        found = np.zeros((y.shape[0], self.n + self.m + 1))
        cdef double[:, ::1] rows = found
        cdef Py_ssize_t i
        for i in range(y.shape[0]):
            self.accelerate(t[i], &y[i, 0])
            memcpy(&rows[i, 0], &self.out[0], (self.n + self.m) * sizeof(double))
        return found

    def check(self, double t, const double[::1] y):
        """Factorise at y; return the status, the unknown of least pivot in ``weakest``, and in ``soundness``
        what cancellation left of that pivot."""
        return self.factorise(t, &y[0])
