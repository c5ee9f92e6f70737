/* Steps of a driven loop along its assembly branch, or of one in each lane of vectors: see loop_steps.h. */
#include "extrapolate.h"
#include "loop.h"
#include "loop_limits.h"

/* Set the variables of the next state to those predicted after a step h, by the state before too, and the changes of the
   solved ones to l->change. Return the largest change, in radians or sizes of the loop. */
static wide predicted_change(struct loop *l, wide h) {
    const long n = l->sizes.n;
    const wide g = l->stride, s = h / g, *q = l->now, *u = q + n, *a = u + n, *q0 = l->past, *u0 = q0 + n, *a0 = u0 + n;
    const mask near = near_stride(h, g);
    wide largest = all(0);
    memcpy(l->next, q, (size_t)n * sizeof(wide));
    for (long k = 0; k < l->sizes.solved; k++) {
        const long j = l->solved[k];
        l->change[k] = extrapolated(near, h, s, g, q[j], u[j], a[j], q0[j], u0[j], a0[j]);
        l->next[j] += l->change[k];
        largest = larger(largest, magnitude(l->change[k]) / l->scale[j]);
    }
    return largest;
}

/* Lanes in which the closed variables of the next state are near their prediction and the inputs did not reverse within the
   step, which the rates at both ends do not show. */
static mask as_predicted(const struct loop *l, wide h, wide largest) {
    const long n = l->sizes.n;
    const wide *q = l->now, *u = q + n, *a = u + n;
    mask near = ~(mask){0};
    wide astray = all(0);
    for (long k = 0; k < l->sizes.solved; k++) {
        const long j = l->solved[k];
        astray = larger(astray, magnitude(l->next[j] - q[j] - l->change[k]) / l->scale[j]);
    }
    for (long k = 0; k < l->sizes.inputs; k++) {
        const long j = l->driven[k];
        const wide apart = l->next[j] - q[j] - parabola(h, u[j], a[j]);
        const mask reversed = magnitude(apart) / l->scale[j] > LOOP_LONGEST;
        near &= ~reversed;
    }
    const mask far = astray > LOOP_ASTRAY * largest + R(1e-9);
    return near & ~far;
}

/* Lanes in which the pose evaluated last is on the assembly branch of the last followed state: the screws of a branch
   have determinants of one sign. For fewer than six screws A and B this is the sign of that of A^T B; for six the
   factors have it. A determinant of zero has no sign. */
static mask same_branch_of(const struct loop *l) {
    const long rank = l->sizes.solved;
    wide product[ROWS * ROWS];
    mask swaps[ROWS], opposite = {0};
    if (rank > ROWS || rank != l->sizes.rank)
        return ~opposite;
    if (rank == ROWS)
        return l->factor.sign * l->side > 0;
    for (long i = 0; i < rank; i++)
        for (long j = 0; j < rank; j++)
            product[rank * i + j] = qr_dot(l->followed + ROWS * i, l->columns + ROWS * j);
    const mask regular = factor_dense(rank, product, swaps);
    if (!any(regular)) /* some swaps are unset */
        return regular;
    for (long i = 0; i < rank; i++)
        opposite ^= (product[(rank + 1) * i] < 0) ^ (swaps[i] != i);
    return regular & ~opposite;
}

/* Keep the screws evaluated last as those of the last followed state. */
static void keep_columns(struct loop *l, mask which) {
    copy_where(which, l->columns, ROWS * l->sizes.solved, l->followed);
    l->side = chosen(which, l->factor.sign, l->side);
}

/* Make the next state, after a step h, that of now in some lanes. */
static void take_next(struct loop *l, mask which, wide h) {
    const long n = l->sizes.n;
    keep_columns(l, which);
    copy_where(which, l->now, 3 * n, l->past);
    copy_where(which, l->next, 3 * n, l->now);
    l->stride = chosen(which, h, l->stride);
}
