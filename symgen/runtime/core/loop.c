#include "loop.h"

#include <string.h>

#include "arena.h"
#include "linear.h"

#define LOOP struct loop
#include "loop_steps.h"

/* -- memory ----------------------------------------------------------------------------------------------- */

/* Reals for the work and the results of any kernel. */
static long room(const struct loop_sizes *s) {
    const long n = s->n, wanted[] = {n + ROWS, s->out_size, 2 * ROWS * n + 24, n + n * n};
    long most = s->work;
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
        if (wanted[i] > most)
            most = wanted[i];
    return most + 1;
}

static struct sizes as_equations(const struct loop_sizes *s) {
    const long unknowns = s->n + ROWS;
    struct sizes made = {0};
    made.n = s->n;
    made.m = ROWS;
    made.extra = s->extra;
    made.parameters = s->parameters;
    made.derived = s->derived;
    made.work = s->series_rows && s->work < unknowns * unknowns ? unknowns * unknowns : s->work;
    made.series_rows = s->series_rows, made.series_watched = s->series_watched;
    made.choices = made.windings = s->balls;
    made.turns = s->balls ? s->n : 0;
    made.switches = s->switches;
    made.tables = s->tables;
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
        ARENA_ARRAY(l->work, big),
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
    none.series = kernels->series;
    equations_bind(&l->base, &plain, &none, memory);
    l->base.of = &loop_behaviour;
    l->base.owner = l;
    arrange(l, sizes, (char *)memory + rounded(equations_bytes(&plain)));
    l->p = l->base.p;
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
    prescribe(l, t, q);
}

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

void loop_solve(struct loop *l, real *b, real *x) {
    solve_screws(l, l->sizes.rank, b, x);
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

real loop_changes(struct loop *l, int which, const real *drift, real *b, real *v) {
    return changes(l, which, drift, b, v);
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
    l->kernels.motion(&t, q, u, l->base.p, l->work, l->loads);
    loop_changes(l, 2, l->loads + ROWS * n, b, a);
    return all_finite(a, n) ? DONE : NOT_FINITE;
}

/* -- forces ----------------------------------------------------------------------------------------------- */

void loop_hold(struct loop *l, const real *efforts, real *wrench) {
    held(l, efforts, wrench);
}

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
