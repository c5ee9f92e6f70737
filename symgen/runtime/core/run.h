/* One run: the step loop around any method.
 *
 * The loop takes a step by the method, judges its error, brings it back onto the constraints, watches their
 * rank, locates events, records samples and follows the drift. All that changes in a run lies in one block of
 * memory without pointers, `memory`, with `struct state` at its start: its bytes, and those of the equations'
 * memory, are a checkpoint, and a run that goes on from them is the same to the bit.
 *
 * A new kind of method is one C file that defines a `struct kind`, and a line in kinds.c.
 */
#ifndef SYMGEN_RUN_H
#define SYMGEN_RUN_H

#include "equations.h"

enum stabilisation { PROJECTION, BAUMGARTE, RAW };

/* Looks at the pivots, and at the events, in each step. */
enum { LOOKS = 4, MOST_PASSAGES = 64 };

/* What a run is asked to do. */
struct task {
    double t0, t_end;
    double rtol, atol;   /* both zero: fixed steps */
    double step;         /* the fixed step, or the first one tried; 0: found by itself */
    double max_drift;    /* a constraint error [m] beyond this ends the run; infinite: none does */
    long stabilisation;  /* enum stabilisation */
    long samples;        /* times at which the state is recorded */
    long places_only;    /* velocities of samples are not asked for: they may stay as they are interpolated */
    long found;          /* events remembered until they are taken away; at least LOOKS of each kind */
};

struct run;

/* A kind of method. It owns run->own, `reals` of them: all that its steps carry from one to the next.
 * `counts` and `numbers` of the method (see struct scheme) mean what the kind's file says they do. */
struct kind {
    const char *name;
    /* Whether its steps keep positions and velocities on the constraints: then the loop does not project. */
    int keeps_constraints;
    size_t (*reals)(const struct equations *e, const long *counts);
    /* Point run->f and run->f_new, dim each, at dy/dt at y and at y_new, and whatever it keeps for itself. */
    void (*bind)(struct run *run);
    /* Get ready at run->y, projected already: leave dy/dt in f. DONE, or what went wrong. */
    int (*begin)(struct run *run);
    /* Write y_new, the state at t_new = t + h; when adaptive leave the error over the tolerance in state->norm
     * (1: just met). DONE; AGAIN with state->shrink; or what ends the run. Must not change y or f. A method that
     * needs y_new on the constraints to judge its error calls `settle` itself, and hands on what that answers. */
    int (*step)(struct run *run, real t, real h, real t_new);
    /* y_new is accepted, and projected: leave dy/dt there in f_new. Returns a status. */
    int (*finish)(struct run *run, real h, real t_new);
    /* Once in a step, before interpolate is called between y and y_new: make what that needs. */
    void (*prepare)(struct run *run, real h);
    /* Write the state at t + theta h, 0 <= theta <= 1, as good as the method has it; not projected. */
    void (*interpolate)(struct run *run, real h, real theta, real *y);
    /* y_new has become y: carry over what the next step needs, such as f = f_new. */
    void (*accept)(struct run *run);
};

/* A method: its kind with coefficients. */
struct scheme {
    const struct kind *kind;
    long adaptive;
    long error_order;    /* the step goes with norm^(-1 / (error_order + 1)) */
    const long *counts;
    const real *numbers;
};

/* All that changes in a run, and no pointer; plain types only. */
struct state {
    /* progress */
    real t, h;
    long steps, rejected;
    long recorded, moved;           /* samples, and those moved in time from a loss of rank */
    long passages, events;          /* remembered now */
    long events_before;             /* events remembered before the step in hand */
    long ended_by;                  /* the terminal event that ended the run, -1: none */
    /* of the step in hand */
    real norm, shrink;
    long settled;                   /* y_new is on the constraints already */
    real correction;                /* what bringing it there changed, over the tolerance as norm is */
    real t_left;                    /* what rounding left of the time of fixed steps, which else would add up */
    /* rank */
    real t_old, t_look, t_before;
    double sound, at_look, at_before;
    /* drift: largest constraint errors and energy error, ranges of the energies */
    real position_drift, velocity_drift, energy_drift, energy_start;
    real kinetic_min, kinetic_max, potential_min, potential_max;
    long worst;                     /* the constraint that strayed most */
    /* stiffness seen: steps that were near the edge of stability in a row, and whether it was called stiff */
    long stiff_row, easy_row, stiff;
    real t_stiff;
    /* the first event that had no finite value, -1: none, and when */
    long blind;
    real t_blind;
};

/* Where the constraints came nearest to losing rank. */
struct passage {
    double t, soundness;
    long weakest;
};

/* An event: its number and time; its state is in run->event_states. */
struct event {
    real t;
    long index, rising;
};

struct run {
    struct equations *e;
    struct scheme scheme;
    struct task task;
    long dim;
    size_t bytes;
    /* arrays in memory, behind the state */
    struct state *state;
    struct passage *passages;
    struct event *events;
    real *event_states;          /* a row of dim for each */
    real *y, *y_new;
    real *stage, *error;         /* scratch of dim each, for methods and loop */
    real *y_old, *f_old;         /* the step before, for the rank */
    real *gaps;                  /* values of the events at y, at looks in between, and at y_new: a row each */
    real *times, *samples;       /* task.samples + 1 times, the last infinite, and rows of dim */
    real *own;                   /* the method's */
    signed char *directions;     /* of events: 1 rising, -1 falling, 0 both */
    char *terminal;
    /* set by the kind's bind */
    real *f, *f_new;
};

/* Bytes of memory for a run, without the struct itself. */
size_t run_bytes(const struct equations *e, const struct scheme *scheme, const struct task *task);

/* Fill in `run` over memory of that size, aligned for every type; nothing in the memory is changed. */
void run_bind(struct run *run, struct equations *e, const struct scheme *scheme, const struct task *task,
              void *memory);

/* Set the state of a bound run to its start; y, times, directions and terminal are set by the caller. */
void run_reset(struct run *run);

/* Project and record the start, find the first step; return MORE or what went wrong. */
int run_begin(struct run *run);

/* Take at most so many steps; return MORE, DONE, ENDED or what went wrong. Comes back early with MORE when
 * remembered events or passages must be taken away (set their counts to zero) before it can go on. */
int run_advance(struct run *run, long most);

/* -- for methods ------------------------------------------------------------------------------------------- */

/* Bring y_new onto the constraints, unless the method or the user sees to that. */
int settle(struct run *run, real t_new);

/* Root mean square of `error` over the tolerance at y and y_new. */
real error_norm(const struct run *run, const real *error);

/* Whether errors across the constraints are so much magnified that states are projected before they are looked at:
 * stages and estimates too, where they vanish again when the end of the step is. */
static inline int is_magnified(const struct run *run) {
    return run->state->sound < NEAR && run->task.stabilisation == PROJECTION;
}

int all_finite(const real *v, long count);

/* The largest magnitude, 0 of none. */
real largest_of(const real *v, long count);

/* -- parts of the loop, a file each ------------------------------------------------------------------------ */

/* Constraints nearer to a loss of rank than this passed one. */
#define PASSAGE 1e-6

void watch_rank(struct run *run, real t_new, double sound);
int record_samples(struct run *run, real t_new, real until, real h, double sound, int *prepared);
void begin_events(struct run *run);
void locate_events(struct run *run, real t_new, real h, int *prepared);

/* The kind of that name, NULL when there is none. */
const struct kind *find_kind(const char *name);

#endif
