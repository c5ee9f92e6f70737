/* The functions of start_lanes.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "start_lanes.h"
#include "wide.h"

struct start_lanes {
    struct start_lane_kernels kernels;
    struct start_sizes sizes;
    ptrdiff_t parameters;
    wide *p, *q, *still, *change, *matrix, *right, *beta, *work, *out;
    mask *order;
};

static size_t start_place(struct start_lanes *s, const struct start_sizes *z, ptrdiff_t parameters, void *memory) {
    const struct arena_array arrays[] = {
        ARENA_ARRAY(s->p, parameters),
        ARENA_ARRAY(s->q, z->n + 1),
        ARENA_ARRAY(s->still, z->n + 1),
        ARENA_ARRAY(s->change, z->n + 1),
        ARENA_ARRAY(s->matrix, z->rows * z->n),
        ARENA_ARRAY(s->right, z->rows),
        ARENA_ARRAY(s->beta, z->n),
        ARENA_ARRAY(s->work, z->work + 1),
        ARENA_ARRAY(s->out, z->out + 1),
        ARENA_ARRAY(s->order, z->n),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t start_bytes(const struct start_sizes *sizes, ptrdiff_t parameters) {
    struct start_lanes counted;
    return start_place(&counted, sizes, parameters, NULL);
}

static void start_bind(struct start_lanes *s, const struct start_sizes *sizes, const struct start_lane_kernels *kernels,
                 ptrdiff_t given, ptrdiff_t parameters, void *memory) {
    start_place(s, sizes, parameters, memory);
    s->sizes = *sizes, s->kernels = *kernels, s->parameters = given;
}

static void evaluate(struct start_lanes *s, kernel function, const wide *q, const wide *u) {
    const wide t = all(0);
    call(function, &t, q, u, s->p, s->work, s->out);
}

/* Solve the rows of the assembly for s->change; return the lanes with independent columns. */
static mask solve_rows(struct start_lanes *s, wide part) {
    return solve_least(s->sizes.rows, s->sizes.n, s->matrix, s->right, part, s->change, s->order, s->beta);
}

#define START struct start_lanes
#include "start_steps.h"

static void assemble(struct start_lanes *s, const real *parameters, real *q, unsigned char *assembled) {
    const ptrdiff_t n = s->sizes.n;
    mask alive = ~(mask){0};
    load(parameters, s->parameters, s->p);
    if (s->kernels.setup != NULL)
        call(s->kernels.setup, NULL, NULL, NULL, s->p, NULL, s->p + s->parameters);
    memset(s->still, 0, (size_t)(n + 1) * sizeof(wide));
    evaluate(s, s->kernels.drawn, s->still, s->still);
    memcpy(s->q, s->out, (size_t)n * sizeof(wide));
    for (real at = 0; at < 1 && any(alive);) {
        at = real_fmin(R(1), at + LONGEST_STEP);
        const wide width = extent(s, s->q);
        alive &= assemble_at(s, alive & ~(tolerance(s, width) > R(MOST_TOLERANCE) * width), at, width, s->q);
    }
    for (int lane = 0; lane < WIDTH; lane++) {
        assembled[lane] = alive[lane] != 0;
        for (ptrdiff_t j = 0; j < n; j++)
            q[lane * n + j] = s->q[j][lane];
    }
}

static const struct start_lanes_api start_functions = {
    .lanes_struct = sizeof(struct start_lanes),
    .bytes = start_bytes,
    .bind = start_bind,
    .assemble = assemble,
};
