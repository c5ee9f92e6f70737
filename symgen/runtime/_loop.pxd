"""What following and moving a loop use of its closure, rates and forces."""

from symgen.runtime._core cimport kernel_t
from symgen.runtime._foreign cimport ForeignEquations
from symgen.runtime._qr cimport Factor

cdef enum:
    _OPEN = 10
    _INCONSISTENT = 11
    _POLE = 12
    _BLIND = 13


cdef class LoopEquations(ForeignEquations):
    cdef kernel_t inputs, position, motion, inverse, given, mass_matrix, outputs
    cdef Py_ssize_t nf, ni, nx, free, told
    cdef readonly Py_ssize_t rank
    cdef readonly double closure, rates_left, hold, size
    cdef readonly int iterations
    cdef Py_ssize_t[::1] solved, driven, found, known
    cdef double[::1] scale, screws, matrix, prescribed, efforts, loads, work2, q, u, trial, step, mass, reduced
    cdef double[:, ::1] basis, gain
    cdef Factor factored
    cdef double stride
    cdef double[:, ::1] past

    cdef void _prescribe(self, double t, double *q) noexcept nogil
    cdef double _look(self, double t, const double *q) noexcept nogil
    cdef void _solve(self, double *b, double *x) noexcept nogil
    cdef void _mismatch(self, double *b) noexcept nogil
    cdef int _close(self, double t, double *q) noexcept nogil
    cdef double _leftover(self, const double *b, double size) noexcept nogil
    cdef double _changes(self, Py_ssize_t which, const double *drift, double *b, double *v) noexcept nogil
    cdef int _move(self, double t, const double *q, double *u, double *a) noexcept nogil
    cdef bint _finite(self, const double *v, Py_ssize_t count) noexcept nogil
    cdef double _power(self, Py_ssize_t j, const double *w) noexcept nogil
    cdef void _hold(self, const double *b, double *w) noexcept nogil
    cdef int _force(self, double t, const double *q, const double *u, double *work) noexcept nogil
    cdef double _eliminate(self, Py_ssize_t m) noexcept nogil
