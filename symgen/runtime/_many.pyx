# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""LinkageRuns of variants of one linkage, without Python code between them."""

from typing import TYPE_CHECKING

import numpy as np

from libc.math cimport fabs, fmax
from libc.string cimport memcmp, memcpy, memset

from symgen.runtime._core cimport (
    Core, KernelEquations, Memory, Scheme, _DONE, _MORE, at_least, core_api, equations, functions_of, interrupted, kernel_of,
    kernel_t, kernels, kernels_of, memory_of, report, run, scheme as scheme_t, task,
)
from symgen.runtime._start cimport (
    Starter, start, start_kernels, start_sizes, start_api, _ON_THE_WAY, _STARTED,
)
from symgen.runtime._headers cimport lane_runs, lane_runs_api, sizes as sizes_of_model

from symgen.calls import raise_failure
from symgen.runtime._core import DOUBLE

if TYPE_CHECKING:
    from symgen.runtime.integrate.integrators.method import Integrator
    from symgen.runtime.kernels.evaluate import Evaluator
    from symgen.runtime.kernels.library import Library


def over_variants(evaluator: Evaluator, str kernel, const double[:, ::1] variants, const double[::1] times,
                  rows: Array) -> Array:
    """Return the output of a kernel for variants of a linkage at many times: (runs, times, entries).

    Parameters
    ----------
    evaluator
        The :class:`~symgen.runtime.kernels.evaluate.Evaluator` of any variant.
    variants
        Parameters of each run, (runs, parameters).
    rows
        States: coordinates, their rates and second rates, (runs, times, 3, n); kernels of the motion receive the
        accelerations in their work memory.
    """
    cdef const core_api *api = (<Core>DOUBLE).api
    cdef const double[:, :, :, ::1] states = np.ascontiguousarray(rows)
    cdef kernel_t function = kernel_of(evaluator.library.addresses, kernel)
    cdef kernel_t setup = kernel_of(evaluator.library.addresses, "setup")
    cdef Py_ssize_t runs = variants.shape[0], count = times.shape[0], parameters = variants.shape[1], i, n
    info, n = evaluator.info(kernel), evaluator.description.coordinates
    cdef Py_ssize_t size = info.out_size, work_size = info.work_size
    if parameters != len(evaluator.parameter_values) or states.shape[0] != runs or states.shape[1] != count or states.shape[2] != 3 \
            or states.shape[3] != n:
        raise ValueError(f"expected {runs} rows of {len(evaluator.parameter_values)} parameters and states of {n} coordinates")
    found = np.zeros((runs, count, size))
    if not runs or not count or not size:
        return found
    cdef double[::1] p = np.array(evaluator.parameters)
    cdef double[:, ::1] work = np.zeros((count, work_size + 1))
    cdef double[:, :, ::1] out = found
    cdef Py_ssize_t held = min(n, work_size), k
    with nogil:
        for i in range(runs):
            if interrupted():
                break
            if parameters:
                memcpy(&p[0], &variants[i, 0], parameters * sizeof(double))
            if setup != NULL:
                setup(NULL, NULL, NULL, &p[0], NULL, &p[parameters])
            for k in range(count):
                memcpy(&work[k, 0], &states[i, k, 2, 0], held * sizeof(double))
            api.call_rows(function, count, &times[0], &states[i, 0, 0, 0], 3 * n, n, &p[0], &work[0, 0], work_size + 1,
                          &out[i, 0, 0], size)
    raise_failure()
    return found


cdef class Lanes:
    """LinkageRuns of fixed explicit steps, or of power series, in the lanes of vectors.

    Parameters
    ----------
    library
        Kernels that take vectors, those of power series among them if the runs have these.
    equations
        The :class:`~symgen.runtime._core.KernelEquations` of a single run.
    lanes
        Numbers of a vector.
    """

    cdef readonly Py_ssize_t lanes
    cdef sizes_of_model sizes
    cdef kernels functions
    cdef const lane_runs_api *api
    cdef lane_runs *core
    cdef Memory memory
    cdef object library
    cdef double[::1] rows, states, samples, drifts
    cdef char[::1] failed, found

    def __init__(self, library: Library, KernelEquations equations, Py_ssize_t lanes):
        self.library, self.lanes = library, lanes
        self.api, self.functions = functions_of(lanes).runs, kernels_of(library.addresses)
        self.sizes = equations.core.sizes
        self.sizes.derived = library.derived
        if self.functions.series == NULL:
            self.sizes.series_rows = 0

    cdef int bound(self, const scheme_t *method, const task *asked) except -1:
        """Allocate memory for runs by a method."""
        cdef Py_ssize_t w = self.lanes, dim = 2 * self.sizes.n + self.sizes.extra
        self.memory = memory_of(self.api.lanes_struct, self.api.bytes(&self.sizes, method))
        self.core = <lane_runs *>self.memory.structure
        self.api.bind(self.core, &self.sizes, &self.functions, method, asked, self.memory.at)
        self.rows, self.states = np.zeros(w * self.sizes.parameters + 1), np.zeros(w * dim)
        self.samples, self.drifts = np.zeros(w * asked.samples * dim), np.zeros(2 * w)
        self.failed, self.found = np.zeros(w, dtype=np.int8), np.zeros(w, dtype=np.int8)
        return 0


cdef class Starts:
    """Starts of variants of one linkage; one object per thread.

    Parameters
    ----------
    evaluator
        The :class:`~symgen.runtime.kernels.evaluate.Evaluator` of any variant.
    equations
        Its :class:`~symgen.runtime._core.KernelEquations`, without redundant constraints, events and held parameters.
    starter
        Its :class:`~symgen.runtime._start.Starter`.
    ends
        Numbers of the two points of every link, shape (links, 2).
    rounding
        Round-off of drawn positions over the size of the linkage.
    consistent
        Round-off of the start's velocities over the largest of their right-hand sides.
    near
        Springs shorter than this part of the largest coordinate have no direction.
    """

    cdef KernelEquations equations
    cdef Starter starter
    cdef const core_api *api
    cdef equations *e
    cdef start *s
    cdef const start_api *of_start
    cdef start_sizes sizes
    cdef start_kernels kernels
    cdef Memory fresh
    cdef Memory state
    cdef kernel_t drawn, lines
    cdef const double *ahead
    cdef Py_ssize_t n, m, springs
    cdef const Py_ssize_t[:, ::1] ends
    cdef double rounding, consistent, near
    cdef double[::1] row, result
    cdef char[::1] none_dropped
    cdef object evaluator

    def __init__(self, evaluator: Evaluator, KernelEquations equations, Starter starter, const Py_ssize_t[:, ::1] ends,
                 double rounding, double consistent, double near):
        d, addresses = evaluator.description, evaluator.library.addresses
        self.evaluator, self.equations, self.starter = evaluator, equations, starter
        self.api, self.e, self.state = equations.of.api, equations.core, equations.memory
        self.s, self.of_start, self.sizes, self.kernels = starter.core, starter.api, starter.sizes, starter.functions
        self.n, self.m, self.ends = equations.n, equations.m, ends
        self.rounding, self.consistent, self.near = rounding, consistent, near
        if self.api.real_bytes != sizeof(double) or self.n < 1 or d.events or d.held or equations.redundant:
            raise ValueError("expected a linkage in doubles, without events and redundant constraints")
        self.drawn, self.lines = kernel_of(addresses, "drawn"), kernel_of(addresses, "line_lengths")
        if self.drawn == NULL:
            raise ValueError("expected a kernel 'drawn'")
        lines = evaluator.find("line_lengths")
        self.springs = lines.out_size if lines else 0
        if any([k.work_size for k in d.kernels if k.name in ("drawn", "line_lengths")]):
            raise ValueError("expected work memory for the kernels of a start")
        self.row, self.result = np.zeros(2 * self.n + 2), np.zeros(self.springs + 1)
        self.none_dropped = np.zeros(self.m + 1, dtype=np.int8)
        self.fresh = memory_of(0, self.state.bytes)
        memcpy(self.fresh.at, self.state.at, self.state.bytes)
        starter.api.bind(starter.core, &starter.sizes, &starter.functions, equations.core.p, starter.memory.at)

    def poses(self, const double[:, ::1] variants,
              ahead: tuple[Array, NDArray[np.uint8]] | None = None) -> tuple[NDArray[np.bool_], Array, Array]:
        """Assemble the linkage for every row of parameters.

        ``ahead`` are coordinates (runs, n) from :class:`~symgen.runtime._start.StartLanes`, and their flags (runs,).

        Returns
        -------
        tuple
            Which starts are regular, their coordinates (runs, n), and the sizes of the linkages there [m].
        """
        cdef Py_ssize_t i, runs = variants.shape[0]
        at_least("parameters", variants.shape[1], self.e.sizes.parameters)
        found, q, lengths = np.zeros(runs, dtype=np.uint8), np.zeros((runs, self.n)), np.zeros(runs)
        cdef unsigned char[::1] regular = found
        cdef const double[:, ::1] known = q if ahead is None else ahead[0]
        cdef const unsigned char[::1] is_known = found if ahead is None else ahead[1]
        if known.shape[0] != runs or known.shape[1] != self.n or is_known.shape[0] != runs:
            raise ValueError(f"expected coordinates and flags of {runs} starts")
        cdef double[:, ::1] to_q = q
        cdef double[::1] to_lengths = lengths
        with nogil:
            for i in range(runs):
                if interrupted():
                    break
                self.renew(&variants[i, 0])
                self.ahead = &known[i, 0] if is_known[i] else NULL
                if self.started():
                    regular[i] = 1
                    memcpy(&to_q[i, 0], self.s.q, self.n * sizeof(double))
                    to_lengths[i] = self.extent()
        raise_failure()
        return found.astype(bool), q, lengths

    cdef void renew(self, const double *parameters) noexcept nogil:
        """Set the parameters of equations and reset their memory."""
        memcpy(self.state.at, self.fresh.at, self.state.bytes)
        self.api.set_parameters(self.e, parameters, NULL)

    cdef bint scaled(self) noexcept nogil:
        """Return whether the scales of all constraints are above zero at the coordinates of the start; leave the values
        and the scales in the output of the start."""
        cdef double t = 0.0
        cdef Py_ssize_t i
        self.kernels.constraints(&t, self.s.q, self.s.still, self.e.p, self.s.work, self.s.out)
        for i in range(self.m):
            if not self.s.out[self.m + i] > 0.0:
                return False
        return True

    cdef double extent(self) noexcept nogil:
        """Return the size of the linkage [m] at the coordinates of the start; leave the positions in its output.

        NaN if a position is not finite."""
        return self.of_start.extent(self.s, self.s.q)

    cdef bint assembled(self) noexcept nogil:
        """Assemble the linkage from its drawing; return whether the start is regular."""
        cdef double t = 0.0, size, apart
        cdef Py_ssize_t i, j, axes = self.sizes.axes
        cdef int status = _ON_THE_WAY
        self.drawn(&t, self.s.still, self.s.still, self.e.p, self.s.work, self.s.q)
        size = self.extent()
        if size != size:
            return False
        if self.kernels.assembly != NULL:
            for i in range(self.ends.shape[0]):
                apart = 0.0
                for j in range(axes):
                    apart = fmax(apart, fabs(self.s.out[self.ends[i, 1] * axes + j] - self.s.out[self.ends[i, 0] * axes + j]))
                if not apart > self.rounding * size:
                    return False
            if self.kernels.constraints != NULL and not self.scaled():
                return False
            self.of_start.begin(self.s)
            if self.ahead != NULL:
                memcpy(self.s.q, self.ahead, self.n * sizeof(double))
                status = self.of_start.outcome(self.s)
            while status == _ON_THE_WAY:
                status = self.of_start.advance(self.s)
            if status != _STARTED:
                return False
        if self.kernels.constraints == NULL:
            return True
        size = fmax(self.sizes.share * self.extent(), self.sizes.tolerance)
        if not self.scaled():
            return False
        for i in range(self.m):
            if not fabs(self.s.out[i] / self.s.out[self.m + i]) <= size:
                return False
        return True

    cdef bint started(self) noexcept nogil:
        """Write the start to the row of the state; return whether it is regular."""
        cdef double t = 0.0, size = 0.0, least
        cdef Py_ssize_t i, kept
        if not self.assembled():
            return False
        memset(&self.row[0], 0, self.row.shape[0] * sizeof(double))
        memcpy(&self.row[0], self.s.q, self.n * sizeof(double))
        if self.api.check(self.e, 0.0, &self.row[0]) != _DONE:
            return False
        for i in range(self.m):
            if self.e.dropped[i]:
                return False
        if self.kernels.mass != NULL:
            kept = self.of_start.velocities(self.s, &self.none_dropped[0])
            if kept < 0:
                return False
            for i in range(kept + self.sizes.prescribed):
                if not self.s.miss[i] <= self.consistent * self.s.fastest:
                    return False
            memcpy(&self.row[self.n], self.s.u, self.n * sizeof(double))
        if self.lines != NULL:
            self.lines(&t, &self.row[0], &self.row[self.n], self.e.p, self.s.work, &self.result[0])
            for i in range(self.n):
                size = fmax(size, fabs(self.row[i]))
            for i in range(self.springs):
                if not self.result[i] > self.near * size:
                    return False
        return True


cdef class LinkageRuns(Starts):
    """LinkageRuns of one linkage from its starts; one object per thread.

    The caller must repeat runs without a regular start, or without a regular end, to obtain the reason. ``alone``
    counts those that left their lane, or had none.

    Parameters
    ----------
    evaluator, equations, starter, ends, rounding, consistent, near
        As of :class:`Starts`.
    method, t0, t_end, rtol, atol, step, times, stabilisation, max_drift, max_step, places_only
        As of :class:`~symgen.runtime._core.Run`.
    most
        Largest number of steps of a run.
    lanes
        The :class:`Lanes` of the runs, for a method with fixed explicit steps or power series.
    """

    cdef Scheme scheme
    cdef scheme_t filled
    cdef task asked
    cdef run *core
    cdef Memory memory
    cdef kernel_t outputs
    cdef Py_ssize_t out, work, turns
    cdef const double[::1] times
    cdef long most
    cdef double[::1] solutions
    cdef Lanes lanes
    cdef Py_ssize_t width
    cdef readonly Py_ssize_t alone
    cdef double[::1] parameters, start
    cdef bint is_known, is_regular
    cdef const lane_runs_api *of_lanes
    cdef lane_runs *in_lanes
    cdef double[::1] lane_parameters, lane_states, lane_samples, lane_drifts
    cdef char[::1] failed, found

    def __init__(self, evaluator: Evaluator, KernelEquations equations, Starter starter, const Py_ssize_t[:, ::1] ends,
                 double rounding, double consistent, double near, method: Integrator, double t0, double t_end,
                 double rtol, double atol, double step, const double[::1] times, *, long stabilisation,
                 double max_drift, double max_step, bint places_only, long most, Lanes lanes=None):
        d, addresses = evaluator.description, evaluator.library.addresses
        Starts.__init__(self, evaluator, equations, starter, ends, rounding, consistent, near)
        self.turns, self.times, self.most = len(d.turns), times, most
        self.parameters, self.start = np.zeros(self.e.sizes.parameters + 1), np.zeros(self.row.shape[0])
        self.outputs = kernel_of(addresses, "outputs")
        if times.shape[0] == 0:
            raise ValueError("expected at least one recorded time")
        outputs = evaluator.find("outputs")
        self.out = outputs.out_size if outputs else 0
        self.work = self.n + self.m + self.e.sizes.couples + 1 if outputs and outputs.work_size else 0
        if outputs and outputs.work_size > self.work:
            raise ValueError("expected outputs that need accelerations and multipliers only")
        self.scheme = equations.of.scheme(method)
        self.filled = self.scheme.filled
        self.asked.t0, self.asked.t_end, self.asked.rtol, self.asked.atol = t0, t_end, rtol, atol
        self.asked.step, self.asked.max_drift, self.asked.stabilisation = step, max_drift, stabilisation
        self.asked.max_step, self.asked.places_only = max_step, places_only
        self.asked.samples = times.shape[0]
        self.solutions = np.zeros(times.shape[0] * self.work + 1)
        if lanes is not None:
            if self.turns or stabilisation or equations.core.sizes.series_watched or not (
                method.kind == "taylor" and lanes.sizes.series_rows and (step > 0.0) != (rtol > 0.0 or atol > 0.0)
                or method.kind == "explicit" and not (method.coefficients["same_as_last"] or rtol or atol or lanes.sizes.series_rows)
                and step > 0.0
            ):
                raise ValueError("expected power series or fixed explicit steps, with projection, for runs in lanes")
            lanes.bound(&self.filled, &self.asked)
            self.lanes, self.width, self.of_lanes, self.in_lanes = lanes, lanes.lanes, lanes.api, lanes.core
            self.lane_parameters, self.lane_states, self.lane_samples = lanes.rows, lanes.states, lanes.samples
            self.lane_drifts, self.failed, self.found = lanes.drifts, lanes.failed, lanes.found
        self.memory = memory_of(
            self.api.run_struct, self.api.run_bytes(equations.core, &self.scheme.filled, &self.asked)
        )
        self.core = <run *>self.memory.structure
        self.api.run_bind(self.core, equations.core, &self.scheme.filled, &self.asked, self.memory.at)

    cdef bint starts(self, const double *parameters) noexcept nogil:
        """Write the start with these parameters to the row of the state; return whether it is regular.

        Runs from states often have the parameters, and the start, of the run before.
        """
        cdef Py_ssize_t size = self.e.sizes.parameters * sizeof(double)
        if not self.is_known or memcmp(&self.parameters[0], parameters, size) != 0:
            self.renew(parameters)
            self.is_regular, self.is_known = self.started(), True
            memcpy(&self.parameters[0], parameters, size)
            memcpy(&self.start[0], &self.row[0], self.start.shape[0] * sizeof(double))
        memcpy(&self.row[0], &self.start[0], self.start.shape[0] * sizeof(double))
        return self.is_regular

    cdef bint ran(self, const double *parameters, const double *state, double *out, double *turns, double *drift) noexcept nogil:
        """Carry out one run; return whether it ended regularly."""
        cdef report r
        cdef const void *samples
        cdef long count = self.asked.samples
        if not self.starts(parameters):
            return False
        if state != NULL:
            memcpy(&self.row[0], state, 2 * self.n * sizeof(double))
        self.renew(parameters)
        memset(self.memory.at, 0, self.memory.bytes)
        self.api.run_bind(self.core, self.e, &self.filled, &self.asked, self.memory.at)
        self.api.run_start(self.core, &self.row[0], NULL, &self.times[0], NULL, NULL)
        if self.api.run_begin(self.core) != _MORE or self.api.run_advance(self.core, self.most) != _DONE:
            return False
        self.api.run_report(self.core, &r)
        if r.recorded != count or r.moved or r.passages:
            return False
        drift[0], drift[1] = r.position_drift, r.energy_drift
        if self.turns:
            memcpy(turns, self.core.turns, count * self.turns * sizeof(double))
        self.evaluate(self.core.samples, out)
        return True

    cdef void evaluate(self, const double *samples, double *out) noexcept nogil:
        """Evaluate the outputs at recorded states, with the parameters of the equations."""
        cdef long count = self.asked.samples, dim = 2 * self.n + self.e.sizes.extra
        if self.work:
            self.api.solve_rows(self.e, count, &self.times[0], samples, dim, &self.solutions[0], self.work)
        if self.out:
            self.api.call_rows(self.outputs, count, &self.times[0], samples, dim, self.n, self.e.p, &self.solutions[0],
                               self.work, out, self.out)

    cdef void ran_in_lanes(self, const double *variants, Py_ssize_t stride, const double *states, Py_ssize_t runs, double *out,
                           double *drifts, unsigned char *regular) noexcept nogil:
        """Carry out at most one run per lane; flag those that ended regularly."""
        cdef Py_ssize_t lane, usable = -1, count = self.times.shape[0], dim = 2 * self.n + self.e.sizes.extra
        cdef Py_ssize_t parameters = self.e.sizes.parameters
        for lane in range(runs):
            self.found[lane] = self.starts(variants + lane * stride)
            if self.found[lane]:
                if states != NULL:
                    memcpy(&self.row[0], states + lane * 2 * self.n, 2 * self.n * sizeof(double))
                memcpy(&self.lane_states[lane * dim], &self.row[0], dim * sizeof(double))
                memcpy(&self.lane_parameters[lane * parameters], variants + lane * stride, parameters * sizeof(double))
                usable = lane
        if usable < 0:
            return
        for lane in range(self.width):  # idle lanes repeat the last run
            if lane >= runs or not self.found[lane]:
                memcpy(&self.lane_states[lane * dim], &self.lane_states[usable * dim], dim * sizeof(double))
                memcpy(&self.lane_parameters[lane * parameters], &self.lane_parameters[usable * parameters],
                       parameters * sizeof(double))
        self.of_lanes.run(self.in_lanes, &self.lane_parameters[0], &self.lane_states[0], &self.times[0], self.most,
                          &self.lane_samples[0], &self.lane_drifts[0], &self.failed[0])
        for lane in range(runs):
            if self.found[lane] and not self.failed[lane]:
                self.renew(variants + lane * stride)
                self.evaluate(&self.lane_samples[lane * count * dim], out + lane * count * self.out)
                drifts[2 * lane], drifts[2 * lane + 1] = self.lane_drifts[2 * lane], self.lane_drifts[2 * lane + 1]
                regular[lane] = 1

    def carry_out(self, const double[:, ::1] variants,
                  states: Array | None = None) -> tuple[NDArray[np.bool_], Array, Array, Array]:
        """Carry out a run for every row of parameters, from its start or from a row of states (q, u).

        Returns
        -------
        tuple
            Which runs ended regularly; the output of the kernel 'outputs' (runs, samples, numbers);
            continuous angles of links (runs, samples, links); largest errors of constraints [m] and energy [J]
            (runs, 2).
        """
        cdef Py_ssize_t runs = variants.shape[0], i, count = self.times.shape[0], out = self.out, turns = self.turns
        cdef const double[:, ::1] rows
        cdef bint from_states = states is not None
        at_least("parameters", variants.shape[1], self.e.sizes.parameters)
        found, turned = np.empty((runs, count, out)), np.empty((runs, count, turns))
        drifts, regular = np.empty((runs, 2)), np.zeros(runs, dtype=np.uint8)
        cdef double[::1] to_found = np.zeros(1) if not found.size else found.reshape(-1)
        cdef double[::1] to_turned = np.zeros(1) if not turned.size else turned.reshape(-1)
        cdef double[:, ::1] to_drifts = drifts
        cdef unsigned char[::1] to_regular = regular
        if from_states:
            rows = states
            at_least("rows of states", rows.shape[0], runs)
            if rows.shape[1] != 2 * self.n:
                raise ValueError(f"expected states of {2 * self.n} numbers, got {rows.shape[1]}")
        with nogil:
            i = 0
            while self.width and i < runs and not interrupted():
                self.ran_in_lanes(&variants[i, 0], variants.shape[1], &rows[i, 0] if from_states else NULL,
                                  min(self.width, runs - i), &to_found[i * count * out], &to_drifts[i, 0], &to_regular[i])
                i += self.width
            for i in range(runs):
                if to_regular[i]:
                    continue
                if interrupted():
                    break
                self.alone += 1
                to_regular[i] = self.ran(&variants[i, 0], &rows[i, 0] if from_states else NULL, &to_found[i * count * out],
                                         &to_turned[i * count * turns], &to_drifts[i, 0])
        raise_failure()
        return regular.astype(bool), found, turned, drifts
