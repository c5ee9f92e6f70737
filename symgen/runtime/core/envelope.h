/* LU factorisation of sparse matrices without pivoting, in the envelope of a symmetric pattern.
 *
 * Row i of L and column i of U have the same entries, from `first[i]` to i - 1. If every multiplier is ordered after
 * the unknowns of its constraint, and W and J have full rank, no pivot of [W, J^T; J, 0] is zero. Complex numbers are
 * kept as two arrays, of real and of imaginary parts.
 */
#ifndef SYMGEN_ENVELOPE_H
#define SYMGEN_ENVELOPE_H

#include <stddef.h>

#include "real.h"

struct envelope {
    ptrdiff_t n;
    const ptrdiff_t *first; /* column of the first entry of each row of L */
    const ptrdiff_t *at;    /* start of each row, n + 1 numbers; the last is the number of entries of L */
};

/* Factorise in place; `imaginary` is NULL for real matrices. False without a pivot. */
int envelope_factor(const struct envelope *e, real *values, real *imaginary);

/* Solve in place by the factors. */
void envelope_solve(const struct envelope *e, const real *values, const real *imaginary, real *x, real *y);

#endif
