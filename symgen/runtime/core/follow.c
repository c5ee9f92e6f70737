/* A driven loop followed through values of its input on one assembly branch. */
#include <string.h>

#include "loop_branch.h"

/* Every PACE attempts, following ends if the remaining range exceeds CREEP times the progress since the last check.
   */
#define CREEP R(1e4)
enum { PACE = 4096 };

/* Try to close the loop at `next`, in l->next, predicted from l->now at t; `last`: whether `next` is the target. */
static int attempt(struct loop *l, real t, real next, int last) {
    const real h = next - t, largest = predicted_change(l, h);
    l->follows = 1;
    const int status = largest <= LOOP_LONGEST ? loop_close(l, next, l->next) : OPEN;
    l->follows = 0;
    if (status != DONE)
        return status;
    if (!any(as_predicted(l, h, largest)))
        return OPEN;
    if (last && !(R(l->base.account->soundness) > RANK_RADIUS))
        return RATES_UNDETERMINED;
    return l->base.account->soundness > l->base.sizes.rank_tolerance ? DONE : SINGULAR;
}

/* Accept the closed pose in l->next as the last followed state. */
static int arrive(struct loop *l, real t, real next) {
    const long n = l->sizes.n;
    const int status = loop_move(l, next, l->next, l->next + n, l->next + 2 * n);
    if (status == DONE)
        take_next(l, 1, next - t);
    return status;
}

static int follow_to(struct loop *l, real *t, real target, real longest, int scouts);

/* Whether the branch of the state l->now at t leads to `next`, which l->next reaches on another one. At a change point, where
   branches cross, it does not: the motion goes straight on. The state is the same afterwards. */
static int leads(struct loop *l, real t, real next, real longest) {
    const long n = l->sizes.n;
    struct {
        real *at;
        long count;
    } parts[] = {{l->now, 3 * n}, {l->next, n}, {l->past, 3 * n}, {l->followed, ROWS * n}};
    const real stride = l->stride, side = l->side;
    const size_t count = sizeof parts / sizeof *parts;
    real *kept = l->scout;
    for (size_t i = 0; i < count; kept += parts[i++].count)
        memcpy(kept, parts[i].at, (size_t)parts[i].count * sizeof(real));
    real at = t;
    const int led = follow_to(l, &at, next, longest, 1) == DONE;
    kept = l->scout;
    for (size_t i = 0; i < count; kept += parts[i++].count)
        memcpy(parts[i].at, kept, (size_t)parts[i].count * sizeof(real));
    l->stride = stride, l->side = side;
    return led;
}

/* Reach the target on one assembly branch, in steps whose prediction is close to the solution. A scout ends near a loss
 * of rank.
 *
 * Return RATES_UNDETERMINED if the screws lose rank at the target itself: l->next is closed there, and t and l->now remain
 * at the previous step. */
static int follow_to(struct loop *l, real *t, real target, real longest, int scouts) {
    real h = target - *t, led = *t;
    if (h == 0)
        return DONE;
    if (!real_isfinite(h) || !(longest > 0))
        return NOT_FINITE;
    real seen = *t;
    for (long tries = 1;; tries++) {
        if (is_interrupted(tries))
            return NOT_FINITE;
        if (tries % PACE == 0) {
            if (!(real_fabs(target - *t) < CREEP * real_fabs(*t - seen)))
                return STEP_TOO_SMALL;
            seen = *t;
        }
        if (real_fabs(h) > longest)
            h = h > 0 ? longest : -longest;
        real next = *t + h;
        if (real_fabs(target - next) < R(1e-9) * real_fabs(h))
            next = target;
        if (next == *t)
            return STEP_TOO_SMALL;
        int status = attempt(l, *t, next, next == target);
        if (status == RATES_UNDETERMINED)
            return RATES_UNDETERMINED;
        if (status == DONE && !any(same_branch_of(l))) {
            const int ahead = h > 0 ? led >= next : led <= next;
            if (scouts || ahead || leads(l, *t, next, longest)) {
                led = ahead ? led : next;
                status = OPEN;
            } else {
                status = loop_close(l, next, l->next);
            }
        }
        if (status == DONE && scouts && !(R(l->base.account->soundness) > R(10) * RANK_RADIUS))
            return SINGULAR;
        if (status == DONE) {
            status = arrive(l, *t, next);
            if (status != DONE)
                return status;
            *t = next;
            if (next == target)
                return DONE;
            h = real_fabs(2 * h) < real_fabs(target - next) ? 2 * h : target - next;
            continue;
        }
        h *= R(0.5);
        if (real_fabs(h) < R(1e-10) * longest)
            return status == SINGULAR || status == NOT_FINITE ? status : OPEN;
    }
}

/* Write the diagnosis of a sample; `hold` is zero if the forces are undetermined. */
static void diagnose(const struct loop *l, int status, double *row) {
    row[CLOSURE] = l->seen->closure;
    row[RATES] = status == RATES_UNDETERMINED ? 0 : l->seen->rates_left;
    row[SOUNDNESS] = l->base.account->soundness;
    row[HOLD] = status == RATES_UNDETERMINED ? 0 : l->seen->hold;
    row[STATUS] = status;
}

/* As loop_follow, from and to the state l->now. */
static int follow_times(struct loop *l, real *t, const real *times, long count, real longest, real *states, long row,
                        real *out, long width, double *diagnosis, long *reached) {
    const long n = l->sizes.n;
    real *q = l->now, *u = q + n, *work = u + n;
    int status = loop_close(l, *t, q);
    if (status == DONE)
        status = loop_move(l, *t, q, u, work);
    if (status != DONE)
        return status;
    keep_columns(l, 1);
    for (long i = 0; i < count; i++) {
        real *state = states + row * i, *recorded = out + width * i;
        status = is_interrupted(i) ? NOT_FINITE : follow_to(l, t, times[i], longest, 0);
        if (status != DONE && status != RATES_UNDETERMINED)
            return status;
        const real *at = status == RATES_UNDETERMINED ? l->next : q;
        memcpy(state, at, (size_t)n * sizeof(real));
        if (status == DONE) {
            status = loop_force(l, *t, q, u, work);
            memcpy(state + n, u, (size_t)(2 * n + ROWS) * sizeof(real));
        }
        if (l->kernels.outputs)
            l->kernels.outputs(&times[i], at, u, l->p, work, recorded);
        if (status == DONE && !(all_finite(work, n + ROWS) && all_finite(recorded, l->sizes.out_size)))
            return NOT_FINITE;
        diagnose(l, status, diagnosis + DIAGNOSES * i);
        *reached = i + 1;
    }
    return DONE;
}

int loop_follow(struct loop *l, real *t, real *q, const real *times, long count, real longest, real *states,
                long row, real *out, long width, double *diagnosis, long *reached) {
    l->stride = 0, *reached = 0;
    copy(q, l->sizes.n, l->now);
    const int status = follow_times(l, t, times, count, longest, states, row, out, width, diagnosis, reached);
    copy(l->now, l->sizes.n, q);
    return status;
}
