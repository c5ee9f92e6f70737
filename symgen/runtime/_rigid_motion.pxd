"""What elastic motions use of the rigid motion."""

from symgen.runtime._core cimport Equations, kernel_t

cdef enum:
    MOTION = 10


cdef class RigidMotion:
    cdef Equations equations
    cdef kernel_t links, joints, torque, point_loads
    cdef readonly Py_ssize_t count
    cdef readonly double t, stride
    cdef double[::1] y, began, still
    cdef double[::1] motion, joined, turning, loads
    cdef double began_at
    cdef bint solved

    cdef int at(self, double t) noexcept nogil
    cdef int at_rest(self, double t) noexcept nogil
    cdef int _moved(self, double t) noexcept nogil
