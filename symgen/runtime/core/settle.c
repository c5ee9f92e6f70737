/* Projection of a step's end onto the constraints, and its correction as an error estimate. */
#include "corrections.h"
#include "run.h"

#include <string.h>

/* Largest correction of the projection near a loss of rank, over the motion in the step. */
#define ASTRAY 0.01

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
    /* Before the end is evaluated, so that this is the last pose of the step; a polynomial is near enough to it. */
    if (run->branch_bytes || run->scheme.kind->places)
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
    if (status == DONE && s->sound >= NEAR) {
        const real shortest = e->of == &kernel_behaviour ? shortest_scale(e) : REAL_INFINITY;
        const struct projected x = {e->n, run->dim, run->y, run->error, run->y_new, shortest};
        s->correction = correction_norm(&x, &run->task);
    }
    return status;
}
