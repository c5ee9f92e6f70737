/* A closed loop behind function pointers: closure, rates, forces, motion.
 *
 * The screws of the solved variables form one matrix of six rows. Positions (Newton), velocities, accelerations and
 * the closing wrench all use its one factorisation. A length scales linear rows and displacements, so that ranks do
 * not depend on units.
 */
#ifndef SYMGEN_LOOP_H
#define SYMGEN_LOOP_H

#include "balls.h"
#include "equations.h"
#include "qr.h"
#include "run.h"

/* Status of closing and moving a loop, in addition to the core's own. */
enum loop_status { OPEN = 20, INCONSISTENT, POLE, RATES_UNDETERMINED };

/* Kernels of a loop; absent kernels are NULL. `position` is needed. */
struct loop_kernels {
    kernel inputs;      /* out = (value, rate, acceleration) of every input */
    kernel position;    /* out = closure transform (3 x 4) less the identity, then the screws of all variables (6 x n);
                           of a free motion, then the meeting frame (3 x 4): closure is in it in `series` */
    kernel motion;      /* out = screws, then the drift of the accelerations */
    kernel inverse;     /* out = efforts required by the motion in work, one per variable; if any is free, then inertia
                           (n x n) */
    kernel given;       /* out = efforts of drives, springs and loads */
    kernel outputs;
    kernel energy;      /* out = (kinetic, potential, power of loads without potential) */
    kernel setup;       /* quantities that depend on parameters alone, stored behind them */
    kernel events;      /* out = distance from each switching point of loads */
    kernel series;      /* power series in time of a free motion, see struct kernels */
};

/* Sizes of a loop and of the groups of its variables. */
struct loop_sizes {
    long n;                      /* variables */
    long parameters, work, out_size; /* reals of parameters, of the largest work, and written by `outputs` */
    long derived;                /* reals that `setup` writes */
    long extra;                  /* 1 if the work of loads without potential is integrated */
    long solved, inputs, unknown, known; /* sizes of the groups of variables, in the order of `numbers` */
    long balls;                  /* ball joints with alternative angles near their poles */
    long switches, tables;       /* switching points, whose branches are the last parameters, see struct sizes */
    long series_rows, series_watched; /* see struct sizes */
    long rank;                   /* generic rank of the screws of the solved variables */
    double size;                 /* the length that scales displacements and moments [m] */
    double tolerance;            /* largest defect of closure in dependent equations, measured as `closure` */
};

/* Results of the last evaluation; plain numbers of the same type in every core. */
struct loop_account {
    double closure;    /* largest defect: of rotations, and of lengths over the size */
    double rates_left; /* part of the required rates that no motion of the solved variables can supply */
    double hold;       /* determinant of the drives of unknown effort over the inputs of known effort */
};

struct loop {
    struct equations base; /* first: a run casts to it */
    struct loop_kernels kernels;
    struct loop_sizes sizes;
    struct loop_account *seen;
    const ptrdiff_t *solved, *driven; /* numbers of the solved variables and of the inputs */
    const ptrdiff_t *found, *known;   /* places of unknown efforts in `solved`, of known ones in `driven` */
    const unsigned char *is_length;
    long free;
    int follows; /* a variable that the pose leaves undetermined keeps its predicted value */
    real size;
    double soundest; /* largest least pivot over the first one so far in a run */
    const struct ball *balls;
    struct qr factor;
    long revision; /* of the equations at the last evaluation, at the pose `at`: 0 if there is none */
    real t, at[MOST];
    wide closure, soundness, hold; /* of the last pose, before they enter the accounts */
    long looks;
    wide *p, *scale, *screws, *matrix, *prescribed, *efforts, *loads, *work;
    wide *q, *u, *trial, *step, *reduced, *basis, *gain, *change;
    wide *now, *past, *next;  /* followed states: variables, rates and accelerations, behind these the closing wrench; now,
                                 at the state before, and after the next step */
    wide stride;              /* time since the state before [s]; 0: there is none */
    wide *columns, *followed; /* the scaled screws of the solved variables, six numbers for each: evaluated last, and
                                 at the last followed state */
    wide side;                /* the sign of the determinant of `followed`, of six screws */
    real *scout;   /* a followed state, kept while steps ahead are tried */
    real *usual;   /* q in the table's own angles, at the last accepted state */
};

/* At a loss of rank, closure to the last digit determines a pose to the square root of that digit only. Below this
   distance from it, rates and forces have no correct digits. */
#define RANK_RADIUS real_fmax(R(1e-7), real_sqrt(REAL_EPSILON))

/* The functions of a single loop; those of lanes are in the file that uses them, see loop_steps.h. */
#if WIDTH == 1

/* Bytes of memory for a loop of these sizes, without the struct itself. */
size_t loop_bytes(const struct loop_sizes *sizes);

/* Set up a loop over zeroed memory of that size. `numbers`, `is_length` (one per variable) and `balls` must outlive
   it. */
void loop_bind(struct loop *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
               const ptrdiff_t *numbers, const unsigned char *is_length, const struct ball *balls, void *memory);

/* Evaluate value, rate and acceleration of every input, and write the values to q. */
void loop_prescribe(struct loop *l, real t, real *q);

/* Evaluate closure and screws at q and factorise; return the defect, which is not finite if closure or screws are
   not. */
real loop_evaluate(struct loop *l, real t, const real *q);

/* Close the loop at t by Newton's method from q, in place; the factor of the solution is kept. */
int loop_close(struct loop *l, real t, real *q);

/* Bring the loop near a closure at t, from any q and for screws of any rank. On return q has the least defect, and
   `rank` is the rank of the screws of the solved variables at q. */
int loop_assemble(struct loop *l, real t, real *q, long *rank);

/* Solve screws x = b of some rank for the changes x of the solved variables, in their own units; b is overwritten. */
void loop_solve(const struct loop *l, long rank, real *b, real *x);

/* Solve for rates (which = 1) or accelerations (2) of all variables from those of the inputs and a drift, which may
   be NULL. Return the part of the required change that no motion can supply. b is scratch of six reals. */
real loop_changes(struct loop *l, int which, const real *drift, real *b, real *v);

/* Solve for rates u and accelerations a of all variables, with the factor at q. */
int loop_move(struct loop *l, real t, const real *q, real *u, real *a);

/* Write the minimum-norm wrench (force, moment) with these efforts at the solved variables. */
void loop_hold(const struct loop *l, const real *efforts, real *wrench);

/* Write the closing wrench behind the accelerations in `work`. */
int loop_force(struct loop *l, real t, const real *q, const real *u, real *work);

/* Columns of the diagnosis of a sample. */
enum { CLOSURE, RATES, SOUNDNESS, HOLD, STATUS, DIAGNOSES };

/* Follow the loop from a closed state (t, q) through monotone times; variables that are not solved for are constant
 * or inputs. On return q and *t are the last state reached.
 *
 * For every time: a row of `states` (`row` reals) with q, rates, accelerations and closing wrench (3 n + 6); a row of
 * `out` (`width` reals) with the output of the kernel `outputs`; and a row of `diagnosis`. `longest` is the longest
 * time step. */
int loop_follow(struct loop *l, real *t, real *q, const real *times, long count, real longest, real *states,
                long row, real *out, long width, double *diagnosis, long *reached);

/* Mark in `found`, one byte for each output of each pose, the outputs that change if a wrench without work on any
 * screw is added to the closing wrench. All variables must be solved for.
 *
 * A pose has one such wrench for each lost rank. Their effects are linear: one weighted sum of all, with weights
 * chosen against cancellation, shows every changed output. `least` is the least pivot of independent screws over the
 * first pivot; `part` is the least effect that counts, over that of a unit wrench. */
void loop_undetermined(struct loop *l, const real *times, const real *states, long row, long count, real least,
                       real part, unsigned char *found);

/* Call after the accelerations of free motion at a state. Write their changes (n rows of ROWS + n) due to unit errors
   in the accelerations of closure, then in the efforts of all variables. */
void loop_answer(struct loop *l, real *answer);

#endif

/* Behaviour in a run of a loop that moves under forces, see struct behaviour. */
extern const struct behaviour loop_behaviour;

#endif
