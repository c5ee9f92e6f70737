"""Banded systems by Gauss's elimination with partial pivoting, in the storage of LAPACK."""

cdef int factor_band(int n, int band, double *a, int *pivots) noexcept nogil
cdef void solve_band(int n, int band, int columns, double *a, int *pivots, double *x) noexcept nogil
