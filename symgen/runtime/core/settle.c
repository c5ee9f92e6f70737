/* Projection of a step's end onto the constraints, and its correction as an error estimate. */
#include "run.h"

#include <string.h>

/* Largest correction of the projection near a loss of rank, over the motion in the step. */
#define ASTRAY 0.01
/* The tightest relative tolerance that a number type meets, over its epsilon: TIGHTEST of runtime/integrate/options.py. */
#define ROUNDINGS 100.0

/* Roundings of a coordinate after the projection, which rotate the tangent space of the constraints. */
#define TURNED 4.0

/* Norm of the projection's correction over the tolerance, or over the corrections that rounding causes in every step:
   ROUNDINGS of the largest coordinate or rate, and the part of the rates that leaves the tangent space by roundings
   of the coordinates. */
static real correction(struct run *run) {
    long n = run->e->n;
    real total = 0, atol = R(run->task.atol), rtol = R(run->task.rtol);
    real least[2] = {largest_of(run->y_new, n), largest_of(run->y_new + n, n)};
    real floor[2] = {R(ROUNDINGS) * REAL_EPSILON * least[0], R(ROUNDINGS) * REAL_EPSILON * least[1]};
    floor[1] += R(TURNED) * REAL_EPSILON * least[0] * least[1] / shortest_scale(run->e);
    for (long i = 0; i < 2 * n; i++) {
        real scale = atol + rtol * real_fmax(real_fabs(run->y[i]), real_fabs(run->y_new[i]));
        real part = (run->error[i] - run->y_new[i]) / real_fmax(scale, floor[i / n]);
        total += part * part;
    }
    return real_sqrt(total / R(run->dim));
}

/* Whether the projection moved the points by more than a small part of the step. Near a loss of rank the tolerance
   does not limit its magnified corrections, but a large one may lead to another assembly branch. If drives determine
   the motion, nothing else limits the step. */
static int is_astray(const struct run *run) {
    real moved = 0, taken = 0, size = largest_of(run->y_new, run->e->n);
    for (long i = 0; i < run->e->n; i++) {
        moved = real_fmax(moved, real_fabs(run->y_new[i] - run->y[i]));
        taken = real_fmax(taken, real_fabs(run->y_new[i] - run->error[i]));
    }
    return taken > R(ASTRAY) * moved + real_sqrt(REAL_EPSILON) * size;
}

int strayed(struct run *run, real t0, const real *y0, real t, real *y) {
    const struct state *s = run->state;
    const double sound = fmin(fmin(s->sound, s->looked), run->e->account->soundness);
    return run->branch_bytes && sound < NEAR && return_to_branch(run->e, run->branch, t0, y0, t, y);
}

int project_new_state(struct run *run, real t_new) {
    struct state *s = run->state;
    struct equations *e = run->e;
    s->settled = 1, s->correction = 0;
    if (e->m == 0)
        return DONE;
    if (run->branch_bytes)
        look_inside(run, t_new);
    if (run->scheme.kind->keeps_constraints) {
        const int status = e->of->factorise(e, t_new, run->y_new);
        return status == DONE && strayed(run, s->t, run->y, t_new, run->y_new) ? PROJECTION_FAILED : status;
    }
    if (run->task.stabilisation != PROJECTION)
        return e->of->factorise(e, t_new, run->y_new);
    memcpy(run->error, run->y_new, (size_t)run->dim * sizeof(real));
    int status = e->of->project(e, t_new, run->y_new);
    if (status == PROJECTION_FAILED)
        memcpy(run->y_new, run->y, (size_t)e->n * sizeof(real));
    if ((status == DONE || status == PROJECTION_FAILED) && strayed(run, s->t, run->y, t_new, run->y_new)) {
        s->shrink = R(SHRINK);
        status = run->scheme.adaptive ? AGAIN : e->of->project(e, t_new, run->y_new);
    }
    if (!run->scheme.adaptive)
        return status;
    if (status == PROJECTION_FAILED || (status == DONE && s->sound < NEAR && is_astray(run))) {
        s->shrink = R(SHRINK);
        return AGAIN;
    }
    if (status == DONE && s->sound >= NEAR)
        s->correction = correction(run);
    return status;
}
