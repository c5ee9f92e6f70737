#include "equations.h"

#include "arena.h"
#include "newton.h"

#include <string.h>

int (*core_interrupted)(void) = NULL;

const struct behaviour kernel_behaviour = {
    accelerate, derivative, position_error, velocity_error, factorise,
    look, project, project_places, make_tangent, measure_energy, .rounding = 0.1,
};

/* Point all arrays into memory, or only count their bytes. */
static size_t place(struct equations *e, const struct sizes *s, void *memory) {
    const long n = s->n, m = s->m, whole = n + m + 1;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(e->account, 1),
        ARENA_ARRAY(e->p, s->parameters + s->derived + 1),
        ARENA_ARRAY(e->tangent_p, s->parameters + s->tangent_derived + 1),
        ARENA_ARRAY(e->work, s->work + 1),
        ARENA_ARRAY(e->factors, s->work + 1),
        ARENA_ARRAY(e->out, 2 * whole + s->couples),
        ARENA_ARRAY(e->rates, m + 1),
        ARENA_ARRAY(e->rhs, whole),
        ARENA_ARRAY(e->energies, 3),
        ARENA_ARRAY(e->before, n + 1),
        ARENA_ARRAY(e->zero, n + 1),
        ARENA_ARRAY(e->errors, 2 * m + 1),
        ARENA_ARRAY(e->gaps, s->events + s->switches + s->windings + 2 * s->turns + 1),
        ARENA_ARRAY(e->dropped, m + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

size_t equations_bytes(const struct sizes *sizes) {
    struct equations counted;
    return place(&counted, sizes, NULL);
}

void equations_bind(struct equations *e, const struct sizes *sizes, const struct kernels *kernels, void *memory) {
    e->of = &kernel_behaviour;
    e->owner = NULL;
    e->kernels = *kernels;
    e->sizes = *sizes;
    e->finest = 0;
    e->n = sizes->n, e->m = sizes->m, e->extra = sizes->extra, e->dim = 2 * sizes->n + sizes->extra;
    e->bytes = place(e, sizes, memory);
    e->account->weakest = e->account->worst = -1;
    e->account->soundness = INFINITY;
}

void set_up_with(kernel setup, long parameters, real *p) {
    if (setup != NULL)
        setup(NULL, NULL, NULL, p, NULL, p + parameters);
}

void set_up(struct equations *e) {
    e->revision++;
    e->p[e->sizes.parameters + e->sizes.derived] = R(e->sizes.rank_tolerance);
    copy(e->p, e->sizes.parameters, e->tangent_p);
    set_up_with(e->kernels.setup, e->sizes.parameters, e->p);
    set_up_with(e->kernels.tangent_setup, e->sizes.parameters, e->tangent_p);
}

void accelerate(struct equations *e, real t, const real *y) {
    const real *u = y + e->n;
    long whole = e->n + e->m;
    e->kernels.accelerations(&t, y, u, e->p, e->work, e->out);
    if (e->kernels.residual == NULL)
        return;
    for (int k = 0; k < REFINEMENTS; k++) {
        e->kernels.residual(&t, y, u, e->p, e->out, e->rhs);
        e->kernels.solve(&t, y, u, e->p, e->work, e->rhs);
        for (long i = 0; i < whole; i++)
            e->out[i] += e->rhs[i];
    }
}

/* Add to e->out the accelerations by which every constraint returns to zero like a critically damped oscillator of
 * rate r: Phi'' = -2 r Phi' - r^2 Phi (J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1, 1972, with alpha = beta =
 * r). */
static void pull_back(struct equations *e, real t, const real *y) {
    const real *u = y + e->n;
    long n = e->n, m = e->m;
    real r = R(e->sizes.stabilisation);
    e->kernels.constraints(&t, y, u, e->p, e->work, e->errors);
    e->kernels.velocity_constraints(&t, y, u, e->p, e->work, e->rates);
    e->kernels.factor(&t, y, u, e->p, e->factors, e->rhs);
    e->account->factorisations++;
    memset(e->rhs, 0, (size_t)n * sizeof(real));
    for (long i = 0; i < m; i++)
        e->rhs[n + i] = -r * (R(2) * e->rates[i] + r * e->errors[i]);
    e->kernels.solve(&t, y, u, e->p, e->factors, e->rhs);
    for (long i = 0; i < n + m; i++)
        e->out[i] += e->rhs[i];
}

void derivative(struct equations *e, real t, const real *y, real *dy) {
    copy(y + e->n, e->n, dy);
    accelerate(e, t, y);
    if (e->sizes.stabilisation > 0.0 && e->m > 0)
        pull_back(e, t, y);
    copy_fresh(e->out, e->n, dy + e->n);
    if (e->extra) {
        e->kernels.energy(&t, y, y + e->n, e->p, e->out, e->energies);
        dy[2 * e->n] = e->energies[2];
    }
    e->account->evaluations++;
}

real position_error(struct equations *e, real t, const real *y) {
    long n = e->n, m = e->m;
    real worst = 0, missed = 0;
    e->kernels.constraints(&t, y, y + n, e->p, e->work, e->out);
    memset(e->rhs, 0, (size_t)n * sizeof(real));
    e->account->worst = -1;
    for (long i = 0; i < m; i++) {
        real error = real_fabs(e->out[i]) / e->out[m + i];
        e->rhs[n + i] = -e->out[i];
        if (e->dropped[i]) {
            missed = real_fmax(missed, error);
        } else if (!(error <= worst)) {
            worst = error;
            e->account->worst = i;
        }
    }
    e->account->missed = (double)missed;
    return worst;
}

real velocity_error(struct equations *e, real t, const real *y) {
    long n = e->n, m = e->m;
    real worst = 0;
    e->kernels.velocity_constraints(&t, y, y + n, e->p, e->work, e->rates);
    memset(e->rhs, 0, (size_t)n * sizeof(real));
    for (long i = 0; i < m; i++) {
        real error = real_fabs(e->rates[i]) / e->out[m + i];
        e->rhs[n + i] = -e->rates[i];
        if (!(error <= worst) && !e->dropped[i])
            worst = error;
    }
    return worst;
}

/* Part of an unknown's pivot that remains after cancellation: the pivot over the sum of its terms of equal sign. That
   sum is zero only if the unknown is undetermined. */
static double part_left(const struct equations *e, const real *factors, long unknown) {
    const real *pivot = factors + e->sizes.first_pivot + 2 * unknown;
    real sign = unknown < e->n ? R(1) : R(-1);
    return pivot[1] != 0 ? (double)(sign * pivot[0] / real_fabs(pivot[1])) : 0.0;
}

/* Watch the pivots of a factor; `dropped` may be NULL. */
static int judge(struct equations *e, const real *factors, char *dropped) {
    struct account *found = e->account;
    long n = e->n, m = e->m, redundant = e->sizes.redundant;
    double tolerance = e->sizes.rank_tolerance;
    int finite = 1;
    found->weakest = -1, found->soundness = INFINITY, found->lost = 0;
    for (long i = 0; i < n; i++) {
        double ratio = part_left(e, factors, i);
        if (!isfinite(ratio)) {
            finite = 0;
        } else if (ratio <= MASSLESS) {
            found->weakest = i, found->soundness = ratio;
            return SINGULAR;
        }
    }
    for (long i = 0; i < m; i++) {
        double ratio = part_left(e, factors, n + i);
        if (dropped)
            dropped[i] = ratio <= tolerance;
        if (!isfinite(ratio)) {
            finite = 0;
        } else if (ratio <= tolerance && found->lost < redundant) {
            found->lost++;
        } else if (ratio < found->soundness) {
            found->weakest = n + i, found->soundness = ratio;
        }
    }
    if (!finite)
        return NOT_FINITE;
    return found->soundness <= tolerance || found->lost < redundant ? SINGULAR : DONE;
}

int factorise(struct equations *e, real t, const real *y) {
    e->kernels.factor(&t, y, y + e->n, e->p, e->factors, e->out);
    e->account->factorisations++;
    return judge(e, e->factors, e->dropped);
}

int look(struct equations *e, real t, const real *y) {
    e->kernels.factor(&t, y, y + e->n, e->p, e->work, e->out);
    e->account->factorisations++;
    return judge(e, e->work, NULL);
}

void solve_factored(struct equations *e, real t, const real *y, real *b) {
    e->kernels.solve(&t, y, y + e->n, e->p, e->factors, b);
}

real size_of(const struct equations *e, const real *y) {
    real size = 0;
    for (long i = 0; i < e->n; i++)
        size = real_fmax(size, real_fabs(y[i]));
    for (long i = 0; i < e->m; i++)
        size = real_fmax(size, real_fabs(e->out[e->m + i]));
    return size;
}

real correct_positions(void *of, struct newton *w) {
    const struct correction *c = of;
    struct equations *e = c->e;
    const long n = e->n;
    if (w->count) {
        copy(c->y, n, e->before);
        solve_factored(e, c->t_factor, c->y_factor, e->rhs);
        for (long i = 0; i < n; i++)
            c->y[i] += e->rhs[i];
        for (long i = 0; i < n && c->h != 0; i++)
            c->y[n + i] += e->rhs[i] / c->h;
    }
    const real worst = position_error(e, c->t, c->y);
    if (!w->count)
        w->size = size_of(e, c->y);
    return worst;
}

int project_positions(struct equations *e, real t, real *y) {
    struct correction c = {.e = e, .t_factor = t, .y_factor = y, .t = t, .y = y};
    struct newton w = {.most = PROJECTIONS, .close = REAL_EPSILON, .rounded = ROUND_OFF, .grows = R(0.5)};
    if (!newton_solve(&w, 1, correct_positions, &c))
        return real_isfinite(w.error) ? PROJECTION_FAILED : NOT_FINITE;
    if (w.error > w.before) {
        memcpy(y, e->before, (size_t)e->n * sizeof(real));
        position_error(e, t, y);
    }
    return e->sizes.redundant && !(e->account->missed <= e->sizes.slack) ? CONTRADICTED : DONE;
}

real shortest_scale(const struct equations *e) {
    real shortest = REAL_INFINITY;
    if (e->of == &kernel_behaviour)
        for (long i = 0; i < e->m; i++)
            shortest = real_fmin(shortest, e->out[e->m + i]);
    return shortest;
}

static real speed_of(const struct equations *e, const real *y) {
    real speed = 0;
    for (long i = e->n; i < 2 * e->n; i++)
        speed = real_fmax(speed, real_fabs(y[i]));
    return speed;
}

/* Constraint rates at which a projection ends: roundings, if the run's tolerance is far above them. Without a
   tolerance, and near a loss of rank, which magnifies rates, iterations continue as long as each halves them. */
static real rounding_of_rates(const struct equations *e, real speed) {
    if (e->account->soundness < NEAR)
        return 0;
    return REAL_EPSILON * speed < R(RATES_LEFT) * R(e->finest) ? REAL_EPSILON * speed : 0;
}

int project_velocities(struct equations *e, real t, real *y) {
    long n = e->n;
    real speed = speed_of(e, y), previous = REAL_INFINITY, rounding = rounding_of_rates(e, speed);
    for (int k = 0; k < 2 * RATE_PROJECTIONS; k++) {
        if (k == RATE_PROJECTIONS) {
            /* the factor belongs to a distant state: factorise again */
            if (previous <= ROUND_OFF * speed)
                break;
            int status = factorise(e, t, y);
            if (status != DONE)
                return status;
        }
        real worst = velocity_error(e, t, y);
        if (!real_isfinite(worst))
            return NOT_FINITE;
        if (worst <= rounding || worst > R(0.5) * previous)
            break;
        previous = worst;
        solve_factored(e, t, y, e->rhs);
        for (long i = 0; i < n; i++)
            y[n + i] += e->rhs[i];
    }
    return DONE;
}

int project_places(struct equations *e, real t, real *y) {
    if (e->m == 0)
        return DONE;
    int status = factorise(e, t, y);
    return status == DONE ? project_positions(e, t, y) : status;
}

int project(struct equations *e, real t, real *y) {
    int status = project_places(e, t, y);
    return status == DONE && e->m ? project_velocities(e, t, y) : status;
}

void make_tangent(struct equations *e, real t, const real *y, real *change) {
    long n = e->n, m = e->m;
    /* Prescribed rates of the constraints take no part in a change. */
    e->kernels.velocity_constraints(&t, y, change, e->p, e->work, e->rhs + n);
    e->kernels.velocity_constraints(&t, y, e->zero, e->p, e->work, e->rates);
    memset(e->rhs, 0, (size_t)n * sizeof(real));
    for (long i = 0; i < m; i++)
        e->rhs[n + i] = e->rates[i] - e->rhs[n + i];
    e->kernels.solve(&t, y, change, e->p, e->factors, e->rhs);
    for (long i = 0; i < n; i++)
        change[i] += e->rhs[i];
}

void measure_energy(struct equations *e, real t, const real *y) {
    e->kernels.energy(&t, y, y + e->n, e->p, e->work, e->energies);
}

void look_at_events(struct equations *e, real t, const real *y) {
    e->kernels.events(&t, y, y + e->n, e->p, e->work, e->gaps);
}
