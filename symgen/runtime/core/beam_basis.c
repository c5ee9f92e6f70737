/* The basis R(t) of the motions that the constraints of elastic links allow, J R = 0, and its derivatives. */
#include "beams.h"

#include <string.h>

int beams_choose(struct beams *b) {
    const ptrdiff_t m = b->layout.counts.constraints, joints = b->whole - b->inner;
    struct account *account = b->base.account;
    struct least_pivot least;
    memcpy(b->pivoted, b->bound, (size_t)(m * joints) * sizeof(real));
    const int chosen = choose_columns(m, joints, b->pivoted, b->dependent, b->independent, &least);
    account->weakest = least.row;
    account->soundness = chosen ? 1.0 : least.part; /* a run has nothing to follow where constraints are eliminated */
    return chosen ? DONE : SINGULAR;
}

/* The right-hand sides of J R = 0 and its rates for derivative k, rows of `border` in `product`. */
static void right_sides(const struct beams *b, int k) {
    const ptrdiff_t m = b->layout.counts.constraints, joints = b->whole - b->inner, border = b->border;
    const real *value = b->basis, *rate = value + joints * border;
    for (ptrdiff_t i = 0; i < m; i++) {
        const real *j0 = b->bound + joints * i, *j1 = j0 + joints * m, *j2 = j1 + joints * m;
        for (ptrdiff_t r = 0; r < border; r++) {
            real total = 0;
            for (ptrdiff_t j = 0; j < joints; j++) {
                if (k == 0)
                    total -= j0[j] * value[border * j + r];
                else if (k == 1)
                    total -= j1[j] * value[border * j + r];
                else
                    total -= j2[j] * value[border * j + r] + 2 * j1[j] * rate[border * j + r];
            }
            b->product[border * i + r] = total;
        }
    }
}

/* Factorise the columns of J that belong to the dependent unknowns; false when they are singular. */
static int factor_dependent(struct beams *b) {
    const ptrdiff_t m = b->layout.counts.constraints, joints = b->whole - b->inner;
    for (ptrdiff_t i = 0; i < m; i++)
        for (ptrdiff_t j = 0; j < m; j++)
            b->pivoted[m * i + j] = b->bound[joints * i + b->dependent[j]];
    return factor_dense(m, b->pivoted, b->swaps);
}

/* Solve for the rows of dependent unknowns, with the right-hand sides in `product`. */
static void solve_dependent(struct beams *b, real *into) {
    const ptrdiff_t m = b->layout.counts.constraints, border = b->border;
    solve_dense_wide(m, b->pivoted, b->swaps, border, b->product);
    for (ptrdiff_t j = 0; j < m; j++)
        memcpy(into + border * b->dependent[j], b->product + border * j, (size_t)border * sizeof(real));
}

/* Write mass, damping and stiffness of the independent unknowns p of S = R p: R^T M R, R^T (C R + 2 M R') and
 * R^T (K R + C R' + M R''). R copies the inner unknowns. */
static void project_matrices(struct beams *b) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = b->inner, border = b->border, block = (b->whole - n) * border, sides = n * border;
    const size_t rest = (size_t)(b->entries - b->banded_entries) * sizeof(real);
    real *mass = b->mass, *damping = b->damping, *stiffness = b->stiffness;
    real *own_mass = mass + b->banded_entries, *own_damping = damping + b->banded_entries;
    real *own_stiffness = stiffness + b->banded_entries;
    memset(own_mass, 0, rest);
    memset(own_damping, 0, rest);
    memset(own_stiffness, 0, rest);
    for (ptrdiff_t e = 0; e < x->counts.entries; e++) {
        const ptrdiff_t i = x->rows[e], j = x->columns[e];
        const real m = b->full_mass[e], c = b->full_damping[e], k = b->full_stiffness[e];
        if (i < n && j < n) {
            *mass++ = m;
            *damping++ = c;
            *stiffness++ = k;
            continue;
        }
        if (j < n) {
            const real *left = b->basis + border * (i - n);
            const ptrdiff_t to = sides + border * j;
            for (ptrdiff_t r = 0; r < border; r++) {
                own_mass[to + r] += left[r] * m;
                own_damping[to + r] += left[r] * c;
                own_stiffness[to + r] += left[r] * k;
            }
            continue;
        }
        const real *value = b->basis + border * (j - n), *rate = value + block, *second = rate + block;
        for (ptrdiff_t q = 0; q < border; q++) {
            const real by_mass = m * value[q], by_damping = c * value[q] + 2 * m * rate[q];
            const real by_stiffness = k * value[q] + c * rate[q] + m * second[q];
            if (i < n) {
                own_mass[border * i + q] += by_mass;
                own_damping[border * i + q] += by_damping;
                own_stiffness[border * i + q] += by_stiffness;
                continue;
            }
            for (ptrdiff_t r = 0; r < border; r++) {
                const real left = b->basis[border * (i - n) + r];
                const ptrdiff_t to = 2 * sides + border * r + q;
                own_mass[to] += left * by_mass;
                own_damping[to] += left * by_damping;
                own_stiffness[to] += left * by_stiffness;
            }
        }
    }
}

/* Write f and g of the damped modes of the independent unknowns: R^T f, and R^T g + R'^T f. */
static void project_modes(struct beams *b) {
    const ptrdiff_t n = b->inner, joints = b->whole - n, border = b->border;
    const real *rates = b->basis + joints * border;
    for (ptrdiff_t mode = 0; mode < b->modes; mode++) {
        const real *f = b->full_forces + 2 * b->whole * mode, *g = f + b->whole;
        real *own_f = b->forces + 2 * b->free * mode, *own_g = own_f + b->free;
        memcpy(own_f, f, (size_t)n * sizeof(real));
        memcpy(own_g, g, (size_t)n * sizeof(real));
        memset(own_f + n, 0, (size_t)border * sizeof(real));
        memset(own_g + n, 0, (size_t)border * sizeof(real));
        for (ptrdiff_t i = 0; i < joints; i++)
            for (ptrdiff_t r = 0; r < border; r++) {
                own_f[n + r] += b->basis[border * i + r] * f[n + i];
                own_g[n + r] += b->basis[border * i + r] * g[n + i] + rates[border * i + r] * f[n + i];
            }
    }
}

int beams_reduce(struct beams *b, int choose) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t m = x->counts.constraints, n = b->inner, joints = b->whole - n, border = b->border;
    const int turns = !x->thesis && b->analysis != QUASI_STATIC;
    real *found = b->motion->joined;
    if (b->analysis == AT_REST)
        memset(found + x->joint_at[BLOCK_JACOBIAN_RATE], 0, (size_t)(2 * m * x->counts.coordinates) * sizeof(real));
    memset(b->bound, 0, (size_t)(3 * m * joints) * sizeof(real));
    for (int k = 0; k < 3; k++)
        for (ptrdiff_t i = 0; i < m; i++)
            for (ptrdiff_t j = 0; j < x->counts.coordinates; j++)
                if (x->joint_places[j] >= 0)
                    b->bound[joints * (k * m + i) + x->joint_places[j] - n] = found[x->joint_at[BLOCK_JACOBIAN + k] + i * x->counts.coordinates + j];
    const int status = choose ? beams_choose(b) : DONE;
    if (status != DONE)
        return status;
    memset(b->basis, 0, (size_t)(3 * joints * border) * sizeof(real));
    for (ptrdiff_t j = 0; j < border; j++)
        b->basis[border * b->independent[j] + j] = 1;
    if (!factor_dependent(b))
        return SINGULAR;
    /* The right-hand sides of all three need those before: solve one after the other. */
    for (int k = 0; k <= (turns ? 2 : 0); k++) {
        right_sides(b, k);
        solve_dependent(b, b->basis + joints * border * k);
    }
    project_matrices(b);
    project_modes(b);
    beams_reduce_load(b, b->full_load, b->load);
    return DONE;
}

void beams_reduce_load(const struct beams *b, const real *load, real *reduced) {
    const ptrdiff_t n = b->inner, joints = b->whole - n, border = b->border;
    memcpy(reduced, load, (size_t)n * sizeof(real));
    for (ptrdiff_t r = 0; r < border; r++) {
        real total = 0;
        for (ptrdiff_t i = 0; i < joints; i++)
            total += b->basis[border * i + r] * load[n + i];
        reduced[n + r] = total;
    }
}

void beams_expand(const struct beams *b, int derivative, const real *p, const real *v, const real *a, long columns,
                  real *out) {
    const ptrdiff_t n = b->inner, joints = b->whole - n, border = b->border;
    const real *top = derivative == 0 ? p : derivative == 1 ? v : a;
    const real *value = b->basis, *rate = value + joints * border, *second = rate + joints * border;
    memcpy(out, top, (size_t)(n * columns) * sizeof(real));
    memset(out + n * columns, 0, (size_t)(joints * columns) * sizeof(real));
    for (ptrdiff_t i = 0; i < joints; i++)
        for (ptrdiff_t r = 0; r < border; r++) {
            const ptrdiff_t at = border * i + r;
            for (long c = 0; c < columns; c++) {
                const ptrdiff_t from = (n + r) * columns + c;
                real sum = value[at] * top[from];
                if (derivative == 1)
                    sum += rate[at] * p[from];
                else if (derivative == 2)
                    sum += 2 * rate[at] * v[from] + second[at] * p[from];
                out[(n + i) * columns + c] += sum;
            }
        }
    if (tangents_in(b, columns) && joints > border)
        b->tangent->open(b, derivative, p, v, a, columns, out);
}
