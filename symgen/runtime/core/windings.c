/* Angles that are continuous over revolutions, from values of atan2, which are known up to a revolution.
 *
 * Angles in loads: an angle is a reference plus the difference from it of least magnitude. The reference is a
 * parameter, 0 outside runs, constant in a step. After a step it is moved within a quarter revolution of the angle.
 * This changes the angle by rounding only, if no step rotates by more than a quarter revolution. Steps of power series
 * end before an angle is half a revolution away from its reference; so do other steps within a tolerance, by its
 * rate at their start and its value at their end.
 *
 * Recorded angles of links: from step to step, and from the step's start to a sample in it, an angle is continued by
 * the number of revolutions for which its change is nearest to that of its power series; for a method without one, to
 * the mean rate of both ends times the duration. With choices of coordinates, the usual ones are recorded in their
 * place.
 */
#include "run.h"
#include "zeros.h"

#include <string.h>

real *references_of_angles(const struct equations *e) {
    return e->p + first_reference(&e->sizes);
}

/* Angles of links up to a revolution, then their rates, at the last evaluation of events. */
static const real *links(const struct run *run) {
    const struct sizes *sizes = &run->e->sizes;
    return run->e->gaps + sizes->events + sizes->switches + sizes->windings;
}

/* Return by how much the angle of a link changes from y to the last look a time later: by its polynomial, else about. */
static real change(const struct run *run, long k, real after) {
    const struct sizes *s = &run->e->sizes;
    real c[COEFFICIENTS_AND_RATE], sum = REAL_INFINITY;
    if (has_polynomials(run) && after != 0) {
        const long degree = run->scheme.kind->polynomial(run, s->events + s->switches + s->windings + k, after, c);
        c[0] = 0, sum = value_of(c, degree, 1);
    }
    return real_isfinite(sum) ? sum : after * (run->turned[s->turns + k] + links(run)[s->turns + k]) / R(2);
}

/* Return the angle of a link at the last look, a time after y. */
static real turned(const struct run *run, long k, real after) {
    const real revolution = R(6.283185307179586476925286766559005768L);
    const real *now = links(run);
    real expected = run->turned[k] + change(run, k, after);
    if (!real_isfinite(expected))
        expected = run->turned[k];
    return now[k] + R(rint((double)((expected - now[k]) / revolution))) * revolution;
}

static void follow_turns(struct run *run, real after) {
    const long turns = run->e->sizes.turns;
    for (long k = 0; k < turns; k++)
        run->turned[k] = turned(run, k, after);
    memcpy(run->turned + turns, links(run) + turns, (size_t)turns * sizeof(real));
}

/* A quarter of a revolution [rad]. */
#define QUARTER R(1.570796326794896619231321691639751442L)
/* Part of a step over which rates of angles in loads are differences. */
#define RATE_OVER R(1e-3)

static int is_wound(const struct run *run) {
    return run->e->sizes.windings > 0 && !run->e->sizes.choices;
}

/* Angles in loads at the last look. */
static const real *angles(const struct equations *e) {
    return e->gaps + e->sizes.events + e->sizes.switches;
}

real within_revolutions(struct run *run, real h) {
    const long windings = run->e->sizes.windings, n = run->e->n;
    const real t = run->state->t, after = RATE_OVER * h, *reference = references_of_angles(run->e);
    real part = 1;
    if (!is_wound(run))
        return h;
    look_at_events(run->e, t, run->y);
    memcpy(run->wound, angles(run->e), (size_t)windings * sizeof(real));
    memcpy(run->stage, run->y, (size_t)run->dim * sizeof(real));
    for (long i = 0; i < n; i++)
        run->stage[i] += after * run->y[n + i];
    look_at_events(run->e, t + after, run->stage);
    for (long k = 0; k < windings; k++) {
        const real rotation = (angles(run->e)[k] - run->wound[k]) / RATE_OVER, away = run->wound[k] - reference[k];
        const real left = R(1.5) * QUARTER - (rotation > 0 ? away : -away);
        if (part * real_fabs(rotation) > left)
            part = left / real_fabs(rotation);
    }
    return part * h;
}

int keeps_revolutions(struct run *run, real t_new) {
    if (!is_wound(run))
        return 1;
    look_at_events(run->e, t_new, run->y_new);
    for (long k = 0; k < run->e->sizes.windings; k++)
        if (real_fabs(angles(run->e)[k] - references_of_angles(run->e)[k]) > R(1.75) * QUARTER)
            return 0;
    return 1;
}

int follow_references(struct equations *e) {
    const struct sizes *sizes = &e->sizes;
    real *reference = references_of_angles(e);
    const real *angle = angles(e);
    int moved = 0;
    for (long k = 0; k < sizes->windings; k++) {
        if (!(real_fabs(angle[k] - reference[k]) > QUARTER))
            continue;
        /* whole quarters, so that samples of a run share few references */
        reference[k] = R(rint((double)(angle[k] / QUARTER))) * QUARTER;
        moved = 1;
    }
    if (moved)
        set_up(e);
    return moved;
}

void follow_windings(struct run *run, real t) {
    const struct sizes *sizes = &run->e->sizes;
    if ((sizes->windings == 0 && sizes->turns == 0) || sizes->choices)
        return;
    look_at_events(run->e, t, run->y);
    if (sizes->turns)
        follow_turns(run, t - run->state->t);
    follow_references(run->e);
}

void keep_windings(struct run *run) {
    const struct sizes *sizes = &run->e->sizes;
    const struct state *s = run->state;
    if (sizes->windings)
        memcpy(run->references + s->recorded * sizes->windings, references_of_angles(run->e),
               (size_t)sizes->windings * sizeof(real));
    if (sizes->turns == 0)
        return;
    if (sizes->choices) {
        run->e->of->usual(run->e, run->samples + s->recorded * run->dim, run->turns + s->recorded * sizes->turns);
        return;
    }
    look_at_events(run->e, run->times[s->recorded], run->samples + s->recorded * run->dim);
    for (long k = 0; k < sizes->turns; k++)
        run->turns[s->recorded * sizes->turns + k] = turned(run, k, run->times[s->recorded] - s->t);
}
