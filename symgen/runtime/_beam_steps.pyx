# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Fixed steps of the elastic motion: implicit, of one linear system a step, and for many states at once."""

import numpy as np

from libc.math cimport isfinite
from libc.string cimport memcpy, memset

from symgen.runtime._bands cimport factor_band, solve_band
from symgen.runtime._beams cimport BeamEquations
from symgen.runtime._core cimport _DONE, _NOT_FINITE, _SINGULAR


cdef class BeamSteps:
    """Steps by collocation, or by a method with displacements and accelerations at both ends.

    Parameters
    ----------
    equations
        What is stepped.
    method
        A :class:`symgen.runtime.beam_methods.BeamMethod`.
    columns
        Number of states stepped together; the load acts on the first only.
    """

    cdef BeamEquations equations
    cdef Py_ssize_t columns, stages, entries, free, whole, band
    cdef double[:, ::1] a, abar
    cdef double[::1] b, bbar, c
    cdef bint collocated
    cdef double at, gamma, beta
    cdef double[2] inertia, rate, place
    cdef double[:, ::1] mass, damping, stiffness, load
    cdef double[::1] banded, rhs
    cdef int[::1] pivots
    cdef double[:, ::1] s, v, acc, p, pv, pa
    cdef readonly long steps

    def __init__(self, BeamEquations equations, method, Py_ssize_t columns):
        cdef Py_ssize_t k
        self.equations, self.columns = equations, columns
        self.whole, self.free = equations.whole, equations.whole - equations.m
        self.entries, self.stages = equations.entries, len(method.c)
        k = self.stages
        self.collocated = method.collocated
        self.a, self.abar = np.array(method.a), np.array(method.a) @ np.array(method.a)
        self.b, self.c = np.array(method.b), np.array(method.c)
        self.bbar = np.array(method.b) @ np.array(method.a)
        self.at, self.gamma, self.beta = method.at, method.gamma, method.beta
        self.inertia, self.rate, self.place = list(method.inertia), list(method.rate), list(method.place)
        self.band = equations.band * k + k - 1
        self.mass, self.damping, self.stiffness = (np.zeros((k, self.entries + 1)) for _ in range(3))
        self.load = np.zeros((k, self.free + 1))
        self.banded = np.zeros((3 * self.band + 1) * self.free * k)
        self.rhs = np.zeros(self.free * k * columns)
        self.pivots = np.zeros(self.free * k, dtype=np.intc)
        self.s, self.v, self.acc = (np.zeros((self.whole, columns)) for _ in range(3))
        self.p, self.pv, self.pa = (np.zeros((self.free, columns)) for _ in range(3))
        self.steps = 0

    def start(self, double t, s, v):
        """Take states (S, S'), each (unknowns, columns), at a time; return a status."""
        cdef int status = self.equations.assemble(t, True)
        if status != _DONE:
            return status
        self.s, self.v = np.array(s, dtype=float).reshape(self.whole, -1), np.array(v, dtype=float).reshape(self.whole, -1)
        self._choose()
        if not self.collocated:
            self._accelerations()
        return _DONE

    def advance(self, double t0, double t1, Py_ssize_t steps):
        """Step from t0 to t1; return a status of the core."""
        cdef Py_ssize_t k
        cdef double h = (t1 - t0) / steps
        cdef int status = _DONE
        with nogil:
            for k in range(steps):
                status = self._collocation(t0 + k * h, h) if self.collocated else self._one_step(t0 + k * h, h)
                if status != _DONE:
                    break
                self.steps += 1
        return status

    @property
    def displacements(self):
        """S of all unknowns, (unknowns, columns)."""
        return np.array(self.s)

    @property
    def rates(self):
        """S' of all unknowns, (unknowns, columns)."""
        return np.array(self.v)

    cdef void _choose(self) noexcept nogil:
        """Take from S and S' the unknowns that are free with the present choice."""
        cdef Py_ssize_t i, c, k
        for i in range(self.free):
            k = self.equations.independent[i] if self.equations.m else i
            for c in range(self.columns):
                self.p[i, c], self.pv[i, c], self.pa[i, c] = self.s[k, c], self.v[k, c], self.acc[k, c]

    cdef int _finish(self, double t) noexcept nogil:
        """Write S, S' and S'' from what is free, and choose anew what is free."""
        cdef Py_ssize_t n = self.whole * self.columns
        cdef int status
        if self.equations.m:
            status = self.equations.assemble(t, False)
            if status != _DONE:
                return status
        self.equations.expand(0, &self.p[0, 0], &self.pv[0, 0], &self.pa[0, 0], self.columns, &self.s[0, 0])
        self.equations.expand(1, &self.p[0, 0], &self.pv[0, 0], &self.pa[0, 0], self.columns, &self.v[0, 0])
        if not self.collocated:
            self.equations.expand(2, &self.p[0, 0], &self.pv[0, 0], &self.pa[0, 0], self.columns, &self.acc[0, 0])
        if not isfinite(self.s[0, 0]):
            return _NOT_FINITE
        if self.equations.m:
            status = self.equations._choose()
            if status != _DONE:
                return status
            self._choose()
        return _DONE

    cdef int _at(self, Py_ssize_t stage, double t) noexcept nogil:
        """Assemble at a time and keep it as a stage."""
        cdef int status = self.equations.assemble(t, False)
        if status == _DONE:
            memcpy(&self.mass[stage, 0], &self.equations.mass[0], self.entries * sizeof(double))
            memcpy(&self.damping[stage, 0], &self.equations.damping[0], self.entries * sizeof(double))
            memcpy(&self.stiffness[stage, 0], &self.equations.stiffness[0], self.entries * sizeof(double))
            memcpy(&self.load[stage, 0], &self.equations.load[0], self.free * sizeof(double))
        return status

    cdef int _solve(self, Py_ssize_t size) noexcept nogil:
        """Solve the banded system for all columns, in place."""
        if factor_band(size, self.band, &self.banded[0], &self.pivots[0]) != 0:
            return _SINGULAR
        solve_band(size, self.band, self.columns, &self.banded[0], &self.pivots[0], &self.rhs[0])
        return _DONE

    cdef int _collocation(self, double t, double h) noexcept nogil:
        """One step of Gauss collocation: accelerations at all stages from one system."""
        cdef Py_ssize_t i, j, e, r, q, c, k = self.stages, size = self.free * k, width = 3 * self.band + 1
        cdef Py_ssize_t row, column
        cdef double value, stage_h
        cdef int status
        for i in range(k):
            status = self._at(i, t + self.c[i] * h)
            if status != _DONE:
                return status
        memset(&self.banded[0], 0, width * size * sizeof(double))
        memset(&self.rhs[0], 0, size * self.columns * sizeof(double))
        for i in range(k):
            stage_h = self.c[i] * h
            for r in range(self.free):
                self.rhs[r * k + i] = self.load[i, r]
            for e in range(self.entries):
                r, q = self.equations.rows[e], self.equations.columns[e]
                row = r * k + i
                for j in range(k):
                    column = q * k + j
                    value = h * self.a[i, j] * self.damping[i, e] + h * h * self.abar[i, j] * self.stiffness[i, e]
                    if i == j:
                        value += self.mass[i, e]
                    self.banded[column * width + 2 * self.band + row - column] = value
                for c in range(self.columns):
                    self.rhs[c * size + row] -= (self.damping[i, e] * self.pv[q, c] + self.stiffness[i, e]
                                                 * (self.p[q, c] + stage_h * self.pv[q, c]))
        status = self._solve(size)
        if status != _DONE:
            return status
        for r in range(self.free):
            for c in range(self.columns):
                self.p[r, c] += h * self.pv[r, c]
                for j in range(k):
                    self.p[r, c] += h * h * self.bbar[j] * self.rhs[c * size + r * k + j]
                    self.pv[r, c] += h * self.b[j] * self.rhs[c * size + r * k + j]
        return self._finish(t + h)

    cdef int _one_step(self, double t, double h) noexcept nogil:
        """One step of a method with accelerations at both ends: Newmark's, generalized-alpha, Wilson's."""
        cdef Py_ssize_t e, r, q, c, width = 3 * self.band + 1
        cdef double value, old
        cdef int status = self._at(0, t + self.at * h)
        if status != _DONE:
            return status
        memset(&self.banded[0], 0, width * self.free * sizeof(double))
        memset(&self.rhs[0], 0, self.free * self.columns * sizeof(double))
        for r in range(self.free):
            self.rhs[r] = self.load[0, r]
        for e in range(self.entries):
            r, q = self.equations.rows[e], self.equations.columns[e]
            value = (self.inertia[1] * self.mass[0, e] + h * self.rate[1] * self.damping[0, e]
                     + h * h * self.place[1] * self.stiffness[0, e])
            self.banded[q * width + 2 * self.band + r - q] = value
            for c in range(self.columns):
                old = self.pa[q, c]
                self.rhs[c * self.free + r] -= (
                    self.inertia[0] * self.mass[0, e] * old
                    + self.damping[0, e] * (self.pv[q, c] + h * self.rate[0] * old)
                    + self.stiffness[0, e] * (self.p[q, c] + self.at * h * self.pv[q, c] + h * h * self.place[0] * old)
                )
        status = self._solve(self.free)
        if status != _DONE:
            return status
        for r in range(self.free):
            for c in range(self.columns):
                old, value = self.pa[r, c], self.rhs[c * self.free + r]
                self.p[r, c] += h * self.pv[r, c] + h * h * ((0.5 - self.beta) * old + self.beta * value)
                self.pv[r, c] += h * ((1 - self.gamma) * old + self.gamma * value)
                self.pa[r, c] = value
        return self._finish(t + h)

    cdef void _accelerations(self) noexcept nogil:
        """Find S'' of the start from the equations just assembled."""
        cdef Py_ssize_t i, r, c
        self.equations._factor_mass()
        for r in range(self.free):
            self.rhs[r] = self.equations.load[r]
            for c in range(1, self.columns):
                self.rhs[c * self.free + r] = 0.0
        for i in range(self.entries):
            r = self.equations.rows[i]
            for c in range(self.columns):
                self.rhs[c * self.free + r] -= (self.equations.damping[i] * self.pv[self.equations.columns[i], c]
                                                + self.equations.stiffness[i] * self.p[self.equations.columns[i], c])
        solve_band(self.free, self.equations.band, self.columns, &self.equations.banded[0],
                   &self.equations.pivots[0], &self.rhs[0])
        for r in range(self.free):
            for c in range(self.columns):
                self.pa[r, c] = self.rhs[c * self.free + r]
        self.equations.expand(2, &self.p[0, 0], &self.pv[0, 0], &self.pa[0, 0], self.columns, &self.acc[0, 0])
