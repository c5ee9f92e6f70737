# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""A closed loop behind function pointers: closure, rates, forces and motion, without Python inside.

The screws of the variables that are solved for are one matrix of six rows: positions (Newton), velocities,
accelerations and the wrench that closes the loop all use its one factorisation. Angular and linear rows, and
angles and displacements, are made alike by a length, so that ranks do not depend on units.
"""

import numpy as np

from libc.float cimport DBL_EPSILON
from libc.math cimport INFINITY, fabs, fmax, isfinite, sqrt
from libc.stdint cimport uintptr_t
from libc.string cimport memcpy, memset

from symgen.runtime._core cimport _DONE, _NOT_FINITE, _PROJECTION_FAILED, _SINGULAR, Equations, kernel_t
from symgen.runtime._qr cimport MOST, ROWS, Factor, factorise_columns, solve_basic, solve_transposed

#: What following a loop may answer besides what the core answers.
OPEN, INCONSISTENT, POLE, BLIND = 10, 11, 12, 13
cdef enum:
    _OPEN = 10
    _INCONSISTENT = 11
    _POLE = 12
    _BLIND = 13

# Defect of closure that rounding leaves at best, and the largest that is taken where it falls no further.
cdef double FINE = 4e-15
cdef double COARSE = 1e-12
cdef int NEWTON = 40
cdef int HALVINGS = 8
# Least part of the largest pivot: below, screws are dependent; below NO_DRIVE, a drive has no hold on a motion.
cdef double RANK = 1e-9
cdef double NO_DRIVE = 1e-9
# Closure to the last digit leaves a pose undetermined by its root where rank is lost: nearer to it than this,
# a pose has no rates and no forces that mean anything.
cdef double SIGHT = 1e-7
# Largest part of a predicted motion by which the solution may differ from the prediction.
cdef double ASTRAY = 0.2
# Least inertia of a free motion over its own terms.
cdef double NO_MASS = 1e-13
# Longest step of a variable, in radians or sizes of the loop.
cdef double LONGEST = 0.5
# Columns of the diagnosis of a sample.
CLOSURE, RATES, SOUNDNESS, HOLD, STATUS = range(5)


cdef kernel_t _kernel(object addresses, str name):
    return <kernel_t><uintptr_t>addresses.get(name, 0)


cdef class LoopEquations(Equations):
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

    cdef kernel_t inputs, position, motion, inverse, given, mass_matrix, outputs
    cdef Py_ssize_t nf, ni, nx, free, told
    cdef readonly Py_ssize_t rank
    cdef readonly double closure, rates_left, hold, size
    cdef readonly int iterations
    cdef Py_ssize_t[::1] solved, driven, found, known
    cdef double[::1] scale, screws, matrix, prescribed, efforts, loads, work2, q, u, trial, step, mass, reduced
    cdef double[:, ::1] basis, gain
    cdef Factor factored
    cdef double stride
    cdef double[:, ::1] past

    def __init__(self, addresses, p, Py_ssize_t work_size, Py_ssize_t out_size, lengths, solved, inputs, unknown,
                 double size, Py_ssize_t rank):
        cdef Py_ssize_t n = len(lengths)
        if not addresses.get("position"):
            raise ValueError("a loop without the kernel 'position' cannot be solved")
        if n > MOST:
            raise ValueError(f"a loop has at most {MOST} variables, got {n}")
        self.inputs, self.position = _kernel(addresses, "inputs"), _kernel(addresses, "position")
        self.motion, self.inverse = _kernel(addresses, "motion"), _kernel(addresses, "inverse")
        self.given, self.mass_matrix = _kernel(addresses, "given"), _kernel(addresses, "mass_matrix")
        self.outputs, self.energy = _kernel(addresses, "outputs"), _kernel(addresses, "energy")
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
                elif not self.soundness > RANK:
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

    # -- motion under forces: what the step loop asks --------------------------------------------------------

    cdef int factorise(self, double t, const double *y) noexcept nogil:
        """Factorise the screws at y, with the inputs where they are prescribed."""
        memcpy(&self.q[0], y, self.n * sizeof(double))
        self._prescribe(t, &self.q[0])
        if not isfinite(self._look(t, &self.q[0])):
            return _NOT_FINITE
        return _SINGULAR if self.soundness <= RANK else _DONE

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
        if self.soundness <= RANK:
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
