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
# A coordinate's pivot that keeps no more than this of its own-signed terms has no mass. Much may cancel
# before: rods a million million times heavier than their neighbours leave 1e-12.
cdef double NO_MASS = 1e-15
# A run that passes a state whose least pivot keeps less than this has passed a loss of rank.
cdef double PASSAGE = 1e-6
# Below this, errors across the constraints are so much magnified that stages and error estimates are projected
# too: they vanish again when the end of the step is projected.
cdef double NEAR = 1e-2
cdef int REFINEMENTS = 2
# How often a sample is moved away from a loss of rank, each time by more.
cdef int SHIFTS = 24
# Iterations of the projection: with the same factor it converges by the step's own error each time.
cdef int PROJECTIONS = 10


cdef kernel_t _kernel(object addresses, str name):
    return <kernel_t><uintptr_t>addresses.get(name, 0)


def call(uintptr_t address, const double[::1] t, const double[::1] q, const double[::1] u, const double[::1] p,
         double[::1] work, double[::1] out):
    """Call one kernel with arrays of at least the sizes it needs (not checked here)."""
    (<kernel_t>address)(&t[0], &q[0], &u[0], &p[0], &work[0], &out[0])


def call_many(uintptr_t address, const double[::1] t, const double[:, ::1] y, Py_ssize_t n, const double[::1] p,
              double[:, ::1] work, double[:, ::1] out):
    """Call a kernel for every row of ``y`` = (q, u, ...) and of ``work``."""
    cdef Py_ssize_t i
    for i in range(y.shape[0]):
        (<kernel_t>address)(&t[i], &y[i, 0], &y[i, n], &p[0], &work[i, 0], &out[i, 0])


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
    rank_tolerance
        What a multiplier's pivot keeps at most of its own-signed terms where rank is lost; the kernels set such a
        multiplier to zero.
    redundant
        Number of constraints that follow from the others in every configuration: so many pivots must be lost.
    """

    cdef kernel_t accelerations, factor, solve, constraints, velocity_constraints, energy, residual
    cdef readonly Py_ssize_t n, m, extra, dim
    cdef readonly long evaluations, factorisations
    cdef readonly Py_ssize_t weakest
    cdef readonly double soundness, rank_tolerance
    cdef readonly Py_ssize_t lost, redundant
    cdef Py_ssize_t first_pivot
    cdef double[::1] p, work, factors, out, rates, rhs, energies, before, zero
    cdef char[::1] dropped

    def __init__(self, addresses, Py_ssize_t n, Py_ssize_t m, Py_ssize_t extra, p, Py_ssize_t work_size,
                 Py_ssize_t first_pivot, double rank_tolerance, Py_ssize_t redundant):
        self.accelerations = _kernel(addresses, "accelerations")
        self.factor = _kernel(addresses, "factor")
        self.solve = _kernel(addresses, "solve")
        self.constraints = _kernel(addresses, "constraints")
        self.velocity_constraints = _kernel(addresses, "velocity_constraints")
        self.energy = _kernel(addresses, "energy")
        self.residual = _kernel(addresses, "residual")
        if self.accelerations == NULL or self.energy == NULL:
            raise ValueError("a model without the kernels 'accelerations' and 'energy' cannot be stepped")
        self.n, self.m, self.extra, self.dim = n, m, extra, 2 * n + extra
        self.p = np.array([*p, 0.0])
        self.work, self.factors = np.zeros(work_size + 1), np.zeros(work_size + 1)
        self.out, self.rates = np.zeros(2 * (n + m) + 1), np.zeros(m + 1)
        self.rhs, self.before, self.energies = np.zeros(n + m + 1), np.zeros(n + 1), np.zeros(3)
        self.zero = np.zeros(n + 1)
        self.weakest, self.soundness, self.first_pivot = -1, INFINITY, first_pivot
        self.rank_tolerance = rank_tolerance
        self.lost, self.redundant, self.dropped = 0, redundant, np.zeros(m + 1, dtype=np.int8)

    cdef void accelerate(self, double t, const double *y) noexcept nogil:
        """Leave accelerations and multipliers in ``out``, refined where the model has a residual."""
        cdef Py_ssize_t i
        cdef int k
        self.accelerations(&t, y, y + self.n, &self.p[0], &self.work[0], &self.out[0])
        if self.residual == NULL:
            return
        for k in range(REFINEMENTS):
            self.residual(&t, y, y + self.n, &self.p[0], &self.out[0], &self.rhs[0])
            self.solve(&t, y, y + self.n, &self.p[0], &self.work[0], &self.rhs[0])
            for i in range(self.n + self.m):
                self.out[i] += self.rhs[i]

    cdef void derivative(self, double t, const double *y, double *dy) noexcept nogil:
        """Write dy/dt of y = (q, u[, work done by loads without potential])."""
        cdef Py_ssize_t n = self.n
        self.accelerate(t, y)
        memcpy(dy, y + n, n * sizeof(double))
        memcpy(dy + n, &self.out[0], n * sizeof(double))
        if self.extra:
            self.energy(&t, y, y + n, &self.p[0], &self.out[0], &self.energies[0])
            dy[2 * n] = self.energies[2]
        self.evaluations += 1

    cdef double position_error(self, double t, const double *y) noexcept nogil:
        """Return the largest error of an independent constraint over its scale; leave -Phi in ``rhs``."""
        cdef Py_ssize_t i
        cdef double worst = 0.0, error
        self.constraints(&t, y, y + self.n, &self.p[0], &self.work[0], &self.out[0])
        memset(&self.rhs[0], 0, self.n * sizeof(double))
        for i in range(self.m):
            self.rhs[self.n + i] = -self.out[i]
            error = fabs(self.out[i]) / self.out[self.m + i]
            if not error <= worst and not self.dropped[i]:
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
            if not error <= worst and not self.dropped[i]:
                worst = error
        return worst

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Factorise at y and watch the pivots: their signs, and what cancellation left of them.

        As many multipliers as there are redundant constraints must be lost, no more and no fewer.
        """
        cdef Py_ssize_t i
        cdef double sign, ratio
        cdef bint finite = True
        cdef double *pivots = &self.factors[self.first_pivot]
        self.factor(&t, y, y + self.n, &self.p[0], &self.factors[0], &self.out[0])
        self.factorisations += 1
        self.weakest, self.soundness, self.lost = -1, INFINITY, 0
        for i in range(self.n + self.m):
            sign = 1.0 if i < self.n else -1.0
            # A pivot's own-signed terms, whose sum is never zero unless the unknown itself is undetermined.
            ratio = sign * pivots[2 * i] / fabs(pivots[2 * i + 1]) if pivots[2 * i + 1] != 0.0 else 0.0
            if i >= self.n:
                self.dropped[i - self.n] = ratio <= self.rank_tolerance
            if not isfinite(ratio):
                finite = False
            elif i >= self.n and ratio <= self.rank_tolerance and self.lost < self.redundant:
                self.lost += 1
            elif i < self.n and ratio <= NO_MASS:
                self.weakest, self.soundness = i, ratio
                return _SINGULAR
            elif i >= self.n and ratio < self.soundness:
                self.weakest, self.soundness = i, ratio
        if not finite:
            return _NOT_FINITE
        return _SINGULAR if self.soundness <= self.rank_tolerance or self.lost < self.redundant else _DONE

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

    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil:
        """Take from e, a change of q or of u at y, what the constraints do not allow, with the last factor."""
        cdef Py_ssize_t i, n = self.n
        self.velocity_constraints(&t, y, e, &self.p[0], &self.work[0], &self.rhs[n])
        self.velocity_constraints(&t, y, &self.zero[0], &self.p[0], &self.work[0], &self.rates[0])
        memset(&self.rhs[0], 0, n * sizeof(double))
        for i in range(self.m):
            self.rhs[n + i] = self.rates[i] - self.rhs[n + i]
        self.solve(&t, y, e, &self.p[0], &self.factors[0], &self.rhs[0])
        for i in range(n):
            e[i] += self.rhs[i]

    cdef void measure_energy(self, double t, const double *y) noexcept nogil:
        """Leave kinetic and potential energy, and the power of loads without potential, in ``energies``."""
        self.energy(&t, y, y + self.n, &self.p[0], &self.work[0], &self.energies[0])

    def solutions(self, const double[::1] t, const double[:, ::1] y):
        """Return accelerations and multipliers at every row of y = (q, u, ...)."""
        found = np.zeros((y.shape[0], self.n + self.m + 1))
        cdef double[:, ::1] rows = found
        cdef Py_ssize_t i
        for i in range(y.shape[0]):
            self.accelerate(t[i], &y[i, 0])
            memcpy(&rows[i, 0], &self.out[0], (self.n + self.m) * sizeof(double))
        return found

    def lost_rows(self):
        """Return the numbers of the constraints that the last factorisation found to follow from others."""
        return [i for i in range(self.m) if self.dropped[i]]

    def check(self, double t, const double[::1] y):
        """Factorise at y; return the status, the unknown of least pivot in ``weakest``, and in ``soundness``
        what cancellation left of that pivot."""
        return self.factorise(t, &y[0])


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
    cdef double[::1] b, c, y, y_new, stage, times, error, weights, y_old, k_old
    cdef double t_old, sound, sound_old
    cdef readonly list passages
    cdef readonly Py_ssize_t recorded, moved
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
        self.recorded = self.moved = 0
        self.y_old, self.k_old = np.zeros(dim + 1), np.zeros(dim + 1)
        self.t_old, self.sound, self.sound_old = t0, INFINITY, INFINITY
        self.passages = []

    @property
    def result(self):
        """The recorded states, one row a time."""
        return np.asarray(self.samples)[: self.recorded, : self.equations.dim]

    @property
    def sampled(self):
        """The times of the recorded states."""
        return np.array(self.times)[: self.recorded]

    @property
    def state(self):
        """The last accepted state."""
        return np.array(self.y)[: self.equations.dim]

    def begin(self):
        """Project and record the start, find the first step; return the status."""
        cdef int status = self.equations.project(self.t, &self.y[0])
        if status != _DONE:
            return status
        self.sound = self.equations.soundness
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
        if self.sound < NEAR:
            memcpy(&self.error[0], &self.stage[0], dim * sizeof(double))
            if self.equations.project(t + self.c[s] * h, &self.error[0]) == _DONE:
                memcpy(&self.stage[0], &self.error[0], dim * sizeof(double))
        self.equations.derivative(t + self.c[s] * h, &self.stage[0], &self.k[s, 0])

    cdef double _error_norm(self, double t_new, double h) noexcept nogil:
        """Root mean square of the local error over the tolerance; two rows are blended as in DOP853."""
        cdef Py_ssize_t i, r, j, dim = self.equations.dim
        cdef double factor, scale, main = 0.0, second = 0.0, total
        if self.sound < NEAR:
            self.equations.factorise(t_new, &self.y_new[0])
        for r in range(self.error_rows):
            memset(&self.error[0], 0, dim * sizeof(double))
            for j in range(self.stages):
                factor = h * self.e[r, j]
                for i in range(dim):
                    self.error[i] += factor * self.k[j, i]
            if self.sound < NEAR:
                self.equations.make_tangent(t_new, &self.y_new[0], &self.error[0])
                self.equations.make_tangent(t_new, &self.y_new[0], &self.error[self.equations.n])
            total = 0.0
            for i in range(dim):
                scale = self.atol + self.rtol * fmax(fabs(self.y[i]), fabs(self.y_new[i]))
                total += (self.error[i] / scale) ** 2
            if r == 0:
                main = total
            else:
                second = total
        if self.error_rows == 1:
            return sqrt(main / dim)
        total = main + 0.01 * second
        return main / sqrt(total * dim) if total > 0.0 else (0.0 if total == 0.0 else total)

    cdef int _step(self) noexcept nogil:
        """Take one accepted step."""
        cdef Py_ssize_t i, j, dim = self.equations.dim
        cdef double h, norm, factor, t_new, sound, largest = 10.0, part = 1.0
        cdef int status
        if self.t >= self.t_end:
            return _DONE
        while True:
            h = part * self.h
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
            else:
                norm = self._error_norm(t_new, h)
                if not (isfinite(norm) and norm <= 1.0):
                    self.rejected += 1
                    largest = 1.0
                    self.h = h * fmax(0.2, 0.9 * pow(norm, self.exponent)) if isfinite(norm) else 0.2 * h
                    continue
            status = self.equations.project(t_new, &self.y_new[0])
            if status == _DONE:
                break
            # A step that ends, or has a stage, where rank is lost for an instant is made a little shorter.
            part *= 0.7
            if status != _SINGULAR and (status != _PROJECTION_FAILED or self.sound >= NEAR) or part < 0.2:
                return status
            self.rejected += 1
        if self.adaptive:
            factor = largest if norm == 0.0 else fmin(largest, fmax(0.2, 0.9 * pow(norm, self.exponent)))
            if h == self.h or factor < 1.0:
                self.h = h * factor
        sound = self.equations.soundness
        # The derivative at the projected end closes the interpolant and is the first stage of the next step.
        self.equations.derivative(t_new, &self.y_new[0], &self.k[self.stages, 0])
        if not self._finite(&self.k[self.stages, 0]):
            return _NOT_FINITE
        status = self._record(t_new, h, sound)
        if status != _DONE:
            return status
        if self.sound <= self.sound_old and self.sound < sound and self.sound < 0.1:
            self._passage(t_new)
        memcpy(&self.y_old[0], &self.y[0], dim * sizeof(double))
        memcpy(&self.k_old[0], &self.k[0, 0], dim * sizeof(double))
        self.t_old, self.sound_old, self.sound = self.t, self.sound, sound
        memcpy(&self.y[0], &self.y_new[0], dim * sizeof(double))
        memcpy(&self.k[0, 0], &self.k[self.stages, 0], dim * sizeof(double))
        self.t = t_new
        self.steps += 1
        self._monitor()
        return _MORE

    cdef double _soundness(self, double t, double t_new) noexcept nogil:
        """Return the least pivot's part at a time of the last two steps, by cubic interpolation."""
        cdef Py_ssize_t i
        cdef bint last = t >= self.t
        cdef double start = self.t if last else self.t_old
        cdef double h = t_new - self.t if last else self.t - self.t_old
        cdef double s = (t - start) / h
        cdef double *y0 = &self.y[0] if last else &self.y_old[0]
        cdef double *y1 = &self.y_new[0] if last else &self.y[0]
        cdef double *d0 = &self.k[0, 0] if last else &self.k_old[0]
        cdef double *d1 = &self.k[self.stages, 0] if last else &self.k[0, 0]
        for i in range(self.equations.dim):
            self.stage[i] = (
                y0[i] + s * s * (3.0 - 2.0 * s) * (y1[i] - y0[i])
                + h * s * (1.0 - s) * ((1.0 - s) * d0[i] - s * d1[i])
            )
        self.equations.factorise(t, &self.stage[0])
        return self.equations.soundness

    cdef void _passage(self, double t_new) noexcept nogil:
        """Look where between the last three states the constraints come nearest to losing rank."""
        cdef double a = self.t_old, b = t_new, ratio = 0.6180339887498949
        cdef double x = b - ratio * (b - a), y = a + ratio * (b - a)
        cdef double at_x = self._soundness(x, t_new), at_y = self._soundness(y, t_new)
        cdef int k
        for k in range(50):
            if at_x < at_y:
                b, y, at_y = y, x, at_x
                x = b - ratio * (b - a)
                at_x = self._soundness(x, t_new)
            else:
                a, x, at_x = x, y, at_y
                y = a + ratio * (b - a)
                at_y = self._soundness(y, t_new)
        if fmin(at_x, at_y) < PASSAGE:
            with gil:
                self.passages.append((x, fmax(at_x, 0.0), self.equations.weakest))

    cdef int _record(self, double t_new, double h, double sound) noexcept nogil:
        """Record the samples that lie in this step: interpolated, then projected.

        A sample too near a loss of rank for its accelerations to mean anything is moved a little in time.
        """
        cdef Py_ssize_t j, k
        cdef double wanted, shift
        cdef double *sample
        cdef bint ready = False
        cdef int status
        while self.times[self.recorded] <= t_new:
            sample = &self.samples[self.recorded, 0]
            wanted = self.times[self.recorded]
            if wanted == t_new and sound >= PASSAGE:
                memcpy(sample, &self.y_new[0], self.equations.dim * sizeof(double))
                self.recorded += 1
                continue
            if not ready:
                for j in range(self.stages + 1, self.all_stages):
                    self._stage(j, self.t, h)
                ready = True
            for k in range(SHIFTS):
                self._interpolate(self.times[self.recorded], h, sample)
                status = self.equations.project(self.times[self.recorded], sample)
                if status == _DONE and self.equations.soundness >= PASSAGE:
                    break
                if status == _NOT_FINITE:
                    return status
                shift = 1e-4 * h * pow(2.0, k // 2) * (1.0 if k % 2 else -1.0)
                if (self.t < wanted + shift < t_new and wanted + shift < self.times[self.recorded + 1]
                        and (self.recorded == 0 or wanted + shift > self.times[self.recorded - 1])):
                    self.times[self.recorded] = wanted + shift
            else:
                if self.times[self.recorded + 1] <= t_new:
                    return _SINGULAR
                self.times[self.recorded] = t_new
                memcpy(sample, &self.y_new[0], self.equations.dim * sizeof(double))
            self.moved += self.times[self.recorded] != wanted
            self.recorded += 1
        return _DONE

    cdef void _interpolate(self, double t, double h, double *sample) noexcept nogil:
        """Write the interpolant of this step at a time."""
        cdef Py_ssize_t i, j, d, dim = self.equations.dim
        cdef double theta = (t - self.t) / h, power
        memcpy(sample, &self.y[0], dim * sizeof(double))
        for j in range(self.all_stages):
            power, self.weights[j] = theta * h, 0.0
            for d in range(self.degree):
                self.weights[j] += self.dense[j, d] * power
                power *= theta
            for i in range(dim):
                sample[i] += self.weights[j] * self.k[j, i]

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
