"""The interface of driven linkages in C, and what their bindings share."""

from symgen.runtime._core cimport Memory, kernel_t

cdef extern from "core/kinematics.h" nogil:
    cdef struct kinematics:
        pass

    cdef struct kinematic_kernels:
        kernel_t closure, gamma, balance

    cdef struct kinematic_groups:
        Py_ssize_t count, squares, filled, couplings
        const Py_ssize_t *starts
        const Py_ssize_t *rows
        const Py_ssize_t *columns
        const Py_ssize_t *entries
        const Py_ssize_t *coupling_starts
        const Py_ssize_t *coupling_columns

    cdef struct kinematic_sizes:
        Py_ssize_t n, m, work, out
        double length

    cdef struct kinematics_table "kinematics_api":
        size_t kinematics_struct
        size_t (*bytes)(const kinematic_sizes *, const kinematic_groups *) noexcept nogil
        void (*bind)(kinematics *, const kinematic_sizes *, const kinematic_kernels *, const kinematic_groups *, const void *, const void *, void *) noexcept nogil
        Py_ssize_t (*follow)(kinematics *, double, const void *, const void *, Py_ssize_t, void *) noexcept nogil
        Py_ssize_t (*multipliers)(kinematics *, const void *, const void *, Py_ssize_t, void *, void *) noexcept nogil


cdef class Blocks:
    cdef kinematic_groups of
    cdef const Py_ssize_t[::1] starts, rows, columns, entries, coupling_starts, coupling_columns
