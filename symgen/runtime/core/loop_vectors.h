/* The functions of loop_lanes.h for vectors of WIDTH doubles: see lanes_of_width.h. */
#include "loop_branch.h"
#include "loop_lanes.h"

#define LOOPS static inline
#include "loop_steps.h"

/* Largest number of halvings of a step. */
enum { MOST_HALVINGS = 12 };

struct loop_lanes {
    struct loop of;
    wide t, first, rate; /* value and rate of the input `lead` at t = 0 */
};

static void loop_lane_bind(struct loop_lanes *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
                           const ptrdiff_t *numbers, const unsigned char *is_length, void *memory) {
    loop_bind(&l->of, sizes, kernels, numbers, is_length, NULL, memory);
}

/* Close the open lanes at t from q, in place; return the lanes closed by full steps. */
static mask closed_loops(struct loop *l, mask open, wide t, wide *q) {
    mask regular = open;
    return closed_by_newton(l, open, t, q, 0, &regular);
}

/* Write rates and accelerations behind q, with the factor there; return the lanes that can follow the inputs. */
static mask moved_loops(struct loop *l, wide t, wide *q) {
    const long n = l->sizes.n;
    wide b[ROWS], *u = q + n, *a = u + n;
    const wide left = loop_changes(l, 1, NULL, b, u);
    call(l->kernels.motion, &t, q, u, l->p, l->work, l->loads);
    loop_changes(l, 2, l->loads + ROWS * n, b, a);
    return (left <= real_fmax(LEFT, LEFT_OPEN * R(l->sizes.tolerance))) & is_finite(largest_in(u, 2 * n));
}

/* Move to `next` in one step in the lanes `which`; return those with an accurate prediction. Failed lanes are removed
   from `alive`. */
static mask attempt_loops(struct loop_lanes *l, mask which, wide next, real least, mask *alive) {
    struct loop *of = &l->of;
    const wide h = next - l->t, largest = predicted_change(of, h);
    which &= largest <= LOOP_LONGEST;
    const mask close = closed_loops(of, which, next, of->next);
    *alive &= ~which | close;
    which &= close & as_predicted(of, h, largest);
    if (!any(which))
        return which;
    *alive &= ~which | (moved_loops(of, next, of->next) & (of->soundness > least) & same_branch_of(of));
    take_next(of, which, h);
    l->t = chosen(which, next, l->t);
    return which;
}

/* -- a loop in each lane --------------------------------------------------------------------------------- */

static void set_up_lanes(struct loop_lanes *l, ptrdiff_t lead) {
    struct loop *of = &l->of;
    const wide zero = all(0);
    set_up(&of->base);
    call(of->kernels.inputs, &zero, of->next, of->next, of->p, of->work, of->prescribed);
    l->first = of->prescribed[3 * lead], l->rate = of->prescribed[3 * lead + 1];
}

/* Write the time at which the input has a value, if it keeps its rate at t = 0; return the lanes in which it does. */
static mask time_of(struct loop_lanes *l, const struct loop_lane_task *task, wide value, wide *t) {
    struct loop *of = &l->of;
    const wide *jet = of->prescribed + 3 * task->lead;
    *t = (value - l->first) / l->rate;
    call(of->kernels.inputs, t, of->next, of->next, of->p, of->work, of->prescribed);
    return (l->rate != 0) & (jet[1] == l->rate) & (magnitude(jet[0] - value) <= R(task->close) * larger(all(1), magnitude(value)));
}

/* Keep the loop closed while its parameters change from those of the scene to those of each lane; return the closed
   lanes. */
static mask begin_loops(struct loop_lanes *l, const struct loop_lane_task *task) {
    struct loop *of = &l->of;
    const long n = of->sizes.n, parameters = of->sizes.parameters;
    mask alive = ~(mask){0};
    memset(of->next, 0, (size_t)(3 * n) * sizeof(wide));
    memset(of->past, 0, (size_t)(3 * n) * sizeof(wide));
    for (long i = 0; i < n; i++)
        of->now[i] = all(task->start[i]);
    l->t = of->stride = all(0);
    for (ptrdiff_t s = 0; s < task->stage_count; s++) {
        const real part = task->stages[s];
        load(task->parameters, parameters, of->p);
        for (long i = 0; i < parameters; i++)
            of->p[i] = (1 - part) * task->own[i] + part * of->p[i];
        set_up_lanes(l, task->lead);
        if (!task->starts_at_zero)
            alive &= time_of(l, task, all(R(task->begin)), &l->t);
        copy(of->now, n, of->q);
        alive &= closed_loops(of, alive, l->t, of->now) & (of->soundness > R(task->least));
        for (long i = 0; i < n; i++)
            alive &= magnitude(of->now[i] - of->q[i]) / of->scale[i] <= 1;
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
    struct loop *of = &l->of;
    const long n = of->sizes.n, out_size = of->sizes.out_size;
    wide *q = of->now, *u = q + n, *a = u + n, *out = of->base.out;
    const mask good = forced(of, l->t, q, u, a) & is_finite(largest_in(a, n + ROWS));
    call(of->kernels.outputs, &l->t, q, u, of->p, a, out);
    for (int lane = 0; lane < WIDTH; lane++)
        if (arrived[lane]) {
            const ptrdiff_t sample = first[lane] + way * task->reached[lane];
            real *column = task->out + lane * out_size * task->count + sample;
            const real *made = (const real *)out + lane;
            for (long i = 0; i < out_size; i++)
                column[i * task->count] = made[i * WIDTH];
            task->hold[lane * task->count + sample] = of->hold[lane];
            if ((double)of->closure[lane] > task->closure[lane])
                task->closure[lane] = (double)of->closure[lane];
            task->reached[lane]++;
        }
    return good & is_finite(largest_in(out, out_size));
}

/* Follow the lanes forwards (way = 1) or backwards from their first times; return the lanes that reach the end. */
static mask followed(struct loop_lanes *l, const struct loop_lane_task *task, mask alive, int way, const ptrdiff_t *first) {
    struct loop *of = &l->of;
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
    of->stride = all(0);
    alive &= closed_loops(of, alive, l->t, of->now);
    alive &= moved_loops(of, l->t, of->now);
    keep_columns(of, ~(mask){0});
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
    struct loop *of = &l->of;
    const long n = of->sizes.n;
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
    copy(of->now, n, of->q); /* as it is at the start */
    const wide begun = l->t;
    alive = followed(l, task, alive, -1, back);
    copy(of->q, n, of->now);
    l->t = begun;
    alive = followed(l, task, alive, 1, first);
    for (int lane = 0; lane < WIDTH; lane++)
        task->reached[lane] = alive[lane] ? task->count : 0;
}

static const struct loop_lanes_api loop_functions = {
    .lanes_struct = sizeof(struct loop_lanes),
    .bytes = loop_bytes,
    .bind = loop_lane_bind,
    .follow = follow_loops,
};
