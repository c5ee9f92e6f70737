/* Equations of motion of elastic links for a run: `beam_behaviour`. */
#include "beams.h"

#include <string.h>

int beams_factor_mass(struct beams *b) {
    const struct band_store at = band_store(b->inner, b->system.band);
    clear_bordered(&b->system);
    for (ptrdiff_t e = 0; e < b->entries; e++)
        if (e < b->banded_entries)
            b->system.banded[at.first + b->rows[e] + b->columns[e] * at.lead] = b->mass[e];
        else
            set_in_border(&b->system, b->rows[e], b->columns[e], b->mass[e]);
    return factor_bordered(&b->system);
}

void beams_take(const struct beams *b, const real *all, long columns, real *free) {
    const size_t row = (size_t)columns * sizeof(real);
    memcpy(free, all, (size_t)b->inner * row);
    for (ptrdiff_t i = b->inner; i < b->free; i++)
        memcpy(free + i * columns, all + independent_unknown(b, i) * columns, row);
}

static struct beams *of(struct equations *e) {
    return e->owner;
}

/* Write load less damping and stiffness forces of all states, a column of `free` numbers each; inlined where the compiler
   knows their number. */
static inline void forces_of_states(const struct beams *b, const long columns, const real *p, const real *v, real *rhs) {
    const ptrdiff_t free = b->free;
    memset(rhs, 0, (size_t)(free * columns) * sizeof(real));
    memcpy(rhs, b->load, (size_t)free * sizeof(real));
    for (ptrdiff_t k = 0; k < b->entries; k++)
        for (long c = 0; c < columns; c++) {
            const ptrdiff_t at = b->columns[k] * columns + c;
            rhs[c * free + b->rows[k]] -= b->damping[k] * v[at] + b->stiffness[k] * p[at];
        }
    subtract_forces_of_modes(b, columns, p, v, free, rhs);
}

/* Write S'' to e->out; its first entry is infinite if the rigid motion fails or the mass matrix is singular. */
static void accelerate_beams(struct equations *e, real t, const real *y) {
    struct beams *b = of(e);
    const long columns = columns_of(e, b);
    const ptrdiff_t free = b->free;
    real *p = e->work, *v = p + free * columns, *a = v + free * columns, *rhs = a + free * columns;
    if (beams_assemble(b, t, 1) != DONE || !beams_factor_mass(b)) {
        e->out[0] = REAL_INFINITY;
        return;
    }
    beams_take(b, y, columns, p);
    beams_take(b, y + e->n, columns, v);
    if (columns == 1)
        forces_of_states(b, 1, p, v, rhs);
    else
        forces_of_states(b, columns, p, v, rhs);
    const int tangents = tangents_in(b, columns);
    solve_bordered(&b->system, tangents ? 1 : columns, rhs);
    if (tangents) {
        for (ptrdiff_t r = 0; r < free; r++)
            a[r * columns] = rhs[r];
        b->tangent->load(b, p, v, a, columns, rhs, free, 1);
        solve_bordered(&b->system, columns - 1, rhs + free);
    }
    for (ptrdiff_t r = 0; r < free; r++)
        for (long c = 0; c < columns; c++)
            a[r * columns + c] = rhs[c * free + r];
    beams_expand(b, 2, p, v, a, columns, e->out);
}

static void derivative_beams(struct equations *e, real t, const real *y, real *dy) {
    const size_t half = (size_t)e->n * sizeof(real);
    accelerate_beams(e, t, y);
    memcpy(dy, y + e->n, half);
    memcpy(dy + e->n, e->out, half);
}

/* Dependent unknowns are eliminated: the constraints hold exactly. */
static real no_error(struct equations *e, real t, const real *y) {
    (void)e;
    (void)t;
    (void)y;
    return 0;
}

static int factorise_beams(struct equations *e, real t, const real *y) {
    (void)y;
    e->account->factorisations++;
    return beams_assemble(of(e), t, 1);
}

/* Set the dependent unknowns from the independent ones by the constraints. */
static int project_beams(struct equations *e, real t, real *y) {
    struct beams *b = of(e);
    const long columns = columns_of(e, b);
    real *p = e->work, *v = p + b->free * columns;
    if (b->layout.counts.constraints == 0)
        return DONE;
    const int status = factorise_beams(e, t, y);
    if (status != DONE)
        return status;
    beams_take(b, y, columns, p);
    beams_take(b, y + e->n, columns, v);
    beams_expand(b, 0, p, v, NULL, columns, y);
    beams_expand(b, 1, p, v, NULL, columns, y + e->n);
    return DONE;
}

/* Project a change of the unknowns onto the tangent space of the constraints. */
static void make_tangent_beams(struct equations *e, real t, const real *y, real *change) {
    struct beams *b = of(e);
    (void)t;
    (void)y;
    if (b->layout.counts.constraints == 0)
        return;
    beams_take(b, change, columns_of(e, b), e->work);
    beams_expand(b, 0, e->work, NULL, NULL, columns_of(e, b), change);
}

/* A motion that is partly prescribed does not conserve energy. */
static void no_energy(struct equations *e, real t, const real *y) {
    (void)t;
    (void)y;
    memset(e->energies, 0, 3 * sizeof(real));
}

const struct behaviour beam_behaviour = {
    .accelerate = accelerate_beams,
    .derivative = derivative_beams,
    .position_error = no_error,
    .velocity_error = no_error,
    .factorise = factorise_beams,
    .project = project_beams,
    .make_tangent = make_tangent_beams,
    .measure_energy = no_energy,
    .rounding = 0.1,
};
