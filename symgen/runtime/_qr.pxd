"""Rank-revealing factorisation of six rows: Householder QR with column pivoting, A P = Q R.

A matrix is stored column by column. Source: G. H. Golub and C. F. Van Loan, *Matrix Computations*, 5.4.2.
"""

from libc.math cimport fabs, sqrt

cdef enum:
    ROWS = 6
    #: Columns that fit the arrays of fixed size.
    MOST = 24


cdef inline void factor_columns(double *a, Py_ssize_t columns, Py_ssize_t *order, double *beta) noexcept nogil:
    """Overwrite A by R on and above the diagonal and the Householder vectors below it.

    ``beta[k]`` belongs to the vector (1, a[k+1:, k]); ``order[k]`` is the column of A that came to place k.
    """
    cdef Py_ssize_t i, j, k, best, steps = columns if columns < ROWS else ROWS
    cdef double norm, largest, head, total, swap, factor
    for j in range(columns):
        order[j] = j
    for k in range(steps):
        best, largest = k, -1.0
        for j in range(k, columns):
            total = 0.0
            for i in range(k, ROWS):
                total += a[ROWS * j + i] * a[ROWS * j + i]
            if total > largest:
                best, largest = j, total
        if best != k:
            order[k], order[best] = order[best], order[k]
            for i in range(ROWS):
                swap = a[ROWS * k + i]
                a[ROWS * k + i] = a[ROWS * best + i]
                a[ROWS * best + i] = swap
        norm = sqrt(largest)
        beta[k] = 0.0
        if not norm > 0.0:
            continue
        head = a[ROWS * k + k]
        if head > 0.0:
            norm = -norm
        # v = x - norm e_k, scaled to v_k = 1; beta = 2/(v.v) = (norm - head)/norm.
        factor = 1.0 / (head - norm)
        for i in range(k + 1, ROWS):
            a[ROWS * k + i] *= factor
        beta[k] = (norm - head) / norm
        a[ROWS * k + k] = norm
        for j in range(k + 1, columns):
            total = a[ROWS * j + k]
            for i in range(k + 1, ROWS):
                total += a[ROWS * k + i] * a[ROWS * j + i]
            total *= beta[k]
            a[ROWS * j + k] -= total
            for i in range(k + 1, ROWS):
                a[ROWS * j + i] -= total * a[ROWS * k + i]


cdef inline Py_ssize_t rank_of(const double *a, Py_ssize_t columns, double tolerance) noexcept nogil:
    """Return how many diagonal entries of R are above the tolerance, times the first."""
    cdef Py_ssize_t k, steps = columns if columns < ROWS else ROWS
    for k in range(steps):
        if not fabs(a[ROWS * k + k]) > tolerance * fabs(a[0]):
            return k
    return steps


cdef inline void turn_by_q(const double *a, const double *beta, Py_ssize_t steps, double *v) noexcept nogil:
    """Overwrite v by Q v."""
    cdef Py_ssize_t i, k
    cdef double total
    for k in range(steps - 1, -1, -1):
        total = v[k]
        for i in range(k + 1, ROWS):
            total += a[ROWS * k + i] * v[i]
        total *= beta[k]
        v[k] -= total
        for i in range(k + 1, ROWS):
            v[i] -= total * a[ROWS * k + i]


cdef inline void turn_by_qt(const double *a, const double *beta, Py_ssize_t steps, double *v) noexcept nogil:
    """Overwrite v by Q^T v."""
    cdef Py_ssize_t i, k
    cdef double total
    for k in range(steps):
        total = v[k]
        for i in range(k + 1, ROWS):
            total += a[ROWS * k + i] * v[i]
        total *= beta[k]
        v[k] -= total
        for i in range(k + 1, ROWS):
            v[i] -= total * a[ROWS * k + i]


cdef inline void back_substitute(const double *a, Py_ssize_t rank, double *c) noexcept nogil:
    """Overwrite c by the solution of R1 x = c, R1 the leading square of R."""
    cdef Py_ssize_t i, k
    for k in range(rank - 1, -1, -1):
        c[k] /= a[ROWS * k + k]
        for i in range(k):
            c[i] -= a[ROWS * k + i] * c[k]


cdef inline void solve_basic(const double *a, const double *beta, const Py_ssize_t *order, Py_ssize_t columns,
                             Py_ssize_t rank, double *b, double *x) noexcept nogil:
    """Write a least-squares solution of A x = b with at most ``rank`` nonzero entries; b is overwritten.

    Behind its first ``rank`` entries b then holds what is left of it, seen through Q^T.
    """
    cdef Py_ssize_t j
    turn_by_qt(a, beta, columns if columns < ROWS else ROWS, b)
    back_substitute(a, rank, b)
    for j in range(columns):
        x[order[j]] = b[j] if j < rank else 0.0


cdef inline void solve_transposed(const double *a, const double *beta, const Py_ssize_t *order, Py_ssize_t columns,
                                  Py_ssize_t rank, const double *b, double *w) noexcept nogil:
    """Write the solution w of least norm of the ``rank`` independent equations of A^T w = b."""
    cdef Py_ssize_t i, k
    for k in range(ROWS):
        w[k] = 0.0
    for k in range(rank):
        w[k] = b[order[k]]
        for i in range(k):
            w[k] -= a[ROWS * k + i] * w[i]
        w[k] /= a[ROWS * k + k]
    turn_by_q(a, beta, columns if columns < ROWS else ROWS, w)
