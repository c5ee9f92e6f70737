#include "variations.h"

#include <string.h>

#include "arena.h"
#include "lanes.h"
#include "linear.h"
#include "tableau.h"

static size_t place(struct variations *v, const struct equations *e, void *memory) {
    const struct variation_sizes *s = &v->sizes;
    const ptrdiff_t n = e->n, whole = e->n + e->m, stages = v->scheme.counts[SOLUTION_STAGES], k = s->columns;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(v->p, s->parameters + s->derived + 1),
        ARENA_ARRAY(v->work, s->work + whole + 1),
        ARENA_ARRAY(v->out, s->out + 1),
        ARENA_ARRAY(v->still, whole),
        ARENA_ARRAY(v->rates, stages * 2 * n),
        ARENA_ARRAY(v->state, 2 * n),
        ARENA_ARRAY(v->moved, 2 * n * k),
        ARENA_ARRAY(v->by_stage, 2 * n * k),
        ARENA_ARRAY(v->turned, stages * 2 * n * k),
        ARENA_ARRAY(v->right, whole * k),
        ARENA_ARRAY(v->solved, whole * k),
        ARENA_ARRAY(v->inverse, whole * whole),
        ARENA_ARRAY(v->sums, s->integrals + 1),
        ARENA_ARRAY(v->summed, s->integrals * k + 1),
        ARENA_ARRAY(v->seed, 2 * n),
        ARENA_ARRAY(v->weights, s->integrals + 1),
        ARENA_ARRAY(v->gradient, k + 1),
        ARENA_ARRAY(v->states, stages * 2 * n),
        ARENA_ARRAY(v->solutions, stages * whole),
        ARENA_ARRAY(v->factors, stages * (e->sizes.work + 1)),
        ARENA_ARRAY(v->back, stages * 2 * n),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes_of(const struct equations *e, const struct scheme *scheme, const struct variation_sizes *sizes) {
    struct variations counted = {.scheme = *scheme, .sizes = *sizes};
    return place(&counted, e, NULL);
}

static void bind(struct variations *v, struct equations *e, const struct scheme *scheme,
                 const struct variation_sizes *sizes, const struct variation_kernels *kernels, void *memory) {
    v->e = e, v->scheme = *scheme, v->sizes = *sizes, v->kernels = *kernels;
    place(v, e, memory);
}

/* Take the parameters of the equations with the references of a step. */
static void begin_step(struct variations *v, const double *references) {
    struct equations *e = v->e;
    real *of = references_of_angles(e);
    for (long i = 0; i < e->sizes.windings; i++)
        of[i] = R(references[i]);
    if (e->sizes.windings)
        set_up(e);
    memcpy(v->p, e->p, (size_t)v->sizes.parameters * sizeof(real));
    set_up_with(v->kernels.setup, v->sizes.parameters, v->p);
    v->p[v->sizes.parameters + v->sizes.derived] = R(e->sizes.rank_tolerance);
}

/* Leave the results of a kernel, at the w given, in v->out. */
static void call(struct variations *v, kernel of, real t, const real *y, const real *w) {
    struct equations *e = v->e;
    memcpy(v->work, w, (size_t)(e->n + e->m) * sizeof(real));
    of(&t, y, y + e->n, v->p, v->work, v->out);
}

/* Rows of `to` += factor times the slopes in v->out along the directions: of (q, u) that change by `moved`, and of w by
 * `turned`. */
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

/* The transpose of that: add the slopes times a seed of their rows to those of (q, u), of w and of the directions. */
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

/* Where there are fewer rows of solutions than columns: write these rows of the inverse of [M J^T; J 0], which is
 * symmetric, from a factorisation. */
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

/* Leave in v->solved the first rows of the solutions of [M J^T; J 0] x = v->right, whose rows before `first` are zero,
 * after `invert` for the same. */
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

/* out = base + h times the rows of the stages before s by their coefficients, many of which are zero. */
static void add_stages(const struct tableau *x, long s, real h, const real *base, const real *rows, long dim, real *out) {
    memcpy(out, base, (size_t)dim * sizeof(real));
    for (long j = 0; j < s; j++)
        if (x->a[s * x->all + j] != 0)
            add_multiple(dim, h * x->a[s * x->all + j], rows + j * dim, out);
}

/* Evaluate a stage: leave its dy/dt in v->rates, w in e->out and the factorisation in e->work. */
static void evaluate(struct variations *v, long s, real t, const real *state) {
    struct equations *e = v->e;
    real *rate = v->rates + s * 2 * e->n;
    accelerate(e, t, state);
    memcpy(rate, state + e->n, (size_t)e->n * sizeof(real));
    memcpy(rate + e->n, e->out, (size_t)e->n * sizeof(real));
}

/* Project v->moved onto the tangent space of the constraints at y. */
static int close_tangents(struct variations *v, real t, const real *y) {
    struct equations *e = v->e;
    const ptrdiff_t k = v->sizes.columns, n = e->n;
    int status = factorise(e, t, y);
    if (status != DONE)
        return status;
    call(v, v->kernels.closing, t, y, v->still);
    invert(v, t, y, e->factors, n);
    for (int rates = 0; rates < 2; rates++) {
        memset(v->right, 0, (size_t)((n + e->m) * k) * sizeof(real));
        add_slopes(v, rates ? OF_RATES : OF_PLACES, R(-1), v->moved, NULL, v->right + n * k);
        solve_columns(v, t, y, e->factors, n, n);
        add_multiple(n * k, R(1), v->solved, v->moved + (rates ? n * k : 0));
    }
    return DONE;
}

static int forward_step(struct variations *v, real t, real h, const real *y, const real *y_new) {
    struct equations *e = v->e;
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t n = e->n, k = v->sizes.columns, row = 2 * n * k, rows = v->sizes.integrals ? n + e->m : n;
    memset(v->solved, 0, (size_t)((n + e->m) * k) * sizeof(real));
    for (long s = 0; s < x.stages; s++) {
        const real t_s = t + x.c[s] * h;
        real *turned = v->turned + s * row;
        add_stages(&x, s, h, y, v->rates, 2 * n, v->state);
        add_stages(&x, s, h, v->moved, v->turned, row, v->by_stage);
        evaluate(v, s, t_s, v->state);
        if (v->kernels.stage != NULL) {
            memset(v->right, 0, (size_t)((n + e->m) * k) * sizeof(real));
            call(v, v->kernels.stage, t_s, v->state, e->out);
            add_slopes(v, OF_RESIDUAL, R(1), v->by_stage, NULL, v->right);
            invert(v, t_s, v->state, e->work, rows);
            solve_columns(v, t_s, v->state, e->work, rows, 0);
        }
        memcpy(turned, v->by_stage + n * k, (size_t)(n * k) * sizeof(real));
        memcpy(turned + n * k, v->solved, (size_t)(n * k) * sizeof(real));
        if (v->sizes.integrals && x.b[s] != 0) {
            call(v, v->kernels.integrands, t_s, v->state, e->out);
            add_multiple(v->sizes.integrals, h * x.b[s], v->out, v->sums);
            if (v->kernels.integrand_slopes != NULL) {
                call(v, v->kernels.integrand_slopes, t_s, v->state, e->out);
                add_slopes(v, OF_INTEGRANDS, h * x.b[s], v->by_stage, v->solved, v->summed);
            }
        }
    }
    for (long s = 0; s < x.stages; s++)
        if (x.b[s] != 0)
            add_multiple(row, h * x.b[s], v->turned + s * row, v->moved);
    int status = e->m ? close_tangents(v, t + h, y_new) : DONE;
    if (status != DONE)
        return status;
    const ptrdiff_t integrals = v->sizes.integrals;
    return all_finite(v->moved, row) && all_finite(v->sums, integrals) && all_finite(v->summed, integrals * k)
               ? DONE
               : NOT_FINITE;
}

/* The transpose of close_tangents. */
static int open_seed(struct variations *v, real t, const real *y) {
    struct equations *e = v->e;
    const long n = e->n;
    int status = factorise(e, t, y);
    if (status != DONE)
        return status;
    call(v, v->kernels.closing, t, y, v->still);
    for (int rates = 1; rates >= 0; rates--) {
        memcpy(e->rhs, v->seed + (rates ? n : 0), (size_t)n * sizeof(real));
        memset(e->rhs + n, 0, (size_t)e->m * sizeof(real));
        solve_factored(e, t, y, e->rhs);
        add_transposed(v, rates ? OF_RATES : OF_PLACES, R(-1), e->rhs + n, v->seed, NULL, v->gradient);
    }
    return DONE;
}

static int backward_step(struct variations *v, real t, real h, const real *y, const real *y_new) {
    struct equations *e = v->e;
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t n = e->n, states = 2 * n, whole = n + e->m, work = e->sizes.work;
    int status = e->m ? open_seed(v, t + h, y_new) : DONE;
    if (status != DONE)
        return status;
    for (long s = 0; s < x.stages; s++) {
        add_stages(&x, s, h, y, v->rates, states, v->states + s * states);
        evaluate(v, s, t + x.c[s] * h, v->states + s * states);
        memcpy(v->solutions + s * whole, e->out, (size_t)whole * sizeof(real));
        memcpy(v->factors + s * (work + 1), e->work, (size_t)work * sizeof(real));
    }
    for (long s = x.stages - 1; s >= 0; s--) {
        const real t_s = t + x.c[s] * h, *state = v->states + s * states, *w = v->solutions + s * whole;
        real *back = v->back + s * states, *from = v->state;
        for (ptrdiff_t i = 0; i < states; i++)
            from[i] = h * x.b[s] * v->seed[i];
        for (long j = s + 1; j < x.stages; j++)
            if (x.a[j * x.all + s] != 0)
                add_multiple(states, h * x.a[j * x.all + s], v->back + j * states, from);
        memset(back, 0, (size_t)states * sizeof(real));
        memcpy(back + n, from, (size_t)n * sizeof(real));
        memcpy(e->rhs, from + n, (size_t)n * sizeof(real));
        memset(e->rhs + n, 0, (size_t)e->m * sizeof(real));
        if (v->kernels.integrand_slopes != NULL && x.b[s] != 0) {
            call(v, v->kernels.integrand_slopes, t_s, state, w);
            add_transposed(v, OF_INTEGRANDS, h * x.b[s], v->weights, back, e->rhs, v->gradient);
        }
        if (v->kernels.stage != NULL) {
            e->kernels.solve(&t_s, state, state + n, e->p, v->factors + s * (work + 1), e->rhs);
            call(v, v->kernels.stage, t_s, state, w);
            add_transposed(v, OF_RESIDUAL, R(1), e->rhs, back, NULL, v->gradient);
        }
    }
    for (long s = 0; s < x.stages; s++)
        add_multiple(states, R(1), v->back + s * states, v->seed);
    return all_finite(v->seed, states) && all_finite(v->gradient, v->sizes.columns) ? DONE : NOT_FINITE;
}

static int forward(struct variations *v, long steps, const double *t, const void *y, const double *references,
                   long *taken) {
    const real *row = y;
    int status = DONE;
    for (*taken = 0; *taken < steps && status == DONE; ++*taken, row += 2 * v->e->n) {
        const double *now = t + *taken;
        begin_step(v, references + *taken * v->e->sizes.windings);
        status = forward_step(v, R(now[0]), R(now[1]) - R(now[0]), row, row + 2 * v->e->n);
    }
    return status;
}

static int backward(struct variations *v, long steps, const double *t, const void *y, const double *references,
                    long *taken) {
    int status = DONE;
    for (*taken = 0; *taken < steps && status == DONE; ++*taken) {
        const long i = steps - 1 - *taken;
        const real *row = (const real *)y + i * 2 * v->e->n;
        begin_step(v, references + i * v->e->sizes.windings);
        status = backward_step(v, R(t[i]), R(t[i + 1]) - R(t[i]), row, row + 2 * v->e->n);
    }
    return status;
}

const struct variation_api symgen_variations = {sizeof(struct variations), bytes_of, bind, forward, backward};
