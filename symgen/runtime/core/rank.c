/* The least pivot of the constraints, followed through the steps, and its zeros. */
#include "run.h"

#include <string.h>

/* Part of a step outside of a run at which pivots are evaluated. */
#define OUTSIDE R(0.125)

/* Whether the polynomial of the present step holds at a time, which may be before it: a series does as far back as it may
   ahead, but not across a jump of a load. */
static int is_polynomial(const struct run *run, real t) {
    const struct kind *kind = run->scheme.kind;
    const real back = run->state->t - t;
    return kind->places && (back <= 0 || (run->e->sizes.switches == 0 && back <= kind->longest(run)));
}

/* Return the least pivot's part at a time of the last two steps, by the polynomial of the step or by cubic interpolation. */
static double soundness(struct run *run, real t, real t_new) {
    const struct state *s = run->state;
    struct equations *e = run->e;
    int last = t >= s->t;
    real start = last ? s->t : s->t_old, h = last ? t_new - s->t : s->t - s->t_old, x = (t - start) / h;
    const real *y0 = last ? run->y : run->y_old, *y1 = last ? run->y_new : run->y;
    const real *u0 = y0 + run->e->n, *u1 = y1 + run->e->n;
    memcpy(run->error, y1, (size_t)run->dim * sizeof(real));
    if (is_polynomial(run, t))
        run->scheme.kind->places(run, t - s->t, run->error);
    else
        for (long i = 0; i < run->e->n; i++)
            run->error[i] = y0[i] + x * x * (R(3) - R(2) * x) * (y1[i] - y0[i])
                            + h * x * (R(1) - x) * ((R(1) - x) * u0[i] - x * u1[i]);
    (e->of->look ? e->of->look : e->of->factorise)(e, t, run->error);
    return e->account->soundness;
}

/* Search between a and b for the instant at which the constraints are nearest to a loss of rank. Towards a loss of rank
   both values fall with the square of the interval, to less than a tenth in six divisions of it; a search in which the
   larger one does not fall to half ends. */
static void look_for_passage(struct run *run, real a, real b, real t_new) {
    struct state *s = run->state;
    real ratio = R(0.6180339887498949), x = b - ratio * (b - a), y = a + ratio * (b - a);
    double at_x = soundness(run, x, t_new), at_y = soundness(run, y, t_new), before = INFINITY;
    for (int k = 0; k < 50; k++) {
        if (k % 6 == 0) {
            if (fmin(at_x, at_y) > PASSAGE && fmax(at_x, at_y) > 0.5 * before)
                return;
            before = fmax(at_x, at_y);
        }
        if (at_x < at_y) {
            b = y, y = x, at_y = at_x;
            x = b - ratio * (b - a);
            at_x = soundness(run, x, t_new);
        } else {
            a = x, x = y, at_x = at_y;
            y = a + ratio * (b - a);
            at_y = soundness(run, y, t_new);
        }
    }
    if (fmin(at_x, at_y) < PASSAGE) {
        struct passage found = {(double)x, fmax(at_x, 0.0), run->e->account->weakest};
        run->passages[s->passages++] = found;
    }
}

/* Parts of a step at whose ends pivots are evaluated. */
static int parts_of_step(const struct run *run, real h) {
    return run->scheme.kind->parts ? run->scheme.kind->parts(run, h) : STEP_PROBES;
}

/* Whether pivots, which fall to `at` at the first or last instant of a run, still fall to a time a little outside of it, by
   the polynomial of the step: their minimum is not in the run then. */
static int fall_on(struct run *run, double at, real outside, real t_new) {
    if (!(at > PASSAGE && is_polynomial(run, outside)))
        return 0;
    const double there = soundness(run, outside, t_new);
    return 0 < there && there < at;
}

/* Find the least pivots inside the step to t_new. The pivots of a tree do not cancel at all, so there is nothing to
   follow. */
void look_inside(struct run *run, real t_new) {
    struct state *s = run->state;
    const int parts = parts_of_step(run, t_new - s->t);
    s->t_looked = t_new;
    s->looked = INFINITY;
    if (run->e->m == 0 || (s->sound == 1.0 && run->e->account->soundness == 1.0))
        return;
    for (int k = 1; k < parts; k++) {
        s->looks[k - 1] = soundness(run, s->t + R(k) * (t_new - s->t) / R(parts), t_new);
        s->looked = fmin(s->looked, s->looks[k - 1]);
    }
}

/* Follow the least pivot through the step and locate its minima. The two previous looks are (t_before, at_before) and
   (t_look, at_look). */
void watch_rank(struct run *run, real t_new, double sound) {
    struct state *s = run->state;
    struct account *account = run->e->account;
    const struct account at_end = *account;
    const int parts = parts_of_step(run, t_new - s->t);
    const real outside = OUTSIDE * (t_new - s->t);
    if (run->e->m == 0 || (s->sound == 1.0 && sound == 1.0))
        return;
    if (s->t_looked != t_new || s->looked == INFINITY)
        look_inside(run, t_new);
    for (int k = 1; k <= parts; k++) {
        real t = s->t + R(k) * (t_new - s->t) / R(parts);
        double at = k == parts ? sound : s->looks[k - 1];
        const int is_first = s->t_before == s->t_look;
        if (s->at_look <= s->at_before && s->at_look < at && !(is_first && fall_on(run, s->at_look, s->t - outside, t_new)))
            look_for_passage(run, s->t_before, t, t_new);
        s->t_before = s->t_look, s->at_before = s->at_look;
        s->t_look = t, s->at_look = at;
    }
    if (is_last(run, t_new) && s->at_look < s->at_before && !fall_on(run, s->at_look, t_new + outside, t_new))
        look_for_passage(run, s->t_before, t_new, t_new);
    if (run->e->of->look == NULL)
        run->e->of->factorise(run->e, t_new, run->y_new);
    account->soundness = at_end.soundness, account->weakest = at_end.weakest, account->lost = at_end.lost;
}
