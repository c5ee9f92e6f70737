/* A closed loop behind function pointers: closure, rates, forces, motion.
 *
 * The screws of the variables that are solved for are one matrix of six rows: positions (Newton), velocities,
 * accelerations and the wrench that closes the loop all use its one factorisation. Angular and linear rows, and
 * angles and displacements, are made alike by a length, so that ranks do not depend on units.
 */
#ifndef SYMGEN_LOOP_H
#define SYMGEN_LOOP_H

#include "balls.h"
#include "equations.h"
#include "qr.h"
#include "run.h"

/* Status of closing and moving a loop, in addition to the core's own. */
enum loop_status { OPEN = 20, INCONSISTENT, POLE, BLIND };

/* Kernels of a loop; those it does not have are NULL. `position` is needed. */
struct loop_kernels {
    kernel inputs;      /* out = (value, rate, acceleration) of every input */
    kernel position;    /* out = closure (3 x 4) less the identity, then the screws of all variables (6 x n) */
    kernel motion;      /* out = screws and the drift of the accelerations, behind them */
    kernel inverse;     /* out = efforts that the motion in work needs, one a variable */
    kernel given;       /* out = efforts that drives, springs and loads give */
    kernel mass_matrix; /* out = inertia (n x n) */
    kernel outputs;
    kernel energy;      /* out = (kinetic, potential, power of loads without potential) */
    kernel setup;       /* what depends on parameters alone, behind them */
    kernel events;      /* out = distance from each switching point of loads */
};

/* Sizes of a loop, and which of its variables are what. */
struct loop_sizes {
    long n;                      /* variables */
    long parameters, work, told; /* reals of parameters, of the largest work, and written by `outputs` */
    long derived;                /* reals that `setup` writes */
    long extra;                  /* 1 when the work of loads without potential is integrated along */
    long solved, inputs, unknown, known; /* how many; `numbers` lists them in this order */
    long balls;                  /* of ball joints whose angles can be written otherwise near their poles */
    long switches;               /* of switching points, whose branches are the last of the parameters */
    long rank;                   /* of the screws of the solved variables, in general */
    double size;                 /* the length that displacements and moments are compared by [m] */
    double tolerance;            /* defect of closure that dependent equations may leave, as of `closure` */
};

/* Results of the last evaluation; plain numbers of the same type in every core. */
struct loop_account {
    double closure;    /* largest defect: of rotations, and of lengths over the size */
    double rates_left; /* part of the required rates that no motion of the solved variables gives */
    double hold;       /* determinant of the drives of unknown effort over the inputs of known effort */
    double stride;     /* time between this state and the one before [s]; 0: there is none before */
    long iterations;
};

struct loop {
    struct equations base; /* first: a run casts to it */
    struct loop_kernels kernels;
    struct loop_sizes sizes;
    struct loop_account *seen;
    const ptrdiff_t *solved, *driven; /* numbers of the variables solved for, and of the inputs */
    const ptrdiff_t *found, *known;   /* places of unknown efforts in `solved`, of known ones in `driven` */
    const unsigned char *is_length;
    long free;
    int follows; /* closing keeps a variable that the pose leaves undetermined as predicted */
    int near;    /* the last accelerations were found in other angles than those in use, near a pole */
    real size;
    double soundest; /* largest part that the least pivot had so far, in a run */
    const struct ball *balls;
    struct qr factor;
    real *scale, *screws, *matrix, *prescribed, *efforts, *loads, *work2;
    real *q, *u, *trial, *step, *mass, *reduced, *basis, *gain, *past, *change;
    real *usual;   /* q in the table's own angles, at the last accepted state */
    real *near_y;  /* a state near a pole, written otherwise for its accelerations */
};

/* Closure to the last digit leaves a pose undetermined by its root where rank is lost: nearer to it than this,
 * a pose has no rates and no forces that mean anything. */
#define SIGHT real_fmax(R(1e-7), real_sqrt(REAL_EPSILON))

/* Bytes of memory for a loop of these sizes, without the struct itself. */
size_t loop_bytes(const struct loop_sizes *sizes);

/* Fill in a loop over zeroed memory of that size. `numbers`, `is_length` (one a variable)
 * and `balls` must outlive it. */
void loop_bind(struct loop *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
               const ptrdiff_t *numbers, const unsigned char *is_length, const struct ball *balls, void *memory);

/* Find value, rate and acceleration of every input, and put the values into q. */
void loop_prescribe(struct loop *l, real t, real *q);

/* Evaluate closure and screws at q and factorise; return the defect, which is not finite where they are not. */
real loop_look(struct loop *l, real t, const real *q);

/* Close the loop at t by Newton's method from q, in place; the factor of the solution is kept. */
int loop_close(struct loop *l, real t, real *q);

/* Bring the loop near to a closure at t, from any q and whatever rank the screws have there; q ends at the least
 * defect that was found, `rank` is that of the screws of the solved variables at q. */
int loop_assemble(struct loop *l, real t, real *q, long *rank);

/* Solve screws x = b for the changes x of the solved variables, in their own units; b is overwritten. */
void loop_solve(struct loop *l, real *b, real *x);

/* Find rates (which = 1) or accelerations (2) of all variables from those of the inputs and a drift, which may be
 * NULL; return the part of the required change that no motion gives. b has six reals of room. */
real loop_changes(struct loop *l, int which, const real *drift, real *b, real *v);

/* Find rates u and accelerations a of all variables, with the factor at q. */
int loop_move(struct loop *l, real t, const real *q, real *u, real *a);

/* Write the wrench (force, moment) of least norm that gives these efforts at the solved variables. */
void loop_hold(struct loop *l, const real *efforts, real *wrench);

/* Find the closing wrench, behind the accelerations in `work`. */
int loop_force(struct loop *l, real t, const real *q, const real *u, real *work);

/* Columns of the diagnosis of a sample. */
enum { CLOSURE, RATES, SOUNDNESS, HOLD, STATUS, DIAGNOSES };

/* Follow the loop, whose other variables are all held or inputs, from a closed state (t, q) through monotone
 * times; q and *t end at the last time reached, as far as it was followed.
 *
 * For every time: in rows of `row` reals of `states` q, rates, accelerations and closing wrench (3 n + 6), in rows of
 * `width` of `out` the output of the kernel `outputs`, and a row of `diagnosis`. `longest` is the longest time step. */
int loop_follow(struct loop *l, real *t, real *q, const real *times, long count, real longest, real *states,
                long row, real *out, long width, double *diagnosis, long *reached);

/* Mark in `found`, one byte for each number of each pose, what the kernel `outputs` writes differently when a wrench
 * that does no work on any screw is added to the closing wrench. All variables must be solved for.
 *
 * A pose has one such wrench for each rank lost. Their effects are linear, so one sum of all, with weights that no
 * effect in use cancels, shows what any of them changes. `least` is the least pivot of independent screws over the
 * first one, `part` the least effect that counts, over that of a unit wrench. */
void loop_undetermined(struct loop *l, const real *times, const real *states, long row, long count, real least,
                       real part, unsigned char *found);

/* After the accelerations of free motion at (t, y): write their change (n rows of ROWS + n) by unit errors of the
 * accelerations of closure, then of the efforts of all variables. */
void loop_answer(struct loop *l, real t, const real *y, real *answer);

/* See struct behaviour. */
int loop_rewrite(struct equations *e, const real *seen, real *y, int back);
void loop_as_usual(const struct equations *e, real *y);

/* Write a state in the table's own angles, of all choices that nearest to `near`. */
void loop_in_table(const struct loop *l, const real *near, real *q, real *u, real *a);

/* Write y near a pole in other angles into l->near_y; whether it is near one, and in the table's angles. */
int loop_turn_near(struct loop *l, const real *y);
/* The way back: accelerations at l->near_y, in place, and the table's own angles in use again. */
void loop_turn_back(struct loop *l, real *a);

/* A loop that moves under forces as a run steps it, see struct behaviour. */
extern const struct behaviour loop_behaviour;

#endif
