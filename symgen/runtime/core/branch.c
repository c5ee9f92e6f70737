/* The assembly branch in the steps of a linkage whose motion is prescribed: its pose is a function of time, which the
 * steps of kinematics.h follow. All unknowns form one group. */
#include <string.h>

#include "arena.h"
#include "branch.h"
#include "kinematics.h"
#include "linear.h"

/* Linkages of more coordinates are not checked: the group is a dense matrix. */
enum { MOST_UNKNOWNS = 128 };

/* Content of the memory: the group without couplings, as struct kinematic_groups has it; the followed state; the steps
   and their memory. */
struct branch {
    ptrdiff_t *rows, *columns, *entries, *starts, *couplings;
    real *state;
    struct kinematics *steps;
    void *memory;
};

static int is_checked(const struct equations *e) {
    return e->of == &kernel_behaviour && e->m > 0 && e->n == e->m - e->sizes.redundant && e->n <= MOST_UNKNOWNS;
}

/* Phi, the scales, dPhi/dt at rest and dPhi/dq row by row, from the kernels of `equations`, which stand for the
   parameters. */
static void closure(const real *t, const real *q, const real *u, const real *equations, real *work, real *out) {
    const struct equations *e = (const void *)equations;
    const kernel rates = e->kernels.velocity_constraints;
    const long n = e->n, m = e->m;
    real *drift = out + 2 * m, *slopes = drift + m, *direction = slopes + m * n, *column = direction + n;
    e->kernels.constraints(t, q, u, e->p, work, out);
    memset(direction, 0, (size_t)n * sizeof(real));
    rates(t, q, direction, e->p, work, drift);
    for (long j = 0; j < n; j++) {
        direction[j] = 1;
        rates(t, q, direction, e->p, work, column);
        direction[j] = 0;
        for (long i = 0; i < m; i++)
            slopes[i * n + j] = column[i] - drift[i];
    }
}

/* dPhi/dq a of the accelerations a. */
static void right_side(const real *t, const real *q, const real *u, const real *equations, real *work, real *out) {
    const struct equations *e = (const void *)equations;
    real *drift = out + e->m, *a = drift + e->m;
    e->kernels.accelerations(t, q, u, e->p, work, a);
    e->kernels.velocity_constraints(t, q, e->zero, e->p, work, drift);
    e->kernels.velocity_constraints(t, q, a, e->p, work, out);
    for (long i = 0; i < e->m; i++)
        out[i] -= drift[i];
}

static const struct kinematic_kernels KERNELS = {.closure = closure, .gamma = right_side};

static struct kinematic_sizes sizes_of(const struct equations *e) {
    const ptrdiff_t n = e->n, m = e->m;
    return (struct kinematic_sizes){.n = n, .m = m, .work = e->sizes.work + 1, .out = 4 * m + m * n + n};
}

static size_t place(const struct equations *e, void *memory, struct branch *b) {
    const struct kinematic_sizes sizes = sizes_of(e);
    const struct kinematic_groups one = {.count = 1, .squares = e->n * e->n};
    const struct arena_array arrays[] = {
        ARENA_ARRAY(b->rows, e->n),
        ARENA_ARRAY(b->columns, e->n),
        ARENA_ARRAY(b->entries, 4 * e->n * e->n),
        ARENA_ARRAY(b->starts, 2),
        ARENA_ARRAY(b->couplings, e->n + 1),
        ARENA_ARRAY(b->state, 3 * e->n),
        {&b->steps, symgen_kinematics.kinematics_struct},
        {&b->memory, symgen_kinematics.bytes(&sizes, &one)},
    };
    return ARENA_PLACE(arrays, memory);
}

size_t branch_bytes(const struct equations *e) {
    struct branch b;
    return is_checked(e) ? place(e, NULL, &b) : 0;
}

/* Write the group of the independent constraints; return whether there are as many as unknowns. */
static int take_rows(const struct equations *e, const struct branch *b) {
    ptrdiff_t rank = 0, *entry = b->entries;
    for (ptrdiff_t i = 0; i < e->m; i++)
        if (!e->dropped[i] && rank++ < e->n)
            b->rows[rank - 1] = i;
    b->starts[0] = 0, b->starts[1] = e->n;
    memset(b->couplings, 0, (size_t)(e->n + 1) * sizeof *b->couplings);
    for (ptrdiff_t i = 0; i < e->n; i++) {
        b->columns[i] = i;
        for (ptrdiff_t j = 0; j < e->n; j++, entry += 4) {
            entry[0] = i * e->n + j, entry[1] = 3 * e->m + b->rows[i] * e->n + j;
            entry[2] = b->rows[i], entry[3] = j;
        }
    }
    return rank == e->n;
}

/* The pose at t on the branch of the pose q0 at t0; NULL near a singular pose, where branches meet. */
static const real *followed(const struct equations *e, void *memory, real t0, const real *q0, real t) {
    struct branch b;
    ptrdiff_t reached;
    place(e, memory, &b);
    if (!take_rows(e, &b))
        return NULL;
    const struct kinematic_sizes sizes = sizes_of(e);
    const real length = largest_or_nan(e->out + e->m, e->m);
    const struct kinematic_groups one = {
        .count = 1, .squares = e->n * e->n, .filled = e->n * e->n, .starts = b.starts, .rows = b.rows,
        .columns = b.columns, .entries = b.entries, .coupling_starts = b.couplings, .coupling_columns = b.couplings,
    };
    const struct kinematic_task task = {
        .t = (double)t0, .parameters = (const void *)e, .q = q0, .lengths = &length, .times = &t, .count = 1,
        .rows = b.state, .reached = &reached,
    };
    symgen_kinematics.bind(b.steps, &sizes, &KERNELS, &one, b.memory);
    symgen_kinematics.follow(b.steps, &task);
    return reached == 1 ? b.state : NULL;
}

int return_to_branch(struct equations *e, void *memory, real t0, const real *q0, real t, real *q) {
    const real *there = followed(e, memory, t0, q0, t);
    real apart = 0;
    for (long i = 0; there != NULL && i < e->n; i++)
        apart = real_fmax(apart, real_fabs(there[i] - q[i]));
    if (!(apart > real_sqrt(REAL_EPSILON) * largest_or_nan(e->out + e->m, e->m)))
        return 0;
    memcpy(q, there, (size_t)e->n * sizeof(real));
    return 1;
}
