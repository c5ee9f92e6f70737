/* One run: the step loop around any method.
 *
 * The loop takes a step by the method, judges its error, brings it back onto the constraints, watches their
 * rank, locates events, records samples and follows the drift. All that changes in a run lies in one block of
 * memory without pointers, `memory`, with `struct state` at its start: its bytes, and those of the equations'
 * memory, are a checkpoint, and a run continued from them is the same to the bit.
 *
 * A new kind of method is one C file that defines a `struct kind`, and a line in kinds.c.
 */
#ifndef SYMGEN_RUN_H
#define SYMGEN_RUN_H

#include "equations.h"

enum stabilisation { PROJECTION, BAUMGARTE, RAW };

/* Looks at the pivots, and at the events, in each step. */
enum { LOOKS = 4, MOST_PASSAGES = 64 };
/* Looks for switching points in each step. */
enum { GLANCES = 16 };

/* Properties of an event: it ends the run; its value is an angle, and continuous over revolutions. */
enum { ENDS_RUN = 1, REVOLVES = 2 };

/* Task of a run. */
struct task {
    double t0, t_end;
    double rtol, atol;   /* both zero: fixed steps */
    double step;         /* the fixed step, or the first one tried; 0: found by itself */
    double max_drift;    /* a constraint error [m] beyond this ends the run; infinite: none does */
    double max_step;     /* the longest step of adaptive methods; 0: any */
    long stabilisation;  /* enum stabilisation */
    long samples;        /* times at which the state is recorded */
    long places_only;    /* velocities of samples are not requested: they may stay as interpolated */
    long found;          /* events remembered until they are taken away; at least LOOKS of each kind */
};

/* Least change of the step. */
#define SHRINK 0.2

struct run;

/* What there is room for: counts of any method; stages and estimates of the error of an explicit one. */
enum { MOST_COUNTS = 16, MOST_STAGES = 32, MOST_ESTIMATES = 2 };

/* A kind of method. It owns run->own, memory of so many bytes: all that its steps carry from one to the next.
 * The file of the kind defines the meaning of the method's `counts` and `numbers` (see struct scheme). */
struct kind {
    const char *name;
    /* Names of the counts and of the arrays of numbers of its schemes, in the order of `struct scheme`. */
    const char *counts, *arrays;
    /* Whether its steps keep positions and velocities on the constraints: then the loop does not project. */
    int keeps_constraints;
    size_t (*bytes)(const struct equations *e, const long *counts);
    /* How many numbers of the scheme are read with these counts, of which MOST_COUNTS are there; -1 where a count is out
     * of range. */
    ptrdiff_t (*numbers)(const long *counts);
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
    /* y_new has become y: carry over the data of the next step, such as f = f_new. */
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
    /* switching points passed, the one that the motion cannot leave (-1: none), and changes of branch without a step */
    long switchings, slid, flips;
    real t_switched;
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
    real *references;            /* of angles in loads at samples: a row each */
    real *turned, *turns;        /* angles of links over revolutions and their rates at y; these angles at samples */
    void *own;                   /* the method's */
    real *farthest;              /* of each switching point, the largest distance seen */
    real *switched;              /* of each, when it switched last; at first the start */
    real *glances;               /* distances from all of them at looks in the step: a row each */
    signed char *directions;     /* of events: 1 rising, -1 falling, 0 both */
    char *terminal;              /* of events: ENDS_RUN, REVOLVES */
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
 * recorded events or passages must be taken away (set their counts to zero) before it can continue. */
int run_advance(struct run *run, long most);

/* -- for methods ------------------------------------------------------------------------------------------- */

/* Bring y_new onto the constraints, unless the method or the user sees to that. DONE; AGAIN with state->shrink where an
 * adaptive step was too long for that; or what ends the run. */
int settle(struct run *run, real t_new);

/* Root mean square of the error of a step over the tolerance at y and y_new. */
real error_norm(const struct run *run, real h, const real *error);

/* Constraints nearer to a loss of rank than this passed one. */
#define PASSAGE 1e-6

/* How many entries of the state limit a step: all away from a loss of rank. Near one, the power of a drive has the
 * rounding errors of its multiplier, magnified; the work of loads and drives limits a step only where drives prescribe
 * all motion, and nothing else would. Next to the loss that power has no bound, and no step is short enough for it. */
long judged_of(const struct run *run);

/* Leave what rounding makes of coordinates, rates and work in a step near a loss of rank, at its end factorised last:
 * the error of velocities goes with the inverse square of the sine whose square `sound` is, that of accelerations and of
 * the power of drives with its cube. Shorter steps come no nearer to the motion than that, since they stay where they are
 * longer. Zero elsewhere. */
void rounding_of(const struct run *run, real h, real *rounding);

/* Whether errors across the constraints are so much magnified that states are projected before they are looked at:
 * stages and estimates too, where they vanish again when the end of the step is. */
static inline int is_magnified(const struct run *run) {
    return run->state->sound < NEAR && run->task.stabilisation == PROJECTION;
}

int all_finite(const real *v, long count);

/* The largest magnitude among numbers, 0 of none. */
real largest_of(const real *v, long count);

/* -- parts of the loop, a file each ------------------------------------------------------------------------ */

void watch_rank(struct run *run, real t_new, double sound);
int record_samples(struct run *run, real t_new, real until, real h, double sound, int *prepared);
void begin_events(struct run *run);
void locate_events(struct run *run, real t_new, real h, int *prepared);
/* The cubic through both ends of the step; the interpolant of the step on the constraints, in run->stage, with the
 * values of the events there; and where a value of it passes zero between a and b. */
void roughly(const struct run *run, real h, real x, real *y);
void move_to(struct run *run, real h, real theta);
real narrowed(struct run *run, real h, long index, real a, real at_a, real b, real at_b);
/* Take one step of this length and settle its end: DONE; AGAIN with the next length in state->h; or what went wrong. */
int try_step(struct run *run, real h, real t_new);

/* Whether other coordinates serve better somewhere along the step of length h: its start is then written in them, and
 * the step is to be taken again. And back in the usual ones, at y, where those serve. */
int rewritten(struct run *run, real h);
void rewrite_back(struct run *run);
/* Write y in the usual coordinates at the end of a run. */
void release_choices(struct run *run);

/* Hold the branch of every switching point at the start: DONE or SLIDING. */
int begin_switches(struct run *run);
/* End a step that was taken to t_new, of length h, at its first switching point: DONE with that in `crossed` (-1: none);
 * AGAIN where a step of another length is to be tried; or what went wrong. A length of zero is a point at the start. */
int end_at_switch(struct run *run, real *t_new, real *h, long *crossed);
/* Hold the other branch behind a switching point and start the method again: DONE, or what went wrong. */
int switch_over(struct run *run, long k);
/* Follow the distances from switching points: DONE, or SLIDING where one makes the motion stiff. */
int watch_switches(struct run *run);
/* Hold no branch any more: loads are then those of the state. */
void release_switches(struct run *run);

/* Move the references of angles in loads, and the angles of links, along with the state; `before` is the time of the
 * state before. Keep them with the sample that is recorded next. */
void follow_windings(struct run *run, real before);
void keep_windings(struct run *run);

/* The kind of that name, NULL when there is none. */
const struct kind *find_kind(const char *name);

#endif
