/* Tangents of the equations of elastic links by parameters, in a batch whose first column is the state. Those of
 * M S'' + C S' + K S + J^T mu = Q and J S = 0 are
 *
 *     M dS'' + C dS' + K dS + J^T dmu = dQ - dM S'' - dC S' - dK S - dJ^T mu,    J dS = -dJ S,
 *
 * where dS = R dp + z: z has only dependent unknowns. */
#include <string.h>

#include "arena.h"
#include "beams.h"
#include "run.h"

/* Number of tangents by one parameter at one time. */
static ptrdiff_t numbers(const struct beams *b, const struct beam_tangents *x) {
    return 3 * x->entries + b->whole + 3 * b->layout.counts.constraints * (b->whole - b->inner);
}

/* Write the weights of the values at all points in those at a time. */
static void weigh(const struct beam_tangents *x, real t, real *weights) {
    real total = 0;
    for (ptrdiff_t k = 0; k < x->points; k++) {
        if (t == x->times[k]) {
            memset(weights, 0, (size_t)x->points * sizeof(real));
            weights[k] = 1;
            return;
        }
        total += weights[k] = x->weights[k] / (t - x->times[k]);
    }
    for (ptrdiff_t k = 0; k < x->points; k++)
        weights[k] /= total;
}

static void prepare(struct beam_tangents *x, const struct beams *b, ptrdiff_t count, const real *times) {
    const ptrdiff_t row = numbers(b, x);
    x->known = count;
    memcpy(x->at, times, (size_t)count * sizeof(real));
    for (ptrdiff_t i = 0; i < count; i++)
        weigh(x, times[i], x->between + i * x->points);
    for (ptrdiff_t j = 0; j < x->parameters; j++)
        multiply_dense(count, x->points, row, x->between, x->points, x->values + j * x->points * row,
                       x->now + j * count * row);
}

/* Return the tangents by parameter j at the time assembled last. */
static const real *present(const struct beams *b, ptrdiff_t j) {
    struct beam_tangents *x = b->tangents;
    const real t = *b->motion->t;
    ptrdiff_t i = 0;
    while (i < x->known && x->at[i] != t)
        i++;
    if (i == x->known) {
        prepare(x, b, 1, &t);
        i = 0;
    }
    return x->now + (j * x->known + i) * numbers(b, x);
}

/* out -= M S'' + C S' + K S, for the rows S, S', S'' of `state` and entries M, C, K of matrices. */
static void subtract(ptrdiff_t count, const ptrdiff_t *rows, const ptrdiff_t *columns, const real *mass, const real *damping,
                     const real *stiffness, ptrdiff_t n, const real *state, real *out) {
    for (ptrdiff_t e = 0; e < count; e++) {
        const real *at = state + columns[e];
        out[rows[e]] -= mass[e] * at[2 * n] + damping[e] * at[n] + stiffness[e] * at[0];
    }
}

static void subtract_all(const struct beams *b, const real *state, real *out) {
    const struct beam_layout *x = &b->layout;
    subtract(x->counts.entries, x->rows, x->columns, b->full_mass, b->full_damping, b->full_stiffness, b->whole, state, out);
}

/* Write S, and by `derivative` S' and S'', of the first column. */
static void find_state(const struct beams *b, int derivative, const real *const rows[3], long columns) {
    const struct beam_tangents *x = b->tangents;
    real *own[3];
    for (int d = 0; d <= derivative; d++) {
        own[d] = x->first + d * b->free;
        for (ptrdiff_t i = 0; i < b->free; i++)
            own[d][i] = rows[d][i * columns];
        beams_expand(b, d, own[0], own[1], own[2], 1, x->state + d * b->whole);
    }
}

/* Write z, and by `derivative` z' and z'', from tangents dJ, dJ', dJ''. */
static void find_opened(const struct beams *b, int derivative, const real *slopes) {
    const struct beam_tangents *x = b->tangents;
    const ptrdiff_t n = b->whole, m = b->layout.counts.constraints, joints = n - b->inner;
    memset(x->opened, 0, (size_t)(3 * n) * sizeof(real));
    for (int d = 0; d <= derivative; d++) {
        for (ptrdiff_t i = 0; i < m; i++) {
            real total = 0;
            for (int r = 0; r <= d; r++) {
                const real *by = slopes + (r * m + i) * joints, *of = b->bound + (r * m + i) * joints;
                const real *s = x->state + (d - r) * n + b->inner, *z = x->opened + (d - r) * n + b->inner;
                const real weight = d == 2 && r == 1 ? 2 : 1;
                for (ptrdiff_t k = 0; k < joints; k++)
                    total -= weight * (by[k] * s[k] + of[k] * z[k]);
            }
            x->right[i] = total;
        }
        solve_dense(m, b->pivoted, b->swaps, x->right);
        for (ptrdiff_t i = 0; i < m; i++)
            x->opened[d * n + b->inner + b->dependent[i]] = x->right[i];
    }
}

/* Find the multipliers of the state: J_d^T mu = (Q - M S'' - C S' - K S)_d for the dependent unknowns. */
static void find_multipliers(const struct beams *b) {
    const struct beam_tangents *x = b->tangents;
    const ptrdiff_t m = b->layout.counts.constraints;
    memcpy(x->forces, b->full_load, (size_t)b->whole * sizeof(real));
    subtract_all(b, x->state, x->forces);
    for (ptrdiff_t i = 0; i < m; i++)
        x->multipliers[i] = x->forces[b->inner + b->dependent[i]];
    solve_dense_transposed(m, b->pivoted, b->swaps, x->multipliers);
}

static void find_load(const struct beams *b, const real *p, const real *v, const real *a, long columns, real *rhs, ptrdiff_t lead,
                 ptrdiff_t stride) {
    const struct beam_tangents *x = b->tangents;
    const ptrdiff_t n = b->whole, m = b->layout.counts.constraints, joints = n - b->inner;
    find_state(b, 2, (const real *const[]){p, v, a}, columns);
    if (m)
        find_multipliers(b);
    for (ptrdiff_t j = 0; j < x->parameters; j++) {
        const real *mass = present(b, j), *damping = mass + x->entries, *stiffness = damping + x->entries;
        const real *force = stiffness + x->entries, *slopes = force + n;
        memcpy(x->forces, force, (size_t)n * sizeof(real));
        subtract(x->entries, x->rows, x->columns, mass, damping, stiffness, n, x->state, x->forces);
        if (m) {
            for (ptrdiff_t i = 0; i < m; i++)
                add_multiple(joints, -x->multipliers[i], slopes + i * joints, x->forces + b->inner);
            find_opened(b, 2, slopes);
            subtract_all(b, x->opened, x->forces);
        }
        beams_reduce_load(b, x->forces, x->load);
        for (ptrdiff_t r = 0; r < b->free; r++)
            rhs[(1 + j) * lead + r * stride] += x->load[r];
    }
}

static void open(const struct beams *b, int derivative, const real *p, const real *v, const real *a, long columns, real *out) {
    const struct beam_tangents *x = b->tangents;
    const ptrdiff_t n = b->whole;
    find_state(b, derivative, (const real *const[]){p, v, a}, columns);
    for (ptrdiff_t j = 0; j < x->parameters; j++) {
        find_opened(b, derivative, present(b, j) + 3 * x->entries + n);
        for (ptrdiff_t i = b->inner; i < n; i++)
            out[i * columns + 1 + j] += x->opened[derivative * n + i];
    }
}

size_t beams_carry(struct beams *b, struct beam_tangents *x, void *memory) {
    static const struct tangents_behaviour behaviour = {prepare, find_load, open};
    const ptrdiff_t times = MOST_STAGES + 1, m = b->layout.counts.constraints;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(x->at, times),
        ARENA_ARRAY(x->between, times * x->points),
        ARENA_ARRAY(x->now, x->parameters * times * numbers(b, x)),
        ARENA_ARRAY(x->first, 3 * b->free),
        ARENA_ARRAY(x->state, 3 * b->whole),
        ARENA_ARRAY(x->opened, 3 * b->whole),
        ARENA_ARRAY(x->forces, b->whole),
        ARENA_ARRAY(x->load, b->free),
        ARENA_ARRAY(x->multipliers, m),
        ARENA_ARRAY(x->right, m),
    };
    if (memory != NULL)
        b->tangents = x, b->tangent = &behaviour, x->known = 0;
    return ARENA_PLACE(arrays, memory);
}
