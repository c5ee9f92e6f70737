# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""A loop that moves under forces: what the step loop asks of its equations."""

from libc.math cimport INFINITY, fabs, fmax, isfinite, sqrt
from libc.string cimport memcpy, memset

from symgen.runtime._core cimport _DONE, _NOT_FINITE, _PROJECTION_FAILED, _SINGULAR
from symgen.runtime._loop cimport _OPEN, LoopEquations
from symgen.runtime._qr cimport MOST, ROWS

# Least inertia of a free motion over its own terms.
cdef double NO_MASS = 1e-13


cdef class MovingLoop(LoopEquations):
    """A loop solved for dependent and free variables; see :class:`LoopEquations` for the parameters."""

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Factorise the screws at y, with the inputs where they are prescribed."""
        memcpy(&self.q[0], y, self.n * sizeof(double))
        self._prescribe(t, &self.q[0])
        if not isfinite(self._look(t, &self.q[0])):
            return _NOT_FINITE
        return _SINGULAR if self.soundness <= self.rank_tolerance else _DONE

    cdef void accelerate(self, double t, const double *y) noexcept nogil:
        """Leave accelerations and the closing wrench in ``out``."""
        cdef Py_ssize_t i, j, k, n = self.n
        cdef double total
        cdef double b[MOST]
        cdef double *q = &self.q[0]
        cdef double *u = &self.u[0]
        cdef double *a = &self.out[0]
        self.factorise(t, y)
        memcpy(u, y + n, n * sizeof(double))
        for k in range(self.ni):
            u[self.driven[k]] = self.prescribed[3 * k + 1]
        self.motion(&t, q, u, &self.p[0], &self.work2[0], &self.loads[0])
        self._changes(2, &self.loads[ROWS * n], b, a)
        self.inverse(&t, q, u, &self.p[0], a, &self.loads[0])
        memset(&self.efforts[0], 0, n * sizeof(double))
        self.given(&t, q, u, &self.p[0], a, &self.efforts[0])
        if self.free:
            self.mass_matrix(&t, q, u, &self.p[0], a, &self.mass[0])
            self._span()
            if not self._balance():
                a[0] = INFINITY
                return
            for j in range(n):
                total = 0.0
                for k in range(self.free):
                    total += self.basis[k, j] * self.reduced[self.free * self.free + k]
                a[j] += total
                self.step[j] = total
            for i in range(n):
                for j in range(n):
                    self.loads[i] += self.mass[n * i + j] * self.step[j]
        for k in range(self.nf):
            b[k] = self.efforts[self.solved[k]] - self.loads[self.solved[k]]
        self._hold(b, a + n)

    cdef void _span(self) noexcept nogil:
        """Write into ``basis`` the motions that the closure leaves free, a row each, over all variables."""
        cdef Py_ssize_t i, k, f
        cdef double c[6]
        for f in range(self.free):
            for k in range(self.n):
                self.basis[f, k] = 0.0
            for i in range(self.rank):
                c[i] = -self.factored.r[ROWS * (self.rank + f) + i]
            for i in range(self.rank - 1, -1, -1):
                c[i] /= self.factored.r[ROWS * i + i]
                for k in range(i):
                    c[k] -= self.factored.r[ROWS * i + k] * c[i]
            for i in range(self.rank):
                k = self.solved[self.factored.order[i]]
                self.basis[f, k] = c[i] * self.scale[k]
            k = self.solved[self.factored.order[self.rank + f]]
            self.basis[f, k] = self.scale[k]

    cdef bint _balance(self) noexcept nogil:
        """Solve the equations of the free motions by Cholesky's method; False where one has no mass."""
        cdef Py_ssize_t i, j, k, d = self.free, n = self.n
        cdef double total, diagonal
        cdef double *r = &self.reduced[0]
        cdef double *z = r + d * d
        for i in range(d):
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total += self.mass[n * j + k] * self.basis[i, k]
                self.step[j] = total
            for k in range(i + 1):
                total = 0.0
                for j in range(n):
                    total += self.basis[k, j] * self.step[j]
                r[d * i + k] = total
            z[i] = 0.0
            for j in range(n):
                z[i] += self.basis[i, j] * (self.efforts[j] - self.loads[j])
        for i in range(d):
            for k in range(i + 1):
                total = r[d * i + k]
                diagonal = total
                for j in range(k):
                    total -= r[d * i + j] * r[d * k + j]
                if i > k:
                    r[d * i + k] = total / r[d * k + k]
                elif not total > NO_MASS * diagonal:
                    self.weakest = self.solved[self.factored.order[self.rank + i]]
                    return False
                else:
                    r[d * i + i] = sqrt(total)
        for i in range(d):
            for j in range(i):
                z[i] -= r[d * i + j] * z[j]
            z[i] /= r[d * i + i]
        for i in range(d - 1, -1, -1):
            for j in range(i + 1, d):
                z[i] -= r[d * j + i] * z[j]
            z[i] /= r[d * i + i]
        return True

    cdef double position_error(self, double t, const double *y) noexcept nogil:
        """Return the defect of closure [m]."""
        return self.size * self._look(t, y)

    cdef double velocity_error(self, double t, const double *y) noexcept nogil:
        """Return the largest rate of closure [m/s], with the screws that ``position_error`` left."""
        cdef Py_ssize_t i, j
        cdef double total, worst = 0.0
        for i in range(ROWS):
            total = 0.0
            for j in range(self.n):
                total += self.screws[12 + self.n * i + j] * y[self.n + j]
            worst = fmax(worst, fabs(total) * (self.size if i < 3 else 1.0))
        return worst

    cdef int project(self, double t, double *y) noexcept nogil:
        """Close the loop and its rates again, the inputs as prescribed."""
        cdef Py_ssize_t i, j, k, n = self.n
        cdef int status
        cdef double b[6]
        cdef double x[MOST]
        status = self._close(t, y)
        if status == _OPEN:
            return _PROJECTION_FAILED
        if status != _DONE:
            return status
        if self.soundness <= self.rank_tolerance:
            return _SINGULAR
        for k in range(self.ni):
            y[n + self.driven[k]] = self.prescribed[3 * k + 1]
        for i in range(ROWS):
            b[i] = 0.0
            for j in range(n):
                b[i] -= self.screws[12 + n * i + j] * y[n + j]
        self._solve(b, x)
        for k in range(self.nf):
            y[n + self.solved[k]] += x[k]
        return _DONE

    cdef void make_tangent(self, double t, const double *y, double *e) noexcept nogil:
        """Take from e, a change of q or of u at y, what closure does not allow, with the last factor."""
        cdef Py_ssize_t i, j, k
        cdef double b[6]
        cdef double x[MOST]
        for k in range(self.ni):
            e[self.driven[k]] = 0.0
        for i in range(ROWS):
            b[i] = 0.0
            for j in range(self.n):
                b[i] -= self.screws[12 + self.n * i + j] * e[j]
        self._solve(b, x)
        for k in range(self.nf):
            e[self.solved[k]] += x[k]

    cdef void measure_energy(self, double t, const double *y) noexcept nogil:
        """Leave kinetic and potential energy, and the power of what has no potential, in ``energies``.

        The closing wrench, which that power needs, is not found here: the power is not to be used.
        """
        self.energy(&t, y, y + self.n, &self.p[0], &self.out[0], &self.energies[0])
