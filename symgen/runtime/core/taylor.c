/* Power series in time: the generated kernel `series` and one factorisation a step give all coefficients.
 *
 * With the coefficients of q up to order k + 1 and those of the multipliers up to order k - 1, the kernel returns
 * coefficient k of the right-hand side of the equations of motion. Their solution is coefficient k of accelerations and
 * multipliers, and by it coefficient k + 2 of q (A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99-117).
 */
#include <math.h>

#include "arena.h"
#include "lanes.h"
#include "run.h"

/* The count of a scheme: the order of the series; 0 for the order that the tolerance needs. */
enum { ORDER };
enum { LOWEST = 3 };
enum { HIGHEST = 64 };
/* Rows of coefficients: the kernel writes one more than the order, and there is one of order 0. */
enum { ROWS = HIGHEST + 3 };
/* Series at y and at y_new. */
enum { BOTH = 2 };

struct taylor {
    long *present;    /* which of the two series is that at y */
    real *longest;    /* of each series: its step within the tolerance */
    real *rows;       /* of each series: coefficients, ROWS rows as in the work of the kernel */
    real *work_done;  /* of each series: coefficients of the work of loads without potential */
    real *sides;      /* right-hand side and solution */
    real *f, *f_new;
};

static size_t place(struct taylor *x, const struct equations *e, void *memory) {
    const ptrdiff_t row = e->sizes.series_rows;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->present, 1),
        ARENA_ARRAY(x->longest, BOTH),
        ARENA_ARRAY(x->rows, BOTH * ROWS * row),
        ARENA_ARRAY(x->work_done, BOTH * ROWS),
        ARENA_ARRAY(x->sides, e->n + e->m + 1),
        ARENA_ARRAY(x->f, e->dim),
        ARENA_ARRAY(x->f_new, e->dim),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct equations *e, const long *counts) {
    struct taylor counted;
    (void)counts;
    return place(&counted, e, NULL);
}

static struct taylor taylor_of(const struct run *run) {
    struct taylor x;
    place(&x, run->e, run->own);
    return x;
}

static ptrdiff_t numbers(const long *counts) {
    return counts[ORDER] == 0 || (LOWEST <= counts[ORDER] && counts[ORDER] <= HIGHEST) ? 0 : -1;
}

static void bind(struct run *run) {
    const struct taylor x = taylor_of(run);
    run->f = x.f, run->f_new = x.f_new;
}

/* Every order takes a substitution, which takes longer than the loops over the orders unless the model is large. With
   steps proportional to tolerance^(1 / order), the product of order and number of steps is least near -log(tolerance). */
static long order_of(const struct run *run) {
    const long given = run->scheme.counts[ORDER];
    const double wanted = fmax(run->task.rtol, (double)REAL_EPSILON);
    const long least = (long)ceil(3 - 0.8 * log(wanted));
    return given > 0 ? given : least < HIGHEST ? least : HIGHEST;
}

/* The step whose last terms are within the tolerance: those of two orders, since every other one may vanish. */
static real within_tolerance(const struct run *run, const real *rows, const real *y, long order) {
    const long n = run->e->n, row = run->e->sizes.series_rows;
    const real atol = R(0.1) * R(run->task.atol), rtol = R(0.1) * R(run->task.rtol);
    real length = R(run->task.t_end) - R(run->task.t0);
    for (long k = order - 1; k <= order; k++) {
        real places = 0, rates = 0;
        for (long i = 0; i < n; i++) {
            const real last = rows[k * row + i];
            const real place = last / (atol + rtol * real_fabs(y[i]));
            const real rate = R(k) * last / (atol + rtol * real_fabs(y[n + i]));
            places += place * place, rates += rate * rate;
        }
        if (!(real_isfinite(places) && real_isfinite(rates)))
            return REAL_INFINITY;
        if (rates > 0)
            length = real_fmin(length, real_pow(rates / R(n), R(-0.5) / R(k - 1)));
        if (places * real_pow(length, R(2 * k)) > R(n))
            length = real_pow(places / R(n), R(-0.5) / R(k));
    }
    return length;
}

/* Expand the motion from (t, y) into one of the two series; write dy/dt. */
static int expand(struct run *run, long which, real t, const real *y, real *dy) {
    const struct taylor x = taylor_of(run);
    struct equations *e = run->e;
    const long n = e->n, m = e->m, row = e->sizes.series_rows, order = order_of(run);
    real *rows = x.rows + which * ROWS * row, *work_done = x.work_done + which * ROWS, at[2] = {t, 0};
    const int status = e->of->factorise(e, t, y);
    if (status != DONE)
        return status;
    copy(y, n, rows);
    copy(y + n, n, rows + row);
    /* The power needs the multipliers of the same order. */
    for (long k = 0; k + 2 <= order + e->extra; k++) {
        real *now = rows + k * row;
        const real by = 1 / R((k + 1) * (k + 2));
        at[1] = R(k);
        e->kernels.series(at, NULL, NULL, e->p, rows, x.sides);
        e->kernels.solve(&t, y, y + n, e->p, e->factors, x.sides);
        for (long i = 0; i < n; i++)
            now[2 * row + i] = x.sides[i] * by;
        for (long i = 0; i < m; i++)
            now[n + i] = x.sides[n + i];
        if (e->extra) {
            e->kernels.series_along(at, NULL, NULL, e->p, rows, x.sides);
            work_done[k + 1] = x.sides[0] / R(k + 1);
        }
    }
    e->account->evaluations++;
    copy(y + n, n, dy);
    for (long i = 0; i < n; i++)
        dy[n + i] = 2 * rows[2 * row + i];
    if (e->extra) {
        work_done[0] = y[2 * n];
        dy[2 * n] = work_done[1];
    }
    if (!run->scheme.adaptive)
        return DONE;
    x.longest[which] = within_tolerance(run, rows, y, order);
    return real_isfinite(x.longest[which]) ? DONE : NOT_FINITE;
}

/* Write the state a time h after y. */
static void evaluate(const struct run *run, real h, real *y) {
    const struct taylor x = taylor_of(run);
    const struct equations *e = run->e;
    const long n = e->n, row = e->sizes.series_rows, order = order_of(run);
    const real *rows = x.rows + *x.present * ROWS * row, *work_done = x.work_done + *x.present * ROWS;
    copy(rows + order * row, n, y);
    for (long i = 0; i < n; i++)
        y[n + i] = 0;
    for (long k = order - 1; k >= 0; k--)
        for (long i = 0; i < n; i++) {
            y[n + i] = y[n + i] * h + y[i];
            y[i] = y[i] * h + rows[k * row + i];
        }
    if (e->extra) {
        y[2 * n] = work_done[order];
        for (long k = order - 1; k >= 0; k--)
            y[2 * n] = y[2 * n] * h + work_done[k];
    }
}

static int begin(struct run *run) {
    *taylor_of(run).present = 0;
    return expand(run, 0, run->state->t, run->y, run->f);
}

/* Events, jumps of loads and revolutions are looked for at probes, whose number in a step is that of shorter steps. */
static real longest(const struct run *run) {
    const struct taylor x = taylor_of(run);
    const struct sizes *s = &run->e->sizes;
    const int is_watched = s->events || s->switches || s->windings || s->turns;
    return x.longest[*x.present] * (is_watched ? R(0.25) : R(1));
}

static int step(struct run *run, real t, real h, real t_new) {
    (void)t, (void)t_new;
    evaluate(run, h, run->y_new);
    run->state->norm = 0; /* the step is within the tolerance */
    return DONE;
}

static int finish(struct run *run, real h, real t_new) {
    (void)h;
    return expand(run, 1 - *taylor_of(run).present, t_new, run->y_new, run->f_new);
}

static void prepare(struct run *run, real h) {
    (void)run, (void)h;
}

static void interpolate(struct run *run, real h, real theta, real *y) {
    evaluate(run, theta * h, y);
}

static void accept(struct run *run) {
    long *present = taylor_of(run).present;
    *present = 1 - *present;
    copy(run->f_new, run->dim, run->f);
}

static int valid(const struct run *run) {
    const long present = *taylor_of(run).present;
    return present == 0 || present == 1;
}

const struct kind taylor_kind = {
    "taylor", "order", "", 0, bytes, numbers, bind, begin, step, finish, prepare, interpolate, accept, valid, longest,
};
