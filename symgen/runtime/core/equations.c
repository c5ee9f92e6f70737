#include "equations.h"

#include <string.h>

#define EQUATIONS
#include "equation_steps.h"

int (*core_interrupted)(void) = NULL;

/* Watch the pivots of a factor; `dropped` may be NULL. */
static int judge(struct equations *e, const real *factors, char *dropped) {
    struct account *found = e->account;
    long n = e->n, m = e->m, redundant = e->sizes.redundant;
    double tolerance = e->sizes.rank_tolerance;
    int finite = 1;
    found->weakest = -1, found->soundness = INFINITY, found->lost = 0;
    for (long i = 0; i < n; i++) {
        double ratio = (double)part_left(e, factors, i);
        if (!isfinite(ratio)) {
            finite = 0;
        } else if (ratio <= MASSLESS) {
            found->weakest = i, found->soundness = ratio;
            return SINGULAR;
        }
    }
    for (long i = 0; i < m; i++) {
        double ratio = (double)part_left(e, factors, n + i);
        if (dropped)
            dropped[i] = ratio <= tolerance;
        if (!isfinite(ratio)) {
            finite = 0;
        } else if (ratio <= tolerance && found->lost < redundant) {
            found->lost++;
        } else if (ratio < found->soundness) {
            found->weakest = n + i, found->soundness = ratio;
        }
    }
    if (!finite)
        return NOT_FINITE;
    return found->soundness <= tolerance || found->lost < redundant ? SINGULAR : DONE;
}

int factorise(struct equations *e, real t, const real *y) {
    e->kernels.factor(&t, y, y + e->n, e->p, e->factors, e->out);
    e->account->factorisations++;
    return judge(e, e->factors, e->dropped);
}

static int look(struct equations *e, real t, const real *y) {
    e->kernels.factor(&t, y, y + e->n, e->p, e->work, e->out);
    e->account->factorisations++;
    return judge(e, e->work, NULL);
}

static int project_positions(struct equations *e, real t, real *y) {
    struct newton w;
    if (!any(closed_positions(e, 1, t, y, &w)))
        return real_isfinite(w.error) ? PROJECTION_FAILED : NOT_FINITE;
    return e->sizes.redundant && !(e->account->missed <= e->sizes.slack) ? CONTRADICTED : DONE;
}

int project_velocities(struct equations *e, real t, real *y) {
    const real speed = largest_in(y + e->n, e->n), rounding = rounding_of_rates(e, speed);
    real before = REAL_INFINITY;
    mask finite = 1;
    const mask open = corrected_velocities(e, 1, t, y, rounding, &before, &finite);
    if (any(open) && !(before <= ROUND_OFF * speed)) {
        /* the factor belongs to a distant state: factorise again */
        const int status = factorise(e, t, y);
        if (status != DONE)
            return status;
        corrected_velocities(e, 1, t, y, rounding, &before, &finite);
    }
    return any(finite) ? DONE : NOT_FINITE;
}

static int project_places(struct equations *e, real t, real *y) {
    if (e->m == 0)
        return DONE;
    int status = factorise(e, t, y);
    return status == DONE ? project_positions(e, t, y) : status;
}

static int project(struct equations *e, real t, real *y) {
    int status = project_places(e, t, y);
    return status == DONE && e->m ? project_velocities(e, t, y) : status;
}

static void make_tangent(struct equations *e, real t, const real *y, real *change) {
    long n = e->n, m = e->m;
    /* Prescribed rates of the constraints take no part in a change. */
    e->kernels.velocity_constraints(&t, y, change, e->p, e->work, e->rhs + n);
    e->kernels.velocity_constraints(&t, y, e->zero, e->p, e->work, e->rates);
    memset(e->rhs, 0, (size_t)n * sizeof(real));
    for (long i = 0; i < m; i++)
        e->rhs[n + i] = e->rates[i] - e->rhs[n + i];
    e->kernels.solve(&t, y, change, e->p, e->factors, e->rhs);
    for (long i = 0; i < n; i++)
        change[i] += e->rhs[i];
}

const struct behaviour kernel_behaviour = {
    accelerate, derivative, position_error, velocity_error, factorise,
    look, project, project_places, make_tangent, measure_energy, .rounding = 0.1,
};

void look_at_events(struct equations *e, real t, const real *y) {
    e->kernels.events(&t, y, y + e->n, e->p, e->work, e->gaps);
}
