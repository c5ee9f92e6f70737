/* Derivatives of runs: tangents of all steps, and transposes of explicit Runge-Kutta steps.
 *
 * The stages of a step are evaluated again from the state at its start. The equations of motion are differentiated
 * implicitly at every stage, and the projection at the end of a step as the projection of (dq, du) onto dPhi = 0 and
 * d(dPhi/dt) = 0. rod_variations.c treats linkages, loop_variations.c loops of joints, implicit_variations.c implicit
 * steps. */
#ifndef SYMGEN_VARIATIONS_H
#define SYMGEN_VARIATIONS_H

#include <stddef.h>

#include "run.h"
#include "tableau.h"

/* Lists of slopes: of the residual, of Phi, of dPhi/dt and of the integrands. */
enum slopes_of { OF_RESIDUAL, OF_PLACES, OF_RATES, OF_INTEGRANDS, SLOPES_OF };

/* Kernels of the analysis `variation` of linkages, or `loop_variation`; absent kernels are NULL. */
struct variation_kernels {
    /* Slopes of the residual, with w in work, as for all kernels below. For loops: gradient of the weighted
       accelerations of closure and efforts; the weights follow accelerations and wrench in work. */
    kernel stage;
    kernel closing;    /* slopes of Phi and dPhi/dt; for loops the gradient of closure, and `rates` the gradient of
                          its rate */
    kernel integrands; /* values */
    kernel integrand_slopes;
    kernel setup;
    kernel rates, prescribed; /* loops only; `prescribed`: slopes of values, rates and accelerations of inputs by p */
};

struct variation_sizes {
    ptrdiff_t columns;             /* number of directions */
    ptrdiff_t integrals;
    ptrdiff_t parameters, derived; /* numbers of p without and with the results of `setup` */
    ptrdiff_t work, out;           /* numbers of work memory and of results of the largest kernel */
    ptrdiff_t entries[SLOPES_OF];
    /* row, column and place in the kernel's results of each slope; columns are (q, u), w, directions */
    const long *places[SLOPES_OF];
    ptrdiff_t width;        /* loops: length of the vectors of kernels */
    const long *directions; /* loops: the parameter that each direction changes, -1: none */
};

struct variations;

/* Implicit differentiation of the equations of one kind. */
struct variation_behaviour {
    /* Place the arrays that this kind has alone; return their bytes. */
    size_t (*place)(struct variations *v, const struct equations *e, void *memory);
    /* Set the parameters from those of the equations, with the references and branches of a step. */
    void (*begin)(struct variations *v);
    /* After the accelerations at a state: write their tangents along v->by_stage to the first rows of v->solved. */
    void (*stage)(struct variations *v, real t, const real *state);
    /* Add the integrands there, and their tangents, times a weight; NULL without integrands. */
    void (*integrate)(struct variations *v, real t, const real *state, real weight);
    /* Project d(q, u), 2n rows in `moved`, onto the tangent space of the constraints at y. */
    int (*close)(struct variations *v, real t, const real *y, real *moved);
    /* The transpose of a stage. `keep` stores the data for the transpose of stage s. The transpose takes a seed of dy/dt, adds
       the seed of (q, u) to `back` and that of the directions to v->gradient; integrands count with the weight. */
    void (*keep)(struct variations *v, long s, real t, const real *state);
    void (*stage_back)(struct variations *v, long s, real t, const real *seed, real weight, real *back);
    /* The transpose of `close`: change a seed of (q, u), and add to v->gradient. */
    int (*open)(struct variations *v, real t, const real *y, real *seed);
};

struct variations {
    const struct variation_behaviour *of;
    struct equations *e;
    struct scheme scheme;
    struct variation_kernels kernels;
    struct variation_sizes sizes;
    real *p, *work, *out;    /* of the kernels */
    real *rates;             /* dy/dt of the stages, a row of 2n each */
    real *state;             /* of a stage */
    /* forward: rows of so many columns */
    real *moved;             /* d(q, u), 2n rows */
    real *by_stage, *turned; /* of a stage; d(dy/dt) of all stages */
    real *solved;            /* dw, n + m rows */
    real *sums, *summed;     /* integrals; their derivatives, a row each */
    /* transposed */
    real *seed;              /* of (q, u) */
    real *weights, *gradient; /* of the integrals; by the directions */
    real *states, *factors, *back; /* of all stages: (q, u), data of `keep`, seed */
    /* of implicit steps */
    real *matrix, *changes;  /* matrix of the equations of a step; right-hand sides and solutions in rows of `columns`
                                */
    ptrdiff_t *swaps;
    real *carried, *carried_moved; /* accelerations of the method and of the motion before a step, n each */
    /* of linkages */
    real *still;             /* zeros in the place of w, on which closing does not depend */
    real *right, *inverse;   /* right-hand sides; rows of the inverse of [M J^T; J 0] */
    real *solutions;         /* w of all stages */
    /* of loops */
    real *t, *q, *u;         /* arguments of kernels, in vectors, like p, work and out */
    real *answer;            /* changes of accelerations, or of variables, per unit error of the equations: n rows */
    real *slopes;            /* slopes of accelerations, or of projected quantities, by (q, u) and directions: n rows
                                */
    real *prescribed;        /* slopes of the inputs' values, rates and accelerations by the directions: one row each
                                */
};

static inline int is_explicit(const struct variations *v) {
    return v->scheme.kind == find_kind("explicit");
}

/* Number of stages of a step with stored results. */
static inline ptrdiff_t stages_of(const struct variations *v) {
    return is_explicit(v) ? v->scheme.counts[SOLUTION_STAGES] : 3;
}

/* Implicit steps: their last 2n directions are the state. `begins`: first step of a run. */
size_t implicit_place(struct variations *v, const struct equations *e, void *memory);
int implicit_step(struct variations *v, int begins, real t, real h, const real *y, const real *y_new);

/* Evaluate stage s at a state: its dy/dt in v->rates, w in e->out, and its factorisation. */
void variations_evaluate(struct variations *v, long s, real t, const real *state);

/* Interface of variations: see core.h. Both functions take `steps` steps between steps + 1 times and states, rows of
   2n reals. `references` has, for each step, a row of the references of angles in loads and the branches of loads.
   Both return DONE, NOT_FINITE or SINGULAR, and the number of steps taken in `taken`. */
struct variation_api {
    size_t variations_struct;
    const struct variation_behaviour *rods, *loops;
    size_t (*bytes)(const struct variation_behaviour *of, const struct equations *e, const struct scheme *scheme,
                    const struct variation_sizes *sizes);
    void (*bind)(struct variations *v, const struct variation_behaviour *of, struct equations *e,
                 const struct scheme *scheme, const struct variation_sizes *sizes,
                 const struct variation_kernels *kernels, void *memory);
    /* Carry v->moved, v->sums and v->summed along the steps. */
    int (*forward)(struct variations *v, long steps, const double *t, const void *y, const double *references,
                   long *taken);
    /* Carry v->seed back along the steps, the last first, and add to v->gradient. */
    int (*backward)(struct variations *v, long steps, const double *t, const void *y, const double *references,
                    long *taken);
    /* With one direction: write for steps whose entry is not zero the number of equal parts, a real number, in which the
       explicit method has the tolerance. Then, with parts as steps, write the states that are not known. */
    int (*count_parts)(struct variations *v, long steps, const double *t, const void *y, const double *references,
                       double rtol, double atol, double *parts, long *taken);
    void (*fill)(struct variations *v, long steps, const double *t, void *y, const double *references,
                 const char *known);
};

extern const struct variation_api symgen_variations;

#endif
