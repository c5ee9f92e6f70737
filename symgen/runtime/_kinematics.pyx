# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of driven linkages in the core, followed in time without forces."""

import numpy as np

from libc.stdint cimport uintptr_t
from libc.stdlib cimport calloc, free

from symgen.runtime._core cimport Core, at_least, kernel_of, kernel_t, kinematics_api

from symgen.runtime._core import DOUBLE

cdef extern from "core/kinematics.h" nogil:
    cdef struct kinematics:
        pass

    cdef struct kinematic_kernels:
        kernel_t constraints, jacobian, drift, gamma

    cdef struct kinematic_sizes:
        Py_ssize_t n, m, work, out
        double length

    cdef struct kinematics_table "kinematics_api":
        size_t kinematics_struct
        size_t (*bytes)(const kinematic_sizes *) noexcept nogil
        void (*bind)(kinematics *, const kinematic_sizes *, const kinematic_kernels *, const void *, const void *, const Py_ssize_t *, void *) noexcept nogil
        Py_ssize_t (*follow)(kinematics *, double, const void *, const void *, Py_ssize_t, void *) noexcept nogil


cdef class Kinematics:
    """The constraints of one driven linkage with scratch memory; one per thread of work.

    Parameters
    ----------
    evaluator, analysis
        The :class:`~symgen.runtime.kernels.evaluate.Evaluator` of the constraints, and that of the kernel
        ``acceleration_rhs``.
    rows
        As many independent constraints as there are coordinates.
    length
        Size of the linkage [m].
    """

    cdef kinematics *core
    cdef void *memory
    cdef const kinematics_table *api
    cdef readonly Py_ssize_t n
    cdef object libraries
    cdef const double[::1] p, gamma_p
    cdef const Py_ssize_t[::1] rows

    def __init__(self, evaluator, analysis, rows, double length):
        cdef kinematic_kernels given
        cdef kinematic_sizes wanted
        cdef Core core = DOUBLE
        d = evaluator.description
        wanted.n, wanted.m, wanted.length = d.coordinates, len(d.constraints), length
        if len(rows) != wanted.n or any([not 0 <= row < wanted.m for row in rows]):
            raise ValueError(f"expected {wanted.n} constraint numbers below {wanted.m}, got {rows!r}")
        self.n, self.libraries = wanted.n, (evaluator.library, analysis.library)
        self.p, self.gamma_p = evaluator.parameters, analysis.parameters
        self.rows = np.array([*rows, -1], dtype=np.intp)
        own, other = (library.addresses for library in self.libraries)
        given.constraints, given.jacobian = kernel_of(own, "constraints"), kernel_of(own, "constraint_jacobian")
        given.drift, given.gamma = kernel_of(own, "velocity_constraints"), kernel_of(other, "acceleration_rhs")
        if given.constraints == NULL or given.jacobian == NULL or given.drift == NULL or given.gamma == NULL:
            raise ValueError("a model without constraints cannot be followed")
        called = [evaluator.info(k) for k in ("constraints", "constraint_jacobian", "velocity_constraints")]
        called.append(analysis.info("acceleration_rhs"))
        wanted.work, wanted.out = max([k.work_size for k in called]), max([k.out_size for k in called])
        self.api = <const kinematics_table *>core.api.kinematics
        self.core = <kinematics *>calloc(1, self.api.kinematics_struct)
        self.memory = calloc(1, self.api.bytes(&wanted))
        if self.core == NULL or self.memory == NULL:
            raise MemoryError
        self.api.bind(self.core, &wanted, &given, &self.p[0], &self.gamma_p[0], &self.rows[0], self.memory)

    def __dealloc__(self):
        free(self.core)
        free(self.memory)

    def follow(self, double t, const double[::1] q, const double[::1] times):
        """Follow the linkage from a pose q at t through monotone times.

        Returns
        -------
        numpy.ndarray
            Coordinates, their rates and second rates at each time reached, shape (reached, 3, n). Not all are
            reached where a step comes near a pose in which the constraint Jacobian is singular.
        """
        cdef Py_ssize_t count = times.shape[0], reached
        rows = np.zeros((count + 1, 3 * self.n))
        cdef double[:, ::1] into = rows
        at_least("coordinates", q.shape[0], self.n)
        if count == 0:
            return rows[:0].reshape(0, 3, self.n)
        with nogil:
            reached = self.api.follow(self.core, t, &q[0], &times[0], count, &into[0, 0])
        return rows[:reached].reshape(reached, 3, self.n)
