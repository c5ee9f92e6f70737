/* Steps of a system by collocation at Gauss points.
 *
 * The equation of motion and the rates of the constraints hold at every Gauss point. At the end of a step, places and
 * rates are projected on the constraints along M^-1 J^T there, which keeps the order of both at twice the number of
 * stages: U. M. Ascher, L. R. Petzold, Projected implicit Runge-Kutta methods for differential-algebraic equations,
 * SIAM Journal on Numerical Analysis 28 (1991). In the eigenvectors of the matrix of coefficients the stages of
 * Newton's correction separate: see system_factor. One of each complex pair is solved.
 */
#ifndef SYMGEN_COLLOCATION_H
#define SYMGEN_COLLOCATION_H

#include "system.h"

struct collocation {
    const struct system *of;
    ptrdiff_t stages, pairs;
    real h;
    real close; /* largest last correction of the unknowns over their sizes, and of rates over the largest in the step */
    /* The method: rates of the stages by `a`, places by `aa`, ends by `b` and `ba`, at `c`. */
    const real *a, *aa, *b, *ba, *c;
    /* One of each pair of eigenvalues of `a` times h; eigenvectors (stages, pairs) and rows of their inverse (pairs,
       stages); complex, real before imaginary parts. */
    const real *eigenvalues, *vectors, *inverse;
    const real *scale; /* sizes of the unknowns */
    /* The motion at the end of the last step, with second rates and multipliers of its stages, the last of which are
       those of the end. `work`: see system_power, and of constraints. */
    real t, work;
    real *q, *v, *a_of, *lambda_of; /* unknowns; stages by unknowns, stages by multipliers */
    real *a_now, *lambda_now;       /* those at which the slopes in the middle of a step are taken */
    /* Scratch: of the stages and, one more row, of the end. */
    real *places, *rates, *errors, *still, *forces, *changes, *right, *times;
    real *factors, *metric; /* a real and an imaginary matrix for each pair; a real one */
    long steps, corrections;
};

/* Bytes of the arrays of these steps, and set their pointers. */
size_t collocation_bytes(const struct system *of, ptrdiff_t stages, ptrdiff_t pairs);
void collocation_bind(struct collocation *c, void *memory);

/* Take a step; `z` and `z_rates` are rows of prescribed numbers in its middle, at the stages and at its end. False where
   Newton's method does not converge, or a matrix has no pivot; the motion is then that before the step. */
int collocation_step(struct collocation *c, const real *z, const real *z_rates);

#endif
