#include "loop.h"

#include <string.h>

#include "arena.h"
#include "linear.h"
#include "loop_limits.h"

/* Largest numbers of Newton's iterations to a closed pose, and of halvings of one of its steps. */
enum { NEWTON = 40, HALVINGS = 8 };

#define NUMBER real
#define LOOP struct loop
#include "screws.h"

/* -- memory ----------------------------------------------------------------------------------------------- */

/* Reals for the work and the results of any kernel. */
static long room(const struct loop_sizes *s) {
    const long n = s->n, wanted[] = {n + ROWS, s->out_size, 2 * ROWS * n + 12, n + n * n};
    long most = s->work;
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
        if (wanted[i] > most)
            most = wanted[i];
    return most + 1;
}

static struct sizes as_equations(const struct loop_sizes *s) {
    struct sizes made = {0};
    made.n = s->n;
    made.m = ROWS;
    made.extra = s->extra;
    made.parameters = s->parameters;
    made.derived = s->derived;
    made.work = s->work;
    made.choices = made.windings = s->balls;
    made.turns = s->balls ? s->n : 0;
    made.switches = s->switches;
    made.rank_tolerance = (double)RANK_TOLERANCE;
    return made;
}

/* Point all arrays into memory, or only count their bytes. */
static size_t arrange(struct loop *l, const struct loop_sizes *s, void *memory) {
    const ptrdiff_t n = s->n, big = room(s), square = (n + 1) * (n + 1);
    const struct arena_array arrays[] = {
        ARENA_ARRAY(l->seen, 1),
        ARENA_ARRAY(l->base.out, big),
        ARENA_ARRAY(l->base.work, big),
        ARENA_ARRAY(l->work2, big),
        ARENA_ARRAY(l->loads, big),
        ARENA_ARRAY(l->screws, big),
        ARENA_ARRAY(l->matrix, ROWS * (n + 1)),
        ARENA_ARRAY(l->prescribed, 3 * s->inputs + 1),
        ARENA_ARRAY(l->efforts, n + 1),
        ARENA_ARRAY(l->scale, n + 1),
        ARENA_ARRAY(l->q, n + 1),
        ARENA_ARRAY(l->u, n + 1),
        ARENA_ARRAY(l->trial, n + 1),
        ARENA_ARRAY(l->step, n + 1),
        ARENA_ARRAY(l->reduced, square),
        ARENA_ARRAY(l->basis, square),
        ARENA_ARRAY(l->gain, s->unknown * s->unknown + 1),
        ARENA_ARRAY(l->past, 3 * (n + 1)),
        ARENA_ARRAY(l->change, n + 1),
        ARENA_ARRAY(l->columns, ROWS * (n + 1)),
        ARENA_ARRAY(l->followed, ROWS * (n + 1)),
        ARENA_ARRAY(l->scout, 4 * (n + 1) + 3 * (n + 1) + ROWS * (n + 1)),
        ARENA_ARRAY(l->usual, n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

size_t loop_bytes(const struct loop_sizes *sizes) {
    const struct sizes plain = as_equations(sizes);
    struct loop counted;
    return rounded(equations_bytes(&plain)) + arrange(&counted, sizes, NULL);
}

void loop_bind(struct loop *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
               const ptrdiff_t *numbers, const unsigned char *is_length, const struct ball *balls, void *memory) {
    const struct sizes plain = as_equations(sizes);
    struct kernels none = {0};
    none.energy = kernels->energy;
    none.setup = kernels->setup;
    none.events = kernels->events;
    equations_bind(&l->base, &plain, &none, memory);
    l->base.of = &loop_behaviour;
    l->base.owner = l;
    arrange(l, sizes, (char *)memory + rounded(equations_bytes(&plain)));
    l->kernels = *kernels;
    l->sizes = *sizes;
    l->solved = numbers;
    l->driven = l->solved + sizes->solved;
    l->found = l->driven + sizes->inputs;
    l->known = l->found + sizes->unknown;
    l->is_length = is_length;
    l->balls = balls;
    l->free = sizes->solved - sizes->rank;
    l->size = R(sizes->size);
    for (long i = 0; i < sizes->n; i++)
        l->scale[i] = is_length[i] ? l->size : 1;
}

/* -- closure ---------------------------------------------------------------------------------------------- */

void loop_prescribe(struct loop *l, real t, real *q) {
    if (l->sizes.inputs == 0)
        return;
    l->kernels.inputs(&t, q, q, l->base.p, l->work2, l->prescribed);
    for (long k = 0; k < l->sizes.inputs; k++)
        q[l->driven[k]] = l->prescribed[3 * k];
}

real loop_look(struct loop *l, real t, const real *q) {
    const long n = l->sizes.n, rank = l->sizes.rank;
    struct account *account = l->base.account;
    real worst = 0;
    l->kernels.position(&t, q, l->u, l->base.p, l->work2, l->screws);
    for (int i = 0; i < 12; i++) {
        real entry = real_fabs(l->screws[i]);
        if (i % 4 == 3)
            entry /= l->size;
        if (!real_isfinite(entry)) {
            l->seen->closure = (double)entry;
            account->soundness = 0;
            return entry;
        }
        worst = real_fmax(worst, entry);
    }
    for (long k = 0; k < l->sizes.solved; k++)
        for (int i = 0; i < ROWS; i++) {
            const real entry = l->screws[12 + n * i + l->solved[k]] * l->scale[l->solved[k]];
            l->columns[ROWS * k + i] = i < 3 ? entry : entry / l->size;
        }
    memcpy(l->matrix, l->columns, (size_t)(ROWS * l->sizes.solved) * sizeof(real));
    qr_factorise(l->matrix, l->sizes.solved, &l->factor);
    account->factorisations++;
    account->soundness = 1;
    account->weakest = -1;
    if (rank > 0) {
        const real first = real_fabs(l->factor.r[0]);
        account->weakest = l->solved[l->factor.order[rank - 1]];
        account->soundness = first > 0 ? (double)(real_fabs(l->factor.r[(ROWS + 1) * (rank - 1)]) / first) : 0;
    }
    l->seen->closure = (double)worst;
    return worst;
}

void loop_solve(struct loop *l, real *b, real *x) {
    for (int k = 3; k < ROWS; k++)
        b[k] /= l->size;
    qr_solve(&l->factor, l->sizes.rank, b, x);
    for (long k = 0; k < l->sizes.solved; k++)
        x[k] *= l->scale[l->solved[k]];
}

/* Set the solved variables of q to `trial` plus a part of `step`. */
static void place(const struct loop *l, real *q, real part) {
    for (long k = 0; k < l->sizes.solved; k++)
        q[l->solved[k]] = part == 0 ? l->trial[k] : l->trial[k] + part * l->step[k];
}

int loop_close(struct loop *l, real t, real *q) {
    int halved = 0;
    real before = REAL_INFINITY, part = 1, fine = FINE, defect = 0, b[ROWS], x[MOST], step = REAL_INFINITY;
    const real tolerance = R(l->sizes.tolerance);
    loop_prescribe(l, t, q);
    /* The resolution of an angle of many revolutions is its last digit. */
    for (long k = 0; k < l->sizes.n; k++)
        fine = real_fmax(fine, 2 * REAL_EPSILON * real_fabs(q[k]) / l->scale[k]);
    const real coarse = real_fmax(COARSE, 8 * fine);
    for (int turn = 0; turn < NEWTON; turn++) {
        l->seen->iterations = turn + 1;
        defect = loop_look(l, t, q);
        if (!real_isfinite(defect))
            return NOT_FINITE;
        if (defect <= fine)
            return DONE;
        if (defect > R(0.5) * before && real_fmax(before, defect) <= coarse) {
            if (defect > before) {
                place(l, q, 0);
                loop_look(l, t, q);
            }
            return DONE;
        }
        if (defect <= tolerance && step <= STILL)
            return DONE;
        if (defect > before && defect > tolerance && halved < HALVINGS) {
            halved++;
            part *= R(0.5);
            place(l, q, part);
            continue;
        }
        before = defect;
        part = 1;
        halved = 0;
        step = 0;
        mismatch(l, b);
        const long rank = l->sizes.rank;
        if (l->follows && rank > 0 && !(R(l->base.account->soundness) > SIGHT))
            l->sizes.rank--; /* the variable that the pose leaves undetermined stays as predicted */
        loop_solve(l, b, x);
        l->sizes.rank = rank;
        for (long k = 0; k < l->sizes.solved; k++) {
            if (!real_isfinite(x[k]))
                return SINGULAR;
            /* Beyond a radian the linear prediction of a step is not valid. */
            step = real_fmax(step, real_fabs(x[k]) / l->scale[l->solved[k]]);
        }
        part = real_fmax(part, step);
        part = 1 / part;
        for (long k = 0; k < l->sizes.solved; k++) {
            l->trial[k] = q[l->solved[k]];
            l->step[k] = x[k];
            q[l->solved[k]] += part * x[k];
        }
    }
    return R(l->seen->closure) <= coarse ? DONE : OPEN;
}

/* -- rates ------------------------------------------------------------------------------------------------ */

real loop_changes(struct loop *l, int which, const real *drift, real *b, real *v) {
    const long n = l->sizes.n;
    real size = 0, left = 0, x[MOST];
    for (int i = 0; i < ROWS; i++) {
        b[i] = drift ? -drift[i] : 0;
        size = real_fmax(size, i < 3 ? real_fabs(b[i]) : real_fabs(b[i]) / l->size);
    }
    for (long k = 0; k < l->sizes.inputs; k++) {
        const long j = l->driven[k];
        const real rate = l->prescribed[3 * k + which];
        v[j] = rate;
        size = real_fmax(size, real_fabs(rate) / l->scale[j]);
        for (int i = 0; i < ROWS; i++)
            b[i] -= l->screws[12 + n * i + j] * rate;
    }
    loop_solve(l, b, x);
    for (long k = 0; k < l->sizes.solved; k++)
        v[l->solved[k]] = x[k];
    for (long k = l->sizes.rank; k < ROWS; k++)
        if (!(real_fabs(b[k]) <= left))
            left = real_fabs(b[k]);
    return size > 0 ? left / size : 0;
}

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
    l->kernels.motion(&t, q, u, l->base.p, l->work2, l->loads);
    loop_changes(l, 2, l->loads + ROWS * n, b, a);
    return all_finite(a, n) ? DONE : NOT_FINITE;
}

/* -- forces ----------------------------------------------------------------------------------------------- */

void loop_hold(struct loop *l, const real *efforts, real *wrench) {
    real c[MOST], s[ROWS];
    for (long k = 0; k < l->sizes.solved; k++)
        c[k] = efforts[k] * l->scale[l->solved[k]];
    qr_solve_transposed(&l->factor, l->sizes.rank, c, s);
    for (int k = 0; k < 3; k++) {
        wrench[k] = s[3 + k] / l->size;
        wrench[3 + k] = s[k];
    }
}

/* Solve the m equations of `gain` for b in place; return their determinant, with scaled rates. */
static real balance(struct loop *l, ptrdiff_t m, real *b) {
    ptrdiff_t swaps[MOST];
    real product = 1;
    if (!factor_dense(m, l->gain, swaps))
        return 0;
    for (ptrdiff_t k = 0; k < m; k++) {
        if (swaps[k] != k)
            product = -product;
        product *= l->gain[m * k + k] / l->scale[l->solved[l->found[k]]] * l->scale[l->driven[l->known[k]]];
    }
    solve_dense(m, l->gain, swaps, b);
    return product;
}

int loop_force(struct loop *l, real t, const real *q, const real *u, real *work) {
    const long n = l->sizes.n, unknown = l->sizes.unknown;
    real b[MOST], c[ROWS], moved[MOST], needed[MOST];
    if (!l->kernels.inverse)
        return DONE;
    l->kernels.inverse(&t, q, u, l->base.p, work, l->loads);
    memset(l->efforts, 0, (size_t)n * sizeof(real));
    if (l->kernels.given)
        l->kernels.given(&t, q, u, l->base.p, work, l->efforts);
    for (long k = 0; k < l->sizes.solved; k++)
        b[k] = l->efforts[l->solved[k]] - l->loads[l->solved[k]];
    loop_hold(l, b, work + n);
    l->seen->hold = 1;
    if (unknown == 0)
        return DONE;
    /* gain[i, x]: rate of the variable of unknown effort x at unit rate of the input i of known effort. The unknown
     * efforts E balance the efforts that the inputs need beyond their known ones: gain E = needed. */
    for (long i = 0; i < unknown; i++) {
        const long j = l->driven[l->known[i]];
        for (int k = 0; k < ROWS; k++)
            c[k] = -l->screws[12 + n * k + j];
        loop_solve(l, c, moved);
        for (long x = 0; x < unknown; x++)
            l->gain[unknown * i + x] = moved[l->found[x]];
        needed[i] = l->loads[j] + power(l, j, work + n) - l->efforts[j];
    }
    const real hold = balance(l, unknown, needed);
    l->seen->hold = (double)hold;
    if (!(real_fabs(hold) > NO_DRIVE))
        return POLE;
    for (long x = 0; x < unknown; x++)
        b[l->found[x]] += needed[x];
    loop_hold(l, b, work + n);
    return DONE;
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
        loop_look(l, times[i], q);
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
