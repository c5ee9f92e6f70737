# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of loops in the core: closure, following along inputs, equations of motion for runs."""

from typing import TYPE_CHECKING

import numpy as np

from libc.string cimport memcpy

from symgen.runtime._core cimport (
    Core, Integrable, Memory, Reals, at_least, equations, functions_of, interrupted, kernel_of, kernel_t, memory_of,
)
from symgen.runtime._headers cimport (
    _OPEN, _INCONSISTENT, _POLE, _RATES_UNDETERMINED, _ROWS, _MOST, _CLOSURE, _RATES, _SOUNDNESS, _HOLD, _STATUS,
    _DIAGNOSES, loop_kernels, loop_sizes, ball, loop_account, loop, loop_lanes, loop_lane_task, loop_lanes_api,
    loops_api,
)

from symgen.calls import raise_failure
from symgen.runtime._core import DOUBLE

if TYPE_CHECKING:
    from symgen.runtime.kernels.library import Library

#: Status of closing and moving a loop, in addition to the core's own.
OPEN, INCONSISTENT, POLE, RATES_UNDETERMINED = _OPEN, _INCONSISTENT, _POLE, _RATES_UNDETERMINED
#: Columns of the diagnosis of a sample.
CLOSURE, RATES, SOUNDNESS, HOLD, STATUS = _CLOSURE, _RATES, _SOUNDNESS, _HOLD, _STATUS


cdef loop_kernels kernels_of(addresses):
    """Return the kernels of a loop; absent kernels are NULL."""
    cdef loop_kernels functions
    functions.inputs, functions.position = kernel_of(addresses, "inputs"), kernel_of(addresses, "position")
    functions.motion, functions.inverse = kernel_of(addresses, "motion"), kernel_of(addresses, "inverse")
    functions.given, functions.outputs = kernel_of(addresses, "given"), kernel_of(addresses, "outputs")
    functions.energy = kernel_of(addresses, "energy")
    functions.setup, functions.events = kernel_of(addresses, "setup"), kernel_of(addresses, "events")
    functions.series = kernel_of(addresses, "series")
    return functions


cdef class LoopEquations(Integrable):
    """The kernels of one loop with its parameters and scratch memory; one per thread of work.

    Parameters
    ----------
    library
        The kernels, kept alive by this object; ``position`` is required.
    p
        Parameters.
    work_size, out_size
        Size of the work memory of the largest kernel, and of the result of the kernel 'outputs'.
    lengths
        Whether each variable is a displacement.
    solved
        Numbers of the solved variables; others are constant, or inputs.
    inputs
        Numbers of the variables whose motion is prescribed.
    unknown
        Numbers of the variables with an unknown effort of a drive.
    size
        The length that scales displacements and moments [m].
    rank
        Generic rank of the screws of ``solved``.
    core
        The core that the kernels were compiled for; the core of doubles by default. tolerance Largest defect of
        closure in dependent equations: of rotations, and of lengths over the size.
    balls
        Ball joints with alternative angles near their poles: numbers of theta, eta and alpha of each, -1 for a
        constant alpha; the next ball, which takes over the spin, then follows. Their leading angles are the parameters
        before the branches of switching points.
    switches
        Number of switching points of loads: values that the kernel 'events' writes; those of ``tables`` are the last.
    work_of_loads
        Whether the work of loads without potential is integrated.
    series_rows, series_watched
        Coefficients of one order of power series, and those of the kernel 'events' among them.
    """

    cdef const loops_api *api
    cdef loop_account *seen
    cdef loop_sizes sizes
    cdef Py_ssize_t[::1] numbers
    cdef ball[_MOST] balls
    cdef unsigned char[::1] lengths
    cdef readonly double size
    cdef readonly Py_ssize_t rank
    cdef Py_ssize_t out_size

    def __init__(self, library: Library, p: Sequence[float] | Array, Py_ssize_t work_size, Py_ssize_t out_size,
                 lengths: Sequence[bool], solved: Sequence[int], inputs: Sequence[int], unknown: Sequence[int],
                 double size, Py_ssize_t rank, *, Core core=DOUBLE, double tolerance=0.0,
                 balls: Sequence[Sequence[int]] = (), long switches=0, long tables=0, bint work_of_loads=True,
                 long series_rows=0, long series_watched=0):
        cdef Py_ssize_t k
        cdef loop_sizes wanted
        cdef loop_kernels functions
        cdef const double[::1] parameters = np.array([*p, 0.0])
        addresses = library.addresses
        if not addresses.get("position"):
            raise ValueError("expected a loop with the kernel 'position'")
        if len(lengths) > _MOST:
            raise ValueError(f"expected at most {_MOST} variables of a loop, got {len(lengths)}")
        for i in (*solved, *inputs, *unknown):
            if not 0 <= i < len(lengths):
                raise ValueError(f"expected numbers of variables below {len(lengths)}, got {i}")
        if not 0 <= rank <= min(_ROWS, len(solved)):
            raise ValueError(f"expected a rank of at most {min(_ROWS, len(solved))}, got {rank}")
        found = [list(solved).index(i) for i in unknown if i in list(solved)]
        known = [k for k, i in enumerate(inputs) if i not in list(unknown)]
        if len(found) > len(known):
            found = []  # an input that is released in the search for closures has no effort
        self.numbers = np.array([*solved, *inputs, *found, *known, -1], dtype=np.intp)
        self.lengths = np.array([*lengths, False], dtype=np.uint8)
        functions = kernels_of(addresses)
        wanted.n, wanted.parameters, wanted.derived = len(lengths), parameters.shape[0] - 1, library.derived
        wanted.work, wanted.out_size, wanted.solved, wanted.inputs = work_size, out_size, len(solved), len(inputs)
        wanted.unknown, wanted.known, wanted.rank, wanted.size = len(found), len(known), rank, size
        wanted.tolerance, wanted.balls, wanted.extra = tolerance, len(balls), work_of_loads
        wanted.switches = switches if functions.events != NULL else 0
        wanted.tables = tables if functions.events != NULL else 0
        if functions.series != NULL:
            wanted.series_rows, wanted.series_watched = series_rows, series_watched
        else:
            wanted.series_rows = wanted.series_watched = 0
        at_least("parameters", wanted.parameters, wanted.balls + wanted.switches)
        if len(balls) > _MOST or any([not -1 <= i < len(lengths) for angles in balls for i in angles]):
            raise ValueError(f"expected numbers of variables below {len(lengths)} for each ball joint, got {balls!r}")
        for k in range(wanted.balls):
            self.balls[k].angles[0], self.balls[k].angles[1], self.balls[k].angles[2] = balls[k]
        self.of, self.size, self.rank, self.out_size, self.sizes = core, size, rank, out_size, wanted
        self.libraries = (library,)
        self.api = core.api.loops
        self._bind(&functions)
        self.bound(parameters)

    cdef void _bind(self, const loop_kernels *functions):
        self.memory = memory_of(self.api.loop_struct, self.api.bytes(&self.sizes))
        self.core = <equations *>self.memory.structure
        self.api.bind(<loop *>self.core, &self.sizes, functions, &self.numbers[0], &self.lengths[0], self.balls, self.memory.at)
        self.seen = (<loop *>self.core).seen

    def copy(self) -> LoopEquations:
        """Return equations of the same loop with their own memory, which holds the same."""
        cdef LoopEquations made = LoopEquations.__new__(LoopEquations)
        made.of, made.libraries, made.api, made.sizes = self.of, self.libraries, self.api, self.sizes
        made.size, made.rank, made.out_size = self.size, self.rank, self.out_size
        made.numbers, made.lengths = self.numbers, self.lengths
        memcpy(made.balls, self.balls, sizeof(self.balls))
        made.n, made.m, made.extra, made.dim = self.n, self.m, self.extra, self.dim
        made._bind(&(<loop *>self.core).kernels)
        made.core.revision = self.core.revision
        memcpy(made.memory.at, self.memory.at, self.memory.bytes)
        return made

    @property
    def closure(self) -> float:
        """Defect of closure at the last evaluation: of rotations, and of lengths over the size."""
        return self.seen.closure

    @property
    def rates_left(self) -> float:
        """Part of the last required rates that no motion of the solved variables can supply."""
        return self.seen.rates_left

    def close(self, double t, double[::1] q) -> int:
        """Close the loop at t by Newton's method from q, in place; return the status."""
        at_least("variables", q.shape[0], self.n)
        cdef Reals state = Reals(self.of, q)
        cdef int status = self.api.close(<loop *>self.core, t, state.at)
        state.back()
        return status

    def assemble(self, double t, double[::1] q) -> tuple[int, int]:
        """Bring the loop near a closure at t from any q, in place; return the status and the rank at q."""
        at_least("variables", q.shape[0], self.n)
        cdef Reals state = Reals(self.of, q)
        cdef long rank = 0
        cdef int status = self.api.assemble(<loop *>self.core, t, state.at, &rank)
        state.back()
        return status, rank

    def closed_screws(self, double t, q: Array) -> tuple[Array, float]:
        """Return the screws of all variables at q, shape (6, n), and the defect of closure there."""
        screws = np.empty((_ROWS, self.n))
        cdef Reals state = Reals(self.of, q), into = Reals(self.of, screws)
        at_least("variables", state.count, self.n)
        cdef double defect = self.api.closed_screws(<loop *>self.core, t, state.at, into.at)
        into.back()
        return screws, defect

    def turn(self, q: Array) -> Array:
        """Return the variables q in the angles in use. Near poles of balls these are the alternative ones from now on,
        by the leading angles among :attr:`parameters`."""
        state = np.concatenate([q, np.zeros(self.n)])
        at_least("variables", len(q), self.n)
        cdef Reals y = Reals(self.of, state)
        self.api.turn(<loop *>self.core, y.at)
        y.back()
        return state[:self.n]

    def turn_back(self, y: Array, near: Array) -> Array:
        """Return a state (q, u) in the angles of the table, those nearest to the variables ``near``, from that in the
        angles by :attr:`parameters`, which are those of the table from now on."""
        at_least("variables", min(len(y) // 2, len(near)), self.n)
        state = np.array(y, dtype=float)
        cdef Reals to = Reals(self.of, state), beside = Reals(self.of, near)
        self.api.turn_back(<loop *>self.core, beside.at, to.at)
        to.back()
        return state

    def follow(self, double t, double[::1] q, times: Array, double longest, double[:, ::1] states, double[:, ::1] out,
               double[:, ::1] diagnosis) -> tuple[int, int, float]:
        """Follow the loop from a closed state (t, q) through monotone times; return the status and the number reached.

        Variables that are not solved for are constant, or inputs.

        Parameters
        ----------
        q
            The state at t; on return the last state reached.
        longest
            Longest step in time [s].
        states, out, diagnosis
            For every time: q, rates, accelerations and closing wrench; the result of the kernel 'outputs'; and the
            columns CLOSURE, RATES, SOUNDNESS, HOLD, STATUS.

        Returns
        -------
        tuple
            Status, number of times reached, and the time up to which the loop could be followed.
        """
        cdef Reals state = Reals(self.of, q), when = Reals(self.of, times)
        cdef Reals rows = Reals(self.of, states), outputs = Reals(self.of, out)
        cdef double at = t
        cdef long count = 0
        cdef int status
        at_least("variables", state.count, self.n)
        at_least("columns of states", states.shape[1], 3 * self.n + _ROWS)
        at_least("columns of out", out.shape[1], self.out_size)
        at_least("columns of the diagnosis", diagnosis.shape[1], _DIAGNOSES)
        if diagnosis.shape[0] and diagnosis.shape[1] != _DIAGNOSES:
            raise ValueError(f"expected {_DIAGNOSES} columns of the diagnosis, got {diagnosis.shape[1]}")
        for found in (states.shape[0], out.shape[0], diagnosis.shape[0]):
            at_least("rows", found, when.count)
        with nogil:
            status = self.api.follow(<loop *>self.core, &at, state.at, when.at, when.count, longest, rows.at,
                                     states.shape[1], outputs.at, out.shape[1], &diagnosis[0, 0] if diagnosis.shape[0] else NULL, &count)
        raise_failure()
        state.back()
        rows.back()
        outputs.back()
        return status, count, at

    def undetermined(self, times: Array, double[:, ::1] states, double least, double part) -> NDArray[np.bool_]:
        """Return which outputs depend on a wrench without work on any screw, (poses, outputs).

        All variables must be solved for.

        Parameters
        ----------
        times
            Times of the poses [s].
        states
            Rows that start with the variables.
        least
            Least pivot of independent screws, over the first one.
        part
            Least effect that counts, over that of a unit wrench.
        """
        cdef Reals when = Reals(self.of, times), rows = Reals(self.of, states)
        cdef unsigned char[:, ::1] found = np.zeros((when.count, self.out_size), dtype=np.uint8)
        at_least("rows", states.shape[0], when.count)
        at_least("columns of states", states.shape[1], self.n)
        if when.count and self.out_size:
            with nogil:
                self.api.undetermined(<loop *>self.core, when.at, rows.at, states.shape[1], when.count, least, part,
                                      &found[0, 0])
            raise_failure()
        return np.asarray(found).view(bool)


cdef class LoopLanes:
    """Variants of one driven loop, followed in SIMD lanes; one object per thread.

    Parameters
    ----------
    like
        The equations of one variant.
    library
        Their kernels, which take vectors.
    lanes
        Numbers of a vector.
    """

    cdef loop_lanes *core
    cdef Memory memory
    cdef const loop_lanes_api *api
    cdef Py_ssize_t lanes
    cdef loop_sizes sizes
    cdef LoopEquations like
    cdef object library

    def __init__(self, LoopEquations like, library: Library, Py_ssize_t lanes):
        cdef loop_kernels functions = kernels_of(library.addresses)
        self.like, self.library, self.sizes, self.lanes = like, library, like.sizes, lanes
        self.sizes.derived = library.derived
        self.api = functions_of(lanes).loops
        if functions.inputs == NULL or functions.position == NULL or functions.motion == NULL or functions.outputs == NULL:
            raise ValueError("expected kernels of a driven loop with outputs")
        if self.sizes.rank != self.sizes.solved or not 0 < self.sizes.solved <= _ROWS:
            raise ValueError(f"expected one to {_ROWS} independent screws, got {self.sizes.solved} of rank {self.sizes.rank}")
        self.memory = memory_of(self.api.lanes_struct, self.api.bytes(&self.sizes))
        self.core = <loop_lanes *>self.memory.structure
        self.api.bind(self.core, &self.sizes, &functions, &like.numbers[0], &like.lengths[0], self.memory.at)

    def follow(self, const double[::1] own, const double[:, ::1] parameters, const double[::1] start,
               const double[::1] stages, begin: float | None, Py_ssize_t lead, const double[::1] samples, bint of_input,
               double close, double longest, double apart,
               double least) -> tuple[Array, Array, Array, Array, NDArray[np.bool_]]:
        """Close and follow a loop for each row of parameters.

        Parameters
        ----------
        own, start, stages
            Parameters of the scene, variables closed with them, and fractions of the path from these to the rows.
        begin
            Value of the input ``lead`` at the start; None for a start at t = 0.
        samples, of_input
            Increasing values of that input, or times.
        close, longest, apart, least
            Rounding of values of the input, the longest step over the range, the least range [s], and the ratio of the
            least pivot to the greatest below which a lane ends.

        Returns
        -------
        tuple
            Times (runs, samples), results of the kernel 'outputs' (runs, numbers, samples), the determinant of the
            drives (runs, samples), the largest closure (runs,), and which runs reached the end. Results of other runs
            are undefined; single loops must follow them.
        """
        cdef Py_ssize_t runs = parameters.shape[0], parameter_count = self.sizes.parameters, out_size = self.sizes.out_size, w = self.lanes
        cdef Py_ssize_t count = samples.shape[0], padded = (runs + w - 1) // w * w, first = 0
        cdef loop_lane_task task
        if count < 1 or runs < 1 or parameters.shape[1] != parameter_count or own.shape[0] != parameter_count or start.shape[0] != self.sizes.n:
            raise ValueError(f"expected samples, and rows of {parameter_count} parameters and of {self.sizes.n} variables")
        if not 0 <= lead < self.sizes.inputs:
            raise ValueError(f"expected the number of an input below {self.sizes.inputs}, got {lead}")
        if not stages.shape[0]:
            raise ValueError("expected at least one stage")
        rows = np.minimum(np.arange(padded), runs - 1)  # idle lanes repeat the last run
        cdef const double[:, ::1] all_parameters = np.ascontiguousarray(np.asarray(parameters)[rows]).reshape(padded, parameter_count)
        made = np.tile(samples, (padded, 1))
        out, hold, closure = np.empty((padded, out_size, count)), np.empty((padded, count)), np.empty(padded)
        reached = np.zeros(padded, dtype=np.intp)
        cdef double[:, ::1] to_times = made, to_hold = hold
        cdef double[:, :, ::1] to_out = out
        cdef double[::1] to_closure = closure
        cdef Py_ssize_t[::1] to_reached = reached
        cdef double none = 0.0
        task.own, task.start, task.stages = &own[0] if parameter_count else &none, &start[0], &stages[0]
        task.stage_count, task.starts_at_zero, task.lead = stages.shape[0], begin is None, lead
        task.begin = 0.0 if begin is None else begin
        task.values, task.count = &samples[0] if of_input else NULL, count
        task.close, task.longest, task.apart, task.least = close, longest, apart, least
        with nogil:
            while first < padded and not interrupted():
                task.parameters = &all_parameters[first, 0] if parameter_count else &none
                task.times, task.out, task.hold = &to_times[first, 0], &to_out[first, 0, 0], &to_hold[first, 0]
                task.closure, task.reached = &to_closure[first], &to_reached[first]
                self.api.follow(self.core, &task)
                first += w
        raise_failure()
        return made[:runs], out[:runs], hold[:runs], closure[:runs], reached[:runs] == count
