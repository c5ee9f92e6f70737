/* Explicit Runge-Kutta methods.
 *
 * counts: stages of the solution, all stages, degree of the interpolant, rows of error weights.
 * numbers: a (all stages squared, row by row), b (stages), c (all stages), error weights (rows of stages),
 * interpolant (all stages by degree). Stage number `stages` is the derivative at the projected end of the step,
 * which closes the interpolant and is the first stage of the next step; stages behind it serve the interpolant.
 */
#include "run.h"

#include <string.h>

struct tableau {
    long stages, all, degree, rows;
    const real *a, *b, *c, *e, *dense;
};

static struct tableau tableau_of(const struct run *run) {
    const long *counts = run->scheme.counts;
    struct tableau x = {.stages = counts[0], .all = counts[1], .degree = counts[2], .rows = counts[3]};
    x.a = run->scheme.numbers;
    x.b = x.a + x.all * x.all;
    x.c = x.b + x.stages;
    x.e = x.c + x.all;
    x.dense = x.e + x.rows * x.stages;
    return x;
}

/* `own` holds the derivatives of all stages, a row each. */
static size_t reals(const struct equations *e, const long *counts) {
    return (size_t)(counts[1] + 1) * (size_t)e->dim;
}

static void bind(struct run *run) {
    run->f = run->own;
    run->f_new = run->own + run->scheme.counts[0] * run->dim;
}

static int begin(struct run *run) {
    run->e->of->derivative(run->e, run->state->t, run->y, run->f);
    return DONE;
}

/* Add to `sum` the stages before `count` by their weights times h. */
static void add_stages(const struct run *run, const real *weights, long count, real h, real *sum) {
    for (long j = 0; j < count; j++) {
        real factor = h * weights[j];
        if (factor == 0)
            continue;
        const real *k = run->own + j * run->dim;
        for (long i = 0; i < run->dim; i++)
            sum[i] += factor * k[i];
    }
}

/* Whether errors across the constraints are so much magnified that stages and estimates are projected too:
 * they vanish again when the end of the step is. */
static int magnified(const struct run *run) {
    return run->state->sound < NEAR && run->task.stabilisation == PROJECTION;
}

/* Fill stage s from the stages before it. */
static void fill_stage(struct run *run, const struct tableau *x, long s, real h) {
    struct equations *e = run->e;
    size_t bytes = (size_t)run->dim * sizeof(real);
    real t = run->state->t + x->c[s] * h;
    memcpy(run->stage, run->y, bytes);
    add_stages(run, x->a + s * x->all, s, h, run->stage);
    if (magnified(run)) {
        memcpy(run->error, run->stage, bytes);
        if (e->of->project(e, t, run->error) == DONE)
            memcpy(run->stage, run->error, bytes);
    }
    e->of->derivative(e, t, run->stage, run->own + s * run->dim);
}

/* Root mean square of the local error over the tolerance; two rows are blended as in DOP853. */
static real estimate(struct run *run, const struct tableau *x, real t_new, real h) {
    struct equations *e = run->e;
    long dim = run->dim;
    real atol = R(run->task.atol), rtol = R(run->task.rtol), totals[2] = {0, 0};
    if (magnified(run))
        e->of->factorise(e, t_new, run->y_new);
    for (long r = 0; r < x->rows; r++) {
        memset(run->error, 0, (size_t)dim * sizeof(real));
        add_stages(run, x->e + r * x->stages, x->stages, h, run->error);
        if (magnified(run)) {
            e->of->make_tangent(e, t_new, run->y_new, run->error);
            e->of->make_tangent(e, t_new, run->y_new, run->error + e->n);
        }
        for (long i = 0; i < dim; i++) {
            real part = run->error[i] / (atol + rtol * real_fmax(real_fabs(run->y[i]), real_fabs(run->y_new[i])));
            totals[r] += part * part;
        }
    }
    if (x->rows == 1)
        return real_sqrt(totals[0] / R(dim));
    real total = totals[0] + R(0.01) * totals[1];
    return total > 0 ? totals[0] / real_sqrt(total * R(dim)) : total;
}

static int step(struct run *run, real t, real h, real t_new) {
    struct tableau x = tableau_of(run);
    (void)t;
    for (long s = 1; s < x.stages; s++)
        fill_stage(run, &x, s, h);
    memcpy(run->y_new, run->y, (size_t)run->dim * sizeof(real));
    add_stages(run, x.b, x.stages, h, run->y_new);
    if (run->scheme.adaptive)
        run->state->norm = estimate(run, &x, t_new, h);
    return DONE;
}

static int finish(struct run *run, real h, real t_new) {
    (void)h;
    run->e->of->derivative(run->e, t_new, run->y_new, run->f_new);
    return DONE;
}

static void prepare(struct run *run, real h) {
    struct tableau x = tableau_of(run);
    for (long s = x.stages + 1; s < x.all; s++)
        fill_stage(run, &x, s, h);
}

static void interpolate(struct run *run, real h, real theta, real *y) {
    struct tableau x = tableau_of(run);
    memcpy(y, run->y, (size_t)run->dim * sizeof(real));
    for (long j = 0; j < x.all; j++) {
        const real *k = run->own + j * run->dim;
        real power = theta * h, weight = 0;
        for (long d = 0; d < x.degree; d++) {
            weight += x.dense[j * x.degree + d] * power;
            power *= theta;
        }
        for (long i = 0; i < run->dim; i++)
            y[i] += weight * k[i];
    }
}

static void accept(struct run *run) {
    memcpy(run->f, run->f_new, (size_t)run->dim * sizeof(real));
}

const struct kind explicit_kind = {
    "explicit", 0, reals, bind, begin, step, finish, prepare, interpolate, accept,
};
