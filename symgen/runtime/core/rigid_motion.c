#include "rigid_motion.h"

#include <string.h>

#include "lanes.h"
#include "memory.h"

/* Strides that are gone at once at most: tens of thousands of turns. */
#define FARTHEST R(1e7)

size_t motion_bytes(const struct equations *e, const long *sizes) {
    size_t reals = 1 + 2 * (size_t)(e->dim + 1) + (size_t)(e->dim + e->n + e->m + 1);
    for (int i = 0; i < WRITTEN; i++)
        reals += (size_t)sizes[i] + 1;
    reals += 2 * (size_t)e->sizes.parameters;
    return rounded(sizeof(long)) + reals * sizeof(real);
}

void motion_bind(struct rigid_motion *m, struct equations *e, const struct motion_kernels *kernels, const long *sizes,
                 double stride, void *memory) {
    real **written[] = {&m->motion, &m->joined, &m->turning, &m->loads, &m->p, &m->joints_p};
    const long parameters = e->sizes.parameters;
    real *at = (real *)(void *)((char *)memory + rounded(sizeof(long)));
    m->e = e;
    m->kernels = *kernels;
    memcpy(m->sizes, sizes, sizeof m->sizes);
    m->stride = R(stride);
    m->solved = memory;
    m->t = at, at += 1;
    m->y = at, at += e->dim + 1;
    m->began = at, at += e->dim + 1;
    m->still = at, at += e->dim + e->n + e->m + 1;
    for (int i = 0; i < WRITTEN; i++) {
        *written[i] = at;
        at += sizes[i] + 1 + (i < OF_SETUP ? 0 : parameters);
    }
    copy(e->p, parameters, m->p);
    copy(e->p, parameters, m->joints_p);
    set_up_with(kernels->setup, parameters, m->p);
    set_up_with(kernels->joints_setup, parameters, m->joints_p);
}

void motion_start(struct rigid_motion *m, real t, const real *y) {
    memcpy(m->y, y, (size_t)m->e->dim * sizeof(real));
    memcpy(m->began, y, (size_t)m->e->dim * sizeof(real));
    *m->t = m->began_at = t;
    *m->solved = 0;
}

/* Take the state to a time near by; leave accelerations and multipliers in the equations' `out`. */
static int moved(struct rigid_motion *m, real t) {
    struct equations *e = m->e;
    const real h = t - *m->t;
    real *y = m->y;
    if (h == 0 && *m->solved)
        return DONE;
    if (h != 0) {
        if (!*m->solved)
            e->of->accelerate(e, *m->t, y);
        for (long i = 0; i < e->n; i++) {
            y[i] += h * (y[e->n + i] + h / 2 * e->out[i]);
            y[e->n + i] += h * e->out[i];
        }
    }
    *m->solved = 0;
    const int status = e->of->project(e, t, y);
    if (status != DONE)
        return status;
    *m->t = t;
    e->of->accelerate(e, t, y);
    *m->solved = 1;
    return DONE;
}

int motion_at(struct rigid_motion *m, real t) {
    struct equations *e = m->e;
    const real *q = m->y, *u = m->y + e->n;
    if (real_fabs(t - m->began_at) < real_fabs(t - *m->t)) {
        memcpy(m->y, m->began, (size_t)e->dim * sizeof(real));
        *m->t = m->began_at;
        *m->solved = 0;
    }
    const real start = *m->t;
    const real steps = real_fabs(t - start) / m->stride;
    if (!(steps <= FARTHEST))
        return NOT_FINITE;
    const long count = (long)steps + (steps > (long)steps);
    for (long k = 1; k < count; k++) {
        const int status = moved(m, start + (t - start) * k / count);
        if (status != DONE)
            return status;
    }
    const int status = moved(m, t);
    if (status != DONE)
        return status;
    m->kernels.links(m->t, q, u, m->p, e->out, m->motion);
    m->kernels.joints(m->t, q, u, m->joints_p, e->out, m->joined);
    if (m->kernels.torque)
        m->kernels.torque(m->t, q, u, m->p, e->out, m->turning);
    if (m->kernels.loads)
        m->kernels.loads(m->t, q, u, m->p, e->out, m->loads);
    return DONE;
}

int motion_at_rest(struct rigid_motion *m, real t) {
    const int status = motion_at(m, t);
    if (status != DONE)
        return status;
    for (long k = 0; k < m->sizes[OF_LINKS] / MOTION; k++)
        for (int i = 2; i < MOTION; i++)
            m->motion[MOTION * k + i] = 0;
    memset(m->loads, 0, (size_t)m->sizes[OF_LOADS] * sizeof(real));
    m->kernels.joints(m->t, m->y, m->still, m->joints_p, m->still, m->joined);
    return DONE;
}
