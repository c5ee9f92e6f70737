#include "elastic.h"

#include <string.h>

static void start_motion(struct rigid_motion *m, double t, const void *y) {
    motion_start(m, R(t), y);
}

static int move_to(struct rigid_motion *m, double t) {
    return motion_at(m, R(t));
}

static int along(struct rigid_motion *m, const void *times, long count, void *y, void *solutions, void *motion, void *loads) {
    const struct equations *e = m->e;
    const size_t sizes[] = {(size_t)e->dim * sizeof(real), (size_t)m->sizes.links * sizeof(real), (size_t)m->sizes.loads * sizeof(real)};
    const size_t solved = (size_t)(e->n + e->m) * sizeof(real);
    for (long k = 0; k < count; k++) {
        const int status = is_interrupted(k) ? NOT_FINITE : motion_at(m, ((const real *)times)[k]);
        if (status != DONE)
            return status;
        memcpy((char *)y + k * (ptrdiff_t)sizes[0], m->y, sizes[0]);
        memcpy((char *)solutions + k * (ptrdiff_t)solved, e->out, solved);
        memcpy((char *)motion + k * (ptrdiff_t)sizes[1], m->motion, sizes[1]);
        if (sizes[2])
            memcpy((char *)loads + k * (ptrdiff_t)sizes[2], m->loads, sizes[2]);
    }
    return DONE;
}

static int assemble_at(struct beams *b, double t, int analysis) {
    b->analysis = analysis;
    const int status = beams_assemble(b, R(t), 1);
    b->analysis = IN_MOTION;
    return status;
}

static void unbalanced(struct beams *b, int analysis, const void *s, void *out) {
    b->analysis = analysis;
    beams_unbalanced(b, s, out);
    b->analysis = IN_MOTION;
}

static int beams_valid(const struct beams *b) {
    const ptrdiff_t m = b->layout.counts.constraints, joints = b->whole - b->inner, own = m ? b->entries : 0;
    return all_below(m, b->dependent, joints) && all_below(joints, b->independent, joints) && all_below(m, b->swaps, m) && all_below(own, b->own_rows, b->free) && all_below(own, b->own_columns, b->free);
}

const struct elastic_api symgen_elastic = {
    .motion_struct = sizeof(struct rigid_motion),
    .beams_struct = sizeof(struct beams),
    .motion_bytes = motion_bytes,
    .motion_bind = motion_bind,
    .motion_start = start_motion,
    .motion_follow = motion_follow,
    .motion_at = move_to,
    .motion_along = along,
    .beams_bytes = beams_bytes,
    .beams_bind = beams_bind,
    .beams_assemble = assemble_at,
    .beams_unbalanced = unbalanced,
    .beams_valid = beams_valid,
    .beams_carry = beams_carry,
};
