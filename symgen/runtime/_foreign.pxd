"""Equations that are not kernels alone: what their own files fill in."""

from symgen.runtime._core cimport Integrable, kernel_t


cdef class ForeignEquations(Integrable):
    cdef kernel_t energy
    cdef readonly Py_ssize_t n, m, extra, dim
    cdef readonly long evaluations, factorisations
    cdef readonly Py_ssize_t weakest
    cdef readonly double soundness, rank_tolerance, missed
    cdef readonly Py_ssize_t lost, redundant
    cdef double[::1] p, work, out, rhs, energies, before
    cdef char[::1] dropped

    cdef void tell(self) noexcept nogil
    cdef void accelerate(self, double t, const double *y) noexcept nogil
    cdef void derivative(self, double t, const double *y, double *dy) noexcept nogil
    cdef double position_error(self, double t, const double *y) noexcept nogil
    cdef double velocity_error(self, double t, const double *y) noexcept nogil
    cdef int factorise(self, double t, const double *y) noexcept nogil
    cdef int project(self, double t, double *y) noexcept nogil
    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil
    cdef void measure_energy(self, double t, const double *y) noexcept nogil
