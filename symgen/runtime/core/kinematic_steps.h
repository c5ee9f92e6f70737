/* Steps of driven linkages, of one linkage or of one in each lane of vectors. The including file defines LINKAGE, the
 * numbers `wide` and the flags `mask` with their functions as in vectors.h, and dense solutions as in linear.h. */
#include "extrapolate.h"
#include "kinematic_limits.h"

/* Evaluate the constraints: Phi over its scale goes into k->phi, 1 / scale into k->weight. Return the largest. */
static wide missed(LINKAGE *k, wide t, const wide *q) {
    const ptrdiff_t m = k->sizes.m;
    wide *values = k->closure, *scale = k->scale, *weight = k->weight, *phi = k->phi;
    call(k->kernels.closure, &t, q, k->still, k->p, k->work, values);
    for (ptrdiff_t i = 0; i < m; i++) {
        if (any(values[m + i] != scale[i])) { /* most scales are lengths of links */
            scale[i] = values[m + i];
            weight[i] = 1 / scale[i];
        }
        phi[i] = values[i] * weight[i];
    }
    return largest_in(phi, m);
}

/* LU factorisation with partial pivoting of a group of two unknowns: a dyad or a crank, the most frequent groups. */
static inline mask factor_pair(wide *a, mask *swaps, wide *inverse) {
    const mask exchanged = magnitude(a[2]) > magnitude(a[0]);
    exchange(exchanged, a, a + 2, 2);
    inverse[0] = 1 / a[0];
    a[2] *= inverse[0];
    a[3] -= a[2] * a[1];
    inverse[1] = 1 / a[3];
    swaps[0] = exchanged & 1, swaps[1] = (mask){0} + 1;
    return (a[0] != 0) & (a[3] != 0) & finite(a[0]) & finite(a[3]);
}

static inline void solve_pair(const wide *a, const mask *swaps, const wide *inverse, wide *b) {
    exchange(swaps[0] != 0, b, b + 1, 1);
    b[1] = (b[1] - a[2] * b[0]) * inverse[1];
    b[0] = (b[0] - a[1] * b[1]) * inverse[0];
}

static inline void solve_pair_transposed(const wide *a, const mask *swaps, const wide *inverse, wide *b) {
    b[0] *= inverse[0];
    b[1] = (b[1] - a[1] * b[0]) * inverse[1];
    b[0] -= a[2] * b[1];
    exchange(swaps[0] != 0, b, b + 1, 1);
}

/* Factorise dPhi/dq where the constraints were evaluated last; returns where it is regular. */
static mask factorise_groups(LINKAGE *k) {
    const struct kinematic_groups *g = &k->groups;
    const ptrdiff_t *entry = g->entries;
    const wide *closure = k->closure, *weight = k->weight;
    wide *group = k->values;
    memset(group, 0, (size_t)g->squares * sizeof(wide));
    for (ptrdiff_t e = 0; e < g->filled; e++, entry += 4)
        group[entry[0]] = closure[entry[1]] * weight[entry[2]];
    mask regular = ~(mask){0};
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], width = g->starts[c + 1] - start;
        regular &= width == 2 ? factor_pair(group, k->swaps + start, k->inverse + start)
                              : factor_dense(width, group, k->swaps + start);
        group += width * width;
    }
    return regular;
}

/* Lanes with a negative determinant; the least pivot over the greatest. */
static mask judge(const LINKAGE *k, wide *soundness) {
    const struct kinematic_groups *g = &k->groups;
    const wide *group = k->values;
    wide least = all(REAL_INFINITY), greatest = all(0);
    mask negative = {0};
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], width = g->starts[c + 1] - start;
        for (ptrdiff_t i = 0; i < width; i++) {
            const wide pivot = group[i * width + i];
            least = smaller(least, magnitude(pivot));
            greatest = larger(greatest, magnitude(pivot));
            negative ^= (pivot < 0) ^ (k->swaps[start + i] != i);
        }
        group += width * width;
    }
    *soundness = least / greatest;
    return negative;
}

/* Solve dPhi/dq x = rows over their scales; rows are results of a kernel for all constraints. */
static void solve(LINKAGE *k, const wide *rows, wide *x) {
    const struct kinematic_groups *g = &k->groups;
    const wide *group = k->values, *coupling = k->values + g->squares, *weight = k->weight;
    wide *solved = k->solved;
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], end = g->starts[c + 1], width = end - start;
        for (ptrdiff_t i = start; i < end; i++) {
            wide value = rows[g->rows[i]] * weight[g->rows[i]];
            for (ptrdiff_t e = g->coupling_starts[i]; e < g->coupling_starts[i + 1]; e++)
                value -= coupling[e] * solved[g->coupling_columns[e]];
            solved[i] = value;
        }
        if (width == 2)
            solve_pair(group, k->swaps + start, k->inverse + start, solved + start);
        else
            solve_dense(width, group, k->swaps + start, solved + start);
        group += width * width;
        for (ptrdiff_t i = start; i < end; i++)
            x[g->columns[i]] = solved[i];
    }
}

/* Solve J^T lambda = forces; lambda of the constraints that are not among the rows is zero. */
static void solve_transposed(LINKAGE *k, const wide *forces, wide *lambda) {
    const struct kinematic_groups *g = &k->groups;
    const wide *group = k->values + g->squares, *coupling = group;
    wide *solved = k->solved;
    for (ptrdiff_t j = 0; j < k->sizes.n; j++)
        solved[j] = forces[g->columns[j]];
    for (ptrdiff_t i = 0; i < k->sizes.m; i++)
        lambda[i] = (wide){0};
    for (ptrdiff_t c = g->count - 1; c >= 0; c--) {
        const ptrdiff_t start = g->starts[c], end = g->starts[c + 1], width = end - start;
        group -= width * width;
        if (width == 2)
            solve_pair_transposed(group, k->swaps + start, k->inverse + start, solved + start);
        else
            solve_dense_transposed(width, group, k->swaps + start, solved + start);
        for (ptrdiff_t i = start; i < end; i++) {
            for (ptrdiff_t e = g->coupling_starts[i]; e < g->coupling_starts[i + 1]; e++)
                solved[g->coupling_columns[e]] -= coupling[e] * solved[i];
            lambda[g->rows[i]] = solved[i] * k->weight[g->rows[i]];
        }
    }
}

/* Close the open lanes at t by Newton's method from q, in place; return the converged lanes. The last evaluation of
   constraints is at q. */
static mask closed(LINKAGE *k, mask open, wide t, wide *q) {
    const ptrdiff_t n = k->sizes.n;
    wide before = all(REAL_INFINITY), *change = k->out;
    mask found = {0};
    for (int tries = 0; tries < NEWTON; tries++) {
        const wide worst = missed(k, t, q), size = larger(k->length, largest_in(q, n));
        const mask done = (worst <= 4 * REAL_EPSILON * size) | ((worst <= ACCEPT * size) & (worst > before / 4));
        found |= open & done;
        open &= ~done & (worst < before / 2);
        if (!any(open))
            break;
        open &= factorise_groups(k);
        if (!any(open)) /* without factors there is no solution */
            break;
        before = worst;
        solve(k, k->closure, change);
        for (ptrdiff_t j = 0; j < n; j++)
            q[j] = chosen(open, q[j] - change[j], q[j]);
    }
    return found;
}

/* Write velocities and accelerations of the pose closed last; return the lanes in which it is neither near a singular
   pose nor behind one. */
static mask moved(LINKAGE *k, const wide *t, const wide *q, wide *u, wide *a, mask *sign) {
    const ptrdiff_t n = k->sizes.n, m = k->sizes.m;
    wide soundness;
    mask good = factorise_groups(k);
    *sign = (mask){0};
    if (!any(good))
        return good;
    *sign = judge(k, &soundness);
    solve(k, k->closure + 2 * m, u);
    for (ptrdiff_t j = 0; j < n; j++)
        u[j] = -u[j];
    call(k->kernels.gamma, t, q, u, k->p, k->work, k->out);
    solve(k, k->out, a);
    return good & (soundness > SOUND) & finite(largest_in(u, n)) & finite(largest_in(a, n));
}

EXTRAPOLATION(wide, wide_parabola, wide_quintic)

/* Move to `next` in one step in the lanes `which`; return those with an accurate prediction. Lanes near a singular
   pose are removed from `alive`. */
static mask attempt(LINKAGE *k, mask which, wide next, mask *alive) {
    const ptrdiff_t n = k->sizes.n;
    const wide h = next - k->t, g = k->stride, s = h / g, *q = k->q, *u = q + n, *a = u + n;
    const wide *q0 = k->past, *u0 = q0 + n, *a0 = u0 + n;
    wide *change = k->change, *predicted = k->next;
    const mask near = (g * h > 0) & (magnitude(h) <= STRIDES * magnitude(g));
    for (ptrdiff_t j = 0; j < n; j++) {
        const wide along = wide_parabola(h, u[j], a[j]);
        change[j] = chosen(near, along + wide_quintic(s, g, q[j], u[j], a[j], q0[j], u0[j], a0[j]), along);
        predicted[j] = q[j] + change[j];
    }
    const wide way = largest_in(change, n);
    which &= way <= LONGEST * k->length;
    if (any(which))
        which = closed(k, which, next, predicted);
    if (!any(which))
        return which;
    for (ptrdiff_t j = 0; j < n; j++)
        change[j] -= predicted[j] - q[j];
    which &= largest_in(change, n) <= ASTRAY * way + R(1e-9) * k->length;
    if (!any(which))
        return which;
    mask sign;
    const mask sound = moved(k, &next, k->next, k->next + n, k->next + 2 * n, &sign) & ~(sign ^ k->sign);
    *alive &= ~which | sound;
    if (any(~which)) {
        copy_where(which, k->q, 3 * n, k->past);
        copy_where(which, k->next, 3 * n, k->q);
    } else {
        wide *oldest = k->past;
        k->past = k->q, k->q = k->next, k->next = oldest;
    }
    k->stride = chosen(which, h, k->stride);
    k->t = chosen(which, next, k->t);
    return which;
}
