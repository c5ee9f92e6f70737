/* The correction of a step's end by its projection, one text for a single run and for lanes: see wide.h. */
#ifndef SYMGEN_CORRECTIONS_H
#define SYMGEN_CORRECTIONS_H

#include "run.h"
#include "wide.h"

/* The tightest relative tolerance that a number type meets, over its epsilon: TIGHTEST of runtime/integrate/options.py. */
#define ROUNDINGS 100.0
/* Roundings of a coordinate after the projection, which rotate the tangent space of the constraints. */
#define TURNED 4.0

/* A projected state y_new of dim numbers after a step from y, and before its projection. */
struct projected {
    ptrdiff_t n, dim;
    const wide *y, *before, *y_new;
    wide shortest; /* the least scale of the constraints */
};

/* Norm of the projection's correction over the tolerance, or over the corrections that rounding causes in every step:
   ROUNDINGS of the largest coordinate or rate, and the part of the rates that leaves the tangent space by roundings
   of the coordinates. */
static inline wide correction_norm(const struct projected *x, const struct task *task) {
    const ptrdiff_t n = x->n;
    wide total = all(0);
    const wide least[2] = {largest_in(x->y_new, n), largest_in(x->y_new + n, n)};
    wide floor[2] = {R(ROUNDINGS) * REAL_EPSILON * least[0], R(ROUNDINGS) * REAL_EPSILON * least[1]};
    floor[1] += R(TURNED) * REAL_EPSILON * least[0] * least[1] / x->shortest;
    for (ptrdiff_t i = 0; i < 2 * n; i++) {
        const wide scale = R(task->atol) + R(task->rtol) * larger(magnitude(x->y[i]), magnitude(x->y_new[i]));
        const wide part = (x->before[i] - x->y_new[i]) / larger(scale, floor[i / n]);
        total += part * part;
    }
    return root(total / R(x->dim));
}

#endif
