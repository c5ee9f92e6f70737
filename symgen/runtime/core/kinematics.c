#include "kinematics.h"

#include "arena.h"
#include "extrapolate.h"
#include "kinematic_lanes.h"
#include "kinematic_limits.h"
#include "lanes.h"
#include "linear.h"

static size_t place(struct kinematics *k, const struct kinematic_sizes *s, const struct kinematic_groups *g, void *memory) {
    const struct arena_array arrays[] = {
        ARENA_ARRAY(k->q, s->n + 1),
        ARENA_ARRAY(k->u, s->n + 1),
        ARENA_ARRAY(k->a, s->n + 1),
        ARENA_ARRAY(k->past, 3 * s->n + 1),
        ARENA_ARRAY(k->next, s->n + 1),
        ARENA_ARRAY(k->change, s->n + 1),
        ARENA_ARRAY(k->still, s->n + 1),
        ARENA_ARRAY(k->phi, s->m + 1),
        ARENA_ARRAY(k->weight, s->m + 1),
        ARENA_ARRAY(k->solved, s->n + 1),
        ARENA_ARRAY(k->work, s->work + 1),
        ARENA_ARRAY(k->closure, s->out + 1),
        ARENA_ARRAY(k->out, s->out + 1),
        ARENA_ARRAY(k->values, g->squares + g->couplings + 1),
        ARENA_ARRAY(k->inverse, s->n + 1),
        ARENA_ARRAY(k->swaps, s->n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

size_t kinematics_bytes(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups) {
    struct kinematics counted;
    return place(&counted, sizes, groups, NULL);
}

void kinematics_bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                     const struct kinematic_groups *groups, const real *p, const real *balance_p, void *memory) {
    place(k, sizes, groups, memory);
    k->sizes = *sizes;
    k->kernels = *kernels;
    k->groups = *groups;
    k->p = p;
    k->balance_p = balance_p;
}

static void zero(ptrdiff_t count, real *values) {
    for (ptrdiff_t i = 0; i < count; i++)
        values[i] = 0;
}

/* Evaluate the constraints: Phi over its scale goes into k->phi, 1 / scale into k->weight. Return the largest. */
static real missed(struct kinematics *k, real t, const real *q) {
    const ptrdiff_t m = k->sizes.m;
    k->kernels.closure(&t, q, k->still, k->p, k->work, k->closure);
    for (ptrdiff_t i = 0; i < m; i++) {
        k->weight[i] = 1 / k->closure[m + i];
        k->phi[i] = k->closure[i] * k->weight[i];
    }
    return largest_or_nan(k->phi, m);
}

/* LU factorisation with partial pivoting of a group of two unknowns: a dyad or a crank, the most frequent groups. */
static int factor_pair(real *a, ptrdiff_t *swaps, real *inverse) {
    const int exchanged = real_fabs(a[2]) > real_fabs(a[0]);
    const real a00 = a[2 * exchanged], a01 = a[2 * exchanged + 1];
    inverse[0] = 1 / a00;
    const real factor = a[2 - 2 * exchanged] * inverse[0], pivot = a[3 - 2 * exchanged] - factor * a01;
    inverse[1] = 1 / pivot;
    swaps[0] = exchanged, swaps[1] = 1;
    a[0] = a00, a[1] = a01, a[2] = factor, a[3] = pivot;
    return a00 != 0 && pivot != 0 && real_isfinite(a00) && real_isfinite(pivot);
}

static void solve_pair(const real *a, const ptrdiff_t *swaps, const real *inverse, real *b) {
    const real first = b[swaps[0]];
    b[1] = (b[1 - swaps[0]] - a[2] * first) * inverse[1];
    b[0] = (first - a[1] * b[1]) * inverse[0];
}

static void solve_pair_transposed(const real *a, const ptrdiff_t *swaps, const real *inverse, real *b) {
    const real first = b[0] * inverse[0], second = (b[1] - a[1] * first) * inverse[1];
    b[swaps[0]] = first - a[2] * second;
    b[1 - swaps[0]] = second;
}

/* Factorise dPhi/dq, its independent rows over their scales, at the last evaluation of the constraints; return 0 if
   it is singular. */
static int factorise_groups(struct kinematics *k) {
    const struct kinematic_groups *g = &k->groups;
    const ptrdiff_t *entry = g->entries;
    zero(g->squares, k->values);
    for (ptrdiff_t e = 0; e < g->filled; e++, entry += 4)
        k->values[entry[0]] = k->closure[entry[1]] * k->weight[entry[2]];
    real *group = k->values;
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], width = g->starts[c + 1] - start;
        if (!(width == 2 ? factor_pair(group, k->swaps + start, k->inverse + start)
                         : factor_dense(width, group, k->swaps + start)))
            return 0;
        group += width * width;
    }
    return 1;
}

/* Sign of the determinant, and the least pivot over the greatest. */
static int judge(struct kinematics *k, real *soundness) {
    const struct kinematic_groups *g = &k->groups;
    const real *group = k->values;
    real least = REAL_INFINITY, greatest = 0;
    int sign = 1;
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], width = g->starts[c + 1] - start;
        for (ptrdiff_t i = 0; i < width; i++) {
            const real pivot = group[i * width + i];
            least = real_fmin(least, real_fabs(pivot));
            greatest = real_fmax(greatest, real_fabs(pivot));
            if ((pivot < 0) != (k->swaps[start + i] != i))
                sign = -sign;
        }
        group += width * width;
    }
    *soundness = k->sizes.n ? least / greatest : R(1);
    return sign;
}

#define NUMBER real
#define LINKAGE struct kinematics
#include "groups.h"

/* The largest error of J^T lambda = forces, which is overwritten. */
static real unbalanced(const struct kinematics *k, const real *lambda, real *forces) {
    const ptrdiff_t *entry = k->groups.entries;
    for (ptrdiff_t e = 0; e < k->groups.filled; e++, entry += 4)
        forces[entry[3]] -= k->closure[entry[1]] * lambda[entry[2]];
    return largest_or_nan(forces, k->sizes.n);
}

/* Close the linkage at t by Newton's method from q, in place. The last evaluation of constraints is at q. */
static int closed(struct kinematics *k, real t, real *q) {
    const ptrdiff_t n = k->sizes.n;
    real before = REAL_INFINITY;
    for (int tries = 0; tries < NEWTON; tries++) {
        const real worst = missed(k, t, q), size = real_fmax(R(k->sizes.length), largest_or_nan(q, n));
        if (worst <= 4 * REAL_EPSILON * size || (worst <= ACCEPT * size && worst > before / 4))
            return 1;
        if (!(worst < before / 2) || !factorise_groups(k))
            return 0;
        before = worst;
        solve(k, k->closure, k->out);
        for (ptrdiff_t j = 0; j < n; j++)
            q[j] -= k->out[j];
    }
    return 0;
}

/* Write velocities and accelerations of the pose closed last; return 0 if it is near a singular pose or behind one.
   */
static int moved(struct kinematics *k, real t, const real *q, real *u, real *a) {
    const ptrdiff_t n = k->sizes.n, m = k->sizes.m;
    real soundness;
    if (!factorise_groups(k))
        return 0;
    const int sign = judge(k, &soundness);
    if (!(soundness > SOUND) || (k->sign != 0 && sign != k->sign))
        return 0;
    solve(k, k->closure + 2 * m, u);
    for (ptrdiff_t j = 0; j < n; j++)
        u[j] = -u[j];
    k->kernels.gamma(&t, q, u, k->p, k->work, k->out);
    solve(k, k->out, a);
    k->sign = sign;
    return real_isfinite(largest_or_nan(u, n)) && real_isfinite(largest_or_nan(a, n));
}

/* Move to `next` in one step; return 0 if the solution differs too much from the prediction. */
static int attempt(struct kinematics *k, real next) {
    const ptrdiff_t n = k->sizes.n;
    const real h = next - k->t, length = R(k->sizes.length), *past = k->past;
    for (ptrdiff_t j = 0; j < n; j++) {
        k->change[j] = extrapolated(h, k->stride, k->q[j], k->u[j], k->a[j], past[j], past[n + j], past[2 * n + j]);
        k->next[j] = k->q[j] + k->change[j];
    }
    const real way = largest_or_nan(k->change, n);
    if (!(way <= LONGEST * length) || !closed(k, next, k->next))
        return 0;
    for (ptrdiff_t j = 0; j < n; j++)
        k->change[j] -= k->next[j] - k->q[j];
    if (!(largest_or_nan(k->change, n) <= ASTRAY * way + R(1e-9) * length))
        return 0;
    copy(k->q, n, k->past);
    copy(k->u, n, k->past + n);
    copy(k->a, n, k->past + 2 * n);
    copy(k->next, n, k->q);
    k->stride = h;
    k->t = next;
    return moved(k, next, k->q, k->u, k->a);
}

/* Reach the target in as many steps as accurate predictions need. */
static int go(struct kinematics *k, real target) {
    real h = target - k->t;
    const real shortest = real_fabs(h) / (1 << HALVINGS);
    while (k->t != target) {
        const real next = real_fabs(target - k->t - h) < R(1e-9) * real_fabs(h) ? target : k->t + h;
        const real from = k->t;
        if (next == from)
            return 0;
        if (attempt(k, next)) {
            h = real_fabs(2 * h) < real_fabs(target - next) ? 2 * h : target - next;
            continue;
        }
        h /= 2;
        if (k->t != from || real_fabs(h) < shortest)
            return 0; /* near a singular pose, or no step has an accurate prediction */
    }
    return 1;
}

ptrdiff_t kinematics_follow(struct kinematics *k, real t, const real *q, const real *times, ptrdiff_t count, real *rows) {
    const ptrdiff_t n = k->sizes.n;
    copy(q, n, k->q);
    k->t = t;
    k->stride = 0;
    k->sign = 0;
    if (!closed(k, t, k->q) || !moved(k, t, k->q, k->u, k->a))
        return 0;
    for (ptrdiff_t i = 0; i < count; i++, rows += 3 * n) {
        if (!go(k, times[i]))
            return i;
        copy(k->q, n, rows);
        copy(k->u, n, rows + n);
        copy(k->a, n, rows + 2 * n);
    }
    return count;
}

ptrdiff_t kinematics_multipliers(struct kinematics *k, const real *times, const real *rows, ptrdiff_t count,
                                 real *multipliers, real *quality) {
    const ptrdiff_t n = k->sizes.n, m = k->sizes.m;
    for (ptrdiff_t i = 0; i < count; i++, rows += 3 * n, multipliers += m, quality += 2) {
        missed(k, times[i], rows);
        if (!factorise_groups(k))
            return i;
        judge(k, quality);
        if (!(quality[0] > SOUND))
            return i;
        copy(rows + 2 * n, n, k->work);
        k->kernels.balance(times + i, rows, rows + n, k->balance_p, k->work, k->out);
        solve_transposed(k, k->out, multipliers);
        quality[1] = unbalanced(k, multipliers, k->out);
    }
    return count;
}

static void bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const struct kinematic_groups *groups, const void *p, const void *balance_p, void *memory) {
    kinematics_bind(k, sizes, kernels, groups, p, balance_p, memory);
}

static ptrdiff_t follow(struct kinematics *k, double t, const void *q, const void *times, ptrdiff_t count, void *rows) {
    return kinematics_follow(k, R(t), q, times, count, rows);
}

static ptrdiff_t multipliers(struct kinematics *k, const void *times, const void *rows, ptrdiff_t count, void *into,
                             void *quality) {
    return kinematics_multipliers(k, times, rows, count, into, quality);
}

const struct kinematics_api symgen_kinematics = {
    .kinematics_struct = sizeof(struct kinematics),
    .bytes = kinematics_bytes,
    .bind = bind,
    .follow = follow,
    .multipliers = multipliers,
    .lanes = kinematic_lanes_of,
};
