/* The coefficients of an explicit Runge-Kutta method; explicit.c states their meaning. */
#ifndef SYMGEN_TABLEAU_H
#define SYMGEN_TABLEAU_H

#include "run.h"

struct tableau {
    long stages, all, degree, rows, same_as_last;
    const real *a, *b, *c, *e, *dense, *edge;
};

static inline struct tableau tableau_of(const struct scheme *scheme) {
    const long *counts = scheme->counts;
    struct tableau x = {.stages = counts[0], .all = counts[1], .degree = counts[2], .rows = counts[3]};
    x.same_as_last = counts[4];
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
    for (long j = 0; j < x->all; j++) {
        real power = theta * h;
        weights[j] = 0;
        for (long d = 0; d < x->degree; d++) {
            weights[j] += x->dense[j * x->degree + d] * power;
            power *= theta;
        }
    }
}

#endif
