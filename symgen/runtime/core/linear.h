/* Small dense linear systems in the core's number type. Matrices are stored row by row.
 *
 * Complex numbers are pairs (real part, imaginary part), so that every number type has them. Banded matrices are in
 * bands.h, the orthogonal factorisation of six rows in qr.h.
 */
#ifndef SYMGEN_LINEAR_H
#define SYMGEN_LINEAR_H

#include <stddef.h>

#include "real.h"

/* The largest magnitude; NaN if one of the values is NaN. */
real largest_or_nan(const real *values, ptrdiff_t count);

/* to += factor * from, for `count` numbers. */
void add_multiple(ptrdiff_t count, real factor, const real *from, real *to);

/* c = a b: a has `rows` rows of `inner` numbers, a `stride` from one row to the next, b and c have rows of `columns`. */
void multiply_dense(ptrdiff_t rows, ptrdiff_t inner, ptrdiff_t columns, const real *a, ptrdiff_t stride, const real *b,
                    real *c);

/* LU factorisation of a, n by n, in place, with partial pivoting; swaps (n) receives the row exchanged at each step.
 * Returns 0 where a pivot is zero or not finite, else 1. */
ptrdiff_t factor_dense(ptrdiff_t n, real *a, ptrdiff_t *swaps);

/* Solve in place with that factorisation: one right-hand side; with the transpose of a; or `wide` right-hand sides, a row
 * of b for each unknown. */
void solve_dense(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, real *b);
void solve_dense_transposed(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, real *b);
void solve_dense_wide(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, ptrdiff_t wide, real *b);

/* The same for complex a (n by n pairs) and b (n pairs). */
int factor_complex(ptrdiff_t n, real *a, ptrdiff_t *swaps);
void solve_complex(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, real *b);

/* Cholesky factorisation of a symmetric matrix, whose lower triangle is given, in place. Pivots are raised to `least`;
 * returns the first row whose pivot keeps at most `part` of its diagonal entry, or n. */
ptrdiff_t factor_positive(ptrdiff_t n, real *a, real part, real least);
void solve_positive(ptrdiff_t n, const real *a, real *b);

/* Write the minimum-norm x that minimises |A x - b|: Householder QR with column pivoting, and reflections from the
 * right if columns are dependent. A has `rows` by `columns` numbers, column by column; pivots of at most `part` of
 * the first count as zero. A and b are overwritten; order and beta have room for a number per column. Returns 0 where
 * columns are dependent. Source: G. H. Golub and C. F. Van Loan, Matrix Computations, 5.4 and 5.5. */
ptrdiff_t solve_least(ptrdiff_t rows, ptrdiff_t columns, real *a, real *b, real part, real *x, ptrdiff_t *order,
                      real *beta);

/* The least pivot over the first pivot of an elimination with complete pivoting, and its row. */
struct least_pivot {
    double part;
    ptrdiff_t row;
};

/* Choose `rows` independent columns of a (rows by columns, overwritten) by complete pivoting. Write their numbers to
   `chosen`, the other columns to `others`, which has room for all. Return 0 if the rows are dependent: a pivot is at
   most RANK_TOLERANCE times the first. */
int choose_columns(ptrdiff_t rows, ptrdiff_t columns, real *a, ptrdiff_t *chosen, ptrdiff_t *others,
                   struct least_pivot *least);

/* Whether all numbers are from 0 to below a limit: those of a restored memory may be any. */
static inline int all_below(ptrdiff_t count, const ptrdiff_t *numbers, ptrdiff_t limit) {
    for (ptrdiff_t i = 0; i < count; i++)
        if (numbers[i] < 0 || numbers[i] >= limit)
            return 0;
    return 1;
}

#endif
