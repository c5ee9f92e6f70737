/* The coefficients of an explicit Runge-Kutta method. */
#ifndef SYMGEN_TABLEAU_H
#define SYMGEN_TABLEAU_H

#include <string.h>

#include "run.h"

/* Stages of the solution, all stages, degree of the interpolant, rows of error weights, and whether they use the
   derivative at the end (first same as last). */
#define EXPLICIT_COUNTS "stages all_stages degree estimates same_as_last"
enum { SOLUTION_STAGES, ALL_STAGES, DEGREE, ESTIMATES, SAME_AS_LAST };

/* a (all stages squared, row by row), b (stages), c (all stages), error weights (rows of stages + 1), interpolant (all
 * stages by degree), and the edge of stability (0: unknown). */
#define EXPLICIT_ARRAYS "a b c error dense edge"

struct tableau {
    long stages, all, degree, rows, same_as_last;
    const real *a, *b, *c, *e, *dense, *edge;
};

static inline struct tableau tableau_sizes(const long *counts) {
    struct tableau x = {.stages = counts[SOLUTION_STAGES], .all = counts[ALL_STAGES], .degree = counts[DEGREE]};
    x.rows = counts[ESTIMATES];
    x.same_as_last = counts[SAME_AS_LAST];
    return x;
}

static inline struct tableau tableau_of(const struct scheme *scheme) {
    struct tableau x = tableau_sizes(scheme->counts);
    x.a = scheme->numbers;
    x.b = x.a + x.all * x.all;
    x.c = x.b + x.stages;
    x.e = x.c + x.all;
    x.dense = x.e + x.rows * (x.stages + 1);
    x.edge = x.dense + x.all * x.degree;
    return x;
}

/* Weights of the derivatives of all stages at the part theta of a step of length h. */
static inline void dense_weights(const struct tableau *x, real h, real theta, real *weights) {
    real power = theta * h;
    memset(weights, 0, (size_t)x->all * sizeof(real));
    for (long d = 0; d < x->degree; d++, power *= theta) {
        const real *dense = x->dense + d;
        for (long j = 0; j < x->all; j++, dense += x->degree)
            weights[j] += *dense * power;
    }
}

/* Root mean square of an error by the sums of squares of one or two estimates, which are blended as in DOP853. */
static inline real blended(long rows, const real *totals, long count) {
    if (rows == 1)
        return real_sqrt(totals[0] / R(count));
    const real total = totals[0] + R(0.01) * totals[1];
    return total > 0 ? totals[0] / real_sqrt(total * R(count)) : total;
}

#endif
