"""What the step loop uses of the kernels' core."""

ctypedef void (*kernel_t)(const double *, const double *, const double *, const double *, double *, double *) noexcept nogil

cdef enum:
    _DONE = 0
    _MORE = 1
    _NOT_FINITE = 2
    _STEP_TOO_SMALL = 3
    _SINGULAR = 4
    _PROJECTION_FAILED = 5
    _CONTRADICTED = 6


cdef kernel_t kernel_of(object addresses, str name)


cdef class Equations:
    cdef kernel_t accelerations, factor, solve, constraints, velocity_constraints, energy, residual
    cdef readonly Py_ssize_t n, m, extra, dim
    cdef readonly long evaluations, factorisations
    cdef readonly Py_ssize_t weakest
    cdef readonly double soundness, rank_tolerance, missed
    cdef double slack
    cdef readonly Py_ssize_t lost, redundant
    cdef Py_ssize_t first_pivot
    cdef double[::1] p, work, factors, out, rates, rhs, energies, before, zero
    cdef char[::1] dropped

    cdef void accelerate(self, double t, const double *y) noexcept nogil
    cdef void derivative(self, double t, const double *y, double *dy) noexcept nogil
    cdef double position_error(self, double t, const double *y) noexcept nogil
    cdef double velocity_error(self, double t, const double *y) noexcept nogil
    cdef int factorise(self, double t, const double *y) noexcept nogil
    cdef int project(self, double t, double *y) noexcept nogil
    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil
    cdef void measure_energy(self, double t, const double *y) noexcept nogil
