/* Fixed implicit steps of elastic links: a kind of runs of `beam_behaviour`, with one linear system per step for all
 * columns of the state.
 *
 * Collocation has `stages`, with a and a a (stages squared), the weights b and b a, and the nodes c. Without stages, the
 * equation holds at the fraction `at` of the step, where S'' = inertia . (S''_0, S''_1), S' = S'_0 + h rate . (S''_0,
 * S''_1) and S = S_0 + at h S'_0 + h^2 place . (S''_0, S''_1); the step ends by Newmark's formulas with gamma and beta.
 *
 * Gear's method has `past` states, with which S' and S'' at the end of a step are the slopes of the polynomials through S and
 * S' there and at the last `past` states. The first steps are those of the collocation.
 */
#include <string.h>

#include "arena.h"
#include "beams.h"
#include "lanes.h"
#include "run.h"

/* Most past states of Gear's method: beyond, it is unstable for any equation. */
enum { MOST_PAST = 6 };

struct beam_steps {
    struct beams *b;
    long columns, stages; /* states of the batch, of which the first is loaded; stored stages, one or more */
    int collocated;
    long past;            /* states of Gear's method, with the present one; 0: another method */
    long *known;          /* number of those before the present one that are known */
    real *lengths;        /* of the present step, and of those between the present and the known states, backwards */
    real *before;         /* these states, backwards */
    real at, gamma, beta;
    const real *inertia, *rate, *place;
    const real *a, *aa, *weights, *weights_a, *nodes;
    real *by_rate, *by_place; /* weights of the accelerations at all stages in S' and S, a row for each stage */
    real *of_entry;           /* one entry of the matrices at all stages */
    real *mass, *damping, *stiffness, *load, *forces; /* one row per stage */
    /* The system of all stages: within each unknown, one entry per stage. Each damped mode adds an unknown, the rate
       f S' + g S. */
    struct bordered system;
    real *rhs;
    real *p, *pv, *pa; /* S, S', S'' of the independent unknowns, rows of `columns` */
    real *first;       /* those of the first column at a stage */
    real *f, *f_new;   /* S' and S'' of all unknowns at both ends; of collocation, S'' is the mean of the step */
};

/* The steps of equations by a scheme, collocated or not, with arrays in memory; with NULL their bytes are counted in
   `total`. */
static struct beam_steps place(const struct equations *e, const long *counts, const real *numbers, int collocated,
                               void *memory, size_t *total) {
    struct beams *b = e->owner;
    struct beam_steps steps = {.b = b, .columns = columns_of(e, b), .collocated = collocated, .past = counts[1]},
                      *x = &steps;
    const ptrdiff_t k = x->stages = x->collocated ? counts[0] : 1;
    const ptrdiff_t columns = x->columns, free = b->free, entries = b->entries;
    x->system.inner = b->inner * k;
    x->system.border = (b->border + b->modes) * k;
    x->system.band = b->system.band * k + k - 1;
    const struct arena_array arrays[] = {
        /* first what lasts from step to step, in the same place for steps of both kinds */
        ARENA_ARRAY(x->f, e->dim),
        ARENA_ARRAY(x->f_new, e->dim),
        ARENA_ARRAY(x->known, 1),
        ARENA_ARRAY(x->lengths, x->past),
        ARENA_ARRAY(x->before, x->past ? (x->past - 1) * e->dim : 0),
        ARENA_ARRAY(x->by_rate, k * k),
        ARENA_ARRAY(x->by_place, k * k),
        ARENA_ARRAY(x->of_entry, 3 * k),
        ARENA_ARRAY(x->mass, k * (entries + 1)),
        ARENA_ARRAY(x->damping, k * (entries + 1)),
        ARENA_ARRAY(x->stiffness, k * (entries + 1)),
        ARENA_ARRAY(x->load, k * (free + 1)),
        ARENA_ARRAY(x->forces, k * 2 * free * b->modes),
        ARENA_ARRAY(x->system.banded, (3 * x->system.band + 1) * x->system.inner),
        ARENA_ARRAY(x->system.right, x->system.inner * x->system.border),
        ARENA_ARRAY(x->system.below, x->system.inner * x->system.border),
        ARENA_ARRAY(x->system.corner, x->system.border * x->system.border),
        ARENA_ARRAY(x->system.panel, panel_size(x->system.border, x->system.band)),
        ARENA_ARRAY(x->rhs, (free + b->modes) * k * columns),
        ARENA_ARRAY(x->p, free * columns),
        ARENA_ARRAY(x->pv, free * columns),
        ARENA_ARRAY(x->pa, free * columns),
        ARENA_ARRAY(x->first, 3 * free),
        ARENA_ARRAY(x->system.pivots, x->system.inner),
        ARENA_ARRAY(x->system.swaps, x->system.border),
    };
    *total = ARENA_PLACE(arrays, memory);
    if (numbers == NULL)
        return steps;
    x->at = numbers[0], x->gamma = numbers[1], x->beta = numbers[2];
    x->inertia = numbers + 3, x->rate = x->inertia + 2, x->place = x->rate + 2;
    x->a = x->place + 2, x->aa = x->a + k * k, x->weights = x->aa + k * k, x->weights_a = x->weights + k;
    x->nodes = x->weights_a + k;
    return steps;
}

/* The present step of a run: of Gear's method it is collocated until all past states are known. */
static struct beam_steps steps_of(const struct run *run) {
    const long *counts = run->scheme.counts;
    size_t total;
    const struct beam_steps x = place(run->e, counts, run->scheme.numbers, counts[0] > 0, run->own, &total);
    if (x.past == 0 || *x.known < x.past - 1)
        return x;
    return place(run->e, counts, run->scheme.numbers, 0, run->own, &total);
}

static size_t bytes(const struct run *run, const long *counts) {
    size_t total;
    place(run->e, counts, NULL, counts[0] > 0, NULL, &total);
    return total;
}

static ptrdiff_t numbers(const long *counts) {
    const long k = counts[0], past = counts[1];
    if (k < 0 || k > MOST_STAGES || past < 0 || past > MOST_PAST || (past && k == 0))
        return -1;
    return 9 + 2 * k * k + 3 * k;
}

static void bind(struct run *run) {
    const struct beam_steps x = steps_of(run);
    run->f = x.f, run->f_new = x.f_new;
}

/* Select the independent unknowns; without stages find S''. States before are of another motion. */
static int begin(struct run *run) {
    struct beam_steps x = steps_of(run);
    struct equations *e = run->e;
    const size_t half = (size_t)e->n * sizeof(real);
    *x.known = 0;
    x = steps_of(run);
    if (!x.collocated) {
        e->of->derivative(e, run->state->t, run->y, x.f);
        return real_isfinite(x.f[e->n]) ? DONE : SINGULAR;
    }
    memcpy(x.f, run->y + e->n, half);
    memset(x.f + e->n, 0, half);
    return e->of->factorise(e, run->state->t, run->y);
}

/* Assemble at a time and store the matrices as a stage. */
static int keep_stage(struct beam_steps *x, long stage, real t) {
    const struct beams *b = x->b;
    const size_t entries = (size_t)b->entries * sizeof(real);
    const ptrdiff_t row = stage * (b->entries + 1);
    const int status = beams_assemble(x->b, t, 0);
    if (status != DONE)
        return status;
    memcpy(x->mass + row, b->mass, entries);
    memcpy(x->damping + row, b->damping, entries);
    memcpy(x->stiffness + row, b->stiffness, entries);
    memcpy(x->load + stage * (b->free + 1), b->load, (size_t)b->free * sizeof(real));
    const ptrdiff_t modal = 2 * b->free * b->modes;
    if (modal)
        memcpy(x->forces + stage * modal, b->forces, (size_t)modal * sizeof(real));
    return DONE;
}

/* Add the loads of tangents at all stages, by the accelerations of the first column. */
static int load_tangents(struct beam_steps *x, real t, real h) {
    struct beams *b = x->b;
    const long k = x->stages, columns = x->columns;
    const ptrdiff_t free = b->free, size = (free + b->modes) * k;
    real *p = x->first, *v = p + free, *a = v + free, times[MOST_STAGES + 1];
    for (long i = 0; i < k; i++)
        times[i] = t + (x->collocated ? x->nodes[i] : x->at) * h;
    times[k] = t + h;
    b->tangent->prepare(b->tangents, b, k + 1, times);
    for (long i = 0; i < k; i++) {
        const int status = k > 1 ? beams_assemble(b, times[i], 0) : DONE;
        if (status != DONE)
            return status;
        for (ptrdiff_t r = 0; r < free; r++) {
            const real *found = x->rhs + r * k, rate = x->pv[r * columns], old = x->collocated ? 0 : x->pa[r * columns];
            p[r] = x->p[r * columns] + (times[i] - t) * rate + h * h * x->place[0] * old;
            v[r] = rate + h * x->rate[0] * old;
            a[r] = x->inertia[0] * old + x->inertia[1] * found[i];
            for (long j = 0; j < k; j++) {
                p[r] += x->by_place[k * j + i] * found[j];
                v[r] += x->by_rate[k * j + i] * found[j];
            }
        }
        b->tangent->load(b, p, v, a, 1, x->rhs + i, size, k);
    }
    return DONE;
}

/* Solve the system for all columns of a step from t, in place. */
static int solve(struct beam_steps *x, real t, real h) {
    const int tangents = tangents_in(x->b, x->columns);
    if (!factor_bordered(&x->system))
        return SINGULAR;
    solve_bordered(&x->system, tangents ? 1 : x->columns, x->rhs);
    if (!tangents)
        return DONE;
    const int status = load_tangents(x, t, h);
    if (status == DONE)
        solve_bordered(&x->system, x->columns - 1, x->rhs + x->system.inner + x->system.border);
    return status;
}

/* Write the row and the column of a damped mode at stage i. Its unknown equals the rate f S' + g S; its force is f
   times the unknown. by_rate and by_place are the weights of the accelerations at all stages in S' and in S; without
   accelerations the state at the stage is S_0 + until S_0'. */
static void mode_in_system(struct beam_steps *x, ptrdiff_t mode, long i, const real *by_rate, const real *by_place,
                           real until) {
    const struct beams *b = x->b;
    const long k = x->stages, columns = x->columns;
    const ptrdiff_t free = b->free, size = (free + b->modes) * k, own = (free + mode) * k + i;
    const real *f = x->forces + 2 * free * (i * b->modes + mode), *g = f + free;
    set_in_border(&x->system, own, own, -1);
    for (ptrdiff_t q = 0; q < free; q++) {
        set_in_border(&x->system, q * k + i, own, f[q]);
        for (long j = 0; j < k; j++)
            set_in_border(&x->system, own, q * k + j, by_rate[k * j] * f[q] + by_place[k * j] * g[q]);
        for (long c = 0; c < columns; c++) {
            const real p = x->p[q * columns + c], v = x->pv[q * columns + c];
            x->rhs[c * size + own] -= f[q] * v + g[q] * (p + until * v);
        }
    }
}

/* Write the weights of the accelerations at all stages in S' and S at each stage; the weights of one stage are a
   column. */
static void weigh_stages(struct beam_steps *x, real h) {
    const long k = x->stages;
    for (long i = 0; i < k; i++)
        for (long j = 0; j < k; j++) {
            x->by_rate[k * j + i] = h * x->a[k * i + j];
            x->by_place[k * j + i] = h * h * x->aa[k * i + j];
        }
}

/* Write the coefficients of all entries at `k` stages; inlined where the compiler knows the number. */
static inline void entries_in_system(struct beam_steps *x, const long k) {
    const struct beams *b = x->b;
    const ptrdiff_t own = b->entries + 1;
    const struct band_store at = band_store(x->system.inner, x->system.band);
    real *damping = x->of_entry, *stiffness = damping + k, *values = stiffness + k;
    for (ptrdiff_t e = 0; e < b->entries; e++) {
        const ptrdiff_t row = b->rows[e] * k, column = b->columns[e] * k;
        const int inside = e < b->banded_entries;
        for (long i = 0; i < k; i++) {
            damping[i] = x->damping[i * own + e];
            stiffness[i] = x->stiffness[i * own + e];
        }
        for (long j = 0; j < k; j++) {
            const real *by_rate = x->by_rate + k * j, *by_place = x->by_place + k * j;
            real *restrict to = inside ? x->system.banded + at.first + row + (column + j) * at.lead : values;
            for (long i = 0; i < k; i++)
                to[i] = by_rate[i] * damping[i] + by_place[i] * stiffness[i];
            to[j] += x->mass[j * own + e];
            for (long i = 0; !inside && i < k; i++)
                set_in_border(&x->system, row + i, column + j, values[i]);
        }
    }
}

/* Write the coefficients of all entries at all stages. */
LANES static void system_of_stages(struct beam_steps *x) {
    switch (x->stages) {
    case 6:
        entries_in_system(x, 6);
        break;
    case 2:
        entries_in_system(x, 2);
        break;
    default:
        entries_in_system(x, x->stages);
    }
}

/* Write the system of the accelerations of a collocation; within each unknown, one entry per stage. */
static void collocation_system(struct beam_steps *x, real h) {
    const struct beams *b = x->b;
    const long k = x->stages, columns = x->columns;
    const ptrdiff_t size = (b->free + b->modes) * k;
    clear_bordered(&x->system);
    memset(x->rhs, 0, (size_t)(size * columns) * sizeof(real));
    weigh_stages(x, h);
    system_of_stages(x);
    for (long i = 0; i < k; i++) {
        const real *damping = x->damping + i * (b->entries + 1);
        const real *stiffness = x->stiffness + i * (b->entries + 1), until = x->nodes[i] * h;
        for (ptrdiff_t r = 0; r < b->free; r++)
            x->rhs[r * k + i] = x->load[i * (b->free + 1) + r];
        for (ptrdiff_t e = 0; e < b->entries; e++) {
            const ptrdiff_t q = b->columns[e], row = b->rows[e] * k + i;
            for (long c = 0; c < columns; c++) {
                const real p = x->p[q * columns + c], v = x->pv[q * columns + c];
                x->rhs[c * size + row] -= damping[e] * v + stiffness[e] * (p + until * v);
            }
        }
        for (ptrdiff_t mode = 0; mode < b->modes; mode++)
            mode_in_system(x, mode, i, x->by_rate + i, x->by_place + i, until);
    }
}

/* One step of collocation: accelerations at all stages from one system. */
static int collocate(struct beam_steps *x, real t, real h) {
    const long k = x->stages, columns = x->columns;
    const ptrdiff_t size = (x->b->free + x->b->modes) * k;
    for (long i = 0; i < k; i++) {
        const int status = keep_stage(x, i, t + x->nodes[i] * h);
        if (status != DONE)
            return status;
    }
    collocation_system(x, h);
    const int status = solve(x, t, h);
    if (status != DONE)
        return status;
    for (ptrdiff_t r = 0; r < x->b->free; r++)
        for (long c = 0; c < columns; c++) {
            const real *found = x->rhs + c * size + r * k;
            real *p = x->p + r * columns + c, *v = x->pv + r * columns + c;
            *p += h * *v;
            for (long j = 0; j < k; j++) {
                *p += h * h * x->weights_a[j] * found[j];
                *v += h * x->weights[j] * found[j];
            }
        }
    return DONE;
}

/* One step of a method with accelerations at both ends: Newmark's, generalized-alpha, Wilson's. */
static int step_once(struct beam_steps *x, real t, real h) {
    const struct beams *b = x->b;
    const long columns = x->columns;
    const ptrdiff_t free = b->free, size = free + b->modes;
    const struct band_store in = band_store(x->system.inner, x->system.band);
    const real at = x->at, gamma = x->gamma, beta = x->beta, half = R(0.5), *inertia = x->inertia;
    const real rate[] = {h * x->rate[0], h * x->rate[1]};
    const real place[] = {h * h * x->place[0], h * h * x->place[1]};
    int status = keep_stage(x, 0, t + at * h);
    if (status != DONE)
        return status;
    clear_bordered(&x->system);
    memset(x->rhs, 0, (size_t)(size * columns) * sizeof(real));
    memcpy(x->rhs, x->load, (size_t)free * sizeof(real));
    for (ptrdiff_t e = 0; e < b->entries; e++) {
        const ptrdiff_t r = b->rows[e], q = b->columns[e];
        const real mass = x->mass[e], damping = x->damping[e], stiffness = x->stiffness[e];
        const real value = inertia[1] * mass + rate[1] * damping + place[1] * stiffness;
        if (e < b->banded_entries)
            x->system.banded[in.first + r + q * in.lead] = value;
        else
            set_in_border(&x->system, r, q, value);
        for (long c = 0; c < columns; c++) {
            const real p = x->p[q * columns + c], v = x->pv[q * columns + c], old = x->pa[q * columns + c];
            x->rhs[c * size + r] -= inertia[0] * mass * old + damping * (v + rate[0] * old) +
                                    stiffness * (p + at * h * v + place[0] * old);
        }
    }
    for (ptrdiff_t mode = 0; mode < b->modes; mode++) {
        const real *f = x->forces + 2 * free * mode, *g = f + free;
        mode_in_system(x, mode, 0, rate + 1, place + 1, at * h);
        for (ptrdiff_t q = 0; q < free; q++)
            for (long c = 0; c < columns; c++)
                x->rhs[c * size + free + mode] -= (rate[0] * f[q] + place[0] * g[q]) * x->pa[q * columns + c];
    }
    x->by_rate[0] = rate[1], x->by_place[0] = place[1];
    status = solve(x, t, h);
    if (status != DONE)
        return status;
    for (ptrdiff_t r = 0; r < free; r++)
        for (long c = 0; c < columns; c++) {
            const ptrdiff_t k = r * columns + c;
            const real old = x->pa[k], new = x->rhs[c * size + r];
            x->p[k] += h * x->pv[k] + h * h * ((half - beta) * old + beta * new);
            x->pv[k] += h * ((1 - gamma) * old + gamma * new);
            x->pa[k] = new;
        }
    return DONE;
}

/* Write a state and weights with which step_once takes a step of Gear's method: S' = S'_past + r S'' and S = S_past + r S',
   with r and the weights of past states from the slope of the polynomial through them and the end of the step (C. W. Gear,
   Numerical Initial Value Problems in Ordinary Differential Equations, 1971; here for steps of any lengths). */
static void from_past(struct beam_steps *x, const struct run *run, real h, real weights[4], real *state) {
    const long past = x->past, n = run->e->n;
    real ago[MOST_PAST], slope = 0;
    x->lengths[0] = h;
    for (long j = 0; j < past; j++) {
        ago[j] = x->lengths[j] + (j ? ago[j - 1] : 0);
        slope += 1 / ago[j];
    }
    memset(state, 0, (size_t)run->dim * sizeof(real));
    memset(run->error, 0, (size_t)n * sizeof(real));
    for (long j = 0; j < past; j++) {
        const real *y = j ? x->before + (j - 1) * run->dim : run->y;
        real weight = 1 / (slope * ago[j]);
        for (long i = 0; i < past; i++)
            if (i != j)
                weight *= ago[i] / (ago[i] - ago[j]);
        for (long i = 0; i < 2 * n; i++)
            state[i] += weight * y[i];
    }
    const real part = 1 / (slope * h);
    for (long i = 0; i < n; i++) /* step_once adds h S' */
        state[i] += (part - 1) * h * state[n + i];
    weights[0] = weights[2] = 0, weights[1] = part, weights[3] = part * part;
    x->rate = weights, x->place = weights + 2, x->gamma = part, x->beta = part * part;
}

static int step(struct run *run, real t, real h, real t_new) {
    struct beam_steps x = steps_of(run);
    struct beams *b = x.b;
    const long n = run->e->n;
    const real *y = run->y, *second = x.f + n;
    real weights[4];
    if (x.past && !x.collocated) {
        from_past(&x, run, h, weights, run->stage);
        y = run->stage, second = run->error;
    }
    beams_take(b, y, x.columns, x.p);
    beams_take(b, y + n, x.columns, x.pv);
    beams_take(b, second, x.columns, x.pa);
    int status = x.collocated ? collocate(&x, t, h) : step_once(&x, t, h);
    if (status == DONE && b->layout.counts.constraints)
        status = beams_assemble(b, t_new, 0);
    if (status != DONE)
        return status;
    beams_expand(b, 0, x.p, x.pv, x.pa, x.columns, run->y_new);
    beams_expand(b, 1, x.p, x.pv, x.pa, x.columns, run->y_new + n);
    if (!x.collocated)
        beams_expand(b, 2, x.p, x.pv, x.pa, x.columns, x.f_new + n);
    run->state->settled = 1, run->state->correction = 0;
    return DONE;
}

/* Select the independent unknowns of the next step. */
static int finish(struct run *run, real h, real t_new) {
    const struct beam_steps x = steps_of(run);
    struct beams *b = x.b;
    const long n = run->e->n;
    (void)t_new;
    if (x.past)
        x.lengths[0] = h;
    memcpy(run->f_new, run->y_new + n, (size_t)n * sizeof(real));
    for (long i = 0; x.collocated && i < n; i++)
        run->f_new[n + i] = (run->y_new[n + i] - run->y[n + i]) / h;
    return b->layout.counts.constraints ? beams_choose(b) : DONE;
}

static void accept(struct run *run) {
    const struct beam_steps x = steps_of(run);
    const size_t row = (size_t)run->dim * sizeof(real);
    if (x.past < 2)
        return;
    memmove(x.before + run->dim, x.before, (size_t)(x.past - 2) * row);
    memcpy(x.before, run->y_old, row);
    memmove(x.lengths + 1, x.lengths, (size_t)(x.past - 1) * sizeof(real));
    *x.known += *x.known < x.past - 1;
}

static int valid(const struct run *run) {
    const struct beam_steps x = steps_of(run);
    return 0 <= *x.known && (x.past ? *x.known < x.past : *x.known == 0);
}

const struct kind beam_kind = {
    "beam_steps", "stages past", "at gamma beta inertia rate place a aa b ba c", 1, bytes, numbers, bind, begin, step, finish,
    NULL, hermite, accept, valid, NULL, NULL, NULL, NULL,
};
