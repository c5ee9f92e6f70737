/* Accelerations of a mechanism and projections of its state, one text for a single mechanism and for one with other
 * parameters in each lane of vectors: see wide.h. The including file defines EQUATIONS, the storage class of the functions
 * that equations.h declares. */
#include <string.h>

#include "arena.h"
#include "newton.h"

/* Point all arrays into memory, or only count their bytes. */
static inline size_t equations_place(struct equations *e, const struct sizes *s, void *memory) {
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

EQUATIONS size_t equations_bytes(const struct sizes *sizes) {
    struct equations counted;
    return equations_place(&counted, sizes, NULL);
}

EQUATIONS void equations_bind(struct equations *e, const struct sizes *sizes, const struct kernels *kernels,
                              void *memory) {
    e->of = WIDTH == 1 ? &kernel_behaviour : NULL;
    e->owner = NULL;
    e->kernels = *kernels;
    e->sizes = *sizes;
    e->finest = 0;
    e->n = sizes->n, e->m = sizes->m, e->extra = sizes->extra, e->dim = 2 * sizes->n + sizes->extra;
    e->bytes = equations_place(e, sizes, memory);
    e->account->weakest = e->account->worst = -1;
    e->account->soundness = INFINITY;
}

EQUATIONS void set_up_with(kernel setup, long parameters, wide *p) {
    if (setup != NULL)
        call(setup, NULL, NULL, NULL, p, NULL, p + parameters);
}

EQUATIONS void set_up(struct equations *e) {
    e->revision++;
    e->p[e->sizes.parameters + e->sizes.derived] = all(R(e->sizes.rank_tolerance));
    copy(e->p, e->sizes.parameters, e->tangent_p);
    set_up_with(e->kernels.setup, e->sizes.parameters, e->p);
    set_up_with(e->kernels.tangent_setup, e->sizes.parameters, e->tangent_p);
}

/* Call a kernel at a time and a state. */
static inline void call_at(const struct equations *e, kernel function, wide t, const wide *y, wide *work, wide *out) {
    call(function, &t, y, y + e->n, e->p, work, out);
}

EQUATIONS void solve_factored(struct equations *e, wide t, const wide *y, wide *b) {
    call_at(e, e->kernels.solve, t, y, e->factors, b);
}

EQUATIONS void accelerate(struct equations *e, wide t, const wide *y) {
    const long whole = e->n + e->m;
    call_at(e, e->kernels.accelerations, t, y, e->work, e->out);
    if (e->kernels.residual == NULL)
        return;
    for (int k = 0; k < REFINEMENTS; k++) {
        call_at(e, e->kernels.residual, t, y, e->out, e->rhs);
        call_at(e, e->kernels.solve, t, y, e->work, e->rhs);
        for (long i = 0; i < whole; i++)
            e->out[i] += e->rhs[i];
    }
}

/* Add to e->out the accelerations by which every constraint returns to zero like a critically damped oscillator of
 * rate r: Phi'' = -2 r Phi' - r^2 Phi (J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1, 1972, with alpha = beta =
 * r). */
static inline void pull_back(struct equations *e, wide t, const wide *y) {
    const long n = e->n, m = e->m;
    const real r = R(e->sizes.stabilisation);
    call_at(e, e->kernels.constraints, t, y, e->work, e->errors);
    call_at(e, e->kernels.velocity_constraints, t, y, e->work, e->rates);
    call_at(e, e->kernels.factor, t, y, e->factors, e->rhs);
    e->account->factorisations++;
    memset(e->rhs, 0, (size_t)n * sizeof(wide));
    for (long i = 0; i < m; i++)
        e->rhs[n + i] = -r * (R(2) * e->rates[i] + r * e->errors[i]);
    solve_factored(e, t, y, e->rhs);
    for (long i = 0; i < n + m; i++)
        e->out[i] += e->rhs[i];
}

/* Write dy/dt; with Baumgarte's terms if sizes.stabilisation is above zero. */
static inline void derivative(struct equations *e, wide t, const wide *y, wide *dy) {
    copy(y + e->n, e->n, dy);
    accelerate(e, t, y);
    if (e->sizes.stabilisation > 0.0 && e->m > 0)
        pull_back(e, t, y);
    copy_fresh(e->out, e->n, dy + e->n);
    if (e->extra) {
        call_at(e, e->kernels.energy, t, y, e->out, e->energies);
        dy[2 * e->n] = e->energies[2];
    }
    e->account->evaluations++;
}

/* Write the negative rows behind n zeros to e->rhs. Return the largest independent row over its scale in e->out, NaN if one
   is NaN; its number, in lanes that of any of them, and the largest other row of a single mechanism go into `found`. */
static inline wide largest_row(struct equations *e, const wide *rows, struct account *found) {
    const long n = e->n, m = e->m;
    wide largest = all(0);
    found->worst = -1, found->missed = 0;
    memset(e->rhs, 0, (size_t)n * sizeof(wide));
    for (long i = 0; i < m; i++) {
        const wide error = magnitude(rows[i]) / e->out[m + i];
        const mask within = (error <= largest) | (largest != largest);
        e->rhs[n + i] = -rows[i];
        if (e->dropped[i]) {
            found->missed = fmax(found->missed, (double)number_of(error, 0));
        } else if (any(~within)) {
            largest = chosen(within, largest, error);
            found->worst = i;
        }
    }
    return largest;
}

EQUATIONS wide position_error(struct equations *e, wide t, const wide *y) {
    call_at(e, e->kernels.constraints, t, y, e->work, e->out);
    return largest_row(e, e->out, e->account);
}

EQUATIONS wide velocity_error(struct equations *e, wide t, const wide *y) {
    struct account rates;
    call_at(e, e->kernels.velocity_constraints, t, y, e->work, e->rates);
    return largest_row(e, e->rates, &rates);
}

/* Part of an unknown's pivot that remains after cancellation: the pivot over the sum of its terms of equal sign. That
   sum is zero only if the unknown is undetermined. */
static inline wide part_left(const struct equations *e, const wide *factors, long unknown) {
    const wide *pivot = factors + e->sizes.first_pivot + 2 * unknown;
    const real sign = unknown < e->n ? R(1) : R(-1);
    return chosen(pivot[1] != 0, sign * pivot[0] / magnitude(pivot[1]), all(0));
}

EQUATIONS wide size_of(const struct equations *e, const wide *y) {
    return larger(largest_in(y, e->n), largest_in(e->out + e->m, e->m));
}

EQUATIONS wide shortest_scale(const struct equations *e) {
    wide shortest = all(REAL_INFINITY);
    for (long i = 0; i < e->m; i++)
        shortest = smaller(shortest, e->out[e->m + i]);
    return shortest;
}

EQUATIONS wide correct_positions(void *of, struct newton *w) {
    const struct correction *c = of;
    struct equations *e = c->e;
    const long n = e->n;
    if (w->count) {
        copy_where(w->open, c->y, n, e->before);
        solve_factored(e, c->t_factor, c->y_factor, e->rhs);
        for (long i = 0; i < n; i++)
            c->y[i] = chosen(w->open, c->y[i] + e->rhs[i], c->y[i]);
        for (long i = 0; i < n && c->h != 0; i++)
            c->y[n + i] += e->rhs[i] / c->h;
    }
    const wide worst = position_error(e, c->t, c->y);
    if (!w->count)
        w->size = size_of(e, c->y);
    return worst;
}

/* Project the positions of y in the open lanes with the last factor; return the lanes that come onto the constraints, and
   leave the last errors in `w`. */
static inline mask closed_positions(struct equations *e, mask open, wide t, wide *y, struct newton *w) {
    struct correction c = {.e = e, .t_factor = t, .y_factor = y, .t = t, .y = y};
    *w = (struct newton){
        .most = PROJECTIONS, .close = all(REAL_EPSILON), .rounded = all(ROUND_OFF), .grows = R(0.5),
    };
    const mask closed = newton_solve(w, open, correct_positions, &c);
    if (any(w->worse)) {
        copy_where(w->worse, e->before, e->n, y);
        position_error(e, t, y);
    }
    return closed;
}

/* Constraint rates at which a projection ends: roundings of a speed, if the run's tolerance is far above them. Without a
   tolerance, and near a loss of rank, which magnifies rates, iterations continue as long as each halves them. */
static inline wide rounding_of_rates(const struct equations *e, wide speed) {
    const wide rounding = REAL_EPSILON * speed;
    if (e->account->soundness < NEAR)
        return all(0);
    return chosen(rounding < all(R(RATES_LEFT) * R(e->finest)), rounding, all(0));
}

/* Correct the velocities of y in the open lanes with the last factor, RATE_PROJECTIONS times at most, until the constraint
   rates are rounding or are not half of those before, which are left in `before`. Return the lanes that took all
   corrections; those with rates that are not finite are removed from `finite`. */
static inline mask corrected_velocities(struct equations *e, mask open, wide t, wide *y, wide rounding, wide *before,
                                        mask *finite) {
    const long n = e->n;
    for (int k = 0; k < RATE_PROJECTIONS && any(open); k++) {
        const wide rate = velocity_error(e, t, y);
        *finite &= ~open | is_finite(rate);
        open &= (rate > rounding) & (rate <= R(0.5) * *before) & *finite;
        *before = chosen(open, rate, *before);
        if (!any(open))
            break;
        solve_factored(e, t, y, e->rhs);
        for (long i = n; i < 2 * n; i++)
            y[i] = chosen(open, y[i] + e->rhs[i - n], y[i]);
    }
    return open;
}

static inline void measure_energy(struct equations *e, wide t, const wide *y) {
    call_at(e, e->kernels.energy, t, y, e->work, e->energies);
}
