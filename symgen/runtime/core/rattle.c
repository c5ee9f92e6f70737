/* RATTLE and its symmetric compositions: positions and velocities on the constraints, time reversible.
 *
 * H. C. Andersen, J. Comput. Phys. 52 (1983) 24; E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration,
 * second edition, VII.1.4 and V.3.2. With h the length of a step or of a part of it:
 *
 *     u' = u + h/2 M^-1 (f(q, u, t) - J(q)^T lambda),       q_1 = q + h u',   Phi(q_1, t_1) = 0,
 *     u_1 = u' + h/2 M^-1 (f(q_1, u_1, t_1) - J(q_1)^T mu),                   J(q_1) u_1 + dPhi/dt = 0.
 *
 * The second half is the adjoint of the first, so the step is symmetric and of order 2 for any force; if the force
 * depends on velocities, u_1 is iterated. The acceleration of the constrained motion replaces M^-1 f: it differs by a
 * term M^-1 J^T x, which the multipliers absorb.
 *
 * counts: parts of a step, an odd number. side: lengths of the parts before the middle one over that of the
 * step; the parts after the middle one mirror those before it, and the middle one is the rest of the step.
 */
#include "arena.h"
#include "linear.h"
#include "newton.h"
#include "run.h"

#include <string.h>

/* Largest number of corrections: of positions with the factor at the start, of these with a new Jacobian each, and of
   velocities on which forces depend. */
enum { CORRECTIONS = 60 };
/* Content of `own`: rates at both ends, the state and its acceleration after the finished parts, the start of the
   iterations of a part, the factorisation at y, and the Jacobian of the position constraints along the directions
   M^-1 J^T. */
struct rattle {
    real *f, *f_new, *y, *rate, *begun, *factors, *motions, *jacobian, *change;
    ptrdiff_t *swaps;
};

/* Point all arrays into memory, or only count their bytes. */
static size_t place(const struct equations *e, void *memory, struct rattle *x) {
    const long n = e->n, m = e->m, dim = e->dim;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->f, dim),
        ARENA_ARRAY(x->f_new, dim),
        ARENA_ARRAY(x->y, dim),
        ARENA_ARRAY(x->rate, dim),
        ARENA_ARRAY(x->begun, dim),
        ARENA_ARRAY(x->factors, e->sizes.work + 1),
        ARENA_ARRAY(x->motions, n * m),
        ARENA_ARRAY(x->jacobian, m * m),
        ARENA_ARRAY(x->swaps, m),
        ARENA_ARRAY(x->change, m),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct run *run, const long *counts) {
    struct rattle x;
    (void)counts;
    return place(run->e, NULL, &x);
}

static struct rattle memory_of(const struct run *run) {
    struct rattle x;
    place(run->e, run->own, &x);
    return x;
}

static ptrdiff_t numbers(const long *counts) {
    return counts[0] % 2 == 1 && counts[0] > 0 ? counts[0] / 2 : -1;
}

static void bind(struct run *run) {
    struct rattle x = memory_of(run);
    run->f = x.f;
    run->f_new = x.f_new;
}

static void copy_factors(const struct equations *e, const real *from, real *to) {
    memcpy(to, from, (size_t)e->sizes.work * sizeof(real));
}

static int begin(struct run *run) {
    struct equations *e = run->e;
    struct rattle x = memory_of(run);
    e->of->derivative(e, run->state->t, run->y, x.f);
    copy_factors(e, e->work, x.factors);
    return DONE;
}

/* Write to x->motions, with the last factor, the change of q along M^-1 J^T at a unit change of each constraint, a
   column each; zero for constraints that follow from others. */
static void find_motions(struct equations *e, const struct rattle *x, real t, const real *y) {
    long n = e->n, m = e->m;
    for (long k = 0; k < m; k++) {
        memset(e->rhs, 0, (size_t)(n + m) * sizeof(real));
        e->rhs[n + k] = 1;
        solve_factored(e, t, y, e->rhs);
        memcpy(x->motions + k * n, e->rhs, (size_t)n * sizeof(real));
    }
}

/* Write to x->change the amounts of these motions that bring Phi (e->rhs is -Phi) to zero: Newton's step with the
   Jacobian at y. Return 0 if it is singular. */
static int jacobian_step(struct equations *e, const struct rattle *x, real t, const real *y) {
    long n = e->n, m = e->m;
    memcpy(x->change, e->rhs + n, (size_t)m * sizeof(real));
    e->kernels.velocity_constraints(&t, y, e->zero, e->p, e->work, e->rates);
    for (long k = 0; k < m; k++) {
        if (e->dropped[k]) {
            for (long i = 0; i < m; i++)
                x->jacobian[i * m + k] = x->jacobian[k * m + i] = 0;
            x->jacobian[k * m + k] = 1;
            x->change[k] = 0;
            continue;
        }
        e->kernels.velocity_constraints(&t, y, x->motions + k * n, e->p, e->work, e->rhs);
        for (long i = 0; i < m; i++)
            x->jacobian[i * m + k] = e->dropped[i] ? R(0) : e->rhs[i] - e->rates[i];
    }
    if (!factor_dense(m, x->jacobian, x->swaps))
        return 0;
    solve_dense(m, x->jacobian, x->swaps, x->change);
    return 1;
}

/* Add `amount` times the change of positions dq to `y`, over a part of length h. */
static void shift(const struct equations *e, const real *dq, real amount, real h, real *y) {
    for (long i = 0; i < e->n; i++) {
        y[i] += amount * dq[i];
        y[e->n + i] += amount * dq[i] / h;
    }
}

/* A correction of positions with a new Jacobian. */
struct relinearised {
    struct run *run;
    const struct rattle *x;
    struct correction c;
};

static real relinearise(void *of, struct newton *w) {
    const struct relinearised *r = of;
    const struct rattle *x = r->x;
    struct equations *e = r->run->e;
    real *dq = r->run->error, *y = r->c.y;
    if (w->halved) {
        shift(e, dq, -real_pow(R(0.5), R(w->halved)), r->c.h, y);
    } else if (w->count) {
        if (!jacobian_step(e, x, r->c.t, y))
            return REAL_INFINITY;
        memset(dq, 0, (size_t)e->n * sizeof(real));
        for (long j = 0; j < e->m; j++)
            add_multiple(e->n, x->change[j], x->motions + j * e->n, dq);
        shift(e, dq, 1, r->c.h, y);
    }
    const real worst = e->of->position_error(e, r->c.t, y);
    w->size = size_of(e, y);
    return worst;
}

/* Correct positions and velocities of `y`, a part of length h after (t, start), so that the positions satisfy the
   constraints at t_1: with the factor at the start while that converges, else with a new Jacobian at every iterate.
   */
static int meet_positions(struct run *run, const struct rattle *x, real t, const real *start, real h, real t_1,
                          real *y) {
    struct relinearised r = {run, x, {run->e, t, start, t_1, h, y}};
    struct newton w = {.most = CORRECTIONS, .close = REAL_EPSILON, .rounded = ROUND_OFF, .grows = R(0.5)};
    /* near a loss of rank, iterations with the factor at the start stall early: new Jacobians reduce the error further */
    if (run->state->sound < NEAR)
        w.rounded = REAL_EPSILON;
    memcpy(x->begun, y, (size_t)run->dim * sizeof(real));
    if (newton_solve(&w, 1, correct_positions, &r.c))
        return DONE;
    memcpy(y, x->begun, (size_t)run->dim * sizeof(real));
    find_motions(run->e, x, t, start);
    w.rounded = ROUND_OFF, w.grows = 1, w.halvings = CORRECTIONS;
    return newton_solve(&w, 1, relinearise, &r) ? DONE : PROJECTION_FAILED;
}

/* Write the rates of y = (q_1, u, work) to x->rate, and the factorisation there to e->factors. */
static void evaluate_rates(struct run *run, const struct rattle *x, real t, const real *y) {
    struct equations *e = run->e;
    e->of->derivative(e, t, y, x->rate);
    copy_factors(e, e->work, e->factors);
}

/* Write into y the velocities u' + h/2 M^-1 f, on the constraints, with the accelerations in x->rate. */
static int kick(struct run *run, const struct rattle *x, const real *half, real h, real t_1, real *y) {
    struct equations *e = run->e;
    long n = e->n;
    for (long i = 0; i < n; i++)
        y[n + i] = half[i] + h / 2 * x->rate[n + i];
    if (e->m == 0)
        return DONE;
    e->of->position_error(e, t_1, y);
    return project_velocities(e, t_1, y);
}

/* A correction of the velocities of y = (q_1, u', work): a new evaluation of forces that depend on them. */
struct kicks {
    struct run *run;
    const struct rattle *x;
    real h, t_1, *y;
    int status;
};

static real correct_velocities(void *of, struct newton *w) {
    struct kicks *k = of;
    struct equations *e = k->run->e;
    const long n = e->n;
    real *half = k->run->error, *last = half + n, *u = k->y + n, change = 0;
    memcpy(last, u, (size_t)n * sizeof(real));
    evaluate_rates(k->run, k->x, k->t_1, k->y);
    k->status = kick(k->run, k->x, half, k->h, k->t_1, k->y);
    if (k->status != DONE)
        return REAL_INFINITY;
    if (!e->extra) /* no force depends on velocities: the work of such a force would be integrated */
        return 0;
    w->size = real_fmax(largest_of(u, n), k->h * largest_of(k->x->rate + n, n));
    for (long i = 0; i < n; i++)
        change = real_fmax(change, real_fabs(u[i] - last[i]));
    return change;
}

/* Bring y = (q_1, u', work) to the end of the part. */
static int meet_velocities(struct run *run, const struct rattle *x, real h, real t_1, real *y) {
    struct equations *e = run->e;
    const long n = e->n;
    const real power = e->extra ? x->rate[2 * n] : R(0);
    struct kicks k = {run, x, h, t_1, y, UNSOLVED};
    struct newton w = {.most = CORRECTIONS, .close = 4 * REAL_EPSILON, .rounded = ROUND_OFF, .grows = REAL_INFINITY};
    memcpy(run->error, y + n, (size_t)n * sizeof(real));
    add_multiple(n, h / 2, x->rate + n, y + n);
    if (!e->extra) { /* no force depends on velocities: the work of such a force would be integrated */
        evaluate_rates(run, x, t_1, y);
        return kick(run, x, run->error, h, t_1, y);
    }
    if (!newton_solve(&w, 1, correct_velocities, &k))
        return k.status != DONE ? k.status : real_isfinite(w.error) ? UNSOLVED : NOT_FINITE;
    y[2 * n] += h / 2 * (power + x->rate[2 * n]);
    return DONE;
}

/* One part of a step: advance x->y, with its rates x->rate and the factor in e->factors, by h to t_1. */
static int part(struct run *run, const struct rattle *x, real t, real h, real t_1) {
    struct equations *e = run->e;
    long n = e->n;
    real *y = run->stage;
    memcpy(y, x->y, (size_t)run->dim * sizeof(real));
    for (long i = 0; i < n; i++) {
        y[n + i] += h / 2 * x->rate[n + i];
        y[i] += h * y[n + i];
    }
    if (e->m) {
        int status = meet_positions(run, x, t, x->y, h, t_1, y);
        if (status != DONE)
            return status;
        if (e->sizes.redundant && !(e->account->missed <= e->sizes.slack))
            return CONTRADICTED;
        if (strayed(run, t, x->y, t_1, y))
            for (long i = 0; i < n; i++)
                y[n + i] = (y[i] - x->y[i]) / h;
    }
    int status = meet_velocities(run, x, h, t_1, y);
    memcpy(x->y, y, (size_t)run->dim * sizeof(real));
    return status;
}

/* Length of a part over that of the step. */
static real fraction(const struct run *run, long index) {
    long parts = run->scheme.counts[0], side = parts / 2;
    real middle = 1;
    if (index != side)
        return run->scheme.numbers[index < side ? index : parts - 1 - index];
    for (long i = 0; i < side; i++)
        middle -= R(2) * run->scheme.numbers[i];
    return middle;
}

static int step(struct run *run, real t, real h, real t_new) {
    struct rattle x = memory_of(run);
    long parts = run->scheme.counts[0];
    size_t bytes = (size_t)run->dim * sizeof(real);
    memcpy(x.y, run->y, bytes);
    memcpy(x.rate, x.f, bytes);
    copy_factors(run->e, x.factors, run->e->factors);
    for (long i = 0; i < parts; i++) {
        real length = h * fraction(run, i), t_1 = i + 1 < parts ? t + length : t_new;
        int status = part(run, &x, t, length, t_1);
        if (status != DONE)
            return status;
        t = t_1;
    }
    memcpy(run->y_new, x.y, bytes);
    return DONE;
}

static int finish(struct run *run, real h, real t_new) {
    struct rattle x = memory_of(run);
    (void)h, (void)t_new;
    memcpy(x.f_new, x.rate, (size_t)run->dim * sizeof(real));
    memcpy(x.f_new, run->y_new + run->e->n, (size_t)run->e->n * sizeof(real));
    copy_factors(run->e, run->e->factors, x.factors);
    return DONE;
}

/* The step's accelerations have the error of the velocities at which they were evaluated: evaluate both ends again.
   */
static void prepare(struct run *run, real h) {
    struct equations *e = run->e;
    struct rattle x = memory_of(run);
    e->of->derivative(e, run->state->t, run->y, x.y);
    e->of->derivative(e, run->state->t + h, run->y_new, x.rate);
}

/* Positions of order 6 from both ends with two derivatives. Velocities of order 4 from both ends with one derivative;
   if the step is accurate enough, of order 5 as the slope of the positions. */
static void interpolate(struct run *run, real h, real theta, real *y) {
    struct rattle x = memory_of(run);
    long n = run->e->n;
    const real *q0 = run->y, *u0 = q0 + n, *a0 = x.y + n, *q1 = run->y_new, *u1 = q1 + n, *a1 = x.rate + n;
    real s = theta, r = 1 - s, s2 = s * s, r2 = r * r;
    real of_u0 = s * r2 * r * (1 + R(3) * s), of_u1 = -r * s2 * s * (R(4) - R(3) * s);
    real of_a0 = s2 * r2 * r / 2, of_a1 = r2 * s2 * s / 2, of_q1 = s2 * s * (R(10) - R(15) * s + R(6) * s2);
    real slope = R(30) * s2 * r2 / h;
    for (long i = 0; i < n; i++) {
        real dq = q1[i] - q0[i];
        y[i] = q0[i] + of_q1 * dq + h * (of_u0 * u0[i] + of_u1 * u1[i] + h * (of_a0 * a0[i] + of_a1 * a1[i]));
        y[n + i] = run->scheme.counts[0] == 1
                       ? u0[i] + s2 * (R(3) - R(2) * s) * (u1[i] - u0[i]) + h * s * r * (r * a0[i] - s * a1[i])
                       : slope * dq + r2 * (1 + R(2) * s - R(15) * s2) * u0[i]
                             + s2 * (1 + R(2) * r - R(15) * r2) * u1[i]
                             + h * s * r * (r * (1 - R(5) * s / 2) * a0[i] - s * (1 - R(5) * r / 2) * a1[i]);
    }
    if (run->e->extra)
        y[2 * n] = run->y[2 * n] + s2 * (R(3) - R(2) * s) * (run->y_new[2 * n] - run->y[2 * n])
                   + h * s * r * (r * x.y[2 * n] - s * x.rate[2 * n]);
}

static int valid(const struct run *run) {
    return all_below(run->e->m, memory_of(run).swaps, run->e->m);
}

const struct kind rattle_kind = {
    "rattle", "parts", "side", 1, bytes, numbers, bind, begin, step, finish, prepare, interpolate, NULL,
    valid, NULL, NULL, NULL, NULL,
};
