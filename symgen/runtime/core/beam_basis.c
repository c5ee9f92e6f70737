/* The basis R(t) of the motions that the constraints of elastic links allow, J R = 0, and its derivatives. */
#include "beams.h"

#include <string.h>

int beams_choose(struct beams *b) {
    const ptrdiff_t m = b->layout.constraints, n = b->whole;
    struct account *account = b->base.account;
    struct least_pivot least;
    memcpy(b->pivoted, b->bound, (size_t)(m * n) * sizeof(real));
    const int chosen = choose_columns(m, n, b->pivoted, b->dependent, b->independent, &least);
    account->weakest = least.row;
    account->soundness = least.part;
    return chosen ? DONE : SINGULAR;
}

/* The right-hand sides of J R = 0 and its rates for derivative k, rows of `free` in `product`. */
static void right_sides(const struct beams *b, int k) {
    const ptrdiff_t m = b->layout.constraints, n = b->whole, free = b->free;
    const real *value = b->basis, *rate = value + n * free;
    for (ptrdiff_t i = 0; i < m; i++) {
        const real *j0 = b->bound + n * i, *j1 = j0 + n * m, *j2 = j1 + n * m;
        for (ptrdiff_t r = 0; r < free; r++) {
            real total = 0;
            for (ptrdiff_t j = 0; j < n; j++) {
                if (k == 0)
                    total -= j0[j] * value[free * j + r];
                else if (k == 1)
                    total -= j1[j] * value[free * j + r];
                else
                    total -= j2[j] * value[free * j + r] + 2 * j1[j] * rate[free * j + r];
            }
            b->product[free * i + r] = total;
        }
    }
}

/* Factorise the columns of J that belong to the dependent unknowns; false when they are singular. */
static int factor_dependent(struct beams *b) {
    const ptrdiff_t m = b->layout.constraints;
    for (ptrdiff_t i = 0; i < m; i++)
        for (ptrdiff_t j = 0; j < m; j++)
            b->pivoted[m * i + j] = b->bound[b->whole * i + b->dependent[j]];
    return factor_dense(m, b->pivoted, b->swaps);
}

/* Solve for the rows of dependent unknowns, with the right-hand sides in `product`. */
static void solve_dependent(struct beams *b, real *into) {
    const ptrdiff_t m = b->layout.constraints, free = b->free;
    solve_dense_wide(m, b->pivoted, b->swaps, free, b->product);
    for (ptrdiff_t j = 0; j < m; j++)
        memcpy(into + free * b->dependent[j], b->product + free * j, (size_t)free * sizeof(real));
}

/* A term `times` matrix R_of of a projection; a matrix NULL is left out. */
struct term {
    const real *matrix;
    int of;
    real times;
};

/* Write R^T (sum of terms). */
static void project_terms(const struct beams *b, const struct term *terms, int count, real *out) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = b->whole, free = b->free;
    memset(b->product, 0, (size_t)(n * free) * sizeof(real));
    for (ptrdiff_t e = 0; e < x->entries; e++) {
        real *to = b->product + free * x->rows[e];
        for (int k = 0; k < count; k++) {
            const real *from = b->basis + n * free * terms[k].of + free * x->columns[e];
            const real by = terms[k].times * terms[k].matrix[e];
            for (ptrdiff_t r = 0; r < free; r++)
                to[r] += by * from[r];
        }
    }
    memset(out, 0, (size_t)(free * free) * sizeof(real));
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t q = 0; q < free; q++) {
            const real left = b->basis[free * i + q];
            if (left != 0)
                for (ptrdiff_t r = 0; r < free; r++)
                    out[free * q + r] += left * b->product[free * i + r];
        }
}

int beams_reduce(struct beams *b, int choose) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t m = x->constraints, n = b->whole, free = b->free;
    const int turns = !x->thesis && b->analysis != QUASI_STATIC;
    real *found = b->motion->joined;
    if (b->analysis == AT_REST)
        memset(found + x->joint_at[5], 0, (size_t)(2 * m * x->coordinates) * sizeof(real));
    memset(b->bound, 0, (size_t)(3 * m * n) * sizeof(real));
    for (int k = 0; k < 3; k++)
        for (ptrdiff_t i = 0; i < m; i++)
            for (ptrdiff_t j = 0; j < x->coordinates; j++)
                if (x->joint_places[j] >= 0)
                    b->bound[n * (k * m + i) + x->joint_places[j]] = found[x->joint_at[4 + k] + i * x->coordinates + j];
    const int status = choose ? beams_choose(b) : DONE;
    if (status != DONE)
        return status;
    memset(b->basis, 0, (size_t)(3 * n * free) * sizeof(real));
    for (ptrdiff_t j = 0; j < free; j++)
        b->basis[free * b->independent[j] + j] = 1;
    if (!factor_dependent(b))
        return SINGULAR;
    /* The right-hand sides of all three need those before: solve one after the other. */
    for (int k = 0; k <= (turns ? 2 : 0); k++) {
        right_sides(b, k);
        solve_dependent(b, b->basis + n * free * k);
    }
    const struct term mass[] = {{b->full_mass, 0, 1}};
    const struct term damping[] = {{b->full_damping, 0, 1}, {b->full_mass, 1, 2}};
    const struct term stiffness[] = {{b->full_stiffness, 0, 1}, {b->full_damping, 1, 1}, {b->full_mass, 2, 1}};
    project_terms(b, mass, 1, b->mass);
    project_terms(b, damping, turns ? 2 : 1, b->damping);
    project_terms(b, stiffness, turns ? 3 : 1, b->stiffness);
    for (ptrdiff_t r = 0; r < free; r++) {
        real total = 0;
        for (ptrdiff_t i = 0; i < n; i++)
            total += b->basis[free * i + r] * b->full_load[i];
        b->load[r] = total;
    }
    return DONE;
}

void beams_expand(const struct beams *b, int derivative, const real *p, const real *v, const real *a, long columns,
                  real *out) {
    const ptrdiff_t n = b->whole, free = b->free;
    const real *top = derivative == 0 ? p : derivative == 1 ? v : a;
    const real *value = b->basis, *rate = value + n * free, *second = rate + n * free;
    if (b->layout.constraints == 0) {
        memcpy(out, top, (size_t)(n * columns) * sizeof(real));
        return;
    }
    memset(out, 0, (size_t)(n * columns) * sizeof(real));
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t r = 0; r < free; r++) {
            const ptrdiff_t at = free * i + r;
            for (long c = 0; c < columns; c++) {
                const ptrdiff_t from = r * columns + c;
                real sum = value[at] * top[from];
                if (derivative == 1)
                    sum += rate[at] * p[from];
                else if (derivative == 2)
                    sum += 2 * rate[at] * v[from] + second[at] * p[from];
                out[i * columns + c] += sum;
            }
        }
}
