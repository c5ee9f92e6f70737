/* Events: zero crossings of values of the kernel `events` in a step, located on its projected interpolant.
 *
 * A method with power series has the polynomials of the values over the step: every change of sign, beyond the tolerance,
 * is a crossing, and an extremum within the tolerance touches zero.
 *
 * Otherwise values are compared at both ends of a step and at STEP_PROBES - 1 instants in between. A crossing is a change
 * of sign, or to zero, between neighbouring instants. Two crossings between neighbouring instants, and a value that only
 * touches zero, are not detected.
 */
#include "run.h"
#include "zeros.h"

#include <string.h>

/* Largest number of bisections and secants for one event. */
enum { NARROWINGS = 200 };

/* Whether going from one value to another passes zero in this direction: 1 rising, -1 falling, 0 both. */
static int passes(real from, real to, int direction) {
    return (direction >= 0 && from < 0 && to >= 0) || (direction <= 0 && from > 0 && to <= 0);
}

/* Continue the value of an event on an angle from an earlier look, less than half a revolution before: values from
   atan2 jump by a revolution. */
static real continued(const struct run *run, long index, real before, real value) {
    const real revolution = R(6.283185307179586476925286766559005768L);
    if (index >= run->e->sizes.events || !(run->terminal[index] & REVOLVES))
        return value;
    return value + R(rint((double)((before - value) / revolution))) * revolution;
}

static void continue_row(struct run *run, int k) {
    long events = run->e->sizes.events;
    real *row = run->gaps + k * events;
    for (long i = 0; i < events; i++)
        if (run->probed[i])
            row[i] = continued(run, i, row[i - events], row[i]);
}

/* Write the cubic through both ends of the step, accurate enough to detect crossings; in long steps, whose interpolant
   needs no preparation, that one. */
void hermite(struct run *run, real h, real x, real *y) {
    if (run->scheme.kind->longest) {
        run->scheme.kind->interpolate(run, h, x, y);
        return;
    }
    for (long i = 0; i < run->dim; i++)
        y[i] = run->y[i] + x * x * (R(3) - R(2) * x) * (run->y_new[i] - run->y[i])
               + h * x * (R(1) - x) * ((R(1) - x) * run->f[i] - x * run->f_new[i]);
}

/* Write the interpolated state to run->stage, projected onto the constraints if possible, and evaluate the events
   there. */
void move_to(struct run *run, real h, real theta) {
    real t = run->state->t + theta * h;
    run->scheme.kind->interpolate(run, h, theta, run->stage);
    if (run->task.stabilisation == PROJECTION) {
        memcpy(run->error, run->stage, (size_t)run->dim * sizeof(real));
        int status = run->e->of->project(run->e, t, run->error);
        if (status == DONE && strayed(run, run->state->t, run->y, t, run->error))
            status = run->e->of->project(run->e, t, run->error);
        if (status == DONE)
            memcpy(run->stage, run->error, (size_t)run->dim * sizeof(real));
    }
    look_at_events(run->e, t, run->stage);
}

/* Keep the first event without a finite value. */
static void see(struct run *run, long place) {
    struct state *s = run->state;
    if (s->blind < 0 && !real_isfinite(run->gaps[place]))
        s->blind = place % run->e->sizes.events, s->t_blind = s->t;
}

/* Evaluate all events at the probes of the step, on the interpolant or on the cubic. */
static void probe_events(struct run *run, real h, int finely) {
    long events = run->e->sizes.events;
    for (int k = 1; k < STEP_PROBES; k++) {
        real theta = R(k) / R(STEP_PROBES);
        if (finely) {
            move_to(run, h, theta);
        } else {
            hermite(run, h, theta, run->stage);
            look_at_events(run->e, run->state->t + theta * h, run->stage);
        }
        memcpy(run->gaps + k * events, run->e->gaps, (size_t)events * sizeof(real));
        continue_row(run, k);
    }
    continue_row(run, STEP_PROBES);
}

/* Return the instant of an event between a and b, whose values have different signs: the end of the final bracket
   behind the crossing. Every third iteration is a bisection, the others are secants, so that the bracket closes. */
real narrowed(struct run *run, real h, long index, real a, real at_a, real b, real at_b) {
    real least = R(2) * REAL_EPSILON * real_fmax(R(1), real_fabs(run->state->t) / h);
    for (int k = 0; k < NARROWINGS && b - a > least && at_b != 0; k++) {
        real middle = k % 3 == 2 ? a + (b - a) / R(2) : a - at_a * ((b - a) / (at_b - at_a));
        middle = real_fmin(real_fmax(middle, a + least / R(2)), b - least / R(2));
        move_to(run, h, middle);
        real at = continued(run, index, at_a, run->e->gaps[index]);
        if ((at < 0) == (at_a < 0) && at != 0)
            a = middle, at_a = at;
        else
            b = middle, at_b = at;
    }
    return b;
}

/* Insert an event into the record, ordered by time. */
static void remember(struct run *run, real h, real theta, long index, int rising) {
    struct state *s = run->state;
    size_t bytes = (size_t)run->dim * sizeof(real);
    real t = s->t + theta * h;
    long place = s->events;
    /* Within rounding of the start there is no crossing. */
    if (s->steps == 0 && t - s->t <= R(64) * REAL_EPSILON * real_fmax(h, real_fabs(s->t)))
        return;
    move_to(run, h, theta);
    for (; place > s->events_before && run->events[place - 1].t > t; place--) {
        run->events[place] = run->events[place - 1];
        memcpy(run->event_states + place * run->dim, run->event_states + (place - 1) * run->dim, bytes);
    }
    run->events[place] = (struct event){t, index, rising};
    memcpy(run->event_states + place * run->dim, run->stage, bytes);
    s->events++;
}

static void locate(struct run *run, real h, long index) {
    long events = run->e->sizes.events;
    const real *gap = run->gaps + index;
    for (int k = 0; k < STEP_PROBES; k++) {
        real from = gap[k * events], to = gap[(k + 1) * events];
        if (!passes(from, to, run->directions[index]))
            continue;
        real theta = narrowed(run, h, index, R(k) / R(STEP_PROBES), from, R(k + 1) / R(STEP_PROBES), to);
        remember(run, h, theta, index, from < 0);
    }
}

/* A value over a step, with the polynomial of its rate, and its rounding error. */
struct course {
    real c[COEFFICIENTS_AND_RATE], rate[MOST_COEFFICIENTS], noise;
    long degree;
};

/* Write the course of an event, with the values of `gaps` at both ends and the rates of both series, so that steps join
   with the same signs. Return whether it is known. */
static int follow(struct run *run, real h, long index, struct course *of) {
    const long events = run->e->sizes.events;
    real *c = of->c, *end = run->gaps + STEP_PROBES * events + index;
    const long n = of->degree = run->scheme.kind->polynomial(run, index, h, c);
    if (n < 0)
        return 0;
    c[0] = run->gaps[index];
    const real reached = value_of(c, n, 1);
    if (!(real_isfinite(reached) && real_isfinite(*end) && real_isfinite(c[n + 1])))
        return 0;
    *end = continued(run, index, reached, *end);
    real steeper = c[n + 1];
    for (long k = 1; k <= n; k++)
        steeper -= R(k) * c[k];
    const real higher = *end - reached, last = steeper - R(n - 1) * higher;
    c[n] += last, c[n - 1] += higher - last;
    for (long k = 0; k < n; k++)
        of->rate[k] = R(k + 1) * c[k + 1];
    of->noise = R(4 * n) * REAL_EPSILON * (real_fabs(c[0]) + reach_of(c, n));
    return 1;
}

/* Return the part of the step at which a crossing between two places is, with the projected interpolant beyond zero. */
static real crossing(struct run *run, real h, long index, const struct course *of, const struct zeros *z) {
    real a = z->from, b = z->to, at[2];
    /* an angle is continued over less than half a revolution */
    while (run->terminal[index] & REVOLVES && real_fabs(value_of(of->c, of->degree, b) - value_of(of->c, of->degree, a)) > 1) {
        const real middle = a + (b - a) / R(2);
        if (sign_of(value_of(of->c, of->degree, middle), 0) == z->before)
            a = middle;
        else
            b = middle;
    }
    for (int k = 0; k < 2; k++) {
        const real theta = k ? b : a;
        at[k] = theta == 0 ? run->gaps[index] : run->gaps[STEP_PROBES * run->e->sizes.events + index];
        if (theta == 0 || theta == 1)
            continue;
        move_to(run, h, theta);
        at[k] = continued(run, index, value_of(of->c, of->degree, theta), run->e->gaps[index]);
    }
    /* the interpolant differs from the polynomial within the tolerance */
    if (sign_of(at[1], 0) == z->before)
        return b;
    return sign_of(at[0], 0) == z->before ? narrowed(run, h, index, a, at[0], b, at[1]) : a;
}

/* Whether an event touches zero at the end of the step or crosses it slowly: that its rate there, over a step, reaches
   across the tolerance only with the curvature of the step. The next step decides. */
static int is_open(const struct run *run, long index, const struct course *of, real tolerance, real t_new) {
    const real end = run->gaps[STEP_PROBES * run->e->sizes.events + index], steep = of->c[of->degree + 1];
    return !is_last(run, t_new) && real_fabs(end) <= tolerance && steep * steep <= R(8) * tolerance * reach_of(of->c, of->degree);
}

/* `touch` is the last touch in the step, or less than zero. Where the run ends within the tolerance of it, there is no
   crossing as well. */
static void locate_crossings(struct run *run, real h, long index, const struct course *of, real tolerance, real t_new, real touch) {
    const real end = run->gaps[STEP_PROBES * run->e->sizes.events + index];
    const int open = is_open(run, index, of, tolerance, t_new);
    struct zeros z = {.c = of->c, .degree = of->degree, .noise = tolerance, .width = 1,
                      .sign = run->sides[index], .ends = !open, .last = sign_of(end, 0)};
    while (next_zero(&z)) {
        const int touches = is_last(run, t_new) && z.to == 1 && real_fabs(end) <= tolerance && touch >= z.from;
        if (run->directions[index] != z.before && !touches)
            remember(run, h, crossing(run, h, index, of, &z), index, z.before < 0);
    }
    run->sides[index] = (signed char)(open ? z.sign : sign_of(end, 0));
}

/* Return the last touch, as a part of the step; -1 without one. A rate that is zero at the end of the step has its sign in
   the next. */
static real locate_touches(struct run *run, real h, long index, const struct course *of, real tolerance, real t_new) {
    const long n = of->degree;
    const real noise = R(n) * of->noise;
    struct zeros z = {.c = of->rate, .degree = n - 1, .noise = noise, .width = 1, .last = sign_of(of->c[n + 1], 0)};
    real touch = -1;
    z.ends = z.last != 0 || is_last(run, t_new);
    z.sign = run->slopes[index] ? run->slopes[index] : sign_of(of->rate[0], run->state->steps ? 0 : noise);
    while (next_zero(&z)) {
        const real theta = bisected(of->rate, n - 1, z.from, z.to, z.before);
        if (!(real_fabs(value_of(of->c, n, theta)) <= tolerance))
            continue;
        touch = theta;
        if (run->directions[index] != -z.before)
            remember(run, h, theta, index, TOUCHES);
    }
    run->slopes[index] = (signed char)(z.last ? z.last : z.sign);
    return touch;
}

/* Locate the zeros of an event by its polynomial; return whether this is known. */
static int locate_zeros(struct run *run, real h, long index, real t_new) {
    struct course of;
    if (!follow(run, h, index, &of))
        return 0;
    real b[MOST_COEFFICIENTS], least = REAL_INFINITY, most = 0;
    bernstein(of.c, of.degree, 0, 1, b);
    const int sign = sign_of(b[0], 0);
    int same = sign == run->sides[index];
    for (long k = 0; k <= of.degree; k++) {
        least = real_fmin(least, real_fabs(b[k])), most = real_fmax(most, real_fabs(b[k]));
        same = same && sign_of(b[k], 0) == sign;
    }
    const real tolerance = real_fmax(of.noise, R(run->task.atol) + R(run->task.rtol) * most);
    if (same && least > tolerance) {
        run->slopes[index] = 0;
        return 1;
    }
    real touch = -1;
    if (most > tolerance)
        touch = locate_touches(run, h, index, &of, tolerance, t_new);
    else
        run->slopes[index] = 0;
    locate_crossings(run, h, index, &of, tolerance, t_new, touch);
    return 1;
}

static int any_passes(const struct run *run) {
    long events = run->e->sizes.events;
    for (long i = 0; i < STEP_PROBES * events; i++)
        if (run->probed[i % events] && passes(run->gaps[i], run->gaps[i + events], run->directions[i % events]))
            return 1;
    return 0;
}

void begin_events(struct run *run) {
    long events = run->e->sizes.events;
    if (events) {
        look_at_events(run->e, run->state->t, run->y);
        memcpy(run->gaps + STEP_PROBES * events, run->e->gaps, (size_t)events * sizeof(real));
        for (long i = 0; i < events; i++)
            run->sides[i] = (signed char)sign_of(run->e->gaps[i], 0), run->slopes[i] = 0;
    }
}

/* Locate the events without a polynomial between the probes of the step. */
static void locate_between_probes(struct run *run, real h, int *prepared) {
    long events = run->e->sizes.events;
    probe_events(run, h, 0);
    for (long i = 0; i < (STEP_PROBES + 1) * events; i++)
        if (run->probed[i % events])
            see(run, i);
    if (!any_passes(run))
        return;
    prepare_interpolation(run, h, prepared);
    probe_events(run, h, 1);
    for (long i = 0; i < events; i++)
        if (run->probed[i])
            locate(run, h, i);
}

void locate_events(struct run *run, real t_new, real h, int *prepared) {
    struct state *s = run->state;
    long events = run->e->sizes.events;
    if (events == 0)
        return;
    s->events_before = s->events;
    memcpy(run->gaps, run->gaps + STEP_PROBES * events, (size_t)events * sizeof(real));
    look_at_events(run->e, t_new, run->y_new);
    memcpy(run->gaps + STEP_PROBES * events, run->e->gaps, (size_t)events * sizeof(real));
    const int by_zeros = has_polynomials(run);
    int probed = 0;
    for (long i = 0; i < events; i++)
        probed |= run->probed[i] = !(by_zeros && locate_zeros(run, h, i, t_new));
    if (probed)
        locate_between_probes(run, h, prepared);
    for (long i = 0; i < events; i++)
        if (run->probed[i])
            run->sides[i] = (signed char)sign_of(run->gaps[STEP_PROBES * events + i], 0), run->slopes[i] = 0;
    for (long i = s->events_before; i < s->events; i++)
        if (run->terminal[run->events[i].index] & ENDS_RUN) {
            s->events = i + 1;
            s->ended_by = run->events[i].index;
            break;
        }
}
