#define LOOPS
#include "loop_steps.h"

/* -- closure ---------------------------------------------------------------------------------------------- */

/* Enter the pose evaluated last into the accounts. */
static void enter(struct loop *l) {
    struct account *account = l->base.account;
    account->factorisations += l->looks;
    l->looks = 0;
    account->soundness = (double)l->soundness;
    account->weakest = l->sizes.rank > 0 ? l->solved[l->factor.order[l->sizes.rank - 1]] : -1;
    l->seen->closure = (double)l->closure;
}

/* The pose evaluated last. A step evaluates its end several times: where it is projected, where it is continued from,
   and where its error is measured. */
static void keep_pose(struct loop *l, real t, const real *q) {
    l->revision = l->base.revision, l->t = t;
    memcpy(l->at, q, (size_t)l->sizes.n * sizeof(real));
}

static int is_kept(const struct loop *l, real t, const real *q) {
    return l->revision == l->base.revision && l->t == t && memcmp(l->at, q, (size_t)l->sizes.n * sizeof(real)) == 0;
}

real loop_evaluate(struct loop *l, real t, const real *q) {
    if (!is_kept(l, t, q)) {
        evaluate_screws(l, t, q);
        keep_pose(l, t, q);
    }
    enter(l);
    return l->closure;
}

int loop_close(struct loop *l, real t, real *q) {
    mask regular = 1;
    const int is_closed = any(closed_by_newton(l, 1, t, q, l->follows, &regular));
    enter(l);
    l->revision = 0;
    if (is_closed) {
        keep_pose(l, t, q);
        return DONE;
    }
    return !real_isfinite(l->closure) ? NOT_FINITE : any(regular) ? OPEN : SINGULAR;
}

/* -- rates ------------------------------------------------------------------------------------------------ */

int loop_move(struct loop *l, real t, const real *q, real *u, real *a) {
    const long n = l->sizes.n;
    real b[ROWS];
    if (!(R(l->base.account->soundness) > RANK_TOLERANCE))
        return SINGULAR;
    const real left = loop_changes(l, 1, NULL, b, u);
    l->seen->rates_left = (double)left;
    if (!all_finite(u, n))
        return NOT_FINITE;
    if (!(left <= real_fmax(LEFT, LEFT_OPEN * R(l->sizes.tolerance))))
        return INCONSISTENT;
    l->kernels.motion(&t, q, u, l->base.p, l->work, l->loads);
    loop_changes(l, 2, l->loads + ROWS * n, b, a);
    return all_finite(a, n) ? DONE : NOT_FINITE;
}

/* -- forces ----------------------------------------------------------------------------------------------- */

int loop_force(struct loop *l, real t, const real *q, const real *u, real *work) {
    const int is_regular = any(forced(l, t, q, u, work));
    if (l->kernels.inverse != NULL)
        l->seen->hold = (double)l->hold;
    return is_regular ? DONE : POLE;
}

void loop_undetermined(struct loop *l, const real *times, const real *states, long row, long count, real least,
                       real part, unsigned char *found) {
    const real weights[ROWS] = {1, real_sqrt(R(2)), real_sqrt(R(3)), real_sqrt(R(5)), real_sqrt(R(7)), real_sqrt(R(11))};
    const long n = l->sizes.n, out_size = l->sizes.out_size, room = l->sizes.work;
    const real effect = part * real_fmax(1, l->size);
    real *u = l->u, *p = l->base.p, *work = l->base.work, *plain = l->base.out, *moved = l->loads, wrench[ROWS];
    memset(u, 0, (size_t)n * sizeof(real));
    for (long i = 0; i < count && !is_interrupted(i); i++, found += out_size) {
        const real *q = states + row * i;
        long rank = 0;
        real norm = 0;
        loop_evaluate(l, times[i], q);
        while (rank < l->factor.steps
               && real_fabs(l->factor.r[(ROWS + 1) * rank]) > least * real_fabs(l->factor.r[0]))
            rank++;
        memset(found, 0, (size_t)out_size);
        if (rank == ROWS)
            continue;
        for (long k = 0; k < ROWS; k++) {
            wrench[k] = k < rank ? 0 : weights[k - rank];
            norm += wrench[k] * wrench[k];
        }
        norm = real_sqrt(norm);
        for (long k = rank - 1; k >= 0; k--)
            qr_turn(&l->factor, k, wrench);
        memset(work, 0, (size_t)room * sizeof(real));
        l->kernels.outputs(&times[i], q, u, p, work, plain);
        memset(work, 0, (size_t)room * sizeof(real));
        for (int k = 0; k < 3; k++) {
            work[n + k] = wrench[3 + k] / norm;
            work[n + 3 + k] = wrench[k] / norm * l->size;
        }
        l->kernels.outputs(&times[i], q, u, p, work, moved);
        for (long j = 0; j < out_size; j++)
            found[j] = real_fabs(moved[j] - plain[j]) > real_fmax(effect, R(1e-13) * (real_fabs(plain[j]) + 1));
    }
}
