# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""A closed loop behind function pointers: closure, rates and forces, without Python inside.

The screws of the variables that are solved for are one matrix of six rows: positions (Newton), velocities,
accelerations and the wrench that closes the loop all use its one factorisation. Angular and linear rows, and
angles and displacements, are made alike by a length, so that ranks do not depend on units.
"""

import numpy as np

from libc.float cimport DBL_EPSILON
from libc.math cimport INFINITY, fabs, fmax, isfinite
from libc.string cimport memset

from symgen.runtime._core cimport _DONE, _NOT_FINITE, _SINGULAR, kernel_of
from symgen.runtime._qr cimport MOST, ROWS, Factor, factorise_columns, solve_basic, solve_transposed

#: What closing and moving a loop may answer besides what the core answers.
OPEN, INCONSISTENT, POLE, BLIND = _OPEN, _INCONSISTENT, _POLE, _BLIND

# Defect of closure that rounding leaves at best, and the largest that is taken where it falls no further.
cdef double FINE = 4e-15
cdef double COARSE = 1e-12
cdef int NEWTON = 40
cdef int HALVINGS = 8
# Least part of the largest pivot: below, screws are dependent; below NO_DRIVE, a drive has no hold on a motion.
cdef double RANK = 1e-9
cdef double NO_DRIVE = 1e-9


cdef class LoopEquations(ForeignEquations):
    """The kernels of one loop with its parameters and scratch memory; one per thread of work.

    Parameters
    ----------
    addresses
        Address of each kernel by name; ``position`` is required.
    p
        Parameters.
    work_size, out_size
        Doubles of work that the largest kernel needs, and that the kernel 'outputs' writes.
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
    """

    def __init__(self, addresses, p, Py_ssize_t work_size, Py_ssize_t out_size, lengths, solved, inputs, unknown,
                 double size, Py_ssize_t rank):
        cdef Py_ssize_t n = len(lengths)
        if not addresses.get("position"):
            raise ValueError("a loop without the kernel 'position' cannot be solved")
        if n > MOST:
            raise ValueError(f"a loop has at most {MOST} variables, got {n}")
        self.inputs, self.position = kernel_of(addresses, "inputs"), kernel_of(addresses, "position")
        self.motion, self.inverse = kernel_of(addresses, "motion"), kernel_of(addresses, "inverse")
        self.given, self.mass_matrix = kernel_of(addresses, "given"), kernel_of(addresses, "mass_matrix")
        self.outputs, self.energy = kernel_of(addresses, "outputs"), kernel_of(addresses, "energy")
        self.n, self.m, self.extra, self.dim = n, ROWS, 1, 2 * n + 1
        self.p = np.array([*p, 0.0])
        self.solved = np.array([*solved, -1], dtype=np.intp)
        self.driven = np.array([*inputs, -1], dtype=np.intp)
        self.found = np.array([*(list(solved).index(i) for i in unknown if i in list(solved)), -1], dtype=np.intp)
        self.known = np.array([*(k for k, i in enumerate(inputs) if i not in list(unknown)), -1], dtype=np.intp)
        self.nf, self.ni, self.nx = len(solved), len(inputs), len(self.found) - 1
        self.told = out_size
        self.size, self.rank, self.free = size, rank, len(solved) - rank
        self.scale = np.where(np.asarray([*lengths, False]), size, 1.0)
        memory = max(work_size, n + ROWS, out_size, 2 * ROWS * n + 12, n * n) + 1
        self.work, self.work2, self.out, self.loads = (np.zeros(memory) for _ in range(4))
        self.screws = np.zeros(memory)
        self.matrix = np.zeros(ROWS * (n + 1))
        self.prescribed, self.efforts = np.zeros(3 * self.ni + 1), np.zeros(n + 1)
        self.q, self.u, self.trial, self.step = (np.zeros(n + 1) for _ in range(4))
        self.mass, self.reduced = np.zeros(n * n + 1), np.zeros((n + 1) * (n + 1))
        self.basis, self.gain = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        self.past, self.stride = np.zeros((3, n + 1)), 0.0
        self.energies, self.rhs = np.zeros(3), np.zeros(n + ROWS + 1)
        self.weakest, self.soundness, self.missed = -1, INFINITY, 0.0
        self.rank_tolerance = RANK

    # -- closure ---------------------------------------------------------------------------------------------

    cdef void _prescribe(self, double t, double *q) noexcept nogil:
        """Find value, rate and acceleration of every input, and put the values into q."""
        cdef Py_ssize_t k
        if self.ni == 0:
            return
        self.inputs(&t, q, q, &self.p[0], &self.work2[0], &self.prescribed[0])
        for k in range(self.ni):
            q[self.driven[k]] = self.prescribed[3 * k]

    cdef double _look(self, double t, const double *q) noexcept nogil:
        """Evaluate closure and screws at q and factorise; return the defect: of rotations, and lengths by size."""
        cdef Py_ssize_t i, k, n = self.n
        cdef double worst = 0.0, entry
        cdef double *found = &self.screws[0]
        self.position(&t, q, &self.u[0], &self.p[0], &self.work2[0], found)
        for i in range(12):
            entry = fabs(found[i]) / self.size if i % 4 == 3 else fabs(found[i])
            if not isfinite(entry):
                self.closure, self.soundness = entry, 0.0
                return entry
            worst = fmax(worst, entry)
        for k in range(self.nf):
            for i in range(ROWS):
                entry = found[12 + n * i + self.solved[k]] * self.scale[self.solved[k]]
                self.matrix[ROWS * k + i] = entry if i < 3 else entry / self.size
        factorise_columns(&self.matrix[0], self.nf, &self.factored)
        self.factorisations += 1
        self.soundness, self.weakest = 1.0, -1
        if self.rank > 0:
            self.weakest = self.solved[self.factored.order[self.rank - 1]]
            entry = fabs(self.factored.r[0])
            self.soundness = fabs(self.factored.r[(ROWS + 1) * (self.rank - 1)]) / entry if entry > 0.0 else 0.0
        self.closure = worst
        return worst

    cdef void _solve(self, double *b, double *x) noexcept nogil:
        """Solve screws x = b for the changes x of the variables, in their own units; b is as the screws are."""
        cdef Py_ssize_t k
        for k in range(3, ROWS):
            b[k] /= self.size
        solve_basic(&self.factored, self.rank, b, x)
        for k in range(self.nf):
            x[k] *= self.scale[self.solved[k]]

    cdef void _mismatch(self, double *b) noexcept nogil:
        """Write the twist that would close the loop: minus the small rotation, and the displacement at O."""
        cdef double *e = &self.screws[0]
        cdef double x = 0.5 * (e[9] - e[6]), y = 0.5 * (e[2] - e[8]), z = 0.5 * (e[4] - e[1])
        b[0], b[1], b[2] = -x, -y, -z
        b[3] = -e[3] + y * e[11] - z * e[7]
        b[4] = -e[7] + z * e[3] - x * e[11]
        b[5] = -e[11] + x * e[7] - y * e[3]

    cdef int _close(self, double t, double *q) noexcept nogil:
        """Close the loop at t by Newton's method from q; the factor of the solution is kept."""
        cdef Py_ssize_t k
        cdef int turn, halved = 0
        cdef double defect, before = INFINITY, part = 1.0, fine = FINE, coarse = COARSE
        cdef double b[6]
        cdef double x[MOST]
        self._prescribe(t, q)
        # An angle of many turns cannot be told finer than its own last digit.
        for k in range(self.n):
            fine = fmax(fine, 2.0 * DBL_EPSILON * fabs(q[k]) / self.scale[k])
        coarse = fmax(coarse, 8.0 * fine)
        for turn in range(NEWTON):
            self.iterations = turn + 1
            defect = self._look(t, q)
            if not isfinite(defect):
                return _NOT_FINITE
            if defect <= fine:
                return _DONE
            if defect > 0.5 * before and fmax(before, defect) <= coarse:
                if defect > before:
                    for k in range(self.nf):
                        q[self.solved[k]] = self.trial[k]
                    self._look(t, q)
                return _DONE
            if defect > before and halved < HALVINGS:
                halved += 1
                part *= 0.5
                for k in range(self.nf):
                    q[self.solved[k]] = self.trial[k] + part * self.step[k]
                continue
            before, part, halved = defect, 1.0, 0
            self._mismatch(b)
            self._solve(b, x)
            for k in range(self.nf):
                if not isfinite(x[k]):
                    return _SINGULAR
                # A step of more than a radian leaves what its linear prediction is good for.
                part = fmax(part, fabs(x[k]) / self.scale[self.solved[k]])
            part = 1.0 / part
            for k in range(self.nf):
                self.trial[k], self.step[k] = q[self.solved[k]], x[k]
                q[self.solved[k]] += part * x[k]
        return _DONE if self.closure <= coarse else _OPEN

    # -- rates -----------------------------------------------------------------------------------------------

    cdef double _leftover(self, const double *b, double size) noexcept nogil:
        """Return what no motion of the solved variables gives, over the size of what was asked."""
        cdef Py_ssize_t k
        cdef double worst = 0.0
        for k in range(self.rank, ROWS):
            if not fabs(b[k]) <= worst:
                worst = fabs(b[k])
        return worst / size if size > 0.0 else 0.0

    cdef double _changes(self, Py_ssize_t which, const double *drift, double *b, double *v) noexcept nogil:
        """Find rates (which = 1) or accelerations (2) of all variables from those of the inputs and a drift."""
        cdef Py_ssize_t i, k, j, n = self.n
        cdef double rate, size = 0.0, left
        cdef double x[MOST]
        for i in range(ROWS):
            b[i] = -drift[i] if drift != NULL else 0.0
            size = fmax(size, fabs(b[i]) if i < 3 else fabs(b[i]) / self.size)
        for k in range(self.ni):
            j, rate = self.driven[k], self.prescribed[3 * k + which]
            v[j] = rate
            size = fmax(size, fabs(rate) / self.scale[j])
            for i in range(ROWS):
                b[i] -= self.screws[12 + n * i + j] * rate
        self._solve(b, x)
        for k in range(self.nf):
            v[self.solved[k]] = x[k]
        left = self._leftover(b, size)
        return left

    cdef int _move(self, double t, const double *q, double *u, double *a) noexcept nogil:
        """Find rates and accelerations of all variables, with the factor at q."""
        cdef double b[6]
        if not self.soundness > RANK:
            return _SINGULAR
        self.rates_left = self._changes(1, NULL, b, u)
        if not self._finite(u, self.n):
            return _NOT_FINITE
        if not self.rates_left <= 1e-7:
            return _INCONSISTENT
        self.motion(&t, q, u, &self.p[0], &self.work2[0], &self.loads[0])
        self._changes(2, &self.loads[ROWS * self.n], b, a)
        return _DONE if self._finite(a, self.n) else _NOT_FINITE

    cdef bint _finite(self, const double *v, Py_ssize_t count) noexcept nogil:
        cdef Py_ssize_t i
        for i in range(count):
            if not isfinite(v[i]):
                return False
        return True

    # -- forces ----------------------------------------------------------------------------------------------

    cdef double _power(self, Py_ssize_t j, const double *w) noexcept nogil:
        """Return the reciprocal product of variable j's screw with a wrench (force, moment)."""
        cdef Py_ssize_t i
        cdef double total = 0.0
        for i in range(3):
            total += self.screws[12 + self.n * i + j] * w[3 + i] + self.screws[12 + self.n * (3 + i) + j] * w[i]
        return total

    cdef void _hold(self, const double *b, double *w) noexcept nogil:
        """Write the wrench (force, moment) of least norm that gives these efforts at the solved variables."""
        cdef Py_ssize_t k
        cdef double c[MOST]
        cdef double s[6]
        for k in range(self.nf):
            c[k] = b[k] * self.scale[self.solved[k]]
        solve_transposed(&self.factored, self.rank, c, s)
        for k in range(3):
            w[k], w[3 + k] = s[3 + k] / self.size, s[k]

    cdef int _force(self, double t, const double *q, const double *u, double *work) noexcept nogil:
        """Find the closing wrench, behind the accelerations in ``work``."""
        cdef Py_ssize_t i, k, x, j, n = self.n
        cdef double b[MOST]
        cdef double c[6]
        cdef double moved[MOST]
        if self.inverse == NULL:
            return _DONE
        self.inverse(&t, q, u, &self.p[0], work, &self.loads[0])
        memset(&self.efforts[0], 0, n * sizeof(double))
        if self.given != NULL:
            self.given(&t, q, u, &self.p[0], work, &self.efforts[0])
        for k in range(self.nf):
            b[k] = self.efforts[self.solved[k]] - self.loads[self.solved[k]]
        self._hold(b, work + n)
        self.hold = 1.0
        if self.nx == 0:
            return _DONE
        # gain[x, i]: how much the variable of unknown effort x moves with the input i of known effort. The
        # unknown efforts E balance what the inputs need beyond what they are given: gain^T E = needed - given.
        for i in range(self.nx):
            j = self.driven[self.known[i]]
            for k in range(ROWS):
                c[k] = -self.screws[12 + n * k + j]
            self._solve(c, moved)
            for x in range(self.nx):
                k = self.found[x]
                self.gain[i, x] = moved[k]
            self.gain[i, self.nx] = self.loads[j] + self._power(j, work + n) - self.efforts[j]
        self.hold = self._eliminate(self.nx)
        if not fabs(self.hold) > NO_DRIVE:
            return _POLE
        for k in range(self.nf):
            for x in range(self.nx):
                if self.found[x] == k:
                    b[k] += self.gain[x, self.nx]
        self._hold(b, work + n)
        return _DONE

    cdef double _eliminate(self, Py_ssize_t m) noexcept nogil:
        """Solve the m equations in ``gain`` in place; return their determinant, with rates made alike."""
        cdef Py_ssize_t i, j, k, best
        cdef double factor, product = 1.0
        for k in range(m):
            best = k
            for i in range(k + 1, m):
                if fabs(self.gain[i, k]) > fabs(self.gain[best, k]):
                    best = i
            if best != k:
                product = -product
                for j in range(m + 1):
                    factor = self.gain[k, j]
                    self.gain[k, j] = self.gain[best, j]
                    self.gain[best, j] = factor
            product *= self.gain[k, k] / self.scale[self.solved[self.found[k]]] * self.scale[self.driven[self.known[k]]]
            for i in range(k + 1, m):
                factor = self.gain[i, k] / self.gain[k, k]
                for j in range(k, m + 1):
                    self.gain[i, j] -= factor * self.gain[k, j]
        for k in range(m - 1, -1, -1):
            self.gain[k, m] /= self.gain[k, k]
            for i in range(k):
                self.gain[i, m] -= self.gain[i, k] * self.gain[k, m]
        return product

    # -- what Python asks ------------------------------------------------------------------------------------

    def close(self, double t, double[::1] q):
        """Close the loop at t by Newton's method from q, in place; return the status."""
        return self._close(t, &q[0])

    def closed_screws(self, double t, const double[::1] q):
        """Return the screws of all variables at q, shape (6, n), and the defect of closure there."""
        cdef double defect = self._look(t, &q[0])
        return np.array(self.screws[12 : 12 + ROWS * self.n]).reshape(ROWS, self.n), defect
