"""The interface of starts in C, and their binding."""

from symgen.runtime._headers cimport (
    start_kernels, start_sizes, _STARTED, _ON_THE_WAY, _UNASSEMBLED, _TOO_TOLERANT, _OTHER_SIDE, MOST_TOLERANCE,
    start, start_api,
)
from symgen.runtime._core cimport Memory, kernel_t


cdef class Starter:
    cdef start *core
    cdef Memory memory
    cdef const start_api *api
    cdef start_sizes sizes
    cdef start_kernels functions
    cdef object library
    cdef const double[::1] p

    cdef object copied(self, const double *numbers, Py_ssize_t count)
