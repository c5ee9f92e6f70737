/* Banded systems by Gauss's elimination with partial pivoting.
 *
 * Wide bands of doubles go to LAPACK where it is given: for narrow ones it calls BLAS at every column, which takes
 * twice as long as the arithmetic.
 */
#ifndef SYMGEN_BANDS_H
#define SYMGEN_BANDS_H

#include <stddef.h>

#include "real.h"

/* Bands from which on LAPACK works in blocks and is faster. */
enum { WIDE = 64 };

/* Where a band matrix keeps its entries: (i, j) at `first` + i + j * `lead`, `size` numbers in all. */
struct band_store {
    ptrdiff_t first, lead, size;
};

/* LAPACK's band storage with room for the fill-in of pivoting, or full columns if they need less memory. */
static inline struct band_store band_store(ptrdiff_t n, ptrdiff_t band) {
    const ptrdiff_t width = 3 * band + 1;
    if (band < WIDE && n < width)
        return (struct band_store){0, n, n * n};
    return (struct band_store){2 * band, width - 1, n * width};
}

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
