"""The interface of starts in C, and their binding."""

from symgen.runtime._core cimport Memory, kernel_t

cdef extern from "core/start_lanes.h" nogil:
    cdef struct start_kernels:
        kernel_t assembly, points, constraints, jacobian, drift, rates, mass, metric, momentum

    cdef struct start_sizes:
        Py_ssize_t n, m, rows, prescribed, points, axes, work, out
        double tolerance, share, size

    enum start_status:
        _STARTED "STARTED"
        _ON_THE_WAY "ON_THE_WAY"
        _UNASSEMBLED "UNASSEMBLED"
        _TOO_TOLERANT "TOO_TOLERANT"
        _OTHER_SIDE "OTHER_SIDE"

    double MOST_TOLERANCE

    cdef struct start:
        double at, fastest
        int side
        double *q
        double *u
        double *miss
        double *still
        double *work
        double *out

    cdef struct start_lanes:
        pass

    cdef struct start_lane_kernels:
        kernel_t setup, drawn, assembly, points

    cdef struct start_lanes_table "start_lanes_api":
        size_t lanes_struct
        size_t (*bytes)(const start_sizes *, Py_ssize_t) noexcept nogil
        void (*bind)(start_lanes *, const start_sizes *, const start_lane_kernels *, Py_ssize_t, Py_ssize_t, void *) noexcept nogil
        void (*assemble)(start_lanes *, const double *, double *, unsigned char *) noexcept nogil

    cdef struct start_table "start_api":
        size_t start_struct
        size_t (*bytes)(const start_sizes *) noexcept nogil
        void (*bind)(start *, const start_sizes *, const start_kernels *, const void *, void *) noexcept nogil
        double (*size)(Py_ssize_t, Py_ssize_t, const double *) noexcept nogil
        double (*extent)(start *, const double *) noexcept nogil
        void (*begin)(start *) noexcept nogil
        int (*advance)(start *) noexcept nogil
        int (*outcome)(start *) noexcept nogil
        Py_ssize_t (*velocities)(start *, const char *) noexcept nogil


cdef class Starter:
    cdef start *core
    cdef Memory memory
    cdef const start_table *api
    cdef start_sizes sizes
    cdef start_kernels functions
    cdef object library
    cdef const double[::1] p

    cdef object copied(self, const double *numbers, Py_ssize_t count)
