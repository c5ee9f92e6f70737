#include "variations.h"

#include <string.h>

#include "arena.h"
#include "linear.h"
#include "tableau.h"

extern const struct variation_behaviour rod_variations, loop_variations;

static size_t place(struct variations *v, const struct equations *e, void *memory) {
    const struct variation_sizes *s = &v->sizes;
    const ptrdiff_t n = e->n, stages = stages_of(v), k = s->columns;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(v->rates, stages * 2 * n),
        ARENA_ARRAY(v->state, 2 * n),
        ARENA_ARRAY(v->moved, 2 * n * k),
        ARENA_ARRAY(v->by_stage, 2 * n * k),
        ARENA_ARRAY(v->turned, stages * 2 * n * k),
        ARENA_ARRAY(v->solved, (n + e->m) * k),
        ARENA_ARRAY(v->sums, s->integrals + 1),
        ARENA_ARRAY(v->summed, s->integrals * k + 1),
        ARENA_ARRAY(v->seed, 2 * n),
        ARENA_ARRAY(v->weights, s->integrals + 1),
        ARENA_ARRAY(v->gradient, k + 1),
        ARENA_ARRAY(v->states, stages * 2 * n),
        ARENA_ARRAY(v->back, stages * 2 * n),
    };
    char *at = memory;
    size_t bytes = ARENA_PLACE(arrays, at);
    bytes += v->of->place(v, e, at == NULL ? NULL : at + bytes);
    return is_explicit(v) ? bytes : bytes + implicit_place(v, e, at == NULL ? NULL : at + bytes);
}

static size_t bytes_of(const struct variation_behaviour *of, const struct equations *e, const struct scheme *scheme,
                       const struct variation_sizes *sizes) {
    struct variations counted = {.of = of, .e = (struct equations *)e, .scheme = *scheme, .sizes = *sizes};
    return place(&counted, e, NULL);
}

static void bind(struct variations *v, const struct variation_behaviour *of, struct equations *e,
                 const struct scheme *scheme, const struct variation_sizes *sizes,
                 const struct variation_kernels *kernels, void *memory) {
    v->of = of, v->e = e, v->scheme = *scheme, v->sizes = *sizes, v->kernels = *kernels;
    place(v, e, memory);
}

/* Set the parameters, with the references and branches of a step. */
static void begin_step(struct variations *v, const double *references) {
    struct equations *e = v->e;
    real *of = references_of_angles(e);
    const long held = held_parameters(&e->sizes);
    for (long i = 0; i < held; i++)
        of[i] = R(references[i]);
    if (held)
        set_up(e);
    v->of->begin(v);
}

/* out += h times the sum of the rows of stages by their weights, many of which are zero. */
static void add_weighted(const real *weights, long count, real h, const real *rows, ptrdiff_t dim, real *out) {
    for (long j = 0; j < count; j++)
        if (weights[j] != 0)
            add_multiple(dim, h * weights[j], rows + j * dim, out);
}

/* out = base + the same of the stages before s. */
static void add_stages(const struct tableau *x, long s, real h, const real *base, const real *rows, long dim, real *out) {
    memcpy(out, base, (size_t)dim * sizeof(real));
    add_weighted(x->a + s * x->all, s, h, rows, dim, out);
}

void variations_evaluate(struct variations *v, long s, real t, const real *state) {
    struct equations *e = v->e;
    real *rate = v->rates + s * 2 * e->n;
    e->of->accelerate(e, t, state);
    memcpy(rate, state + e->n, (size_t)e->n * sizeof(real));
    memcpy(rate + e->n, e->out, (size_t)e->n * sizeof(real));
}

/* Whether the stages of a step from y are projected, as those of the run are near a loss of rank. */
static int are_projected(struct variations *v, real t, const real *y) {
    struct equations *e = v->e;
    return e->m && e->of->factorise(e, t, y) == DONE && e->account->soundness < NEAR;
}

/* Write the state of stage s of a step; return whether it is projected. */
static int reach_stage(struct variations *v, const struct tableau *x, long s, real t, real h, const real *y,
                       int projected, real *state) {
    struct equations *e = v->e;
    const ptrdiff_t states = 2 * e->n;
    add_stages(x, s, h, y, v->rates, states, state);
    if (s == 0 || !projected)
        return 0;
    memcpy(v->back, state, (size_t)states * sizeof(real));
    if (e->of->project(e, t + x->c[s] * h, state) == DONE)
        return 1;
    memcpy(state, v->back, (size_t)states * sizeof(real));
    return 0;
}

static void explicit_step(struct variations *v, real t, real h, const real *y) {
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, row = 2 * n * k;
    const int projected = are_projected(v, t, y);
    for (long s = 0; s < x.stages; s++) {
        const real t_s = t + x.c[s] * h;
        real *turned = v->turned + s * row;
        const int closes = reach_stage(v, &x, s, t, h, y, projected, v->state);
        add_stages(&x, s, h, v->moved, v->turned, row, v->by_stage);
        if (closes)
            v->of->close(v, t_s, v->state, v->by_stage);
        variations_evaluate(v, s, t_s, v->state);
        v->of->stage(v, t_s, v->state);
        memcpy(turned, v->by_stage + n * k, (size_t)(n * k) * sizeof(real));
        memcpy(turned + n * k, v->solved, (size_t)(n * k) * sizeof(real));
        if (v->sizes.integrals && x.b[s] != 0)
            v->of->integrate(v, t_s, v->state, h * x.b[s]);
    }
    add_weighted(x.b, x.stages, h, v->turned, row, v->moved);
}

static int forward_step(struct variations *v, int begins, real t, real h, const real *y, const real *y_new) {
    const ptrdiff_t k = v->sizes.columns, integrals = v->sizes.integrals;
    int status = DONE;
    if (is_explicit(v))
        explicit_step(v, t, h, y);
    else
        status = implicit_step(v, begins, t, h, y, y_new);
    if (status == DONE && v->e->m)
        status = v->of->close(v, t + h, y_new, v->moved);
    if (status != DONE)
        return status;
    return all_finite(v->moved, 2 * v->e->n * k) && all_finite(v->sums, integrals) && all_finite(v->summed, integrals * k)
               ? DONE
               : NOT_FINITE;
}

static int backward_step(struct variations *v, real t, real h, const real *y, const real *y_new) {
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t n = v->e->n, states = 2 * n;
    int closes[MOST_STAGES], status = v->e->m ? v->of->open(v, t + h, y_new, v->seed) : DONE;
    if (status != DONE)
        return status;
    const int projected = are_projected(v, t, y);
    for (long s = 0; s < x.stages; s++) {
        real *state = v->states + s * states;
        closes[s] = reach_stage(v, &x, s, t, h, y, projected, state);
        variations_evaluate(v, s, t + x.c[s] * h, state);
        v->of->keep(v, s, t + x.c[s] * h, state);
    }
    for (long s = x.stages - 1; s >= 0; s--) {
        real *back = v->back + s * states, *from = v->state;
        for (ptrdiff_t i = 0; i < states; i++)
            from[i] = h * x.b[s] * v->seed[i];
        for (long j = s + 1; j < x.stages; j++)
            if (x.a[j * x.all + s] != 0)
                add_multiple(states, h * x.a[j * x.all + s], v->back + j * states, from);
        memset(back, 0, (size_t)states * sizeof(real));
        memcpy(back + n, from, (size_t)n * sizeof(real));
        v->of->stage_back(v, s, t + x.c[s] * h, from, h * x.b[s], back);
        if (closes[s])
            v->of->open(v, t + x.c[s] * h, v->states + s * states, back);
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
        const real h = R(now[1]) - R(now[0]);
        begin_step(v, references + *taken * held_parameters(&v->e->sizes));
        status = forward_step(v, *taken == 0, R(now[0]), h, row, row + 2 * v->e->n);
    }
    return status;
}

static int backward(struct variations *v, long steps, const double *t, const void *y, const double *references,
                    long *taken) {
    int status = DONE;
    for (*taken = 0; *taken < steps && status == DONE; ++*taken) {
        const long i = steps - 1 - *taken;
        const real *row = (const real *)y + i * 2 * v->e->n;
        begin_step(v, references + i * held_parameters(&v->e->sizes));
        status = backward_step(v, R(t[i]), R(t[i + 1]) - R(t[i]), row, row + 2 * v->e->n);
    }
    return status;
}

/* Write the state at the end of a step whose stages have been evaluated. */
static void write_end(const struct variations *v, real h, const real *y, real *end) {
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t states = 2 * v->e->n;
    memcpy(end, y, (size_t)states * sizeof(real));
    add_weighted(x.b, x.stages, h, v->rates, states, end);
}

/* The error of one explicit step over the tolerance: of its end, and of a tangent by the estimates of the method. The
   tangent begins with changes of all coordinates and rates that the constraints allow, so that no motion about the run
   is left out. */
static int measure_error(struct variations *v, real t, real h, const real *y, const real *y_new, real rtol, real atol,
                         real *norm) {
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t n = v->e->n, states = 2 * n;
    real totals[MOST_ESTIMATES] = {0}, *end = v->state, *error = v->back;
    for (ptrdiff_t i = 0; i < states; i++) {
        const real uneven = R(0.618) * R(i), size = R(0.5) + uneven - R((long)uneven);
        v->moved[i] = (i % 2 ? -size : size) / (i < n ? R(1) : h);
    }
    const int status = v->e->m ? v->of->close(v, t, y, v->moved) : DONE;
    if (status != DONE)
        return status;
    explicit_step(v, t, h, y);
    write_end(v, h, y, end);
    *norm = 0;
    for (ptrdiff_t i = 0; i < states; i++) {
        const real tolerance = atol + rtol * real_fmax(real_fabs(y[i]), real_fabs(y_new[i]));
        *norm = real_fmax(*norm, real_fabs(end[i] - y_new[i]) / tolerance);
    }
    if (x.same_as_last) {
        memcpy(v->by_stage, v->moved, (size_t)states * sizeof(real));
        variations_evaluate(v, 0, t + h, end);
        v->of->stage(v, t + h, end);
    }
    for (long r = 0; r < x.rows; r++) {
        const real *weights = x.e + r * (x.stages + 1);
        memset(error, 0, (size_t)states * sizeof(real));
        add_weighted(weights, x.stages, h, v->turned, states, error);
        if (x.same_as_last) {
            add_multiple(n, h * weights[x.stages], v->moved + n, error);
            add_multiple(n, h * weights[x.stages], v->solved, error + n);
        }
        for (ptrdiff_t i = 0; i < states; i++) {
            const real part = error[i] * (i < n ? R(1) : h) / rtol;
            totals[r] += part * part;
        }
    }
    const real of_tangent = blended(x.rows, totals, states);
    *norm = real_fmax(*norm, of_tangent);
    return real_isfinite(of_tangent) ? DONE : NOT_FINITE;
}

static int count_parts(struct variations *v, long steps, const double *t, const void *y, const double *references,
                       double rtol, double atol, double *parts, long *taken) {
    const real *row = y, power = R(1) / R(v->scheme.error_order + 1), least = real_fmax(R(rtol), REAL_EPSILON);
    int status = DONE;
    for (*taken = 0; *taken < steps && status == DONE; ++*taken, row += 2 * v->e->n) {
        const real now = R(t[*taken]), h = R(t[*taken + 1]) - now;
        real norm = 0;
        if (h > 0 && parts[*taken] != 0) {
            begin_step(v, references + *taken * held_parameters(&v->e->sizes));
            status = measure_error(v, now, h, row, row + 2 * v->e->n, least, R(atol), &norm);
        }
        parts[*taken] = (double)real_pow(norm, power);
    }
    return status;
}

static void fill(struct variations *v, long steps, const double *t, void *y, const double *references,
                 const char *known) {
    const struct tableau x = tableau_of(&v->scheme);
    const ptrdiff_t states = 2 * v->e->n;
    real *row = y;
    for (long i = 0; i < steps; i++, row += states) {
        const real h = R(t[i + 1]) - R(t[i]);
        if (known[i + 1])
            continue;
        begin_step(v, references + i * held_parameters(&v->e->sizes));
        const int projected = are_projected(v, R(t[i]), row);
        for (long s = 0; s < x.stages; s++) {
            reach_stage(v, &x, s, R(t[i]), h, row, projected, v->state);
            variations_evaluate(v, s, R(t[i]) + x.c[s] * h, v->state);
        }
        write_end(v, h, row, row + states);
    }
}

const struct variation_api symgen_variations = {
    sizeof(struct variations), &rod_variations, &loop_variations, bytes_of, bind, forward, backward,
    count_parts, fill,
};
