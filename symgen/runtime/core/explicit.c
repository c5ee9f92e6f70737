/* Explicit Runge-Kutta methods.
 *
 * counts: stages of the solution, all stages, degree of the interpolant, rows of error weights, and whether these
 * use the derivative at the end (first same as last).
 * numbers: a (all stages squared, row by row), b (stages), c (all stages), error weights (rows of stages + 1),
 * interpolant (all stages by degree), and the edge of stability (0: not known). Stage number `stages` is the
 * derivative at the projected end of the step, which closes the interpolant and is the first stage of the next
 * step; stages behind it serve the interpolant.
 */
#include "run.h"

#include <string.h>

struct tableau {
    long stages, all, degree, rows, same_as_last;
    const real *a, *b, *c, *e, *dense, *edge;
};

static struct tableau tableau_of(const struct run *run) {
    const long *counts = run->scheme.counts;
    struct tableau x = {.stages = counts[0], .all = counts[1], .degree = counts[2], .rows = counts[3]};
    x.same_as_last = counts[4];
    x.a = run->scheme.numbers;
    x.b = x.a + x.all * x.all;
    x.c = x.b + x.stages;
    x.e = x.c + x.all;
    x.dense = x.e + x.rows * (x.stages + 1);
    x.edge = x.dense + x.all * x.degree;
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

/* Add rows by their factors, one after the other for every entry: the same numbers whatever goes at once. */
static void add_four(const real f[4], const real *const k[4], long dim, real *restrict sum) {
    const real *restrict a = k[0], *restrict b = k[1], *restrict c = k[2], *restrict d = k[3];
    real fa = f[0], fb = f[1], fc = f[2], fd = f[3];
    for (long i = 0; i < dim; i++)
        sum[i] = (((sum[i] + fa * a[i]) + fb * b[i]) + fc * c[i]) + fd * d[i];
}

static void add_one(real f, const real *restrict k, long dim, real *restrict sum) {
    for (long i = 0; i < dim; i++)
        sum[i] += f * k[i];
}

/* Add to `sum` the stages before `count` by their weights times h. */
static void add_stages(const struct run *run, const real *weights, long count, real h, real *sum) {
    const real *rows[4];
    real factors[4];
    long dim = run->dim, held = 0;
    for (long j = 0; j < count; j++) {
        if (weights[j] == 0)
            continue;
        factors[held] = h * weights[j];
        rows[held++] = run->own + j * dim;
        if (held == 4) {
            add_four(factors, rows, dim, sum);
            held = 0;
        }
    }
    for (long j = 0; j < held; j++)
        add_one(factors[j], rows[j], dim, sum);
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
        add_stages(run, x->e + r * (x->stages + 1), x->stages + x->same_as_last, h, run->error);
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
    if (x.same_as_last) {
        int status = settle(run, t_new);
        if (status != DONE)
            return status;
        run->e->of->derivative(run->e, t_new, run->y_new, run->f_new);
    }
    if (run->scheme.adaptive)
        run->state->norm = estimate(run, &x, t_new, h);
    return DONE;
}

/* Looks whether accuracy or stability set the step: every so many steps, and in all while it seems stability. */
enum { STIFF_EVERY = 16, STIFF_ROW = 15, EASY_ROW = 6 };

/* The last stage and the end are at the same time: the ratio of their derivatives' distance to their own is a
 * bound from below of the largest eigenvalue (Hairer and Wanner II, IV.2). */
static void look_for_stiffness(struct run *run, const struct tableau *x, real h, real t_new) {
    struct state *s = run->state;
    const real *last = run->own + (x->stages - 1) * run->dim;
    real rates = 0, states = 0;
    if (*x->edge == 0 || s->stiff || (s->stiff_row == 0 && s->steps % STIFF_EVERY != STIFF_EVERY - 1))
        return;
    for (long i = 0; i < run->dim; i++) {
        real rate = run->f_new[i] - last[i], state = run->y_new[i] - run->stage[i];
        rates += rate * rate, states += state * state;
    }
    if (states > 0 && h * real_sqrt(rates / states) > *x->edge) {
        s->easy_row = 0;
        if (s->stiff_row++ == 0)
            s->t_stiff = t_new;
        s->stiff = s->stiff_row == STIFF_ROW;
    } else if (s->stiff_row && ++s->easy_row == EASY_ROW) {
        s->stiff_row = s->easy_row = 0;
    }
}

static int finish(struct run *run, real h, real t_new) {
    struct tableau x = tableau_of(run);
    if (!(x.same_as_last && run->state->settled))
        run->e->of->derivative(run->e, t_new, run->y_new, run->f_new);
    if (run->scheme.adaptive && run->state->settled)
        look_for_stiffness(run, &x, h, t_new);
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
