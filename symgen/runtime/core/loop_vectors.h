/* The functions of loop_lanes.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "loop_lanes.h"
#include "wide.h"

/* Largest number of halvings of a step. */
enum { MOST_HALVINGS = 12 };

struct loop_lanes {
    struct loop_kernels kernels;
    struct loop_sizes sizes;
    const ptrdiff_t *solved, *driven, *found, *known;
    real scale[MOST], size;
    wide t, stride, first, rate; /* value and rate of the input `lead` at t = 0 */
    wide *p, *q, *past, *next; /* variables, rates, accelerations and closing wrench: now, at the previous state,
                                  after the next step */
    wide *screws, *prescribed, *loads, *efforts, *work, *out, *change, *trial, *step, *gain, *begun;
    wide *matrix, *columns, *followed; /* as in struct loop */
    struct qr factor;
    wide closure, soundness, hold;
    long looks;
};

#define LOOP struct loop_lanes
#include "loop_branch.h"
#include "loop_steps.h"

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
        ARENA_ARRAY(l->step, n),
        ARENA_ARRAY(l->gain, s->unknown * s->unknown),
        ARENA_ARRAY(l->begun, n + 1),
        ARENA_ARRAY(l->matrix, ROWS * s->solved),
        ARENA_ARRAY(l->columns, ROWS * s->solved),
        ARENA_ARRAY(l->followed, ROWS * s->solved),
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

/* Close the open lanes at t from q, in place; return the lanes closed by full steps. */
static mask closed_loops(struct loop_lanes *l, mask open, wide t, wide *q) {
    mask regular = open;
    return closed_by_newton(l, open, t, q, 0, &regular);
}

/* Write rates and accelerations behind q, with the factor there; return the lanes that can follow the inputs. */
static mask moved_loops(struct loop_lanes *l, wide t, wide *q) {
    const long n = l->sizes.n;
    wide b[ROWS], *u = q + n, *a = u + n;
    const wide left = changes(l, 1, NULL, b, u);
    call(l->kernels.motion, &t, q, u, l->p, l->work, l->loads);
    changes(l, 2, l->loads + ROWS * n, b, a);
    return (left <= real_fmax(LEFT, LEFT_OPEN * R(l->sizes.tolerance))) & is_finite(largest_in(u, 2 * n));
}

/* Move to `next` in one step in the lanes `which`; return those with an accurate prediction. Failed lanes are removed
   from `alive`. */
static mask attempt_loops(struct loop_lanes *l, mask which, wide next, real least, mask *alive) {
    const long n = l->sizes.n;
    const struct loop_state now = {l->q, l->q + n, l->q + 2 * n}, past = {l->past, l->past + n, l->past + 2 * n};
    const wide h = next - l->t, largest = predicted_change(l, h, l->stride, now, past, l->next);
    which &= largest <= LOOP_LONGEST;
    const mask close = closed_loops(l, which, next, l->next);
    *alive &= ~which | close;
    which &= close & as_predicted(l, h, largest, now, l->next);
    if (!any(which))
        return which;
    *alive &= ~which | (moved_loops(l, next, l->next) & (l->soundness > least) & same_branch_of(l));
    copy_where(which, l->columns, ROWS * l->sizes.solved, l->followed);
    copy_where(which, l->q, 3 * n, l->past);
    copy_where(which, l->next, 3 * n, l->q);
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
    const mask good = forced(l, l->t, l->q, l->q + n, l->q + 2 * n) & is_finite(largest_in(l->q + 2 * n, n + ROWS));
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
    return good & is_finite(largest_in(l->out, out_size));
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
    memcpy(l->followed, l->columns, (size_t)(ROWS * l->sizes.solved) * sizeof(wide));
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
