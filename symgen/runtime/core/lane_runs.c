#include "lane_runs.h"

#include <string.h>

#include "arena.h"
#include "lanes.h"
#include "stages.h"
#include "tableau.h"

static size_t place(struct lane_runs *l, const struct lane_sizes *s, const struct scheme *scheme, void *memory) {
    const ptrdiff_t w = s->lanes, whole = s->n + s->m + 1, dim = 2 * s->n + s->extra;
    const ptrdiff_t out = whole > 2 * s->m + 1 ? whole : 2 * s->m + 1;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(l->p, w * (s->parameters + s->derived + 1)),
        ARENA_ARRAY(l->time, w),
        ARENA_ARRAY(l->y, w * dim),
        ARENA_ARRAY(l->y_new, w * dim),
        ARENA_ARRAY(l->stage, w * dim),
        ARENA_ARRAY(l->own, w * dim * (scheme->counts[ALL_STAGES] + 1)),
        ARENA_ARRAY(l->work, w * (s->work + 1)),
        ARENA_ARRAY(l->factors, w * (s->work + 1)),
        ARENA_ARRAY(l->out, w * out),
        ARENA_ARRAY(l->rhs, w * whole),
        ARENA_ARRAY(l->rates, w * (s->m + 1)),
        ARENA_ARRAY(l->scale, w * (s->m + 1)),
        ARENA_ARRAY(l->energies, w * 3),
        ARENA_ARRAY(l->before, w * s->n),
        ARENA_ARRAY(l->previous, w),
        ARENA_ARRAY(l->size, w),
        ARENA_ARRAY(l->position_drift, w),
        ARENA_ARRAY(l->energy_drift, w),
        ARENA_ARRAY(l->energy_start, w),
        ARENA_ARRAY(l->active, w),
        ARENA_ARRAY(l->failed, w),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct lane_sizes *sizes, const struct scheme *scheme) {
    struct lane_runs counted;
    return place(&counted, sizes, scheme, NULL);
}

static void bind(struct lane_runs *l, const struct lane_sizes *sizes, const struct kernels *kernels,
                 const struct scheme *scheme, const struct task *task, void *memory) {
    l->sizes = *sizes, l->kernels = *kernels, l->scheme = *scheme, l->task = *task;
    l->dim = 2 * sizes->n + sizes->extra;
    place(l, sizes, scheme, memory);
}

/* Call a kernel at the states y and one time. */
static void call(struct lane_runs *l, kernel function, real t, const real *y, real *work, real *out) {
    for (ptrdiff_t lane = 0; lane < l->sizes.lanes; lane++)
        l->time[lane] = t;
    function(l->time, y, y + l->sizes.n * l->sizes.lanes, l->p, work, out);
}

LANES static void add(ptrdiff_t count, const real *restrict from, real *restrict to) {
    for (ptrdiff_t i = 0; i < count; i++)
        to[i] += from[i];
}

static void fail_unless_finite(struct lane_runs *l, const real *values) {
    const ptrdiff_t w = l->sizes.lanes;
    for (ptrdiff_t i = 0; i < l->dim * w; i++)
        if (!real_isfinite(values[i]))
            l->failed[i % w] = 1;
}

/* As `derivative` of equations. */
static void lane_derivative(struct lane_runs *l, real t, const real *y, real *dy) {
    const ptrdiff_t n = l->sizes.n, w = l->sizes.lanes;
    memcpy(dy, y + n * w, (size_t)(n * w) * sizeof(real));
    call(l, l->kernels.accelerations, t, y, l->work, l->out);
    for (int k = 0; k < REFINEMENTS && l->kernels.residual != NULL; k++) {
        call(l, l->kernels.residual, t, y, l->out, l->rhs);
        call(l, l->kernels.solve, t, y, l->work, l->rhs);
        add((n + l->sizes.m) * w, l->rhs, l->out);
    }
    memcpy(dy + n * w, l->out, (size_t)(n * w) * sizeof(real));
    if (l->sizes.extra) {
        call(l, l->kernels.energy, t, y, l->out, l->energies);
        memcpy(dy + 2 * n * w, l->energies + 2 * w, (size_t)w * sizeof(real));
    }
}

/* Factorise at y; mark lanes near a loss of rank as failed. */
static void lane_factor(struct lane_runs *l, real t, const real *y) {
    const ptrdiff_t n = l->sizes.n, w = l->sizes.lanes;
    call(l, l->kernels.factor, t, y, l->factors, l->out);
    for (ptrdiff_t i = 0; i < n + l->sizes.m; i++) {
        const real *pivot = l->factors + (l->sizes.first_pivot + 2 * i) * w, sign = i < n ? R(1) : R(-1);
        const double least = i < n ? MASSLESS : fmax(NEAR, l->sizes.rank_tolerance);
        for (ptrdiff_t lane = 0; lane < w; lane++) {
            const real terms = real_fabs(pivot[w + lane]);
            const double ratio = terms != 0 ? (double)(sign * pivot[lane] / terms) : 0.0;
            if (!(ratio > least) || !isfinite(ratio))
                l->failed[lane] = 1;
        }
    }
}

/* The largest row over its scale, in one lane. */
static real worst_of(const struct lane_runs *l, const real *rows, const real *scales, ptrdiff_t lane) {
    real worst = 0;
    for (ptrdiff_t i = 0; i < l->sizes.m && worst == worst; i++) {
        const real error = real_fabs(rows[i * l->sizes.lanes + lane]) / scales[i * l->sizes.lanes + lane];
        if (!(error <= worst))
            worst = error;
    }
    return worst;
}

/* Solve for the negative rows with the last factor; add the solution to `to` in active lanes. */
static void correct(struct lane_runs *l, real t, const real *y, const real *rows, real *to) {
    const ptrdiff_t n = l->sizes.n, w = l->sizes.lanes;
    memset(l->rhs, 0, (size_t)(n * w) * sizeof(real));
    for (ptrdiff_t i = 0; i < l->sizes.m * w; i++)
        l->rhs[n * w + i] = -rows[i];
    call(l, l->kernels.solve, t, y, l->factors, l->rhs);
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t lane = 0; lane < w; lane++)
            if (l->active[lane])
                to[i * w + lane] += l->rhs[i * w + lane];
}

static void keep_scale(struct lane_runs *l, ptrdiff_t lane) {
    const ptrdiff_t w = l->sizes.lanes, m = l->sizes.m;
    for (ptrdiff_t i = 0; i < m; i++)
        l->scale[i * w + lane] = l->out[(m + i) * w + lane];
}

/* Largest magnitude of some entries of a lane. */
static real largest_in(const struct lane_runs *l, const real *values, ptrdiff_t count, ptrdiff_t lane, real largest) {
    for (ptrdiff_t i = 0; i < count; i++)
        largest = real_fmax(largest, real_fabs(values[i * l->sizes.lanes + lane]));
    return largest;
}

/* Apply the criteria of `project_positions` to one lane; return 1 if its positions need another correction. */
static int needs_correction(struct lane_runs *l, int k, real *y, ptrdiff_t lane) {
    const ptrdiff_t n = l->sizes.n, m = l->sizes.m, w = l->sizes.lanes;
    const real worst = worst_of(l, l->out, l->out + m * w, lane);
    if (!real_isfinite(worst)) {
        l->failed[lane] = 1;
        return 0;
    }
    if (k == 0)
        l->size[lane] = largest_in(l, l->out + m * w, m, lane, largest_in(l, y, n, lane, 0));
    const real size = l->size[lane];
    if (k && worst > REAL_EPSILON * size && worst > R(0.5) * l->previous[lane]) {
        l->failed[lane] |= worst > R(1e4) * REAL_EPSILON * size;
        if (worst > l->previous[lane])
            for (ptrdiff_t i = 0; i < n; i++)
                y[i * w + lane] = l->before[i * w + lane];
        else
            keep_scale(l, lane);
        return 0;
    }
    keep_scale(l, lane);
    l->previous[lane] = worst;
    for (ptrdiff_t i = 0; i < n; i++)
        l->before[i * w + lane] = y[i * w + lane];
    return worst > REAL_EPSILON * size;
}

/* As `project_positions` of equations. */
static void close_lanes(struct lane_runs *l, real t, real *y) {
    const ptrdiff_t w = l->sizes.lanes;
    ptrdiff_t left = 0;
    for (ptrdiff_t lane = 0; lane < w; lane++)
        left += l->active[lane] = !l->failed[lane];
    for (int k = 0; k < PROJECTIONS && left; k++) {
        call(l, l->kernels.constraints, t, y, l->work, l->out);
        left = 0;
        for (ptrdiff_t lane = 0; lane < w; lane++)
            if (l->active[lane])
                left += l->active[lane] = (char)needs_correction(l, k, y, lane);
        if (left)
            correct(l, t, y, l->out, y);
    }
    for (ptrdiff_t lane = 0; lane < w; lane++)
        l->failed[lane] |= l->active[lane];
}

/* As `project_velocities` of equations, for a run without tolerance and up to a new factor. */
static void settle_rates(struct lane_runs *l, real t, real *y) {
    const ptrdiff_t n = l->sizes.n, w = l->sizes.lanes;
    ptrdiff_t left = 0;
    for (ptrdiff_t lane = 0; lane < w; lane++) {
        left += l->active[lane] = !l->failed[lane];
        l->previous[lane] = REAL_INFINITY;
        l->size[lane] = largest_in(l, y + n * w, n, lane, 0);
    }
    for (int k = 0; k < RATE_PROJECTIONS && left; k++) {
        call(l, l->kernels.velocity_constraints, t, y, l->work, l->rates);
        left = 0;
        for (ptrdiff_t lane = 0; lane < w; lane++) {
            if (!l->active[lane])
                continue;
            const real worst = worst_of(l, l->rates, l->scale, lane);
            l->failed[lane] |= !real_isfinite(worst);
            l->active[lane] = !(l->failed[lane] || worst <= 0 || worst > R(0.5) * l->previous[lane]);
            left += l->active[lane];
            if (l->active[lane])
                l->previous[lane] = worst;
        }
        if (left)
            correct(l, t, y, l->rates, y + n * w);
    }
    for (ptrdiff_t lane = 0; lane < w; lane++)
        if (l->active[lane] && !(l->previous[lane] <= R(1e4) * REAL_EPSILON * l->size[lane]))
            l->failed[lane] = 1;
}

static void project_lanes(struct lane_runs *l, real t, real *y, int places_only) {
    if (l->sizes.m == 0)
        return;
    lane_factor(l, t, y);
    close_lanes(l, t, y);
    if (!places_only)
        settle_rates(l, t, y);
}

/* Follow drift of constraints and energy, as the loop of a single run does. */
static void monitor(struct lane_runs *l, real t) {
    const ptrdiff_t n = l->sizes.n, m = l->sizes.m, w = l->sizes.lanes;
    if (m) {
        call(l, l->kernels.constraints, t, l->y, l->work, l->out);
        call(l, l->kernels.velocity_constraints, t, l->y, l->work, l->rates);
    }
    for (ptrdiff_t lane = 0; lane < w && m; lane++) {
        const real error = worst_of(l, l->out, l->out + m * w, lane), rate = worst_of(l, l->rates, l->out + m * w, lane);
        l->failed[lane] |= !(real_isfinite(error) && real_isfinite(rate));
        l->position_drift[lane] = real_fmax(l->position_drift[lane], error);
        l->failed[lane] |= (double)l->position_drift[lane] > l->task.max_drift;
    }
    call(l, l->kernels.energy, t, l->y, l->work, l->energies);
    for (ptrdiff_t lane = 0; lane < w; lane++) {
        const real total = l->energies[lane] + l->energies[w + lane] - (l->sizes.extra ? l->y[2 * n * w + lane] : R(0));
        l->failed[lane] |= !real_isfinite(total);
        if (l->energy_start[lane] == REAL_INFINITY)
            l->energy_start[lane] = total;
        l->energy_drift[lane] = real_fmax(l->energy_drift[lane], real_fabs(total - l->energy_start[lane]));
    }
}

/* Copy the states of all lanes into their rows of samples. */
static void record(const struct lane_runs *l, const real *y, ptrdiff_t sample, real *samples) {
    const ptrdiff_t w = l->sizes.lanes;
    for (ptrdiff_t lane = 0; lane < w; lane++)
        for (ptrdiff_t i = 0; i < l->dim; i++)
            samples[(lane * l->task.samples + sample) * l->dim + i] = y[i * w + lane];
}

/* The interpolant at the part theta of a step, in l->stage: as `interpolate` of explicit methods. */
static void interpolate(struct lane_runs *l, real h, real theta) {
    const struct tableau x = tableau_of(&l->scheme);
    real weights[MOST_STAGES];
    dense_weights(&x, h, theta, weights);
    add_stages(weights, x.all, R(1), l->own, l->dim * l->sizes.lanes, l->y, l->stage);
}

/* Take a step to t_new, and leave the derivatives at its end behind those of the stages. */
static void take_step(struct lane_runs *l, real t, real h, real t_new) {
    const struct tableau x = tableau_of(&l->scheme);
    const ptrdiff_t row = l->dim * l->sizes.lanes;
    for (ptrdiff_t s = 1; s < x.stages; s++) {
        add_stages(x.a + s * x.all, s, h, l->own, row, l->y, l->stage);
        lane_derivative(l, t + x.c[s] * h, l->stage, l->own + s * row);
    }
    add_stages(x.b, x.stages, h, l->own, row, l->y, l->y_new);
    fail_unless_finite(l, l->y_new);
    project_lanes(l, t_new, l->y_new, 0);
    lane_derivative(l, t_new, l->y_new, l->own + x.stages * row);
    fail_unless_finite(l, l->own + x.stages * row);
}

static void begin(struct lane_runs *l, const real *given, const real *y0) {
    const ptrdiff_t w = l->sizes.lanes, parameters = l->sizes.parameters;
    for (ptrdiff_t lane = 0; lane < w; lane++) {
        for (ptrdiff_t i = 0; i < parameters; i++)
            l->p[i * w + lane] = given[lane * parameters + i];
        l->p[(parameters + l->sizes.derived) * w + lane] = R(l->sizes.rank_tolerance);
        for (ptrdiff_t i = 0; i < l->dim; i++)
            l->y[i * w + lane] = y0[lane * l->dim + i];
        l->position_drift[lane] = l->energy_drift[lane] = 0;
        l->energy_start[lane] = REAL_INFINITY;
        l->failed[lane] = 0;
    }
    if (l->kernels.setup != NULL)
        l->kernels.setup(NULL, NULL, NULL, l->p, NULL, l->p + parameters * w);
    project_lanes(l, R(l->task.t0), l->y, 0);
    lane_derivative(l, R(l->task.t0), l->y, l->own);
    fail_unless_finite(l, l->own);
    monitor(l, R(l->task.t0));
}

static int all_failed(const struct lane_runs *l) {
    return memchr(l->failed, 0, (size_t)l->sizes.lanes) == NULL;
}

/* Record the samples in a step of length h; return how many samples there are then. */
static ptrdiff_t record_step(struct lane_runs *l, real t, real h, real t_new, const real *times, ptrdiff_t recorded, real *samples) {
    for (; recorded < l->task.samples && times[recorded] <= t_new; recorded++) {
        if (times[recorded] == t_new) {
            record(l, l->y_new, recorded, samples);
            continue;
        }
        interpolate(l, h, (times[recorded] - t) / h);
        project_lanes(l, times[recorded], l->stage, (int)l->task.places_only);
        record(l, l->stage, recorded, samples);
    }
    return recorded;
}

static void run(struct lane_runs *l, const void *given, const void *y0, const void *times_, void *samples, void *drifts,
                char *failed) {
    const ptrdiff_t w = l->sizes.lanes, row = l->dim * w, stages = l->scheme.counts[SOLUTION_STAGES];
    const real *times = times_, t_end = R(l->task.t_end);
    real t = R(l->task.t0), t_left = 0;
    ptrdiff_t recorded = 0;
    begin(l, given, y0);
    for (; recorded < l->task.samples && times[recorded] <= t; recorded++)
        record(l, l->y, recorded, samples);
    for (ptrdiff_t turn = 0; t < t_end && !all_failed(l) && !is_interrupted(turn); turn++) {
        real h = R(l->task.step), t_new = t + (h + t_left);
        if (!(h > R(10) * REAL_EPSILON * real_fmax(real_fabs(t), REAL_EPSILON * t_end)))
            memset(l->failed, 1, (size_t)w);
        if (t_new >= t_end || t_end - t_new < R(1e-9) * h) {
            t_new = t_end;
            h = t_end - t;
        }
        take_step(l, t, h, t_new);
        recorded = record_step(l, t, h, t_new, times, recorded, samples);
        t_left = (h + t_left) - (t_new - t);
        t = t_new;
        memcpy(l->y, l->y_new, (size_t)row * sizeof(real));
        memcpy(l->own, l->own + stages * row, (size_t)row * sizeof(real));
        monitor(l, t);
    }
    for (ptrdiff_t lane = 0; lane < w; lane++) {
        ((real *)drifts)[2 * lane] = l->position_drift[lane];
        ((real *)drifts)[2 * lane + 1] = l->energy_drift[lane];
        failed[lane] = (char)(l->failed[lane] || recorded < l->task.samples);
    }
}

const struct lane_api symgen_lane_runs = {
    .lane_struct = sizeof(struct lane_runs),
    .bytes = bytes,
    .bind = bind,
    .run = run,
};
