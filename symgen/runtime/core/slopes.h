/* The Jacobian of the accelerations by the generated kernel `tangent`, for implicit methods. */
#ifndef SYMGEN_SLOPES_H
#define SYMGEN_SLOPES_H

#include "run.h"

/* Write da/dq and da/du at y, n by n each, row by row. `values` is memory for the kernel's output.
 * Returns DONE or NOT_FINITE. */
int find_slopes(struct equations *e, real t, const real *y, real *values, real *by_q, real *by_u);

/* Project y onto the constraints and write dy/dt there. It then depends on the motion along the constraints only, and
   iterations without its slopes converge, unless the motion is stiff there. */
void derivative_along(struct run *run, real t, real *y, real *dy);

/* The matrix x^2 - x da/du - da/dq, n by n, for x real or complex (pairs): the system for dq after elimination of the
   rates from (x - d(u, a)/d(q, u)) (dq, du) = (r, s). */
void reduced_matrix(long n, real x, const real *by_q, const real *by_u, real *matrix);
void reduced_complex(long n, const real *x, const real *by_q, const real *by_u, real *matrix);

/* Solve this system in place, r = (r, s) of 2n, with the factorised matrix; pairs if complex. */
void solve_reduced(long n, real x, const real *by_u, const real *matrix, const ptrdiff_t *swaps, real *r);
void solve_reduced_complex(long n, const real *x, const real *by_u, const real *matrix, const ptrdiff_t *swaps, real *r);

/* Weights and nodes of Radau's method. */
void radau_scheme(real a[3][3], real c[3]);

#endif
