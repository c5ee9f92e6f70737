/* The functions of lane_runs.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "corrections.h"
#include "lane_runs.h"
#include "newton.h"
#include "series_steps.h"
#include "tableau.h"
#include "wide.h"

/* A step from y at t, each lane in its own time; the lanes that are not complete, and those that take the step. */
struct lane_step {
    wide t, h, t_new;
    mask open, taken;
};

/* Power series of the lanes at y and at y_new, and steps within the tolerance: lengths of those from either, limits of
   the next by those before, and the growth of this limit after a step. */
struct lane_series {
    long present, order; /* which is that at y */
    wide *rows, *f_new, *changes;
    wide longest[BOTH], limit, growth;
};

struct lane_runs {
    struct kernels kernels;
    struct lane_sizes sizes;
    struct scheme scheme;
    struct task task;
    ptrdiff_t dim;
    int adaptive;
    struct lane_series series;
    wide *p, *y, *y_new, *stage, *own, *work, *factors, *out, *rhs, *rates, *scale, *before;
    wide energies[3], position_drift, energy_drift, energy_start;
    mask failed;
};

static size_t lane_run_place(struct lane_runs *l, const struct lane_sizes *s, const struct scheme *scheme,
                             void *memory) {
    const ptrdiff_t whole = s->n + s->m, dim = 2 * s->n + s->extra;
    const int explicit = s->series_rows == 0;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(l->p, s->parameters + s->derived + 1),
        ARENA_ARRAY(l->y, dim),
        ARENA_ARRAY(l->y_new, dim),
        ARENA_ARRAY(l->stage, dim),
        ARENA_ARRAY(l->own, explicit ? dim * (scheme->counts[ALL_STAGES] + 1) : 0),
        ARENA_ARRAY(l->series.rows, BOTH * rows_of(HIGHEST) * s->series_rows),
        ARENA_ARRAY(l->series.f_new, dim),
        ARENA_ARRAY(l->series.changes, s->n + 1),
        ARENA_ARRAY(l->work, s->work),
        ARENA_ARRAY(l->factors, s->work),
        ARENA_ARRAY(l->out, whole > 2 * s->m ? whole : 2 * s->m),
        ARENA_ARRAY(l->rhs, whole),
        ARENA_ARRAY(l->rates, s->m),
        ARENA_ARRAY(l->scale, s->m),
        ARENA_ARRAY(l->before, s->n),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t lane_run_bytes(const struct lane_sizes *sizes, const struct scheme *scheme) {
    struct lane_runs counted;
    return lane_run_place(&counted, sizes, scheme, NULL);
}

static void lane_run_bind(struct lane_runs *l, const struct lane_sizes *sizes, const struct kernels *kernels,
                          const struct scheme *scheme, const struct task *task, void *memory) {
    lane_run_place(l, sizes, scheme, memory);
    l->sizes = *sizes, l->kernels = *kernels, l->scheme = *scheme, l->task = *task;
    l->dim = 2 * sizes->n + sizes->extra;
    l->adaptive = scheme->adaptive && (task->rtol > 0.0 || task->atol > 0.0);
}

/* Call a kernel at the times and states of the lanes. */
static void call_at(const struct lane_runs *l, kernel function, wide t, const wide *y, wide *work, wide *out) {
    call(function, &t, y, y + l->sizes.n, l->p, work, out);
}

static void fail_unless_finite(struct lane_runs *l, const wide *values) {
    l->failed |= ~is_finite(largest_in(values, l->dim));
}

/* As `derivative` of equations. */
static void lane_derivative(struct lane_runs *l, wide t, const wide *y, wide *dy) {
    const ptrdiff_t n = l->sizes.n, m = l->sizes.m;
    memcpy(dy, y + n, (size_t)n * sizeof(wide));
    call_at(l, l->kernels.accelerations, t, y, l->work, l->out);
    for (int k = 0; k < REFINEMENTS && l->kernels.residual != NULL; k++) {
        call_at(l, l->kernels.residual, t, y, l->out, l->rhs);
        call_at(l, l->kernels.solve, t, y, l->work, l->rhs);
        for (ptrdiff_t i = 0; i < n + m; i++)
            l->out[i] += l->rhs[i];
    }
    memcpy(dy + n, l->out, (size_t)n * sizeof(wide));
    if (l->sizes.extra) {
        call_at(l, l->kernels.energy, t, y, l->out, l->energies);
        dy[2 * n] = l->energies[2];
    }
}

/* Factorise at y; mark lanes near a loss of rank as failed. */
static void lane_factor(struct lane_runs *l, wide t, const wide *y) {
    const ptrdiff_t n = l->sizes.n;
    call_at(l, l->kernels.factor, t, y, l->factors, l->out);
    for (ptrdiff_t i = 0; i < n + l->sizes.m; i++) {
        const wide *pivot = l->factors + l->sizes.first_pivot + 2 * i, terms = magnitude(pivot[1]);
        const wide ratio = (i < n ? R(1) : R(-1)) * pivot[0] / terms;
        const real near = l->scheme.near ? R(NEARBY) : R(NEAR);
        const real least = i < n ? R(MASSLESS) : real_fmax(near, R(l->sizes.rank_tolerance));
        l->failed |= ~((terms != 0) & (ratio > least) & is_finite(ratio));
    }
}

/* The largest row over its scale; NaN if one is NaN. */
static wide worst_of(const struct lane_runs *l, const wide *rows, const wide *scales) {
    wide worst = all(0);
    for (ptrdiff_t i = 0; i < l->sizes.m; i++) {
        const wide error = magnitude(rows[i]) / scales[i];
        worst = chosen((error <= worst) | (worst != worst), worst, error);
    }
    return worst;
}

/* Solve for the negative rows with the last factor; add the solution to `to` in open lanes. */
static void correct(struct lane_runs *l, mask open, wide t, const wide *y, const wide *rows, wide *to) {
    const ptrdiff_t n = l->sizes.n;
    memset(l->rhs, 0, (size_t)n * sizeof(wide));
    for (ptrdiff_t i = 0; i < l->sizes.m; i++)
        l->rhs[n + i] = -rows[i];
    call_at(l, l->kernels.solve, t, y, l->factors, l->rhs);
    for (ptrdiff_t i = 0; i < n; i++)
        to[i] = chosen(open, to[i] + l->rhs[i], to[i]);
}

/* Positions of the lanes to be projected at t. */
struct lane_positions {
    struct lane_runs *l;
    wide t, *y;
};

static wide correct_lanes(void *of, struct newton *w) {
    const struct lane_positions *p = of;
    struct lane_runs *l = p->l;
    const ptrdiff_t n = l->sizes.n, m = l->sizes.m;
    if (w->count) {
        copy_where(w->open, p->y, n, l->before);
        correct(l, w->open, p->t, p->y, l->out, p->y);
    }
    call_at(l, l->kernels.constraints, p->t, p->y, l->work, l->out);
    if (!w->count)
        w->size = larger(largest_in(p->y, n), largest_in(l->out + m, m));
    return worst_of(l, l->out, l->out + m);
}

/* As `project_positions` of equations; the scales of the constraints remain. */
static void close_lanes(struct lane_runs *l, wide t, wide *y) {
    struct lane_positions p = {l, t, y};
    struct newton w = {
        .most = PROJECTIONS, .close = all(REAL_EPSILON), .rounded = all(ROUND_OFF), .grows = R(0.5),
    };
    const mask open = ~l->failed;
    l->failed |= open & ~newton_solve(&w, open, correct_lanes, &p);
    if (any(w.worse)) {
        copy_where(w.worse, l->before, l->sizes.n, y);
        call_at(l, l->kernels.constraints, t, y, l->work, l->out);
    }
    memcpy(l->scale, l->out + l->sizes.m, (size_t)l->sizes.m * sizeof(wide));
}

/* As `project_velocities` of equations, up to a new factor. */
static void settle_rates(struct lane_runs *l, wide t, wide *y) {
    wide *u = y + l->sizes.n, previous = all(REAL_INFINITY);
    const wide speed = largest_in(u, l->sizes.n), rounded = REAL_EPSILON * speed;
    const wide rounding = chosen(rounded < all(l->adaptive ? R(RATES_LEFT) * R(l->task.atol) : 0), rounded, all(0));
    mask open = ~l->failed, settled = {0};
    const mask begun = open;
    for (int k = 0; k < RATE_PROJECTIONS && any(open); k++) {
        call_at(l, l->kernels.velocity_constraints, t, y, l->work, l->rates);
        const wide worst = worst_of(l, l->rates, l->scale);
        l->failed |= open & ~is_finite(worst);
        settled |= open & (worst <= rounding);
        open &= (worst > rounding) & (worst <= R(0.5) * previous);
        previous = chosen(open, worst, previous);
        if (any(open))
            correct(l, open, t, y, l->rates, u);
    }
    l->failed |= begun & ~(settled | (previous <= ROUND_OFF * speed));
}

static void project_lanes(struct lane_runs *l, wide t, wide *y, int places_only) {
    if (l->sizes.m == 0)
        return;
    lane_factor(l, t, y);
    close_lanes(l, t, y);
    if (!places_only)
        settle_rates(l, t, y);
}

/* Follow drift of constraints and energy, as the loop of a single run does. */
static void monitor(struct lane_runs *l, wide t) {
    const ptrdiff_t n = l->sizes.n, m = l->sizes.m;
    if (m) {
        call_at(l, l->kernels.constraints, t, l->y, l->work, l->out);
        call_at(l, l->kernels.velocity_constraints, t, l->y, l->work, l->rates);
        const wide error = worst_of(l, l->out, l->out + m), rate = worst_of(l, l->rates, l->out + m);
        l->position_drift = larger(l->position_drift, error);
        l->failed |= ~(is_finite(error) & is_finite(rate)) | (l->position_drift > R(l->task.max_drift));
    }
    call_at(l, l->kernels.energy, t, l->y, l->work, l->energies);
    wide total = l->energies[0] + l->energies[1];
    if (l->sizes.extra)
        total -= l->y[2 * n];
    l->failed |= ~is_finite(total);
    l->energy_start = chosen(l->energy_start == REAL_INFINITY, total, l->energy_start);
    l->energy_drift = larger(l->energy_drift, magnitude(total - l->energy_start));
}

/* Copy the state of a lane into its row of samples. */
static void record_lane(const struct lane_runs *l, const wide *y, int lane, ptrdiff_t sample, real *samples) {
    for (ptrdiff_t i = 0; i < l->dim; i++)
        samples[(lane * l->task.samples + sample) * l->dim + i] = y[i][lane];
}

/* to = y + h times the sum of the first derivatives by their weights, one after the other. */
static void add_derivatives(const struct lane_runs *l, const real *weights, long count, real h, wide *to) {
    real factors[MOST_STAGES];
    for (long j = 0; j < count; j++)
        factors[j] = h * weights[j];
    for (ptrdiff_t i = 0; i < l->dim; i++) {
        wide sum = l->y[i];
        for (long j = 0; j < count; j++)
            sum += factors[j] * l->own[j * l->dim + i];
        to[i] = sum;
    }
}

static void fill_stage(struct lane_runs *l, const struct tableau *of, const struct lane_step *x, ptrdiff_t s) {
    const real t = x->t[0], h = x->h[0];
    add_derivatives(l, of->a + s * of->all, s, h, l->stage);
    lane_derivative(l, all(t + of->c[s] * h), l->stage, l->own + s * l->dim);
}

/* Take an explicit step, which all lanes take at one time, and leave the derivatives at its end behind those of the
   stages. */
static void take_step(struct lane_runs *l, const struct lane_step *x) {
    const struct tableau of = tableau_of(&l->scheme);
    const real h = x->h[0];
    for (ptrdiff_t s = 1; s < of.stages; s++)
        fill_stage(l, &of, x, s);
    add_derivatives(l, of.b, of.stages, h, l->y_new);
    fail_unless_finite(l, l->y_new);
    project_lanes(l, x->t_new, l->y_new, 0);
    lane_derivative(l, x->t_new, l->y_new, l->own + of.stages * l->dim);
    fail_unless_finite(l, l->own + of.stages * l->dim);
}

#include "series_vectors.h"

static int by_series(const struct lane_runs *l) {
    return l->sizes.series_rows > 0;
}

static void begin_runs(struct lane_runs *l, const real *parameter_rows, const real *y0) {
    const ptrdiff_t parameters = l->sizes.parameters;
    const wide t = all(R(l->task.t0));
    load(parameter_rows, parameters, l->p);
    load(y0, l->dim, l->y);
    l->p[parameters + l->sizes.derived] = all(R(l->sizes.rank_tolerance));
    l->position_drift = l->energy_drift = all(0);
    l->energy_start = all(REAL_INFINITY);
    l->failed = (mask){0};
    if (l->kernels.setup != NULL)
        call(l->kernels.setup, NULL, NULL, NULL, l->p, NULL, l->p + parameters);
    project_lanes(l, t, l->y, 0);
    if (by_series(l)) {
        begin_series_of_lanes(l, t);
    } else {
        lane_derivative(l, t, l->y, l->own);
        fail_unless_finite(l, l->own);
    }
    monitor(l, t);
}

/* Write the states of the lanes at times in a step, not projected; the first of a step needs further stages. */
static void interpolate_lanes(struct lane_runs *l, const struct lane_step *x, wide at, int first) {
    if (by_series(l)) {
        const struct series s = series_of(l, l->series.present);
        const wide part = (at - x->t) / x->h;
        state_of_series(&s, part * x->h, l->stage, l->series.changes);
        return;
    }
    const struct tableau of = tableau_of(&l->scheme);
    real weights[MOST_STAGES];
    for (ptrdiff_t s = of.stages + 1; s < of.all && first; s++)
        fill_stage(l, &of, x, s);
    dense_weights(&of, x->h[0], (at[0] - x->t[0]) / x->h[0], weights);
    add_derivatives(l, weights, of.all, R(1), l->stage);
}

/* Record the samples of a step; `next` counts those of each lane. */
static void record_step(struct lane_runs *l, const struct lane_step *x, const real *times, ptrdiff_t *next, real *samples) {
    for (int first = 1;; first = 0) {
        mask due = {0}, inside;
        wide at = x->t_new;
        for (int lane = 0; lane < WIDTH; lane++)
            if (x->taken[lane] && next[lane] < l->task.samples && times[next[lane]] <= x->t_new[lane])
                due[lane] = -1, at[lane] = times[next[lane]];
        if (!any(due))
            return;
        inside = due & (at != x->t_new);
        if (any(inside)) {
            interpolate_lanes(l, x, at, first);
            copy_where(~inside, l->y_new, l->dim, l->stage);
            project_lanes(l, at, l->stage, (int)l->task.places_only);
        }
        for (int lane = 0; lane < WIDTH; lane++)
            if (due[lane])
                record_lane(l, inside[lane] ? l->stage : l->y_new, lane, next[lane]++, samples);
    }
}

static void run_lanes(struct lane_runs *l, const real *parameter_rows, const real *y0, const real *times, long most,
                      real *samples, real *drifts, char *failed) {
    const wide end = all(R(l->task.t_end));
    struct lane_step x = {.t = all(R(l->task.t0))};
    wide left = all(0); /* rounding error of the time of fixed steps, which would add up */
    ptrdiff_t next[WIDTH] = {0};
    begin_runs(l, parameter_rows, y0);
    for (int lane = 0; lane < WIDTH; lane++)
        while (next[lane] < l->task.samples && times[next[lane]] <= R(l->task.t0))
            record_lane(l, l->y, lane, next[lane]++, samples);
    for (long turn = 0; turn < most && any(~l->failed & (x.t < end)) && !is_interrupted(turn); turn++) {
        const wide length = l->adaptive ? length_of_step(l) : all(R(l->task.step));
        x.t_new = x.t + (length + left);
        const mask last = (x.t_new >= end) | (end - x.t_new < R(1e-9) * length);
        x.t_new = chosen(last, end, x.t_new), x.h = chosen(last, end - x.t, length);
        x.open = ~l->failed & (x.t < end);
        if (!by_series(l)) /* all lanes have one time */
            x.open = ~(mask){0};
        x.taken = x.open;
        const mask failed_before = l->failed;
        l->failed |= ~(length > R(10) * REAL_EPSILON * larger(magnitude(x.t), REAL_EPSILON * end));
        if (by_series(l))
            take_series_step(l, &x, length);
        else
            take_step(l, &x);
        record_step(l, &x, times, next, samples);
        l->failed = failed_before | (l->failed & x.open);
        if (!l->adaptive)
            left = (x.h + left) - (x.t_new - x.t);
        x.t = chosen(x.taken, x.t_new, x.t);
        copy_where(x.taken, l->y_new, l->dim, l->y);
        if (by_series(l))
            accept_series(l, &x);
        else
            memcpy(l->own, l->own + l->scheme.counts[SOLUTION_STAGES] * l->dim, (size_t)l->dim * sizeof(wide));
        monitor(l, x.t);
    }
    for (int lane = 0; lane < WIDTH; lane++) {
        drifts[2 * lane] = l->position_drift[lane];
        drifts[2 * lane + 1] = l->energy_drift[lane];
        failed[lane] = (char)(has(l->failed, lane) || x.t[lane] < end[lane] || next[lane] < l->task.samples);
    }
}

static const struct lane_runs_api run_functions = {
    .lanes_struct = sizeof(struct lane_runs),
    .bytes = lane_run_bytes,
    .bind = lane_run_bind,
    .run = run_lanes,
};
