#include "core.h"

#include <string.h>

static void watch(int (*interrupted)(void)) {
    core_interrupted = interrupted;
}

static void widen(long count, const double *high, const double *low, void *reals) {
    real *to = reals;
    for (long i = 0; i < count; i++)
        to[i] = low == NULL ? R(high[i]) : R(high[i]) + R(low[i]);
}

static void narrow(long count, const void *reals, double *high, double *low) {
    const real *from = reals;
    for (long i = 0; i < count; i++) {
        high[i] = (double)from[i];
        if (low != NULL)
            low[i] = (double)(from[i] - R(high[i]));
    }
}

static void call_rows(kernel function, long rows, const void *t, const void *y, long y_stride, long n, const void *p,
                      void *work, long work_stride, void *out, long out_stride) {
    const real *row = y;
    for (long i = 0; i < rows && !is_interrupted(i); i++, row += y_stride)
        function((const real *)t + i, row, row + n, p, (real *)work + i * work_stride, (real *)out + i * out_stride);
}

static void set_parameters(struct equations *e, const double *high, const double *low) {
    widen(e->sizes.parameters, high, low, e->p);
    set_up(e);
}

static void solve_rows(struct equations *e, long rows, const void *t, const void *y, long y_stride, void *out,
                       long out_stride) {
    const real *row = y;
    for (long i = 0; i < rows && !is_interrupted(i); i++, row += y_stride) {
        e->of->accelerate(e, ((const real *)t)[i], row);
        memcpy((real *)out + i * out_stride, e->out, (size_t)(e->n + e->m + e->sizes.couples) * sizeof(real));
    }
}

static int check_at(struct equations *e, double t, const void *y) {
    return e->of->factorise(e, R(t), y);
}

static void derivative_at(struct equations *e, double t, const void *y, void *dy) {
    e->of->derivative(e, R(t), y, dy);
}

static void run_start(struct run *run, const double *y0, const double *y0_low, const double *times,
                      const signed char *directions, const char *terminal) {
    size_t events = (size_t)run->e->sizes.events;
    run_reset(run);
    widen(run->dim, y0, y0_low, run->y);
    widen(run->task.samples, times, NULL, run->times);
    run->times[run->task.samples] = REAL_INFINITY;
    if (events) {
        memcpy(run->directions, directions, events);
        memcpy(run->terminal, terminal, events);
    }
}

static void extend(struct run *run, double t_end) {
    run_extend(run, R(t_end));
}

static void run_report(const struct run *run, struct report *report) {
    const struct state *s = run->state;
    *report = (struct report){
        .t = (double)s->t,
        .t_end = run->task.t_end,
        .h = (double)s->h,
        .position_drift = (double)s->position_drift,
        .velocity_drift = (double)s->velocity_drift,
        .energy_drift = (double)s->energy_drift,
        .kinetic_min = (double)s->kinetic_min,
        .kinetic_max = (double)s->kinetic_max,
        .potential_min = (double)s->potential_min,
        .potential_max = (double)s->potential_max,
        .t_stiff = (double)s->t_stiff,
        .steps = s->steps,
        .rejected = s->rejected,
        .recorded = s->recorded,
        .moved = s->moved,
        .passages = s->passages,
        .events = s->events,
        .ended_by = s->ended_by,
        .worst = s->worst,
        .stiff = s->stiff,
        .blind = s->blind,
        .t_blind = (double)s->t_blind,
        .switchings = s->switchings,
        .slid = s->slid,
    };
}

static const void *state_of(const struct run *run) {
    if (run->e->sizes.choices == 0)
        return run->y;
    memcpy(run->stage, run->y, (size_t)run->dim * sizeof(real));
    run->e->of->as_usual(run->e, run->stage, 0);
    return run->stage;
}

static long take_events(struct run *run, struct found_event *events, void *states) {
    long count = run->state->events;
    for (long i = 0; i < count; i++)
        events[i] = (struct found_event){(double)run->events[i].t, run->events[i].index, run->events[i].rising};
    memcpy(states, run->event_states, (size_t)(count * run->dim) * sizeof(real));
    run->state->events = 0;
    return count;
}

static long take_passages(struct run *run, struct passage *passages) {
    long count = run->state->passages;
    memcpy(passages, run->passages, (size_t)count * sizeof *passages);
    run->state->passages = 0;
    return count;
}

const struct core_api symgen_core = {
    .version = CORE_VERSION,
    .real_bytes = sizeof(real),
    .epsilon = (double)REAL_EPSILON,
    .real_name = REAL_NAME,
    .watch = watch,
    .loops = &symgen_loops,
    .elastic = &symgen_elastic,
    .system = &symgen_system,
    .kinematics = &symgen_kinematics,
    .start = &symgen_start,
    .lanes = lanes_of,
    .variations = &symgen_variations,
    .widen = widen,
    .narrow = narrow,
    .call_rows = call_rows,
    .equations_struct = sizeof(struct equations),
    .run_struct = sizeof(struct run),
    .equations_bytes = equations_bytes,
    .equations_bind = equations_bind,
    .set_parameters = set_parameters,
    .solve_rows = solve_rows,
    .check = check_at,
    .derivative = derivative_at,
    .find_kind = find_kind,
    .run_bytes = run_bytes,
    .run_bind = run_bind,
    .run_start = run_start,
    .run_set_nodes = run_set_nodes,
    .run_valid = run_valid,
    .run_begin = run_begin,
    .run_extend = extend,
    .run_restart = run_restart,
    .run_record = run_record,
    .run_advance = run_advance,
    .run_report = run_report,
    .run_state = state_of,
    .take_events = take_events,
    .take_passages = take_passages,
};
