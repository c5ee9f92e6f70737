/* Derivatives of runs with explicit Runge-Kutta steps: the tangent of every step, and its transpose.
 *
 * The states between the steps of a run are its checkpoints: the stages of a step are evaluated again from the state
 * before it. With the residual R(q, u, p; w) of the equations of motion and its solution w = (a, lambda),
 *
 *     [M J^T; J 0] dw = R_q dq + R_u du + R_p dp
 *
 * at every stage, with the factorisation that its accelerations left. The projection at the end of a step is
 * differentiated as the mass-weighted projection of (dq, du) onto dPhi = 0 and d(dPhi/dt) = 0. */
#ifndef SYMGEN_VARIATIONS_H
#define SYMGEN_VARIATIONS_H

#include <stddef.h>

#include "run.h"

/* Lists of slopes: of the residual, of Phi, of dPhi/dt and of the integrands. */
enum slopes_of { OF_RESIDUAL, OF_PLACES, OF_RATES, OF_INTEGRANDS, SLOPES_OF };

/* Kernels of the analysis `variation`; those that a model does not have are NULL. */
struct variation_kernels {
    kernel stage;      /* slopes of the residual, with w in work, as all below */
    kernel closing;    /* slopes of Phi and dPhi/dt */
    kernel integrands; /* values */
    kernel integrand_slopes;
    kernel setup;
};

struct variation_sizes {
    ptrdiff_t columns;             /* directions: derivatives by so many numbers */
    ptrdiff_t integrals;
    ptrdiff_t parameters, derived; /* numbers of p before and after those that `setup` makes */
    ptrdiff_t work, out;           /* numbers of work memory and of results of the largest kernel */
    ptrdiff_t entries[SLOPES_OF];
    /* of each slope its row, its column and its place in the kernel's results: columns are (q, u), w, directions */
    const long *places[SLOPES_OF];
};

struct variations {
    struct equations *e;
    struct scheme scheme;
    struct variation_kernels kernels;
    struct variation_sizes sizes;
    real *p, *work, *out;
    real *still;             /* zeros in the place of w, which closing does not depend on */
    real *rates;             /* dy/dt of the stages, a row of 2n each */
    real *state;             /* of a stage */
    /* forward: rows of so many columns */
    real *moved;             /* d(q, u), 2n rows */
    real *by_stage, *turned; /* of a stage; d(dy/dt) of all stages */
    real *right, *solved;    /* right-hand sides, and dw, n + m rows */
    real *inverse;           /* rows of the inverse of [M J^T; J 0] */
    real *sums, *summed;     /* integrals; their derivatives, a row each */
    /* transposed */
    real *seed;              /* of (q, u) */
    real *weights, *gradient; /* of the integrals; by the directions */
    real *states, *solutions, *factors, *back; /* of all stages: (q, u), w, factorisation, seed */
};

/* Interface of variations: see core.h. Each takes so many steps between steps + 1 times and states, rows of 2n reals;
 * `references` are those of angles in loads in each step, a row each. Both return DONE or NOT_FINITE or SINGULAR, with
 * the number of steps taken in `taken`. */
struct variation_api {
    size_t variations_struct;
    size_t (*bytes)(const struct equations *e, const struct scheme *scheme, const struct variation_sizes *sizes);
    void (*bind)(struct variations *v, struct equations *e, const struct scheme *scheme,
                 const struct variation_sizes *sizes, const struct variation_kernels *kernels, void *memory);
    /* Carry v->moved, v->sums and v->summed along the steps. */
    int (*forward)(struct variations *v, long steps, const double *t, const void *y, const double *references,
                   long *taken);
    /* Carry v->seed back along the steps, the last first, and add to v->gradient. */
    int (*backward)(struct variations *v, long steps, const double *t, const void *y, const double *references,
                    long *taken);
};

extern const struct variation_api symgen_variations;

#endif
