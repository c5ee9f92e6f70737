#include "kinematics.h"

#include <string.h>

#include "arena.h"
#include "lanes.h"
#include "linear.h"
#include "single.h"

static size_t place(struct kinematics *k, const struct kinematic_sizes *s, const struct kinematic_groups *g, void *memory) {
    const struct arena_array arrays[] = {
        ARENA_ARRAY(k->q, 3 * s->n + 1),
        ARENA_ARRAY(k->past, 3 * s->n + 1),
        ARENA_ARRAY(k->next, 3 * s->n + 1),
        ARENA_ARRAY(k->change, s->n + 1),
        ARENA_ARRAY(k->still, s->n + 1),
        ARENA_ARRAY(k->phi, s->m + 1),
        ARENA_ARRAY(k->scale, s->m + 1),
        ARENA_ARRAY(k->weight, s->m + 1),
        ARENA_ARRAY(k->solved, s->n + 1),
        ARENA_ARRAY(k->work, s->work + 1),
        ARENA_ARRAY(k->closure, s->out + 1),
        ARENA_ARRAY(k->out, s->out + 1),
        ARENA_ARRAY(k->values, g->squares + g->couplings + 1),
        ARENA_ARRAY(k->inverse, s->n + 1),
        ARENA_ARRAY(k->matrix, g->squares + 1),
        ARENA_ARRAY(k->matrix_before, g->squares + 1),
        ARENA_ARRAY(k->mean, g->squares + 1),
        ARENA_ARRAY(k->pivots, s->n + 1),
        ARENA_ARRAY(k->pivots_before, s->n + 1),
        ARENA_ARRAY(k->predicted, s->n + 1),
        ARENA_ARRAY(k->swaps, s->n + 1),
        ARENA_ARRAY(k->spare, s->n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups) {
    struct kinematics counted;
    return place(&counted, sizes, groups, NULL);
}

static void bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const struct kinematic_groups *groups, const void *p, const void *balance_p, void *memory) {
    place(k, sizes, groups, memory);
    k->sizes = *sizes;
    k->kernels = *kernels;
    k->groups = *groups;
    k->p = p;
    k->balance_p = balance_p;
    k->length = R(sizes->length);
    for (ptrdiff_t i = 0; i < sizes->m; i++)
        k->scale[i] = REAL_INFINITY - REAL_INFINITY;
}

#define LINKAGE struct kinematics
#include "kinematic_steps.h"

/* The largest error of J^T lambda = forces, which is overwritten. */
static real unbalanced(const struct kinematics *k, const real *lambda, real *forces) {
    const ptrdiff_t *entry = k->groups.entries;
    for (ptrdiff_t e = 0; e < k->groups.filled; e++, entry += 4)
        forces[entry[3]] -= k->closure[entry[1]] * lambda[entry[2]];
    return largest_or_nan(forces, k->sizes.n);
}

/* Reach the target in as many steps as accurate predictions need. */
static int go(struct kinematics *k, real target, real shortest) {
    real h = target - k->t;
    while (k->t != target) {
        const real next = real_fabs(target - k->t - h) < R(1e-9) * real_fabs(h) ? target : k->t + h;
        const real from = k->t;
        mask alive = 1;
        if (next == from)
            return 0;
        if (any(attempt(k, 1, next, &alive))) {
            if (!any(alive))
                return 0; /* near a singular pose, or behind one */
            h = real_fabs(2 * h) < real_fabs(target - next) ? 2 * h : target - next;
            continue;
        }
        h /= 2;
        if (real_fabs(h) < shortest)
            return 0; /* no step has an accurate prediction */
    }
    return 1;
}

static ptrdiff_t follow(struct kinematics *k, double t, const void *q, const void *times, ptrdiff_t count, void *to) {
    const ptrdiff_t n = k->sizes.n;
    real *rows = to;
    copy(q, n, k->q);
    k->t = R(t);
    k->stride = 0;
    if (!any(begun(k, 1)))
        return 0;
    const real shortest = SHORTEST * real_fabs(((const real *)times)[count - 1] - k->t);
    for (ptrdiff_t i = 0; i < count; i++, rows += 3 * n) {
        if (is_interrupted(i) || !go(k, ((const real *)times)[i], shortest))
            return i;
        copy(k->q, 3 * n, rows);
    }
    return count;
}

static ptrdiff_t multipliers(struct kinematics *k, const void *times, const void *poses, ptrdiff_t count, void *to,
                             void *quality_of) {
    const ptrdiff_t n = k->sizes.n, m = k->sizes.m;
    const real *t = times, *rows = poses;
    real *lambda = to, *quality = quality_of;
    for (ptrdiff_t i = 0; i < count && !is_interrupted(i); i++, rows += 3 * n, lambda += m, quality += 2) {
        missed(k, t[i], rows);
        if (!any(factorise_groups(k)))
            return i;
        read_pivots(k, k->pivots);
        quality[0] = n ? soundness(k->pivots, n) : 1;
        if (!(quality[0] > SOUND))
            return i;
        copy(rows + 2 * n, n, k->work);
        k->kernels.balance(t + i, rows, rows + n, k->balance_p, k->work, k->out);
        solve_transposed(k, k->out, lambda);
        quality[1] = unbalanced(k, lambda, k->out);
    }
    return count;
}

const struct kinematics_api symgen_kinematics = {
    .kinematics_struct = sizeof(struct kinematics),
    .bytes = bytes,
    .bind = bind,
    .follow = follow,
    .multipliers = multipliers,
};
