/* Driven linkages followed in time: the functions of kinematics.h, for a single linkage if WIDTH is 1, or for vectors
 * of WIDTH doubles: see lanes_of_width.h. */
#include "arena.h"
#include "kinematics.h"
#include "wide.h"

struct kinematics {
    struct kinematic_kernels kernels;
    struct kinematic_sizes sizes;
    struct kinematic_groups groups;
    const wide *p, *p_forces;
    wide *own, *own_forces;   /* parameters of the lanes */
    wide t, stride, length;
    wide *q, *past, *next;    /* coordinates, rates and second rates: now, a stride before, after the next step */
    wide *change, *still, *phi, *scale, *weight, *solved, *work, *closure, *out;
    wide *values, *inverse;   /* of dPhi/dq, its groups factorised; 1 / pivots of groups of two */
    wide *matrix, *pivots;    /* the groups of dPhi/dq and their pivots, evaluated last */
    wide *matrix_before, *pivots_before, *predicted; /* at the present pose; pivots at the predicted pose */
    wide *mean;
    wide *extremes, *lengths; /* rows of forces, and the largest square of the length of each vector of forces */
    wide *here, *before, violation; /* positions and velocities of points now; positions at the previous time */
    wide *rates;              /* magnitudes of the rates of links at the last time */
    wide passed;              /* the last time; not a number before the first */
    mask *swaps, *spare, steady;
};

static size_t kinematic_place(struct kinematics *k, const struct kinematic_sizes *s, const struct kinematic_groups *g,
                              void *memory) {
    const struct arena_array arrays[] = {
        ARENA_ARRAY(k->own, s->parameters + s->derived + 1),
        ARENA_ARRAY(k->own_forces, s->parameters + s->derived_forces + 1),
        ARENA_ARRAY(k->q, 3 * s->n),
        ARENA_ARRAY(k->past, 3 * s->n),
        ARENA_ARRAY(k->next, 3 * s->n),
        ARENA_ARRAY(k->change, s->n),
        ARENA_ARRAY(k->still, s->n),
        ARENA_ARRAY(k->phi, s->m),
        ARENA_ARRAY(k->scale, s->m),
        ARENA_ARRAY(k->weight, s->m),
        ARENA_ARRAY(k->solved, s->n),
        ARENA_ARRAY(k->work, s->work),
        ARENA_ARRAY(k->closure, s->out),
        ARENA_ARRAY(k->out, s->out),
        ARENA_ARRAY(k->values, g->squares + g->couplings),
        ARENA_ARRAY(k->inverse, s->n),
        ARENA_ARRAY(k->matrix, g->squares),
        ARENA_ARRAY(k->matrix_before, g->squares),
        ARENA_ARRAY(k->mean, g->squares),
        ARENA_ARRAY(k->pivots, s->n),
        ARENA_ARRAY(k->pivots_before, s->n),
        ARENA_ARRAY(k->predicted, s->n),
        ARENA_ARRAY(k->swaps, s->n),
        ARENA_ARRAY(k->spare, s->n),
        ARENA_ARRAY(k->extremes, 4 * s->joint_forces),
        ARENA_ARRAY(k->lengths, s->joint_forces),
        ARENA_ARRAY(k->here, 2 * s->coordinates),
        ARENA_ARRAY(k->before, s->coordinates),
        ARENA_ARRAY(k->rates, s->links),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t kinematic_bytes(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups) {
    struct kinematics counted;
    return kinematic_place(&counted, sizes, groups, NULL);
}

static void kinematic_bind(struct kinematics *k, const struct kinematic_sizes *sizes,
                           const struct kinematic_kernels *kernels, const struct kinematic_groups *groups,
                           void *memory) {
    kinematic_place(k, sizes, groups, memory);
    k->sizes = *sizes, k->kernels = *kernels, k->groups = *groups;
    for (ptrdiff_t i = 0; i < sizes->m; i++)
        k->scale[i] = all(REAL_INFINITY) - all(REAL_INFINITY);
}

#include "kinematic_steps.h"

/* -- a run in each lane ---------------------------------------------------------------------------------- */

/* The parameters of each lane, and the quantities that depend on them alone; a single linkage has both in its row. */
static const wide *parameters_of(const struct kinematics *k, const real *rows, kernel setup, ptrdiff_t derived,
                                 wide *own) {
    const ptrdiff_t parameters = k->sizes.parameters;
    if (WIDTH == 1)
        return (const wide *)rows;
    load(rows, parameters, own);
    own[parameters + derived] = all(R(k->sizes.rank_tolerance));
    if (setup != NULL)
        call(setup, NULL, NULL, NULL, own, NULL, own + parameters);
    return own;
}

/* The number of times reached by each lane. */
static inline mask counts(const struct kinematic_task *task) {
    mask reached;
    memcpy(&reached, task->reached, sizeof reached);
    return reached;
}

/* Write values of the lanes that have arrived, at the index of their next time. */
static void store(const struct kinematic_task *task, mask arrived, const wide *values, ptrdiff_t count, real *rows) {
    for (int lane = 0; lane < WIDTH; lane++)
        if (has(arrived, lane)) {
            real *row = rows + (lane * task->count + task->reached[lane]) * count;
            for (ptrdiff_t i = 0; i < count; i++)
                row[i] = ((const real *)values)[i * WIDTH + lane];
        }
}

/* Whether links have rotated little since the previous time; in arrived lanes, store their rates. An angle is less
   than its tangent, and the rotation differs from that of the greater rate by less than both together. */
static mask turns_little(struct kinematics *k, const struct kinematic_extremes *e, mask arrived) {
    const ptrdiff_t rates = k->sizes.coordinates;
    const wide step = magnitude(k->t - k->passed);
    mask little = ~(mask){0};
    for (ptrdiff_t link = 0; link < e->link_count; link++) {
        const ptrdiff_t i = e->links[2 * link], j = e->links[2 * link + 1];
        const wide *p = k->here, *o = k->before;
        const wide x = p[j] - p[i], y = p[j + 1] - p[i + 1], x0 = o[j] - o[i], y0 = o[j + 1] - o[i + 1];
        const wide *v = p + rates;
        const wide rate = magnitude(x * (v[j + 1] - v[i + 1]) - y * (v[j] - v[i])) / (x * x + y * y);
        const wide fastest = step * larger(rate, k->rates[link]), along = x0 * x + y0 * y;
        k->rates[link] = chosen(arrived, rate, k->rates[link]);
        little &= (along > 0) & (magnitude(x0 * y - y0 * x) < (R(e->turn) - 2 * fastest) * along);
    }
    return little;
}

/* Lanes in which a value exceeds the greatest so far; a NaN among the greatest remains. */
static inline mask beyond(wide value, wide greatest) {
    const mask within = (value <= greatest) | (greatest != greatest);
    return ~within;
}

/* Lanes whose next time is recorded; lanes that have just arrived have a next time. */
static mask recorded(const struct kinematic_task *task) {
    const unsigned char *flags = task->extremes->recorded;
    const ptrdiff_t first = task->reached[0];
    mask flagged = {0};
    if (first < task->count && !any(counts(task) != first))
        return flagged - flags[first];
    for (int lane = 0; lane < WIDTH; lane++)
        ((flag *)&flagged)[lane] = -(flag)(task->reached[lane] < task->count && flags[task->reached[lane]]);
    return flagged;
}

/* Update the extremes of lanes that have just arrived at a time; `k->out` has the forces of the pose. */
static void reduce(struct kinematics *k, const struct kinematic_task *task, mask arrived) {
    const struct kinematic_extremes *e = task->extremes;
    const ptrdiff_t count = k->sizes.joint_forces, m = k->sizes.m, places = k->sizes.coordinates;
    wide *greatest = k->extremes, *least = greatest + count, *longest = least + count, *last = longest + count;
    call(k->kernels.points, &k->t, k->q, k->q + k->sizes.n, k->p, k->work, k->here);
    const mask little = turns_little(k, e, arrived);
    k->steady &= ~arrived | (k->passed != k->passed) | little;
    k->steady &= ~arrived | is_finite(largest_in(k->out, count)); /* otherwise the caller decides from all values */
    copy_where(arrived, k->here, places, k->before);
    k->passed = chosen(arrived, k->t, k->passed);
    arrived &= recorded(task);
    if (!any(arrived))
        return;
    if (any(arrived & beyond(largest_in(k->phi, m) * (1 + 4 * REAL_EPSILON), k->violation))) /* a quotient, but for round-off */
        for (ptrdiff_t i = 0; i < m; i++) {
            const wide violation = magnitude(k->closure[i] / k->closure[m + i]);
            k->violation = chosen(arrived & beyond(violation, k->violation), violation, k->violation);
        }
    for (ptrdiff_t v = 0; v < e->vectors; v++) {
        const ptrdiff_t begin = e->starts[v], end = e->starts[v + 1];
        const int wanted = e->wanted[v];
        wide square = all(0);
        for (ptrdiff_t i = begin; i < end; i++) {
            const wide value = k->out[i];
            if (wanted & GREATEST)
                greatest[i] = chosen(arrived & beyond(value, greatest[i]), value, greatest[i]);
            if (wanted & LEAST)
                least[i] = chosen(arrived & beyond(-value, -least[i]), value, least[i]);
            if (wanted & LAST)
                last[i] = chosen(arrived, value, last[i]);
            square += value * value;
        }
        if (!(wanted & LONGEST_VECTOR))
            continue;
        const mask longer = arrived & beyond(square, k->lengths[v]);
        k->lengths[v] = chosen(longer, square, k->lengths[v]);
        copy_where(longer, k->out + begin, end - begin, longest + begin);
    }
}

static void begin_extremes(struct kinematics *k) {
    const ptrdiff_t count = k->sizes.joint_forces;
    for (ptrdiff_t i = 0; i < count; i++) {
        k->extremes[i] = k->lengths[i] = all(-REAL_INFINITY);
        k->extremes[count + i] = all(REAL_INFINITY);
    }
    k->violation = all(0);
    k->passed = all(REAL_INFINITY) - all(REAL_INFINITY);
    k->steady = ~(mask){0};
}

static void end_extremes(const struct kinematics *k, const struct kinematic_extremes *e) {
    const ptrdiff_t numbers = 4 * k->sizes.joint_forces;
    for (int lane = 0; lane < WIDTH; lane++) {
        for (ptrdiff_t i = 0; i < numbers; i++)
            e->rows[lane * numbers + i] = ((const real *)k->extremes)[i * WIDTH + lane];
        e->closure[lane] = (double)((const real *)&k->violation)[lane];
        e->steady[lane] = (unsigned char)has(k->steady, lane);
    }
}

/* Record pose and forces of lanes that have just arrived at a time, with dPhi/dq factorised there. */
static void record(struct kinematics *k, const struct kinematic_task *task, mask arrived) {
    const ptrdiff_t n = k->sizes.n;
    if (task->extremes == NULL)
        store(task, arrived, k->q, 3 * n, task->rows);
    if (k->kernels.joints != NULL) { /* their argument `work` is the accelerations, then the multipliers */
        memcpy(k->work, k->q + 2 * n, (size_t)n * sizeof(wide));
        call(k->kernels.balance, &k->t, k->q, k->q + n, k->p_forces, k->work, k->out);
        memcpy(k->work, k->q + 2 * n, (size_t)n * sizeof(wide));
        solve_transposed(k, k->out, k->work + n);
        call(k->kernels.joints, &k->t, k->q, k->q + n, k->p_forces, k->work, k->out);
        if (task->extremes != NULL)
            reduce(k, task, arrived);
        else
            store(task, arrived, k->out, k->sizes.joint_forces, task->forces);
    }
    const mask reached = counts(task) + (arrived & 1);
    memcpy(task->reached, &reached, sizeof reached);
}

/* Begin at the starts; return the lanes with a regular start. */
static mask begin(struct kinematics *k, const struct kinematic_task *task) {
    const ptrdiff_t n = k->sizes.n;
    k->p = parameters_of(k, task->parameters, k->kernels.setup, k->sizes.derived, k->own);
    if (k->kernels.joints != NULL)
        k->p_forces = parameters_of(k, task->parameters, k->kernels.setup_forces, k->sizes.derived_forces, k->own_forces);
    load(task->q, n, k->q);
    load(task->lengths, 1, &k->length);
    memset(k->still, 0, (size_t)n * sizeof(wide));
    memset(k->past, 0, 3 * (size_t)n * sizeof(wide));
    k->t = all(R(task->t)), k->stride = all(0);
    for (int lane = 0; lane < WIDTH; lane++)
        task->reached[lane] = 0;
    return begin_pose(k, ~(mask){0});
}

/* Set the next time of lanes that have just arrived; lanes without a next time end. */
static wide renewed(const struct kinematic_task *task, mask fresh, wide target, mask *alive) {
    const ptrdiff_t first = task->reached[0];
    if (first < task->count && !any(~fresh | (counts(task) != first)))
        return all(task->times[first]);
    for (int lane = 0; lane < WIDTH; lane++)
        if (has(fresh, lane)) {
            if (task->reached[lane] == task->count)
                ((flag *)alive)[lane] = 0;
            else
                ((real *)&target)[lane] = task->times[task->reached[lane]];
        }
    return target;
}

static void kinematic_follow(struct kinematics *k, const struct kinematic_task *task) {
    mask alive = begin(k, task), arrived = alive & (k->t == task->times[0]), fresh = alive;
    const wide shortest = all(SHORTEST * real_fabs(task->times[task->count - 1] - R(task->t)));
    wide target = k->t, h = all(0);
    if (task->extremes != NULL)
        begin_extremes(k);
    for (ptrdiff_t turn = 0; any(alive) && !is_interrupted(turn); turn++) {
        if (any(arrived))
            record(k, task, arrived);
        if (any(fresh)) {
            target = renewed(task, fresh, target, &alive);
            h = chosen(fresh, target - k->t, h);
        }
        const wide next = chosen(magnitude(target - k->t - h) < R(1e-9) * magnitude(h), target, k->t + h);
        alive &= next != k->t;
        const mask held = attempt(k, alive, next, &alive);
        const wide left = target - next, twice = 2 * h;
        h = chosen(held, chosen(magnitude(twice) < magnitude(left), twice, left), h / 2);
        const mask too_short = magnitude(h) < shortest;
        alive &= held | ~too_short;
        arrived = fresh = alive & held & (k->t == target);
    }
    if (task->extremes != NULL)
        end_extremes(k, task->extremes);
}

#if WIDTH == 1

/* The largest error of J^T lambda = forces, which is overwritten. */
static real unbalanced(const struct kinematics *k, const real *lambda, real *forces) {
    const ptrdiff_t *entry = k->groups.entries;
    for (ptrdiff_t e = 0; e < k->groups.filled; e++, entry += 4)
        forces[entry[3]] -= k->closure[entry[1]] * lambda[entry[2]];
    return largest_or_nan(forces, k->sizes.n);
}

static ptrdiff_t multipliers(struct kinematics *k, const real *p, const real *p_forces, const real *times,
                             const real *rows, ptrdiff_t count, real *lambda, real *quality) {
    const ptrdiff_t n = k->sizes.n, m = k->sizes.m;
    k->p = p;
    for (ptrdiff_t i = 0; i < count && !is_interrupted(i); i++, rows += 3 * n, lambda += m, quality += 2) {
        constraint_errors(k, times[i], rows);
        if (!any(factorise_groups(k)))
            return i;
        read_pivots(k, k->pivots);
        quality[0] = n ? soundness(k->pivots, n) : 1;
        if (!(quality[0] > SOUND))
            return i;
        copy(rows + 2 * n, n, k->work);
        k->kernels.balance(times + i, rows, rows + n, p_forces, k->work, k->out);
        solve_transposed(k, k->out, lambda);
        quality[1] = unbalanced(k, lambda, k->out);
    }
    return count;
}

#endif

#if WIDTH == 1
const struct kinematics_api symgen_kinematics = {
    .multipliers = multipliers,
#else
static const struct kinematics_api kinematic_functions = {
#endif
    .kinematics_struct = sizeof(struct kinematics),
    .bytes = kinematic_bytes,
    .bind = kinematic_bind,
    .follow = kinematic_follow,
};
