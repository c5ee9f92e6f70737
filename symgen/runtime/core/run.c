#include "run.h"

#include <string.h>

#include "arena.h"
#include "lanes.h"

/* Safety factor of the length of the next step. */
#define SAFETY 0.9
/* Accelerations of linkages vary much between steps: beyond this growth the factor CAREFUL applies. */
#define GROW_FREELY 1.2

/* Least pivot of the constraints, over the largest so far, at which adaptive steps end: the error of rates by rounding is
   proportional to its inverse. */
#define TOO_NEAR 1e-4

/* -- memory ------------------------------------------------------------------------------------------------ */

/* Point all arrays into memory, or only count their bytes. */
static size_t place(struct run *run, void *memory) {
    const struct sizes *sizes = &run->e->sizes;
    const long dim = run->dim, events = sizes->events, switches = sizes->switches;
    const long samples = run->task.samples + 1, found = events ? run->task.found : 0;
    const struct scheme *near = run->given->near;
    const size_t own = run->given->kind->bytes(run, run->given->counts);
    const size_t own_near = near ? near->kind->bytes(run, near->counts) : 0;
    run->branch_bytes = branch_bytes(run->e);
    const struct arena_array arrays[] = {
        ARENA_ARRAY(run->state, 1),
        ARENA_ARRAY(run->passages, MOST_PASSAGES),
        ARENA_ARRAY(run->events, found),
        ARENA_ARRAY(run->event_states, found * dim),
        ARENA_ARRAY(run->y, dim),
        ARENA_ARRAY(run->y_new, dim),
        ARENA_ARRAY(run->stage, dim),
        ARENA_ARRAY(run->error, dim),
        ARENA_ARRAY(run->y_old, dim),
        ARENA_ARRAY(run->gaps, (STEP_PROBES + 1) * events),
        ARENA_ARRAY(run->times, samples),
        ARENA_ARRAY(run->samples, samples * dim),
        ARENA_ARRAY(run->nodes, run->task.nodes + 1),
        ARENA_ARRAY(run->counts, run->task.nodes + 1),
        ARENA_ARRAY(run->references, samples * sizes->windings),
        ARENA_ARRAY(run->wound, sizes->windings),
        ARENA_ARRAY(run->turned, 2 * sizes->turns),
        ARENA_ARRAY(run->turns, samples * sizes->turns),
        ARENA_ARRAY(run->farthest, switches),
        ARENA_ARRAY(run->switched, switches),
        ARENA_ARRAY(run->switch_gaps, (SWITCH_PROBES + 1) * switches),
        {&run->owns[0], own},
        {&run->owns[1], own_near},
        {&run->branch, run->branch_bytes},
        ARENA_ARRAY(run->directions, events),
        ARENA_ARRAY(run->terminal, events),
        ARENA_ARRAY(run->sides, events),
        ARENA_ARRAY(run->slopes, events),
        ARENA_ARRAY(run->probed, events),
    };
    return ARENA_PLACE(arrays, memory);
}

size_t run_bytes(const struct equations *e, const struct scheme *scheme, const struct task *task) {
    struct run run = {.e = (struct equations *)e, .given = scheme, .task = *task, .dim = e->dim};
    return place(&run, NULL);
}

/* Bind the method of the present steps. */
static void bind_method(struct run *run) {
    const struct task *task = &run->task;
    const int near = run->given->near && run->state->near;
    run->scheme = near ? *run->given->near : *run->given;
    run->scheme.adaptive = run->scheme.adaptive && (task->rtol > 0.0 || task->atol > 0.0); /* these need a tolerance */
    run->own = run->owns[near];
    run->scheme.kind->bind(run);
}

void run_bind(struct run *run, struct equations *e, const struct scheme *scheme, const struct task *task,
              void *memory) {
    run->e = e, run->given = scheme, run->task = *task, run->dim = e->dim, run->least = 0.0;
    run->bytes = place(run, memory);
    e->revision++; /* the memory may have been restored */
    bind_method(run);
    e->finest = run->scheme.adaptive ? task->atol : 0.0;
}

/* Whether the times of samples are within the run, in ascending order. */
static int are_times_valid(const struct run *run) {
    const long count = run->task.samples;
    const real *times = run->times;
    for (long k = 0; k < count; k++)
        if (!(times[k] <= times[k + 1] && R(run->task.t0) <= times[k] && times[k] <= R(run->task.t_end)))
            return 0;
    return times[count] == REAL_INFINITY;
}

int run_valid(const struct run *run) {
    const struct state *s = run->state;
    const struct sizes *sizes = &run->e->sizes;
    const struct account *a = run->e->account;
    const long rows = sizes->m > 12 ? sizes->m : 12; /* the worst entry of a loop is one of 3 x 4 */
    const long last[] = {s->ended_by, s->worst, s->slid, s->blind, a->worst, a->weakest};
    const long ends[] = {sizes->events, rows, sizes->switches, sizes->events, rows, sizes->n + sizes->m};
    for (size_t i = 0; i < sizeof last / sizeof *last; i++)
        if (last[i] < -1 || last[i] >= (ends[i] > 0 ? ends[i] : 1))
            return 0;
    /* beyond them, steps would not end: the rounding error of the time is below that of its range */
    const real begin = R(run->task.t0), end = R(run->task.t_end);
    const real range = real_fmax(real_fabs(begin), real_fabs(end));
    if (!(begin <= s->t && s->t <= end && 0 <= s->h && s->h < REAL_INFINITY &&
          real_fabs(s->t_left) <= REAL_EPSILON * range))
        return 0;
    const long last_node = run->task.nodes, since = s->steps - s->steps_before;
    if (!(0 <= s->node && s->node <= last_node && run->nodes[last_node] == end && run->counts[last_node] < 0
          && run->counts[0] <= 0 && 0 <= since && (run->counts[s->node] < 0 || since <= run->counts[s->node])))
        return 0;
    return 0 <= s->recorded && s->recorded <= run->task.samples && s->passages == 0 && s->events == 0 &&
           0 <= s->events_before && s->events_before <= run->task.found && s->steps >= 0 &&
           are_times_valid(run) &&
           (run->scheme.kind->valid == NULL || run->scheme.kind->valid(run));
}

void run_reset(struct run *run) {
    struct state *s = run->state;
    memset(s, 0, sizeof *s);
    s->t = s->t_old = s->t_look = s->t_before = R(run->task.t0);
    s->h = R(run->task.step);
    run->nodes[run->task.nodes] = R(run->task.t_end), run->counts[run->task.nodes] = -1;
    s->ended_by = s->worst = s->blind = s->slid = -1;
    s->sound = s->at_look = s->at_before = s->looked = INFINITY;
    s->t_looked = s->t;
    bind_method(run);
    s->kinetic_min = s->potential_min = s->energy_start = REAL_INFINITY;
    s->kinetic_max = s->potential_max = -REAL_INFINITY;
}

/* The shortest step from a time that its rounding does not change. */
static real shortest_step(const struct run *run, real t) {
    return R(10) * REAL_EPSILON * real_fmax(real_fabs(t), REAL_EPSILON * R(run->task.t_end));
}

void run_set_nodes(struct run *run, const double *nodes, const long *counts) {
    for (long k = 0; k < run->task.nodes; k++) {
        run->nodes[k] = R(nodes[k]), run->counts[k] = counts[k];
        if (counts[k] > 0 && !(run->nodes[k] - run->nodes[k - 1] > shortest_step(run, run->nodes[k - 1])))
            run->counts[k] = 0;
    }
}

/* -- size of errors and steps ------------------------------------------------------------------------------ */

int all_finite(const real *v, long count) {
    for (long i = 0; i < count; i++)
        if (!real_isfinite(v[i]))
            return 0;
    return 1;
}

/* Whether drives prescribe all motion. */
static int is_prescribed(const struct run *run) {
    return run->e->n == run->e->m - run->e->sizes.redundant;
}

long judged_of(const struct run *run) {
    const struct equations *e = run->e;
    const double sound = fmin(run->state->sound, e->account->soundness);
    return is_magnified(run) && !(is_prescribed(run) && sound > PASSAGE) ? 2 * e->n : run->dim;
}

void rounding_of(const struct run *run, real h, real *rounding) {
    const struct state *s = run->state;
    struct equations *e = run->e;
    long n = e->n;
    rounding[0] = rounding[1] = rounding[2] = 0;
    if (!is_magnified(run))
        return;
    real sound = R(fmin(s->sound, e->account->soundness)), noise = R(e->of->rounding);
    real speed = largest_of(run->f, n), acceleration = largest_of(run->f + n, n);
    rounding[0] = noise * h * REAL_EPSILON / sound * speed;
    rounding[1] = noise * h * REAL_EPSILON / (sound * real_sqrt(sound)) * acceleration;
    if (judged_of(run) == 2 * n)
        return;
    /* The power of inertia has the error of the accelerations. The power of the multipliers has an error proportional
       to their size. */
    e->of->measure_energy(e, s->t, run->y);
    real inertia = speed > 0 ? R(2) * e->energies[0] / speed : 0;
    rounding[2] = rounding[1] * inertia
                  + noise * h * REAL_EPSILON / (sound * real_sqrt(sound)) * real_fabs(run->f[2 * n]);
}

real error_norm(const struct run *run, real h, const real *error) {
    real total = 0, atol = R(run->task.atol), rtol = R(run->task.rtol), rounding[3];
    long n = run->e->n;
    rounding_of(run, h, rounding);
    for (long i = 0; i < run->dim; i++) {
        real least = atol + rounding[i / n];
        real part = error[i] / (least + rtol * real_fmax(real_fabs(run->y[i]), real_fabs(run->y_new[i])));
        total += part * part;
    }
    return real_sqrt(total / R(run->dim));
}

static real exponent(const struct run *run) {
    return R(-1) / R(run->scheme.error_order + 1);
}

real largest_of(const real *v, long count) {
    real size = 0;
    for (long i = 0; i < count; i++)
        size = real_fmax(size, real_fabs(v[i]));
    return size;
}

/* Return a time in which the motion changes little: coordinates by 1/100 of their size due to their rates, and by
   1/200 due to their accelerations. For negligible rates and accelerations, a small part of the run. */
static real short_time(const struct run *run) {
    long n = run->e->n;
    real size = largest_of(run->y, n), rate = largest_of(run->f, n), acceleration = largest_of(run->f + n, n);
    real left = R(run->task.t_end) - run->state->t, time = left;
    if (size > 0 && rate > 0)
        time = real_fmin(time, R(0.01) * size / rate);
    if (size > 0 && acceleration > 0)
        time = real_fmin(time, R(0.1) * real_sqrt(size / acceleration));
    return real_fmax(time, R(1e-9) * left);
}

/* Estimate the first step from two derivatives (Hairer, II.4). Their tolerance is that of the state a short time
   later: at rest, the tolerance of the rates, and with it the step, would almost vanish. */
static real first_step(struct run *run) {
    real d1 = 0, d2 = 0, t = run->state->t, left = R(run->task.t_end) - t, h0 = short_time(run), h1;
    real atol = R(run->task.atol), rtol = R(run->task.rtol), *second = run->y_new;
    long dim = run->dim;
    for (long i = 0; i < dim; i++)
        run->stage[i] = run->y[i] + h0 * run->f[i];
    run->e->of->derivative(run->e, t + h0, run->stage, second);
    for (long i = 0; i < dim; i++) {
        real scale = atol + rtol * real_fmax(real_fabs(run->y[i]), real_fabs(run->stage[i]));
        real first = run->f[i] / scale, change = (second[i] - run->f[i]) / (scale * h0);
        d1 += first * first, d2 += change * change;
    }
    d1 = real_sqrt(d1 / R(dim)), d2 = real_sqrt(d2 / R(dim));
    h1 = d1 <= R(1e-15) && d2 <= R(1e-15) ? real_fmax(R(1e-6), h0 * R(1e-3))
                                          : real_pow(R(0.01) / real_fmax(d1, d2), -exponent(run));
    return real_fmin(real_fmin(R(100) * h0, h1), left);
}

/* Choose the method of the next steps, that near a loss of rank within a part of the soundest pivot. */
static int choose_method(struct run *run) {
    struct state *s = run->state;
    s->soundest = fmax(s->soundest, s->sound);
    const int near = s->sound < (s->near ? 2 * NEARBY : NEARBY) * s->soundest;
    if (run->given->near == NULL || !run->scheme.adaptive || near == s->near)
        return MORE;
    s->near = near;
    bind_method(run);
    const int status = run->scheme.kind->begin(run);
    if (status != DONE)
        return status;
    if (run->scheme.kind->longest)
        s->h = R(run->task.t_end) - R(run->task.t0);
    else if (s->t < R(run->task.t_end))
        s->h = first_step(run);
    return MORE;
}

/* -- the loop ---------------------------------------------------------------------------------------------- */

/* Update drift of constraints and energy with the state just accepted. */
static int monitor(struct run *run) {
    struct state *s = run->state;
    struct equations *e = run->e;
    const real *y = run->y, *energies = e->energies;
    if (e->m) {
        real error = e->of->position_error(e, s->t, y);
        if (error > s->position_drift) {
            s->position_drift = error;
            s->worst = e->account->worst;
        }
        real rate = e->of->velocity_error(e, s->t, y);
        if (!(real_isfinite(error) && real_isfinite(rate)))
            return NOT_FINITE;
        s->velocity_drift = real_fmax(s->velocity_drift, rate);
    }
    e->of->measure_energy(e, s->t, y);
    real total = energies[0] + energies[1] - (e->extra ? y[2 * e->n] : R(0));
    if (!real_isfinite(total))
        return NOT_FINITE;
    if (s->energy_start == REAL_INFINITY)
        s->energy_start = total - s->imbalance;
    s->imbalance = total - s->energy_start;
    s->energy_drift = real_fmax(s->energy_drift, real_fabs(s->imbalance));
    s->kinetic_min = real_fmin(s->kinetic_min, energies[0]);
    s->kinetic_max = real_fmax(s->kinetic_max, energies[0]);
    s->potential_min = real_fmin(s->potential_min, energies[1]);
    s->potential_max = real_fmax(s->potential_max, energies[1]);
    return (double)s->position_drift > run->task.max_drift ? DRIFTED : MORE;
}

/* Record the present state at all sample times up to the present one. */
static void record_present(struct run *run) {
    struct state *s = run->state;
    while (run->times[s->recorded] <= s->t) {
        memcpy(run->samples + s->recorded * run->dim, run->y, (size_t)run->dim * sizeof(real));
        keep_windings(run);
        s->recorded++;
    }
}

/* Project y onto the constraints. */
static int place_start(struct run *run) {
    struct state *s = run->state;
    struct equations *e = run->e;
    if (e->sizes.choices)
        e->of->rewrite(e, run->y, run->y, 1);
    int status = e->of->project(e, s->t, run->y);
    if (status != DONE)
        return status;
    s->sound = s->at_look = s->at_before = e->account->soundness;
    s->soundest = fmax(s->soundest, s->sound);
    s->t_old = s->t_look = s->t_before = s->t;
    follow_windings(run, s->t);
    return DONE;
}

/* Start the method at y, which is on the constraints. */
static int start_motion(struct run *run, int moved) {
    int status = choose_branches(run, moved);
    if (status == DONE)
        status = run->scheme.kind->begin(run);
    if (status != DONE)
        return status;
    if (!all_finite(run->f, run->dim))
        return NOT_FINITE;
    begin_events(run);
    status = monitor(run);
    record_present(run);
    return status;
}

int run_begin(struct run *run) {
    int status = place_start(run);
    if (status == DONE)
        status = start_motion(run, 1);
    if (status == MORE && run->scheme.adaptive && run->task.step == 0.0)
        run->state->h = run->scheme.kind->longest ? R(run->task.t_end) - run->state->t : first_step(run);
    return status;
}

void run_extend(struct run *run, real t_end) {
    run->task.t_end = (double)t_end;
    run->nodes[run->task.nodes] = t_end;
    run->state->t_left = 0;
}

int run_restart(struct run *run, int moves) {
    set_up(run->e);
    int status = moves ? place_start(run) : DONE;
    run->state->energy_start = REAL_INFINITY;
    return status == DONE ? start_motion(run, moves) : status;
}

void run_record(struct run *run) {
    struct state *s = run->state;
    const long recorded = s->recorded, last = run->task.samples;
    memcpy(run->samples + last * run->dim, run->y, (size_t)run->dim * sizeof(real));
    run->times[last] = s->t, s->recorded = last;
    keep_windings(run);
    run->times[last] = REAL_INFINITY, s->recorded = recorded;
}

/* Return the length of the next attempt after a step with this error over the tolerance. */
static real shortened(const struct run *run, real h, real norm) {
    if (!real_isfinite(norm))
        return R(SHRINK) * h;
    return h * real_fmax(R(SHRINK), R(CAREFUL) * real_pow(norm, exponent(run)));
}

/* Take one step and project its end: DONE; AGAIN with the next length in state->h; or the status of the failure. */
int try_step(struct run *run, real h, real t_new) {
    struct state *s = run->state;
    s->settled = 0;
    int status = run->scheme.kind->step(run, s->t, h, t_new);
    if (status == AGAIN)
        s->h = h * s->shrink;
    if (status != DONE)
        return status;
    if (!run->scheme.adaptive && !all_finite(run->y_new, run->dim))
        return NOT_FINITE;
    if (run->scheme.adaptive && !(s->norm <= 1)) {
        s->h = shortened(run, h, s->norm);
        return AGAIN;
    }
    status = s->settled ? DONE : project_new_state(run, t_new);
    if (status == AGAIN)
        s->h = h * s->shrink;
    /* The correction by the projection is the part of the step's error transverse to the constraints. If it exceeds
       the method's error estimate, the correction replaces the estimate. */
    if (status == DONE && run->scheme.adaptive && !(s->correction <= s->norm)) {
        s->norm = s->correction;
        if (!(s->norm <= 1)) {
            s->h = shortened(run, h, s->norm);
            return AGAIN;
        }
    }
    if (status == DONE && run->scheme.adaptive && !run->scheme.kind->longest && !keeps_revolutions(run, t_new)) {
        s->h = R(0.5) * h;
        return AGAIN;
    }
    return status;
}

/* Length of the next step over the step just taken. */
static real next_over_last(const struct run *run, real largest) {
    real best = real_pow(run->state->norm, exponent(run));
    real grown = real_fmin(R(SAFETY) * best, real_fmax(R(GROW_FREELY), R(CAREFUL) * best));
    return real_fmin(largest, real_fmax(R(SHRINK), grown));
}

static int is_counted(const struct run *run) {
    return run->counts[run->state->node] > 0;
}

/* Whether the interval that ends at the present node is complete. */
static int is_complete(const struct run *run) {
    const struct state *s = run->state;
    const long count = run->counts[s->node];
    return count < 0 ? s->t >= run->nodes[s->node] : s->steps == s->steps_before + count;
}

/* Enter the interval between two nodes of the next step, and set the length of counted steps. */
static int enter_interval(struct run *run) {
    struct state *s = run->state;
    for (; s->node < run->task.nodes && is_complete(run); s->node++, s->steps_before = s->steps)
        if (s->t < run->nodes[s->node]) {
            s->t = run->nodes[s->node], s->t_left = 0;
            s->h = R(run->task.step);
            record_present(run);
            const int status = run->scheme.kind->begin(run);
            if (status != DONE)
                return status;
        }
    const long k = s->node;
    if (run->counts[k] > 0)
        s->h = (run->nodes[k] - run->nodes[k - 1]) / R(run->counts[k]);
    return DONE;
}

/* Write the end of a step of length h, which ends at the next node at the latest; return its length. */
static real end_of_step(const struct run *run, real h, real *t_new) {
    const struct state *s = run->state;
    const long k = s->node, next = s->steps + 1 - s->steps_before;
    const real until = run->nodes[k];
    if (is_counted(run)) {
        *t_new = next < run->counts[k] ? run->nodes[k - 1] + R(next) * h : until;
        return h;
    }
    *t_new = s->t + (h + s->t_left);
    if (*t_new < until && until - *t_new >= R(1e-9) * h)
        return h;
    *t_new = until;
    return until - s->t;
}

/* Take a step within the tolerance: write its projected end to y_new, and its time and length. */
static int accepted_step(struct run *run, real *t_new, real *length) {
    struct state *s = run->state;
    real largest = R(GROW), part = 1, h;
    int failed = STEP_TOO_SMALL;
    /* The pivot from which the limits of ends and stages follow: a step from within them may end as near. Errors of a motion
       that drives prescribe do not add up, but power series have no digits there. */
    const int is_limited = run->scheme.near || !is_prescribed(run);
    const int avoids = run->scheme.adaptive && run->task.stabilisation == PROJECTION && run->e->m > 0 && is_limited;
    double sound = avoids ? fmin(s->soundest, s->sound / TOO_NEAR) : 0.0;
    if (run->scheme.adaptive)
        s->h = run->scheme.kind->longest ? real_fmin(s->h, run->scheme.kind->longest(run)) : within_revolutions(run, s->h);
    if (run->task.max_step > 0.0)
        s->h = real_fmin(s->h, R(run->task.max_step));
    for (;;) {
        h = part * s->h;
        if (!is_counted(run) && !(h > shortest_step(run, s->t)))
            return failed;
        h = end_of_step(run, h, t_new);
        run->least = PASSAGE * sound;
        int status = try_step(run, h, *t_new);
        if (status == DONE && run->e->account->soundness < TOO_NEAR * sound)
            status = SINGULAR;
        if (status == DONE)
            break;
        s->rejected++;
        if (status == AGAIN) {
            largest = 1;
            continue;
        }
        /* Shorten a step slightly if its end or a stage is near an instantaneous loss of rank. Where all lengths are, it
           may be nearer, but for power series, which leave it to the other method. */
        part *= R(0.7);
        if (status == SINGULAR && sound > 0 && !run->scheme.near && part < R(0.2)) {
            part = 1, sound = sound > 1e-5 * s->soundest ? 0.1 * sound : 0.0;
            continue;
        }
        int near = s->sound < NEAR && (status == PROJECTION_FAILED || status == UNSOLVED);
        if (is_counted(run) || (status != SINGULAR && !near)) {
            s->rejected--;
            return status;
        }
        if (part >= R(0.2))
            continue;
        if (!run->scheme.adaptive) {
            s->rejected--;
            return status;
        }
        s->h = h, part = 1, failed = status;
    }
    if (run->scheme.adaptive) {
        real factor = s->norm == 0 || run->scheme.kind->longest ? largest : next_over_last(run, largest);
        if (h == s->h || factor < 1)
            s->h = h * factor;
    }
    run->least = 0.0;
    *length = h;
    return DONE;
}

/* End the run at the last recorded event. */
static int stop_at_event(struct run *run, real *t_new, real h) {
    struct state *s = run->state;
    long last = s->events - 1;
    *t_new = run->events[last].t;
    memcpy(run->y_new, run->event_states + last * run->dim, (size_t)run->dim * sizeof(real));
    s->settled = 0;
    return run->scheme.kind->finish(run, h, *t_new);
}

static int one_step(struct run *run) {
    struct state *s = run->state;
    const struct kind *kind = run->scheme.kind;
    size_t bytes = (size_t)run->dim * sizeof(real);
    real t_new, h;
    int prepared = 0, status;
    long crossed = -1;
    double sound;
    if (s->ended_by >= 0)
        return ENDED;
    if (s->t < R(run->task.t_end) && (status = enter_interval(run)) != DONE)
        return status;
    if (s->t >= R(run->task.t_end))
        return DONE;
    do {
        status = accepted_step(run, &t_new, &h);
        if (status != DONE)
            return behind_jump(run, status);
        sound = run->e->account->soundness;
        status = kind->finish(run, h, t_new);
        if (status != DONE)
            return status;
        if (!all_finite(run->f_new, run->dim))
            return NOT_FINITE;
        if (rewritten(run, h))
            status = AGAIN;
        else if (run->e->sizes.switches) {
            status = end_at_switch(run, &t_new, &h, &crossed);
            sound = run->e->account->soundness;
        }
    } while (status == AGAIN);
    if (status == DONE)
        status = h == 0 ? switch_over(run, crossed) : behind_jump(run, DONE);
    if (status != DONE || h == 0)
        return status == DONE ? MORE : status;
    locate_events(run, t_new, h, &prepared);
    real until = s->ended_by >= 0 ? run->events[s->events - 1].t : t_new;
    status = record_samples(run, t_new, until, h, sound, &prepared);
    if (status == DONE && s->ended_by >= 0)
        status = stop_at_event(run, &t_new, h);
    if (status != DONE)
        return status;
    watch_rank(run, t_new, sound);
    memcpy(run->y_old, run->y, bytes);
    s->t_old = s->t, s->sound = sound;
    memcpy(run->y, run->y_new, bytes);
    follow_windings(run, t_new);
    copy(run->f_new, run->dim, run->f);
    if (kind->accept != NULL)
        kind->accept(run);
    if (!run->scheme.adaptive && !is_counted(run))
        s->t_left = (h + s->t_left) - (t_new - s->t);
    s->t = t_new;
    s->steps++;
    if (run->e->sizes.switches && s->ended_by < 0) {
        status = crossed < 0 ? watch_switches(run) : switch_over(run, crossed);
        if (status != DONE)
            return status;
    }
    rewrite_back(run);
    status = monitor(run);
    if (status == MORE && s->ended_by < 0)
        status = choose_method(run);
    return status == MORE && s->ended_by >= 0 ? ENDED : status;
}

/* The largest number of events of a step. */
static long most_events(const struct run *run) {
    return (has_polynomials(run) ? MOST_COEFFICIENTS : STEP_PROBES) * run->e->sizes.events;
}

int run_advance(struct run *run, long most) {
    int status = MORE;
    for (long k = 0; k < most && status == MORE; k++) {
        if (run->state->passages > MOST_PASSAGES - STEP_PROBES - 1
            || (run->e->sizes.events && run->state->events > run->task.found - most_events(run)))
            break;
        status = one_step(run);
    }
    return status;
}
