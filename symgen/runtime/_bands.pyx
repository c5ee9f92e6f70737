# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Banded systems by Gauss's elimination with partial pivoting, in the storage of LAPACK.

The matrix has n columns of 3*band + 1 entries, its diagonal at 2*band. Wide bands go to LAPACK, by the
addresses that SciPy publishes: nothing is linked at build time. For narrow ones LAPACK calls BLAS at every
column, which takes twice as long as the arithmetic.
"""

from cpython.pycapsule cimport PyCapsule_GetName, PyCapsule_GetPointer
from libc.math cimport fabs

from scipy.linalg import cython_lapack

ctypedef void (*gbtrf_t)(int *m, int *n, int *kl, int *ku, double *ab, int *ldab, int *pivots,
                         int *info) noexcept nogil
ctypedef void (*gbtrs_t)(char *trans, int *n, int *kl, int *ku, int *nrhs, double *ab, int *ldab, int *pivots,
                         double *b, int *ldb, int *info) noexcept nogil

# Bands from which on LAPACK works in blocks and is faster.
cdef int WIDE = 64


cdef void *address(str name) except NULL:
    capsule = cython_lapack.__pyx_capi__[name]
    return PyCapsule_GetPointer(capsule, PyCapsule_GetName(capsule))


cdef gbtrf_t gbtrf = <gbtrf_t>address("dgbtrf")
cdef gbtrs_t gbtrs = <gbtrs_t>address("dgbtrs")


cdef int factor_band(int n, int band, double *a, int *pivots) noexcept nogil:
    """Factorise in place; return zero, or the number from one of the column without a pivot."""
    cdef int i, j, k, below, best, last = 0, width = 3 * band + 1, info = 0
    cdef double factor, value
    cdef double *own
    cdef double *other
    if band >= WIDE:
        gbtrf(&n, &n, &band, &band, a, &width, pivots, &info)
        return info
    for k in range(n):
        own = a + <Py_ssize_t>k * width + 2 * band
        below, best = min(band, n - 1 - k), 0
        for i in range(1, below + 1):
            if fabs(own[i]) > fabs(own[best]):
                best = i
        pivots[k] = k + best
        if own[best] == 0.0:
            return k + 1
        last = max(last, min(k + band + best, n - 1))
        if best:
            for j in range(k, last + 1):
                other = a + <Py_ssize_t>j * width + 2 * band + k - j
                value, other[0] = other[0], other[best]
                other[best] = value
        factor = 1.0 / own[0]
        for i in range(1, below + 1):
            own[i] *= factor
        for j in range(k + 1, last + 1):
            other = a + <Py_ssize_t>j * width + 2 * band + k - j
            factor = other[0]
            if factor != 0.0:
                for i in range(1, below + 1):
                    other[i] -= factor * own[i]
    return 0


cdef void solve_band(int n, int band, int columns, double *a, int *pivots, double *x) noexcept nogil:
    """Solve for right sides in the columns of x, in place, by the factors."""
    cdef int c, i, k, width = 3 * band + 1, info = 0
    cdef double value
    cdef double *own
    cdef double *b
    if band >= WIDE:
        gbtrs("N", &n, &band, &band, &columns, a, &width, pivots, x, &n, &info)
        return
    for c in range(columns):
        b = x + <Py_ssize_t>c * n
        for k in range(n):
            own = a + <Py_ssize_t>k * width + 2 * band
            value = b[pivots[k]]
            b[pivots[k]], b[k] = b[k], value
            for i in range(1, min(band, n - 1 - k) + 1):
                b[k + i] -= value * own[i]
        for k in range(n - 1, -1, -1):
            own = a + <Py_ssize_t>k * width + 2 * band
            b[k] /= own[0]
            value = b[k]
            for i in range(max(-2 * band, -k), 0):
                b[k + i] -= value * own[i]
