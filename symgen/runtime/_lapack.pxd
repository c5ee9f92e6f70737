"""Routines of LAPACK, as SciPy carries them."""

ctypedef void (*gbtrf_t)(int *m, int *n, int *kl, int *ku, double *ab, int *ldab, int *pivots, int *info) noexcept nogil
ctypedef void (*gbtrs_t)(char *trans, int *n, int *kl, int *ku, int *nrhs, double *ab, int *ldab, int *pivots, double *b, int *ldb, int *info) noexcept nogil

cdef gbtrf_t gbtrf
cdef gbtrs_t gbtrs
