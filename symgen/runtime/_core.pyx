# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of the C core: equations and runs of any number type, and single kernels in double."""

import threading
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from cpython.buffer cimport PyBUF_STRIDES, PyBuffer_Release, PyObject_GetBuffer
from cpython.bytes cimport PyBytes_FromStringAndSize
from cpython.exc cimport PyErr_CheckSignals
from libc.math cimport INFINITY, rint
from libc.stdint cimport uintptr_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy

from symgen.calls import FAILURES, raise_failure
from symgen.errors import ModelError

if TYPE_CHECKING:
    from typing import Protocol

    from numpy.typing import NDArray

    from symgen.runtime.kernels.library import Library

    Raw = NDArray[np.uint8]
    #: Numbers of t, q, u, p, work and out that a kernel reads or writes.
    Sizes = tuple[int, int, int, int, int, int]

    class Method(Protocol):
        @property
        def kind(self) -> str: ...
        @property
        def coefficients(self) -> Mapping[str, ArrayLike]: ...
        @property
        def adaptive(self) -> bool: ...
        @property
        def error_order(self) -> int: ...

cdef extern from "pythread.h" nogil:
    unsigned long PyThread_get_thread_ident()

#: Status of a step, a projection or a factorisation.
DONE, MORE, NOT_FINITE, STEP_TOO_SMALL, SINGULAR = _DONE, _MORE, _NOT_FINITE, _STEP_TOO_SMALL, _SINGULAR
PROJECTION_FAILED, CONTRADICTED, DRIFTED, ENDED = _PROJECTION_FAILED, _CONTRADICTED, _DRIFTED, _ENDED
UNSOLVED, SLIDING = _UNSOLVED, _SLIDING
#: Effects of events on a run.
ENDS_RUN, REVOLVES, PROBED = _ENDS_RUN, _REVOLVES, _PROBED
#: The branch that asks a table for its piece.
WHICH_PIECE = _WHICH_PIECE
#: Methods of stabilisation of the constraints.
STABILISATIONS = {"projection": _PROJECTION, "baumgarte": _BAUMGARTE, "raw": _RAW}  # type: dict[str, int]

# Capacity of the core's record of events, for each event function.
cdef long REMEMBERED = 64


# Steps of a call between two looks for Ctrl-C.
cdef long STEPS_AT_ONCE = 1024

cdef double REVOLUTION = 6.283185307179586476925286766559


# Alignment of vectors.
cdef size_t LINE = 64


cdef class Memory:
    def __dealloc__(self):
        free(self.block)

    cdef object saved(self):
        """Return the bytes of the memory."""
        return PyBytes_FromStringAndSize(<const char *>self.at, self.bytes)

    cdef int restore(self, const unsigned char[::1] saved) except -1:
        """Restore the memory from the first of saved bytes; raise ValueError if there are too few."""
        if <size_t>saved.shape[0] < self.bytes:
            raise ValueError("expected the saved memory of a motion of the same size")
        memcpy(self.at, &saved[0], self.bytes)
        return 0


cdef Memory memory_of(size_t structure, size_t bytes):
    cdef Memory made = Memory.__new__(Memory)
    cdef size_t first = (structure + LINE - 1) // LINE * LINE
    made.block, made.bytes = calloc(1, first + bytes + LINE), bytes
    if made.block == NULL:
        raise MemoryError
    made.structure = <void *>((<size_t>made.block + LINE - 1) // LINE * LINE)
    made.at = <char *>made.structure + first
    return made


cdef kernel_t kernel_of(object addresses, str name):
    """Return a kernel by name; NULL if the model lacks it."""
    return <kernel_t><uintptr_t>addresses.get(name, 0)


cdef kernels kernels_of(object addresses):
    """Return the kernels of a model by name but those of implicit methods; absent kernels are NULL."""
    cdef kernels functions
    functions.tangent = functions.tangent_setup = NULL
    functions.accelerations = kernel_of(addresses, "accelerations")
    functions.factor, functions.solve = kernel_of(addresses, "factor"), kernel_of(addresses, "solve")
    functions.constraints = kernel_of(addresses, "constraints")
    functions.velocity_constraints = kernel_of(addresses, "velocity_constraints")
    functions.energy, functions.residual = kernel_of(addresses, "energy"), kernel_of(addresses, "residual")
    functions.events, functions.series = kernel_of(addresses, "events"), kernel_of(addresses, "series")
    functions.setup = kernel_of(addresses, "setup")
    return functions


cdef const lane_functions *functions_of(Py_ssize_t lanes) except NULL:
    """Return the functions for vectors of so many doubles; raise ValueError if absent."""
    cdef const lane_functions *functions = (<Core>DOUBLE).api.lanes(lanes)
    if functions == NULL:
        raise ValueError(f"expected vectors of 2, 4 or 8 numbers, got {lanes}")
    return functions


cdef object _way(double rising):
    """Return whether an event is rising; None for one that touches zero, also of a checkpoint, which has NaN."""
    return rising > 0 if rising >= 0 else None


cdef int at_least(str what, Py_ssize_t found, Py_ssize_t needed) except -1:
    """Raise ValueError where an array is shorter than what C reads or writes of it."""
    if found < needed:
        raise ValueError(f"expected at least {needed} {what}, got {found}")
    return 0


cdef int _fits(sizes, Py_ssize_t t, Py_ssize_t q, Py_ssize_t u, Py_ssize_t p, Py_ssize_t work, Py_ssize_t out) except -1:
    """Raise ValueError where an argument array is shorter than a kernel of these sizes reads or writes."""
    cdef Py_ssize_t of_t, of_q, of_u, of_p, of_work, of_out
    if len(sizes) != 6:
        raise ValueError(f"expected the sizes of t, q, u, p, work and out, got {sizes!r}")
    of_t, of_q, of_u, of_p, of_work, of_out = sizes
    if t < of_t or q < of_q or u < of_u or p < of_p or work < of_work or out < of_out:
        for what, found, needed in zip(("t", "q", "u", "p", "work", "out"), (t, q, u, p, work, out), sizes):
            at_least(f"numbers in {what}", found, needed)
    return 0


def call(uintptr_t address, sizes: Sizes, const double[::1] t, const double[::1] q, const double[::1] u,
         const double[::1] p, double[::1] work, double[::1] out) -> None:
    """Call one kernel; ``sizes`` are the numbers of t, q, u, p, work and out that it reads or writes."""
    _fits(sizes, t.shape[0], q.shape[0], u.shape[0], p.shape[0], work.shape[0], out.shape[0])
    (<kernel_t>address)(&t[0], &q[0], &u[0], &p[0], &work[0], &out[0])
    raise_failure()


def set_up(uintptr_t address, double[::1] p, Py_ssize_t parameters, Py_ssize_t derived) -> None:
    """Write the ``derived`` numbers of a set-up kernel behind the parameters."""
    at_least("numbers in p", p.shape[0], parameters + derived)
    set_up_with(<kernel_t>address, parameters, &p[0])
    raise_failure()


def evaluate(uintptr_t address, sizes: Sizes, double t, const double[::1] q, const double[::1] u, const double[::1] p,
             work: Array | None) -> Array:
    """Return the output of one kernel; ``work`` is None or holds the accelerations that it reads."""
    cdef Py_ssize_t count = sizes[5]
    cdef double[::1] out = np.zeros(count + 1), memory
    memory = np.zeros(sizes[4] + 1) if work is None else work
    _fits(sizes, 1, q.shape[0], u.shape[0], p.shape[0], memory.shape[0], count)
    (<kernel_t>address)(&t, &q[0], &u[0], &p[0], &memory[0], &out[0])
    raise_failure()
    return out.base[:count]


def call_many(uintptr_t address, sizes: Sizes, const double[::1] t, const double[:, ::1] y, Py_ssize_t n,
              const double[::1] p, double[:, ::1] work, double[:, ::1] out) -> None:
    """Call a kernel for every row of ``y`` = (q, u, ...), of ``work`` and of ``out``; ``sizes`` as in :func:`call`."""
    cdef Py_ssize_t rows = y.shape[0]
    if rows == 0:
        return
    _fits(sizes, 1, n, y.shape[1] - n, p.shape[0], work.shape[1], out.shape[1])
    for what, found in (("times", t.shape[0]), ("rows of work", work.shape[0]), ("rows of out", out.shape[0])):
        at_least(what, found, rows)
    symgen_core.call_rows(<kernel_t>address, y.shape[0], &t[0], &y[0, 0], y.shape[1], n, &p[0], &work[0, 0],
                          work.shape[1], &out[0, 0], out.shape[1])
    raise_failure()


def call_at(uintptr_t address, sizes: Sizes, const double[:, ::1] p, double[:, ::1] out) -> None:
    """Call a kernel of the parameters alone for every row of ``p`` and of ``out``; ``sizes`` as in :func:`call`."""
    cdef Py_ssize_t i
    cdef double[::1] none = np.zeros(max(sizes[:3]) + sizes[4] + 1)
    if p.shape[0] == 0:
        return
    _fits(sizes, none.shape[0], none.shape[0], none.shape[0], p.shape[1], none.shape[0], out.shape[1])
    at_least("rows of out", out.shape[0], p.shape[0])
    with nogil:
        for i in range(p.shape[0]):
            (<kernel_t>address)(&none[0], &none[0], &none[0], &p[i, 0], &none[0], &out[i, 0])
    raise_failure()


def call_repeatedly(uintptr_t address, sizes: Sizes, Py_ssize_t times, const double[:, ::1] y, Py_ssize_t n,
                    const double[::1] p, double[::1] work, double[:, ::1] out) -> None:
    """Call a kernel ``times`` times over all rows of ``y``, for measurements without Python's overhead."""
    cdef Py_ssize_t i, k
    cdef double t = 0.0
    _fits(sizes, 1, n, y.shape[1] - n, p.shape[0], work.shape[0], out.shape[1])
    at_least("rows of out", out.shape[0], y.shape[0])
    with nogil:
        for k in range(times):
            for i in range(y.shape[0]):
                (<kernel_t>address)(&t, &y[i, 0], &y[i, n], &p[0], &work[0], &out[i, 0])


def address_of(array: NDArray[Any]) -> int:
    """Return the memory address of an array's first number."""
    cdef Py_buffer seen
    PyObject_GetBuffer(array, &seen, PyBUF_STRIDES)
    address = <uintptr_t>seen.buf
    PyBuffer_Release(&seen)
    return address


cdef unsigned long MAIN = threading.main_thread().ident


cdef int interrupted() noexcept nogil:
    """Return whether Ctrl-C or another signal raised an exception; the caller of the loop raises it again.

    Python runs the handlers of signals in the main thread only: others are not stopped, and do not wait for the GIL."""
    if PyThread_get_thread_ident() != MAIN:
        return 0
    with gil:
        try:
            PyErr_CheckSignals()
        except BaseException as error:
            FAILURES.errors.append(error)
            return 1
    return 0


cdef class Core:
    """The core compiled for one number type.

    Parameters
    ----------
    address
        Address of its ``symgen_core``; 0 for the core of doubles, which is part of this module. owner Object that
        keeps the library of this address open.
    """

    def __init__(self, uintptr_t address=0, owner: Any = None):
        self.api = <const core_api *>address if address else &symgen_core
        self.owner, self.schemes = owner, {}
        if self.api.version != _CORE_VERSION:
            raise ValueError(f"expected a core of version {_CORE_VERSION}, got {self.api.version}")
        self.api.watch(interrupted)

    @property
    def name(self) -> str:
        """Name of the number type: float32, float64, longdouble or float128."""
        return self.api.real_name.decode()

    @property
    def real_bytes(self) -> int:
        """Bytes of a number."""
        return self.api.real_bytes

    @property
    def epsilon(self) -> float:
        """Distance from 1 to the next number."""
        return self.api.epsilon

    def widen(self, high: ArrayLike, low: ArrayLike | None = None) -> Raw:
        """Return doubles, or sums of two doubles, as numbers of the core: an array of raw bytes,
        with one more axis of ``real_bytes``."""
        cdef const double[::1] values = np.ascontiguousarray(high, dtype=float).ravel()
        cdef const double[::1] rest
        shape = np.shape(high)
        found = np.empty((*shape, self.api.real_bytes), dtype=np.uint8)
        cdef unsigned char[::1] to = found.reshape(-1)
        if values.shape[0] == 0:
            return found
        if low is None:
            self.api.widen(values.shape[0], &values[0], NULL, &to[0])
        else:
            rest = np.ascontiguousarray(low, dtype=float).ravel()
            at_least("low parts", rest.shape[0], values.shape[0])
            self.api.widen(values.shape[0], &values[0], &rest[0], &to[0])
        return found

    def narrow(self, raw: Raw) -> tuple[Array, Array]:
        """Return numbers of :meth:`widen` as two arrays of doubles: rounded values and remainders."""
        cdef const unsigned char[::1] raw_bytes = np.ascontiguousarray(raw).reshape(-1)
        shape = raw.shape[:raw.ndim - 1]
        high, low = np.empty(shape), np.empty(shape)
        cdef double[::1] a = high.reshape(-1), b = low.reshape(-1)
        if a.shape[0]:
            at_least("bytes", raw_bytes.shape[0], a.shape[0] * self.api.real_bytes)
            self.api.narrow(a.shape[0], &raw_bytes[0], &a[0], &b[0])
        return high, low

    def call(self, uintptr_t address, sizes: Sizes, const unsigned char[:, ::1] t, const unsigned char[:, :, ::1] y,
             Py_ssize_t n, const unsigned char[:, ::1] p, unsigned char[:, :, ::1] work,
             unsigned char[:, :, ::1] out) -> None:
        """Call a kernel of this number type for rows of raw numbers; ``sizes`` as in :func:`call`."""
        if y.shape[0]:
            _fits(sizes, 1, n, y.shape[1] - n, p.shape[0], work.shape[1], out.shape[1])
            for found in (t.shape[0], work.shape[0], out.shape[0]):
                at_least("rows", found, y.shape[0])
            for found in (t.shape[1], y.shape[2], p.shape[1], work.shape[2], out.shape[2]):
                at_least("bytes of a number", found, self.api.real_bytes)
            self.api.call_rows(<kernel_t>address, y.shape[0], &t[0, 0], &y[0, 0, 0], y.shape[1], n, &p[0, 0],
                               &work[0, 0, 0], work.shape[1], &out[0, 0, 0], out.shape[1])
            raise_failure()

    cdef Scheme scheme(self, method):
        if method not in self.schemes:
            self.schemes[method] = Scheme(self, method)
        return self.schemes[method]


cdef const kind *_kind_of(const core_api *api, method) except NULL:
    cdef const kind *found = api.find_kind(method.kind.encode())
    if found == NULL:
        raise ValueError(f"expected a kind of method of the core, got {method.kind!r}")
    return found


def _exact(method):
    """Return the counts of a method and its coefficients, in the order in which the core reads them for its kind."""
    cdef const kind *known = _kind_of(&symgen_core, method)
    counts = tuple(int(method.coefficients[name]) for name in known.counts.decode().split())
    arrays = [np.ravel(method.coefficients[name]) for name in known.arrays.decode().split()]
    return counts, np.concatenate([np.zeros(0, dtype=object), *arrays])


def scheme_of(method: Method) -> tuple[tuple[int, ...], Array]:
    """Return the counts of a method and its coefficients in doubles, in the same order."""
    counts, numbers = _exact(method)
    return counts, numbers.astype(float)


cdef class Scheme:
    """The coefficients of a method, in numbers of a core."""

    def __init__(self, Core core, method: Method):
        counts, exact = _exact(method)
        cdef const double[::1] numbers = np.append(exact.astype(float), 0.0)
        cdef const double[::1] rest = np.zeros(numbers.shape[0])
        cdef Py_ssize_t i
        self.filled.kind = _kind_of(core.api, method)
        for i, count in enumerate(counts):
            self.counts[i] = count
        needed = self.filled.kind.numbers(self.counts)
        if needed < 0:
            raise ValueError(
                f"a method of kind {method.kind!r} cannot have the counts {counts}: an explicit one has at "
                f"most {_MOST_STAGES} stages and two estimates of its error, a composition an odd number of parts"
            )
        at_least(f"numbers of a method of kind {method.kind!r}", numbers.shape[0], needed)
        self.memory = memory_of(0, numbers.shape[0] * core.api.real_bytes)
        if core.api.real_bytes > <Py_ssize_t>sizeof(double):  # digits beyond those of a double
            rest = np.append([float(Fraction(x) - Fraction(float(x))) for x in exact], 0.0)
        core.api.widen(numbers.shape[0], &numbers[0], &rest[0], self.memory.at)
        self.filled.adaptive, self.filled.error_order = method.adaptive, method.error_order
        self.filled.counts, self.filled.numbers = self.counts, <double *>self.memory.at
        self.near = core.scheme(method.near) if method.near else None
        self.filled.near = &self.near.filled if method.near else NULL


#: The core of doubles.
DOUBLE = Core()  # type: Core


cdef class Reals:
    """Numbers of Python for a core: the same memory for a core of doubles, otherwise a copy.

    Results of the core are copied back only into a contiguous array.
    """

    def __init__(self, Core of, doubles: ArrayLike):
        cdef const double[::1] numbers
        self.of, self.doubles = of, np.ascontiguousarray(doubles, dtype=float).reshape(-1)
        numbers = self.doubles
        self.count = numbers.shape[0]
        if of.api.real_bytes == sizeof(double):
            self.at = <void *>&numbers[0] if self.count else NULL
            return
        self.own = memory_of(0, self.count * of.api.real_bytes)
        self.at = self.own.at
        if self.count:
            of.api.widen(self.count, &numbers[0], NULL, self.at)

    cdef void back(self):
        """Copy the core's results back."""
        cdef double[::1] to
        if self.own is not None and self.count:
            to = self.doubles
            self.of.api.narrow(self.count, self.at, &to[0], NULL)


cdef class Integrable:
    """KernelEquations that a run integrates: their memory, sizes and diagnosis."""

    cdef int make(self, const sizes *wanted, const kernels *functions) except -1:
        self.memory = memory_of(self.of.api.equations_struct, self.of.api.equations_bytes(wanted))
        self.core = <equations *>self.memory.structure
        self.of.api.equations_bind(self.core, wanted, functions, self.memory.at)
        return 0

    cdef int bound(self, const double[::1] parameters) except -1:
        """Set the parameters of new equations, compute the quantities that depend on them alone, and store their
        sizes."""
        self.of.api.set_parameters(self.core, &parameters[0], NULL)
        self.n, self.m, self.extra = self.core.sizes.n, self.core.sizes.m, self.core.sizes.extra
        self.dim = 2 * self.n + self.extra
        return 0

    @property
    def core_type(self) -> Core:
        """The core that these equations were compiled for."""
        return self.of

    @property
    def parameters(self) -> Array:
        """The parameters, including references and branches that are constant in a step."""
        cdef double[::1] held = np.zeros(self.core.sizes.parameters + 1)
        self.of.api.narrow(self.core.sizes.parameters, self.core.p, &held[0], NULL)
        return np.asarray(held)[:self.core.sizes.parameters]

    @property
    def evaluations(self) -> int:
        """Number of evaluations of accelerations in runs."""
        return self.core.account.evaluations

    @property
    def factorisations(self) -> int:
        """Number of factorisations."""
        return self.core.account.factorisations

    @property
    def weakest(self) -> int:
        """The unknown of least pivot at the last factorisation, -1 for none."""
        return self.core.account.weakest

    @property
    def soundness(self) -> float:
        """The part of that pivot that remains after cancellation."""
        return self.core.account.soundness

    @property
    def lost(self) -> int:
        """Number of vanished pivots of redundant constraints at the last factorisation."""
        return self.core.account.lost

    @property
    def missed(self) -> float:
        """Error of redundant constraints [m] at their last evaluation."""
        return self.core.account.missed

    @property
    def redundant(self) -> int:
        """Number of constraints that follow from the others everywhere."""
        return self.core.sizes.redundant

    @property
    def rank_tolerance(self) -> float:
        """Rank is lost if a pivot keeps at most this part of the sum of its terms of equal sign."""
        return self.core.sizes.rank_tolerance

    def solutions(self, t: Array, y: Array) -> Array:
        """Return accelerations, multipliers and couples at every row of y = (q, u, ...)."""
        found = np.zeros((y.shape[0], self.n + self.m + self.core.sizes.couples + 1))
        if y.shape[0] == 0:
            return found
        at_least("numbers in a row of y", y.shape[1], 2 * self.n)
        at_least("times", len(t), y.shape[0])
        cdef Reals times = Reals(self.of, t), states = Reals(self.of, y), into = Reals(self.of, found)
        self.of.api.solve_rows(self.core, y.shape[0], times.at, states.at, y.shape[1], into.at, found.shape[1])
        raise_failure()
        into.back()
        return found

    def derivative(self, double t, y: Array) -> Array:
        """Return dy/dt at (t, y) as in a step."""
        found = np.zeros(self.dim)
        cdef Reals state = Reals(self.of, y), into = Reals(self.of, found)
        at_least("numbers in y", state.count, self.dim)
        self.of.api.derivative(self.core, t, state.at, into.at)
        into.back()
        return found

    def save(self) -> bytes:
        """Return the bytes of its memory: all data that persist between steps."""
        return self.memory.saved()

    def restore(self, const unsigned char[::1] memory) -> None:
        """Restore the bytes of :meth:`save` for the same equations."""
        if <size_t>memory.shape[0] != self.memory.bytes:
            raise ValueError("expected the saved memory of equations of the same sizes")
        self.memory.restore(memory)

    def lost_rows(self) -> list[int]:
        """Return the numbers of the constraints that depend on others at the last factorisation."""
        return [i for i in range(self.m) if self.core.dropped[i]]

    def set_parameters(self, const double[::1] parameters) -> None:
        """Set the parameters, branches of loads included, and compute the quantities that depend on them alone."""
        at_least("parameters", parameters.shape[0], self.core.sizes.parameters)
        self.of.api.set_parameters(self.core, &parameters[0], NULL)

    def put(self, Py_ssize_t place, double value) -> float:
        """Set a parameter of equations in doubles and return its value before; a run restarts before its next step."""
        if self.of.api.real_bytes != sizeof(double) or not 0 <= place < self.core.sizes.parameters:
            raise ValueError("expected equations in doubles, and the number of a parameter")
        cdef double before = self.core.p[place]
        self.core.p[place] = value
        return before

    def check(self, double t, const double[::1] y) -> int:
        """Factorise at y; return the status, the unknown of least pivot in ``weakest``, and in ``soundness`` the part
        of that pivot that remains after cancellation."""
        cdef Reals state = Reals(self.of, y)
        at_least("numbers in y", state.count, 2 * self.n)
        return self.of.api.check(self.core, t, state.at)


cdef object _places(tangent, Py_ssize_t n, Py_ssize_t m):
    """Return row, column and place of each value of the kernel 'tangent', checked against the sizes of a model."""
    found = np.array(tangent, dtype="l")
    if found.ndim != 2 or found.shape[1] != 3 or (found < 0).any() or (found >= (n + m, 2 * n, len(found))).any():
        raise ValueError(f"expected (row, column, place) below {(n + m, 2 * n, len(found))} for each slope")
    if (np.diff(found[:, 1]) < 0).any():
        raise ValueError("expected the slopes column by column")
    return found.ravel()


cdef class KernelEquations(Integrable):
    """The kernels of one model with its parameters and scratch memory; one per thread of work.

    Parameters
    ----------
    library
        The kernels, kept alive by this object; ``accelerations`` and ``energy`` are required.
    n, m
        Number of coordinates and of constraints.
    extra
        1 if the work of loads without potential is integrated, else 0.
    p
        Parameters.
    work_size
        Size of the work memory of the largest kernel.
    first_pivot
        Place of the first pivot in the work memory of 'factor'.
    rank_tolerance
        Rank is lost if a multiplier's pivot keeps at most this part of the sum of its terms of equal sign; the kernels
        set such a multiplier to zero.
    redundant
        Number of constraints that follow from the others in every configuration: the number of pivots that must
        vanish.
    slack
        Largest contradiction [m] between a redundant constraint and the others.
    core
        The core that the kernels were compiled for; the core of doubles by default. events, switches, windings, turns
        Number of values that the kernel 'events' writes for events, for switching points, of which those of ``tables`` are
        the last, for angles in loads, and for continuous angles of links, each with its rate.
    tangent
        Row, column and place of each value of the kernel 'tangent', column by column.
    tangent_library
        The library of that kernel and its set-up, for implicit methods.
    stabilisation
        Rate [1/s] of Baumgarte's terms in derivatives; 0 for none.
    couples
        Number of further unknowns, which the kernel 'accelerations' writes behind the multipliers.
    """

    def __init__(self, library: Library, Py_ssize_t n, Py_ssize_t m, Py_ssize_t extra, const double[::1] p,
                 Py_ssize_t work_size, Py_ssize_t first_pivot, double rank_tolerance, Py_ssize_t redundant,
                 double slack, *, long series_rows=0, long series_watched=0, Core core=DOUBLE, long events=0,
                 long switches=0, long tables=0, long windings=0, long turns=0, tangent: ArrayLike = (),
                 tangent_library: Library | None = None, double stabilisation=0.0, long couples=0):
        cdef kernels functions = kernels_of(library.addresses)
        cdef sizes wanted
        addresses = library.addresses
        tangents = tangent_library.addresses if tangent_library is not None else {}
        if not (addresses.get("accelerations") and addresses.get("energy")):
            raise ValueError("expected a model with the kernels 'accelerations' and 'energy'")
        functions.tangent, functions.tangent_setup = kernel_of(tangents, "tangent"), kernel_of(tangents, "setup")
        wanted.n, wanted.m, wanted.extra, wanted.parameters = n, m, extra, p.shape[0]
        wanted.couples = couples
        wanted.derived = library.derived
        wanted.tangent_derived = tangent_library.derived if tangents else 0
        wanted.work, wanted.first_pivot, wanted.redundant = work_size, first_pivot, redundant
        wanted.events = events if functions.events != NULL else 0
        wanted.switches = switches if functions.events != NULL else 0
        wanted.tables = tables if functions.events != NULL else 0
        wanted.windings = windings if functions.events != NULL else 0
        wanted.turns = turns if functions.events != NULL else 0
        wanted.series_rows = series_rows if functions.series != NULL else 0
        wanted.series_watched = series_watched if functions.series != NULL else 0
        wanted.choices = 0
        wanted.tangent, wanted.tangent_places = len(tangent), NULL
        if wanted.tangent:
            self.places = _places(tangent, n, m)
            wanted.tangent_places = &self.places[0]
        wanted.rank_tolerance, wanted.slack, wanted.stabilisation = rank_tolerance, slack, stabilisation
        if functions.factor != NULL:
            at_least("numbers of work memory", work_size, first_pivot + 2 * (n + m))
        self.of, self.libraries = core, (library, tangent_library)
        self.make(&wanted, &functions)
        self.bound(p)

    def copy(self) -> KernelEquations:
        """Return equations of the same model with their own memory, which holds the same."""
        cdef KernelEquations made = KernelEquations.__new__(KernelEquations)
        made.of, made.libraries, made.places = self.of, self.libraries, self.places
        made.make(&self.core.sizes, &self.core.kernels)
        made.n, made.m, made.extra, made.dim = self.n, self.m, self.extra, self.dim
        made.core.revision = self.core.revision
        memcpy(made.memory.at, self.memory.at, self.memory.bytes)
        return made


cdef int _check_nodes(nodes, counts, double t0, double t_end) except -1:
    """Raise ValueError where steps between nodes would not lead from the start of a run to its end."""
    times, numbers = np.asarray(nodes), np.asarray(counts)
    if len(times) < 2 or len(numbers) != len(times) or not (np.diff(times) > 0).all() or (numbers < -1).any():
        raise ValueError("expected increasing times of nodes, at least two, and numbers of steps")
    if (times.min(), times.max()) != (t0, t_end) or counts[0] or not counts[len(times) - 1]:
        raise ValueError("expected nodes from start to end, without steps to the first and with some to the last")
    return 0


cdef class Run:
    """A run from t0 to t_end by any method; no Python code runs inside a step.

    Parameters
    ----------
    equations
        The :class:`Integrable` to integrate.
    method
        A value of :data:`~symgen.runtime.integrate.integrators.INTEGRATORS`.
    t0, y0, t_end
        Start and end of the run.
    rtol, atol
        Tolerances of the local error; both zero for a fixed step.
    step
        The fixed step, or the first adaptive step (0: estimated).
    times
        Increasing times in [t0, t_end] at which the state is recorded.
    stabilisation
        A number of :data:`STABILISATIONS`.
    max_drift
        Error of a constraint [m] beyond which the run ends.
    max_step
        The longest step of an adaptive method; 0 for no limit.
    places_only
        Velocities of recorded states are not requested: they may violate the constraints by the error of
        interpolation.
    directions, terminal
        Of each event: 1 rising, -1 falling, 0 both; and whether it ends the run.
    nodes, counts
        Times at which steps end, increasing from t0 to t_end, and the number of equal steps to each from the one before
        it: 0 to the first, and where the state is kept up to a node, at which the method starts anew; -1 for steps of
        the method's own choice.
    continues
        The run goes on from its end by :meth:`step` or :meth:`extend`.
    """

    cdef Integrable equations
    cdef Core of
    cdef Scheme scheme
    cdef task asked
    cdef run *core
    cdef Memory memory
    cdef readonly double t, t_end, h, position_drift, velocity_drift, energy_drift
    cdef readonly double kinetic_min, kinetic_max, potential_min, potential_max, t_stiff
    cdef readonly double t_blind
    cdef readonly long steps, rejected, recorded, moved, ended_by, worst, blind, switchings, slid
    cdef readonly bint stiff
    cdef readonly Py_ssize_t dim
    cdef readonly list passages  # type: list[tuple[float, float, int]]
    cdef readonly list events  # type: list[tuple[float, int, bool | None, Array]]
    cdef double t_left
    cdef tuple ways
    cdef const double[::1] nodes
    cdef const long[::1] counts

    def __init__(self, Integrable equations, method: Method, double t0, const double[::1] y0, double t_end, double rtol,
                 double atol, double step, const double[::1] times, long stabilisation=0, double max_drift=INFINITY,
                 double max_step=0.0, bint places_only=False, directions: Sequence[int] = (),
                 terminal: Sequence[int] = (), *, const double[::1] nodes=None, counts: ArrayLike = (),
                 bint continues=False):
        cdef const signed char[::1] ways, effects
        cdef const signed char *way = NULL
        cdef const char *end = NULL
        self.ways = tuple(directions)
        if directions:
            ways, effects = np.array(directions, dtype=np.int8), np.array(terminal, dtype=np.int8)
            way, end = &ways[0], <const char *>&effects[0]
        self.equations, self.of = equations, equations.of
        if y0.shape[0] != equations.dim:
            raise ValueError(f"expected a state of {equations.dim} numbers, got {y0.shape[0]}")
        if not len(directions) == len(terminal) == equations.core.sizes.events:
            raise ValueError(f"expected directions and ends of {equations.core.sizes.events} events")
        if method.kind == "taylor" and not equations.core.sizes.series_rows:
            raise ModelError(
                f"{method.name}: power series are for compiled linkages, of fewer than about 100 rods, free loops and user-defined "
                "systems, without powers of varying exponent, and those of users without abs (such as of sqrt(x**2)), sign and max\n"
                "  Choose dop853."
            )
        self.scheme = self.of.scheme(method)
        self.asked.t0, self.asked.t_end, self.asked.rtol, self.asked.atol = t0, t_end, rtol, atol
        self.asked.step, self.asked.max_drift, self.asked.stabilisation = step, max_drift, stabilisation
        self.asked.max_step = max_step
        self.asked.samples, self.asked.found = times.shape[0], REMEMBERED * len(directions)
        self.asked.places_only, self.asked.nodes = places_only, 0 if nodes is None else nodes.shape[0]
        self.asked.continues = continues
        if continues and nodes is not None:
            raise ValueError("expected no nodes of a run that goes on from its end")
        self.nodes = nodes
        if self.asked.nodes:
            self.counts = np.array(counts, "l")
            _check_nodes(nodes, self.counts, t0, t_end)
        self.memory = memory_of(
            self.of.api.run_struct, self.of.api.run_bytes(equations.core, &self.scheme.filled, &self.asked)
        )
        self.core = <run *>self.memory.structure
        self.of.api.run_bind(self.core, equations.core, &self.scheme.filled, &self.asked, self.memory.at)
        self.dim = y0.shape[0]
        self.of.api.run_start(self.core, &y0[0], NULL, &times[0], way, end)
        self._set_nodes()
        self.passages, self.events = [], []
        self._look()

    cdef void _set_nodes(self):
        if self.asked.nodes:
            self.of.api.run_set_nodes(self.core, &self.nodes[0], &self.counts[0])

    cdef void _look(self):
        cdef report r
        self.of.api.run_report(self.core, &r)
        self.t, self.t_end, self.h = r.t, r.t_end, r.h
        self.position_drift, self.velocity_drift, self.energy_drift = r.position_drift, r.velocity_drift, r.energy_drift
        self.kinetic_min, self.kinetic_max = r.kinetic_min, r.kinetic_max
        self.potential_min, self.potential_max = r.potential_min, r.potential_max
        self.steps, self.rejected, self.recorded, self.moved = r.steps, r.rejected, r.recorded, r.moved
        self.ended_by, self.worst, self.stiff, self.t_stiff = r.ended_by, r.worst, r.stiff, r.t_stiff
        self.blind, self.t_blind = r.blind, r.t_blind
        self.switchings, self.slid = r.switchings, r.slid
        if r.passages:
            self._take_passages()
        if r.events:
            self._take_events(r.events)

    cdef void _take_passages(self):
        cdef passage found[_MOST_PASSAGES]
        cdef long i, count = self.of.api.take_passages(self.core, found)
        for i in range(count):
            self.passages.append((found[i].t, found[i].soundness, found[i].weakest))

    cdef void _take_events(self, long count):
        cdef Memory of_events = memory_of(count * sizeof(found_event), count * self.dim * self.of.api.real_bytes)
        cdef found_event *found = <found_event *>of_events.structure
        cdef long i
        self.of.api.take_events(self.core, found, of_events.at)
        states = self._doubles(of_events.at, count, self.dim)
        for i in range(count):
            self.events.append((found[i].t, found[i].index, _way(found[i].rising), states[i]))

    def save(self) -> tuple[bytes, bytes]:
        """Return the bytes of equations and run: the complete state of the core between two steps."""
        return self.equations.save(), self.memory.saved()

    def restore(self, const unsigned char[::1] equations, const unsigned char[::1] memory) -> None:
        """Restore the bytes of :meth:`save` for the same equations and options."""
        if <size_t>memory.shape[0] != self.memory.bytes:
            raise ValueError("expected the saved memory of a run of the same sizes")
        self.equations.restore(equations)
        self.memory.restore(memory)
        self.of.api.run_bind(self.core, self.equations.core, &self.scheme.filled, &self.asked, self.memory.at)
        self._set_nodes()
        if not self.of.api.run_valid(self.core):
            raise ValueError("expected the saved counts and times of a run between two steps")
        self._look()

    def take(self, passages: Array, events: Array, states: Array) -> None:
        """Record passages (t, soundness, weakest), and events (t, number, rising) with states, from before a restored
        memory was saved."""
        rows, limits = (np.asarray(passages), np.asarray(events)), (self.equations.n + self.equations.m, len(self.ways))
        if rows[1].shape != (len(states), 3) or np.shape(states) != (len(states), self.dim):
            raise ValueError(f"expected events and states of {self.dim} numbers")
        for found, column, first, limit in ((rows[0], 2, -1, limits[0]), (rows[1], 1, 0, limits[1])):
            if found.ndim != 2 or found.shape[1] != 3 or not ((found[:, column] >= first) & (found[:, column] < limit)).all():
                raise ValueError(f"expected numbers of passages and events below {limit}")
        self.passages.extend((t, sound, int(k)) for t, sound, k in rows[0].tolist())
        self.events.extend((t, int(i), _way(up), state) for (t, i, up), state in zip(rows[1].tolist(), states))

    def begin(self) -> int:
        """Project and record the start, estimate the first step; return the status."""
        cdef int status = self.of.api.run_begin(self.core)
        self._look()
        return status

    def advance(self, long most) -> int:
        """Take at most ``most`` steps; return MORE, DONE or the status of the failure."""
        cdef int status = _MORE
        with nogil:
            status = self.of.api.run_advance(self.core, most)
        self._look()
        return status

    def step(self, double h) -> int:
        """Go on for a time h from the end of a run that continues; return DONE or the status of the failure. Passages
        and events are those of this call."""
        cdef int status = _MORE
        cdef double begin = self.t, whole = h + self.t_left, end = begin + whole
        if end == begin:
            whole, end = h, begin + h
        if not (self.asked.continues and begin < end < INFINITY):
            raise ValueError("expected a run that continues, and a time that advances it")
        if self.passages or self.events:
            self.passages, self.events = [], []
        self.extend(end)
        while status == _MORE:
            with nogil:
                status = self.of.api.run_advance(self.core, STEPS_AT_ONCE)
            self._look()
            if status == _MORE:
                PyErr_CheckSignals()
        self.t_left = whole - (end - begin) if status == _DONE else 0.0
        if FAILURES.errors:
            raise_failure()
        return status

    def extend(self, double t_end) -> None:
        """Move the end of a run that continues, from the present time on."""
        if not (self.asked.continues and self.t <= t_end < INFINITY):
            raise ValueError("expected a run that continues, and an end after the present time")
        self.asked.t_end = t_end
        self.of.api.run_extend(self.core, t_end)

    def restart(self, bint moves) -> int:
        """Start the method anew after a change of the equations' parameters; ``moves``: of those of constraints, onto
        which the state is projected. Return MORE or the status of the failure."""
        cdef int status = self.of.api.run_restart(self.core, moves)
        self._look()
        return status

    def continue_as(self, Run other) -> None:
        """Take over the present state of a run with the same equations and options."""
        self.asked.t0, self.asked.t_end, self.t_left = other.asked.t0, other.asked.t_end, other.t_left
        self.restore(*other.save())

    cdef const double *_present(self, const void *rows, Py_ssize_t columns) except? NULL:
        """Return the row of the present state, behind those of the samples; of runs in doubles."""
        if self.of.api.real_bytes != sizeof(double):
            raise ValueError("expected a run in doubles")
        return <const double *>rows + self.asked.samples * columns

    def present(self) -> tuple[Array, Array, Array]:
        """Return the present state, references of angles in loads and continuous angles of links, of a run in doubles.

        With choices of coordinates these are the state in the present ones, the choices, and the usual coordinates."""
        cdef const sizes *of = &self.equations.core.sizes
        self.of.api.run_record(self.core)
        return (self._doubles(self._present(self.core.samples, self.dim), 1, self.dim)[0],
                self._doubles(self._present(self.core.references, of.windings), 1, of.windings)[0],
                self._doubles(self._present(self.core.turns, of.turns), 1, of.turns)[0])

    def outputs(self, KernelEquations at, uintptr_t address, numbers: Sizes,
                turning: Sequence[tuple[int, int]]) -> Array:
        """Return the output of a kernel of doubles at the present state, with one number more.

        ``at`` are other equations of the same model, whose memory is used, ``numbers`` the sizes as in :func:`call`, and
        ``turning`` pairs of places of angles in the output and of continuous angles, nearest to which they are shifted
        by revolutions.
        """
        cdef const sizes *of = &self.equations.core.sizes
        cdef const double *y = self._present(self.core.samples, self.dim)
        cdef const double *turns = self._present(self.core.turns, of.turns)
        cdef Py_ssize_t place, turn
        cdef double[::1] out = np.empty(numbers[5] + 1)
        if not (at.of.api.real_bytes == sizeof(double) and at.core.sizes.parameters == of.parameters
                and at.core.sizes.derived == of.derived):
            raise ValueError("expected equations of the same model in doubles")
        _fits(numbers, 1, self.equations.n, self.dim - self.equations.n, of.parameters + of.derived + 1,
              at.n + at.m + at.core.sizes.couples, numbers[5])
        self.of.api.run_record(self.core)
        memcpy(at.core.p, self.equations.core.p, (of.parameters + of.derived + 1) * sizeof(double))
        if numbers[4]:
            at.core.of.accelerate(at.core, self.t, y)
        (<kernel_t>address)(&self.t, y, y + self.equations.n, at.core.p, at.core.out, &out[0])
        for place, turn in turning:
            out[place] += rint((turns[turn] - out[place]) / REVOLUTION) * REVOLUTION
        if FAILURES.errors:
            raise_failure()
        return out.base

    def advance_noting(self, double[::1] t, double[:, ::1] y, double[:, ::1] references) -> tuple[int, int]:
        """Take at most one step per row; write time, state, references of angles and branches of loads after it.
        Return the status and the number of rows written. Runs in doubles only."""
        cdef const sizes *of = &self.equations.core.sizes
        cdef Py_ssize_t rows = t.shape[0], first = first_reference(of), held = held_parameters(of)
        cdef long taken = 0, steps = self.steps
        cdef int status = _MORE
        cdef report r
        if self.of.api.real_bytes != sizeof(double):
            raise ValueError("expected a run in doubles")
        for what, found in (("rows of y", y.shape[0]), ("rows of references", references.shape[0])):
            at_least(what, found, rows)
        if y.shape[1] != self.dim or references.shape[1] != held:
            raise ValueError(f"expected rows of {self.dim} and {held} numbers")
        with nogil:
            while taken < rows and status == _MORE:
                status = self.of.api.run_advance(self.core, 1)
                self.of.api.run_report(self.core, &r)
                if r.steps == steps and status != _MORE:
                    break
                steps = r.steps  # unchanged if a load switches to its other branch at a point: a row without a step
                t[taken] = r.t
                memcpy(&y[taken, 0], self.of.api.run_state(self.core), self.dim * sizeof(double))
                if held:
                    memcpy(&references[taken, 0], self.equations.core.p + first, held * sizeof(double))
                taken += 1
        self._look()
        return status, taken

    cdef object _doubles(self, const void *raw, Py_ssize_t rows, Py_ssize_t columns):
        found = np.empty((rows, columns))
        cdef double[::1] to = found.reshape(-1)
        if rows * columns:
            self.of.api.narrow(rows * columns, raw, &to[0], NULL)
        return found

    @property
    def result(self) -> Array:
        """The recorded states, one row per time."""
        return self._doubles(self.core.samples, self.recorded, self.dim)

    @property
    def sampled(self) -> Array:
        """The times of the recorded states."""
        return self._doubles(self.core.times, 1, self.recorded)[0]

    @property
    def references(self) -> Array:
        """The references of the angles in loads at the recorded times, one row per time."""
        return self._doubles(self.core.references, self.recorded, self.equations.core.sizes.windings)

    @property
    def turns(self) -> Array:
        """The continuous angles of links at the recorded times, one row per time."""
        return self._doubles(self.core.turns, self.recorded, self.equations.core.sizes.turns)

    def called(self, uintptr_t address, sizes: Sizes, const double[::1] p) -> Array:
        """Return the output of a kernel of doubles without work memory, one row per recorded state of a run in
        doubles."""
        cdef Py_ssize_t size = sizes[5]
        if self.of.api.real_bytes != sizeof(double):
            raise ValueError("expected a run in doubles: kernels of doubles cannot read other states")
        _fits(sizes, 1, self.equations.n, self.dim - self.equations.n, p.shape[0], 0, size)
        found = np.empty((self.recorded, size))
        cdef double[:, ::1] out = found
        cdef double none = 0.0
        self.of.api.call_rows(<kernel_t>address, self.recorded, self.core.times,
                              self.core.samples, self.dim, self.equations.n, &p[0], &none, 0,
                              &out[0, 0], size)
        raise_failure()
        return found

    @property
    def state(self) -> Array:
        """The last accepted state."""
        found = np.empty(self.dim)
        cdef double[::1] to = found
        if self.dim:
            self.of.api.narrow(self.dim, self.of.api.run_state(self.core), &to[0], NULL)
        return found
