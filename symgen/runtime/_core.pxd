"""The core's interface in C, and what other compiled parts use of its binding."""

ctypedef void (*kernel_t)(const double *, const double *, const double *, const double *, double *, double *) noexcept nogil

cdef extern from "core/core.h" nogil:
    enum status:
        _DONE "DONE"
        _MORE "MORE"
        _NOT_FINITE "NOT_FINITE"
        _STEP_TOO_SMALL "STEP_TOO_SMALL"
        _SINGULAR "SINGULAR"
        _PROJECTION_FAILED "PROJECTION_FAILED"
        _CONTRADICTED "CONTRADICTED"
        _DRIFTED "DRIFTED"
        _ENDED "ENDED"
        _UNSOLVED "UNSOLVED"
        _SLIDING "SLIDING"

    enum:
        _ENDS_RUN "ENDS_RUN"
        _REVOLVES "REVOLVES"
        _PROBED "PROBED"

    enum:
        _WHICH_PIECE "WHICH_PIECE"

    enum stabilisation:
        _PROJECTION "PROJECTION"
        _BAUMGARTE "BAUMGARTE"
        _RAW "RAW"

    cdef struct kernels:
        kernel_t accelerations
        kernel_t factor
        kernel_t solve
        kernel_t constraints
        kernel_t velocity_constraints
        kernel_t energy
        kernel_t residual
        kernel_t events
        kernel_t tangent
        kernel_t setup
        kernel_t series
        kernel_t tangent_setup

    cdef struct sizes:
        long n, m, extra, parameters, derived, tangent_derived, work, first_pivot, redundant, events, switches, tables, windings, turns, choices, series_rows, series_watched, tangent
        const long *tangent_places
        double rank_tolerance, slack, stabilisation

    long first_reference(const sizes *)
    long held_parameters(const sizes *)

    cdef struct account:
        double soundness, missed
        long weakest, lost, worst, evaluations, factorisations

    cdef struct behaviour:
        void (*accelerate)(equations *, double, const double *) noexcept nogil
        void (*derivative)(equations *, double, const double *, double *) noexcept nogil
        double (*position_error)(equations *, double, const double *) noexcept nogil
        double (*velocity_error)(equations *, double, const double *) noexcept nogil
        int (*factorise)(equations *, double, const double *) noexcept nogil
        int (*project)(equations *, double, double *) noexcept nogil
        void (*make_tangent)(equations *, double, const double *, double *) noexcept nogil
        void (*measure_energy)(equations *, double, const double *) noexcept nogil

    cdef struct equations:
        const behaviour *of
        void *owner
        sizes sizes
        account *account
        double *p
        double *out
        double *energies
        double *gaps
        const char *dropped

    cdef struct kind:
        const char *counts
        const char *arrays
        Py_ssize_t (*numbers)(const long *) noexcept nogil

    cdef struct scheme:
        const kind *kind
        long adaptive, error_order
        const long *counts
        const double *numbers
        const scheme *near

    cdef struct task:
        double t0, t_end, rtol, atol, step, max_drift, max_step
        long stabilisation, samples, places_only, found, nodes, continues

    cdef struct run:
        const double *times
        const double *samples
        const double *references
        const double *turns

    cdef struct report:
        double t, t_end, h, position_drift, velocity_drift, energy_drift
        double kinetic_min, kinetic_max, potential_min, potential_max, t_stiff
        long steps, rejected, recorded, moved, passages, events, ended_by, worst, stiff, blind, switchings, slid
        double t_blind

    cdef struct passage:
        double t, soundness
        long weakest

    cdef struct found_event:
        double t
        long index, rising

    enum:
        MOST_PASSAGES
        MOST_COUNTS
        MOST_STAGES
        CORE_VERSION

    cdef struct lane_functions:
        Py_ssize_t width
        const void *starts
        const void *kinematics
        const void *loops
        const void *runs

    cdef struct core_api:
        long version, real_bytes
        double epsilon
        const char *real_name
        void (*watch)(int (*)() noexcept nogil) noexcept nogil
        const void *loops
        const void *elastic
        const void *system
        const void *kinematics
        const void *start
        const lane_functions *(*lanes)(Py_ssize_t) noexcept nogil
        const void *variations
        void (*widen)(long, const double *, const double *, void *) noexcept nogil
        void (*narrow)(long, const void *, double *, double *) noexcept nogil
        void (*call_rows)(kernel_t, long, const void *, const void *, long, long, const void *, void *, long, void *, long) noexcept nogil
        size_t equations_struct, run_struct
        size_t (*equations_bytes)(const sizes *) noexcept nogil
        void (*equations_bind)(equations *, const sizes *, const kernels *, void *) noexcept nogil
        void (*set_parameters)(equations *, const double *, const double *) noexcept nogil
        void (*solve_rows)(equations *, long, const void *, const void *, long, void *, long) noexcept nogil
        int (*check)(equations *, double, const void *) noexcept nogil
        void (*derivative)(equations *, double, const void *, void *) noexcept nogil
        const kind *(*find_kind)(const char *) noexcept nogil
        size_t (*run_bytes)(const equations *, const scheme *, const task *) noexcept nogil
        void (*run_bind)(run *, equations *, const scheme *, const task *, void *) noexcept nogil
        void (*run_start)(run *, const double *, const double *, const double *, const signed char *, const char *) noexcept nogil
        void (*run_set_nodes)(run *, const double *, const long *) noexcept nogil
        int (*run_valid)(const run *) noexcept nogil
        int (*run_begin)(run *) noexcept nogil
        void (*run_extend)(run *, double) noexcept nogil
        int (*run_restart)(run *, int) noexcept nogil
        void (*run_record)(run *) noexcept nogil
        int (*run_advance)(run *, long) noexcept nogil
        void (*run_report)(const run *, report *) noexcept nogil
        const void *(*run_state)(const run *) noexcept nogil
        long (*take_events)(run *, found_event *, void *) noexcept nogil
        long (*take_passages)(run *, passage *) noexcept nogil

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
    cdef long counts[MOST_COUNTS]


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
