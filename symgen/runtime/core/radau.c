/* Collocation at Radau's three points: order 5, stiff components damped at any step; adaptive.
 *
 * E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, second edition, IV.8: simplified Newton
 * iterations, error estimate and choice of the step. The equations are those of index 1, dq/dt = u, du/dt = a(q, u, t),
 * with the Jacobian da/dq, da/du from the kernel `tangent`; the rates are eliminated from every linear system. The
 * work of loads follows by the same quadrature. The interpolant is the collocation polynomial, of degree 3.
 *
 * Arrays: T and its inverse, row by row, which transform the inverse of the method's matrix to block diagonal form;
 * they affect the convergence only.
 */
#include "arena.h"
#include "linear.h"
#include "newton.h"
#include "run.h"
#include "slopes.h"

#include <string.h>

/* Stages of the method of order 5. */
enum { STAGES = 3 };
/* Most iterations of a step that may be repeated with a shorter one. */
enum { ITERATIONS = 7 };
/* Most iterations of a step of fixed length. */
enum { FIXED_ITERATIONS = 20 };
/* Iterations may stall by rounding below this part of the tolerance. */
#define STALLED 0.03
/* Iterations that converge this fast keep their Jacobian. */
#define FAST 1e-3
/* If a step may grow by less than this factor, its length and its matrices are reused. */
#define KEEP 1.2
/* After a step whose iterations did not converge, steps stay below this part of its length. */
#define CAUTION 0.8
/* Growth of this limit in each step. */
#define FORGET 1.05

struct radau {
    real *f, *f_new;               /* dy/dt at both ends */
    real *z, *z_old;               /* y at the stages less y at the start: of this and of the previous step */
    real *slopes;                  /* dy/dt at the stages */
    real *by_q, *by_u, *values;    /* the Jacobian, and scratch memory for it */
    real *matrix, *complex_matrix;
    ptrdiff_t *swaps, *complex_swaps;
    real *r, *rc;                  /* right-hand sides, 2n and 2n pairs */
    real *scale;                   /* of the errors of the iterations, 2n */
    real *memo;                    /* values carried from step to step, see the enum */
};

enum memo { KNOWN, FRESH, STALE, ALONG, H_MATRIX, H, H_OLD, NORM_OLD, REJECTED, H_UNSOLVED, CUT, MEMO };

/* The method in the core's numbers. */
struct coefficients {
    real a[STAGES][STAGES], inverse[STAGES][STAGES], c[STAGES], error[STAGES], x, xc[2];
};

static struct coefficients coefficients_in_reals(void) {
    real s6 = real_sqrt(R(6)), third = real_pow(R(3), R(1) / R(3)), s3 = real_sqrt(R(3));
    return (struct coefficients){
        .a = {{(R(88) - 7 * s6) / 360, (R(296) - 169 * s6) / 1800, (3 * s6 - R(2)) / 225},
              {(R(296) + 169 * s6) / 1800, (R(88) + 7 * s6) / 360, (R(-2) - 3 * s6) / 225},
              {(R(16) - s6) / 36, (R(16) + s6) / 36, R(1) / 9}},
        .inverse = {{2 + s6 / 2, (29 * s6 - R(36)) / 30, (R(6) - 4 * s6) / 15},
                    {(R(-36) - 29 * s6) / 30, 2 - s6 / 2, (R(6) + 4 * s6) / 15},
                    {8 * s6 / 3 - 1, -8 * s6 / 3 - 1, R(5)}},
        .c = {(R(4) - s6) / 10, (R(4) + s6) / 10, R(1)},
        .error = {(R(-13) - 7 * s6) / 3, (7 * s6 - R(13)) / 3, R(-1) / 3},
        .x = 3 + third * third - third,
        .xc = {3 + (third - third * third) / 2, s3 * third * (third + R(1)) / 2},
    };
}

void radau_scheme(real a[STAGES][STAGES], real c[STAGES]) {
    const struct coefficients m = coefficients_in_reals();
    memcpy(a, m.a, sizeof m.a);
    memcpy(c, m.c, sizeof m.c);
}

/* Point all arrays into memory, or only count their bytes. */
static size_t place(const struct equations *e, void *memory, struct radau *x) {
    const long n = e->n, dim = e->dim;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->f, dim),
        ARENA_ARRAY(x->f_new, dim),
        ARENA_ARRAY(x->z, STAGES * dim),
        ARENA_ARRAY(x->z_old, STAGES * dim),
        ARENA_ARRAY(x->slopes, STAGES * dim),
        ARENA_ARRAY(x->by_q, n * n),
        ARENA_ARRAY(x->by_u, n * n),
        ARENA_ARRAY(x->values, e->sizes.tangent),
        ARENA_ARRAY(x->matrix, n * n),
        ARENA_ARRAY(x->swaps, n),
        ARENA_ARRAY(x->complex_matrix, 2 * n * n),
        ARENA_ARRAY(x->complex_swaps, n),
        ARENA_ARRAY(x->r, 2 * n),
        ARENA_ARRAY(x->rc, 4 * n),
        ARENA_ARRAY(x->scale, 2 * n),
        ARENA_ARRAY(x->memo, MEMO),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct run *run, const long *counts) {
    struct radau x;
    (void)counts;
    return place(run->e, NULL, &x);
}

static struct radau memory_of(const struct run *run) {
    struct radau x;
    place(run->e, run->own, &x);
    return x;
}

static ptrdiff_t numbers(const long *counts) {
    (void)counts;
    return 2 * STAGES * STAGES;
}

static void bind(struct run *run) {
    struct radau x = memory_of(run);
    run->f = x.f;
    run->f_new = x.f_new;
}

static int begin(struct run *run) {
    struct radau x = memory_of(run);
    memset(x.memo, 0, MEMO * sizeof(real));
    run->e->of->derivative(run->e, run->state->t, run->y, x.f);
    return DONE;
}

/* Set the scale of changes in the iterations: the tolerance, or some roundings for fixed steps. */
static void set_scale(const struct run *run, const struct radau *x, real h) {
    long n = run->e->n;
    real sizes[2] = {0, 0};
    for (long i = 0; i < 2 * n; i++) {
        if (run->scheme.adaptive)
            x->scale[i] = R(run->task.atol) + R(run->task.rtol) * real_fabs(run->y[i]);
        else
            sizes[i / n] = real_fmax(sizes[i / n], real_fmax(real_fabs(run->y[i]), h * real_fabs(run->f[i])));
    }
    for (long i = 0; i < 2 * n && !run->scheme.adaptive; i++)
        x->scale[i] = R(100) * REAL_EPSILON * sizes[i / n];
}

/* The polynomial through z, zero at the start, at theta of its step. */
static real collocated(const struct coefficients *m, const real *z, long stride, real theta) {
    real sum = 0;
    for (int i = 0; i < STAGES; i++) {
        real weight = theta / m->c[i];
        for (int j = 0; j < STAGES; j++)
            if (j != i)
                weight *= (theta - m->c[j]) / (m->c[i] - m->c[j]);
        sum += weight * z[i * stride];
    }
    return sum;
}

/* Write to z the collocation polynomial of the last step, extrapolated over this step, less y; zero where this is far. */
static void predict(const struct run *run, const struct radau *x, const struct coefficients *m, real h) {
    long dim = run->dim;
    real h_old = x->memo[H_OLD];
    const int is_near = h_old > 0 && h <= R(GROW) * h_old;
    for (int s = 0; s < STAGES; s++)
        for (long i = 0; i < dim; i++)
            x->z[s * dim + i] =
                is_near ? run->y_old[i] - run->y[i] + collocated(m, x->z_old + i, dim, 1 + m->c[s] * h / h_old) : R(0);
}

/* Evaluate and factor the matrices of a step's linear systems; return 0 on failure. */
static int make_matrices(struct run *run, const struct radau *x, const struct coefficients *m, real h, int anew) {
    struct equations *e = run->e;
    long n = e->n;
    real along = is_magnified(run);
    if (anew || !x->memo[KNOWN] || x->memo[STALE] || x->memo[ALONG] != along) {
        if (along > 0) {
            memset(x->by_q, 0, (size_t)(n * n) * sizeof(real));
            memset(x->by_u, 0, (size_t)(n * n) * sizeof(real));
        } else if (find_slopes(e, run->state->t, run->y, x->values, x->by_q, x->by_u) != DONE) {
            return 0;
        }
        x->memo[ALONG] = along;
        x->memo[KNOWN] = x->memo[FRESH] = 1;
        x->memo[STALE] = x->memo[H_MATRIX] = 0;
    }
    if (x->memo[H_MATRIX] == h)
        return 1;
    real xc[2] = {m->xc[0] / h, m->xc[1] / h};
    reduced_matrix(n, m->x / h, x->by_q, x->by_u, x->matrix);
    reduced_complex(n, xc, x->by_q, x->by_u, x->complex_matrix);
    x->memo[H_MATRIX] = 0;
    if (!factor_dense(n, x->matrix, x->swaps) || !factor_complex(n, x->complex_matrix, x->complex_swaps))
        return 0;
    x->memo[H_MATRIX] = h;
    return 1;
}

static void evaluate_rates(struct run *run, real t, real *y, real *dy) {
    if (is_magnified(run))
        derivative_along(run, t, y, dy);
    else
        run->e->of->derivative(run->e, t, y, dy);
}

/* Evaluate the stages and write the transformed residual of the collocation equations to r and rc. */
static int find_residual(struct run *run, const struct radau *x, const struct coefficients *m, real t, real h) {
    const real *t_inverse = run->scheme.numbers + STAGES * STAGES;
    long dim = run->dim, n = run->e->n;
    memset(x->r, 0, (size_t)(2 * n) * sizeof(real));
    memset(x->rc, 0, (size_t)(4 * n) * sizeof(real));
    for (int s = 0; s < STAGES; s++) {
        const real *z = x->z, *slope = x->slopes + s * dim;
        for (long i = 0; i < dim; i++)
            run->stage[i] = run->y[i] + z[s * dim + i];
        evaluate_rates(run, t + m->c[s] * h, run->stage, x->slopes + s * dim);
        if (!all_finite(slope, dim))
            return 0;
        for (long i = 0; i < 2 * n; i++) {
            real missed = slope[i];
            for (int j = 0; j < STAGES; j++)
                missed -= m->inverse[s][j] / h * z[j * dim + i];
            x->r[i] += t_inverse[s] * missed;
            x->rc[2 * i] += t_inverse[STAGES + s] * missed;
            x->rc[2 * i + 1] += t_inverse[2 * STAGES + s] * missed;
        }
    }
    return 1;
}

/* Solve for the change of the stages, add it, and return its size over the scale. */
static real change_stages(struct run *run, const struct radau *x, const struct coefficients *m, real h) {
    const real *T = run->scheme.numbers;
    long dim = run->dim, n = run->e->n;
    real total = 0, xc[2] = {m->xc[0] / h, m->xc[1] / h};
    solve_reduced(n, m->x / h, x->by_u, x->matrix, x->swaps, x->r);
    solve_reduced_complex(n, xc, x->by_u, x->complex_matrix, x->complex_swaps, x->rc);
    for (int s = 0; s < STAGES; s++)
        for (long i = 0; i < 2 * n; i++) {
            real change = T[3 * s] * x->r[i] + T[3 * s + 1] * x->rc[2 * i] + T[3 * s + 2] * x->rc[2 * i + 1];
            x->z[s * dim + i] += change;
            if (change != 0)
                total += (change / x->scale[i]) * (change / x->scale[i]);
        }
    return real_sqrt(total / R(2 * n * STAGES));
}

/* The stages of a step, and the largest error of a solution over the scale. */
struct stages {
    struct run *run;
    const struct radau *x;
    const struct coefficients *m;
    real t, h, tolerance;
    int magnified;
};

static real correct(void *of, struct newton *w) {
    const struct stages *s = of;
    if (!find_residual(s->run, s->x, s->m, s->t, s->h))
        return REAL_INFINITY;
    const real size = change_stages(s->run, s->x, s->m, s->h), rate = w->count ? size / w->before : R(0);
    /* with projected stages the first ratio is no rate of convergence: positions follow the rates one iteration later;
       accelerations are at the limit of rounding, and the error estimate judges the step */
    if (s->magnified)
        w->rounded = w->count > 1 ? REAL_INFINITY : w->rounded;
    else if (size > w->rounded && rate < 1 && real_pow(rate, R(w->most - w->count)) / (1 - rate) * size > s->tolerance)
        return REAL_INFINITY;
    s->x->memo[STALE] = w->count > 1 && rate > R(FAST) && rate <= R(0.5);
    return size;
}

/* Iterate to the stages of the step; return 0 without convergence. */
static int solve_stages(struct run *run, const struct radau *x, const struct coefficients *m, real t, real h) {
    const real rtol = R(run->task.rtol), rounding = R(10) * REAL_EPSILON / rtol;
    const int adaptive = run->scheme.adaptive, magnified = is_magnified(run);
    const real tolerance = adaptive ? real_fmax(rounding, real_fmin(R(0.03), real_sqrt(rtol))) : R(1);
    struct stages s = {run, x, m, t, h, tolerance, magnified};
    struct newton w = {.most = adaptive ? ITERATIONS : FIXED_ITERATIONS, .close = tolerance * R(0.01),
                       .rounded = real_fmax(R(STALLED), tolerance), .left = tolerance,
                       .grows = magnified ? REAL_INFINITY : R(1)};
    predict(run, x, m, h);
    return newton_solve(&w, 1, correct, &s) || (magnified && real_isfinite(w.error));
}

/* Write to run->error the error estimate of order 4, filtered by the real system [IV.8.19]; `at` is dy/dt. */
static real estimate(struct run *run, const struct radau *x, const struct coefficients *m, real h, const real *at) {
    struct equations *e = run->e;
    long dim = run->dim, n = e->n;
    for (long i = 0; i < 2 * n; i++) {
        x->r[i] = at[i];
        for (int s = 0; s < STAGES; s++)
            x->r[i] += m->error[s] / h * x->z[s * dim + i];
    }
    solve_reduced(n, m->x / h, x->by_u, x->matrix, x->swaps, x->r);
    memset(run->error, 0, (size_t)dim * sizeof(real));
    memcpy(run->error, x->r, (size_t)(2 * n) * sizeof(real));
    if (is_magnified(run) && e->of->factorise(e, run->state->t + h, run->y_new) == DONE) {
        e->of->make_tangent(e, run->state->t + h, run->y_new, run->error);
        e->of->make_tangent(e, run->state->t + h, run->y_new, run->error + n);
        if (judged_of(run) > 2 * n) {
            real missed = at[2 * n];
            for (int s = 0; s < STAGES; s++)
                missed += m->error[s] / h * x->z[s * dim + 2 * n];
            run->error[2 * n] = h / m->x * missed;
        }
    }
    return error_norm(run, h, run->error);
}

static int step(struct run *run, real t, real h, real t_new) {
    struct coefficients m = coefficients_in_reals();
    struct radau x = memory_of(run);
    long dim = run->dim;
    (void)t_new;
    x.memo[CUT] = h < run->state->h;
    set_scale(run, &x, h);
    for (int anew = 0;; anew = 1) {
        if (make_matrices(run, &x, &m, h, anew) && solve_stages(run, &x, &m, t, h))
            break;
        if (!anew && !x.memo[FRESH])
            continue;
        run->state->shrink = R(0.5);
        if (!is_magnified(run)) /* else it is over soon */
            x.memo[H_UNSOLVED] = h;
        return run->scheme.adaptive ? AGAIN : UNSOLVED;
    }
    for (int s = 0; s < STAGES && run->e->extra; s++) {
        real *work = x.z + s * dim + 2 * run->e->n;
        *work = 0;
        for (int j = 0; j < STAGES; j++)
            *work += h * m.a[s][j] * x.slopes[j * dim + 2 * run->e->n];
    }
    for (long i = 0; i < dim; i++)
        run->y_new[i] = run->y[i] + x.z[(STAGES - 1) * dim + i];
    if (!run->scheme.adaptive)
        return DONE;
    real norm = estimate(run, &x, &m, h, run->f);
    if (norm > 1 && (x.memo[REJECTED] || run->state->steps == 0)) {
        for (long i = 0; i < dim; i++)
            run->stage[i] = run->y[i] + run->error[i];
        evaluate_rates(run, t, run->stage, run->f_new);
        norm = estimate(run, &x, &m, h, run->f_new);
    }
    x.memo[REJECTED] = !(norm <= 1);
    run->state->norm = norm;
    return DONE;
}

static int finish(struct run *run, real h, real t_new) {
    struct radau x = memory_of(run);
    x.memo[H] = h;
    run->e->of->derivative(run->e, t_new, run->y_new, x.f_new);
    return DONE;
}

static void interpolate(struct run *run, real h, real theta, real *y) {
    struct coefficients m = coefficients_in_reals();
    struct radau x = memory_of(run);
    (void)h;
    for (long i = 0; i < run->dim; i++)
        y[i] = run->y[i] + collocated(&m, x.z + i, run->dim, theta);
}

/* Store the stages, and choose the next step from the errors of the last two (Gustafsson's control). */
static void accept(struct run *run) {
    struct state *s = run->state;
    struct radau x = memory_of(run);
    real h = x.memo[H], h_old = x.memo[H_OLD], norm = real_fmax(s->norm, R(1e-2));
    memcpy(x.z_old, x.z, (size_t)(STAGES * run->dim) * sizeof(real));
    x.memo[FRESH] = 0;
    x.memo[H_OLD] = h;
    if (!run->scheme.adaptive)
        return;
    if (h_old > 0 && !x.memo[CUT]) {
        real predicted = R(0.9) * h * h / h_old * real_pow(x.memo[NORM_OLD] / (norm * norm), R(0.25));
        s->h = real_fmin(s->h, real_fmax(predicted, R(0.2) * h));
    }
    x.memo[NORM_OLD] = norm;
    if (x.memo[H_UNSOLVED] > 0) {
        s->h = real_fmin(s->h, R(CAUTION) * x.memo[H_UNSOLVED]);
        x.memo[H_UNSOLVED] *= R(FORGET);
    }
    if (h <= s->h && s->h <= R(KEEP) * h)
        s->h = h;
}

static int valid(const struct run *run) {
    const struct radau x = memory_of(run);
    return all_below(run->e->n, x.swaps, run->e->n) && all_below(run->e->n, x.complex_swaps, run->e->n);
}

const struct kind radau_kind = {
    "radau", "", "t t_inverse", 0, bytes, numbers, bind, begin, step, finish, NULL, interpolate, accept,
    valid, NULL, NULL, NULL, NULL,
};
