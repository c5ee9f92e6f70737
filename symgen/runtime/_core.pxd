"""The core's interface in C, and what other compiled parts use of its binding."""

from symgen.runtime._headers cimport (
    _DONE, _MORE, _NOT_FINITE, _STEP_TOO_SMALL, _SINGULAR, _PROJECTION_FAILED, _CONTRADICTED, _DRIFTED, _ENDED,
    _UNSOLVED, _SLIDING, _ENDS_RUN, _REVOLVES, _PROBED, _WHICH_PIECE, _PROJECTION, _BAUMGARTE, _RAW, kernels, sizes,
    account, behaviour, equations, kind, scheme, task, run, report, passage, found_event, _MOST_PASSAGES,
    _MOST_COUNTS, _MOST_STAGES, _CORE_VERSION, lane_functions, core_api, kernel_t,
)

cdef extern from "core/core.h" nogil:
    long first_reference(const sizes *)
    long held_parameters(const sizes *)
    void set_up_with(kernel_t, long, double *) noexcept nogil
    cdef const core_api symgen_core


cdef class Memory:
    """A structure of the core and its memory: zero at first, each from a cache line on, freed with this."""

    cdef void *block
    cdef void *structure
    cdef void *at
    cdef size_t bytes

    cdef object saved(self)
    cdef int restore(self, const unsigned char[::1] saved) except -1


cdef Memory memory_of(size_t structure, size_t bytes)
cdef kernel_t kernel_of(object addresses, str name)
cdef kernels kernels_of(object addresses)
cdef const lane_functions *functions_of(Py_ssize_t lanes) except NULL
cdef int interrupted() noexcept nogil
cdef int at_least(str what, Py_ssize_t found, Py_ssize_t needed) except -1


cdef class Core:
    cdef const core_api *api
    cdef object owner
    cdef dict schemes

    cdef Scheme scheme(self, method)


cdef class Scheme:
    cdef scheme filled
    cdef Memory memory
    cdef Scheme near
    cdef long counts[_MOST_COUNTS]


cdef class Reals:
    cdef Core of
    cdef object doubles
    cdef Memory own
    cdef void *at
    cdef Py_ssize_t count

    cdef void back(self)


cdef class Integrable:
    cdef Core of
    cdef equations *core
    cdef Memory memory
    cdef object libraries
    cdef readonly Py_ssize_t n, m, extra, dim

    cdef int make(self, const sizes *wanted, const kernels *functions) except -1
    cdef int bound(self, const double[::1] parameters) except -1


cdef class KernelEquations(Integrable):
    cdef long[::1] places
