/* Steps of a driven loop along its assembly branch, or of one in each lane of vectors: see loop_steps.h. */
#include "extrapolate.h"
#include "loop.h"
#include "loop_limits.h"

/* A followed state of a loop: positions, rates and accelerations. */
struct loop_state {
    const wide *q, *u, *a;
};

/* Set the variables `new` to those predicted after a step h from a state, by that of a stride g before too, and the
   changes of the solved ones to l->change. Return the largest change, in radians or sizes of the loop. */
static wide predicted_change(struct loop *l, wide h, wide g, struct loop_state now, struct loop_state past, wide *new) {
    const wide s = h / g;
    const mask near = near_stride(h, g);
    wide largest = all(0);
    memcpy(new, now.q, (size_t)l->sizes.n * sizeof(wide));
    for (long k = 0; k < l->sizes.solved; k++) {
        const long j = l->solved[k];
        l->change[k] = extrapolated(near, h, s, g, now.q[j], now.u[j], now.a[j], past.q[j], past.u[j], past.a[j]);
        new[j] += l->change[k];
        largest = larger(largest, magnitude(l->change[k]) / l->scale[j]);
    }
    return largest;
}

/* Lanes in which the closed variables `new` are near their prediction and the inputs did not reverse within the step,
   which the rates at both ends do not show. */
static mask as_predicted(const struct loop *l, wide h, wide largest, struct loop_state now, const wide *new) {
    mask near = ~(mask){0};
    wide astray = all(0);
    for (long k = 0; k < l->sizes.solved; k++) {
        const long j = l->solved[k];
        astray = larger(astray, magnitude(new[j] - now.q[j] - l->change[k]) / l->scale[j]);
    }
    for (long k = 0; k < l->sizes.inputs; k++) {
        const long j = l->driven[k];
        const wide apart = new[j] - now.q[j] - parabola(h, now.u[j], now.a[j]);
        const mask reversed = magnitude(apart) / l->scale[j] > LOOP_LONGEST;
        near &= ~reversed;
    }
    const mask far = astray > LOOP_ASTRAY * largest + R(1e-9);
    return near & ~far;
}

/* Lanes in which the pose evaluated last is on the assembly branch of the last followed state: the screws of a branch
   have determinants of one sign. For fewer than six screws A and B this is the sign of that of A^T B. A determinant of
   zero has no sign. */
static mask same_branch_of(const struct loop *l) {
    const long rank = l->sizes.solved;
    wide product[ROWS * ROWS];
    mask swaps[ROWS], opposite = {0};
    if (rank > ROWS || rank != l->sizes.rank)
        return ~opposite;
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
