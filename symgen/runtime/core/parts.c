/* The kinds of parts of a system. */
#include "system.h"

#include <string.h>

#include "linear.h"

/* -- elements ---------------------------------------------------------------------------------------------- */

static void call_element(const struct elements *of, kernel function, const struct states *s, ptrdiff_t row,
                         ptrdiff_t element) {
    const ptrdiff_t n = of->size, *places = of->places + element * n, at = row * s->unknowns;
    real *state = of->state;
    for (ptrdiff_t k = 0; k < n; k++) {
        const ptrdiff_t place = at + places[k];
        state[k] = s->q[place];
        state[n + k] = s->v[place];
        state[2 * n + k] = s->a[place];
    }
    function(s->t + row, state, state + n, of->properties + element * of->stride, NULL, of->out);
}

static void evaluate_elements(const struct part *part, const struct states *s, real *forces, real *errors,
                              real *rates) {
    const struct elements *of = (const struct elements *)part;
    (void)errors, (void)rates;
    if (forces == NULL)
        return;
    for (ptrdiff_t row = 0; row < s->count; row++)
        for (ptrdiff_t element = 0; element < of->count; element++) {
            const ptrdiff_t *places = of->places + element * of->size;
            call_element(of, of->residual, s, row, element);
            for (ptrdiff_t k = 0; k < of->size; k++)
                forces[row * s->unknowns + places[k]] += of->out[k];
        }
}

static void add_slopes_of_elements(const struct part *part, const struct states *s, const struct slopes *to) {
    const struct elements *of = (const struct elements *)part;
    const ptrdiff_t entries = of->size * of->size;
    for (ptrdiff_t element = 0; element < of->count; element++) {
        const ptrdiff_t *slots = part->slots + element * entries;
        call_element(of, of->tangent, s, 0, element);
        for (ptrdiff_t k = 0; k < entries; k++) {
            to->by_a[slots[k]] += of->out[k];
            to->by_v[slots[k]] += of->out[entries + k];
            to->by_q[slots[k]] += of->out[2 * entries + k];
        }
    }
}

static real dissipation_of_elements(const struct part *part, const struct states *s, ptrdiff_t row) {
    const struct elements *of = (const struct elements *)part;
    enum { DISSIPATED = 3 }; /* after kinetic, strain and potential energy */
    real power = 0;
    for (ptrdiff_t element = 0; element < of->count; element++) {
        call_element(of, of->energies, s, row, element);
        power += of->out[DISSIPATED];
    }
    return power;
}

void bind_elements(struct elements *of, int damped) {
    of->part.evaluate = evaluate_elements;
    of->part.add_slopes = add_slopes_of_elements;
    of->part.dissipation = damped ? dissipation_of_elements : NULL;
    of->part.input = NULL;
}

/* -- constraints ------------------------------------------------------------------------------------------- */

/* An unknown or prescribed number, or its rate, at a state. */
static inline real number_at(const struct states *s, const real *of_unknowns, const real *prescribed, ptrdiff_t row,
                             ptrdiff_t place) {
    return place < s->unknowns ? of_unknowns[row * s->unknowns + place]
                               : prescribed[row * s->known + place - s->unknowns];
}

/* Add the slope of a constraint below and right of the diagonal. */
static inline void add_to_jacobian(const struct part *part, const struct slopes *to, ptrdiff_t entry, real slope) {
    if (part->below[entry] >= 0) {
        to->jacobian[part->below[entry]] += slope;
        to->jacobian[part->right[entry]] += slope;
    }
}

static void call_row(const struct rows *of, const struct states *s, ptrdiff_t row, ptrdiff_t k) {
    const ptrdiff_t *places = of->places + k * of->size;
    real state[3 * WIDEST_ROW], acting[WIDEST_ROW];
    for (ptrdiff_t i = 0; i < of->size; i++) {
        state[i] = number_at(s, s->q, s->z, row, places[i]);
        state[of->size + i] = number_at(s, s->v, s->z_rates, row, places[i]);
    }
    memcpy(state + 2 * of->size, of->factors + k * of->factors_of, (size_t)of->factors_of * sizeof(real));
    memcpy(acting, of->acting + k * of->acting_of, (size_t)of->acting_of * sizeof(real));
    of->row(s->t + row, state, state + of->size, of->properties + k * of->properties_of, acting, of->out);
}

static void evaluate_rows(const struct part *part, const struct states *s, real *forces, real *errors, real *rates) {
    const struct rows *of = (const struct rows *)part;
    for (ptrdiff_t row = 0; row < s->count; row++)
        for (ptrdiff_t k = 0; k < of->count; k++) {
            const ptrdiff_t at = row * s->multipliers + of->first + k;
            call_row(of, s, row, k);
            if (errors != NULL)
                errors[at] += of->out[0];
            if (rates != NULL)
                rates[at] += of->out[1];
            if (forces == NULL)
                continue;
            for (ptrdiff_t i = 0; i < of->size; i++) {
                const ptrdiff_t place = of->places[k * of->size + i];
                if (place < s->unknowns)
                    forces[row * s->unknowns + place] += of->out[2 + i] * s->lambda[at];
            }
        }
}

static void add_slopes_of_rows(const struct part *part, const struct states *s, const struct slopes *to) {
    const struct rows *of = (const struct rows *)part;
    const ptrdiff_t square = of->size * of->size;
    ptrdiff_t entry = 0;
    for (ptrdiff_t k = 0; k < of->count; k++) {
        call_row(of, s, 0, k);
        for (ptrdiff_t i = 0; i < of->size; i++)
            add_to_jacobian(part, to, k * of->size + i, of->out[2 + i]);
        for (; entry < of->inner_count && of->inner[entry] / square == k; entry++) {
            const real second =
                of->curvature != NULL ? of->curvature[entry] : of->out[2 + of->size + of->inner[entry] % square];
            to->by_q[part->slots[entry]] += second * s->lambda[of->first + k];
        }
    }
}

void bind_rows(struct rows *of) {
    of->part.evaluate = evaluate_rows;
    of->part.add_slopes = add_slopes_of_rows;
    of->part.dissipation = of->part.input = NULL;
}

static void evaluate_ties(const struct part *part, const struct states *s, real *forces, real *errors, real *rates) {
    const struct ties *of = (const struct ties *)part;
    for (ptrdiff_t row = 0; row < s->count; row++)
        for (ptrdiff_t k = 0; k < of->count; k++) {
            const ptrdiff_t place = of->places[k], at = row * s->multipliers + of->rows[k];
            if (forces != NULL && place < s->unknowns)
                forces[row * s->unknowns + place] += of->factors[k] * s->lambda[at];
            if (errors != NULL)
                errors[at] += of->factors[k] * number_at(s, s->q, s->z, row, place);
            if (rates != NULL)
                rates[at] += of->factors[k] * number_at(s, s->v, s->z_rates, row, place);
        }
}

static void add_slopes_of_ties(const struct part *part, const struct states *s, const struct slopes *to) {
    const struct ties *of = (const struct ties *)part;
    (void)s;
    for (ptrdiff_t k = 0; k < of->count; k++)
        add_to_jacobian(part, to, k, of->factors[k]);
}

void bind_ties(struct ties *of) {
    of->part.evaluate = evaluate_ties;
    of->part.add_slopes = add_slopes_of_ties;
    of->part.dissipation = of->part.input = NULL;
}

/* -- rigid links ------------------------------------------------------------------------------------------- */

static void call_joints(const struct rigid *of, const struct states *s, ptrdiff_t row) {
    const ptrdiff_t at = row * s->unknowns;
    memcpy(of->work, s->a + at, (size_t)of->n * sizeof(real));
    for (ptrdiff_t k = 0; k < of->count; k++)
        of->work[of->n + of->of_rows[k]] = s->lambda[row * s->multipliers + k] / of->sizes[k];
    of->joints(s->t + row, s->q + at, s->v + at, of->p_joints, of->work, of->out);
}

/* Add the results of a kernel for the constraints of the linkage over their scales. */
static void add_scaled(const struct rigid *of, kernel function, const struct states *s, ptrdiff_t row, real *to) {
    const ptrdiff_t at = row * s->unknowns;
    function(s->t + row, s->q + at, s->v + at, of->p, of->spare, of->out);
    for (ptrdiff_t k = 0; k < of->count; k++)
        to[row * s->multipliers + k] += of->out[of->of_rows[k]] / of->sizes[k];
}

static void evaluate_rigid(const struct part *part, const struct states *s, real *forces, real *errors, real *rates) {
    const struct rigid *of = (const struct rigid *)part;
    for (ptrdiff_t row = 0; row < s->count; row++) {
        if (forces != NULL) {
            real *to = forces + row * s->unknowns;
            call_joints(of, s, row);
            for (ptrdiff_t i = 0; i < of->n; i++)
                to[i] -= of->out[of->load + i];
            for (ptrdiff_t k = 0; k < of->count; k++) {
                const real *slopes = of->out + of->jacobian + of->in_jacobian[k] * of->columns;
                add_multiple(of->n, s->lambda[row * s->multipliers + k], slopes, to);
            }
        }
        if (rates != NULL && of->count)
            add_scaled(of, of->rates, s, row, rates);
        if (errors != NULL && of->count)
            add_scaled(of, of->constraints, s, row, errors);
    }
}

static void add_slopes_of_rigid(const struct part *part, const struct states *s, const struct slopes *to) {
    const struct rigid *of = (const struct rigid *)part;
    real *const by[] = {to->by_a, to->by_v, to->by_q};
    const ptrdiff_t *slot = part->slots;
    call_joints(of, s, 0);
    for (int i = 0; i < 3; i++)
        for (ptrdiff_t k = 0; k < of->entries[i]; k++)
            by[i][*slot++] += of->out[of->at[i] + k];
    for (ptrdiff_t k = 0; k < of->count; k++)
        for (ptrdiff_t i = 0; i < of->n; i++)
            add_to_jacobian(part, to, k * of->n + i, of->out[of->jacobian + of->in_jacobian[k] * of->columns + i]);
}

static real input_of_rigid(const struct part *part, const struct states *s, ptrdiff_t row) {
    const struct rigid *of = (const struct rigid *)part;
    const ptrdiff_t at = row * s->unknowns;
    memcpy(of->work, s->a + at, (size_t)of->n * sizeof(real));
    of->energy(s->t + row, s->q + at, s->v + at, of->p_joints, of->work, of->out);
    return of->out[of->power];
}

void bind_rigid(struct rigid *of) {
    of->part.evaluate = evaluate_rigid;
    of->part.add_slopes = add_slopes_of_rigid;
    of->part.dissipation = NULL;
    of->part.input = of->energy != NULL ? input_of_rigid : NULL;
}

/* -- functions of the caller ------------------------------------------------------------------------------- */

static void evaluate_added(const struct part *part, const struct states *s, real *forces, real *errors, real *rates) {
    const struct added *of = (const struct added *)part;
    (void)errors, (void)rates;
    if (forces != NULL)
        of->forces(of->owner, s, forces);
}

static void add_slopes_of_added(const struct part *part, const struct states *s, const struct slopes *to) {
    const struct added *of = (const struct added *)part;
    real *const by[] = {to->by_a, to->by_v, to->by_q};
    of->slopes(of->owner, s, of->found);
    for (int i = 0; i < 3; i++)
        for (ptrdiff_t k = 0; k < of->entries; k++)
            by[i][part->slots[k]] += of->found[i * of->entries + k];
}

static real input_of_added(const struct part *part, const struct states *s, ptrdiff_t row) {
    const struct added *of = (const struct added *)part;
    (void)s;
    return of->power(of->owner, row);
}

void bind_added(struct added *of) {
    of->part.evaluate = evaluate_added;
    of->part.add_slopes = add_slopes_of_added;
    of->part.dissipation = NULL;
    of->part.input = input_of_added;
}
