/* A driven loop followed through values of its input on one assembly branch. */
#include <string.h>

#include "loop_branch.h"

/* Every PACE attempts, following ends if the remaining range exceeds CREEP times the progress since the last check.
   */
#define CREEP R(1e4)
enum { PACE = 4096 };

/* Try to close the loop at `next`, in l->q, predicted from (t, q); `last`: whether `next` is the target. */
static int attempt(struct loop *l, real t, const real *q, real next, int last) {
    const long row = l->sizes.n + 1;
    const struct loop_state now = {q, l->u, l->base.work}, past = {l->past, l->past + row, l->past + 2 * row};
    const real h = next - t, largest = predicted_change(l, h, R(l->seen->stride), now, past, l->q);
    l->follows = 1;
    const int status = largest <= LOOP_LONGEST ? loop_close(l, next, l->q) : OPEN;
    l->follows = 0;
    if (status != DONE)
        return status;
    if (!any(as_predicted(l, h, largest, now, l->q)))
        return OPEN;
    if (last && !(R(l->base.account->soundness) > RANK_RADIUS))
        return RATES_UNDETERMINED;
    return l->base.account->soundness > l->base.sizes.rank_tolerance ? DONE : SINGULAR;
}

static void keep_columns(struct loop *l) {
    memcpy(l->followed, l->columns, (size_t)(ROWS * l->sizes.solved) * sizeof(real));
}

/* Accept the closed pose in l->q at t as the last followed state. */
static int arrive(struct loop *l, real t, real *q, real next) {
    const long n = l->sizes.n;
    const size_t row = (size_t)n * sizeof(real);
    memcpy(l->past, q, row);
    memcpy(l->past + n + 1, l->u, row);
    memcpy(l->past + 2 * (n + 1), l->base.work, row);
    l->seen->stride = (double)(next - t);
    const int status = loop_move(l, next, l->q, l->u, l->base.work);
    if (status != DONE)
        return status;
    memcpy(q, l->q, row);
    keep_columns(l);
    return DONE;
}

static int follow_to(struct loop *l, real *t, real *q, real target, real longest, int scouts);

/* Whether the branch of the state (t, q) leads to `next`, which l->q reaches on another one. At a change point, where
   branches cross, it does not: the motion goes straight on. The state is the same afterwards. */
static int leads(struct loop *l, real t, real *q, real next, real longest) {
    const long n = l->sizes.n, row = n + 1;
    struct {
        real *at;
        long count;
    } parts[] = {{q, n}, {l->q, n}, {l->u, n}, {l->base.work, n}, {l->past, 3 * row}, {l->followed, ROWS * n}};
    const double stride = l->seen->stride;
    const size_t count = sizeof parts / sizeof *parts;
    real *kept = l->scout;
    for (size_t i = 0; i < count; kept += parts[i++].count)
        memcpy(kept, parts[i].at, (size_t)parts[i].count * sizeof(real));
    real at = t;
    const int led = follow_to(l, &at, q, next, longest, 1) == DONE;
    kept = l->scout;
    for (size_t i = 0; i < count; kept += parts[i++].count)
        memcpy(parts[i].at, kept, (size_t)parts[i].count * sizeof(real));
    l->seen->stride = stride;
    return led;
}

/* Reach the target on one assembly branch, in steps whose prediction is close to the solution. A scout ends near a loss
 * of rank.
 *
 * Return RATES_UNDETERMINED if the screws lose rank at the target itself: l->q is closed there, and t and q remain at
 * the previous step. */
static int follow_to(struct loop *l, real *t, real *q, real target, real longest, int scouts) {
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
        int status = attempt(l, *t, q, next, next == target);
        if (status == RATES_UNDETERMINED)
            return RATES_UNDETERMINED;
        if (status == DONE && !any(same_branch_of(l))) {
            const int ahead = h > 0 ? led >= next : led <= next;
            if (scouts || ahead || leads(l, *t, q, next, longest)) {
                led = ahead ? led : next;
                status = OPEN;
            } else {
                status = loop_close(l, next, l->q);
            }
        }
        if (status == DONE && scouts && !(R(l->base.account->soundness) > R(10) * RANK_RADIUS))
            return SINGULAR;
        if (status == DONE) {
            status = arrive(l, *t, q, next);
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

int loop_follow(struct loop *l, real *t, real *q, const real *times, long count, real longest, real *states,
                long row, real *out, long width, double *diagnosis, long *reached) {
    const long n = l->sizes.n;
    real *u = l->u, *work = l->base.work, *p = l->base.p;
    l->seen->stride = 0;
    *reached = 0;
    int status = loop_close(l, *t, q);
    if (status == DONE)
        status = loop_move(l, *t, q, u, work);
    if (status != DONE)
        return status;
    keep_columns(l);
    for (long i = 0; i < count; i++) {
        real *state = states + row * i, *recorded = out + width * i;
        status = is_interrupted(i) ? NOT_FINITE : follow_to(l, t, q, times[i], longest, 0);
        if (status != DONE && status != RATES_UNDETERMINED)
            return status;
        const real *at = status == RATES_UNDETERMINED ? l->q : q;
        memcpy(state, at, (size_t)n * sizeof(real));
        if (status == DONE) {
            memcpy(state + n, u, (size_t)n * sizeof(real));
            status = loop_force(l, *t, q, u, work);
            memcpy(state + 2 * n, work, (size_t)(n + ROWS) * sizeof(real));
        }
        if (l->kernels.outputs)
            l->kernels.outputs(&times[i], at, u, p, work, recorded);
        if (status == DONE && !(all_finite(work, n + ROWS) && all_finite(recorded, l->sizes.out_size)))
            return NOT_FINITE;
        diagnose(l, status, diagnosis + DIAGNOSES * i);
        *reached = i + 1;
    }
    return DONE;
}
