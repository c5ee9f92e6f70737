/* Memory, closure, rates and forces of a loop, or of one in each lane of vectors: see wide.h. The including file defines LOOPS,
 * the storage class of the functions that loop.h declares. Lanes have independent screws, six at most. */
#include <string.h>

#include "arena.h"
#include "loop.h"
#include "loop_limits.h"
#include "newton.h"

/* Most iterations of Newton's method to a closed pose. */
enum { CLOSINGS = 40 };
/* The same in lanes. */
enum { LANE_CLOSINGS = 12 };
/* Most halvings of one of its steps. Lanes that need a halving fail. */
enum { HALVINGS = 8 };

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
static size_t loop_place(struct loop *l, const struct loop_sizes *s, void *memory) {
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
        ARENA_ARRAY(l->now, 2 * n + big),
        ARENA_ARRAY(l->past, 3 * n),
        ARENA_ARRAY(l->next, 2 * n + big),
        ARENA_ARRAY(l->change, n + 1),
        ARENA_ARRAY(l->columns, ROWS * (n + 1)),
        ARENA_ARRAY(l->followed, ROWS * (n + 1)),
        ARENA_ARRAY(l->scout, 4 * (n + 1) + 3 * (n + 1) + ROWS * (n + 1)),
        ARENA_ARRAY(l->usual, n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

LOOPS size_t loop_bytes(const struct loop_sizes *sizes) {
    const struct sizes plain = as_equations(sizes);
    struct loop counted;
    return equations_bytes(&plain) + loop_place(&counted, sizes, NULL);
}

LOOPS void loop_bind(struct loop *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
                     const ptrdiff_t *numbers, const unsigned char *is_length, const struct ball *balls, void *memory) {
    const struct sizes plain = as_equations(sizes);
    struct kernels none = {0};
    none.energy = kernels->energy;
    none.setup = kernels->setup;
    none.events = kernels->events;
    none.series = kernels->series;
    equations_bind(&l->base, &plain, &none, memory);
    l->base.of = WIDTH == 1 ? &loop_behaviour : NULL;
    l->base.owner = l;
    loop_place(l, sizes, (char *)memory + l->base.bytes);
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
        l->scale[i] = all(is_length[i] ? l->size : 1);
}

/* Write the twist that closes the loop to first order: minus the small rotation, and the displacement at O. */
static void mismatch(const struct loop *l, wide *b) {
    const wide *e = l->screws;
    const wide x = R(0.5) * (e[9] - e[6]), y = R(0.5) * (e[2] - e[8]), z = R(0.5) * (e[4] - e[1]);
    b[0] = -x;
    b[1] = -y;
    b[2] = -z;
    b[3] = -e[3] + y * e[11] - z * e[7];
    b[4] = -e[7] + z * e[3] - x * e[11];
    b[5] = -e[11] + x * e[7] - y * e[3];
}

/* The reciprocal product of variable j's screw with a wrench (force, moment). */
static wide power(const struct loop *l, long j, const wide *w) {
    const long n = l->sizes.n;
    wide total = {0};
    for (int i = 0; i < 3; i++)
        total += l->screws[12 + n * i + j] * w[3 + i] + l->screws[12 + n * (3 + i) + j] * w[i];
    return total;
}

LOOPS void loop_prescribe(struct loop *l, wide t, wide *q) {
    if (l->sizes.inputs == 0)
        return;
    call(l->kernels.inputs, &t, q, q, l->p, l->work, l->prescribed);
    for (long k = 0; k < l->sizes.inputs; k++)
        q[l->driven[k]] = l->prescribed[3 * k];
}

/* Write the scaled screws of the solved variables, six numbers for each. */
static void scaled_columns(const struct loop *l, wide *columns) {
    for (long k = 0; k < l->sizes.solved; k++)
        for (int i = 0; i < ROWS; i++) {
            const wide entry = l->screws[12 + l->sizes.n * i + l->solved[k]] * l->scale[l->solved[k]];
            columns[ROWS * k + i] = entry / (i < 3 ? 1 : l->size);
        }
}

/* Evaluate closure and screws at q and factorise; return the largest defect, which is not finite if closure is not. */
static wide evaluate_screws(struct loop *l, wide t, const wide *q) {
    const long rank = l->sizes.rank;
    wide defects[12];
    call(l->kernels.position, &t, q, q, l->p, l->work, l->screws);
    for (int i = 0; i < 12; i++)
        defects[i] = l->screws[i] / (i % 4 == 3 ? l->size : 1);
    l->closure = largest_in(defects, 12);
    l->soundness = all(0);
    if (!any(is_finite(l->closure)))
        return l->closure;
    l->looks++;
    scaled_columns(l, l->columns);
    memcpy(l->matrix, l->columns, (size_t)(ROWS * l->sizes.solved) * sizeof(wide));
    qr_factorise(l->matrix, l->sizes.solved, &l->factor);
    l->soundness = all(1);
    if (rank > 0) {
        const wide first = magnitude(l->factor.r[0]);
        l->soundness = chosen(first > 0, magnitude(l->factor.r[(ROWS + 1) * (rank - 1)]) / first, all(0));
    }
    return l->closure;
}

LOOPS void loop_solve(const struct loop *l, long rank, wide *b, wide *x) {
    for (int k = 3; k < ROWS; k++)
        b[k] /= l->size;
    qr_solve(&l->factor, rank, b, x);
    for (long k = 0; k < l->sizes.solved; k++)
        x[k] *= l->scale[l->solved[k]];
}

/* In some lanes, set the solved variables of q to `trial` plus a part of `step`. */
static void retry(const struct loop *l, mask which, wide part, wide *q) {
    for (long k = 0; k < l->sizes.solved; k++) {
        wide *variable = q + l->solved[k];
        *variable = chosen(which, l->trial[k] + part * l->step[k], *variable);
    }
}

/* A pose q at t that Newton's method closes: the length of the last correction and the part of it that was applied. */
struct closing {
    struct loop *l;
    wide t, *q, part, step;
    int follows;
    mask regular;
};

static wide correct_pose_of_loop(void *of, struct newton *w) {
    struct closing *c = of;
    struct loop *l = c->l;
    mask moves = w->open;
    if (w->halved) {
        c->part *= R(0.5);
        retry(l, moves, c->part, c->q);
    } else if (w->count) {
        long rank = l->sizes.rank;
        wide b[ROWS];
        if (WIDTH > 1)
            moves &= l->soundness > RANK_RADIUS;
        else if (c->follows && rank > 0 && !any(l->soundness > RANK_RADIUS))
            rank--;
        if (!any(moves))
            return all(REAL_INFINITY);
        c->step = all(0);
        mismatch(l, b);
        loop_solve(l, rank, b, l->step);
        for (long k = 0; k < l->sizes.solved; k++) {
            c->regular &= is_finite(l->step[k]);
            c->step = larger(c->step, magnitude(l->step[k]) / l->scale[l->solved[k]]);
            l->trial[k] = chosen(moves, c->q[l->solved[k]], l->trial[k]);
        }
        moves &= c->regular;
        if (!any(moves))
            return all(REAL_INFINITY);
        /* Beyond a radian the linear prediction of a step is not valid. */
        c->part = 1 / larger(all(1), c->step);
        retry(l, moves, c->part, c->q);
    }
    const wide defect = evaluate_screws(l, c->t, c->q);
    const mask least = (defect <= R(l->sizes.tolerance)) & (c->step <= STILL);
    return chosen(moves, chosen(least, all(0), defect), all(REAL_INFINITY));
}

/* Close the open lanes at t by Newton's method from q, in place; return the closed lanes. The factor of the solution is
   kept. A loop that `follows` keeps a variable as predicted that the pose leaves undetermined. Lanes with corrections
   that are not finite are removed from `regular`. */
static mask closed_by_newton(struct loop *l, mask open, wide t, wide *q, int follows, mask *regular) {
    wide fine = all(FINE);
    loop_prescribe(l, t, q);
    /* The resolution of an angle of many revolutions is its last digit. */
    for (long k = 0; k < l->sizes.n; k++)
        fine = larger(fine, 2 * REAL_EPSILON * magnitude(q[k]) / l->scale[k]);
    const wide coarse = larger(all(COARSE), 8 * fine);
    struct closing c = {l, t, q, all(1), all(REAL_INFINITY), follows, *regular};
    struct newton w = {.most = WIDTH == 1 ? CLOSINGS : LANE_CLOSINGS, .close = fine, .rounded = coarse, .grows = 1,
                       .tolerated = R(l->sizes.tolerance), .halvings = WIDTH == 1 ? HALVINGS : 0};
    mask done = newton_solve(&w, open, correct_pose_of_loop, &c);
    *regular = c.regular;
    if (any(w.worse)) {
        retry(l, w.worse, all(0), q);
        evaluate_screws(l, t, q);
    }
    return done | (w.open & (w.error <= coarse));
}

LOOPS wide loop_changes(struct loop *l, int which, const wide *drift, wide *b, wide *v) {
    const long n = l->sizes.n, rank = l->sizes.rank;
    wide size = all(0), left = size, x[MOST];
    for (int i = 0; i < ROWS; i++) {
        b[i] = all(0);
        if (drift)
            b[i] = -drift[i];
        size = larger(size, magnitude(b[i]) / (i < 3 ? 1 : l->size));
    }
    for (long k = 0; k < l->sizes.inputs; k++) {
        const long j = l->driven[k];
        const wide rate = l->prescribed[3 * k + which];
        v[j] = rate;
        size = larger(size, magnitude(rate) / l->scale[j]);
        for (int i = 0; i < ROWS; i++)
            b[i] -= l->screws[12 + n * i + j] * rate;
    }
    loop_solve(l, rank, b, x);
    for (long k = 0; k < l->sizes.solved; k++)
        v[l->solved[k]] = x[k];
    for (long k = rank; k < ROWS; k++)
        left = chosen(magnitude(b[k]) <= left, left, magnitude(b[k]));
    return chosen(size > 0, left / size, all(0));
}

LOOPS void loop_hold(const struct loop *l, const wide *efforts, wide *wrench) {
    wide c[MOST], s[ROWS];
    for (long k = 0; k < l->sizes.solved; k++)
        c[k] = efforts[k] * l->scale[l->solved[k]];
    qr_solve_transposed(&l->factor, l->sizes.rank, c, s);
    for (int k = 0; k < 3; k++) {
        wrench[k] = s[3 + k] / l->size;
        wrench[3 + k] = s[k];
    }
}

/* Write the closing wrench behind the accelerations in `work`; return the lanes with regular force transmission. */
static mask forced(struct loop *l, wide t, const wide *q, const wide *u, wide *work) {
    const long n = l->sizes.n, unknown = l->sizes.unknown, solved = l->sizes.solved;
    mask swaps[MOST];
    wide b[MOST], c[ROWS], x[MOST], needed[MOST];
    l->hold = all(1);
    if (l->kernels.inverse == NULL)
        return ~(mask){0};
    call(l->kernels.inverse, &t, q, u, l->p, work, l->loads);
    memset(l->efforts, 0, (size_t)n * sizeof(wide));
    if (l->kernels.given != NULL)
        call(l->kernels.given, &t, q, u, l->p, work, l->efforts);
    for (long k = 0; k < solved; k++)
        b[k] = l->efforts[l->solved[k]] - l->loads[l->solved[k]];
    loop_hold(l, b, work + n);
    if (unknown == 0)
        return ~(mask){0};
    /* gain[i, k]: rate of the variable of unknown effort k at unit rate of the input i of known effort. The unknown
     * efforts E balance the efforts that the inputs need beyond their known ones: gain E = needed. */
    for (long i = 0; i < unknown; i++) {
        const long j = l->driven[l->known[i]];
        for (int k = 0; k < ROWS; k++)
            c[k] = -l->screws[12 + n * k + j];
        loop_solve(l, l->sizes.rank, c, x);
        for (long k = 0; k < unknown; k++)
            l->gain[unknown * i + k] = x[l->found[k]];
        needed[i] = l->loads[j] + power(l, j, work + n) - l->efforts[j];
    }
    const mask good = factor_dense(unknown, l->gain, swaps);
    for (long k = 0; k < unknown; k++) {
        l->hold = chosen(swaps[k] != k, -l->hold, l->hold);
        l->hold *= l->gain[unknown * k + k] / l->scale[l->solved[l->found[k]]] * l->scale[l->driven[l->known[k]]];
    }
    l->hold = chosen(good, l->hold, all(0));
    const mask regular = magnitude(l->hold) > NO_DRIVE;
    if (!any(regular))
        return regular;
    solve_dense(unknown, l->gain, swaps, needed);
    for (long k = 0; k < unknown; k++)
        b[l->found[k]] += needed[k];
    loop_hold(l, b, work + n);
    return regular;
}
