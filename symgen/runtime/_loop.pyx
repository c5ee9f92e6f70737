# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of closed loops in the core: closed, followed along their inputs, and moved by runs."""

import numpy as np

from libc.stdlib cimport calloc
from libc.string cimport memset

from symgen.runtime._core cimport Core, Integrable, Reals, equations, kernel_of, kernel_t, loops_api

from symgen.runtime._core import DOUBLE

cdef extern from "core/loops.h" nogil:
    enum:
        _OPEN "OPEN"
        _INCONSISTENT "INCONSISTENT"
        _POLE "POLE"
        _BLIND "BLIND"
        ROWS
        MOST
        _CLOSURE "CLOSURE"
        _RATES "RATES"
        _SOUNDNESS "SOUNDNESS"
        _HOLD "HOLD"
        _STATUS "STATUS"

    cdef struct loop:
        pass

    cdef struct loop_kernels:
        kernel_t inputs, position, motion, inverse, given, mass_matrix, outputs, energy, setup

    cdef struct loop_sizes:
        long n, parameters, derived, work, told, solved, inputs, unknown, known, rank
        double size

    cdef struct loop_account:
        double closure, rates_left, hold
        long iterations

    cdef struct loops_table "loops_api":
        size_t loop_struct
        size_t (*bytes)(const loop_sizes *) noexcept nogil
        void (*bind)(loop *, const loop_sizes *, const loop_kernels *, const Py_ssize_t *, const unsigned char *, void *) noexcept nogil
        loop_account *(*seen)(loop *) noexcept nogil
        int (*close)(loop *, double, void *) noexcept nogil
        double (*closed_screws)(loop *, double, const void *, void *) noexcept nogil
        int (*follow)(loop *, double *, void *, const void *, long, double, void *, long, void *, long, double *, long *) noexcept nogil

#: What closing and moving a loop may answer besides what the core answers.
OPEN, INCONSISTENT, POLE, BLIND = _OPEN, _INCONSISTENT, _POLE, _BLIND
#: Columns of the diagnosis of a sample.
CLOSURE, RATES, SOUNDNESS, HOLD, STATUS = _CLOSURE, _RATES, _SOUNDNESS, _HOLD, _STATUS


cdef class LoopEquations(Integrable):
    """The kernels of one loop with its parameters and scratch memory; one per thread of work.

    Parameters
    ----------
    addresses
        Address of each kernel by name; ``position`` is required.
    p
        Parameters.
    work_size, out_size
        Numbers of work that the largest kernel needs, and that the kernel 'outputs' writes.
    lengths
        For every variable whether it is a displacement.
    solved
        Numbers of the variables that are solved for; the others are held, or are inputs.
    inputs
        Numbers of the variables whose motion is prescribed.
    unknown
        Numbers of the variables at which the effort of a drive is to be found.
    size
        The length that displacements and moments are compared by [m].
    rank
        Rank of the screws of ``solved`` in general.
    core
        The core that the kernels were compiled for; that of doubles when absent.
    derived
        Numbers that the kernel 'setup' makes of the parameters.
    """

    cdef const loops_table *api
    cdef loop_account *seen
    cdef Py_ssize_t[::1] numbers
    cdef unsigned char[::1] lengths
    cdef readonly double size
    cdef readonly Py_ssize_t rank

    def __init__(self, addresses, p, Py_ssize_t work_size, Py_ssize_t out_size, lengths, solved, inputs, unknown,
                 double size, Py_ssize_t rank, *, Core core=DOUBLE, long derived=0):
        cdef loop_sizes wanted
        cdef loop_kernels given
        cdef const double[::1] parameters = np.array([*p, 0.0])
        if not addresses.get("position"):
            raise ValueError("a loop without the kernel 'position' cannot be solved")
        if len(lengths) > MOST:
            raise ValueError(f"a loop has at most {MOST} variables, got {len(lengths)}")
        found = [list(solved).index(i) for i in unknown if i in list(solved)]
        known = [k for k, i in enumerate(inputs) if i not in list(unknown)]
        self.numbers = np.array([*solved, *inputs, *found, *known, -1], dtype=np.intp)
        self.lengths = np.array([*lengths, False], dtype=np.uint8)
        given.inputs, given.position = kernel_of(addresses, "inputs"), kernel_of(addresses, "position")
        given.motion, given.inverse = kernel_of(addresses, "motion"), kernel_of(addresses, "inverse")
        given.given, given.mass_matrix = kernel_of(addresses, "given"), kernel_of(addresses, "mass_matrix")
        given.outputs, given.energy = kernel_of(addresses, "outputs"), kernel_of(addresses, "energy")
        given.setup = kernel_of(addresses, "setup")
        wanted.n, wanted.parameters, wanted.derived = len(lengths), parameters.shape[0] - 1, derived
        wanted.work, wanted.told, wanted.solved, wanted.inputs = work_size, out_size, len(solved), len(inputs)
        wanted.unknown, wanted.known, wanted.rank, wanted.size = len(found), len(known), rank, size
        self.of, self.size, self.rank = core, size, rank
        self.api = <const loops_table *>core.api.loops
        self.core = <equations *>calloc(1, self.api.loop_struct)
        self.bytes = self.api.bytes(&wanted)
        self.memory = calloc(1, self.bytes)
        if self.core == NULL or self.memory == NULL:
            raise MemoryError
        self.api.bind(<loop *>self.core, &wanted, &given, &self.numbers[0], &self.lengths[0], self.memory)
        self.seen = self.api.seen(<loop *>self.core)
        self.bound(parameters)

    @property
    def closure(self):
        """Defect of closure at the last look: of rotations, and of lengths over the size."""
        return self.seen.closure

    @property
    def rates_left(self):
        """Part of the rates last asked that no motion of the solved variables gives."""
        return self.seen.rates_left

    @property
    def hold(self):
        """Hold of the drives of unknown effort on the motion, at the last forces."""
        return self.seen.hold

    @property
    def iterations(self):
        """Iterations that the last closing took."""
        return self.seen.iterations

    def close(self, double t, double[::1] q):
        """Close the loop at t by Newton's method from q, in place; return the status."""
        cdef Reals state = Reals(self.of, q)
        cdef int status = self.api.close(<loop *>self.core, t, state.at)
        state.back()
        return status

    def closed_screws(self, double t, q):
        """Return the screws of all variables at q, shape (6, n), and the defect of closure there."""
        screws = np.empty((ROWS, self.n))
        cdef Reals state = Reals(self.of, q), into = Reals(self.of, screws)
        cdef double defect = self.api.closed_screws(<loop *>self.core, t, state.at, into.at)
        into.back()
        return screws, defect

    def follow(self, double t, double[::1] q, times, double longest, double[:, ::1] states, double[:, ::1] out,
               double[:, ::1] diagnosis):
        """Follow the loop from a closed state (t, q) through monotone times; return the status and how many.

        Its other variables are all held, or inputs.

        Parameters
        ----------
        q
            The state at t; in the end that at the last time reached, as far as it was followed.
        longest
            Longest step in time [s].
        states, out, diagnosis
            For every time: q, rates, accelerations and closing wrench; what the kernel 'outputs' gives; the
            columns CLOSURE, RATES, SOUNDNESS, HOLD, STATUS.

        Returns
        -------
        tuple
            Status, number of times reached, and the time up to which the loop could be followed.
        """
        cdef Reals state = Reals(self.of, q), when = Reals(self.of, times)
        cdef Reals rows = Reals(self.of, states), told = Reals(self.of, out)
        cdef double at = t
        cdef long count = 0
        cdef int status
        with nogil:
            status = self.api.follow(<loop *>self.core, &at, state.at, when.at, when.count, longest, rows.at,
                                     states.shape[1], told.at, out.shape[1], &diagnosis[0, 0] if diagnosis.shape[0] else NULL, &count)
        state.back()
        rows.back()
        told.back()
        return status, count, at
