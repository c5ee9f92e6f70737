# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled step loop: nothing of Python runs inside a step."""

import numpy as np

from libc.float cimport DBL_EPSILON
from libc.math cimport INFINITY, fabs, fmax, fmin, isfinite, pow, sqrt
from libc.string cimport memcpy, memset

from symgen.runtime._core cimport (
    _DONE, _MORE, _NOT_FINITE, _PROJECTION_FAILED, _SINGULAR, _STEP_TOO_SMALL, Equations
)

# A run that passes a state whose least pivot keeps less than this has passed a loss of rank.
cdef double PASSAGE = 1e-6
# Below this, errors across the constraints are so much magnified that stages and error estimates are projected
# too: they vanish again when the end of the step is projected.
cdef double NEAR = 1e-2
# How often a sample is moved away from a loss of rank, each time by more.
cdef int SHIFTS = 24
# Looks at the pivots in each step.
cdef int LOOKS = 4


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
    cdef double t_old, sound, t_look, at_look, t_before, at_before
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
        self.t_old, self.sound = t0, INFINITY
        self.t_look = self.t_before = t0
        self.at_look = self.at_before = INFINITY
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
        self.sound = self.at_look = self.at_before = self.equations.soundness
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
            if not h > 10.0 * DBL_EPSILON * fmax(fabs(self.t), DBL_EPSILON * self.t_end):
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
        self._watch(t_new, sound)
        memcpy(&self.y_old[0], &self.y[0], dim * sizeof(double))
        memcpy(&self.k_old[0], &self.k[0, 0], dim * sizeof(double))
        self.t_old, self.sound = self.t, sound
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

    cdef void _watch(self, double t_new, double sound) noexcept nogil:
        """Follow the least pivot through the step, and look closer wherever it has a minimum.

        The last two looks before this one are (t_before, at_before) and (t_look, at_look).
        """
        cdef int k
        cdef double t, at
        if self.equations.m == 0 or self.sound == 1.0 and sound == 1.0:
            return
        for k in range(1, LOOKS + 1):
            t = self.t + k * (t_new - self.t) / LOOKS
            at = sound if k == LOOKS else self._soundness(t, t_new)
            if self.at_look <= self.at_before and self.at_look < at:
                self._passage(self.t_before, t, t_new)
            self.t_before, self.at_before = self.t_look, self.at_look
            self.t_look, self.at_look = t, at
        if t_new >= self.t_end and self.at_look < self.at_before:
            self._passage(self.t_before, t_new, t_new)
        self.equations.factorise(t_new, &self.y_new[0])

    cdef void _passage(self, double a, double b, double t_new) noexcept nogil:
        """Look where in these looks the constraints come nearest to losing rank."""
        cdef double ratio = 0.6180339887498949
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
