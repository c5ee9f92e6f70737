/* Power series in time: the generated kernel `series` and one factorisation a step give all coefficients
 * (A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99-117).
 */
#include "arena.h"
#include "run.h"
#include "series_steps.h"
#include "zeros.h"

/* Steps that values of events and switching points shorten, at most. */
#define SHORTENED R(1e-3)

struct taylor {
    long *present;    /* which of the two series is that at y */
    long *order;
    real *longest;    /* of each series: its step within the tolerance, may be infinite */
    real *changes;    /* accelerations of the series, and the power behind them */
    real *at_end;     /* those of the end of the step: the projection looks inside the step */
    long *expanded;   /* whether the other series is that at y_new */
    real *f, *f_new;
    real *rows;       /* of each series: coefficients, rows as the kernel writes them */
};

/* Point all arrays into memory, or only count their bytes: those of the rows depend on the order. */
static size_t place(struct taylor *x, const struct equations *e, long order, void *memory) {
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->present, 1),
        ARENA_ARRAY(x->order, 1),
        ARENA_ARRAY(x->longest, BOTH),
        ARENA_ARRAY(x->changes, e->n + 1),
        ARENA_ARRAY(x->at_end, e->n + 1),
        ARENA_ARRAY(x->expanded, 1),
        ARENA_ARRAY(x->f, e->dim),
        ARENA_ARRAY(x->f_new, e->dim),
        ARENA_ARRAY(x->rows, BOTH * rows_of(order) * e->sizes.series_rows),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct run *run, const long *counts) {
    struct taylor counted;
    return place(&counted, run->e, order_of(counts, &run->task), NULL);
}

static struct taylor taylor_of(const struct run *run) {
    struct taylor x;
    memcpy(&x, run->arrays, sizeof x);
    return x;
}

static void bind(struct run *run) {
    struct taylor x;
    _Static_assert(sizeof x <= sizeof run->arrays, "the arrays of a run have room for those of power series");
    place(&x, run->e, 0, run->own);
    memcpy(run->arrays, &x, sizeof x);
    run->f = x.f, run->f_new = x.f_new;
}

static ptrdiff_t numbers(const long *counts) {
    return counts[ORDER] == 0 || (LOWEST <= counts[ORDER] && counts[ORDER] <= HIGHEST) ? 0 : -1;
}

/* One of the two series. */
static struct series series_of(const struct run *run, long which) {
    const struct taylor x = taylor_of(run);
    return series_at(run->e, *x.order, x.rows, which);
}

/* Values of the kernel `events` that are watched for zeros: those of events and of switching points. */
static long watched(const struct sizes *s) {
    return s->series_watched ? s->events + s->switches : 0;
}

static int is_probed(const struct run *run, long i) {
    return i < run->e->sizes.events && run->terminal[i] & PROBED;
}

/* The part of a step of this length in which the last terms of the watched values are within the tolerance, relative to the
   value or to its change in the step; in the shortest, probes take the place of series that end there, as at a kink. */
static real resolved(const struct run *run, const real *rows, long order, real length) {
    const struct sizes *s = &run->e->sizes;
    const real least = SHORTENED * length;
    for (long i = 0; i < watched(s); i++) {
        if (is_probed(run, i))
            continue;
        const real *value = rows + s->series_rows - s->series_watched + i;
        const real size = R(run->task.atol) + R(run->task.rtol) * real_fabs(value[0]);
        const real rate = R(run->task.rtol) * real_fabs(value[s->series_rows]);
        for (long k = order - 1; k > 1 && k > order - 3; k--) {
            const real last = real_fabs(value[k * s->series_rows]);
            if (!real_isfinite(last))
                length = least;
            else if (last > 0)
                length = real_fmin(length, real_fmax(real_pow(size / last, R(1) / R(k)), real_pow(rate / last, R(1) / R(k - 1))));
        }
    }
    return real_fmax(length, least);
}

/* Expand the motion from (t, y) into one of the two series; write dy/dt. Behind the end of the run, accelerations are the
   last coefficients. */
static int expand(struct run *run, long which, real t, const real *y, real *dy) {
    const struct taylor x = taylor_of(run);
    struct equations *e = run->e;
    const int last = is_last(run, t);
    const struct series s = series_of(run, which);
    const int status = (e->of->prepare_series ? e->of->prepare_series : e->of->factorise)(e, t, y);
    if (status != DONE)
        return status;
    expand_series(e, &s, last ? 1 : s.order - 1, t, y, dy);
    if (!run->scheme.adaptive || last)
        return DONE;
    x.longest[which] = length_of_series(&s, &run->task, y);
    return x.longest[which] > 0 ? DONE : NOT_FINITE;
}

/* Write the state a time h after y; its accelerations and the power behind them to x.changes. */
static void evaluate(const struct run *run, real h, real *y) {
    const struct taylor x = taylor_of(run);
    const struct series s = series_of(run, *x.present);
    state_of_series(&s, h, y, x.changes);
}

static int begin(struct run *run) {
    const struct taylor x = taylor_of(run);
    *x.present = 0, *x.order = order_of(run->scheme.counts, &run->task);
    return expand(run, 0, run->state->t, run->y, run->f);
}

static long polynomial(const struct run *run, long i, real h, real *c) {
    const struct taylor x = taylor_of(run);
    const struct sizes *s = &run->e->sizes;
    const long row = s->series_rows, degree = *x.order - 1, watched_at = row - s->series_watched + i;
    const real *at_y = series_of(run, *x.present).rows + watched_at;
    const real *at_y_new = series_of(run, 1 - *x.present).rows + watched_at;
    real power = 1;
    if (is_probed(run, i))
        return -1;
    for (long k = 0; k <= degree; k++, power *= h)
        c[k] = at_y[k * row] * power;
    c[degree + 1] = at_y_new[row] * h;
    if (i >= watched(s))
        return degree;
    const real size = R(run->task.rtol) * (real_fabs(c[0]) + real_fabs(c[1]));
    const real of_time = real_fabs(run->state->t * at_y[row]);
    const real limit = R(run->task.atol) + size + R(16) * REAL_EPSILON * (reach_of(c, degree) + of_time);
    const int revolves = i < s->events && run->terminal[i] & REVOLVES; /* its value jumps by revolutions */
    const int joins = revolves || real_fabs(value_of(c, degree, 1) - at_y_new[0]) <= limit;
    return joins && real_fabs(c[degree]) <= limit && real_fabs(c[degree - 1]) <= limit ? degree : -1;
}

/* The part of a length in which the angles in loads stay within 3/8 of a revolution of their references: beyond a half
   they are others. */
static real within_references(const struct run *run, real length) {
    const struct sizes *s = &run->e->sizes;
    const real limit = R(2.356194490192344928846982537459627163L);
    for (long i = 0; i < 2 * s->windings; i++) {
        real c[COEFFICIENTS_AND_RATE];
        const int side = i % 2 ? 1 : -1;
        struct zeros z = {.c = c, .sign = -side, .width = 1, .noise = REAL_EPSILON};
        z.degree = polynomial(run, s->events + s->switches + i / 2, length, c);
        c[0] -= references_of_angles(run->e)[i / 2] + R(side) * limit;
        if (reach_of(c, z.degree) > real_fabs(c[0]) && next_zero(&z))
            length *= bisected(c, z.degree, z.from, z.to, z.before);
    }
    return length;
}

/* Without polynomials, events, jumps of loads and revolutions are looked for at probes, whose number in a step is that of
   shorter steps. */
static real longest(const struct run *run) {
    const struct sizes *s = &run->e->sizes;
    const struct taylor x = taylor_of(run);
    const struct series present = series_of(run, *x.present);
    /* a run that continues may end soon, and later be extended */
    const real most = real_fmax(R(run->task.t_end) - R(run->task.t0), run->state->h);
    const real length = resolved(run, present.rows, present.order, real_fmin(x.longest[*x.present], most));
    int probed = 0;
    for (long i = 0; i < s->events; i++)
        probed |= is_probed(run, i);
    if (s->series_watched && !s->choices)
        return within_references(run, probed ? R(0.25) * length : length);
    probed = s->choices ? s->switches && !s->series_watched : s->events || s->switches || s->windings || s->turns;
    return length * (probed ? R(0.25) : R(1));
}

/* The end is projected and expanded at once: accelerations and power there are compared with those of the series. A
   part of the difference is the error of a step whose last terms do not show it. */
static int step(struct run *run, real t, real h, real t_new) {
    const struct taylor x = taylor_of(run);
    const long n = run->e->n;
    (void)t;
    *x.expanded = 0;
    evaluate(run, h, run->y_new);
    copy(x.changes, run->dim - n, x.at_end);
    run->state->norm = 0;
    if (!run->scheme.adaptive)
        return DONE;
    run->state->shrink = R(SHRINK);
    if (!all_finite(run->y_new, run->dim))
        return AGAIN;
    int status = project_new_state(run, t_new);
    if (status == DONE)
        status = expand(run, 1 - *x.present, t_new, run->y_new, run->f_new);
    if (status != DONE)
        return status == NOT_FINITE ? AGAIN : status;
    *x.expanded = 1;
    memset(run->error, 0, (size_t)n * sizeof(real));
    for (long i = n; i < run->dim; i++)
        run->error[i] = error_of_series(h, x.at_end[i - n], run->f_new[i]);
    const real norm = error_norm(run, h, run->error);
    run->state->norm = norm <= 1 ? 0 : norm;
    return DONE;
}

/* The part of a term that changes a number by the tolerance. */
static real within_tolerance(const struct run *run, real number, real term) {
    return term == 0 ? REAL_INFINITY : (R(run->task.atol) + R(run->task.rtol) * real_fabs(number)) / real_fabs(term);
}

/* The derivative along the last terms, in which the stiffest part of the motion prevails, is a lower bound of the largest
   eigenvalue; rates are weighted so that an oscillation at the edge has this bound in all phases. At the edge, these terms
   are within a tenth of the tolerance, as in all steps, and the part of the motion itself is within the tolerance. Loads may
   be linear in no larger change. So small a one of positions may be lost in rounding: rates alone would be at the edge. */
static void look_for_stiffness(struct run *run, real h, real t_new) {
    const struct taylor x = taylor_of(run);
    const struct series s = series_of(run, *x.present);
    const long n = run->e->n, k = s.order - 1;
    const real *places = s.rows + k * s.row, *speeds = places + s.row, *y = run->y_new;
    const real edge = R(exp((lgamma((double)s.order) - log(10.0)) / (double)k)), weight = h / edge;
    real part = REAL_INFINITY, rates = 0, states = 0;
    for (long i = 0; i < n; i++) {
        part = real_fmin(part, within_tolerance(run, y[i], places[i]));
        part = real_fmin(part, within_tolerance(run, y[n + i], R(s.order) * speeds[i]));
    }
    if (!real_isfinite(part))
        return;
    copy(y, run->dim, run->stage);
    for (long i = 0; i < n; i++) {
        run->stage[i] += part * places[i];
        run->stage[n + i] += part * R(s.order) * speeds[i];
    }
    run->e->of->derivative(run->e, t_new, run->stage, run->error);
    for (long i = 0; i < n; i++) {
        const real place = part * places[i], speed = part * R(s.order) * speeds[i];
        const real change = weight * (run->error[n + i] - run->f_new[n + i]);
        states += place * place + weight * weight * speed * speed, rates += speed * speed + change * change;
    }
    watch_stiffness(run, t_new, states > 0 && h * real_sqrt(rates / states) > edge);
}

static int finish(struct run *run, real h, real t_new) {
    const struct taylor x = taylor_of(run);
    if (*x.expanded && run->state->settled) {
        *x.expanded = 0;
        if (is_stiffness_due(run))
            look_for_stiffness(run, h, t_new);
        return DONE;
    }
    return expand(run, 1 - *x.present, t_new, run->y_new, run->f_new);
}

static void interpolate(struct run *run, real h, real theta, real *y) {
    evaluate(run, theta * h, y);
}

static void places(const struct run *run, real h, real *q) {
    const struct series s = series_of(run, *taylor_of(run).present);
    places_of_series(&s, h, q);
}

/* A step is at most half of the radius of convergence, that of other methods up to all of it, so half of their probes do. But
   a motion may have no such radius, as a rotation at a uniform rate, and a step of it last as long as from one loss of rank to
   the next: velocities or accelerations then change by more than their size. */
static int parts(const struct run *run, real h) {
    const struct series s = series_of(run, *taylor_of(run).present);
    real sizes[3];
    for (long k = 0; k < 3; k++)
        sizes[k] = largest_of(s.rows + (k + 1) * s.row, s.n);
    const int turns = R(2) * h * sizes[1] > sizes[0] || R(3) * h * sizes[2] > sizes[1];
    return turns ? STEP_PROBES : STEP_PROBES / 2;
}

static void accept(struct run *run) {
    long *present = taylor_of(run).present;
    *present = 1 - *present;
}

static int valid(const struct run *run) {
    const struct taylor x = taylor_of(run);
    return (*x.present == 0 || *x.present == 1) && *x.order == order_of(run->scheme.counts, &run->task);
}

const struct kind taylor_kind = {
    "taylor", "order", "", 0, bytes, numbers, bind, begin, step, finish, NULL, interpolate, accept, valid, longest,
    polynomial, places, parts,
};
