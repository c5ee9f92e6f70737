#include "beam_steps.h"

#include <string.h>

#include "arena.h"
#include "lanes.h"
#include "run.h"

/* Point all arrays into memory, or only count their bytes. */
static size_t place(struct beam_steps *x, void *memory) {
    const ptrdiff_t k = x->stages, columns = x->columns;
    const ptrdiff_t free = x->b->free, whole = x->b->whole, entries = x->b->entries;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->a, k * k),
        ARENA_ARRAY(x->aa, k * k),
        ARENA_ARRAY(x->weights, k),
        ARENA_ARRAY(x->weights_a, k),
        ARENA_ARRAY(x->nodes, k),
        ARENA_ARRAY(x->by_rate, k * k),
        ARENA_ARRAY(x->by_place, k * k),
        ARENA_ARRAY(x->of_entry, 3 * k),
        ARENA_ARRAY(x->mass, k * (entries + 1)),
        ARENA_ARRAY(x->damping, k * (entries + 1)),
        ARENA_ARRAY(x->stiffness, k * (entries + 1)),
        ARENA_ARRAY(x->load, k * (free + 1)),
        ARENA_ARRAY(x->forces, k * 2 * free * x->b->modes),
        ARENA_ARRAY(x->system.banded, (3 * x->system.band + 1) * x->system.inner),
        ARENA_ARRAY(x->system.right, x->system.inner * x->system.border),
        ARENA_ARRAY(x->system.below, x->system.inner * x->system.border),
        ARENA_ARRAY(x->system.corner, x->system.border * x->system.border),
        ARENA_ARRAY(x->system.panel, panel_size(x->system.border, x->system.band)),
        ARENA_ARRAY(x->rhs, (free + x->b->modes) * k * columns),
        ARENA_ARRAY(x->s, whole * columns),
        ARENA_ARRAY(x->v, whole * columns),
        ARENA_ARRAY(x->acc, whole * columns),
        ARENA_ARRAY(x->p, free * columns),
        ARENA_ARRAY(x->pv, free * columns),
        ARENA_ARRAY(x->pa, free * columns),
        ARENA_ARRAY(x->system.pivots, x->system.inner),
        ARENA_ARRAY(x->system.swaps, x->system.border),
    };
    return ARENA_PLACE(arrays, memory);
}

static void fill(struct beam_steps *x, struct beams *b, const struct beam_scheme *scheme, long columns) {
    x->b = b;
    x->scheme = *scheme;
    x->columns = columns;
    x->stages = scheme->stages > 0 ? scheme->stages : 1;
    x->system.inner = b->inner * x->stages;
    x->system.border = (b->border + b->modes) * x->stages;
    x->system.band = b->system.band * x->stages + x->stages - 1;
}

size_t beam_steps_bytes(const struct beams *b, const struct beam_scheme *scheme, long columns) {
    struct beam_steps counted;
    fill(&counted, (struct beams *)b, scheme, columns);
    return place(&counted, NULL);
}

void beam_steps_bind(struct beam_steps *x, struct beams *b, const struct beam_scheme *scheme, long columns,
                     void *memory) {
    const long k = scheme->stages;
    const double *const from[] = {scheme->a, scheme->aa, scheme->b, scheme->ba, scheme->c};
    fill(x, b, scheme, columns);
    place(x, memory);
    real *to[] = {x->a, x->aa, x->weights, x->weights_a, x->nodes};
    const long counts[] = {k * k, k * k, k, k, k};
    for (int i = 0; i < 5; i++)
        for (long j = 0; j < counts[i]; j++)
            to[i][j] = R(from[i][j]);
}

/* Copy the independent unknowns of the present choice from S and S'. */
static void take_free(struct beam_steps *x) {
    for (ptrdiff_t i = 0; i < x->b->free; i++) {
        const ptrdiff_t k = independent_unknown(x->b, i);
        const size_t row = (size_t)x->columns * sizeof(real);
        memcpy(x->p + i * x->columns, x->s + k * x->columns, row);
        memcpy(x->pv + i * x->columns, x->v + k * x->columns, row);
        memcpy(x->pa + i * x->columns, x->acc + k * x->columns, row);
    }
}

/* Write S, S' and S'' from the independent unknowns, then select the independent unknowns for the next step. */
static int finish(struct beam_steps *x, real t) {
    struct beams *b = x->b;
    const int bound = b->layout.counts.constraints != 0;
    if (bound) {
        const int status = beams_assemble(b, t, 0);
        if (status != DONE)
            return status;
    }
    beams_expand(b, 0, x->p, x->pv, x->pa, x->columns, x->s);
    beams_expand(b, 1, x->p, x->pv, x->pa, x->columns, x->v);
    if (!x->scheme.stages)
        beams_expand(b, 2, x->p, x->pv, x->pa, x->columns, x->acc);
    if (!all_finite(x->s, (long)b->layout.counts.unknowns * x->columns))
        return NOT_FINITE;
    if (bound) {
        const int status = beams_choose(b);
        if (status != DONE)
            return status;
        take_free(x);
    }
    return DONE;
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

/* Solve the system for all columns, in place. */
static int solve(struct beam_steps *x) {
    if (!factor_bordered(&x->system))
        return SINGULAR;
    solve_bordered(&x->system, x->columns, x->rhs);
    return DONE;
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

/* One step of Gauss collocation: accelerations at all stages from one system. */
static int collocate(struct beam_steps *x, real t, real h) {
    const long k = x->stages, columns = x->columns;
    const ptrdiff_t size = (x->b->free + x->b->modes) * k;
    for (long i = 0; i < k; i++) {
        const int status = keep_stage(x, i, t + x->nodes[i] * h);
        if (status != DONE)
            return status;
    }
    collocation_system(x, h);
    const int status = solve(x);
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
    return finish(x, t + h);
}

/* One step of a method with accelerations at both ends: Newmark's, generalized-alpha, Wilson's. */
static int step_once(struct beam_steps *x, real t, real h) {
    const struct beams *b = x->b;
    const struct beam_scheme *s = &x->scheme;
    const long columns = x->columns;
    const ptrdiff_t free = b->free, size = free + b->modes;
    const struct band_store in = band_store(x->system.inner, x->system.band);
    const real at = R(s->at), gamma = R(s->gamma), beta = R(s->beta), half = R(0.5);
    const real inertia[] = {R(s->inertia[0]), R(s->inertia[1])};
    const real rate[] = {h * R(s->rate[0]), h * R(s->rate[1])};
    const real place[] = {h * h * R(s->place[0]), h * h * R(s->place[1])};
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
    status = solve(x);
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
    return finish(x, t + h);
}

/* Solve the equations assembled at the start for S''. */
static int start_accelerations(struct beam_steps *x) {
    struct beams *b = x->b;
    const long columns = x->columns;
    const ptrdiff_t free = b->free;
    if (!beams_factor_mass(b))
        return SINGULAR;
    memset(x->rhs, 0, (size_t)(free * columns) * sizeof(real));
    memcpy(x->rhs, b->load, (size_t)free * sizeof(real));
    for (ptrdiff_t e = 0; e < b->entries; e++)
        for (long c = 0; c < columns; c++) {
            const ptrdiff_t at = b->columns[e] * columns + c;
            x->rhs[c * free + b->rows[e]] -= b->damping[e] * x->pv[at] + b->stiffness[e] * x->p[at];
        }
    subtract_forces_of_modes(b, columns, x->p, x->pv, free, x->rhs);
    solve_bordered(&b->system, columns, x->rhs);
    for (ptrdiff_t r = 0; r < free; r++)
        for (long c = 0; c < columns; c++)
            x->pa[r * columns + c] = x->rhs[c * free + r];
    beams_expand(b, 2, x->p, x->pv, x->pa, columns, x->acc);
    return DONE;
}

int beam_steps_start(struct beam_steps *x, real t) {
    const int status = beams_assemble(x->b, t, 1);
    if (status != DONE)
        return status;
    take_free(x);
    return x->scheme.stages ? DONE : start_accelerations(x);
}

int beam_steps_part(struct beam_steps *x, real t0, real t1, long count, long from, long to, long *done) {
    const real h = (t1 - t0) / count;
    for (long k = from; k < to; k++) {
        const real t = t0 + k * h;
        const int status = x->scheme.stages ? collocate(x, t, h) : step_once(x, t, h);
        if (status != DONE)
            return status;
        ++*done;
    }
    return DONE;
}

int beam_steps_advance(struct beam_steps *x, real t0, real t1, long count, long *done) {
    return beam_steps_part(x, t0, t1, count, 0, count, done);
}
