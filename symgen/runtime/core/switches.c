/* Switching points: zeros of the argument of a sign or of an absolute value in a load, and knots of tables.
 *
 * In a step every load stays on one branch, so that it is smooth; the branches are parameters, 1 or -1, of tables odd
 * numbers of pieces, constant in a step. Distances change their sign from each piece to the next. A step that passes a
 * switching point is repeated up to the point, the branch changes there, and the method restarts. If both branches lead
 * back to the point (friction at rest), the motion slides along it, and the run ends.
 *
 * A method with power series has the polynomials of the arguments over the step, whose first zero is the switching point.
 * Otherwise arguments are evaluated at both ends of a step and at SWITCH_PROBES - 1 instants in between. Unequal spacing
 * avoids aliasing with a periodic load. Two crossings between neighbouring instants are not detected.
 */
#include "newton.h"
#include "zeros.h"

#include <string.h>

/* Most corrections of the length of a step that ends at a switching point. */
enum { POLISHINGS = 5 };
/* Most knots of tables at one time. */
enum { KNOTS_AT_ONCE = 64 };
/* Most passes over one step. */
enum { PASSES = 64 };
/* Most halvings of an interval that contains a switching point. */
enum { HALVINGS = 40 };
/* The test for stiffness due to a switching point applies to distances below this part of the largest so far. */
#define CLOSE R(1e-6)
/* Tolerance of coordinates and rates for fixed steps. */
#define FIXED R(1e-12)

static real *branch_of(struct run *run, long k) {
    const struct sizes *sizes = &run->e->sizes;
    return run->e->p + sizes->parameters - sizes->switches + k;
}

static void hold(struct run *run, long k, real branch) {
    *branch_of(run, k) = branch;
    set_up(run->e);
}

/* The sign of the distance on a branch: of pieces 2 i + 1 it is that of 1 for even i. */
static real side(real branch) {
    const long long odd = (long long)branch;
    return odd % 4 == 1 || odd % 4 == -3 ? R(1) : R(-1);
}

static real side_of(struct run *run, long k) {
    return side(*branch_of(run, k));
}

static int is_knot(const struct run *run, long k) {
    return k >= run->e->sizes.switches - run->e->sizes.tables;
}

/* Write the distances from all switching points at a state. */
static const real *distances(struct run *run, real t, const real *y) {
    look_at_events(run->e, t, y);
    return run->e->gaps + run->e->sizes.events;
}

/* Position of probe number j in a step. */
static real probe_place(int j) {
    real shift = R(0.6180339887498949) * R(j);
    shift -= R((long)shift);
    return j == 0 || j == SWITCH_PROBES ? R(j) / R(SWITCH_PROBES) : (R(j) + R(0.8) * (shift - R(0.5))) / R(SWITCH_PROBES);
}

/* Return the uncertainty of the distance from a switching point due to the tolerance of the state and the rounding of
   the time. */
static real blur(struct run *run, long k, real t, const real *y) {
    struct equations *e = run->e;
    int adaptive = run->scheme.adaptive;
    real at = distances(run, t, y)[k], later = t + R(8) * REAL_EPSILON * real_fabs(t), total = 0;
    real least[2] = {largest_of(y, e->n), largest_of(y + e->n, e->n)};
    total += real_fabs(distances(run, later, y)[k] - at);
    memcpy(run->error, y, (size_t)run->dim * sizeof(real));
    for (long i = 0; i < 2 * e->n; i++) {
        real size = adaptive ? R(run->task.atol) + R(run->task.rtol) * real_fabs(y[i]) : FIXED * (R(1) + least[i / e->n]);
        run->error[i] += real_fmax(size, R(8) * REAL_EPSILON * least[i / e->n]);
        total += real_fabs(distances(run, t, run->error)[k] - at);
        run->error[i] = y[i];
    }
    return total;
}

/* Return the rate of the distance from a switching point along dy/dt, by a difference over a small part of a time. */
static real rate_of(struct run *run, long k, real t, const real *y, const real *f, real h) {
    real part = real_fmax(R(1e-5) * h, R(64) * REAL_EPSILON * real_fabs(t)), at = distances(run, t, y)[k];
    for (long i = 0; i < run->dim; i++)
        run->error[i] = y[i] + part * f[i];
    return (distances(run, t + part, run->error)[k] - at) / part;
}

/* A length of time for differences: that of the step, or at the start a part of the run. */
static real scale_of(const struct run *run) {
    return run->state->h > 0 ? run->state->h : R(1e-6) * (R(run->task.t_end) - run->state->t);
}

/* Return the branch at the state. */
static real found_branch(struct run *run, long k) {
    if (!is_knot(run, k))
        return distances(run, run->state->t, run->y)[k] < 0 ? -1 : 1;
    hold(run, k, R(WHICH_PIECE));
    return distances(run, run->state->t, run->y)[k];
}

/* Return the other branch at a switching point: of a table that of the two next to it on which the state is. Where there
   is no piece, the distance is not a number. */
static real other_branch(struct run *run, long k) {
    const real branch = *branch_of(run, k);
    real at[2];
    if (!is_knot(run, k))
        return -branch;
    for (int i = 0; i < 2; i++) {
        const real next = branch + (i ? R(2) : R(-2));
        hold(run, k, next);
        at[i] = side(next) * distances(run, run->state->t, run->y)[k];
    }
    return branch + (at[0] != at[0] || at[1] > at[0] ? R(2) : R(-2));
}

/* A length of time that the rounding of its ends exceeds. */
static real instant(const struct run *run, real h) {
    return R(64) * REAL_EPSILON * real_fmax(h, real_fabs(run->state->t));
}

/* Whether the state is behind a switching point, also an instant later: steps may end so much before it. */
static int is_behind(struct run *run, long k) {
    const real t = run->state->t, least = blur(run, k, t, run->y), at = distances(run, t, run->y)[k] * side_of(run, k);
    return at < -least && distances(run, t + instant(run, scale_of(run)), run->y)[k] * side_of(run, k) < -least;
}

/* Find other branches again whose arguments jump at a switching point. */
static void find_again(struct run *run, long point) {
    for (long k = 0; k < run->e->sizes.switches; k++)
        if (k != point && is_behind(run, k))
            hold(run, k, found_branch(run, k));
}

/* Write the derivative on this branch to run->f; return the rate at which the state leaves the point. */
static real leaving(struct run *run, long k, real branch) {
    struct state *s = run->state;
    hold(run, k, branch);
    run->e->of->derivative(run->e, s->t, run->y, run->f);
    return side(branch) * rate_of(run, k, s->t, run->y, run->f, scale_of(run));
}

static int begin_switches(struct run *run) {
    struct state *s = run->state;
    for (long k = 0; k < run->e->sizes.switches; k++) {
        const real before = *branch_of(run, k);
        hold(run, k, found_branch(run, k));
        if (*branch_of(run, k) != before && s->jumped < 0)
            s->jumped = k;
        run->switched[k] = s->t;
    }
    for (long k = 0; k < run->e->sizes.switches; k++) {
        real least = blur(run, k, s->t, run->y), far = real_fabs(distances(run, s->t, run->y)[k]);
        run->farthest[k] = far;
        if (far > least)
            continue;
        if (leaving(run, k, is_knot(run, k) ? *branch_of(run, k) : R(1)) * scale_of(run) >= -least)
            continue;
        if (leaving(run, k, other_branch(run, k)) * scale_of(run) < -least) {
            s->slid = k;
            return SLIDING;
        }
    }
    return DONE;
}

/* Evaluate the distances times the signs of their branches along the step: negative values are behind the point. */
static void look_along(struct run *run, real t_new, real h) {
    long switches = run->e->sizes.switches;
    for (int j = 0; j <= SWITCH_PROBES; j++) {
        real theta = probe_place(j), t = j == SWITCH_PROBES ? t_new : run->state->t + theta * h;
        const real *y = j == 0 ? run->y : j == SWITCH_PROBES ? run->y_new : run->stage, *at;
        if (j > 0 && j < SWITCH_PROBES)
            hermite(run, h, theta, run->stage);
        at = distances(run, t, y);
        for (long k = 0; k < switches; k++)
            run->switch_gaps[j * switches + k] = at[k] * side_of(run, k);
    }
}

/* Return the distance from a switching point on the interpolant of the step, times the sign of its branch. */
static real on_the_way(struct run *run, real h, long k, real theta) {
    move_to(run, h, theta);
    return run->e->gaps[run->e->sizes.events + k] * side_of(run, k);
}

/* Return the position between two others at which the interpolant passes a switching point; 2 if it does not. */
static real passed_at(struct run *run, real h, long k, real start, real b) {
    const long index = run->e->sizes.events + k;
    real a = start, from, to;
    to = b < 1 ? on_the_way(run, h, k, b) : distances(run, run->state->t + h, run->y_new)[k] * side_of(run, k);
    from = a > 0 ? on_the_way(run, h, k, a) : distances(run, run->state->t, run->y)[k] * side_of(run, k);
    if (!(to < 0))
        return 2;
    /* If the last step ended at the point, the state may leave it and return. */
    for (int i = 0; i < HALVINGS && !(from > 0); i++) {
        real middle = start + (b - start) / R(2), at = on_the_way(run, h, k, middle);
        if (at > 0)
            a = middle, from = at;
        else
            b = middle, to = at;
    }
    if (!(from > 0))
        return start;
    return narrowed(run, h, index, a, from * side_of(run, k), b, to * side_of(run, k));
}

/* Return the first switching point in the step (-1: none) and its position theta. */
static long first_passed(struct run *run, real t_new, real h, real *theta) {
    long switches = run->e->sizes.switches, first = -1;
    int prepared = 0;
    look_along(run, t_new, h);
    *theta = 2;
    for (int j = 1; j <= SWITCH_PROBES && first < 0; j++) {
        for (long k = 0; k < switches; k++) {
            real to = run->switch_gaps[j * switches + k], at;
            if (!(to < 0) || !(to < -blur(run, k, run->state->t, run->y)))
                continue;
            prepare_interpolation(run, h, &prepared);
            at = passed_at(run, h, k, probe_place(j - 1), probe_place(j));
            if (at < *theta)
                *theta = at, first = k;
        }
    }
    return first;
}

/* The same by the polynomials of the distances, if these are known. A distance that an instant covers has no sign: the
   step may begin just behind its switching point. */
static long first_zero(struct run *run, real t_new, real h, real *theta) {
    const struct sizes *s = &run->e->sizes;
    long first = -1;
    *theta = 2;
    for (long k = 0; k < s->switches; k++) {
        real c[COEFFICIENTS_AND_RATE], at;
        struct zeros z = {.c = c, .degree = run->scheme.kind->polynomial(run, s->events + k, h, c), .sign = 1, .width = 1};
        if (z.degree < 0)
            return first_passed(run, t_new, h, theta);
        for (long i = 0; i <= z.degree; i++)
            c[i] *= side_of(run, k);
        const real reach = reach_of(c, z.degree);
        if (c[0] >= reach)
            continue;
        z.noise = real_fmax(blur(run, k, run->state->t, run->y), R(4 * z.degree) * REAL_EPSILON * reach);
        z.noise = real_fmax(z.noise, R(1.01) * instant(run, h) * real_fabs(c[1]) / h);
        if (is_knot(run, k)) {
            /* On a knot rounding decides on which side the state is: one that leaves the piece has passed. */
            if (c[0] <= z.noise && c[1] < 0) {
                *theta = 0, first = k;
                continue;
            }
            c[0] = real_fmax(c[0], 0);
        }
        if (!next_zero(&z))
            continue;
        at = passed_at(run, h, k, z.from, z.to);
        if (is_knot(run, k)) /* which evaluations may not show, for an argument with more rounding than the time has */
            at = real_fmin(at, z.to);
        if (at < *theta)
            *theta = at, first = k;
    }
    return first;
}

/* Take the step again with another length. */
static int retaken(struct run *run, real h, real t_new) {
    real planned = run->state->h;
    int status = try_step(run, h, t_new);
    if (status != DONE)
        return status;
    run->state->h = planned;
    status = run->scheme.kind->finish(run, h, t_new);
    return status == DONE && !all_finite(run->f_new, run->dim) ? NOT_FINITE : status;
}

/* The end of a step that moves onto a switching point, the longest step, and the status of the last one. */
struct polish {
    struct run *run;
    long k;
    real most, *t_new, *h, at;
    int status;
};

static real polish(void *of, struct newton *w) {
    struct polish *p = of;
    struct run *run = p->run;
    struct state *s = run->state;
    if (w->count) {
        const real change = -p->at / rate_of(run, p->k, *p->t_new, run->y_new, run->f_new, *p->h);
        if (!real_isfinite(change) || real_fabs(change) > R(0.1) * *p->h || *p->h + change > p->most)
            return REAL_INFINITY;
        *p->h += change, *p->t_new = s->t + (*p->h + s->t_left);
        p->status = retaken(run, *p->h, *p->t_new);
        if (p->status != DONE)
            return REAL_INFINITY;
    }
    p->at = distances(run, *p->t_new, run->y_new)[p->k];
    w->size = blur(run, p->k, *p->t_new, run->y_new);
    return real_fabs(p->at);
}

/* Move the end of a step onto a near switching point. */
static int polished(struct run *run, long k, real most, real *t_new, real *h) {
    struct polish p = {run, k, most, t_new, h, 0, DONE};
    struct newton w = {.most = POLISHINGS, .close = R(1e-3), .grows = REAL_INFINITY};
    newton_solve(&w, 1, polish, &p);
    return p.status;
}

int end_at_switch(struct run *run, real *t_new, real *h, long *crossed) {
    struct state *s = run->state;
    *crossed = -1;
    for (int pass = 0; pass < PASSES; pass++) {
        int status;
        real theta, most = *h;
        long k = has_polynomials(run) ? first_zero(run, *t_new, *h, &theta) : first_passed(run, *t_new, *h, &theta);
        if (k < 0)
            return DONE;
        *crossed = k;
        if (theta * *h <= instant(run, *h)) {
            *h = 0;
            return DONE;
        }
        *h *= theta, *t_new = s->t + (*h + s->t_left);
        status = retaken(run, *h, *t_new);
        /* Rates of short pieces by differences are rounding; zeros of polynomials need none. */
        if (status == DONE && !(has_polynomials(run) && is_knot(run, k)))
            status = polished(run, k, most, t_new, h);
        if (status != DONE)
            return status;
    }
    return DONE;
}

/* Most changes of branches at one time: many knots may be as near as the rounding of the time. */
static long most_flips(const struct run *run) {
    return 2 * run->e->sizes.switches + (run->e->sizes.tables ? KNOTS_AT_ONCE : 0);
}

/* Whether the drives of a model have switching points: their constraints may jump there. */
static int may_jump(const struct run *run) {
    return run->e->of == &kernel_behaviour && run->e->m > 0;
}

static void read_errors(struct run *run, real *errors) {
    errors[0] = position_error(run->e, run->state->t, run->y);
    errors[1] = velocity_error(run->e, run->state->t, run->y);
}

/* Whether constraints or their rates differ from those on the branches before, beyond the rounding of the time. */
static int jumps(struct run *run) {
    const struct state *s = run->state;
    const long n = run->e->n;
    const real late = R(16) * instant(run, 0), rate = largest_of(run->y + n, n);
    real now[2], small;
    if (!may_jump(run))
        return 0;
    read_errors(run, now);
    small = R(1e-9) * size_of(run->e, run->y);
    return now[0] > R(10) * s->unswitched[0] + small + late * rate
           || now[1] > R(10) * s->unswitched[1] + small / scale_of(run) + R(1e-6) * rate + late * largest_of(run->f + n, n);
}

int behind_jump(struct run *run, int status) {
    struct state *s = run->state;
    if (!s->switchings || s->t_switched != s->t || s->jumped < 0)
        return status;
    s->slid = s->jumped;
    return SLIDING;
}

int choose_branches(struct run *run, int moved) {
    struct state *s = run->state;
    if (may_jump(run) && !moved)
        read_errors(run, s->unswitched);
    s->jumped = -1;
    int status = begin_switches(run);
    if (status == DONE && s->jumped >= 0 && !moved && jumps(run)) {
        s->slid = s->jumped;
        status = SLIDING;
    }
    s->jumped = -1;
    return status;
}

int switch_over(struct run *run, long k) {
    struct state *s = run->state;
    real least = blur(run, k, s->t, run->y), h = scale_of(run);
    if (may_jump(run) && !(s->switchings && s->t_switched == s->t))
        read_errors(run, s->unswitched);
    const real branch = other_branch(run, k);
    hold(run, k, branch);
    find_again(run, k);
    s->flips = s->t_switched == s->t && s->switchings ? s->flips + 1 : 0;
    /* After two switches of a point, the next step must not extend over many more. */
    if (run->scheme.adaptive && run->switched[k] < s->t && run->switched[k] > R(run->task.t0))
        s->h = real_fmin(s->h, R(2) * (s->t - run->switched[k]));
    s->switchings++, s->t_switched = run->switched[k] = s->t;
    real ahead = leaving(run, k, branch) * h;
    /* The next knot may be nearer than the difference of this rate reaches. */
    if ((ahead < -least && !is_knot(run, k)) || s->flips > most_flips(run)) {
        s->slid = k;
        return SLIDING;
    }
    s->jumped = jumps(run) ? k : -1;
    int status = run->scheme.kind->begin(run);
    return status == DONE && !all_finite(run->f, run->dim) ? NOT_FINITE : status;
}

/* Whether the load near a switching point makes the motion stiff: whether doubling the distance from it changes the
   rate of the distance by a large part of the distance in a step. */
static int makes_stiff(struct run *run, long k) {
    struct equations *e = run->e;
    struct state *s = run->state;
    real at = distances(run, s->t, run->y)[k], squares = 0, before, after;
    for (long i = 0; i < 2 * e->n; i++) {
        memcpy(run->error, run->y, (size_t)run->dim * sizeof(real));
        run->error[i] += at;
        run->stage[i] = (distances(run, s->t, run->error)[k] - at) / at;
        squares += run->stage[i] * run->stage[i];
    }
    if (!(squares > 0))
        return 0;
    for (long i = 0; i < 2 * e->n; i++)
        run->stage[i] = run->y[i] + run->stage[i] * at / squares;
    for (long i = 2 * e->n; i < run->dim; i++)
        run->stage[i] = run->y[i];
    before = rate_of(run, k, s->t, run->y, run->f, s->h);
    e->of->derivative(e, s->t, run->stage, run->f_new);
    after = rate_of(run, k, s->t, run->stage, run->f_new, s->h);
    return real_fabs(after - before) * s->h > R(0.5) * real_fabs(at);
}

int watch_switches(struct run *run) {
    struct state *s = run->state;
    const real *at = distances(run, s->t, run->y);
    for (long k = 0; k < run->e->sizes.switches; k++) {
        real far = real_fabs(at[k]);
        run->farthest[k] = real_fmax(run->farthest[k], far);
        if (s->stiff && far > 0 && far < CLOSE * run->farthest[k]) {
            if (makes_stiff(run, k)) {
                s->slid = k;
                return SLIDING;
            }
            at = distances(run, s->t, run->y);
        }
    }
    return DONE;
}

void release_switches(struct run *run) {
    for (long k = 0; k < run->e->sizes.switches; k++)
        hold(run, k, 0);
}
