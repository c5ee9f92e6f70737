/* Explicit Runge-Kutta methods.
 *
 * tableau.h lists the counts and arrays of a scheme. Stage number `stages` is the derivative at the projected end of
 * the step. It closes the interpolant and is the first stage of the next step. Further stages serve the interpolant.
 */
#include "lanes.h"
#include "run.h"
#include "stages.h"
#include "tableau.h"

/* `own` holds the derivatives of all stages, a row each, and a row of scratch. */
static size_t bytes(const struct run *run, const long *counts) {
    return (size_t)((counts[ALL_STAGES] + 1) * run->dim) * sizeof(real);
}

static ptrdiff_t numbers(const long *counts) {
    const struct tableau x = tableau_sizes(counts);
    if (x.stages < 1 || x.all < x.stages || x.all > MOST_STAGES || x.degree < 0 || x.degree > MOST_STAGES ||
        x.rows < 0 || x.rows > MOST_ESTIMATES || x.same_as_last < 0 || x.same_as_last > 1 ||
        x.stages + x.same_as_last > x.all)
        return -1;
    return x.all * x.all + x.stages + x.all + x.rows * (x.stages + 1) + x.all * x.degree + 1;
}

static void bind(struct run *run) {
    run->f = run->own;
    run->f_new = run->f + run->scheme.counts[SOLUTION_STAGES] * run->dim;
}

static int begin(struct run *run) {
    run->e->of->derivative(run->e, run->state->t, run->y, run->f);
    return DONE;
}

/* Evaluate stage s from the stages before it: DONE, or SINGULAR if its accelerations have no correct digits. */
static int fill_stage(struct run *run, const struct tableau *x, long s, real h) {
    struct equations *e = run->e;
    const size_t row = (size_t)run->dim * sizeof(real);
    real *stages = run->own;
    real t = run->state->t + x->c[s] * h;
    int status = DONE;
    add_stages(x->a + s * x->all, s, h, run->own, run->dim, run->y, run->stage);
    if (is_magnified(run)) {
        memcpy(run->error, run->stage, row);
        status = e->of->project(e, t, run->error);
        if (status == DONE)
            memcpy(run->stage, run->error, row);
        if (e->account->soundness < run->least)
            return SINGULAR;
    }
    e->of->derivative(e, t, run->stage, stages + s * run->dim);
    return status == SINGULAR ? SINGULAR : DONE;
}

/* Root mean square of the local error over the tolerance. */
static real estimate(struct run *run, const struct tableau *x, real t_new, real h) {
    struct equations *e = run->e;
    real atol = R(run->task.atol), rtol = R(run->task.rtol), totals[MOST_ESTIMATES] = {0}, rounding[3];
    real *errors[MOST_ESTIMATES] = {run->error, (real *)run->own + x->all * run->dim};
    if (is_magnified(run))
        e->of->factorise(e, t_new, run->y_new);
    for (long r = 0; r < x->rows; r++) {
        add_stages(x->e + r * (x->stages + 1), x->stages + x->same_as_last, h, run->own, run->dim, NULL, errors[r]);
        if (is_magnified(run)) {
            e->of->make_tangent(e, t_new, run->y_new, errors[r]);
            e->of->make_tangent(e, t_new, run->y_new, errors[r] + e->n);
        }
    }
    const long judged = judged_of(run);
    rounding_of(run, h, rounding);
    for (long i = 0; i < judged; i++) {
        real least = atol + rounding[i / e->n];
        real scale = R(1) / (least + rtol * real_fmax(real_fabs(run->y[i]), real_fabs(run->y_new[i])));
        for (long r = 0; r < x->rows; r++)
            totals[r] += (errors[r][i] * scale) * (errors[r][i] * scale);
    }
    return blended(x->rows, totals, judged);
}

static int step(struct run *run, real t, real h, real t_new) {
    struct tableau x = tableau_of(&run->scheme);
    (void)t;
    for (long s = 1; s < x.stages; s++)
        if (fill_stage(run, &x, s, h) != DONE && run->scheme.adaptive)
            return SINGULAR;
    add_stages(x.b, x.stages, h, run->own, run->dim, run->y, run->y_new);
    if (x.same_as_last) {
        int status = project_new_state(run, t_new);
        if (status != DONE)
            return status;
        run->e->of->derivative(run->e, t_new, run->y_new, run->f_new);
    }
    if (run->scheme.adaptive)
        run->state->norm = estimate(run, &x, t_new, h);
    return DONE;
}

/* The last stage and the end of the step have the same time. The distance of their derivatives over the distance of
   their states is a lower bound of the largest eigenvalue (Hairer and Wanner II, IV.2). */
static void look_for_stiffness(struct run *run, const struct tableau *x, real h, real t_new) {
    const real *last = (const real *)run->own + (x->stages - 1) * run->dim;
    real rates = 0, states = 0;
    if (*x->edge == 0 || !is_stiffness_due(run))
        return;
    for (long i = 0; i < run->dim; i++) {
        real rate = run->f_new[i] - last[i], state = run->y_new[i] - run->stage[i];
        rates += rate * rate, states += state * state;
    }
    watch_stiffness(run, t_new, states > 0 && h * real_sqrt(rates / states) > *x->edge);
}

static int finish(struct run *run, real h, real t_new) {
    struct tableau x = tableau_of(&run->scheme);
    if (!(x.same_as_last && run->state->settled))
        run->e->of->derivative(run->e, t_new, run->y_new, run->f_new);
    if (run->scheme.adaptive && run->state->settled)
        look_for_stiffness(run, &x, h, t_new);
    return DONE;
}

static void prepare(struct run *run, real h) {
    struct tableau x = tableau_of(&run->scheme);
    for (long s = x.stages + 1; s < x.all; s++)
        fill_stage(run, &x, s, h);
}

static void interpolate(struct run *run, real h, real theta, real *y) {
    struct tableau x = tableau_of(&run->scheme);
    real weights[MOST_STAGES];
    dense_weights(&x, h, theta, weights);
    add_stages(weights, x.all, R(1), run->own, run->dim, run->y, y);
}

const struct kind explicit_kind = {
    "explicit", EXPLICIT_COUNTS, EXPLICIT_ARRAYS, 0, bytes, numbers, bind, begin, step, finish, prepare, interpolate, NULL,
    NULL, NULL, NULL, NULL, NULL,
};
