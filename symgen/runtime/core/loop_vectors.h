/* The functions of loop_lanes.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "extrapolate.h"
#include "loop_lanes.h"
#include "loop_limits.h"

/* Largest numbers of halvings of a step and of iterations in a lane. */
enum { MOST_HALVINGS = 12, MOST_ITERATIONS = 12 };

struct loop_lanes {
    struct loop_kernels kernels;
    struct loop_sizes sizes;
    const ptrdiff_t *solved, *driven, *found, *known;
    real scale[MOST], size;
    wide t, stride, first, rate; /* value and rate of the input `lead` at t = 0 */
    wide *p, *q, *past, *next; /* variables, rates, accelerations and closing wrench: now, at the previous state,
                                  after the next step */
    wide *screws, *prescribed, *loads, *efforts, *work, *out, *change, *trial, *gain, *begun;
    wide *columns; /* as in struct loop */
    mask *swaps;
    wide matrix[ROWS * ROWS], r[ROWS * ROWS], vectors[ROWS * ROWS], beta[ROWS];
    mask order[ROWS]; /* the column of `matrix` at each place */
    wide closure, soundness, hold;
};

#define LOOP struct loop_lanes
#include "screws.h"

static size_t loop_place(struct loop_lanes *l, const struct loop_sizes *s, void *memory) {
    const ptrdiff_t n = s->n, state = 3 * n + ROWS;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(l->p, s->parameters + s->derived + 1),
        ARENA_ARRAY(l->q, state),
        ARENA_ARRAY(l->past, state),
        ARENA_ARRAY(l->next, state),
        ARENA_ARRAY(l->screws, 12 + ROWS * n),
        ARENA_ARRAY(l->prescribed, 3 * s->inputs),
        ARENA_ARRAY(l->loads, 2 * ROWS * n + ROWS),
        ARENA_ARRAY(l->efforts, n),
        ARENA_ARRAY(l->work, s->work),
        ARENA_ARRAY(l->out, s->out_size),
        ARENA_ARRAY(l->change, n),
        ARENA_ARRAY(l->trial, n),
        ARENA_ARRAY(l->gain, s->unknown * s->unknown),
        ARENA_ARRAY(l->begun, n + 1),
        ARENA_ARRAY(l->columns, ROWS * s->solved),
        ARENA_ARRAY(l->swaps, s->unknown),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t loop_lane_bytes(const struct loop_sizes *sizes) {
    struct loop_lanes counted;
    return loop_place(&counted, sizes, NULL);
}

static void loop_lane_bind(struct loop_lanes *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
                 const ptrdiff_t *numbers, const unsigned char *is_length, void *memory) {
    loop_place(l, sizes, memory);
    l->kernels = *kernels, l->sizes = *sizes;
    l->solved = numbers;
    l->driven = l->solved + sizes->solved;
    l->found = l->driven + sizes->inputs;
    l->known = l->found + sizes->unknown;
    l->size = R(sizes->size);
    for (long i = 0; i < sizes->n; i++)
        l->scale[i] = is_length[i] ? l->size : 1;
}

/* -- six rows: as in qr.h -------------------------------------------------------------------------------- */

static inline wide six_dot(const wide *a, const wide *b) {
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5]);
}

static void factorise_screws(struct loop_lanes *l) {
    const ptrdiff_t columns = l->sizes.solved;
    wide *a = l->matrix;
    for (ptrdiff_t j = 0; j < columns; j++)
        l->order[j] = (mask){0} + j;
    for (ptrdiff_t k = 0; k < columns; k++) {
        mask best = (mask){0} + k;
        wide largest = six_dot(a + ROWS * k, a + ROWS * k);
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const wide total = six_dot(a + ROWS * j, a + ROWS * j);
            const mask greater = total > largest;
            largest = chosen(greater, total, largest);
            best = (best & ~greater) | (greater & j);
        }
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const mask here = best == j;
            if (!any(here))
                continue;
            exchange(here, a + ROWS * j, a + ROWS * k, ROWS);
            exchange(here, l->r + ROWS * j, l->r + ROWS * k, k);
            exchange(here, (wide *)(l->order + j), (wide *)(l->order + k), 1);
        }
        wide *v = l->vectors + ROWS * k, norm = root(largest);
        norm = chosen(a[ROWS * k + k] > 0, -norm, norm);
        l->r[ROWS * k + k] = norm;
        const wide total = a[ROWS * k + k] - norm, factor = 1 / total;
        for (int i = 0; i < ROWS; i++)
            v[i] = a[ROWS * k + i] * factor;
        v[k] = all(1);
        l->beta[k] = -total / norm;
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const wide part = l->beta[k] * six_dot(v, a + ROWS * j);
            for (int i = 0; i < ROWS; i++)
                a[ROWS * j + i] -= part * v[i];
            l->r[ROWS * j + k] = a[ROWS * j + k];
            a[ROWS * j + k] = all(0);
        }
    }
}

static inline void reflect(const struct loop_lanes *l, ptrdiff_t k, wide *b) {
    const wide total = l->beta[k] * six_dot(l->vectors + ROWS * k, b);
    for (int i = 0; i < ROWS; i++)
        b[i] -= total * l->vectors[ROWS * k + i];
}

/* Solve screws x = b for the changes x of the solved variables; b is overwritten as by loop_solve. */
static void solve_screws(const struct loop_lanes *l, wide *b, wide *x) {
    const ptrdiff_t columns = l->sizes.solved;
    for (int k = 3; k < ROWS; k++)
        b[k] /= l->size;
    for (ptrdiff_t k = 0; k < columns; k++)
        reflect(l, k, b);
    for (ptrdiff_t k = columns - 1; k >= 0; k--) {
        b[k] /= l->r[ROWS * k + k];
        for (ptrdiff_t i = 0; i < k; i++)
            b[i] -= l->r[ROWS * k + i] * b[k];
    }
    for (ptrdiff_t c = 0; c < columns; c++) {
        wide value = b[0];
        for (ptrdiff_t j = 1; j < columns; j++)
            value = chosen(l->order[j] == c, b[j], value);
        x[c] = value * l->scale[l->solved[c]];
    }
}

/* -- closure and motion: as in loop.c -------------------------------------------------------------------- */

static void prescribe_lanes(struct loop_lanes *l, wide t, wide *q) {
    call(l->kernels.inputs, &t, q, q, l->p, l->work, l->prescribed);
    for (long k = 0; k < l->sizes.inputs; k++)
        q[l->driven[k]] = l->prescribed[3 * k];
}

static void scaled_columns(const struct loop_lanes *l, wide *columns) {
    for (long k = 0; k < l->sizes.solved; k++)
        for (int i = 0; i < ROWS; i++) {
            const wide entry = l->screws[12 + l->sizes.n * i + l->solved[k]] * l->scale[l->solved[k]];
            columns[ROWS * k + i] = entry / (i < 3 ? 1 : l->size);
        }
}

/* Evaluate closure and screws at q and factorise; return the lanes in which they are finite. */
static mask look(struct loop_lanes *l, wide t, const wide *q) {
    const long rank = l->sizes.solved;
    mask known = ~(mask){0};
    wide worst = all(0);
    call(l->kernels.position, &t, q, q, l->p, l->work, l->screws);
    for (int i = 0; i < 12; i++) {
        wide entry = magnitude(l->screws[i]);
        if (i % 4 == 3)
            entry /= l->size;
        known &= finite(entry);
        worst = larger(worst, entry);
    }
    scaled_columns(l, l->matrix);
    factorise_screws(l);
    const wide first = magnitude(l->r[0]);
    l->soundness = chosen(first > 0, magnitude(l->r[(ROWS + 1) * (rank - 1)] / first), all(0));
    l->closure = worst;
    return known;
}

/* Close the open lanes at t by Newton's method from q, in place; return the lanes closed by full steps. */
static mask closed_loops(struct loop_lanes *l, mask open, wide t, wide *q) {
    const long n = l->sizes.n, solved = l->sizes.solved;
    const wide tolerance = all(R(l->sizes.tolerance));
    wide before = all(REAL_INFINITY), step = before, fine = all(FINE), b[ROWS], x[ROWS];
    mask done = {0};
    prescribe_lanes(l, t, q);
    for (long k = 0; k < n; k++)
        fine = larger(fine, 2 * REAL_EPSILON * magnitude(q[k]) / l->scale[k]);
    const wide coarse = larger(all(COARSE), 8 * fine);
    for (int turn = 0; turn < MOST_ITERATIONS; turn++) {
        open &= look(l, t, q);
        const wide defect = l->closure;
        const mask rounding = ~(defect <= fine) & (defect > R(0.5) * before) & (larger(before, defect) <= coarse);
        const mask back = open & rounding & (defect > before);
        if (any(back)) {
            for (long k = 0; k < solved; k++)
                q[l->solved[k]] = chosen(back, l->trial[k], q[l->solved[k]]);
            look(l, t, q);
        }
        const mask here = open & ((defect <= fine) | rounding | ((defect <= tolerance) & (step <= STILL)));
        done |= here;
        open &= ~here & ~((defect > before) & (defect > tolerance)) & (l->soundness > SIGHT);
        if (!any(open))
            break;
        before = defect;
        step = all(0);
        mismatch(l, b);
        solve_screws(l, b, x);
        for (long k = 0; k < solved; k++) {
            open &= finite(x[k]);
            step = larger(step, magnitude(x[k]) / l->scale[l->solved[k]]);
        }
        const wide part = 1 / larger(all(1), step);
        for (long k = 0; k < solved; k++) {
            const long j = l->solved[k];
            l->trial[k] = q[j];
            q[j] = chosen(open, q[j] + part * x[k], q[j]);
        }
    }
    return done;
}

static wide changes(struct loop_lanes *l, int which, const wide *drift, wide *b, wide *v) {
    const long n = l->sizes.n, solved = l->sizes.solved;
    wide size = all(0), left = size, x[ROWS];
    for (int i = 0; i < ROWS; i++) {
        b[i] = all(0);
        if (drift)
            b[i] = -drift[i];
        size = larger(size, magnitude(b[i]) / (i < 3 ? 1 : l->size));
    }
    for (long k = 0; k < l->sizes.inputs; k++) {
        const long j = l->driven[k];
        const wide rate = l->prescribed[3 * k + which];
        v[j] = rate;
        size = larger(size, magnitude(rate) / l->scale[j]);
        for (int i = 0; i < ROWS; i++)
            b[i] -= l->screws[12 + n * i + j] * rate;
    }
    solve_screws(l, b, x);
    for (long k = 0; k < solved; k++)
        v[l->solved[k]] = x[k];
    for (long k = solved; k < ROWS; k++)
        left = chosen(magnitude(b[k]) <= left, left, magnitude(b[k]));
    return chosen(size > 0, left / size, all(0));
}

/* Write rates and accelerations behind q, with the factor there; return the lanes that can follow the inputs. */
static mask moved_loops(struct loop_lanes *l, wide t, wide *q) {
    const long n = l->sizes.n;
    wide b[ROWS], *u = q + n, *a = u + n;
    const wide left = changes(l, 1, NULL, b, u);
    call(l->kernels.motion, &t, q, u, l->p, l->work, l->loads);
    changes(l, 2, l->loads + ROWS * n, b, a);
    return (left <= real_fmax(LEFT, LEFT_OPEN * R(l->sizes.tolerance))) & finite(largest_in(u, 2 * n));
}

/* -- forces: as in loop.c -------------------------------------------------------------------------------- */

static void held(const struct loop_lanes *l, const wide *efforts, wide *wrench) {
    const long solved = l->sizes.solved;
    wide c[ROWS], s[ROWS];
    for (long k = 0; k < solved; k++)
        c[k] = efforts[k] * l->scale[l->solved[k]];
    for (int k = 0; k < ROWS; k++)
        s[k] = all(0);
    for (long k = 0; k < solved; k++) {
        wide value = c[0];
        for (long j = 1; j < solved; j++)
            value = chosen(l->order[k] == j, c[j], value);
        for (long i = 0; i < k; i++)
            value -= l->r[ROWS * k + i] * s[i];
        s[k] = value / l->r[ROWS * k + k];
    }
    for (long k = solved - 1; k >= 0; k--)
        reflect(l, k, s);
    for (int k = 0; k < 3; k++) {
        wrench[k] = s[3 + k] / l->size;
        wrench[3 + k] = s[k];
    }
}

/* Write the closing wrench behind the accelerations; return the lanes with regular force transmission. */
static mask forced(struct loop_lanes *l, wide *q) {
    const long n = l->sizes.n, unknown = l->sizes.unknown, solved = l->sizes.solved;
    wide *u = q + n, *work = u + n, b[ROWS], c[ROWS], x[ROWS], needed[ROWS];
    l->hold = all(1);
    if (l->kernels.inverse == NULL)
        return ~(mask){0};
    call(l->kernels.inverse, &l->t, q, u, l->p, work, l->loads);
    for (long k = 0; k < n; k++)
        l->efforts[k] = all(0);
    if (l->kernels.given != NULL)
        call(l->kernels.given, &l->t, q, u, l->p, work, l->efforts);
    for (long k = 0; k < solved; k++)
        b[k] = l->efforts[l->solved[k]] - l->loads[l->solved[k]];
    held(l, b, work + n);
    if (unknown == 0)
        return ~(mask){0};
    for (long i = 0; i < unknown; i++) {
        const long j = l->driven[l->known[i]];
        for (int k = 0; k < ROWS; k++)
            c[k] = -l->screws[12 + n * k + j];
        solve_screws(l, c, x);
        for (long k = 0; k < unknown; k++)
            l->gain[unknown * i + k] = x[l->found[k]];
        needed[i] = l->loads[j] + power(l, j, work + n) - l->efforts[j];
    }
    mask good = factor_dense(unknown, l->gain, l->swaps);
    for (long k = 0; k < unknown; k++) {
        l->hold = chosen(l->swaps[k] != k, -l->hold, l->hold);
        l->hold *= l->gain[unknown * k + k] / l->scale[l->solved[l->found[k]]] * l->scale[l->driven[l->known[k]]];
    }
    solve_dense(unknown, l->gain, l->swaps, needed);
    good &= magnitude(l->hold) > NO_DRIVE;
    for (long k = 0; k < unknown; k++)
        b[l->found[k]] += needed[k];
    held(l, b, work + n);
    return good;
}

/* -- steps: as in follow.c ------------------------------------------------------------------------------- */

/* As in follow.c; `columns` are those of the new pose. */
static mask on_branch(const struct loop_lanes *l, const wide *columns) {
    const long rank = l->sizes.solved;
    wide product[ROWS * ROWS];
    mask swaps[ROWS], opposite = {0};
    for (long i = 0; i < rank; i++)
        for (long j = 0; j < rank; j++)
            product[rank * i + j] = six_dot(l->columns + ROWS * i, columns + ROWS * j);
    factor_dense(rank, product, swaps);
    for (long i = 0; i < rank; i++)
        opposite ^= (product[(rank + 1) * i] < 0) ^ (swaps[i] != i);
    return ~opposite;
}

/* Move to `next` in one step in the lanes `which`; return those with an accurate prediction. Failed lanes are removed
   from `alive`. */
static mask attempt_loops(struct loop_lanes *l, mask which, wide next, real least, mask *alive) {
    const long n = l->sizes.n, solved = l->sizes.solved;
    const wide h = next - l->t, g = l->stride, s = h / g, *q = l->q, *u = q + n, *a = u + n;
    const wide *q0 = l->past, *u0 = q0 + n, *a0 = u0 + n;
    const mask near = (g * h > 0) & (magnitude(h) <= STRIDES * magnitude(g));
    wide *new = l->next, way = all(0), astray = way, columns[ROWS * ROWS];
    for (long k = 0; k < n; k++)
        new[k] = q[k];
    for (long k = 0; k < solved; k++) {
        const long j = l->solved[k];
        const wide change = wide_parabola(h, u[j], a[j]);
        l->change[k] = chosen(near, change + wide_quintic(s, g, q[j], u[j], a[j], q0[j], u0[j], a0[j]), change);
        way = larger(way, magnitude(l->change[k]) / l->scale[j]);
        new[j] += l->change[k];
    }
    which &= way <= LOOP_LONGEST;
    const mask close = closed_loops(l, which, next, new);
    *alive &= ~which | close;
    which &= close;
    for (long k = 0; k < solved; k++) {
        const long j = l->solved[k];
        astray = larger(astray, magnitude(new[j] - q[j] - l->change[k]) / l->scale[j]);
    }
    for (long k = 0; k < l->sizes.inputs; k++) {
        const long j = l->driven[k];
        const wide path = h * (u[j] + R(0.5) * h * a[j]);
        which &= ~(magnitude(new[j] - q[j] - path) / l->scale[j] > LOOP_LONGEST);
    }
    which &= ~(astray > LOOP_ASTRAY * way + R(1e-9));
    if (!any(which))
        return which;
    scaled_columns(l, columns);
    *alive &= ~which | (moved_loops(l, next, new) & (l->soundness > least) & on_branch(l, columns));
    copy_where(which, columns, ROWS * solved, l->columns);
    copy_where(which, l->q, 3 * n, l->past);
    copy_where(which, new, 3 * n, l->q);
    l->stride = chosen(which, h, l->stride);
    l->t = chosen(which, next, l->t);
    return which;
}

/* -- a loop in each lane --------------------------------------------------------------------------------- */

static void set_up_lanes(struct loop_lanes *l, ptrdiff_t lead) {
    const ptrdiff_t parameters = l->sizes.parameters;
    const wide zero = all(0);
    if (l->kernels.setup != NULL)
        call(l->kernels.setup, NULL, NULL, NULL, l->p, NULL, l->p + parameters);
    call(l->kernels.inputs, &zero, l->next, l->next, l->p, l->work, l->prescribed);
    l->first = l->prescribed[3 * lead], l->rate = l->prescribed[3 * lead + 1];
}

/* Write the time at which the input has a value, if it keeps its rate at t = 0; return the lanes in which it does. */
static mask time_of(struct loop_lanes *l, const struct loop_lane_task *task, wide value, wide *t) {
    const wide *jet = l->prescribed + 3 * task->lead;
    *t = (value - l->first) / l->rate;
    call(l->kernels.inputs, t, l->next, l->next, l->p, l->work, l->prescribed);
    return (l->rate != 0) & (jet[1] == l->rate) & (magnitude(jet[0] - value) <= R(task->close) * larger(all(1), magnitude(value)));
}

/* Keep the loop closed while its parameters change from those of the scene to those of each lane; return the closed
   lanes. */
static mask begin_loops(struct loop_lanes *l, const struct loop_lane_task *task) {
    const long n = l->sizes.n, parameters = l->sizes.parameters;
    mask alive = ~(mask){0};
    memset(l->next, 0, (size_t)(3 * n + ROWS) * sizeof(wide));
    memset(l->past, 0, (size_t)(3 * n + ROWS) * sizeof(wide));
    for (long i = 0; i < n; i++)
        l->q[i] = all(task->start[i]);
    l->t = l->stride = all(0);
    l->p[parameters + l->sizes.derived] = all(RANK_TOLERANCE);
    for (ptrdiff_t s = 0; s < task->stage_count; s++) {
        const real part = task->stages[s];
        load(task->parameters, parameters, l->p);
        for (long i = 0; i < parameters; i++)
            l->p[i] = (1 - part) * task->own[i] + part * l->p[i];
        set_up_lanes(l, task->lead);
        if (!task->starts_at_zero)
            alive &= time_of(l, task, all(R(task->begin)), &l->t);
        memcpy(l->begun, l->q, (size_t)n * sizeof(wide));
        alive &= closed_loops(l, alive, l->t, l->q) & (l->soundness > R(task->least));
        for (long i = 0; i < n; i++)
            alive &= magnitude(l->q[i] - l->begun[i]) / l->scale[i] <= 1;
        if (!any(alive))
            break;
    }
    return alive;
}

/* Write the times of all values; return the lanes in which the input has these values, at increasing times. */
static mask clocked(struct loop_lanes *l, const struct loop_lane_task *task) {
    mask alive = ~(mask){0};
    wide before = all(-REAL_INFINITY), t = before;
    for (ptrdiff_t i = 0; i < task->count; i++) {
        if (task->values != NULL)
            alive &= time_of(l, task, all(task->values[i]), &t);
        for (int lane = 0; lane < WIDTH; lane++)
            if (task->values != NULL)
                task->times[lane * task->count + i] = t[lane];
            else
                t[lane] = task->times[lane * task->count + i];
        alive &= t > before;
        before = t;
    }
    return alive;
}

/* Record pose and forces in lanes that have just arrived at a time; return the lanes with determined forces. */
static mask record_loops(struct loop_lanes *l, const struct loop_lane_task *task, mask arrived, int way, const ptrdiff_t *first) {
    const long n = l->sizes.n, out_size = l->sizes.out_size;
    const mask good = forced(l, l->q) & finite(largest_in(l->q + 2 * n, n + ROWS));
    call(l->kernels.outputs, &l->t, l->q, l->q + n, l->p, l->q + 2 * n, l->out);
    for (int lane = 0; lane < WIDTH; lane++)
        if (arrived[lane]) {
            const ptrdiff_t sample = first[lane] + way * task->reached[lane];
            real *column = task->out + lane * out_size * task->count + sample;
            const real *made = (const real *)l->out + lane;
            for (long i = 0; i < out_size; i++)
                column[i * task->count] = made[i * WIDTH];
            task->hold[lane * task->count + sample] = l->hold[lane];
            if ((double)l->closure[lane] > task->closure[lane])
                task->closure[lane] = (double)l->closure[lane];
            task->reached[lane]++;
        }
    return good & finite(largest_in(l->out, out_size));
}

/* Follow the lanes forwards (way = 1) or backwards from their first times; return the lanes that reach the end. */
static mask followed(struct loop_lanes *l, const struct loop_lane_task *task, mask alive, int way, const ptrdiff_t *first) {
    mask ended = {0};
    wide longest = all(1), target = l->t, h = all(0), shortest = h;
    for (int lane = 0; lane < WIDTH; lane++) {
        task->reached[lane] = 0;
        if (way > 0 ? first[lane] >= task->count : first[lane] < 0) {
            ended[lane] = alive[lane];
            alive[lane] = 0;
        } else {
            const real *times = task->times + lane * task->count;
            const real range = real_fabs(times[way > 0 ? task->count - 1 : 0] - l->t[lane]);
            longest[lane] = (range > R(task->apart) ? range : R(task->apart)) / R(task->longest);
        }
    }
    l->stride = all(0);
    alive &= closed_loops(l, alive, l->t, l->q);
    alive &= moved_loops(l, l->t, l->q);
    scaled_columns(l, l->columns);
    mask fresh = alive, arrived = {0};
    for (ptrdiff_t turn = 0; any(alive) && !is_interrupted(turn); turn++) {
        if (any(arrived))
            alive &= ~arrived | record_loops(l, task, arrived, way, first);
        arrived = (mask){0};
        for (int lane = 0; lane < WIDTH; lane++)
            if (fresh[lane]) {
                const ptrdiff_t at = first[lane] + way * task->reached[lane];
                if (way > 0 ? at >= task->count : at < 0) {
                    ended[lane] = alive[lane];
                    alive[lane] = 0;
                } else
                    target[lane] = task->times[lane * task->count + at];
            }
        h = chosen(fresh, target - l->t, h);
        shortest = chosen(fresh, smaller(magnitude(h), longest) / (1 << MOST_HALVINGS), shortest);
        arrived = fresh = alive & (h == 0) & fresh; /* the first time may equal the time of the start */
        if (any(arrived))
            continue;
        h = chosen(magnitude(h) > longest, chosen(h > 0, longest, -longest), h);
        wide next = l->t + h;
        next = chosen(magnitude(target - next) < R(1e-9) * magnitude(h), target, next);
        alive &= next != l->t;
        const mask kept = attempt_loops(l, alive, next, R(task->least), &alive);
        const wide left = target - next, twice = 2 * h;
        h = chosen(kept, chosen(magnitude(twice) < magnitude(left), twice, left), h / 2);
        alive &= kept | ~(magnitude(h) < shortest);
        arrived = fresh = alive & kept & (l->t == target);
    }
    return ended;
}

static void follow_loops(struct loop_lanes *l, const struct loop_lane_task *task) {
    const long n = l->sizes.n;
    ptrdiff_t first[WIDTH], back[WIDTH];
    mask alive = begin_loops(l, task);
    alive &= clocked(l, task);
    for (int lane = 0; lane < WIDTH; lane++) {
        task->closure[lane] = 0;
        for (first[lane] = 0; first[lane] < task->count; first[lane]++)
            if (!(task->times[lane * task->count + first[lane]] < l->t[lane]))
                break;
        back[lane] = first[lane] - 1;
    }
    memcpy(l->begun, l->q, (size_t)n * sizeof(wide));
    l->begun[n] = l->t;
    alive = followed(l, task, alive, -1, back);
    memcpy(l->q, l->begun, (size_t)n * sizeof(wide));
    l->t = l->begun[n];
    alive = followed(l, task, alive, 1, first);
    for (int lane = 0; lane < WIDTH; lane++)
        task->reached[lane] = alive[lane] ? task->count : 0;
}

static const struct loop_lanes_api loop_functions = {
    .lanes_struct = sizeof(struct loop_lanes),
    .bytes = loop_lane_bytes,
    .bind = loop_lane_bind,
    .follow = follow_loops,
};
