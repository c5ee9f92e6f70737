/* The size of a linkage and its assembly at a fraction of the path from the drawing, of one linkage or of one in each
 * lane of vectors. The including file defines START, the numbers `wide` and the flags `mask` with their functions as in
 * vectors.h, `evaluate` of a kernel at rest, and `solve_rows`, which solves s->matrix x = s->right for s->change and
 * returns the lanes that have a solution. */
#include <string.h>

#include "newton.h"
#include "start_limits.h"

/* Twice the largest distance of points from their mean, which no rotation changes. */
static wide size_of_points(ptrdiff_t count, ptrdiff_t axes, const wide *positions) {
    wide squares[2], mean[3]; /* the largest square of a distance, and that of a point */
    memset(squares, 0, sizeof squares);
    memset(mean, 0, sizeof mean);
    for (ptrdiff_t i = 0; i < count; i++)
        for (ptrdiff_t axis = 0; axis < axes; axis++)
            mean[axis] += positions[i * axes + axis] / (real)count;
    for (ptrdiff_t i = 0; i < count; i++) {
        memset(squares + 1, 0, sizeof *squares);
        for (ptrdiff_t axis = 0; axis < axes; axis++) {
            const wide apart = positions[i * axes + axis] - mean[axis];
            squares[1] += apart * apart;
        }
        squares[0] = largest_in(squares, 2);
    }
    return 2 * root(squares[0]);
}

static wide extent(START *s, const wide *q) {
    if (s->sizes.size > 0)
        return all(R(s->sizes.size));
    evaluate(s, s->kernels.points, q, s->still);
    return size_of_points(s->sizes.points, s->sizes.axes, s->out);
}

/* The error of an assembly of some size that is accepted. */
static wide tolerance(const START *s, wide width) {
    return larger(R(s->sizes.share) * width, all(R(s->sizes.tolerance)));
}

/* Coordinates q at a fraction of the path, their size, that of the linkage, and the accepted error. */
struct assembly {
    START *s;
    real at;
    wide width, size, accepted, *q;
};

static wide correct_assembly(void *of, struct newton *w) {
    const struct assembly *a = of;
    START *s = a->s;
    const ptrdiff_t n = s->sizes.n, rows = s->sizes.rows;
    mask moves = w->open, closed = {0};
    if (w->count) {
        for (ptrdiff_t i = 0; i < rows; i++) {
            s->right[i] = -s->out[i];
            for (ptrdiff_t j = 0; j < n; j++)
                s->matrix[rows * j + i] = s->out[rows + n * i + j];
        }
        /* below the assembly error singular values are numerically zero */
        moves &= solve_rows(s, R(10) * a->accepted / a->width);
        const wide moved = largest_in(s->change, n);
        moves &= moved <= a->size;
        for (ptrdiff_t j = 0; j < n; j++)
            a->q[j] = chosen(moves, a->q[j] + s->change[j], a->q[j]);
        closed = (w->before <= a->accepted) & (moved <= ROUNDING * a->size);
    }
    memset(s->change, 0, (size_t)(n + 1) * sizeof(wide));
    s->change[0] = all(a->at);
    evaluate(s, s->kernels.assembly, a->q, s->change);
    return chosen(moves, chosen(closed, all(0), largest_in(s->out, rows)), all(REAL_INFINITY));
}

/* Solve the rows of the assembly for q, of some size, at a fraction of the path, by Newton's method in the open lanes:
   within the tolerance, and to round-off at the end of the path. Return the lanes that converged. */
static mask assemble_at(START *s, mask open, real at, wide width, wide *q) {
    const wide size = larger(width, largest_in(q, s->sizes.n)), accepted = tolerance(s, width);
    struct assembly a = {s, at, width, size, accepted, q};
    struct newton w = {.most = ASSEMBLY_ITERATIONS, .grows = 2};
    if (at < 1)
        w.close = accepted;
    else
        w.rounded = ROUNDING * size;
    return newton_solve(&w, open, correct_assembly, &a);
}
