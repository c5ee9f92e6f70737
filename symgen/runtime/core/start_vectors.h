/* The functions of start_lanes.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "start_lanes.h"
#include "wide.h"

struct start_lanes {
    struct start_lane_kernels kernels;
    struct start_sizes sizes;
    ptrdiff_t parameters;
    wide *p, *q, *still, *change, *matrix, *right, *work, *out;
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

static inline wide dot(ptrdiff_t count, const wide *a, const wide *b) {
    wide total = all(0);
    for (ptrdiff_t i = 0; i < count; i++)
        total += a[i] * b[i];
    return total;
}

/* Solve a x = b as solve_least does, for x in s->change; returns the lanes with independent columns. */
static mask solve_rows(struct start_lanes *s, wide part) {
    const ptrdiff_t rows = s->sizes.rows, columns = s->sizes.n;
    wide *a = s->matrix, *b = s->right, first = all(0);
    mask *order = s->order, independent = ~(mask){0};
    for (ptrdiff_t j = 0; j < columns; j++)
        order[j] = (mask){0} + j;
    for (ptrdiff_t k = 0; k < columns; k++) {
        mask best = (mask){0} + k;
        wide largest = all(-1);
        for (ptrdiff_t j = k; j < columns; j++) {
            const wide total = dot(rows - k, a + rows * j + k, a + rows * j + k);
            const mask greater = total > largest;
            best = (best & ~greater) | (greater & j);
            largest = chosen(greater, total, largest);
        }
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const mask here = best == j;
            if (!any(here))
                continue;
            exchange(here, a + rows * j, a + rows * k, rows);
            exchange(here, (wide *)(order + j), (wide *)(order + k), 1);
        }
        largest = root(largest);
        if (k == 0)
            first = largest;
        independent &= largest > part * first;
        wide *own = a + rows * k + k, norm = own[0] * own[0];
        for (ptrdiff_t i = 1; i < rows - k; i++)
            norm += own[i] * own[i];
        norm = root(norm);
        norm = chosen(own[0] > 0, -norm, norm);
        for (ptrdiff_t i = 1; i < rows - k; i++)
            own[i] /= own[0] - norm;
        const wide reflected = (norm - own[0]) / norm;
        own[0] = norm;
        for (ptrdiff_t j = k + 1; j <= columns; j++) {
            wide *other = j < columns ? a + rows * j + k : b + k;
            const wide along = reflected * (other[0] + dot(rows - k - 1, own + 1, other + 1));
            other[0] -= along;
            for (ptrdiff_t i = 1; i < rows - k; i++)
                other[i] -= along * own[i];
        }
    }
    for (ptrdiff_t k = columns - 1; k >= 0; k--) {
        b[k] /= a[rows * k + k];
        for (ptrdiff_t i = 0; i < k; i++)
            b[i] -= a[rows * k + i] * b[k];
    }
    for (ptrdiff_t c = 0; c < columns; c++) {
        wide value = b[0];
        for (ptrdiff_t k = 1; k < columns; k++)
            value = chosen(order[k] == c, b[k], value);
        s->change[c] = value;
    }
    return independent;
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
