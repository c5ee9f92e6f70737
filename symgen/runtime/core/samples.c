/* Samples within a step: interpolated, then projected. */
#include "run.h"

#include <string.h>

/* Largest number of shifts of a sample away from a loss of rank, each larger than the last. */
enum { SHIFTS = 24 };

static int sampled(struct run *run, real t, real h, real *sample) {
    struct equations *e = run->e;
    run->scheme.kind->interpolate(run, h, (t - run->state->t) / h, sample);
    if (run->task.stabilisation != PROJECTION)
        return DONE;
    int places_only = run->task.places_only && e->of->project_places;
    int status = places_only ? e->of->project_places(e, t, sample) : e->of->project(e, t, sample);
    if (status == DONE && strayed(run, run->state->t, run->y, t, sample))
        status = e->of->project(e, t, sample);
    return status == DONE && e->account->soundness < PASSAGE ? SINGULAR : status;
}

/* A sample whose accelerations have no correct digits, near a loss of rank, is moved slightly in time, also past the next
   ones, which are then behind it. */
static int one_sample(struct run *run, real until, real h, real *sample) {
    struct state *s = run->state;
    real *time = run->times + s->recorded;
    if (s->recorded && *time <= time[-1] && time[-1] > s->t)
        *time = real_fmin(time[-1] + R(1e-9) * h, until);
    const real wanted = *time;
    for (int k = 0; k < SHIFTS; k++) {
        int status = sampled(run, *time, h, sample);
        if (status == DONE || status == NOT_FINITE)
            return status;
        real shift = R(1e-4) * h * (real)(1L << k / 2) * (k % 2 ? R(1) : R(-1));
        real moved = wanted + shift;
        if (s->t < moved && moved < until && (s->recorded == 0 || moved > time[-1]))
            *time = moved;
    }
    if (time[1] <= until)
        return SINGULAR;
    *time = until;
    if (s->ended_by < 0)
        memcpy(sample, run->y_new, (size_t)run->dim * sizeof(real));
    else
        run->scheme.kind->interpolate(run, h, (until - s->t) / h, sample);
    return DONE;
}

/* Record the samples of the step that ends at t_new, up to a time. */
int record_samples(struct run *run, real t_new, real until, real h, double sound, int *prepared) {
    struct state *s = run->state;
    while (run->times[s->recorded] <= until) {
        real wanted = run->times[s->recorded], *sample = run->samples + s->recorded * run->dim;
        if (wanted == t_new && sound >= PASSAGE) {
            memcpy(sample, run->y_new, (size_t)run->dim * sizeof(real));
        } else {
            prepare_interpolation(run, h, prepared);
            int status = one_sample(run, until, h, sample);
            if (status != DONE)
                return status;
            s->moved += run->times[s->recorded] != wanted;
        }
        keep_windings(run);
        s->recorded++;
    }
    return DONE;
}
