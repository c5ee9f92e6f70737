/* Steps of driven linkages, of one linkage or of one in each lane of vectors: see kinematic_follow.h. */
#include "extrapolate.h"
#include "newton.h"

/* Largest difference of the solution from its prediction, over the predicted motion. */
#define ASTRAY R(0.1)
/* Longest step over the size of the linkage. */
#define LONGEST R(0.1)
/* Largest factor by which the determinant of a group changes in a step. */
#define CHANGE R(4)
/* Below this ratio of the least pivot to the greatest, following ends and the caller searches for singular poses. */
#define SOUND R(1e-6)
/* Shortest step over the whole time. */
#define SHORTEST R(1e-12)
/* Round-off of a residual over the coordinates. */
#define ACCEPT (256 * REAL_EPSILON)
enum { POSE_ITERATIONS = 12 };

/* Evaluate the constraints: Phi over its scale goes into k->phi, 1 / scale into k->weight. Return the largest. */
static wide constraint_errors(struct kinematics *k, wide t, const wide *q) {
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
    return (a[0] != 0) & (a[3] != 0) & is_finite(a[0]) & is_finite(a[3]);
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
static mask factorise_groups(struct kinematics *k) {
    const struct kinematic_groups *g = &k->groups;
    const ptrdiff_t *entry = g->entries;
    const wide *closure = k->closure, *weight = k->weight;
    wide *group = k->values;
    memset(group, 0, (size_t)g->squares * sizeof(wide));
    for (ptrdiff_t e = 0; e < g->filled; e++, entry += 4)
        group[entry[0]] = closure[entry[1]] * weight[entry[2]];
    memcpy(k->matrix, group, (size_t)g->squares * sizeof(wide));
    mask regular = ~(mask){0};
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], width = g->starts[c + 1] - start;
        regular &= width == 2 ? factor_pair(group, k->swaps + start, k->inverse + start)
                              : factor_dense(width, group, k->swaps + start);
        group += width * width;
    }
    return regular;
}

/* Write the pivots of a group, whose product is its determinant. */
static inline void pivots_of(ptrdiff_t width, const wide *group, const mask *swaps, wide *pivots) {
    for (ptrdiff_t i = 0; i < width; i++) {
        const wide pivot = group[i * width + i];
        pivots[i] = chosen(swaps[i] != i, -pivot, pivot);
    }
}

/* Write the pivots of all groups. */
static void read_pivots(const struct kinematics *k, wide *pivots) {
    const struct kinematic_groups *g = &k->groups;
    const wide *group = k->values;
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], width = g->starts[c + 1] - start;
        pivots_of(width, group, k->swaps + start, pivots + start);
        group += width * width;
    }
}

/* The least pivot over the greatest. */
static wide soundness(const wide *pivots, ptrdiff_t count) {
    wide least = all(REAL_INFINITY), greatest = all(0);
    for (ptrdiff_t i = 0; i < count; i++) {
        least = smaller(least, magnitude(pivots[i]));
        greatest = larger(greatest, magnitude(pivots[i]));
    }
    return least / greatest;
}

/* Lanes in which a determinant is at least and at most so many times another one. */
static inline mask within(wide value, wide other, real least, real most) {
    const wide product = value * other, square = other * other;
    return (product >= least * square) & (product <= most * square);
}

/* The determinant of a group over another one. */
static inline wide quotient(ptrdiff_t width, const wide *pivots, const wide *others) {
    wide value = all(1);
    for (ptrdiff_t i = 0; i < width; i++)
        value *= pivots[i] / others[i];
    return value;
}

/* The determinant of the mean of two matrices of a group over that of the first. */
static wide quotient_halfway(struct kinematics *k, ptrdiff_t width, const wide *a, const wide *b, const wide *pivots_of_a) {
    wide *mean = k->mean, *pivots = k->change;
    for (ptrdiff_t i = 0; i < width * width; i++)
        mean[i] = (a[i] + b[i]) / 2;
    factor_dense(width, mean, k->spare);
    pivots_of(width, mean, k->spare, pivots);
    return quotient(width, pivots, pivots_of_a);
}

/* Lanes in which the step stays on its assembly branch: the determinant of every group changes little from the start
   to the end, also halfway between both poses, and from the predicted pose to the end. Between two assemblies a group
   is singular halfway, since the constraints are quadratic in the coordinates. */
static mask same_branch(struct kinematics *k) {
    const struct kinematic_groups *g = &k->groups;
    const wide *b = k->matrix, *a = k->matrix_before, *predicted = k->predicted, *pivots = k->pivots;
    const wide *before = k->pivots_before;
    mask same = ~(mask){0};
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t width = g->starts[c + 1] - g->starts[c];
        wide start = all(1), end, middle, turned = all(1), guessed;
        if (width == 2) {
            start = before[0] * before[1], end = pivots[0] * pivots[1];
            middle = ((a[0] + b[0]) * (a[3] + b[3]) - (a[1] + b[1]) * (a[2] + b[2])) / 4;
            turned = end, guessed = predicted[0] * predicted[1];
        } else {
            end = quotient(width, pivots, before);
            middle = quotient_halfway(k, width, a, b, before);
            guessed = quotient(width, predicted, pivots);
        }
        same &= within(end, start, 1 / CHANGE, CHANGE);
        same &= within(middle, start, R(0.5), CHANGE) | within(middle, end, R(0.5), CHANGE);
        same &= within(guessed, turned, R(0.5), R(2)) | (guessed != guessed); /* without an iteration */
        a += width * width, b += width * width, before += width, pivots += width, predicted += width;
    }
    return same;
}

/* Solve dPhi/dq x = rows over their scales; rows are results of a kernel for all constraints. */
static void solve(struct kinematics *k, const wide *rows, wide *x) {
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
static void solve_transposed(struct kinematics *k, const wide *forces, wide *lambda) {
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

/* A pose to be closed at t. */
struct open_pose {
    struct kinematics *k;
    wide t, *q;
};

static wide correct_pose(void *of, struct newton *w) {
    const struct open_pose *pose = of;
    struct kinematics *k = pose->k;
    const ptrdiff_t n = k->sizes.n;
    wide *change = k->out;
    mask moves = w->open;
    if (w->count) {
        moves &= factorise_groups(k);
        if (w->count == 1)
            read_pivots(k, k->predicted);
        if (any(moves)) /* without factors there is no solution */
            solve(k, k->closure, change);
        for (ptrdiff_t j = 0; j < n; j++)
            pose->q[j] = chosen(moves, pose->q[j] - change[j], pose->q[j]);
    }
    const wide worst = constraint_errors(k, pose->t, pose->q);
    w->size = larger(k->length, largest_in(pose->q, n));
    return chosen(moves, worst, all(REAL_INFINITY));
}

/* Close the open lanes at t by Newton's method from q, in place; return the converged lanes. The last evaluation of
   constraints is at q. */
static mask closed(struct kinematics *k, mask open, wide t, wide *q) {
    struct open_pose pose = {k, t, q};
    struct newton w = {
        .most = POSE_ITERATIONS, .close = all(4 * REAL_EPSILON), .rounded = all(ACCEPT), .grows = R(0.5),
    };
    return newton_solve(&w, open, correct_pose, &pose);
}

/* Write velocities and accelerations of the pose closed last; return the lanes in which it is not near a singular
   pose. */
static mask solve_rates(struct kinematics *k, const wide *t, const wide *q, wide *u, wide *a) {
    const ptrdiff_t n = k->sizes.n, m = k->sizes.m;
    const mask good = factorise_groups(k);
    read_pivots(k, k->pivots);
    if (!any(good))
        return good;
    solve(k, k->closure + 2 * m, u);
    for (ptrdiff_t j = 0; j < n; j++)
        u[j] = -u[j];
    call(k->kernels.gamma, t, q, u, k->p, k->work, k->out);
    solve(k, k->out, a);
    return good & (soundness(k->pivots, n) > SOUND) & is_finite(largest_in(u, n)) & is_finite(largest_in(a, n));
}

/* Keep the pose next to the last one as the start of the next step. */
static void take_matrices(struct kinematics *k, mask which) {
    const ptrdiff_t n = k->sizes.n, squares = k->groups.squares;
    if (any(~which)) {
        copy_where(which, k->pivots, n, k->pivots_before);
        copy_where(which, k->matrix, squares, k->matrix_before);
        return;
    }
    wide *pivots = k->pivots_before, *matrix = k->matrix_before;
    k->pivots_before = k->pivots, k->pivots = pivots;
    k->matrix_before = k->matrix, k->matrix = matrix;
}

/* Begin at a pose at k->t; return the lanes in which it is closed and regular. */
static mask begin_pose(struct kinematics *k, mask which) {
    const ptrdiff_t n = k->sizes.n;
    const mask found = closed(k, which, k->t, k->q);
    const mask regular = solve_rates(k, &k->t, k->q, k->q + n, k->q + 2 * n);
    take_matrices(k, ~(mask){0});
    return found & regular;
}

/* Move to `next` in one step in the lanes `which`; return those with an accurate prediction on the same assembly
   branch. Lanes near a singular pose are removed from `alive`. */
static mask attempt(struct kinematics *k, mask which, wide next, mask *alive) {
    const ptrdiff_t n = k->sizes.n;
    const wide h = next - k->t, g = k->stride, s = h / g, *q = k->q, *u = q + n, *a = u + n;
    const wide *q0 = k->past, *u0 = q0 + n, *a0 = u0 + n;
    wide *change = k->change, *predicted = k->next;
    const mask near = near_stride(h, g);
    for (ptrdiff_t j = 0; j < n; j++) {
        change[j] = extrapolated(near, h, s, g, q[j], u[j], a[j], q0[j], u0[j], a0[j]);
        predicted[j] = q[j] + change[j];
        k->predicted[j] = all(REAL_INFINITY) - all(REAL_INFINITY);
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
    const mask sound = solve_rates(k, &next, k->next, k->next + n, k->next + 2 * n);
    which &= same_branch(k);
    *alive &= ~which | sound;
    if (!any(which))
        return which;
    take_matrices(k, which);
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
