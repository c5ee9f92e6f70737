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

static struct beams *of(struct equations *e) {
    return e->owner;
}

/* Write S'' to e->out; its first entry is infinite if the rigid motion fails or the mass matrix is singular. */
static void accelerate_beams(struct equations *e, real t, const real *y) {
    struct beams *b = of(e);
    real *p = b->state, *v = p + b->free;
    if (beams_assemble(b, t, 1) != DONE || !beams_factor_mass(b)) {
        e->out[0] = REAL_INFINITY;
        return;
    }
    for (ptrdiff_t i = 0; i < b->free; i++) {
        const ptrdiff_t k = independent_unknown(b, i);
        p[i] = y[k];
        v[i] = y[b->whole + k];
        b->solution[i] = b->load[i];
    }
    for (ptrdiff_t k = 0; k < b->entries; k++)
        b->solution[b->rows[k]] -= b->damping[k] * v[b->columns[k]] + b->stiffness[k] * p[b->columns[k]];
    subtract_forces_of_modes(b, 1, p, v, b->free, b->solution);
    solve_bordered(&b->system, 1, b->solution);
    beams_expand(b, 2, p, v, b->solution, 1, e->out);
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
    real *p = b->state, *v = p + b->free;
    if (b->layout.counts.constraints == 0)
        return DONE;
    const int status = factorise_beams(e, t, y);
    if (status != DONE)
        return status;
    for (ptrdiff_t i = 0; i < b->free; i++) {
        p[i] = y[independent_unknown(b, i)];
        v[i] = y[b->whole + independent_unknown(b, i)];
    }
    beams_expand(b, 0, p, v, NULL, 1, y);
    beams_expand(b, 1, p, v, NULL, 1, y + b->whole);
    return DONE;
}

/* Project a change of the unknowns onto the tangent space of the constraints. */
static void make_tangent_beams(struct equations *e, real t, const real *y, real *change) {
    struct beams *b = of(e);
    (void)t;
    (void)y;
    if (b->layout.counts.constraints == 0)
        return;
    for (ptrdiff_t i = 0; i < b->free; i++)
        b->state[i] = change[independent_unknown(b, i)];
    beams_expand(b, 0, b->state, NULL, NULL, 1, change);
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
