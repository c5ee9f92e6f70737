#include "beams.h"

#include <string.h>

#include "memory.h"

/* Matrices of a superelement, each n x n, and behind them its load vectors; then of each force two and a matrix. */
enum { MATRICES = 8, LOADS = 4 };

/* -- memory ----------------------------------------------------------------------------------------------- */

static struct sizes as_equations(const struct beam_layout *x) {
    struct sizes made = {0};
    made.n = (long)x->unknowns;
    made.m = (long)x->constraints;
    made.work = 1;
    made.rank_tolerance = (double)BEAM_RANK;
    return made;
}

/* Give out the arrays one behind the other, or, where `at` is NULL, only count their bytes. */
static size_t carve(struct beams *b, const struct beam_layout *x, char *at) {
    const ptrdiff_t n = x->unknowns, m = x->constraints, free = n - m, entries = m ? free * free : x->entries;
    const ptrdiff_t band = m ? free - 1 : x->band, some = m ? entries + 1 : 0;
    ptrdiff_t largest = 0;
    for (ptrdiff_t k = 0; k < x->pieces; k++)
        if (x->sizes[k] > largest)
            largest = x->sizes[k];
    const struct { real **array; ptrdiff_t size; } reals[] = {
        {&b->full_mass, x->entries + 1}, {&b->full_damping, x->entries + 1}, {&b->full_stiffness, x->entries + 1},
        {&b->full_load, n + 1}, {&b->mass, some}, {&b->damping, some}, {&b->stiffness, some},
        {&b->load, m ? free + 1 : 0}, {&b->constants, x->constant_count + 1},
        {&b->local, 3 * largest * largest + largest}, {&b->bound, (3 * m + 1) * n}, {&b->pivoted, (m + 1) * n},
        {&b->basis, m ? 3 * n * free : 0}, {&b->product, m ? n * free : 0},
        {&b->banded, (3 * band + 1) * (free > 0 ? free : 1)}, {&b->solution, n + 1}, {&b->state, 2 * n + 1},
    };
    const struct { ptrdiff_t **array; ptrdiff_t size; } numbers[] = {
        {&b->dependent, m + 1}, {&b->independent, n + 1}, {&b->own_rows, some}, {&b->own_columns, some},
    };
    size_t taken = 0;
    for (size_t i = 0; i < sizeof reals / sizeof *reals; i++) {
        if (at)
            *reals[i].array = (real *)(void *)(at + taken);
        taken += rounded((size_t)reals[i].size * sizeof(real));
    }
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        if (at)
            *numbers[i].array = (ptrdiff_t *)(void *)(at + taken);
        taken += rounded((size_t)numbers[i].size * sizeof(ptrdiff_t));
    }
    if (at)
        b->pivots = (int *)(void *)(at + taken);
    return taken + (size_t)(n + 1) * sizeof(int);
}

size_t beams_bytes(const struct beam_layout *layout) {
    const struct sizes plain = as_equations(layout);
    struct beams counted;
    return rounded(equations_bytes(&plain)) + carve(&counted, layout, NULL);
}

void beams_bind(struct beams *b, struct rigid_motion *motion, const struct beam_layout *layout,
                const struct lapack *lapack, void *memory) {
    const struct sizes plain = as_equations(layout);
    const struct kernels none = {0};
    equations_bind(&b->base, &plain, &none, memory);
    b->base.of = &beam_behaviour;
    b->base.owner = b;
    b->motion = motion;
    b->layout = *layout;
    b->lapack = *lapack;
    b->resting = 0;
    b->whole = layout->unknowns;
    b->free = layout->unknowns - layout->constraints;
    carve(b, layout, (char *)memory + rounded(equations_bytes(&plain)));
    if (layout->constraints) {
        b->entries = b->free * b->free;
        b->band = b->free - 1;
        for (ptrdiff_t e = 0; e < b->entries; e++) {
            b->own_rows[e] = e / b->free;
            b->own_columns[e] = e % b->free;
        }
        b->rows = b->own_rows;
        b->columns = b->own_columns;
    } else {
        b->entries = layout->entries;
        b->band = layout->band;
        b->rows = layout->rows;
        b->columns = layout->columns;
        b->mass = b->full_mass;
        b->damping = b->full_damping;
        b->stiffness = b->full_stiffness;
        b->load = b->full_load;
    }
}

/* -- assembly --------------------------------------------------------------------------------------------- */

/* How a link moves, seen in its own axes. */
struct pose {
    real c, s;          /* direction */
    real w, turn;       /* rate and acceleration of turning */
    real along, across; /* acceleration of its start, less gravity */
    real pull;          /* axial force */
};

static struct pose pose_of(const real *x) {
    const real length = real_sqrt(x[0] * x[0] + x[1] * x[1]);
    struct pose p;
    p.c = x[0] / length;
    p.s = x[1] / length;
    p.w = (p.c * x[3] - p.s * x[2]) / length;
    p.turn = (p.c * x[5] - p.s * x[4]) / length - 2 * p.w * (p.c * x[2] + p.s * x[3]) / length;
    p.along = p.c * x[6] + p.s * x[7];
    p.across = p.c * x[7] - p.s * x[6];
    p.pull = -(p.c * x[8] + p.s * x[9]);
    return p;
}

/* Turn the rows and columns of one end's displacements from the link's axes to fixed axes. */
static void turn_end(real *a, ptrdiff_t n, ptrdiff_t u, ptrdiff_t w, real c, real s) {
    for (ptrdiff_t i = 0; i < n; i++) {
        const real x = a[n * u + i], y = a[n * w + i];
        a[n * u + i] = c * x - s * y;
        a[n * w + i] = s * x + c * y;
    }
    for (ptrdiff_t i = 0; i < n; i++) {
        const real x = a[n * i + u], y = a[n * i + w];
        a[n * i + u] = c * x - s * y;
        a[n * i + w] = s * x + c * y;
    }
}

/* Matrices and load of superelement k in its link's axes, Eq. (7.27), into m, d, g (n x n each) and q (n). */
static void in_link_axes(const struct beams *b, ptrdiff_t k, const struct pose *p, real *m, real *d, real *g, real *q) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n, link = x->link_of[k];
    const real *mass = b->constants + x->constants_at[k], *centrifugal = mass + nn, *gyroscopic = centrifugal + nn;
    const real *stiffness = gyroscopic + nn, *damping = stiffness + nn, *tension = damping + nn;
    const real *loads = mass + MATRICES * nn, *force = loads + LOADS * n;
    const real ww = p->w * p->w;
    memcpy(m, mass, (size_t)nn * sizeof(real));
    for (ptrdiff_t i = 0; i < nn; i++) {
        d[i] = damping[i] - 2 * p->w * gyroscopic[i];
        g[i] = stiffness[i] - ww * centrifugal[i] - p->turn * gyroscopic[i] + p->pull * tension[i] +
               p->along * tension[nn + i] - ww * tension[2 * nn + i];
    }
    for (ptrdiff_t i = 0; i < n; i++)
        q[i] = -p->along * loads[i] - p->across * loads[n + i] + ww * loads[2 * n + i] - p->turn * loads[3 * n + i];
    for (ptrdiff_t e = x->loads_at[link]; e < x->loads_at[link + 1]; e++, force += 2 * n + nn) {
        const real *f = b->motion->loads + 2 * e;
        const real along = p->c * f[0] + p->s * f[1], across = p->c * f[1] - p->s * f[0];
        for (ptrdiff_t i = 0; i < n; i++)
            q[i] += along * force[i] + across * force[n + i];
        for (ptrdiff_t i = 0; i < nn; i++)
            g[i] -= along * force[2 * n + i];
    }
}

/* Add to d and g what the turning of the end displacements gives, to second order. */
static void add_turning_ends(const struct beams *b, ptrdiff_t k, const struct pose *p, real *d, real *g) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n;
    const real *mass = b->constants + x->constants_at[k], *gyroscopic = mass + 2 * nn, *damping = mass + 4 * nn;
    const real ww = p->w * p->w;
    for (int e = 0; e < 2; e++) {
        if (x->ends[4 * k + 2 * e] < 0)
            continue;
        /* Columns u and w of this end: X J^T is -X's column w, and X's column u. */
        for (int j = 0; j < 2; j++) {
            const ptrdiff_t at = x->ends[4 * k + 2 * e + j], other = x->ends[4 * k + 2 * e + 1 - j];
            const real sign = j == 0 ? -1 : 1;
            for (ptrdiff_t i = 0; i < n; i++) {
                const real crossed = sign * mass[n * i + other];
                d[n * i + at] += 2 * p->w * crossed;
                g[n * i + at] += p->turn * crossed - ww * mass[n * i + at] -
                                 2 * ww * sign * gyroscopic[n * i + other] + p->w * sign * damping[n * i + other];
            }
        }
    }
}

/* Add one superelement, with the rotation of its ends to second order. */
static void add_piece(struct beams *b, ptrdiff_t k) {
    const struct beam_layout *x = &b->layout;
    const ptrdiff_t n = x->sizes[k], nn = n * n;
    const ptrdiff_t *places = x->places + x->places_at[k], *slots = x->slots + x->slots_at[k];
    const struct pose p = pose_of(b->motion->motion + MOTION * x->link_of[k]);
    real *m = b->local, *d = m + nn, *g = d + nn, *q = g + nn;
    in_link_axes(b, k, &p, m, d, g, q);
    if (!x->thesis)
        add_turning_ends(b, k, &p, d, g);
    for (int e = 0; e < 2; e++) {
        const ptrdiff_t u = x->ends[4 * k + 2 * e], w = x->ends[4 * k + 2 * e + 1];
        if (u < 0)
            continue;
        turn_end(m, n, u, w, p.c, p.s);
        turn_end(d, n, u, w, p.c, p.s);
        turn_end(g, n, u, w, p.c, p.s);
        const real along = q[u], across = q[w];
        q[u] = p.c * along - p.s * across;
        q[w] = p.s * along + p.c * across;
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

static void add_block(real *to, const ptrdiff_t *slots, ptrdiff_t count, const real *from) {
    for (ptrdiff_t i = 0; i < count; i++)
        to[slots[i]] += from[i];
}

/* Add what is not elastic, and flywheel and motor on an elastic crank. */
static void add_joints(struct beams *b) {
    const struct beam_layout *x = &b->layout;
    const real *found = b->motion->joined, *turning = b->motion->turning;
    for (ptrdiff_t i = 0; i < x->coordinates; i++)
        if (x->joint_places[i] >= 0)
            b->full_load[x->joint_places[i]] += found[x->joint_at[0] + i];
    add_block(b->full_mass, x->mass_slots, x->masses, found + x->joint_at[1]);
    add_block(b->full_damping, x->damping_slots, x->dampings, found + x->joint_at[2]);
    add_block(b->full_stiffness, x->stiffness_slots, x->stiffnesses, found + x->joint_at[3]);
    if (x->shaft < 0)
        return;
    b->full_mass[x->shaft_slot] += R(x->flywheel);
    if (b->motion->kernels.torque) {
        b->full_load[x->shaft] += turning[0];
        b->full_stiffness[x->shaft_slot] -= turning[1];
        b->full_damping[x->shaft_slot] -= turning[2];
    }
}

int beams_assemble(struct beams *b, real t, int choose) {
    const size_t entries = (size_t)b->layout.entries * sizeof(real);
    const int status = b->resting ? motion_at_rest(b->motion, t) : motion_at(b->motion, t);
    if (status != DONE)
        return status;
    memset(b->full_mass, 0, entries);
    memset(b->full_damping, 0, entries);
    memset(b->full_stiffness, 0, entries);
    memset(b->full_load, 0, (size_t)b->whole * sizeof(real));
    for (ptrdiff_t k = 0; k < b->layout.pieces; k++)
        add_piece(b, k);
    add_joints(b);
    b->base.account->evaluations++;
    return b->layout.constraints ? beams_reduce(b, choose) : DONE;
}
