# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""A driven loop followed through values of its input, on one branch, without Python inside."""

from libc.math cimport fabs, fmax
from libc.string cimport memcpy

from symgen.runtime._core cimport _DONE, _NOT_FINITE, _SINGULAR
from symgen.runtime._loop cimport _BLIND, _OPEN, _POLE, LoopEquations
from symgen.runtime._qr cimport ROWS

# Closure to the last digit leaves a pose undetermined by its root where rank is lost: nearer to it than this,
# a pose has no rates and no forces that mean anything.
cdef double SIGHT = 1e-7
# Largest part of a predicted motion by which the solution may differ from the prediction.
cdef double ASTRAY = 0.2
# Longest step of a variable, in radians or sizes of the loop.
cdef double LONGEST = 0.5
# Columns of the diagnosis of a sample.
CLOSURE, RATES, SOUNDNESS, HOLD, STATUS = range(5)


cdef class LoopFollower(LoopEquations):
    """A loop whose other variables are all held or inputs; see :class:`LoopEquations` for the parameters."""

    def follow(self, double t, double[::1] q, const double[::1] times, double longest, double[:, ::1] states,
               double[:, ::1] out, double[:, ::1] diagnosis):
        """Follow the loop from a closed state (t, q) through monotone times; return the status and how many.

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
        cdef Py_ssize_t count = 0
        cdef int status
        cdef double at = t
        with nogil:
            status = self._follow(&at, &q[0], times, longest, states, out, diagnosis, &count)
        return status, count, at

    cdef int _follow(self, double *t, double *q, const double[::1] times, double longest, double[:, ::1] states,
                     double[:, ::1] out, double[:, ::1] diagnosis, Py_ssize_t *count) noexcept nogil:
        cdef Py_ssize_t i, n = self.n
        cdef int status
        cdef double *u = &self.u[0]
        cdef double *state
        cdef double b[6]
        self.stride = 0.0
        status = self._close(t[0], q)
        if status == _DONE:
            status = self._move(t[0], q, u, &self.work[0])
        if status != _DONE:
            return status
        for i in range(times.shape[0]):
            status = self._advance(t, q, times[i], longest)
            state = &states[i, 0]
            if status == _BLIND:
                memcpy(state, &self.q[0], n * sizeof(double))
                if self.outputs != NULL:
                    self.outputs(&times[i], &self.q[0], u, &self.p[0], &self.work[0], &out[i, 0])
                diagnosis[i, 0], diagnosis[i, 1], diagnosis[i, 2] = self.closure, 0.0, self.soundness
                diagnosis[i, 3], diagnosis[i, 4] = 0.0, status
                count[0] = i + 1
                continue
            if status != _DONE:
                return status
            memcpy(state, q, n * sizeof(double))
            memcpy(state + n, u, n * sizeof(double))
            status = self._force(t[0], q, u, &self.work[0])
            memcpy(state + 2 * n, &self.work[0], (n + ROWS) * sizeof(double))
            if self.outputs != NULL:
                self.outputs(t, q, u, &self.p[0], &self.work[0], &out[i, 0])
            if status != _POLE and not (self._finite(&self.work[0], n + ROWS) and self._finite(&out[i, 0], self.told)):
                return _NOT_FINITE
            diagnosis[i, 0], diagnosis[i, 1], diagnosis[i, 2] = self.closure, self.rates_left, self.soundness
            diagnosis[i, 3], diagnosis[i, 4] = self.hold, status
            count[0] = i + 1
        return _DONE

    cdef int _advance(self, double *t, double *q, double target, double longest) noexcept nogil:
        """Go to the target in steps whose prediction holds, on one branch.

        Where the screws lose rank at the target itself, answer BLIND: it is closed there in ``self.q``, and t
        and q stay at the step before.
        """
        cdef Py_ssize_t k, j
        cdef int status
        cdef double h = target - t[0], least = 1e-10 * longest, moved, astray, next
        cdef double *u = &self.u[0]
        cdef double *a = &self.work[0]
        cdef double *new = &self.q[0]
        if h == 0.0:
            return _DONE
        while True:
            if fabs(h) > longest:
                h = longest if h > 0.0 else -longest
            next = t[0] + h
            if fabs(target - next) < 1e-9 * fabs(h):
                next = target
            memcpy(new, q, self.n * sizeof(double))
            moved = self._predict(next - t[0], q, u, a)
            for k in range(self.nf):
                new[self.solved[k]] += self.rhs[k]
            status = self._close(next, new) if moved <= LONGEST else _OPEN
            if status == _DONE:
                astray = 0.0
                for k in range(self.nf):
                    j = self.solved[k]
                    astray = fmax(astray, fabs(new[j] - q[j] - self.rhs[k]) / self.scale[j])
                if astray > ASTRAY * moved + 1e-9:
                    status = _OPEN
                elif next == target and not self.soundness > SIGHT:
                    return _BLIND
                elif not self.soundness > self.rank_tolerance:
                    status = _SINGULAR
            if status == _DONE:
                memcpy(&self.past[0, 0], q, self.n * sizeof(double))
                memcpy(&self.past[1, 0], u, self.n * sizeof(double))
                memcpy(&self.past[2, 0], a, self.n * sizeof(double))
                self.stride = next - t[0]
                status = self._move(next, new, u, a)
                if status != _DONE:
                    return status
                memcpy(q, new, self.n * sizeof(double))
                t[0] = next
                if next == target:
                    return _DONE
                h = 2.0 * h if fabs(2.0 * h) < fabs(target - next) else target - next
                continue
            h *= 0.5
            if fabs(h) < least:
                return status if status in (_SINGULAR, _NOT_FINITE) else _OPEN

    cdef double _predict(self, double h, const double *q, const double *u, const double *a) noexcept nogil:
        """Predict the change over h into ``rhs``; return the largest, in radians or sizes of the loop.

        By Hermite's quintic through this state and the one before, unless that lies much nearer.
        """
        cdef Py_ssize_t k, j
        cdef double g = self.stride, s, e0, e1, e2, c3, c4, c5, largest = 0.0
        cdef bint two = g * h > 0.0 and fabs(h) <= 1.5 * fabs(g)
        for k in range(self.nf):
            j = self.solved[k]
            self.rhs[k] = h * (u[j] + 0.5 * h * a[j])
            if two:
                e0 = self.past[0, j] - q[j] + g * (u[j] - 0.5 * g * a[j])
                e1 = g * (self.past[1, j] - u[j] + g * a[j])
                e2 = g * g * (self.past[2, j] - a[j])
                c3 = -0.5 * (e2 + 20.0 * e0 + 8.0 * e1)
                c5 = e1 + 4.0 * e0 + c3
                c4 = e0 + c3 + c5
                s = h / g
                self.rhs[k] += s * s * s * (c3 + s * (c4 + s * c5))
            largest = fmax(largest, fabs(self.rhs[k]) / self.scale[j])
        return largest
