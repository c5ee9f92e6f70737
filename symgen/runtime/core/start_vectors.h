/* Starts in the lanes of vectors of WIDTH doubles: see lanes_of_width.h. */
#include "start_steps.h"

static void assemble(struct start *s, const real *parameters, real *q, unsigned char *assembled) {
    const ptrdiff_t n = s->sizes.n;
    mask alive = ~(mask){0};
    load(parameters, s->sizes.parameters, s->own);
    set_up_with(s->kernels.setup, s->sizes.parameters, s->own);
    memset(s->still, 0, (size_t)(n + 1) * sizeof(wide));
    evaluate(s, s->kernels.drawn, s->still, s->still);
    copy(s->out, n, s->q);
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

static const struct start_api start_functions = {
    .start_struct = sizeof(struct start),
    .bytes = start_bytes,
    .bind = start_bind,
    .assemble = assemble,
};
