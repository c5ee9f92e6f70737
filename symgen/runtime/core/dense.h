/* Small dense linear systems in the core's number type: LU with partial pivoting, row by row.
 *
 * Complex numbers are pairs (real part, imaginary part), so that every number type has them.
 */
#ifndef SYMGEN_DENSE_H
#define SYMGEN_DENSE_H

#include "real.h"

/* Factorise a, n by n, in place; swaps (n reals) gets the rows that were exchanged. Returns 0 when singular or not
 * finite, else 1. */
int factor_dense(long n, real *a, real *swaps);

/* Solve with that factorisation, b in place. */
void solve_dense(long n, const real *a, const real *swaps, real *b);

/* The same for complex a (n by n pairs) and b (n pairs). */
int factor_complex(long n, real *a, real *swaps);
void solve_complex(long n, const real *a, const real *swaps, real *b);

#endif
