/* Angles that are continuous over revolutions, from values of atan2, which are known up to a revolution.
 *
 * Angles in loads: an angle is a reference plus the difference from it of least magnitude. The reference is a
 * parameter, 0 outside runs, constant in a step. After a step it is moved within a quarter revolution of the angle.
 * This changes the angle by rounding only, if no step rotates by more than a quarter revolution. Steps of power series
 * end before an angle is half a revolution away from its reference.
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

int follow_references(struct equations *e) {
    const struct sizes *sizes = &e->sizes;
    const real quarter = R(1.570796326794896619231321691639751442L);
    real *reference = references_of_angles(e);
    const real *angle = e->gaps + sizes->events + sizes->switches;
    int moved = 0;
    for (long k = 0; k < sizes->windings; k++) {
        if (!(real_fabs(angle[k] - reference[k]) > quarter))
            continue;
        /* whole quarters, so that samples of a run share few references */
        reference[k] = R(rint((double)(angle[k] / quarter))) * quarter;
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
