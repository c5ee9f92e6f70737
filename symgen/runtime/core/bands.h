/* Banded systems by Gauss's elimination with partial pivoting, in the storage of LAPACK.
 *
 * The matrix has n columns of 3*band + 1 entries, its diagonal at 2*band. Wide bands of doubles go to LAPACK where
 * it is given: for narrow ones it calls BLAS at every column, which takes twice as long as the arithmetic.
 */
#ifndef SYMGEN_BANDS_H
#define SYMGEN_BANDS_H

#include "real.h"

/* LAPACK's dgbtrf and dgbtrs, or NULL. */
struct lapack {
    void (*factor)(int *m, int *n, int *kl, int *ku, double *ab, int *ldab, int *pivots, int *info);
    void (*solve)(char *trans, int *n, int *kl, int *ku, int *nrhs, double *ab, int *ldab, int *pivots, double *b,
                  int *ldb, int *info);
};

/* Factorise in place; return zero, or the number from one of the column without a pivot. */
int factor_band(const struct lapack *lapack, int n, int band, real *a, int *pivots);

/* Solve for right sides in the columns of x, n reals each, in place, by the factors. */
void solve_band(const struct lapack *lapack, int n, int band, int columns, real *a, int *pivots, real *x);

#endif
