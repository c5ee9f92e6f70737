/* The functions of lane_runs.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "corrections.h"
#include "lane_runs.h"
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
    struct equations e;
    struct scheme scheme;
    struct task task;
    int adaptive;
    struct lane_series series;
    wide *y, *y_new, *stage, *own;
    wide position_drift, energy_drift, energy_start;
    mask failed;
};

static size_t lane_run_place(struct lane_runs *l, const struct sizes *s, const struct scheme *scheme, void *memory) {
    const ptrdiff_t dim = 2 * s->n + s->extra;
    const int explicit = s->series_rows == 0;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(l->y, dim),
        ARENA_ARRAY(l->y_new, dim),
        ARENA_ARRAY(l->stage, dim),
        ARENA_ARRAY(l->own, explicit ? dim * (scheme->counts[ALL_STAGES] + 1) : 0),
        ARENA_ARRAY(l->series.rows, BOTH * rows_of(HIGHEST) * s->series_rows),
        ARENA_ARRAY(l->series.f_new, dim),
        ARENA_ARRAY(l->series.changes, s->n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t lane_run_bytes(const struct sizes *sizes, const struct scheme *scheme) {
    struct lane_runs counted;
    return equations_bytes(sizes) + lane_run_place(&counted, sizes, scheme, NULL);
}

static void lane_run_bind(struct lane_runs *l, const struct sizes *sizes, const struct kernels *kernels,
                          const struct scheme *scheme, const struct task *task, void *memory) {
    equations_bind(&l->e, sizes, kernels, memory);
    lane_run_place(l, sizes, scheme, (char *)memory + l->e.bytes);
    l->scheme = *scheme, l->task = *task;
    l->adaptive = scheme->adaptive && (task->rtol > 0.0 || task->atol > 0.0);
    l->e.finest = l->adaptive ? task->atol : 0.0;
}

static void fail_unless_finite(struct lane_runs *l, const wide *values) {
    l->failed |= ~is_finite(largest_in(values, l->e.dim));
}

/* Factorise at y; mark lanes near a loss of rank as failed. */
static void lane_factor(struct lane_runs *l, wide t, const wide *y) {
    struct equations *e = &l->e;
    call_at(e, e->kernels.factor, t, y, e->factors, e->out);
    for (ptrdiff_t i = 0; i < e->n + e->m; i++) {
        const wide left = part_left(e, e->factors, i);
        const real near = l->scheme.near ? R(NEARBY) : R(NEAR);
        const real least = i < e->n ? R(MASSLESS) : real_fmax(near, R(e->sizes.rank_tolerance));
        l->failed |= ~((left > least) & is_finite(left));
    }
}

/* Project the states of the lanes; those that need a new factor for their velocities fail. */
static void project_lanes(struct lane_runs *l, wide t, wide *y, int places_only) {
    struct equations *e = &l->e;
    struct newton w;
    if (e->m == 0)
        return;
    lane_factor(l, t, y);
    l->failed |= ~closed_positions(e, ~l->failed, t, y, &w);
    if (places_only)
        return;
    const wide speed = largest_in(y + e->n, e->n), rounding = rounding_of_rates(e, speed);
    wide before = all(REAL_INFINITY);
    mask finite = ~(mask){0};
    const mask open = corrected_velocities(e, ~l->failed, t, y, rounding, &before, &finite);
    l->failed |= ~finite | (open & ~(before <= ROUND_OFF * speed));
}

/* Follow drift of constraints and energy, as the loop of a single run does. */
static void monitor(struct lane_runs *l, wide t) {
    struct equations *e = &l->e;
    if (e->m) {
        const wide error = position_error(e, t, l->y), rate = velocity_error(e, t, l->y);
        l->position_drift = larger(l->position_drift, error);
        l->failed |= ~(is_finite(error) & is_finite(rate)) | (l->position_drift > R(l->task.max_drift));
    }
    measure_energy(e, t, l->y);
    wide total = e->energies[0] + e->energies[1];
    if (e->extra)
        total -= l->y[2 * e->n];
    l->failed |= ~is_finite(total);
    l->energy_start = chosen(l->energy_start == REAL_INFINITY, total, l->energy_start);
    l->energy_drift = larger(l->energy_drift, magnitude(total - l->energy_start));
}

/* Copy the state of a lane into its row of samples. */
static void record_lane(const struct lane_runs *l, const wide *y, int lane, ptrdiff_t sample, real *samples) {
    for (ptrdiff_t i = 0; i < l->e.dim; i++)
        samples[(lane * l->task.samples + sample) * l->e.dim + i] = y[i][lane];
}

/* to = y + h times the sum of the first derivatives by their weights, one after the other. */
static void add_derivatives(const struct lane_runs *l, const real *weights, long count, real h, wide *to) {
    real factors[MOST_STAGES];
    for (long j = 0; j < count; j++)
        factors[j] = h * weights[j];
    for (ptrdiff_t i = 0; i < l->e.dim; i++) {
        wide sum = l->y[i];
        for (long j = 0; j < count; j++)
            sum += factors[j] * l->own[j * l->e.dim + i];
        to[i] = sum;
    }
}

static void fill_stage(struct lane_runs *l, const struct tableau *of, const struct lane_step *x, ptrdiff_t s) {
    const real t = x->t[0], h = x->h[0];
    add_derivatives(l, of->a + s * of->all, s, h, l->stage);
    derivative(&l->e, all(t + of->c[s] * h), l->stage, l->own + s * l->e.dim);
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
    derivative(&l->e, x->t_new, l->y_new, l->own + of.stages * l->e.dim);
    fail_unless_finite(l, l->own + of.stages * l->e.dim);
}

#include "series_vectors.h"

static int by_series(const struct lane_runs *l) {
    return l->e.sizes.series_rows > 0;
}

static void begin_runs(struct lane_runs *l, const real *parameter_rows, const real *y0) {
    const wide t = all(R(l->task.t0));
    load(parameter_rows, l->e.sizes.parameters, l->e.p);
    set_up(&l->e);
    load(y0, l->e.dim, l->y);
    l->position_drift = l->energy_drift = all(0);
    l->energy_start = all(REAL_INFINITY);
    l->failed = (mask){0};
    project_lanes(l, t, l->y, 0);
    if (by_series(l)) {
        begin_series_of_lanes(l, t);
    } else {
        derivative(&l->e, t, l->y, l->own);
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
            copy_where(~inside, l->y_new, l->e.dim, l->stage);
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
        copy_where(x.taken, l->y_new, l->e.dim, l->y);
        if (by_series(l))
            accept_series(l, &x);
        else
            copy(l->own + l->scheme.counts[SOLUTION_STAGES] * l->e.dim, l->e.dim, l->own);
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
