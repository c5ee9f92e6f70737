#include "system.h"

#include <string.h>

void system_evaluate(const struct system *of, const struct states *s, real *forces, real *errors, real *rates) {
    for (ptrdiff_t k = 0; k < of->count; k++)
        of->parts[k]->evaluate(of->parts[k], s, forces, errors, rates);
}

void system_refresh(const struct system *of, const struct states *s) {
    const struct slopes *to = &of->slopes;
    const size_t bytes = (size_t)to->size * sizeof(real);
    real *const all[] = {to->by_a, to->by_v, to->by_q, to->jacobian};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        memset(all[i], 0, bytes);
    for (ptrdiff_t k = 0; k < of->count; k++)
        of->parts[k]->add_slopes(of->parts[k], s, to);
}

int system_factor(const struct system *of, real re, real im, real *values, real *imaginary) {
    const struct slopes *at = &of->slopes;
    const real square = re * re - im * im, twice = 2 * re * im;
    for (ptrdiff_t k = 0; k < at->size; k++)
        values[k] = at->by_a[k] + at->jacobian[k];
    if (imaginary == NULL)
        return envelope_factor(&of->envelope, values, NULL);
    for (ptrdiff_t k = 0; k < at->size; k++) {
        values[k] += re * at->by_v[k] + square * at->by_q[k];
        imaginary[k] = im * at->by_v[k] + twice * at->by_q[k];
    }
    return envelope_factor(&of->envelope, values, imaginary);
}

real system_power(const struct system *of, const struct states *s, ptrdiff_t row) {
    real power = 0;
    for (ptrdiff_t k = 0; k < of->count; k++) {
        const struct part *part = of->parts[k];
        const real input = part->input != NULL ? part->input(part, s, row) : 0;
        power += input - (part->dissipation != NULL ? part->dissipation(part, s, row) : 0);
    }
    return power;
}

static void evaluate(const struct system *of, const struct states *s, void *forces, void *errors, void *rates) {
    system_evaluate(of, s, forces, errors, rates);
}

static int accelerate_by(const struct system *of, void *factors, void *right) {
    const ptrdiff_t count = of->envelope.n;
    real *values = right;
    if (!system_factor(of, 0, 0, factors, NULL))
        return 0;
    for (ptrdiff_t k = 0; k < count; k++)
        of->x[of->position[k]] = values[k];
    envelope_solve(&of->envelope, factors, NULL, of->x, NULL);
    for (ptrdiff_t k = 0; k < count; k++)
        values[k] = of->x[of->position[k]];
    return 1;
}

static int project_nothing(struct equations *e, real t, real *y) {
    (void)e, (void)t, (void)y;
    return DONE;
}

static void measure_nothing(struct equations *e, real t, const real *y) {
    (void)t, (void)y;
    memset(e->energies, 0, 3 * sizeof(real));
}

void bind_motion(struct equations *e, struct system_motion *motion) {
    static const struct behaviour of = {.project = project_nothing, .measure_energy = measure_nothing};
    e->of = &of, e->owner = motion;
}

const struct system_api symgen_system = {
    .bind_elements = bind_elements,
    .bind_rows = bind_rows,
    .bind_ties = bind_ties,
    .bind_rigid = bind_rigid,
    .bind_added = bind_added,
    .evaluate = evaluate,
    .refresh = system_refresh,
    .accelerate = accelerate_by,
    .bind_motion = bind_motion,
};
