"""What the steps of elastic motions use of their equations."""

from symgen.runtime._foreign cimport ForeignEquations
from symgen.runtime._rigid_motion cimport RigidMotion


cdef class BeamEquations(ForeignEquations):
    cdef readonly RigidMotion motion
    cdef readonly Py_ssize_t whole, entries, band
    cdef readonly bint thesis
    cdef bint resting
    # superelements
    cdef Py_ssize_t pieces
    cdef Py_ssize_t[::1] sizes, constants_at, link_of, places, places_at, slots, slots_at
    cdef Py_ssize_t[:, ::1] ends
    cdef double[::1] constants
    # joints, loads along links and the crank
    cdef Py_ssize_t coordinates
    cdef Py_ssize_t[::1] joint_places, mass_slots, damping_slots, stiffness_slots, joint_at
    cdef Py_ssize_t[::1] loads_at
    cdef Py_ssize_t shaft, shaft_slot
    cdef double flywheel
    # pattern and values of the matrices: of all unknowns, and of those left by the constraints
    cdef Py_ssize_t[::1] full_rows, full_columns, rows, columns
    cdef double[::1] full_mass, full_damping, full_stiffness, full_load
    cdef double[::1] mass, damping, stiffness, load
    cdef double[::1] local
    # constraints
    cdef Py_ssize_t[::1] dependent, independent
    cdef double[:, ::1] bound, pivoted
    cdef double[:, :, ::1] basis
    cdef double[:, ::1] product
    # solution with the mass matrix
    cdef double[::1] banded, solution
    cdef int[::1] pivots

    cdef int assemble(self, double t, bint choose) noexcept nogil
    cdef void expand(self, Py_ssize_t derivative, const double *p, const double *v, const double *a,
                     Py_ssize_t columns, double *out) noexcept nogil
    cdef void _piece(self, Py_ssize_t k) noexcept nogil
    cdef void _joints(self) noexcept nogil
    cdef int _reduce(self, bint choose) noexcept nogil
    cdef int _dependent_rows(self) noexcept nogil
    cdef void _project(self, const double *a, Py_ssize_t of_a, const double *b, Py_ssize_t of_b, double times,
                       const double *c, Py_ssize_t of_c, double *out) noexcept nogil
    cdef int _choose(self) noexcept nogil
    cdef int _factor_mass(self) noexcept nogil
