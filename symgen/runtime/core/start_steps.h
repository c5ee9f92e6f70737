/* The memory of a start, the size of a linkage and its assembly at a fraction of the path from the drawing, of one linkage or
 * of one in each lane of vectors: see wide.h. */
#include <string.h>

#include "arena.h"
#include "newton.h"
#include "start.h"

/* First and longest step along the path from the drawing, over the path. */
#define LONGEST_STEP (R(1) / 32)
/* Shortest step, over the part of the path that is done. */
#define SHORTEST_STEP (R(1) / 4096)
/* Step over the path below which the assembly fails. Squares of lengths grow along the path: where they grow by orders
   of magnitude, its first steps are tiny. */
#define LEAST_STEP R(1e-15)
/* Round-off over the size of the linkage. */
#define ROUNDING R(1e-14)
enum { ASSEMBLY_ITERATIONS = 30 };

static size_t start_place(struct start *s, const struct start_sizes *z, void *memory) {
    const ptrdiff_t of_velocities = z->m + z->prescribed, most = z->rows > of_velocities ? z->rows : of_velocities;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(s->own, z->parameters + z->derived + 1),
        ARENA_ARRAY(s->q, z->n + 1),
        ARENA_ARRAY(s->u, z->n + 1),
        ARENA_ARRAY(s->miss, of_velocities + 1),
        ARENA_ARRAY(s->trial, z->n + 1),
        ARENA_ARRAY(s->still, z->n + 1),
        ARENA_ARRAY(s->change, z->n + 1),
        ARENA_ARRAY(s->matrix, most * z->n + 1),
        ARENA_ARRAY(s->right, 2 * most + 1),
        ARENA_ARRAY(s->beta, z->n + 1),
        ARENA_ARRAY(s->mass, z->n * z->n + 1),
        ARENA_ARRAY(s->work, z->work + 1),
        ARENA_ARRAY(s->out, (z->out > of_velocities * z->n ? z->out : of_velocities * z->n) + 1),
        ARENA_ARRAY(s->order, z->n + 1),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t start_bytes(const struct start_sizes *sizes) {
    struct start counted;
    return start_place(&counted, sizes, NULL);
}

static void start_bind(struct start *s, const struct start_sizes *sizes, const struct start_kernels *kernels,
                       const void *p, void *memory) {
    start_place(s, sizes, memory);
    s->sizes = *sizes;
    s->kernels = *kernels;
    s->p = p != NULL ? p : s->own;
}

/* Evaluate a kernel at rest; results in s->out. */
static void evaluate(struct start *s, kernel function, const wide *q, const wide *u) {
    const wide t = all(0);
    call(function, &t, q, u, s->p, s->work, s->out);
}

/* Overwrite a matrix A of n columns, stored column by column, by A L^-T for the factor L in s->mass. */
static void divide_columns(const struct start *s, ptrdiff_t rows, wide *a) {
    const ptrdiff_t n = s->sizes.n;
    for (ptrdiff_t j = 0; j < n; j++) {
        wide *column = a + rows * j;
        for (ptrdiff_t k = 0; k < j; k++)
            for (ptrdiff_t i = 0; i < rows; i++)
                column[i] -= s->mass[j * n + k] * a[rows * k + i];
        for (ptrdiff_t i = 0; i < rows; i++)
            column[i] /= s->mass[j * n + j];
    }
}

/* Solve L^T x = b for the factor L in s->mass; b is overwritten. */
static void solve_upper(const struct start *s, wide *b) {
    const ptrdiff_t n = s->sizes.n;
    for (ptrdiff_t i = n - 1; i >= 0; i--) {
        for (ptrdiff_t j = i + 1; j < n; j++)
            b[i] -= s->mass[j * n + i] * b[j];
        b[i] /= s->mass[i * n + i];
    }
}

/* Solve the rows of the assembly for the correction of least norm, where singular values below a part of the largest
   are zero; return the lanes in which there are none. */
static mask solve_rows(struct start *s, wide part) {
    const ptrdiff_t rows = s->sizes.rows;
    if (s->weighted)
        divide_columns(s, rows, s->matrix);
    const mask independent = solve_least(rows, s->sizes.n, s->matrix, s->right, part, s->change, s->order, s->beta);
    if (s->weighted)
        solve_upper(s, s->change);
    return independent;
}

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

static wide extent(struct start *s, const wide *q) {
    if (s->sizes.size > 0)
        return all(R(s->sizes.size));
    evaluate(s, s->kernels.points, q, s->still);
    return size_of_points(s->sizes.points, s->sizes.axes, s->out);
}

/* The error of an assembly of some size that is accepted. */
static wide tolerance(const struct start *s, wide width) {
    return larger(R(s->sizes.share) * width, all(R(s->sizes.tolerance)));
}

/* Coordinates q at a fraction of the path, their size, that of the linkage, and the accepted error. */
struct assembly {
    struct start *s;
    real at;
    wide width, size, accepted, *q;
};

static wide correct_assembly(void *of, struct newton *w) {
    const struct assembly *a = of;
    struct start *s = a->s;
    const ptrdiff_t n = s->sizes.n, rows = s->sizes.rows;
    mask moves = w->open, closed = {0};
    if (w->count) {
        for (ptrdiff_t i = 0; i < rows; i++) {
            s->right[i] = -s->out[i];
            for (ptrdiff_t j = 0; j < n; j++)
                s->matrix[rows * j + i] = s->out[rows + n * i + j];
        }
        /* below the assembly error singular values are numerically zero */
        const mask independent = solve_rows(s, R(10) * a->accepted / a->width);
        if (WIDTH > 1)
            moves &= independent;
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
static mask assemble_at(struct start *s, mask open, real at, wide width, wide *q) {
    const wide size = larger(width, largest_in(q, s->sizes.n)), accepted = tolerance(s, width);
    struct assembly a = {s, at, width, size, accepted, q};
    struct newton w = {.most = ASSEMBLY_ITERATIONS, .grows = 2};
    if (at < 1)
        w.close = accepted;
    else
        w.rounded = ROUNDING * size;
    return newton_solve(&w, open, correct_assembly, &a);
}
