#include "loops.h"

#include <string.h>

static int close_at(struct loop *l, double t, void *q) {
    return loop_close(l, R(t), q);
}

static int assemble(struct loop *l, double t, void *q, long *rank) {
    return loop_assemble(l, R(t), q, rank);
}

static double closed_screws(struct loop *l, double t, const void *q, void *screws) {
    const real defect = loop_evaluate(l, R(t), q);
    memcpy(screws, l->screws + 12, (size_t)(ROWS * l->sizes.n) * sizeof(real));
    return (double)defect;
}

static int turn(struct loop *l, void *y) {
    return loop_rewrite(&l->base, y, y, 1);
}

static void turn_back(struct loop *l, const void *near, void *y) {
    memcpy(l->usual, near, (size_t)l->sizes.n * sizeof(real));
    loop_as_usual(&l->base, y, 1);
}

static int follow(struct loop *l, double *t, void *q, const void *times, long count, double longest, void *states,
                  long row, void *out, long width, double *diagnosis, long *reached) {
    real at = R(*t);
    const int status = loop_follow(l, &at, q, times, count, R(longest), states, row, out, width, diagnosis, reached);
    *t = (double)at;
    return status;
}

static void undetermined(struct loop *l, const void *times, const void *states, long row, long count, double least,
                         double part, unsigned char *found) {
    loop_undetermined(l, times, states, row, count, R(least), R(part), found);
}

const struct loops_api symgen_loops = {
    .loop_struct = sizeof(struct loop),
    .bytes = loop_bytes,
    .bind = loop_bind,
    .close = close_at,
    .assemble = assemble,
    .closed_screws = closed_screws,
    .turn = turn,
    .turn_back = turn_back,
    .follow = follow,
    .undetermined = undetermined,
};
