/* Derivatives of runs of loops of joints. At constant accelerations, closure and the balance of efforts have the
 * tangents r and e. With the inverse G of the screws, motions N of the loop and the inertia M,
 *
 *     da = -G r - N^T (N M N^T)^-1 N (e - M G r),
 *
 * without the closing wrench. The rows of this map are weights of r and e. Kernels compute the gradients of these
 * weighted sums (reverse mode), one in each lane of their vectors; they are the slopes of the accelerations. At the
 * end of a step, G projects onto closure and its rate in the same way. Inputs move as prescribed. */
#include <string.h>

#include "arena.h"
#include "linear.h"
#include "loop.h"
#include "tableau.h"
#include "variations.h"

static struct loop *of(const struct variations *v) {
    return (struct loop *)v->e->owner;
}

/* Number of slopes in a row: by (q, u), then by the directions. */
static ptrdiff_t row_of(const struct variations *v) {
    return 2 * v->e->n + v->sizes.columns;
}

static size_t place(struct variations *v, const struct equations *e, void *memory) {
    const struct loop *l = e->owner;
    const struct variation_sizes *s = &v->sizes;
    const ptrdiff_t n = e->n, width = s->width, slopes = n * row_of(v);
    const struct arena_array arrays[] = {
        ARENA_ARRAY(v->p, (s->parameters + s->derived + 1) * width),
        ARENA_ARRAY(v->t, width),
        ARENA_ARRAY(v->q, (n + 1) * width),
        ARENA_ARRAY(v->u, (n + 1) * width),
        ARENA_ARRAY(v->work, (s->work + 1) * width),
        ARENA_ARRAY(v->out, (s->out + 1) * width),
        ARENA_ARRAY(v->answer, n * (ROWS + n)),
        ARENA_ARRAY(v->slopes, slopes),
        ARENA_ARRAY(v->prescribed, 3 * l->sizes.inputs * s->columns + 1),
        ARENA_ARRAY(v->factors, stages_of(v) * slopes),
    };
    return ARENA_PLACE(arrays, memory);
}

/* Write the same numbers into all lanes. */
static void spread(const struct variations *v, const real *from, ptrdiff_t count, real *to) {
    for (ptrdiff_t i = 0; i < count; i++)
        for (ptrdiff_t lane = 0; lane < v->sizes.width; lane++)
            to[i * v->sizes.width + lane] = from[i];
}

static void begin(struct variations *v) {
    spread(v, v->e->p, v->sizes.parameters, v->p);
    if (v->kernels.setup != NULL)
        v->kernels.setup(NULL, NULL, NULL, v->p, NULL, v->p + v->sizes.parameters * v->sizes.width);
}

/* Evaluate a kernel at the pose (v->q, v->u). */
static void tangent_of(struct variations *v, kernel of_kernel, real t) {
    spread(v, &t, 1, v->t);
    of_kernel(v->t, v->q, v->u, v->p, v->work, v->out);
}

/* Set the pose, with prescribed inputs, and the slopes of the inputs by the directions. */
static void take(struct variations *v, real t, const real *y) {
    struct loop *l = of(v);
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, width = v->sizes.width, parameters = v->sizes.parameters;
    spread(v, y, n, v->q);
    spread(v, y + n, n, v->u);
    for (long i = 0; i < l->sizes.inputs; i++) {
        spread(v, l->prescribed + 3 * i, 1, v->q + l->driven[i] * width);
        spread(v, l->prescribed + 3 * i + 1, 1, v->u + l->driven[i] * width);
    }
    if (v->kernels.prescribed == NULL)
        return;
    tangent_of(v, v->kernels.prescribed, t);
    for (long i = 0; i < 3 * l->sizes.inputs; i++)
        for (ptrdiff_t c = 0; c < k; c++) {
            const long by = v->sizes.directions[c];
            v->prescribed[i * k + c] = by < 0 ? 0 : v->out[(i * parameters + by) * width];
        }
}

/* Write the gradients of weighted sums to `slopes`, a row for each solved variable. Its weights are `count` numbers,
   its row of v->answer. Columns: the first `states` of (q, u), which the kernel writes first, then the directions.
   With `moving`, inputs are prescribed, and the slopes by their accelerations precede those by parameters. */
static void weigh(struct variations *v, kernel of_kernel, real t, ptrdiff_t count, ptrdiff_t states, int moving,
                  real *slopes) {
    const struct loop *l = of(v);
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, width = v->sizes.width, row = row_of(v);
    const ptrdiff_t inputs = moving ? l->sizes.inputs : 0;
    real *weights = v->work + (n + ROWS) * width;
    for (ptrdiff_t first = 0; first < l->sizes.solved; first += width) {
        const ptrdiff_t lanes = l->sizes.solved - first < width ? l->sizes.solved - first : width;
        for (ptrdiff_t lane = 0; lane < width; lane++) {
            const real *from = v->answer + count * l->solved[lane < lanes ? first + lane : first];
            for (ptrdiff_t j = 0; j < count; j++)
                weights[j * width + lane] = from[j];
        }
        tangent_of(v, of_kernel, t);
        for (ptrdiff_t lane = 0; lane < lanes; lane++) {
            real *to = slopes + row * l->solved[first + lane], *by = to + 2 * n;
            const real *out = v->out + lane, *by_p = out + (states + inputs) * width;
            for (ptrdiff_t j = 0; j < states; j++)
                to[j] = out[j * width];
            for (ptrdiff_t c = 0; c < k; c++)
                by[c] = v->sizes.directions[c] < 0 ? 0 : by_p[v->sizes.directions[c] * width];
            for (long i = 0; i < inputs; i++) {
                const ptrdiff_t place[] = {l->driven[i], n + l->driven[i], states + i};
                for (int order = 0; order < 3; order++)
                    add_multiple(k, out[place[order] * width], v->prescribed + (3 * i + order) * k, by);
                to[place[0]] = to[place[1]] = 0;
            }
        }
    }
}

/* Write the slopes of the accelerations just computed at a state. */
static void differentiate(struct variations *v, real t, const real *state, real *slopes) {
    struct equations *e = v->e;
    struct loop *l = of(v);
    const ptrdiff_t n = e->n, k = v->sizes.columns;
    spread(v, e->out, n + ROWS, v->work); /* before the loop is evaluated again */
    loop_answer(l, v->answer);
    take(v, t, state);
    weigh(v, v->kernels.stage, t, ROWS + n, 2 * n, 1, slopes);
    for (long i = 0; i < l->sizes.inputs; i++) {
        real *row = slopes + row_of(v) * l->driven[i];
        memset(row, 0, (size_t)(2 * n) * sizeof(real));
        memcpy(row + 2 * n, v->prescribed + (3 * i + 2) * k, (size_t)k * sizeof(real));
    }
}

/* Add to the rows of the solved variables in `to` their slopes times `from` (`rows` rows) and their slopes by the
   directions. */
static void add_slopes(const struct variations *v, const real *slopes, ptrdiff_t rows, const real *from, real *to) {
    const struct loop *l = of(v);
    const ptrdiff_t k = v->sizes.columns, row = row_of(v);
    for (long i = 0; i < l->sizes.solved; i++) {
        const ptrdiff_t j = l->solved[i];
        multiply_dense(1, rows, k, slopes + row * j, row, from, v->solved);
        add_multiple(k, R(1), v->solved, to + j * k);
        add_multiple(k, R(1), slopes + row * j + 2 * v->e->n, to + j * k);
    }
}

static void stage(struct variations *v, real t, const real *state) {
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, row = row_of(v);
    differentiate(v, t, state, v->slopes);
    multiply_dense(n, 2 * n, k, v->slopes, row, v->by_stage, v->solved);
    for (ptrdiff_t i = 0; i < n; i++)
        add_multiple(k, R(1), v->slopes + row * i + 2 * n, v->solved + i * k);
}

static void keep(struct variations *v, long s, real t, const real *state) {
    differentiate(v, t, state, v->factors + s * v->e->n * row_of(v));
}

static void stage_back(struct variations *v, long s, real t, const real *seed, real weight, real *back) {
    const ptrdiff_t n = v->e->n, k = v->sizes.columns, row = row_of(v);
    const real *slopes = v->factors + s * n * row;
    (void)t, (void)weight;
    for (ptrdiff_t i = 0; i < n; i++) {
        add_multiple(2 * n, seed[n + i], slopes + row * i, back);
        add_multiple(k, seed[n + i], slopes + row * i + 2 * n, v->gradient);
    }
}

/* Set the pose at the end of a step, and the changes of variables due to errors of closure. */
static int arrive(struct variations *v, real t, const real *y) {
    struct loop *l = of(v);
    const ptrdiff_t n = v->e->n;
    memcpy(l->q, y, (size_t)n * sizeof(real));
    loop_prescribe(l, t, l->q);
    if (!real_isfinite(loop_evaluate(l, t, l->q)))
        return NOT_FINITE;
    for (ptrdiff_t c = 0; c < ROWS; c++) {
        real b[ROWS] = {0}, x[MOST];
        b[c] = R(-1);
        loop_solve(l, l->sizes.rank, b, x);
        for (long i = 0; i < l->sizes.solved; i++)
            v->answer[ROWS * l->solved[i] + c] = x[i];
    }
    take(v, t, y);
    return DONE;
}

static int close_tangents(struct variations *v, real t, const real *y, real *moved) {
    const struct loop *l = of(v);
    const ptrdiff_t n = v->e->n, k = v->sizes.columns;
    real *before = v->turned + (stages_of(v) - 1) * 2 * n * k; /* the last stage is computed later, or was used */
    const int status = arrive(v, t, y);
    if (status != DONE)
        return status;
    for (long i = 0; i < l->sizes.inputs; i++)
        for (int order = 0; order < 2; order++)
            memcpy(moved + (order * n + l->driven[i]) * k, v->prescribed + (3 * i + order) * k,
                   (size_t)k * sizeof(real));
    /* sums of all rows first: slopes refer to the state before the projection */
    memcpy(before, moved, (size_t)(2 * n * k) * sizeof(real));
    weigh(v, v->kernels.closing, t, ROWS, n, 0, v->slopes);
    add_slopes(v, v->slopes, n, before, moved);
    memcpy(before, moved, (size_t)(n * k) * sizeof(real));
    weigh(v, v->kernels.rates, t, ROWS, 2 * n, 0, v->slopes);
    add_slopes(v, v->slopes, 2 * n, before, moved + n * k);
    return DONE;
}

/* The transpose of add_slopes: add the seeds of solved variables times their slopes to the seed and to the gradient.
   */
static void add_transposed(struct variations *v, ptrdiff_t states, const real *from, real *to) {
    const struct loop *l = of(v);
    const ptrdiff_t row = row_of(v);
    memcpy(v->state, from, (size_t)v->e->n * sizeof(real));
    for (long i = 0; i < l->sizes.solved; i++) {
        const real *slopes = v->slopes + row * l->solved[i], seed = v->state[l->solved[i]];
        add_multiple(states, seed, slopes, to);
        add_multiple(v->sizes.columns, seed, slopes + 2 * v->e->n, v->gradient);
    }
}

/* The transpose of close_tangents. */
static int open_seed(struct variations *v, real t, const real *y, real *to) {
    const struct loop *l = of(v);
    const ptrdiff_t n = v->e->n, k = v->sizes.columns;
    const int status = arrive(v, t, y);
    if (status != DONE)
        return status;
    weigh(v, v->kernels.rates, t, ROWS, 2 * n, 0, v->slopes);
    add_transposed(v, 2 * n, to + n, to);
    weigh(v, v->kernels.closing, t, ROWS, n, 0, v->slopes);
    add_transposed(v, n, to, to);
    for (long i = 0; i < l->sizes.inputs; i++)
        for (int order = 0; order < 2; order++) {
            real *seed = to + order * n + l->driven[i];
            add_multiple(k, *seed, v->prescribed + (3 * i + order) * k, v->gradient);
            *seed = 0;
        }
    return DONE;
}

const struct variation_behaviour loop_variations = {
    .place = place,
    .begin = begin,
    .stage = stage,
    .close = close_tangents,
    .keep = keep,
    .stage_back = stage_back,
    .open = open_seed,
};
