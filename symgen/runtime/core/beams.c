#include "beams.h"

#include <string.h>

#include "arena.h"
#include "lanes.h"

/* -- memory ----------------------------------------------------------------------------------------------- */

static struct sizes as_equations(const struct beam_layout *x) {
    struct sizes made = {0};
    made.n = (long)x->counts.unknowns;
    made.m = (long)x->counts.constraints;
    made.work = 4 * made.n; /* of accelerations */
    made.rank_tolerance = (double)RANK_TOLERANCE;
    return made;
}

/* Set the numbers of unknowns and of entries. */
static void count(struct beams *b, const struct beam_layout *x) {
    b->whole = x->counts.unknowns;
    b->free = x->counts.unknowns - x->counts.constraints;
    b->inner = x->counts.inner;
    b->border = b->free - b->inner;
    b->modes = x->counts.apart ? x->counts.damped : 0;
    b->banded_entries = b->entries = x->counts.entries;
    if (x->counts.constraints == 0)
        return;
    b->banded_entries = 0;
    for (ptrdiff_t e = 0; e < x->counts.entries; e++)
        b->banded_entries += x->rows[e] < b->inner && x->columns[e] < b->inner;
    b->entries = b->banded_entries + (2 * b->inner + b->border) * b->border;
}

/* Point all arrays into memory, or only count their bytes. */
static size_t place(struct beams *b, const struct beam_layout *x, void *memory) {
    count(b, x);
    const ptrdiff_t n = x->counts.unknowns, m = x->counts.constraints, free = b->free, joints = n - b->inner;
    const ptrdiff_t own = m ? b->entries + 1 : 0, all = x->counts.entries + 1;
    ptrdiff_t largest = 0;
    for (ptrdiff_t k = 0; k < x->counts.pieces; k++)
        if (x->sizes[k] > largest)
            largest = x->sizes[k];
    const struct arena_array arrays[] = {
        ARENA_ARRAY(b->full_mass, all),
        ARENA_ARRAY(b->full_damping, all),
        ARENA_ARRAY(b->full_stiffness, all),
        ARENA_ARRAY(b->full_load, n + 1),
        ARENA_ARRAY(b->mass, own),
        ARENA_ARRAY(b->damping, own),
        ARENA_ARRAY(b->stiffness, own),
        ARENA_ARRAY(b->load, m ? free + 1 : 0),
        ARENA_ARRAY(b->constants, x->counts.constant_count + 1),
        ARENA_ARRAY(b->local, 3 * largest * largest + largest),
        ARENA_ARRAY(b->full_forces, x->counts.damped ? 2 * n * (x->counts.apart ? x->counts.damped : 1) : 0),
        ARENA_ARRAY(b->forces, m ? 2 * free * b->modes : 0),
        ARENA_ARRAY(b->bound, 3 * m * joints),
        ARENA_ARRAY(b->pivoted, m * joints),
        ARENA_ARRAY(b->basis, 3 * joints * b->border),
        ARENA_ARRAY(b->product, m * b->border),
        ARENA_ARRAY(b->system.banded, (3 * x->counts.band + 1) * (b->inner > 0 ? b->inner : 1)),
        ARENA_ARRAY(b->system.right, b->inner * b->border),
        ARENA_ARRAY(b->system.below, b->inner * b->border),
        ARENA_ARRAY(b->system.corner, b->border * b->border),
        ARENA_ARRAY(b->system.panel, panel_size(b->border, x->counts.band)),
        ARENA_ARRAY(b->dependent, m + 1),
        ARENA_ARRAY(b->independent, joints + 1),
        ARENA_ARRAY(b->swaps, m),
        ARENA_ARRAY(b->own_rows, own),
        ARENA_ARRAY(b->own_columns, own),
        ARENA_ARRAY(b->system.pivots, b->inner + 1),
        ARENA_ARRAY(b->system.swaps, b->border),
    };
    b->system.inner = b->inner;
    b->system.border = b->border;
    b->system.band = x->counts.band;
    return ARENA_PLACE(arrays, memory);
}

void beams_count(struct beams *b, const struct beam_layout *layout) {
    memset(b, 0, sizeof *b);
    place(b, layout, NULL);
}

size_t beams_bytes(const struct beam_layout *layout) {
    const struct sizes plain = as_equations(layout);
    struct beams counted;
    return rounded(equations_bytes(&plain)) + place(&counted, layout, NULL);
}

/* Number the matrix entries of the independent unknowns: first between inner unknowns, then in the border. */
static void number_entries(struct beams *b) {
    const ptrdiff_t n = b->inner, m = b->border;
    ptrdiff_t *row = b->own_rows, *column = b->own_columns;
    for (ptrdiff_t e = 0; e < b->layout.counts.entries; e++)
        if (b->layout.rows[e] < n && b->layout.columns[e] < n) {
            *row++ = b->layout.rows[e];
            *column++ = b->layout.columns[e];
        }
    for (int below = 0; below < 2; below++)
        for (ptrdiff_t i = 0; i < n; i++)
            for (ptrdiff_t r = 0; r < m; r++) {
                *row++ = below ? n + r : i;
                *column++ = below ? i : n + r;
            }
    for (ptrdiff_t r = 0; r < m; r++)
        for (ptrdiff_t q = 0; q < m; q++) {
            *row++ = n + r;
            *column++ = n + q;
        }
}

void beams_bind(struct beams *b, struct rigid_motion *motion, const struct beam_layout *layout, void *memory) {
    const struct sizes plain = as_equations(layout);
    const struct kernels none = {0};
    equations_bind(&b->base, &plain, &none, memory);
    b->base.of = &beam_behaviour;
    b->base.owner = b;
    b->motion = motion;
    b->layout = *layout;
    b->analysis = IN_MOTION;
    place(b, layout, (char *)memory + rounded(equations_bytes(&plain)));
    if (layout->counts.constraints) {
        number_entries(b);
        b->rows = b->own_rows;
        b->columns = b->own_columns;
    } else {
        b->rows = layout->rows;
        b->columns = layout->columns;
        b->mass = b->full_mass;
        b->damping = b->full_damping;
        b->stiffness = b->full_stiffness;
        b->load = b->full_load;
        b->forces = b->full_forces;
    }
}

/* -- assembly --------------------------------------------------------------------------------------------- */

/* Resolve a vector, given in axes of the direction (c, s), on the axes in which (c, s) is given. */
static void turn_vector(real *x, real *y, real c, real s) {
    const real along = *x, across = *y;
    *x = c * along - s * across;
    *y = s * along + c * across;
}

/* Resolve the rows and columns of one joint's displacements on fixed axes instead of the link's axes. */
static void turn_end(real *a, ptrdiff_t n, ptrdiff_t u, ptrdiff_t w, real c, real s) {
    real *restrict along = a + n * u, *restrict across = a + n * w;
    for (ptrdiff_t i = 0; i < n; i++) {
        const real x = along[i], y = across[i];
        along[i] = c * x - s * y;
        across[i] = s * x + c * y;
    }
    for (ptrdiff_t i = 0; i < n; i++) {
        const real x = a[n * i + u], y = a[n * i + w];
        a[n * i + u] = c * x - s * y;
        a[n * i + w] = s * x + c * y;
    }
}

/* Matrices and load of superelement k in its link's axes into m, d, g (n x n each) and q (n): constants times the
 * weights of the kernel `links`. */
LANES static void in_link_axes(const struct beams *b, ptrdiff_t k, real *restrict m, real *restrict d, real *restrict g,
                               real *restrict q) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n, link = x->link_of[k];
    const real *w = b->motion->motion + MOTION * link;
    const real *matrices = b->constants + x->constants_at[k], *mass = matrices + OF_MASS * nn;
    const real *centrifugal = matrices + OF_CENTRIFUGAL * nn, *gyroscopic = matrices + OF_GYROSCOPIC * nn;
    const real *stiffness = matrices + OF_STIFFNESS * nn, *damping = matrices + OF_DAMPING * nn;
    const real *axial0 = matrices + OF_AXIAL0 * nn, *axial1 = matrices + OF_AXIAL1 * nn;
    const real *axial2 = matrices + OF_AXIAL2 * nn, *vectors = matrices + MATRICES * nn, *force = vectors + VECTORS * n;
    const int inertial = b->analysis != QUASI_STATIC;
    const real by_rate = w[DAMPING_GYROSCOPIC];
    const real outward = inertial ? w[STIFFNESS_CENTRIFUGAL] : 0, turned = inertial ? w[STIFFNESS_GYROSCOPIC] : 0;
    const real pull0 = w[STIFFNESS_GEOMETRIC0], pull1 = w[STIFFNESS_GEOMETRIC1], pull2 = w[STIFFNESS_GEOMETRIC2];
    const real load_x = w[LOAD_X], load_y = w[LOAD_Y], load_out = w[LOAD_OUT], load_turn = w[LOAD_TURN];
    memcpy(m, mass, (size_t)nn * sizeof(real));
    for (ptrdiff_t i = 0; i < nn; i++) {
        d[i] = damping[i] + by_rate * gyroscopic[i];
        g[i] = stiffness[i] + outward * centrifugal[i] + turned * gyroscopic[i] + pull0 * axial0[i] +
               pull1 * axial1[i] + pull2 * axial2[i];
    }
    for (ptrdiff_t i = 0; i < n; i++)
        q[i] = load_x * vectors[OF_LOAD_X * n + i] + load_y * vectors[OF_LOAD_Y * n + i] +
               load_out * vectors[OF_LOAD_OUT * n + i] + load_turn * vectors[OF_LOAD_TURN * n + i];
    const ptrdiff_t vectors_of_force = OF_FORCE_AXIAL * n;
    for (ptrdiff_t e = x->loads_at[link]; e < x->loads_at[link + 1]; e++) {
        const real *f = b->motion->loads + APPLIED * e, *axial = force + vectors_of_force;
        const real *follower_x = axial + nn, *follower_y = follower_x + nn;
        const real force_x = f[LOAD_FORCE_X], force_y = f[LOAD_FORCE_Y], pull = f[STIFFNESS_GEOMETRIC_FORCE];
        const real along = f[STIFFNESS_FOLLOWER_X], across = f[STIFFNESS_FOLLOWER_Y];
        for (ptrdiff_t i = 0; i < n; i++)
            q[i] += force_x * force[OF_FORCE_X * n + i] + force_y * force[OF_FORCE_Y * n + i];
        for (ptrdiff_t i = 0; i < nn; i++)
            g[i] += pull * axial[i] + along * follower_x[i] + across * follower_y[i];
        force = follower_y + nn;
    }
}

/* Add the damping and stiffness terms due to the rotation of the joints' displacements to d and g, by the weights w. */
static void add_turning_ends(const struct beams *b, ptrdiff_t k, const real *w, real *d, real *g) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n;
    const real *matrices = b->constants + x->constants_at[k], *mass = matrices + OF_MASS * nn;
    const real *gyroscopic = matrices + OF_GYROSCOPIC * nn, *damping = matrices + OF_DAMPING * nn;
    const real ends = w[STIFFNESS_MASS_ENDS];
    for (ptrdiff_t e = k * x->counts.most_joints; e < (k + 1) * x->counts.most_joints; e++) {
        if (x->joints[2 * e] < 0)
            continue;
        /* u and w at this joint rotated by -90 deg: the columns are minus the column w, and the column u. */
        for (int j = 0; j < 2; j++) {
            const ptrdiff_t at = x->joints[2 * e + j], other = x->joints[2 * e + 1 - j];
            const real sign = j == 0 ? -1 : 1;
            const real mass_rate = sign * w[DAMPING_MASS_QUARTER], mass_quarter = sign * w[STIFFNESS_MASS_QUARTER];
            const real gyroscopic_quarter = sign * w[STIFFNESS_GYROSCOPIC_QUARTER];
            const real damping_quarter = sign * w[STIFFNESS_DAMPING_QUARTER];
            for (ptrdiff_t i = 0; i < n; i++) {
                d[n * i + at] += mass_rate * mass[n * i + other];
                g[n * i + at] += mass_quarter * mass[n * i + other] + ends * mass[n * i + at] +
                                 gyroscopic_quarter * gyroscopic[n * i + other] + damping_quarter * damping[n * i + other];
            }
        }
    }
}

/* Add one superelement, with the rotation of its joints to second order. */
static void add_piece(struct beams *b, ptrdiff_t k) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n;
    const ptrdiff_t *places = x->places + x->places_at[k], *slots = x->slots + x->slots_at[k];
    const real *weights = b->motion->motion + MOTION * x->link_of[k], c = weights[COSINE], s = weights[SINE];
    real *m = b->local, *d = m + nn, *g = d + nn, *q = g + nn;
    in_link_axes(b, k, m, d, g, q);
    if (!x->thesis && b->analysis != QUASI_STATIC)
        add_turning_ends(b, k, weights, d, g);
    for (ptrdiff_t e = k * x->counts.most_joints; e < (k + 1) * x->counts.most_joints; e++) {
        const ptrdiff_t u = x->joints[2 * e], w = x->joints[2 * e + 1];
        if (u < 0)
            continue;
        turn_end(m, n, u, w, c, s);
        turn_end(d, n, u, w, c, s);
        turn_end(g, n, u, w, c, s);
        turn_vector(q + u, q + w, c, s);
    }
    for (ptrdiff_t i = 0; i < n; i++)
        if (places[i] >= 0)
            b->full_load[places[i]] += q[i];
    for (ptrdiff_t i = 0; i < nn; i++)
        if (slots[i] >= 0) {
            b->full_mass[slots[i]] += m[i];
            b->full_damping[slots[i]] += d[i];
            b->full_stiffness[slots[i]] += g[i];
        }
}

/* Add the force of a mode on superelement k, constant in its link's axes, to f; its rate by the rotation to g. */
static void add_force(const struct beams *b, ptrdiff_t k, const real *own, real *f, real *g) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], *places = x->places + x->places_at[k];
    const real *weights = b->motion->motion + MOTION * x->link_of[k], c = weights[COSINE], s = weights[SINE];
    const real by_rate = x->thesis ? 0 : weights[STIFFNESS_DAMPING_QUARTER];
    real *a = b->local, *rate = a + n;
    memcpy(a, own, (size_t)n * sizeof(real));
    memset(rate, 0, (size_t)n * sizeof(real));
    for (ptrdiff_t e = k * x->counts.most_joints; e < (k + 1) * x->counts.most_joints; e++) {
        const ptrdiff_t u = x->joints[2 * e], w = x->joints[2 * e + 1];
        if (u < 0)
            continue;
        turn_vector(a + u, a + w, c, s);
        /* (u, w) rotated by -90 deg, as in add_turning_ends, in fixed axes. */
        rate[u] = -by_rate * a[w];
        rate[w] = by_rate * a[u];
    }
    for (ptrdiff_t i = 0; i < n; i++)
        if (places[i] >= 0) {
            f[places[i]] += a[i];
            g[places[i]] += rate[i];
        }
}

/* Add the damping of modes: f (f S' + g S) for each mode, where f S' + g S is the rate of its modal coordinate. If
   modes are few, f and g are stored and the matrices stay banded. */
static void add_modes(struct beams *b) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = b->whole;
    const real *own = b->constants + x->counts.damped_at;
    for (ptrdiff_t mode = 0; mode < x->counts.damped; mode++) {
        real *f = b->full_forces + (x->counts.apart ? 2 * n * mode : 0), *g = f + n;
        memset(f, 0, (size_t)(2 * n) * sizeof(real));
        for (ptrdiff_t k = 0; k < x->counts.pieces; own += x->sizes[k++])
            add_force(b, k, own, f, g);
        for (ptrdiff_t i = 0; i < x->counts.coordinates; i++)
            if (x->joint_places[i] >= 0)
                f[x->joint_places[i]] += own[i];
        own += x->counts.coordinates;
        for (ptrdiff_t i = 0; !x->counts.apart && i < n; i++)
            for (ptrdiff_t j = 0; j < n; j++) {
                b->full_damping[n * i + j] += f[i] * f[j];
                b->full_stiffness[n * i + j] += f[i] * g[j];
            }
    }
}

static void add_block(real *to, const ptrdiff_t *slots, ptrdiff_t count, const real *from) {
    for (ptrdiff_t i = 0; i < count; i++)
        to[slots[i]] += from[i];
}

/* Add mass, damping, stiffness and load of the joints, and flywheel and motor of an elastic crank. */
static void add_joints(struct beams *b) {
    const struct beam_layout *x = &b->layout;
    const real *found = b->motion->joined, *shaft = b->motion->shaft;
    for (ptrdiff_t i = 0; i < x->counts.coordinates; i++)
        if (x->joint_places[i] >= 0)
            b->full_load[x->joint_places[i]] += found[x->joint_at[BLOCK_LOAD] + i];
    add_block(b->full_mass, x->mass_slots, x->counts.masses, found + x->joint_at[BLOCK_MASS_MATRIX]);
    add_block(b->full_damping, x->damping_slots, x->counts.dampings, found + x->joint_at[BLOCK_DAMPING]);
    add_block(b->full_stiffness, x->stiffness_slots, x->counts.stiffnesses, found + x->joint_at[BLOCK_STIFFNESS]);
    if (x->counts.shaft >= 0 && b->motion->kernels.shaft) {
        b->full_mass[x->counts.shaft_slot] += shaft[SHAFT_MASS];
        b->full_damping[x->counts.shaft_slot] += shaft[SHAFT_DAMPING];
        b->full_stiffness[x->counts.shaft_slot] += shaft[SHAFT_STIFFNESS];
        b->full_load[x->counts.shaft] += shaft[SHAFT_LOAD];
    }
}

int beams_assemble(struct beams *b, real t, int choose) {
    const size_t entries = (size_t)b->layout.counts.entries * sizeof(real);
    const int status = b->analysis == AT_REST ? motion_at_rest(b->motion, t) : motion_at(b->motion, t);
    if (status != DONE)
        return status;
    memset(b->full_mass, 0, entries);
    memset(b->full_damping, 0, entries);
    memset(b->full_stiffness, 0, entries);
    memset(b->full_load, 0, (size_t)b->whole * sizeof(real));
    for (ptrdiff_t k = 0; k < b->layout.counts.pieces; k++)
        add_piece(b, k);
    add_joints(b);
    if (b->analysis != QUASI_STATIC)
        add_modes(b);
    else if (b->layout.counts.damped)
        memset(b->full_forces, 0, (size_t)(2 * b->whole * b->modes) * sizeof(real));
    b->base.account->evaluations++;
    return b->layout.counts.constraints ? beams_reduce(b, choose) : DONE;
}

void beams_holding(const struct beams *b, ptrdiff_t k, const real *s, real *f) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n, *places = x->places + x->places_at[k];
    const real *weights = b->motion->motion + MOTION * x->link_of[k], c = weights[COSINE], d = weights[SINE];
    real *own = b->local, *g = own + 2 * nn, *q = g + nn;
    in_link_axes(b, k, own, own + nn, g, q);
    for (ptrdiff_t i = 0; i < n; i++)
        own[i] = places[i] < 0 ? 0 : s[places[i]];
    for (ptrdiff_t e = k * x->counts.most_joints; e < (k + 1) * x->counts.most_joints; e++)
        if (x->joints[2 * e] >= 0)
            turn_vector(own + x->joints[2 * e], own + x->joints[2 * e + 1], c, -d);
    for (ptrdiff_t i = 0; i < n; i++) {
        f[i] = -q[i];
        for (ptrdiff_t j = 0; j < n; j++)
            f[i] += g[n * i + j] * own[j];
    }
}

void beams_unbalanced(const struct beams *b, const real *s, real *out) {
    const struct beam_layout *x = &b->layout;
    const real *found = b->motion->joined, *stiffness = found + x->joint_at[BLOCK_STIFFNESS], *shaft = b->motion->shaft;
    memset(out, 0, (size_t)b->whole * sizeof(real));
    for (ptrdiff_t i = 0; i < x->counts.coordinates; i++)
        if (x->joint_places[i] >= 0)
            out[x->joint_places[i]] -= found[x->joint_at[BLOCK_LOAD] + i];
    for (ptrdiff_t i = 0; i < x->counts.stiffnesses; i++)
        out[x->rows[x->stiffness_slots[i]]] += stiffness[i] * s[x->columns[x->stiffness_slots[i]]];
    if (x->counts.shaft >= 0 && b->motion->kernels.shaft)
        out[x->counts.shaft] += shaft[SHAFT_STIFFNESS] * s[x->counts.shaft] - shaft[SHAFT_LOAD];
    for (ptrdiff_t k = 0; k < x->counts.pieces; k++) {
        const ptrdiff_t *places = x->places + x->places_at[k];
        const real *weights = b->motion->motion + MOTION * x->link_of[k];
        real *f = b->local + x->sizes[k] * x->sizes[k]; /* beams_holding writes there only after its last use of f */
        beams_holding(b, k, s, f);
        for (ptrdiff_t e = k * x->counts.most_joints; e < (k + 1) * x->counts.most_joints; e++)
            if (x->joints[2 * e] >= 0)
                turn_vector(f + x->joints[2 * e], f + x->joints[2 * e + 1], weights[COSINE], weights[SINE]);
        for (ptrdiff_t i = 0; i < x->sizes[k]; i++)
            if (places[i] >= 0)
                out[places[i]] += f[i];
    }
}

void subtract_forces_of_modes(const struct beams *b, long columns, const real *p, const real *v, ptrdiff_t lead, real *rhs) {
    for (ptrdiff_t mode = 0; mode < b->modes; mode++) {
        const real *f = b->forces + 2 * b->free * mode, *g = f + b->free;
        for (long c = 0; c < columns; c++) {
            real rate = 0;
            for (ptrdiff_t i = 0; i < b->free; i++)
                rate += f[i] * v[i * columns + c] + g[i] * p[i * columns + c];
            for (ptrdiff_t i = 0; i < b->free; i++)
                rhs[c * lead + i] -= f[i] * rate;
        }
    }
}
