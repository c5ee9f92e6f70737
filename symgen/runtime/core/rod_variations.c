/* Derivatives of runs of linkages of points and links. With the residual R(q, u, p; w) of the equations of motion and its
 * solution w = (a, lambda),
 *
 *     [M J^T; J 0] dw = R_q dq + R_u du + R_p dp
 *
 * at every stage, with the factorisation of its accelerations. The projection at the end of a step is
 * differentiated as the mass-weighted one. */
#include <string.h>

#include "arena.h"
#include "lanes.h"
#include "linear.h"
#include "tableau.h"
#include "variations.h"

static size_t place(struct variations *v, const struct equations *e, void *memory) {
    const struct variation_sizes *s = &v->sizes;
    const ptrdiff_t whole = e->n + e->m, stages = stages_of(v), k = s->columns;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(v->p, s->parameters + s->derived + 1),
        ARENA_ARRAY(v->work, s->work + whole + 1),
        ARENA_ARRAY(v->out, s->out + 1),
        ARENA_ARRAY(v->still, whole),
        ARENA_ARRAY(v->right, whole * k),
        ARENA_ARRAY(v->inverse, whole * whole),
        ARENA_ARRAY(v->solutions, stages * whole),
        ARENA_ARRAY(v->factors, stages * (e->sizes.work + 1)),
    };
    return ARENA_PLACE(arrays, memory);
}

static void begin(struct variations *v) {
    memcpy(v->p, v->e->p, (size_t)v->sizes.parameters * sizeof(real));
    set_up_with(v->kernels.setup, v->sizes.parameters, v->p);
    v->p[v->sizes.parameters + v->sizes.derived] = R(v->e->sizes.rank_tolerance);
}

/* Write the results of a kernel, with (a, lambda) = w, to v->out. */
static void call_along(struct variations *v, kernel of, real t, const real *y, const real *w) {
    struct equations *e = v->e;
    memcpy(v->work, w, (size_t)(e->n + e->m) * sizeof(real));
    of(&t, y, y + e->n, v->p, v->work, v->out);
}

/* Add to the rows of `to` factor times the derivatives along the directions, by the slopes in v->out: (q, u) change
   by `moved`, w by `turned`. */
LANES static void add_slopes(const struct variations *v, enum slopes_of of, real factor, const real *restrict moved,
                             const real *restrict turned, real *restrict to) {
    const ptrdiff_t k = v->sizes.columns, states = 2 * v->e->n, all = states + v->e->n + v->e->m;
    const long *entry = v->sizes.places[of];
    for (ptrdiff_t i = 0; i < v->sizes.entries[of]; i++, entry += 3) {
        const real slope = factor * v->out[entry[2]];
        real *row = to + entry[0] * k;
        if (entry[1] >= all) {
            row[entry[1] - all] += slope;
            continue;
        }
        const real *by = entry[1] < states ? moved + entry[1] * k : turned + (entry[1] - states) * k;
        for (ptrdiff_t j = 0; j < k; j++)
            row[j] += slope * by[j];
    }
}

/* The transpose of add_slopes: add the slopes times a seed of their rows to the seeds of (q, u), w and the
   directions. */
static void add_transposed(const struct variations *v, enum slopes_of of, real factor, const real *seed, real *to_state,
                           real *to_solution, real *to_directions) {
    const ptrdiff_t states = 2 * v->e->n, all = states + v->e->n + v->e->m;
    const long *entry = v->sizes.places[of];
    for (ptrdiff_t i = 0; i < v->sizes.entries[of]; i++, entry += 3) {
        const real slope = factor * v->out[entry[2]] * seed[entry[0]];
        if (entry[1] >= all)
            to_directions[entry[1] - all] += slope;
        else if (entry[1] < states)
            to_state[entry[1]] += slope;
        else if (to_solution != NULL)
            to_solution[entry[1] - states] += slope;
    }
}

/* If the solutions have fewer rows than columns: write these rows of the symmetric inverse of [M J^T; J 0] from a
   factorisation. */
static void invert(struct variations *v, real t, const real *y, real *factors, ptrdiff_t rows) {
    struct equations *e = v->e;
    const ptrdiff_t whole = e->n + e->m;
    if (rows >= v->sizes.columns)
        return;
    memset(v->inverse, 0, (size_t)(rows * whole) * sizeof(real));
    for (ptrdiff_t i = 0; i < rows; i++) {
        v->inverse[i * whole + i] = 1;
        e->kernels.solve(&t, y, y + e->n, e->p, factors, v->inverse + i * whole);
    }
}

/* Write to v->solved the first rows of the solutions of [M J^T; J 0] x = v->right, whose rows before `first` are
   zero. Call `invert` with the same arguments before. */
static void solve_columns(struct variations *v, real t, const real *y, real *factors, ptrdiff_t rows, ptrdiff_t first) {
    struct equations *e = v->e;
    const ptrdiff_t k = v->sizes.columns, whole = e->n + e->m;
    if (rows < k) {
        multiply_dense(rows, whole - first, k, v->inverse + first, whole, v->right + first * k, v->solved);
        return;
    }
    for (ptrdiff_t j = 0; j < k; j++) {
        for (ptrdiff_t i = 0; i < whole; i++)
            e->rhs[i] = v->right[i * k + j];
        e->kernels.solve(&t, y, y + e->n, e->p, factors, e->rhs);
        for (ptrdiff_t i = 0; i < rows; i++)
            v->solved[i * k + j] = e->rhs[i];
    }
}

static void stage(struct variations *v, real t, const real *state) {
    struct equations *e = v->e;
    const ptrdiff_t n = e->n, k = v->sizes.columns, rows = v->sizes.integrals ? n + e->m : n;
    if (v->kernels.stage == NULL) {
        memset(v->solved, 0, (size_t)((n + e->m) * k) * sizeof(real));
        return;
    }
    memset(v->right, 0, (size_t)((n + e->m) * k) * sizeof(real));
    call_along(v, v->kernels.stage, t, state, e->out);
    add_slopes(v, OF_RESIDUAL, R(1), v->by_stage, NULL, v->right);
    invert(v, t, state, e->work, rows);
    solve_columns(v, t, state, e->work, rows, 0);
}

static void integrate(struct variations *v, real t, const real *state, real weight) {
    call_along(v, v->kernels.integrands, t, state, v->e->out);
    add_multiple(v->sizes.integrals, weight, v->out, v->sums);
    if (v->kernels.integrand_slopes != NULL) {
        call_along(v, v->kernels.integrand_slopes, t, state, v->e->out);
        add_slopes(v, OF_INTEGRANDS, weight, v->by_stage, v->solved, v->summed);
    }
}

static int close_tangents(struct variations *v, real t, const real *y, real *moved) {
    struct equations *e = v->e;
    const ptrdiff_t k = v->sizes.columns, n = e->n;
    int status = factorise(e, t, y);
    if (status != DONE)
        return status;
    call_along(v, v->kernels.closing, t, y, v->still);
    invert(v, t, y, e->factors, n);
    for (int rates = 0; rates < 2; rates++) {
        memset(v->right, 0, (size_t)((n + e->m) * k) * sizeof(real));
        add_slopes(v, rates ? OF_RATES : OF_PLACES, R(-1), moved, NULL, v->right + n * k);
        solve_columns(v, t, y, e->factors, n, n);
        add_multiple(n * k, R(1), v->solved, moved + (rates ? n * k : 0));
    }
    return DONE;
}

/* The transpose of close_tangents. */
static int open_seed(struct variations *v, real t, const real *y, real *seed) {
    struct equations *e = v->e;
    const long n = e->n;
    int status = factorise(e, t, y);
    if (status != DONE)
        return status;
    call_along(v, v->kernels.closing, t, y, v->still);
    for (int rates = 1; rates >= 0; rates--) {
        memcpy(e->rhs, seed + (rates ? n : 0), (size_t)n * sizeof(real));
        memset(e->rhs + n, 0, (size_t)e->m * sizeof(real));
        solve_factored(e, t, y, e->rhs);
        add_transposed(v, rates ? OF_RATES : OF_PLACES, R(-1), e->rhs + n, seed, NULL, v->gradient);
    }
    return DONE;
}

static void keep(struct variations *v, long s, real t, const real *state) {
    const struct equations *e = v->e;
    const ptrdiff_t whole = e->n + e->m, work = e->sizes.work;
    (void)t, (void)state;
    memcpy(v->solutions + s * whole, e->out, (size_t)whole * sizeof(real));
    memcpy(v->factors + s * (work + 1), e->work, (size_t)work * sizeof(real));
}

static void stage_back(struct variations *v, long s, real t, const real *seed, real weight, real *back) {
    struct equations *e = v->e;
    const ptrdiff_t n = e->n;
    const real *state = v->states + s * 2 * n, *w = v->solutions + s * (n + e->m);
    memcpy(e->rhs, seed + n, (size_t)n * sizeof(real));
    memset(e->rhs + n, 0, (size_t)e->m * sizeof(real));
    if (v->kernels.integrand_slopes != NULL && weight != 0) {
        call_along(v, v->kernels.integrand_slopes, t, state, w);
        add_transposed(v, OF_INTEGRANDS, weight, v->weights, back, e->rhs, v->gradient);
    }
    if (v->kernels.stage != NULL) {
        e->kernels.solve(&t, state, state + n, e->p, v->factors + s * (e->sizes.work + 1), e->rhs);
        call_along(v, v->kernels.stage, t, state, w);
        add_transposed(v, OF_RESIDUAL, R(1), e->rhs, back, NULL, v->gradient);
    }
}

const struct variation_behaviour rod_variations = {
    .place = place,
    .begin = begin,
    .stage = stage,
    .integrate = integrate,
    .close = close_tangents,
    .keep = keep,
    .stage_back = stage_back,
    .open = open_seed,
};
