#include "kinematics.h"

#include <string.h>

#include "arena.h"
#include "extrapolate.h"
#include "lanes.h"
#include "linear.h"

/* Largest part of a predicted motion by which the solution may differ from the prediction. */
#define ASTRAY R(0.1)
/* Longest step over the size of the linkage. */
#define LONGEST R(0.1)
/* A least pivot below this part of the greatest is left to those who look for singular poses. */
#define SOUND R(1e-4)
/* Round-off of a residual over the coordinates. */
#define ACCEPT (256 * REAL_EPSILON)
enum { NEWTON = 12, HALVINGS = 12 };

static size_t place(struct kinematics *k, const struct kinematic_sizes *s, void *memory) {
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
        ARENA_ARRAY(k->matrix, s->n * s->n + 1),
        ARENA_ARRAY(k->solved, s->n + 1),
        ARENA_ARRAY(k->work, s->work + 1),
        ARENA_ARRAY(k->out, s->out + 1),
        ARENA_ARRAY(k->swaps, s->n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

size_t kinematics_bytes(const struct kinematic_sizes *sizes) {
    struct kinematics counted;
    return place(&counted, sizes, NULL);
}

void kinematics_bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                     const real *p, const real *gamma_p, const ptrdiff_t *rows, void *memory) {
    place(k, sizes, memory);
    k->sizes = *sizes;
    k->kernels = *kernels;
    k->p = p;
    k->gamma_p = gamma_p;
    k->rows = rows;
}

/* The largest magnitude; not a number where one of them is none. */
static real largest_of(const real *values, ptrdiff_t count) {
    real largest = 0;
    for (ptrdiff_t i = 0; i < count; i++)
        if (!(real_fabs(values[i]) <= largest))
            largest = real_fabs(values[i]);
    return largest;
}

/* Leave Phi over its scale in k->phi, all rows of it, and the scales' inverses; return the worst. */
static real missed(struct kinematics *k, real t, const real *q) {
    const ptrdiff_t m = k->sizes.m;
    k->kernels.constraints(&t, q, k->still, k->p, k->work, k->out);
    for (ptrdiff_t i = 0; i < m; i++) {
        k->weight[i] = 1 / k->out[m + i];
        k->phi[i] = k->out[i] * k->weight[i];
    }
    return largest_of(k->phi, m);
}

/* Factorise dPhi/dq of the independent rows over their scales; returns 0 where it is singular. */
static int factorise_jacobian(struct kinematics *k, real t, const real *q) {
    const ptrdiff_t n = k->sizes.n;
    k->kernels.jacobian(&t, q, k->still, k->p, k->work, k->out);
    for (ptrdiff_t i = 0; i < n; i++) {
        const ptrdiff_t row = k->rows[i];
        for (ptrdiff_t j = 0; j < n; j++)
            k->matrix[i * n + j] = k->out[row * n + j] * k->weight[row];
    }
    return factor_dense(n, k->matrix, k->swaps);
}

/* Sign of the determinant, and the least pivot over the greatest. */
static int judge(struct kinematics *k, real *soundness) {
    const ptrdiff_t n = k->sizes.n;
    real least = REAL_INFINITY, greatest = 0;
    int sign = 1;
    for (ptrdiff_t i = 0; i < n; i++) {
        const real pivot = k->matrix[i * n + i];
        least = real_fmin(least, real_fabs(pivot));
        greatest = real_fmax(greatest, real_fabs(pivot));
        if ((pivot < 0) != (k->swaps[i] != i))
            sign = -sign;
    }
    *soundness = n ? least / greatest : R(1);
    return sign;
}

/* Solve for the independent rows of a kernel's output in k->out, over their scales. */
static void solve(struct kinematics *k, const real *rows, real *into) {
    for (ptrdiff_t i = 0; i < k->sizes.n; i++)
        into[i] = rows[k->rows[i]] * k->weight[k->rows[i]];
    solve_dense(k->sizes.n, k->matrix, k->swaps, into);
}

/* Close the linkage at t by Newton's method from q, in place. */
static int closed(struct kinematics *k, real t, real *q) {
    const ptrdiff_t n = k->sizes.n;
    real before = REAL_INFINITY;
    for (int tries = 0; tries < NEWTON; tries++) {
        const real worst = missed(k, t, q), size = real_fmax(R(k->sizes.length), largest_of(q, n));
        if (worst <= 4 * REAL_EPSILON * size || (worst <= ACCEPT * size && worst > before / 4))
            return 1;
        if (!(worst < before / 2) || !factorise_jacobian(k, t, q))
            return 0;
        before = worst;
        for (ptrdiff_t i = 0; i < n; i++)
            k->solved[i] = k->phi[k->rows[i]];
        solve_dense(n, k->matrix, k->swaps, k->solved);
        for (ptrdiff_t j = 0; j < n; j++)
            q[j] -= k->solved[j];
    }
    return 0;
}

/* Leave velocities and accelerations of a closed pose; 0 where it is too near a singular one, or passed one. */
static int moved(struct kinematics *k, real t, const real *q, real *u, real *a) {
    const ptrdiff_t n = k->sizes.n;
    real soundness;
    if (!factorise_jacobian(k, t, q))
        return 0;
    const int sign = judge(k, &soundness);
    if (!(soundness > SOUND) || (k->sign != 0 && sign != k->sign))
        return 0;
    k->kernels.drift(&t, q, k->still, k->p, k->work, k->out);
    solve(k, k->out, u);
    for (ptrdiff_t j = 0; j < n; j++)
        u[j] = -u[j];
    k->kernels.gamma(&t, q, u, k->gamma_p, k->work, k->out);
    solve(k, k->out, a);
    k->sign = sign;
    return real_isfinite(largest_of(u, n)) && real_isfinite(largest_of(a, n));
}

/* Go to `next` in one step where the prediction holds. */
static int attempt(struct kinematics *k, real next) {
    const ptrdiff_t n = k->sizes.n;
    const real h = next - k->t, length = R(k->sizes.length), *past = k->past;
    for (ptrdiff_t j = 0; j < n; j++) {
        k->change[j] = extrapolated(h, k->stride, k->q[j], k->u[j], k->a[j], past[j], past[n + j], past[2 * n + j]);
        k->next[j] = k->q[j] + k->change[j];
    }
    const real way = largest_of(k->change, n);
    if (!(way <= LONGEST * length) || !closed(k, next, k->next))
        return 0;
    for (ptrdiff_t j = 0; j < n; j++)
        k->change[j] -= k->next[j] - k->q[j];
    if (!(largest_of(k->change, n) <= ASTRAY * way + R(1e-9) * length))
        return 0;
    copy(k->q, n, k->past);
    copy(k->u, n, k->past + n);
    copy(k->a, n, k->past + 2 * n);
    copy(k->next, n, k->q);
    k->stride = h;
    k->t = next;
    return moved(k, next, k->q, k->u, k->a);
}

/* Go to the target in as many steps as predictions need. */
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
            return 0; /* near a singular pose, or no prediction holds */
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

static void bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const void *p, const void *gamma_p, const ptrdiff_t *rows, void *memory) {
    kinematics_bind(k, sizes, kernels, p, gamma_p, rows, memory);
}

static ptrdiff_t follow(struct kinematics *k, double t, const void *q, const void *times, ptrdiff_t count, void *rows) {
    return kinematics_follow(k, R(t), q, times, count, rows);
}

const struct kinematics_api symgen_kinematics = {
    .kinematics_struct = sizeof(struct kinematics),
    .bytes = kinematics_bytes,
    .bind = bind,
    .follow = follow,
};
