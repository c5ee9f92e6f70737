/* Tangents of implicit steps: Radau's collocation, and the generalized-alpha family.
 *
 * The last 2 n directions are the state itself. The tangents of accelerations along all directions are then their
 * slopes by parameters, followed by those by (q, u). With these slopes Newton's method solves the equations of a step
 * again to the last digits, and the tangent of the step has the same matrix. */
#include <string.h>

#include "arena.h"
#include "linear.h"
#include "newton.h"
#include "slopes.h"
#include "variations.h"

/* Stages of Radau's method of order 5. */
enum { STAGES = 3 };
/* Most iterations to the slopes of a step. */
enum { ITERATIONS = 50 };
/* Changes of the iterations may stall below this part of the solution. */
#define STALLED R(1e-9)

size_t implicit_place(struct variations *v, const struct equations *e, void *memory) {
    const ptrdiff_t n = e->n, k = v->sizes.columns, all = STAGES * 2 * n;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(v->states, all),
        ARENA_ARRAY(v->slopes, STAGES * n * k),
        ARENA_ARRAY(v->matrix, all * all),
        ARENA_ARRAY(v->changes, all * k),
        ARENA_ARRAY(v->swaps, all),
        ARENA_ARRAY(v->carried, 2 * n),
        ARENA_ARRAY(v->carried_moved, 2 * n * k),
    };
    return ARENA_PLACE(arrays, memory);
}

/* Evaluate dy/dt of stage s at a state, and its slopes by all directions. */
static void evaluate_slopes(struct variations *v, long s, real t, const real *state) {
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, first = k - 2 * n;
    memset(v->by_stage, 0, (size_t)(2 * n * k) * sizeof(real));
    for (ptrdiff_t i = 0; i < 2 * n; i++)
        v->by_stage[i * k + first + i] = 1;
    variations_evaluate(v, s, t, state);
    v->of->stage(v, t, state);
    memcpy(v->slopes + s * n * k, v->solved, (size_t)(n * k) * sizeof(real));
}

/* Writes the equations of a step at the present states: the matrix, and in v->changes, behind the unknowns if they are
   there, what is left; returns the size of the unknowns. */
typedef real equations_of_step(struct variations *v, real t, real h, const real *y);

/* The unknowns x of a step from y, and what is left of its equations. */
struct unknowns {
    struct variations *v;
    equations_of_step *equations;
    real t, h;
    const real *y;
    ptrdiff_t count;
    real *x, *left;
};

static real correct(void *of, struct newton *w) {
    const struct unknowns *s = of;
    const real size = s->equations(s->v, s->t, s->h, s->y);
    if (!factor_dense(s->count, s->v->matrix, s->v->swaps))
        return REAL_INFINITY;
    solve_dense(s->count, s->v->matrix, s->v->swaps, s->left);
    add_multiple(s->count, 1, s->left, s->x);
    w->size = real_fmax(size, largest_or_nan(s->x, s->count));
    return largest_or_nan(s->left, s->count);
}

/* Solve the equations of a step. */
static int solve_step(struct unknowns s) {
    struct newton w = {.most = ITERATIONS, .close = 4 * REAL_EPSILON, .rounded = STALLED, .grows = REAL_INFINITY};
    return newton_solve(&w, 1, correct, &s) ? DONE : NOT_FINITE;
}

/* The unknowns are the states of the stages. */
static real radau_equations(struct variations *v, real t, real h, const real *y) {
    const ptrdiff_t n = v->e->n, two = 2 * n, k = v->sizes.columns, first = k - two, all = STAGES * two;
    real a[STAGES][STAGES], c[STAGES];
    radau_scheme(a, c);
    for (long s = 0; s < STAGES; s++)
        evaluate_slopes(v, s, t + c[s] * h, v->states + s * two);
    memset(v->matrix, 0, (size_t)(all * all) * sizeof(real));
    for (long s = 0; s < STAGES; s++)
        for (ptrdiff_t i = 0; i < two; i++) {
            real *row = v->matrix + (s * two + i) * all, sum = y[i] - v->states[s * two + i];
            for (long j = 0; j < STAGES; j++) {
                const real weight = h * a[s][j], *slopes = v->slopes + (j * n + i - n) * k + first;
                sum += weight * v->rates[j * two + i];
                if (i < n)
                    row[j * two + n + i] -= weight;
                else
                    add_multiple(two, -weight, slopes, row + j * two);
            }
            row[s * two + i] += 1;
            v->changes[s * two + i] = sum;
        }
    return 0;
}

static int radau(struct variations *v, real t, real h, const real *y, const real *y_new) {
    const ptrdiff_t n = v->e->n, two = 2 * n, k = v->sizes.columns, first = k - two, all = STAGES * two;
    real a[STAGES][STAGES], c[STAGES];
    radau_scheme(a, c);
    for (long s = 0; s < STAGES; s++)
        for (ptrdiff_t i = 0; i < two; i++)
            v->states[s * two + i] = y[i] + c[s] * (y_new[i] - y[i]);
    const int status = solve_step((struct unknowns){v, radau_equations, t, h, y, all, v->states, v->changes});
    if (status != DONE)
        return status;
    for (long s = 0; s < STAGES; s++)
        for (ptrdiff_t i = 0; i < two; i++) {
            real *row = v->changes + (s * two + i) * k;
            memcpy(row, v->moved + i * k, (size_t)first * sizeof(real));
            memset(row + first, 0, (size_t)two * sizeof(real));
            for (long j = 0; i >= n && j < STAGES; j++)
                add_multiple(first, h * a[s][j], v->slopes + (j * n + i - n) * k, row);
        }
    solve_dense_wide(all, v->matrix, v->swaps, k, v->changes);
    memcpy(v->moved, v->changes + (all - two) * k, (size_t)(two * k) * sizeof(real));
    return DONE;
}

/* Add the tangents of accelerations of stage 0 along changes (q, u), and those by parameters, to `to`, n rows. */
static void add_accelerations(const struct variations *v, real factor, const real *changes, real *to) {
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, first = k - 2 * n;
    for (ptrdiff_t i = 0; i < n; i++) {
        const real *slopes = v->slopes + i * k;
        add_multiple(first, factor, slopes, to + i * k);
        for (ptrdiff_t j = 0; j < 2 * n; j++)
            add_multiple(first, factor * slopes[first + j], changes + j * k, to + i * k);
    }
}

static void begin_alpha(struct variations *v, real t, const real *y) {
    const size_t n = (size_t)v->e->n, rows = n * (size_t)v->sizes.columns;
    evaluate_slopes(v, 0, t, y);
    for (size_t i = 0; i < 2; i++)
        memcpy(v->carried + i * n, v->rates + n, n * sizeof(real));
    memset(v->carried_moved, 0, 2 * rows * sizeof(real));
    add_accelerations(v, R(1), v->moved, v->carried_moved);
    memcpy(v->carried_moved + rows, v->carried_moved, rows * sizeof(real));
}

/* The unknowns are the next A of the method, the first numbers of v->changes. The carried accelerations are the present
   A and a of the motion: see alpha.c. */
static real alpha_equations(struct variations *v, real t, real h, const real *y) {
    const real *of = v->scheme.numbers, inertia = 1 - of[0], force = 1 - of[1], beta = of[2], gamma = of[3];
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, first = k - 2 * n;
    real *own = v->carried, *motion = own + n, *next = v->changes, *left = next + n, *state = v->states;
    for (ptrdiff_t i = 0; i < n; i++) {
        state[i] = y[i] + h * (y[n + i] + h * ((R(0.5) - beta) * own[i] + beta * next[i]));
        state[n + i] = y[n + i] + h * ((1 - gamma) * own[i] + gamma * next[i]);
    }
    evaluate_slopes(v, 0, t + h, state);
    for (ptrdiff_t i = 0; i < n; i++) {
        const real *slopes = v->slopes + i * k + first;
        for (ptrdiff_t j = 0; j < n; j++)
            v->matrix[i * n + j] = (i == j) * inertia - force * h * (h * beta * slopes[j] + gamma * slopes[n + j]);
        left[i] = force * v->rates[n + i] + of[1] * motion[i] - inertia * next[i] - of[0] * own[i];
    }
    return largest_or_nan(state + n, n) / h;
}

static int alpha(struct variations *v, real t, real h, const real *y) {
    const real *of = v->scheme.numbers, force = 1 - of[1], beta = of[2], gamma = of[3];
    const ptrdiff_t n = v->e->n, k = v->sizes.columns;
    real *own = v->carried, *motion = own + n, *moved = v->carried_moved, *motion_moved = moved + n * k;
    real *next = v->changes;
    memcpy(next, own, (size_t)n * sizeof(real));
    const int status = solve_step((struct unknowns){v, alpha_equations, t, h, y, n, next, next + n});
    if (status != DONE)
        return status;
    memcpy(motion, v->rates + n, (size_t)n * sizeof(real));
    memcpy(own, next, (size_t)n * sizeof(real));
    /* the part of (q, u) that depends on the previous state and its carried accelerations */
    for (ptrdiff_t i = 0; i < n; i++) {
        real *q = v->moved + i * k, *u = q + n * k;
        add_multiple(k, h, u, q);
        add_multiple(k, h * h * (R(0.5) - beta), moved + i * k, q);
        add_multiple(k, h * (1 - gamma), moved + i * k, u);
    }
    real *right = v->changes;
    for (ptrdiff_t i = 0; i < n * k; i++)
        right[i] = of[1] * motion_moved[i] - of[0] * moved[i];
    add_accelerations(v, force, v->moved, right);
    solve_dense_wide(n, v->matrix, v->swaps, k, right);
    memcpy(moved, right, (size_t)(n * k) * sizeof(real));
    add_multiple(n * k, h * h * beta, moved, v->moved);
    add_multiple(n * k, h * gamma, moved, v->moved + n * k);
    memset(motion_moved, 0, (size_t)(n * k) * sizeof(real));
    add_accelerations(v, R(1), v->moved, motion_moved);
    return DONE;
}

int implicit_step(struct variations *v, int begins, real t, real h, const real *y, const real *y_new) {
    if (v->scheme.kind == find_kind("radau"))
        return radau(v, t, h, y, y_new);
    if (begins)
        begin_alpha(v, t, y);
    return alpha(v, t, h, y);
}
