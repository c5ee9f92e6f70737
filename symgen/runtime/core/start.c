#include "start_steps.h"

/* Singular values below this part of the largest count as zero in the solution for velocities. */
#define DEPENDENT R(1e-10)
/* Pivots below this part of the largest may have either sign by rounding. */
#define STRAIGHT 1e-9

/* Factorise the metric of the corrections. */
static void weigh(struct start *s) {
    const ptrdiff_t n = s->sizes.n;
    if (s->kernels.metric != NULL) {
        evaluate(s, s->kernels.metric, s->q, s->still);
        copy(s->out, n * n, s->mass);
    }
    s->weighted = s->kernels.metric != NULL && factor_positive(n, s->mass, 0, 0) == n;
}

/* The sign of the determinant of the square assembly Jacobian at a fraction of the path, which is that of the drawing
   everywhere on its assembly branch; zero where it is singular, or not square. */
static int side(struct start *s, real at, const real *q) {
    const ptrdiff_t n = s->sizes.n;
    real least = REAL_INFINITY, most = 0;
    int sign = 1;
    if (s->kernels.assembly == NULL || s->sizes.rows != n)
        return 0;
    s->change[0] = at;
    memset(s->change + 1, 0, (size_t)n * sizeof(real));
    evaluate(s, s->kernels.assembly, q, s->change);
    copy(s->out + n, n * n, s->matrix);
    if (!factor_dense(n, s->matrix, s->order))
        return 0;
    for (ptrdiff_t k = 0; k < n; k++) {
        const real pivot = s->matrix[k * n + k];
        sign = (pivot < 0) == (s->order[k] != k) ? sign : -sign;
        least = real_fmin(least, real_fabs(pivot)), most = real_fmax(most, real_fabs(pivot));
    }
    return least > R(STRAIGHT) * most ? sign : 0;
}

static void begin(struct start *s) {
    s->at = 0;
    s->step = LONGEST_STEP;
    s->side = side(s, s->at, s->q);
    weigh(s);
}

static int outcome(struct start *s) {
    return s->side && s->side * side(s, 1, s->q) < 0 ? OTHER_SIDE : STARTED;
}

static int advance(struct start *s) {
    const real target = real_fmin(R(1), s->at + s->step);
    copy(s->q, s->sizes.n, s->trial);
    const real width = extent(s, s->q);
    if (tolerance(s, width) > R(MOST_TOLERANCE) * width)
        return TOO_TOLERANT;
    if (any(assemble_at(s, 1, target, width, s->trial))) {
        copy(s->trial, s->sizes.n, s->q);
        s->at = target;
        s->step = real_fmin(2 * s->step, LONGEST_STEP);
        return target < 1 ? ON_THE_WAY : outcome(s);
    }
    s->step /= 2;
    return s->step < real_fmax(SHORTEST_STEP * s->at, LEAST_STEP) ? UNASSEMBLED : ON_THE_WAY;
}

/* Write to s->matrix, row by row, the scaled constraints without the dropped ones, then the rows of prescribed
   velocities; write right-hand sides to s->right. Return the number of rows of constraints. */
static ptrdiff_t rows_of_velocities(struct start *s, const char *dropped) {
    const ptrdiff_t n = s->sizes.n, m = s->sizes.m, prescribed = s->sizes.prescribed;
    ptrdiff_t kept = 0;
    if (s->kernels.jacobian != NULL) {
        real *scale = s->miss;
        evaluate(s, s->kernels.constraints, s->q, s->still);
        copy(s->out + m, m, scale);
        evaluate(s, s->kernels.drift, s->q, s->still);
        for (ptrdiff_t i = 0; i < m; i++)
            if (!dropped[i])
                s->right[kept++] = -s->out[i] / scale[i];
        evaluate(s, s->kernels.jacobian, s->q, s->still);
        kept = 0;
        for (ptrdiff_t i = 0; i < m; i++)
            if (!dropped[i]) {
                for (ptrdiff_t j = 0; j < n; j++)
                    s->matrix[kept * n + j] = s->out[i * n + j] / scale[i];
                kept++;
            }
    }
    if (prescribed) {
        evaluate(s, s->kernels.rates, s->q, s->still);
        copy(s->out, prescribed, s->right + kept);
        copy(s->out + prescribed, prescribed * n, s->matrix + kept * n);
    }
    return kept;
}

/* Velocities u of least kinetic energy u.M u/2 + b.u, b the momentum by the velocity of the ground:
   u = L^-T x - M^-1 b with x of minimum norm, M = L L^T. */
static ptrdiff_t velocities(struct start *s, const char *dropped) {
    const ptrdiff_t n = s->sizes.n;
    evaluate(s, s->kernels.mass, s->q, s->still);
    copy(s->out, n * n, s->mass);
    if (factor_positive(n, s->mass, 0, 0) < n)
        return -1;
    real *carried = s->change; /* -M^-1 b: the velocities without conditions */
    memset(carried, 0, (size_t)n * sizeof(real));
    if (s->kernels.momentum != NULL) {
        evaluate(s, s->kernels.momentum, s->q, s->still);
        for (ptrdiff_t j = 0; j < n; j++)
            carried[j] = -s->out[j];
        solve_positive(n, s->mass, carried);
    }
    const ptrdiff_t kept = rows_of_velocities(s, dropped), rows = kept + s->sizes.prescribed;
    real *reduced = s->out, *right = s->right + rows;
    s->fastest = real_fmax(largest_or_nan(s->right, rows), largest_or_nan(carried, n));
    copy(s->right, rows, right);
    for (ptrdiff_t i = 0; i < rows; i++)
        for (ptrdiff_t j = 0; j < n; j++) {
            right[i] -= s->matrix[i * n + j] * carried[j];
            reduced[j * rows + i] = s->matrix[i * n + j];
        }
    divide_columns(s, rows, reduced);
    solve_least(rows, n, reduced, right, DEPENDENT, s->u, s->order, s->beta);
    solve_upper(s, s->u);
    for (ptrdiff_t j = 0; j < n; j++)
        s->u[j] += carried[j];
    for (ptrdiff_t i = 0; i < rows; i++) {
        real total = -s->right[i];
        for (ptrdiff_t j = 0; j < n; j++)
            total += s->matrix[i * n + j] * s->u[j];
        s->miss[i] = real_fabs(total);
    }
    return kept;
}

const struct start_api symgen_start = {
    .start_struct = sizeof(struct start),
    .bytes = start_bytes,
    .bind = start_bind,
    .size = size_of_points,
    .extent = extent,
    .begin = begin,
    .advance = advance,
    .outcome = outcome,
    .velocities = velocities,
};
