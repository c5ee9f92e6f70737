# cython: cdivision=True
"""Rank-revealing factorisation of six rows: Householder QR with column pivoting, A P = Q R.

Matrices are stored column by column, six doubles each. All loops over rows have the same length, which
compilers unroll: what a shorter loop would skip is zero. Source: G. H. Golub and C. F. Van Loan, *Matrix
Computations*, 5.4.2.
"""

from libc.math cimport fabs, sqrt

cdef enum:
    ROWS = 6
    #: Columns that fit the arrays of fixed size.
    MOST = 24

cdef struct Factor:
    double r[ROWS * MOST]
    double vectors[ROWS * ROWS]
    double beta[ROWS]
    Py_ssize_t order[MOST]
    Py_ssize_t columns
    Py_ssize_t steps


cdef inline double dot(const double *a, const double *b) noexcept nogil:
    """Return the product of two columns."""
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])


cdef inline void swap(double *a, double *b) noexcept nogil:
    """Exchange two columns."""
    cdef Py_ssize_t i
    cdef double kept
    for i in range(ROWS):
        kept = a[i]
        a[i] = b[i]
        b[i] = kept


cdef inline void factorise_columns(double *a, Py_ssize_t columns, Factor *f) noexcept nogil:
    """Factorise A, which is overwritten; ``f.order[k]`` is the column of A that came to place k."""
    cdef Py_ssize_t i, j, k, best
    cdef double norm, largest, total, factor
    cdef double *v
    f.columns, f.steps = columns, columns if columns < ROWS else ROWS
    for j in range(columns):
        f.order[j] = j
    for k in range(f.steps):
        best, largest = k, -1.0
        for j in range(k, columns):
            total = dot(a + ROWS * j, a + ROWS * j)
            if total > largest:
                best, largest = j, total
        if best != k:
            f.order[k], f.order[best] = f.order[best], f.order[k]
            swap(a + ROWS * k, a + ROWS * best)
            swap(f.r + ROWS * k, f.r + ROWS * best)
        # v = x - norm e_k, scaled to v_k = 1; beta = 2/(v.v) = (norm - x_k)/norm.
        v = f.vectors + ROWS * k
        norm = sqrt(largest)
        if a[ROWS * k + k] > 0.0:
            norm = -norm
        f.r[ROWS * k + k], f.beta[k] = norm, 0.0
        if norm == 0.0:
            for i in range(ROWS):
                v[i] = 0.0
            continue
        total = a[ROWS * k + k] - norm
        factor = 1.0 / total
        for i in range(ROWS):
            v[i] = a[ROWS * k + i] * factor
        v[k], f.beta[k] = 1.0, -total / norm
        for j in range(k + 1, columns):
            total = f.beta[k] * dot(v, a + ROWS * j)
            for i in range(ROWS):
                a[ROWS * j + i] -= total * v[i]
            f.r[ROWS * j + k] = a[ROWS * j + k]
            a[ROWS * j + k] = 0.0


cdef inline void turn(const Factor *f, Py_ssize_t k, double *b) noexcept nogil:
    """Overwrite b by its k-th reflection."""
    cdef Py_ssize_t i
    cdef double total = f.beta[k] * dot(f.vectors + ROWS * k, b)
    for i in range(ROWS):
        b[i] -= total * f.vectors[ROWS * k + i]


cdef inline void solve_basic(const Factor *f, Py_ssize_t rank, double *b, double *x) noexcept nogil:
    """Write a least-squares solution of A x = b with at most ``rank`` nonzero entries; b is overwritten.

    Behind its first ``rank`` entries b then holds what is left of it, seen through Q^T.
    """
    cdef Py_ssize_t i, j, k
    for k in range(f.steps):
        turn(f, k, b)
    for k in range(rank - 1, -1, -1):
        b[k] /= f.r[ROWS * k + k]
        for i in range(k):
            b[i] -= f.r[ROWS * k + i] * b[k]
    for j in range(f.columns):
        x[f.order[j]] = b[j] if j < rank else 0.0


cdef inline void solve_transposed(const Factor *f, Py_ssize_t rank, const double *b, double *w) noexcept nogil:
    """Write the solution w of least norm of the ``rank`` independent equations of A^T w = b."""
    cdef Py_ssize_t i, k
    for k in range(ROWS):
        w[k] = 0.0
    for k in range(rank):
        w[k] = b[f.order[k]]
        for i in range(k):
            w[k] -= f.r[ROWS * k + i] * w[i]
        w[k] /= f.r[ROWS * k + k]
    for k in range(f.steps - 1, -1, -1):
        turn(f, k, w)
