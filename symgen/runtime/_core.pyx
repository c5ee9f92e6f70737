# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Compiled step loops over kernel function pointers: nothing of Python runs inside a step."""

import numpy as np

from libc.math cimport INFINITY, fabs, fmax, fmin, isfinite, nextafter, pow, sqrt
from libc.stdint cimport uintptr_t
from libc.string cimport memcpy, memset

ctypedef void (*kernel_t)(const double *, const double *, const double *, const double *, double *, double *) noexcept nogil

#: What :meth:`Stepper.advance` answers.
DONE, MORE, NOT_FINITE, STEP_TOO_SMALL, SINGULAR, PROJECTION_FAILED = range(6)

cdef int _DONE = 0, _MORE = 1, _NOT_FINITE = 2, _STEP_TOO_SMALL = 3, _SINGULAR = 4, _PROJECTION_FAILED = 5

cdef double EPS = 2.220446049250313e-16
# A multiplier's pivot that lost this much against its own-signed terms means lost rank (tested per step).
cdef double RANK_TOLERANCE = 1e-9
# Iterations of the projection: with the same factor it converges by the step's own error each time.
cdef int PROJECTIONS = 10


cdef kernel_t _kernel(object addresses, str name):
    return <kernel_t><uintptr_t>addresses.get(name, 0)


def call(uintptr_t address, const double[::1] t, const double[::1] q, const double[::1] u, const double[::1] p,
         double[::1] work, double[::1] out):
    """Call one kernel with arrays of at least the sizes it needs (not checked here)."""
    (<kernel_t>address)(&t[0], &q[0], &u[0], &p[0], &work[0], &out[0])


def call_many(uintptr_t address, uintptr_t first, const double[::1] t, const double[:, ::1] y, Py_ssize_t n,
              const double[::1] p, double[::1] scratch, double[::1] work, double[:, ::1] out):
    """Call a kernel for every row of ``y`` = (q, u, ...); ``first``, if given, fills ``work`` before each.

    ``scratch`` is the work memory of ``first``.
    """
    cdef Py_ssize_t i
    for i in range(y.shape[0]):
        if first:
            (<kernel_t>first)(&t[i], &y[i, 0], &y[i, n], &p[0], &scratch[0], &work[0])
        (<kernel_t>address)(&t[i], &y[i, 0], &y[i, n], &p[0], &work[0], &out[i, 0])


def call_repeatedly(uintptr_t address, Py_ssize_t times, const double[:, ::1] y, Py_ssize_t n, const double[::1] p,
                    double[::1] work, double[:, ::1] out):
    """Call a kernel ``times`` times over all rows of ``y``: for measuring it without Python around it."""
    cdef Py_ssize_t i, k
    cdef double t = 0.0
    with nogil:
        for k in range(times):
            for i in range(y.shape[0]):
                (<kernel_t>address)(&t, &y[i, 0], &y[i, n], &p[0], &work[0], &out[i, 0])


cdef class Equations:
    """The kernels of one model with its parameters and scratch memory; one per thread of work.

    Parameters
    ----------
    addresses
        Address of each kernel by name; ``accelerations`` and ``energy`` are required.
    n, m
        Number of coordinates and of constraints.
    extra
        1 when the work of loads without potential is integrated along, else 0.
    p
        Parameters.
    work_size
        Doubles of work memory that the largest kernel needs.
    first_pivot
        Where 'factor' leaves the pivots in its work memory.
    """

    cdef kernel_t accelerations, factor, solve, constraints, velocity_constraints, energy
    cdef readonly Py_ssize_t n, m, extra, dim
    cdef readonly long evaluations, factorisations
    cdef readonly Py_ssize_t weakest
    cdef readonly double soundness
    cdef Py_ssize_t first_pivot
    cdef double[::1] p, work, factors, out, rates, rhs, energies, before

    def __init__(self, addresses, Py_ssize_t n, Py_ssize_t m, Py_ssize_t extra, p, Py_ssize_t work_size,
                 Py_ssize_t first_pivot):
        self.accelerations = _kernel(addresses, "accelerations")
        self.factor = _kernel(addresses, "factor")
        self.solve = _kernel(addresses, "solve")
        self.constraints = _kernel(addresses, "constraints")
        self.velocity_constraints = _kernel(addresses, "velocity_constraints")
        self.energy = _kernel(addresses, "energy")
        if self.accelerations == NULL or self.energy == NULL:
            raise ValueError("a model without the kernels 'accelerations' and 'energy' cannot be stepped")
        self.n, self.m, self.extra, self.dim = n, m, extra, 2 * n + extra
        self.p = np.array([*p, 0.0])
        self.work, self.factors = np.zeros(work_size + 1), np.zeros(work_size + 1)
        self.out, self.rates = np.zeros(2 * (n + m) + 1), np.zeros(m + 1)
        self.rhs, self.before, self.energies = np.zeros(n + m + 1), np.zeros(n + 1), np.zeros(3)
        self.weakest, self.soundness, self.first_pivot = -1, INFINITY, first_pivot

    cdef void derivative(self, double t, const double *y, double *dy) noexcept nogil:
        """Write dy/dt of y = (q, u[, work done by loads without potential])."""
        cdef Py_ssize_t n = self.n
        self.accelerations(&t, y, y + n, &self.p[0], &self.work[0], &self.out[0])
        memcpy(dy, y + n, n * sizeof(double))
        memcpy(dy + n, &self.out[0], n * sizeof(double))
        if self.extra:
            self.energy(&t, y, y + n, &self.p[0], &self.out[0], &self.energies[0])
            dy[2 * n] = self.energies[2]
        self.evaluations += 1

    cdef double position_error(self, double t, const double *y) noexcept nogil:
        """Return the largest constraint error over its scale; leave -Phi in ``rhs``."""
        cdef Py_ssize_t i
        cdef double worst = 0.0, error
        self.constraints(&t, y, y + self.n, &self.p[0], &self.work[0], &self.out[0])
        memset(&self.rhs[0], 0, self.n * sizeof(double))
        for i in range(self.m):
            self.rhs[self.n + i] = -self.out[i]
            error = fabs(self.out[i]) / self.out[self.m + i]
            if not error <= worst:
                worst = error
        return worst

    cdef double velocity_error(self, double t, const double *y) noexcept nogil:
        """Return the largest constraint rate over its scale; leave its negative in ``rhs``.

        The scales are those that ``position_error`` left in ``out`` the call before.
        """
        cdef Py_ssize_t i
        cdef double worst = 0.0, error
        self.velocity_constraints(&t, y, y + self.n, &self.p[0], &self.work[0], &self.rates[0])
        memset(&self.rhs[0], 0, self.n * sizeof(double))
        for i in range(self.m):
            self.rhs[self.n + i] = -self.rates[i]
            error = fabs(self.rates[i]) / self.out[self.m + i]
            if not error <= worst:
                worst = error
        return worst

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Factorise at y and watch the pivots: their signs, and what cancellation left of them."""
        cdef Py_ssize_t i
        cdef double sign, ratio
        cdef bint finite = True
        cdef double *pivots = &self.factors[self.first_pivot]
        self.factor(&t, y, y + self.n, &self.p[0], &self.factors[0], &self.out[0])
        self.factorisations += 1
        self.weakest, self.soundness = -1, INFINITY
        for i in range(self.n + self.m):
            sign = 1.0 if i < self.n else -1.0
            # A pivot's own-signed terms, whose sum is never zero unless the unknown itself is undetermined.
            ratio = sign * pivots[2 * i] / fabs(pivots[2 * i + 1]) if pivots[2 * i + 1] != 0.0 else 0.0
            if not isfinite(ratio):
                finite = False
            elif ratio < self.soundness:
                self.weakest, self.soundness = i, ratio
        if self.soundness <= RANK_TOLERANCE:
            return _SINGULAR
        return _DONE if finite else _NOT_FINITE

    cdef int project(self, double t, double *y) noexcept nogil:
        """Bring positions and velocities back onto the constraints, by mass-weighted steps of one factor."""
        cdef Py_ssize_t i, n = self.n
        cdef int k, status
        cdef double worst, previous = INFINITY, size = 0.0
        if self.m == 0:
            return _DONE
        status = self.factorise(t, y)
        if status != _DONE:
            return status
        for i in range(n):
            size = fmax(size, fabs(y[i]))
        for k in range(PROJECTIONS):
            worst = self.position_error(t, y)
            if not isfinite(worst):
                return _NOT_FINITE
            if worst <= EPS * size:
                break
            if k and worst > 0.5 * previous:
                if worst > 1e4 * EPS * size:
                    return _PROJECTION_FAILED
                if worst > previous:
                    memcpy(y, &self.before[0], n * sizeof(double))
                    self.position_error(t, y)
                break
            previous = worst
            memcpy(&self.before[0], y, n * sizeof(double))
            self.solve(&t, y, y + n, &self.p[0], &self.factors[0], &self.rhs[0])
            for i in range(n):
                y[i] += self.rhs[i]
        previous = INFINITY
        for k in range(3):
            worst = self.velocity_error(t, y)
            if not isfinite(worst):
                return _NOT_FINITE
            if worst == 0.0 or worst > 0.5 * previous:
                break
            previous = worst
            self.solve(&t, y, y + n, &self.p[0], &self.factors[0], &self.rhs[0])
            for i in range(n):
                y[n + i] += self.rhs[i]
        return _DONE

    cdef void measure_energy(self, double t, const double *y) noexcept nogil:
        """Leave kinetic and potential energy, and the power of loads without potential, in ``energies``."""
        self.energy(&t, y, y + self.n, &self.p[0], &self.work[0], &self.energies[0])

    def project_state(self, double t, double[::1] y):
        """Project y = (q, u, ...) in place; return the status."""
        return self.project(t, &y[0])

    def check(self, double t, const double[::1] y):
        """Factorise at y; return the status, the unknown of least pivot in ``weakest``, and in ``soundness``
        what cancellation left of that pivot."""
        return self.factorise(t, &y[0])

    def errors(self, double t, const double[::1] y):
        """Return the largest error of a constraint and of its rate, each over the constraint's scale."""
        if self.m == 0:
            return 0.0, 0.0
        return self.position_error(t, &y[0]), self.velocity_error(t, &y[0])

    def energy_at(self, double t, const double[::1] y):
        """Return kinetic and potential energy, and the power of loads without potential."""
        self.measure_energy(t, &y[0])
        return self.energies[0], self.energies[1], self.energies[2]


cdef class Stepper:
    """An explicit Runge-Kutta run from t0 to t_end with projection after every step.

    Parameters
    ----------
    equations
        What is integrated.
    tableau
        An :class:`~symgen.runtime.integrators.tableau.ExplicitRungeKutta`.
    t0, y0, t_end
        Start and end of the run.
    rtol, atol
        Tolerances of the local error; both zero for a fixed step.
    step
        The fixed step, or the first one tried when the step is adapted (0: found by itself).
    times
        Increasing times in [t0, t_end] at which the state is recorded.
    """

    cdef Equations equations
    cdef readonly double t, t_end, h
    cdef double rtol, atol, first_step
    cdef bint adaptive
    cdef Py_ssize_t stages, all_stages, degree, error_rows
    cdef double exponent
    cdef double[:, ::1] a, e, dense, k, samples
    cdef double[::1] b, c, y, y_new, stage, times, error, weights
    cdef readonly Py_ssize_t recorded
    cdef readonly long steps, rejected
    cdef readonly double position_drift, velocity_drift, energy_drift
    cdef readonly double kinetic_min, kinetic_max, potential_min, potential_max
    cdef double energy_start

    def __init__(self, Equations equations, tableau, double t0, y0, double t_end, double rtol, double atol,
                 double step, times):
        self.equations = equations
        cdef Py_ssize_t dim = equations.dim
        self.t, self.t_end = t0, t_end
        self.rtol, self.atol, self.first_step = rtol, atol, step
        self.adaptive = rtol > 0 or atol > 0
        self.stages, self.all_stages = tableau.stages, tableau.all_stages
        self.a = np.ascontiguousarray(tableau.a)
        self.b, self.c = np.ascontiguousarray(tableau.b), np.ascontiguousarray(tableau.c)
        self.e, self.error_rows = np.ascontiguousarray(tableau.error), tableau.error.shape[0]
        self.dense, self.degree = np.ascontiguousarray(tableau.dense), tableau.dense.shape[1]
        self.exponent = -1.0 / (tableau.error_order + 1)
        self.k = np.zeros((self.all_stages + 1, dim + 1))
        self.y, self.y_new = np.array([*y0, 0.0]), np.zeros(dim + 1)
        self.stage, self.error, self.weights = np.zeros(dim + 1), np.zeros(dim + 1), np.zeros(self.all_stages + 1)
        self.times = np.ascontiguousarray([*times, INFINITY])
        self.samples = np.full((len(times) + 1, dim + 1), np.nan)
        self.h = step
        self.recorded = 0

    @property
    def result(self):
        """The recorded states, one row a time."""
        return np.asarray(self.samples)[: self.recorded, : self.equations.dim]

    @property
    def state(self):
        """The last accepted state."""
        return np.array(self.y)[: self.equations.dim]

    def begin(self):
        """Project and record the start, find the first step; return the status."""
        cdef int status = self.equations.project(self.t, &self.y[0])
        if status != _DONE:
            return status
        self.equations.derivative(self.t, &self.y[0], &self.k[0, 0])
        if not self._finite(&self.k[0, 0]):
            return _NOT_FINITE
        self.position_drift = self.velocity_drift = self.energy_drift = 0.0
        self.kinetic_min = self.potential_min = INFINITY
        self.kinetic_max = self.potential_max = -INFINITY
        self.energy_start = INFINITY
        self._monitor()
        while self.times[self.recorded] <= self.t:
            memcpy(&self.samples[self.recorded, 0], &self.y[0], self.equations.dim * sizeof(double))
            self.recorded += 1
        if self.adaptive and self.first_step == 0.0:
            self.h = self._first_step()
        return _MORE

    def advance(self, long most):
        """Take at most so many steps; return MORE, DONE or what went wrong."""
        cdef int status = _MORE
        cdef long k
        with nogil:
            for k in range(most):
                status = self._step()
                if status != _MORE:
                    break
        return status

    cdef bint _finite(self, const double *v) noexcept nogil:
        cdef Py_ssize_t i
        for i in range(self.equations.dim):
            if not isfinite(v[i]):
                return False
        return True

    cdef double _first_step(self):
        """Guess a first step from the size of the state and its first two derivatives (Hairer, II.4)."""
        cdef Py_ssize_t i, dim = self.equations.dim
        cdef double d0 = 0.0, d1 = 0.0, d2 = 0.0, scale, h0, h1
        for i in range(dim):
            scale = self.atol + fabs(self.y[i]) * self.rtol
            d0 += (self.y[i] / scale) ** 2
            d1 += (self.k[0, i] / scale) ** 2
        d0, d1 = sqrt(d0 / dim), sqrt(d1 / dim)
        h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        h0 = fmin(h0, self.t_end - self.t)
        for i in range(dim):
            self.stage[i] = self.y[i] + h0 * self.k[0, i]
        self.equations.derivative(self.t + h0, &self.stage[0], &self.k[1, 0])
        for i in range(dim):
            scale = self.atol + fabs(self.y[i]) * self.rtol
            d2 += ((self.k[1, i] - self.k[0, i]) / scale) ** 2
        d2 = sqrt(d2 / dim) / h0
        h1 = fmax(1e-6, h0 * 1e-3) if d1 <= 1e-15 and d2 <= 1e-15 else pow(0.01 / fmax(d1, d2), -self.exponent)
        return fmin(fmin(100 * h0, h1), self.t_end - self.t)

    cdef void _stage(self, Py_ssize_t s, double t, double h) noexcept nogil:
        """Fill stage s from the stages before it."""
        cdef Py_ssize_t i, j, dim = self.equations.dim
        cdef double factor
        memcpy(&self.stage[0], &self.y[0], dim * sizeof(double))
        for j in range(s):
            factor = h * self.a[s, j]
            if factor != 0.0:
                for i in range(dim):
                    self.stage[i] += factor * self.k[j, i]
        self.equations.derivative(t + self.c[s] * h, &self.stage[0], &self.k[s, 0])

    cdef double _error_norm(self, double h) noexcept nogil:
        """Root mean square of the local error over the tolerance; two rows are blended as in DOP853."""
        cdef Py_ssize_t i, r, j, dim = self.equations.dim
        cdef double scale, value, main = 0.0, second = 0.0, total
        for i in range(dim):
            scale = self.atol + self.rtol * fmax(fabs(self.y[i]), fabs(self.y_new[i]))
            for r in range(self.error_rows):
                value = 0.0
                for j in range(self.stages):
                    value += self.e[r, j] * self.k[j, i]
                value = h * value / scale
                if r == 0:
                    main += value * value
                else:
                    second += value * value
        if self.error_rows == 1:
            return sqrt(main / dim)
        total = main + 0.01 * second
        return main / sqrt(total * dim) if total > 0.0 else (0.0 if total == 0.0 else total)

    cdef int _step(self) noexcept nogil:
        """Take one accepted step."""
        cdef Py_ssize_t i, j, dim = self.equations.dim
        cdef double h, norm, factor, t_new, largest = 10.0
        cdef int status
        if self.t >= self.t_end:
            return _DONE
        while True:
            h = self.h
            if not h > 10.0 * EPS * fmax(fabs(self.t), EPS * self.t_end):
                return _STEP_TOO_SMALL
            t_new = self.t + h
            if t_new >= self.t_end or self.t_end - t_new < 1e-9 * h:
                t_new = self.t_end
                h = t_new - self.t
            for j in range(1, self.stages):
                self._stage(j, self.t, h)
            memcpy(&self.y_new[0], &self.y[0], dim * sizeof(double))
            for j in range(self.stages):
                factor = h * self.b[j]
                if factor != 0.0:
                    for i in range(dim):
                        self.y_new[i] += factor * self.k[j, i]
            if not self.adaptive:
                if not self._finite(&self.y_new[0]):
                    return _NOT_FINITE
                break
            norm = self._error_norm(h)
            if isfinite(norm) and norm <= 1.0:
                factor = largest if norm == 0.0 else fmin(largest, fmax(0.2, 0.9 * pow(norm, self.exponent)))
                if h == self.h or factor < 1.0:
                    self.h = h * factor
                break
            self.rejected += 1
            largest = 1.0
            self.h = h * fmax(0.2, 0.9 * pow(norm, self.exponent)) if isfinite(norm) else 0.2 * h
        status = self.equations.project(t_new, &self.y_new[0])
        if status != _DONE:
            return status
        # The derivative at the projected end closes the interpolant and is the first stage of the next step.
        self.equations.derivative(t_new, &self.y_new[0], &self.k[self.stages, 0])
        if not self._finite(&self.k[self.stages, 0]):
            return _NOT_FINITE
        status = self._record(t_new, h)
        if status != _DONE:
            return status
        memcpy(&self.y[0], &self.y_new[0], dim * sizeof(double))
        memcpy(&self.k[0, 0], &self.k[self.stages, 0], dim * sizeof(double))
        self.t = t_new
        self.steps += 1
        self._monitor()
        return _MORE

    cdef int _record(self, double t_new, double h) noexcept nogil:
        """Record the samples that lie in this step: interpolated, then projected."""
        cdef Py_ssize_t i, j, d, dim = self.equations.dim
        cdef double theta, power
        cdef double *sample
        cdef bint ready = False
        cdef int status
        while self.times[self.recorded] <= t_new:
            sample = &self.samples[self.recorded, 0]
            if self.times[self.recorded] == t_new:
                memcpy(sample, &self.y_new[0], dim * sizeof(double))
            else:
                if not ready:
                    for j in range(self.stages + 1, self.all_stages):
                        self._stage(j, self.t, h)
                    ready = True
                theta = (self.times[self.recorded] - self.t) / h
                memcpy(sample, &self.y[0], dim * sizeof(double))
                for j in range(self.all_stages):
                    power, self.weights[j] = theta * h, 0.0
                    for d in range(self.degree):
                        self.weights[j] += self.dense[j, d] * power
                        power *= theta
                    for i in range(dim):
                        sample[i] += self.weights[j] * self.k[j, i]
                status = self.equations.project(self.times[self.recorded], sample)
                if status != _DONE:
                    return status
            self.recorded += 1
        return _DONE

    cdef void _monitor(self) noexcept nogil:
        """Update the drift of constraints and energy with the state just accepted."""
        cdef double total
        cdef double *y = &self.y[0]
        cdef double *energies = &self.equations.energies[0]
        if self.equations.m:
            self.position_drift = fmax(self.position_drift, self.equations.position_error(self.t, y))
            self.velocity_drift = fmax(self.velocity_drift, self.equations.velocity_error(self.t, y))
        self.equations.measure_energy(self.t, y)
        total = energies[0] + energies[1] - (y[2 * self.equations.n] if self.equations.extra else 0.0)
        if self.energy_start == INFINITY:
            self.energy_start = total
        self.energy_drift = fmax(self.energy_drift, fabs(total - self.energy_start))
        self.kinetic_min = fmin(self.kinetic_min, energies[0])
        self.kinetic_max = fmax(self.kinetic_max, energies[0])
        self.potential_min = fmin(self.potential_min, energies[1])
        self.potential_max = fmax(self.potential_max, energies[1])
