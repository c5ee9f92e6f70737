#include "rigid_motion.h"

#include <string.h>

#include "arena.h"
#include "branch.h"
#include "lanes.h"

/* Largest number of strides between two evaluations: tens of thousands of revolutions. */
#define FARTHEST R(1e7)

/* Point all arrays into memory, or only count their bytes. */
static size_t place(struct rigid_motion *m, const struct equations *e, const struct motion_sizes *sizes, void *memory) {
    const ptrdiff_t parameters = e->sizes.parameters, dim = e->dim, out = e->n + e->m + 2;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(m->solved, 1),
        ARENA_ARRAY(m->t, 1),
        ARENA_ARRAY(m->y, dim + 1),
        ARENA_ARRAY(m->began, dim + 1),
        ARENA_ARRAY(m->before, e->n + 1),
        ARENA_ARRAY(m->still, dim + out),
        ARENA_ARRAY(m->out, out),
        ARENA_ARRAY(m->motion, sizes->links + 1),
        ARENA_ARRAY(m->joined, sizes->joints + 1),
        ARENA_ARRAY(m->shaft, sizes->shaft + 1),
        ARENA_ARRAY(m->loads, sizes->loads + 1),
        ARENA_ARRAY(m->p, parameters + sizes->setup + 1),
        ARENA_ARRAY(m->joints_p, parameters + sizes->joints_setup + 1),
        {&m->branch, branch_bytes(e)},
    };
    return ARENA_PLACE(arrays, memory);
}

size_t motion_bytes(const struct equations *e, const struct motion_sizes *sizes) {
    struct rigid_motion counted;
    return place(&counted, e, sizes, NULL);
}

/* Copy the references of angles in loads to the parameters of the kernels of links and joints. */
static void take_references(struct rigid_motion *m) {
    const struct equations *e = m->e;
    const long parameters = e->sizes.parameters;
    copy(e->p, parameters, m->p);
    copy(e->p, parameters, m->joints_p);
    set_up_with(m->kernels.setup, parameters, m->p);
    set_up_with(m->kernels.joints_setup, parameters, m->joints_p);
}

void motion_bind(struct rigid_motion *m, struct equations *e, const struct motion_kernels *kernels, const struct motion_sizes *sizes,
                 double stride, void *memory) {
    place(m, e, sizes, memory);
    m->driven = branch_bytes(e) > 0;
    m->e = e;
    m->kernels = *kernels;
    m->sizes = *sizes;
    m->stride = R(stride);
    take_references(m);
}

/* Move the references of angles in loads along with the state. */
static void wind(struct rigid_motion *m) {
    if (m->e->sizes.windings == 0)
        return;
    look_at_events(m->e, *m->t, m->y);
    if (follow_references(m->e))
        take_references(m);
}

/* At the start of the motion, angles in loads are within half a revolution of zero. */
static void begin_windings(struct rigid_motion *m) {
    struct equations *e = m->e;
    if (e->sizes.windings == 0)
        return;
    memset(references_of_angles(e), 0, (size_t)e->sizes.windings * sizeof(real));
    set_up(e);
    take_references(m);
    wind(m);
}

void motion_start(struct rigid_motion *m, real t, const real *y) {
    memcpy(m->y, y, (size_t)m->e->dim * sizeof(real));
    memcpy(m->began, y, (size_t)m->e->dim * sizeof(real));
    *m->t = m->began_at = t;
    *m->solved = 0;
    begin_windings(m);
}

void motion_follow(struct rigid_motion *m, const void *rows, const void *references, long count, double spacing,
                   long absent) {
    m->path = (struct motion_path){rows, references, count, absent, R(spacing)};
}

/* Read the references of angles in loads from a row of the path. */
static void wind_to(struct rigid_motion *m, long row) {
    struct equations *e = m->e;
    const size_t bytes = (size_t)e->sizes.windings * sizeof(real);
    const real *wanted = m->path.references + row * e->sizes.windings;
    if (bytes == 0 || memcmp(wanted, references_of_angles(e), bytes) == 0)
        return;
    memcpy(references_of_angles(e), wanted, bytes);
    set_up(e);
    take_references(m);
}

/* Interpolate the state at a time from the path by Hermite polynomials of degree 5, and project it onto the
   constraints. */
static int interpolated(struct rigid_motion *m, real t) {
    struct equations *e = m->e;
    const struct motion_path *path = &m->path;
    const real h = path->spacing, place = t / h;
    if (t == *m->t && *m->solved)
        return DONE;
    if (!(place > R(-1e-6) && place < (real)(path->count - 1) + R(1e-6)))
        return NOT_FINITE;
    long k = (long)place;
    if (k > path->count - 2)
        k = path->count - 2;
    const real s = place - (real)k, r = 1 - s, ss = s * s, rr = r * r;
    /* Weights of q, h q' and h^2 q'' at both ends, and their rates; those at the second end by symmetry. */
    const real far = ss * s * (10 - s * (15 - 6 * s)), turn = 30 * ss * rr / h;
    const real w[] = {1 - far, s * rr * r * (1 + 3 * s) * h, ss * rr * r / 2 * h * h,
                      far, -r * ss * s * (1 + 3 * r) * h, rr * ss * s / 2 * h * h};
    const real v[] = {-turn, rr * (1 + 2 * s - 15 * ss), s * rr * (2 - 5 * s) / 2 * h,
                      turn, ss * (1 + 2 * r - 15 * rr), -r * ss * (2 - 5 * r) / 2 * h};
    const long n = e->n;
    const real *from = path->rows + 3 * n * k;
    for (long i = 0; i < n; i++) {
        real q = 0, u = 0;
        for (long j = 0; j < 6; j++) {
            q += w[j] * from[n * j + i];
            u += v[j] * from[n * j + i];
        }
        m->y[i] = q;
        m->y[n + i] = u;
    }
    *m->solved = 0;
    *m->t = t;
    const int status = e->of->project(e, t, m->y);
    if (status != DONE)
        return status;
    wind_to(m, k);
    e->of->accelerate(e, t, m->y);
    *m->solved = 1;
    return DONE;
}

/* Accelerations and multipliers, the argument of the kernels. */
static real *solution(struct rigid_motion *m) {
    const struct equations *e = m->e;
    if (m->path.rows == NULL)
        return e->out;
    const long before = e->n + m->path.absent, after = e->m - m->path.absent;
    copy(e->out, before, m->out);
    m->out[before] = 0;
    copy(e->out + before, after, m->out + before + 1);
    return m->out;
}

/* Move the state to a near time; write accelerations and multipliers to `out` of the equations. */
static int move_state(struct rigid_motion *m, real t) {
    struct equations *e = m->e;
    const real h = t - *m->t;
    real *y = m->y;
    if (h == 0 && *m->solved)
        return DONE;
    const double sound = e->account->soundness;
    memcpy(m->before, y, (size_t)e->n * sizeof(real));
    if (h != 0) {
        if (!*m->solved)
            e->of->accelerate(e, *m->t, y);
        for (long i = 0; i < e->n; i++) {
            y[i] += h * (y[e->n + i] + h / 2 * e->out[i]);
            y[e->n + i] += h * e->out[i];
        }
    }
    *m->solved = 0;
    int status = e->of->project(e, t, y);
    if (m->driven && fmin(sound, e->account->soundness) < NEAR) {
        if (status == PROJECTION_FAILED)
            memcpy(y, m->before, (size_t)e->n * sizeof(real));
        if (return_to_branch(e, m->branch, *m->t, m->before, t, y))
            status = e->of->project(e, t, y);
    }
    if (status != DONE)
        return status;
    *m->t = t;
    wind(m);
    e->of->accelerate(e, t, y);
    *m->solved = 1;
    return DONE;
}

/* Move the state to any time, from the present state or from the start, whichever is nearer. */
static int followed(struct rigid_motion *m, real t) {
    struct equations *e = m->e;
    if (real_fabs(t - m->began_at) < real_fabs(t - *m->t)) {
        memcpy(m->y, m->began, (size_t)e->dim * sizeof(real));
        *m->t = m->began_at;
        *m->solved = 0;
        begin_windings(m);
    }
    const real start = *m->t;
    const real steps = real_fabs(t - start) / m->stride;
    if (!(steps <= FARTHEST))
        return NOT_FINITE;
    const long count = (long)steps + (steps > (long)steps);
    for (long k = 1; k < count; k++) {
        const int status = move_state(m, start + (t - start) * k / count);
        if (status != DONE)
            return status;
    }
    return move_state(m, t);
}

int motion_at(struct rigid_motion *m, real t) {
    const int status = m->path.rows ? interpolated(m, t) : followed(m, t);
    if (status != DONE)
        return status;
    const real *q = m->y, *u = m->y + m->e->n;
    real *out = solution(m);
    m->kernels.links(m->t, q, u, m->p, out, m->motion);
    m->kernels.joints(m->t, q, u, m->joints_p, out, m->joined);
    if (m->kernels.shaft)
        m->kernels.shaft(m->t, q, u, m->p, out, m->shaft);
    if (m->kernels.loads)
        m->kernels.loads(m->t, q, u, m->p, out, m->loads);
    return DONE;
}

int motion_at_rest(struct rigid_motion *m, real t) {
    const int status = motion_at(m, t);
    if (status != DONE)
        return status;
    for (long k = 0; k < m->sizes.links / MOTION; k++)
        for (int i = 2; i < MOTION; i++)
            m->motion[MOTION * k + i] = 0;
    memset(m->loads, 0, (size_t)m->sizes.loads * sizeof(real));
    /* A motor does not hold the structure at rest: the slope of its torque by the angle is no stiffness. */
    for (ptrdiff_t i = 0; i < m->e->n; i++)
        if (m->kernels.shaft && m->y[m->e->n + i] != 0)
            m->shaft[SHAFT_STIFFNESS] = 0;
    m->kernels.joints(m->t, m->y, m->still, m->joints_p, m->still, m->joined);
    return DONE;
}
