/* The generalized-alpha family, Newmark's method included: one implicit stage, order 2, stable at any step.
 *
 * J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993) 371, in the form of M. Arnold, O. Bruls, Multibody Syst. Dyn. 18
 * (2007) 185: the auxiliary acceleration A of the method follows the acceleration a(q, u, t) of the motion by
 *
 *     (1 - alpha_m) A_1 + alpha_m A_0 = (1 - alpha_f) a_1 + alpha_f a_0,
 *     q_1 = q_0 + h u_0 + h^2 ((1/2 - beta) A_0 + beta A_1),   u_1 = u_0 + h ((1 - gamma) A_0 + gamma A_1).
 *
 * The authors solve the constraints together with a_1 (index 3). Here a(q, u, t) has index 1, as for every other
 * method, and the end of the step is projected: positions and velocities both stay on the constraints, and the
 * projection handles redundant constraints. Newton's iterations use the kernel `tangent`.
 */
#include "arena.h"
#include "linear.h"
#include "newton.h"
#include "run.h"
#include "slopes.h"

#include <string.h>

/* Largest number of iterations with one Jacobian. */
enum { ITERATIONS = 20 };

struct alpha {
    real *f, *f_new;                        /* dy/dt at both ends */
    real *a, *a_new;                        /* auxiliary accelerations A at both ends, n each */
    real *motion, *motion_new;              /* accelerations of the motion, before the projection: stiff springs would
                                               magnify its corrections */
    real *by_q, *by_u, *values;             /* the Jacobian, and scratch memory for it */
    real *matrix, *change;
    ptrdiff_t *swaps;
    real *h_matrix;                         /* length of the step of the factorised matrix, 0: none */
};

/* Point all arrays into memory, or only count their bytes. */
static size_t place(const struct equations *e, void *memory, struct alpha *x) {
    const long n = e->n, dim = e->dim;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->f, dim),
        ARENA_ARRAY(x->f_new, dim),
        ARENA_ARRAY(x->a, n),
        ARENA_ARRAY(x->a_new, n),
        ARENA_ARRAY(x->motion, n),
        ARENA_ARRAY(x->motion_new, n),
        ARENA_ARRAY(x->by_q, n * n),
        ARENA_ARRAY(x->by_u, n * n),
        ARENA_ARRAY(x->values, e->sizes.tangent),
        ARENA_ARRAY(x->matrix, n * n),
        ARENA_ARRAY(x->swaps, n),
        ARENA_ARRAY(x->change, n),
        ARENA_ARRAY(x->h_matrix, 1),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct run *run, const long *counts) {
    struct alpha x;
    (void)counts;
    return place(run->e, NULL, &x);
}

static struct alpha memory_of(const struct run *run) {
    struct alpha x;
    place(run->e, run->own, &x);
    return x;
}

static ptrdiff_t numbers(const long *counts) {
    (void)counts;
    return 4;
}

static void bind(struct run *run) {
    struct alpha x = memory_of(run);
    run->f = x.f;
    run->f_new = x.f_new;
}

static int begin(struct run *run) {
    struct alpha x = memory_of(run);
    run->e->of->derivative(run->e, run->state->t, run->y, x.f);
    memcpy(x.a, x.f + run->e->n, (size_t)run->e->n * sizeof(real));
    memcpy(x.motion, x.a, (size_t)run->e->n * sizeof(real));
    *x.h_matrix = 0;
    return DONE;
}

/* Matrix of Newton's iterations: the present one, a new one at the start of the step, or a new one at every iterate.
   Near a loss of rank, which magnifies errors transverse to the constraints: simple iteration along them. */
enum attempt { KNOWN, AT_START, EVERY, ALONG, ATTEMPTS };

/* The matrix (1 - alpha_m) - (1 - alpha_f) (h^2 beta da/dq + h gamma da/du) of Newton's iterations, factorised. */
static int make_matrix(struct run *run, const struct alpha *x, real t, const real *y, real h, int attempt) {
    const real *of = run->scheme.numbers;
    struct equations *e = run->e;
    long n = e->n;
    if (attempt == ALONG) {
        memset(x->by_q, 0, (size_t)(n * n) * sizeof(real));
        memset(x->by_u, 0, (size_t)(n * n) * sizeof(real));
    } else if (find_slopes(e, t, y, x->values, x->by_q, x->by_u) != DONE) {
        return 0;
    }
    for (long i = 0; i < n * n; i++)
        x->matrix[i] = -(1 - of[1]) * h * (h * of[2] * x->by_q[i] + of[3] * x->by_u[i]);
    for (long i = 0; i < n; i++)
        x->matrix[i * n + i] += 1 - of[0];
    int made = factor_dense(n, x->matrix, x->swaps);
    *x->h_matrix = made && attempt == AT_START ? h : R(0);
    return made;
}

/* Write positions and velocities at the end of the step, y_new, from the accelerations in a_new. */
static void move(struct run *run, const struct alpha *x, real h) {
    const real *of = run->scheme.numbers, *y = run->y;
    long n = run->e->n;
    for (long i = 0; i < n; i++) {
        run->y_new[i] = y[i] + h * (y[n + i] + h * ((R(0.5) - of[2]) * x->a[i] + of[2] * x->a_new[i]));
        run->y_new[n + i] = y[n + i] + h * ((1 - of[3]) * x->a[i] + of[3] * x->a_new[i]);
    }
}

/* The step whose accelerations a_new are corrected. */
struct stage {
    struct run *run;
    const struct alpha *x;
    real h, t_new, slowest, rounding; /* velocities contain the rounding of positions over h */
    int attempt;
};

static real correct(void *of, struct newton *w) {
    const struct stage *s = of;
    const struct alpha *x = s->x;
    struct run *run = s->run;
    const real *number = run->scheme.numbers, h = s->h;
    const long n = run->e->n;
    move(run, x, h);
    if (s->attempt == EVERY && !make_matrix(run, x, s->t_new, run->y_new, h, s->attempt))
        return REAL_INFINITY;
    if (s->attempt == ALONG)
        derivative_along(run, s->t_new, run->y_new, x->f_new);
    else
        run->e->of->derivative(run->e, s->t_new, run->y_new, x->f_new);
    for (long i = 0; i < n; i++)
        x->change[i] = (1 - number[1]) * x->f_new[n + i] + number[1] * x->motion[i] - (1 - number[0]) * x->a_new[i]
                       - number[0] * x->a[i];
    solve_dense(n, x->matrix, x->swaps, x->change);
    real largest = 0;
    w->size = s->slowest;
    for (long i = 0; i < n; i++) {
        x->a_new[i] += x->change[i];
        largest = real_fmax(largest, real_fabs(x->change[i]));
        w->size = real_fmax(w->size, h * real_fabs(x->a_new[i]));
    }
    if (s->attempt != ALONG)
        w->rounded = real_fmax(ROUND_OFF, s->rounding / w->size);
    return h * largest;
}

/* Iterate to a_new with the present matrix; return 0 without convergence. */
static int solve_step(struct run *run, const struct alpha *x, real h, real t_new, int attempt) {
    const long n = run->e->n;
    const real slowest = real_fmax(largest_of(run->y + n, n), h * largest_of(x->a, n));
    struct stage s = {run, x, h, t_new, slowest, ROUND_OFF * largest_of(run->y, n) / h, attempt};
    struct newton w = {.most = ITERATIONS, .close = 4 * REAL_EPSILON, .rounded = real_sqrt(REAL_EPSILON),
                       .grows = attempt == EVERY ? REAL_INFINITY : R(1)};
    memcpy(x->a_new, x->a, (size_t)n * sizeof(real));
    if (!newton_solve(&w, 1, correct, &s))
        return 0;
    memcpy(x->motion_new, x->f_new + n, (size_t)n * sizeof(real));
    move(run, x, h);
    return 1;
}

static int step(struct run *run, real t, real h, real t_new) {
    struct alpha x = memory_of(run);
    const struct equations *e = run->e;
    int attempt = is_magnified(run) ? ALONG : *x.h_matrix == h ? KNOWN : AT_START;
    for (; attempt < ATTEMPTS; attempt++)
        if ((attempt == KNOWN || attempt == EVERY || make_matrix(run, &x, t, run->y, h, attempt))
            && solve_step(run, &x, h, t_new, attempt))
            break;
    if (attempt == ATTEMPTS)
        return UNSOLVED;
    if (e->extra)
        run->y_new[2 * e->n] = run->y[2 * e->n] + h / 2 * (x.f[2 * e->n] + x.f_new[2 * e->n]);
    return DONE;
}

static int finish(struct run *run, real h, real t_new) {
    struct alpha x = memory_of(run);
    (void)h;
    run->e->of->derivative(run->e, t_new, run->y_new, x.f_new);
    return DONE;
}

static void accept(struct run *run) {
    struct alpha x = memory_of(run);
    memcpy(x.a, x.a_new, (size_t)run->e->n * sizeof(real));
    memcpy(x.motion, x.motion_new, (size_t)run->e->n * sizeof(real));
}

static int valid(const struct run *run) {
    return all_below(run->e->n, memory_of(run).swaps, run->e->n);
}

const struct kind alpha_kind = {
    "alpha", "", "alpha_m alpha_f beta gamma", 0, bytes, numbers, bind, begin, step, finish, NULL, hermite, accept,
    valid, NULL, NULL, NULL, NULL,
};
