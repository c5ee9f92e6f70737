/* One run: the step loop around any method.
 *
 * The loop takes a step by the method, tests its error, projects it onto the constraints, watches their rank, locates
 * events, records samples and measures the drift. All variables of a run are in one block of memory without pointers,
 * `memory`, with `struct state` at its start. Its bytes and those of the equations' memory are a checkpoint. A run
 * continued from a checkpoint has the same bits.
 *
 * A new kind of method is one C file that defines a `struct kind`, and a line in kinds.c.
 */
#ifndef SYMGEN_RUN_H
#define SYMGEN_RUN_H

#include "branch.h"
#include "equations.h"

enum stabilisation { PROJECTION, BAUMGARTE, RAW };

/* Evaluations of pivots and events per step. */
enum { STEP_PROBES = 4 };
/* Capacity of the record of passages through losses of rank. */
enum { MOST_PASSAGES = 64 };
/* Evaluations of the distances from switching points per step. */
enum { SWITCH_PROBES = 16 };

/* In place of a direction: the value touches zero. */
enum { TOUCHES = -1 };
/* Properties of an event: it ends the run; its value is an angle, continued over revolutions; its value has no power
   series. */
enum { ENDS_RUN = 1, REVOLVES = 2, PROBED = 4 };
/* The branch that asks a table for its piece, in place of the distance from a knot. */
enum { WHICH_PIECE = 2 };

/* Task of a run. */
struct task {
    double t0, t_end;
    double rtol, atol;   /* both zero: fixed steps */
    double step;         /* the fixed step, or the first adaptive step; 0: estimated */
    double max_drift;    /* largest constraint error [m], beyond which the run ends; infinite: no limit */
    double max_step;     /* the longest step of adaptive methods; 0: no limit */
    long stabilisation;  /* enum stabilisation */
    long samples;        /* number of times at which the state is recorded */
    long places_only;    /* velocities of samples are not requested: they may remain interpolated, without projection
                            */
    long found;          /* capacity of the record of events; at least MOST_COEFFICIENTS of each kind */
    long nodes;          /* number of times at which steps end before the end of the run, see run->nodes */
    long continues;      /* whether the run may go on from its end, see run_extend */
};

/* Least and greatest change of the step. */
#define SHRINK 0.2
#define GROW 10.0
/* Safety factor of a step after one that failed, and of one that grows much; without it a quarter of all steps would be
   rejected. */
#define CAREFUL 0.75

/* Least pivot of the constraints, over the largest so far, below which steps are those of the method near a loss of rank. */
#define NEARBY 3e-2

struct run;

/* Capacity of the coefficients of a polynomial over a step, and with a rate behind them. */
enum { MOST_COEFFICIENTS = 64, COEFFICIENTS_AND_RATE };
/* Capacity of the counts of any method. */
enum { MOST_COUNTS = 16 };
/* Most stages of an explicit method. */
enum { MOST_STAGES = 32 };
/* Capacity of the pointers that a method keeps. */
enum { MOST_ARRAYS = 16 };
/* Most error estimates of an explicit method. */
enum { MOST_ESTIMATES = 2 };

/* A kind of method. It owns run->own, memory of `bytes` bytes: all data that it carries from step to step.
 * The file of the kind defines the meaning of the method's `counts` and `numbers` (see struct scheme). */
struct kind {
    const char *name;
    /* Names of the counts and of the arrays of numbers of its schemes, in the order of `struct scheme`. */
    const char *counts, *arrays;
    /* Whether its steps satisfy the constraints of positions and velocities: then the loop does not project. */
    int keeps_constraints;
    /* For a run that has equations and task, and the counts of the scheme. */
    size_t (*bytes)(const struct run *run, const long *counts);
    /* Return how many numbers of the scheme are read with these MOST_COUNTS counts; -1 if a count is out of range. */
    ptrdiff_t (*numbers)(const long *counts);
    /* Set the pointers of the method, run->f and run->f_new (dy/dt at y and at y_new, dim each) among them. */
    void (*bind)(struct run *run);
    /* Start at run->y, which is projected: write dy/dt to f. DONE, or the status of the failure. */
    int (*begin)(struct run *run);
    /* Write y_new, the state at t_new = t + h. Adaptive methods also write the error over the tolerance to
       state->norm. Return DONE; AGAIN with state->shrink; or the status that ends the run. Must not change y or f. A
       method whose error estimate needs y_new on the constraints calls `project_new_state` itself and returns its
       status. */
    int (*step)(struct run *run, real t, real h, real t_new);
    /* y_new is accepted and projected: write dy/dt there to f_new. Returns a status. */
    int (*finish)(struct run *run, real h, real t_new);
    /* Prepare the data of interpolate, once per step, before its first call between y and y_new; NULL if there are none.
       */
    void (*prepare)(struct run *run, real h);
    /* Write the interpolated state at t + theta h, 0 <= theta <= 1; not projected. */
    void (*interpolate)(struct run *run, real h, real theta, real *y);
    /* y_new has become y, and f_new f: carry over further data of the next step; NULL if there are none. */
    void (*accept)(struct run *run);
    /* Whether the indices in a restored run->own are within their arrays; NULL if there are none. */
    int (*valid)(const struct run *run);
    /* The length of the next step within the tolerance; NULL if the loop finds it by the errors of steps. */
    real (*longest)(const struct run *run);
    /* Write the MOST_COEFFICIENTS at most of value number i of the kernel `events` over a time h from y, by powers of
       the part of this time, and behind them its rate at y_new; return the degree, or -1 if those of an event or of a
       switching point are not within the tolerance. NULL without series; only for models with sizes.series_watched. */
    long (*polynomial)(const struct run *run, long i, real h, real *c);
    /* Write the coordinates of `interpolate` alone, a time h after y; NULL: a cubic is near enough. */
    void (*places)(const struct run *run, real h, real *q);
    /* Parts of a step of length h, STEP_PROBES at most, at whose ends pivots are evaluated; NULL: STEP_PROBES. */
    int (*parts)(const struct run *run, real h);
};


/* A method: its kind with coefficients. */
struct scheme {
    const struct kind *kind;
    long adaptive;
    long error_order;    /* the step is proportional to norm^(-1 / (error_order + 1)) */
    const long *counts;
    const real *numbers;
    const struct scheme *near; /* the method of adaptive steps near a loss of rank; NULL: this one */
};

/* Variables of a run: plain types, no pointers. */
struct state {
    /* progress */
    real t, h;
    long steps, rejected;
    long recorded, moved;           /* samples; samples moved in time away from a loss of rank */
    long passages, events;          /* recorded and not yet taken */
    long events_before;             /* events recorded before the present step */
    long ended_by;                  /* the terminal event that ended the run, -1: none */
    /* the present step */
    real norm, shrink;
    long settled;                   /* y_new is on the constraints already */
    real correction;                /* change by this projection, over the tolerance like norm */
    real t_left;                    /* rounding error of the time of fixed steps, which would add up */
    long node, steps_before;        /* the node that ends the present interval, and steps before its begin */
    /* rank */
    real t_old, t_look, t_before;
    double sound, at_look, at_before;
    double soundest;                /* the largest part of a pivot so far, at ends of steps */
    long near;                      /* whether steps are those of the method near a loss of rank */
    double looks[STEP_PROBES - 1], looked; /* the least pivot at the probes inside the step to t_looked, and the
                                              least of them */
    real t_looked;
    /* drift: largest constraint errors and energy error, ranges of the energies */
    real position_drift, velocity_drift, energy_drift, energy_start;
    real imbalance;                 /* energy error at y; kept where a change of parameters changes the energy */
    real kinetic_min, kinetic_max, potential_min, potential_max;
    long worst;                     /* the constraint of largest error */
    /* stiffness: numbers of consecutive steps near the edge of stability and of others; whether the motion counts as
       stiff */
    long stiff_row, easy_row, stiff;
    real t_stiff;
    /* switching points passed; the point that the motion cannot leave (-1: none); changes of branch without a step */
    long switchings, slid, flips;
    real t_switched;
    /* at t_switched: errors of constraints and of their rates before, and the point at which they jump (-1: none) */
    real unswitched[2];
    long jumped;
    /* the first event without a finite value, -1: none, and its time */
    long blind;
    real t_blind;
};

/* A pose in which the constraints are nearest to a loss of rank. */
struct passage {
    double t, soundness;
    long weakest;
};

/* An event: its number and time; its state is in run->event_states. */
struct event {
    real t;
    long index, rising; /* TOUCHES in place of a direction */
};

struct run {
    struct equations *e;
    const struct scheme *given;
    struct scheme scheme;        /* of the present steps */
    struct task task;
    long dim;
    size_t bytes;
    /* arrays behind the state in `memory` */
    struct state *state;
    struct passage *passages;
    struct event *events;
    real *event_states;          /* a row of dim for each */
    real *y, *y_new;
    real *stage, *error;         /* scratch of dim each, for methods and loop */
    real *y_old;                 /* the step before, for the rank */
    real *gaps;                  /* values of the events at y, at looks in between, and at y_new: one row each */
    real *times, *samples;       /* task.samples + 1 times, the last infinite, and rows of dim */
    real *nodes;                 /* task.nodes + 1 times at which steps end, the last that of the end */
    long *counts;                /* of equal steps from the node before to each; 0, also for nodes too near for a step: the
                                    state is kept up to it, and the method starts anew there; -1: steps of the
                                    method's own choice */
    real *references;            /* references of angles in loads, one row per sample */
    real *wound;                 /* angles in loads at y, scratch */
    real *turned, *turns;        /* continuous angles of links and their rates at y; these angles at samples */
    void *own;                   /* data of the method of the present steps, one of these: */
    void *owns[2];               /* of the given one, and of that near a loss of rank */
    void *branch;                /* memory of return_to_branch, branch_bytes of it */
    size_t branch_bytes;
    real *farthest;              /* largest distance from each switching point so far */
    real *switched;              /* time of the last switch of each, at first that of the start */
    real *switch_gaps;           /* distances from all switching points at the probes of a step: one row each */
    signed char *directions;     /* of events: 1 rising, -1 falling, 0 both */
    char *terminal;              /* of events: ENDS_RUN, REVOLVES, PROBED */
    signed char *sides;          /* signs of events at y, within the tolerance of a touch those before */
    signed char *slopes;         /* of their rates, near zero; 0: that at y */
    char *probed;                /* whether an event is looked for at probes in the present step */
    double least;                /* pivot of the constraints that stages of the present step must have */
    /* set by the kind's bind; the last for its own use */
    real *f, *f_new;
    void *arrays[MOST_ARRAYS];
};

/* Bytes of memory for a run, without the struct itself. */
size_t run_bytes(const struct equations *e, const struct scheme *scheme, const struct task *task);

/* Set up `run` over memory of that size, aligned for every type, without changes of the memory. */
void run_bind(struct run *run, struct equations *e, const struct scheme *scheme, const struct task *task,
              void *memory);

/* Whether the counts and indices in a restored memory, of the run and of its equations, are within their arrays, and
   its time and those of its samples within the task. */
int run_valid(const struct run *run);

/* Set the state of a bound run to its start; y, times, directions and terminal are set by the caller. */
void run_reset(struct run *run);

/* Set the nodes of a reset run, otherwise the end alone: increasing times in doubles from the start to the end, and counts
   of steps. Those to the start are 0. */
void run_set_nodes(struct run *run, const double *nodes, const long *counts);

/* Project and record the start, estimate the first step; return MORE or the status of the failure. */
int run_begin(struct run *run);

/* Move the end of a run that has come to it, without nodes. */
void run_extend(struct run *run, real t_end);

/* Start the method anew at the present state, after a change of parameters in e->p; `moves`: the change may move the
   constraints, onto which the state is projected. Return MORE or the status of the failure. */
int run_restart(struct run *run, int moves);

/* Record the present state in the row behind the samples. */
void run_record(struct run *run);

/* Take at most `most` steps; return MORE, DONE, ENDED or the status of the failure. Returns early with MORE if the
   record of events or passages is full: the caller takes them and sets their counts to zero. */
int run_advance(struct run *run, long most);

/* In a step near a loss of rank: return_to_branch for states of the run. */
int strayed(struct run *run, real t0, const real *y0, real t, real *y);

/* -- for methods ------------------------------------------------------------------------------------------- */

/* Project y_new onto the constraints, unless the method keeps them or the user selects no projection. DONE; AGAIN
   with state->shrink if an adaptive step was too long; or the status that ends the run. */
int project_new_state(struct run *run, real t_new);

/* Root mean square of the error of a step over the tolerance at y and y_new. */
real error_norm(const struct run *run, real h, const real *error);

/* Below this part of a pivot the constraints pass a loss of rank. */
#define PASSAGE 1e-6

/* Number of entries of the state that limit a step: all, away from a loss of rank. Near a loss of rank, the power of
   a drive contains the magnified rounding errors of its multiplier. The work of loads and drives then limits a step
   only if drives prescribe all motion. Closest to the loss of rank that power has no bound, and no step is short
   enough for it. */
long judged_of(const struct run *run);

/* Write the effect of rounding on coordinates, rates and work in a step near a loss of rank, at its end factorised
   last; zero elsewhere. `sound` is the square of a sine. The error of velocities is proportional to its inverse
   square, the error of accelerations and of the power of drives to its inverse cube. Shorter steps do not reduce this
   error: more of them are near the loss of rank. */
void rounding_of(const struct run *run, real h, real *rounding);

/* Whether errors transverse to the constraints are magnified so much that states must be projected before their
   evaluation, also at stages and for estimates. */
static inline int is_magnified(const struct run *run) {
    return run->state->sound < NEAR && run->task.stabilisation == PROJECTION;
}

/* Whether the run has its end there. */
static inline int is_last(const struct run *run, real t_new) {
    return t_new >= R(run->task.t_end) && !run->task.continues;
}

/* Whether steps have polynomials of the values of the kernel `events`. */
static inline int has_polynomials(const struct run *run) {
    return run->scheme.kind->polynomial != NULL && run->e->sizes.series_watched > 0;
}

/* Prepare the interpolation of the present step, unless it is `prepared`. */
static inline void prepare_interpolation(struct run *run, real h, int *prepared) {
    if (!*prepared && run->scheme.kind->prepare != NULL)
        run->scheme.kind->prepare(run, h);
    *prepared = 1;
}

int all_finite(const real *v, long count);

/* The largest magnitude of `count` numbers, 0 for none. */
real largest_of(const real *v, long count);

/* -- parts of the loop, a file each ------------------------------------------------------------------------ */

/* Whether a method looks for stiffness in this step, and whether stability limits it. */
int is_stiffness_due(const struct run *run);
void watch_stiffness(struct run *run, real t_new, int is_limited);
void look_inside(struct run *run, real t_new);
void watch_rank(struct run *run, real t_new, double sound);
int record_samples(struct run *run, real t_new, real until, real h, double sound, int *prepared);
void begin_events(struct run *run);
void locate_events(struct run *run, real t_new, real h, int *prepared);
/* hermite: the cubic through both ends of the step. move_to: the interpolant of the step on the constraints, in
   run->stage, with the values of the events there. narrowed: the instant between a and b at which an event passes
   zero. */
void hermite(struct run *run, real h, real x, real *y);
void move_to(struct run *run, real h, real theta);
real narrowed(struct run *run, real h, long index, real a, real at_a, real b, real at_b);
/* Take one step of this length and project its end: DONE; AGAIN with the next length in state->h; or the status of
   the failure. */
int try_step(struct run *run, real h, real t_new);

/* Whether the step of length h comes near a pole of its coordinates: its start is then converted to alternative
   coordinates, and the step must be repeated. Away from poles, y is converted back to the usual coordinates. */
int rewritten(struct run *run, real h);
void rewrite_back(struct run *run);
/* Convert y to the usual coordinates at the end of a run. */
void release_choices(struct run *run);

/* Choose the branch of every switching point at the start: DONE or SLIDING. Where a run goes on from a state that has not
   moved, SLIDING also where constraints or their rates jump with a branch. */
int choose_branches(struct run *run, int moved);
/* End a step of length h to t_new at its first switching point: DONE with its number in `crossed` (-1: none); AGAIN
   if a step of another length must be tried; or the status of the failure. A length of zero means a switching point
   at the start. */
int end_at_switch(struct run *run, real *t_new, real *h, long *crossed);
/* Switch to the other branch behind a switching point and restart the method: DONE, or the status of the failure. */
int switch_over(struct run *run, long k);
/* Return the status of a step; SLIDING where it begins at a switching point at which constraints or their rates jump. */
int behind_jump(struct run *run, int status);
/* Update the distances from switching points: DONE, or SLIDING if a switching point makes the motion stiff. */
int watch_switches(struct run *run);
/* Release all branches: loads then depend on the state alone. */
void release_switches(struct run *run);

/* Update the references of angles in loads, and the continuous angles of links, for y at the end t of the present step.
   They belong to the next recorded sample. */
void follow_windings(struct run *run, real t);
/* The part of h in which angles in loads stay near their references by their rates at y; and whether they are there at
   y_new. */
real within_revolutions(struct run *run, real h);
int keeps_revolutions(struct run *run, real t_new);
void keep_windings(struct run *run);

/* The kind of that name, NULL if unknown. */
const struct kind *find_kind(const char *name);

#endif
