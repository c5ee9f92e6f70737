/* The kernels of a model behind function pointers: accelerations, rank of the constraints, projections.
 *
 * y = (q, u[, work]): coordinates, their rates, and the work of loads without potential if it is integrated.
 * Nothing here allocates: the caller owns the memory, so that its bytes are the whole state (checkpoints).
 */
#ifndef SYMGEN_EQUATIONS_H
#define SYMGEN_EQUATIONS_H

#include <stddef.h>

#include "wide.h"

/* Status of steps, projections and factorisations. */
enum status {
    DONE,
    MORE,
    NOT_FINITE,
    STEP_TOO_SMALL,
    SINGULAR,
    PROJECTION_FAILED,
    CONTRADICTED,
    DRIFTED,    /* the error of a constraint exceeds the limit of the run */
    ENDED,      /* a terminal event ended the run */
    UNSOLVED,   /* the implicit equations of a fixed step were not solved */
    AGAIN,      /* adaptive methods only: the step failed, try state->shrink times its length */
    SLIDING     /* the motion stays at a switching point: neither branch of a load leaves it, or a drive jumps there */
};

/* Kernels of a model; absent kernels are NULL. `accelerations` and `energy` are needed.
 * New kernels are appended: their order is that of KERNELS in the binding. */
struct kernels {
    kernel accelerations;        /* out = (q'', lambda); leaves its factorisation in work, as `factor` does */
    kernel factor;               /* factorisation of [M J^T; J 0] into work */
    kernel solve;                /* solves with that factorisation in place: out is the right-hand side and becomes
                                    the solution */
    kernel constraints;          /* out = (Phi, scales): Phi_i / scale_i is in metres */
    kernel velocity_constraints; /* out = dPhi/dt */
    kernel energy;               /* out = (kinetic, potential, power of loads without potential) */
    kernel residual;             /* out = residual of (q'', lambda), which are in work */
    kernel events;               /* out = g, a value for each event, switching point and angle in loads */
    kernel tangent;              /* slopes of the residual by (q, u), with (q'', lambda) in work, for implicit methods */
    kernel setup;                /* quantities that depend on parameters alone, stored behind them in p; for all
                                    kernels but tangent */
    kernel series;               /* power series in time, for `taylor`: factors are in work, coefficients in out */
    kernel tangent_setup;        /* the same for tangent, which has its own derived quantities */
};

/* Sizes and limits of a model. */
struct sizes {
    long n, m;             /* coordinates, constraints */
    long couples;          /* further unknowns, which `accelerations` writes behind the multipliers */
    long extra;            /* 1 if the work of loads without potential is integrated */
    long parameters;
    long derived, tangent_derived; /* reals that `setup` and `tangent_setup` write */
    long work;             /* reals of work memory that the largest kernel needs */
    long first_pivot;      /* where `factor` leaves the pivots in its work: pairs (pivot, sum of own-signed terms) */
    long redundant;        /* constraints that follow from the others everywhere: the number of pivots that must
                              vanish */
    long events;           /* values that `events` writes for events */
    long switches;         /* values for switching points, whose branches are the last parameters */
    long tables;           /* of these the last are knots of tables, whose branches are pieces: 2 i + 1 from knot i on */
    long windings;         /* values for angles in loads, whose references are the parameters before these; or choices
                              */
    long turns;            /* continuous angles of links: `events` writes them last, then their rates; or the usual
                              coordinates, if there are choices */
    long choices;          /* choices of coordinates, parameters in the place of references: see `rewrite` below */
    long series_rows;      /* numbers of a row of coefficients of `series`; 0 without this kernel */
    long series_watched;   /* of these, the last are coefficients of the values of `events` without the rates of turns; 0
                              if they have none */
    long tangent;          /* values that `tangent` writes */
    const long *tangent_places; /* row, column and place in `out` of each value, column by column */
    double rank_tolerance; /* rank is lost where a multiplier's pivot keeps at most this part of its own-signed terms */
    double slack;          /* largest contradiction [m] between a redundant constraint and the others */
    double stabilisation;  /* rate [1/s] of Baumgarte's terms in `derivative`; 0 for none */
};

/* Number of the parameter that holds the first reference of angles in loads. */
static inline long first_reference(const struct sizes *sizes) {
    return sizes->parameters - sizes->switches - sizes->windings;
}

/* Number of parameters that a run sets, the last ones: references of angles in loads, then branches of switching
   points. */
static inline long held_parameters(const struct sizes *sizes) {
    return sizes->windings + sizes->switches;
}

/* Results of the last evaluation, and counters: numbers of the same type in every core. */
struct account {
    double soundness;                  /* least part of a multiplier's pivot after cancellation; infinite without
                                          constraints */
    double missed;                     /* error of redundant constraints at the last position_error [m] */
    long weakest;                      /* the unknown of that pivot, -1 for none */
    long lost;                         /* vanished pivots of redundant constraints */
    long worst;                        /* the constraint of largest error at the last position_error, -1: none */
    long evaluations, factorisations;
};

/* A coordinate has no mass if its pivot keeps at most this part of its own-signed terms. Regular pivots may cancel
   too: a rod 1e12 times heavier than its neighbours leaves 1e-12. */
#define MASSLESS 1e-15
/* Steps of iterative refinement of accelerations. */
#define REFINEMENTS 2
/* Iterations of the projections. With one factor the error falls linearly, by a factor proportional to the step's
   error. Iterations that do not halve the error end, so this number reaches rounding from any error. */
#define PROJECTIONS 80
/* Errors over the size of the unknowns that are rounding if they no longer fall to half. */
#define ROUND_OFF (R(1e4) * REAL_EPSILON)
/* Most projections of rates. */
#define RATE_PROJECTIONS 3
/* Largest constraint rate after a projection, over the tolerance. */
#define RATES_LEFT 1e-3

/* Below this part of a pivot, near a loss of rank, errors transverse to the constraints are magnified too much. */
#define NEAR 1e-2

struct equations;

/* Operations that a run needs of equations. Models of rods use `kernel_behaviour`; loops and elastic linkages (double
 * only) define their own, with `owner`. */
struct behaviour {
    /* Leave accelerations and multipliers in e->out. */
    void (*accelerate)(struct equations *e, real t, const real *y);
    /* Write dy/dt. */
    void (*derivative)(struct equations *e, real t, const real *y, real *dy);
    real (*position_error)(struct equations *e, real t, const real *y);
    real (*velocity_error)(struct equations *e, real t, const real *y);
    int (*factorise)(struct equations *e, real t, const real *y);
    /* The account of the pivots at y, as by `factorise`, but the last factor stays; NULL: it does not. */
    int (*look)(struct equations *e, real t, const real *y);
    /* Project positions and velocities onto the constraints by mass-weighted steps with one factor. */
    int (*project)(struct equations *e, real t, real *y);
    int (*project_places)(struct equations *e, real t, real *y); /* NULL if positions and velocities are projected
                                                                    together */
    /* Project `change`, of q or of u at y, onto the tangent space of the constraints, with the last factor. */
    void (*make_tangent)(struct equations *e, real t, const real *y, real *change);
    /* Leave kinetic and potential energy, and the power of loads without potential, in e->energies. */
    void (*measure_energy)(struct equations *e, real t, const real *y);
    /* Change to alternative coordinates if the usual ones are near a pole at `seen`, rewrite y, and return whether
       they changed; with `back`, return to the usual ones away from poles. Called if sizes.choices is not zero. */
    int (*rewrite)(struct equations *e, const real *seen, real *y, int back);
    /* Write the usual coordinates at a state since the last one that was rewritten. */
    void (*usual)(const struct equations *e, const real *y, real *q);
    /* Convert y to the usual coordinates, which remain in use with `release`. */
    void (*as_usual)(struct equations *e, real *y, int release);
    /* Factorise at y and leave in e->factors what the kernel `series` solves with; NULL if `factorise` does. */
    int (*prepare_series)(struct equations *e, real t, const real *y);
    /* Rounding errors of accelerations near a loss of rank, over epsilon times the magnified part of the motion. */
    double rounding;
};

extern const struct behaviour kernel_behaviour;

struct equations {
    const struct behaviour *of;
    void *owner;
    struct kernels kernels;
    struct sizes sizes;
    long n, m, extra, dim;
    double finest;           /* the absolute tolerance of the run; 0 if the run has none */
    long revision;           /* counts changes of parameters and of the memory: what was computed before is void */
    size_t bytes;            /* of the memory below */
    struct account *account; /* at the start of that memory, which contains no pointers */
    wide *p;                 /* parameters, and behind them the results of `setup` */
    wide *tangent_p;         /* the same for the kernel `tangent` */
    wide *work, *factors;    /* work of `accelerations`, and of `factor` */
    wide *out;               /* (q'', lambda) after accelerate; (Phi, scales) after position_error */
    wide *rates;             /* dPhi/dt after velocity_error */
    wide *rhs;               /* right-hand sides and solutions, n + m */
    wide *energies;          /* kinetic, potential, power of loads without potential */
    wide *before, *zero;     /* n each */
    wide *errors;            /* (Phi, scales) of Baumgarte's terms */
    wide *gaps;              /* values of `events` after look_at_events */
    char *dropped;           /* constraints found dependent by the last factorisation */
};

/* A correction of the positions of y at t by the factor of (t_factor, y_factor), and of velocities over a part of length
   h of a step unless h is zero. */
struct correction {
    struct equations *e;
    wide t_factor;
    const wide *y_factor;
    wide t;
    real h;
    wide *y;
};

/* The functions of equations of a single mechanism; those of lanes are in the file that uses them, see equation_steps.h. */
#if WIDTH == 1

/* Bytes of memory for equations of these sizes, without the struct itself. */
size_t equations_bytes(const struct sizes *sizes);

/* Set up `e` over zeroed memory of that size, aligned for every type. The caller then sets the parameters in e->p and
 * calls set_up. */
void equations_bind(struct equations *e, const struct sizes *sizes, const struct kernels *kernels, void *memory);

/* Compute the quantities that depend on parameters alone. Call it after every change of e->p, before any kernel. */
void set_up(struct equations *e);

/* Call a set-up kernel, if present, on the parameters p. */
void set_up_with(kernel setup, long parameters, real *p);

/* The shortest scale of the constraints at the last projection: a length of a link or 1 m. */
real shortest_scale(const struct equations *e);

/* Leave accelerations and multipliers in e->out, refined where the model has a residual. */
void accelerate(struct equations *e, real t, const real *y);

/* Return the largest error of an independent constraint over its scale [m]; leave (0, -Phi) in e->rhs. */
real position_error(struct equations *e, real t, const real *y);

/* Return the reference length of position errors [m]: the largest of the coordinates and of the constraint scales
   from the last position_error. */
real size_of(const struct equations *e, const real *y);

/* Return the largest constraint rate over its scale [m/s]; leave (0, -dPhi/dt) in e->rhs.
 * The scales come from the preceding call of position_error, in e->out. */
real velocity_error(struct equations *e, real t, const real *y);

/* Factorise [M J^T; J 0] at y into e->factors and watch the pivots: DONE, SINGULAR or NOT_FINITE. */
int factorise(struct equations *e, real t, const real *y);

/* Solve [M J^T; J 0] x = b in place, b of n + m reals, with the last factor. */
void solve_factored(struct equations *e, real t, const real *y, real *b);

/* Project the velocities of y onto the constraints with the last factor; positions are on the constraints. */
int project_velocities(struct equations *e, real t, real *y);

/* A correction of positions: a step of Newton's method, see newton.h. Positions before it are left in e->before. */
struct newton;
real correct_positions(void *of, struct newton *w);

/* references_of_angles: the references of angles in loads, among the parameters. The second function brings them
   within a quarter revolution of the angles at the last evaluation of events, and returns whether any changed. */
real *references_of_angles(const struct equations *e);
int follow_references(struct equations *e);

/* Leave the values of all events in e->gaps. */
void look_at_events(struct equations *e, real t, const real *y);

#endif

/* Ctrl-C in long loops: they ask in every ASKED-th turn, and end early if the answer is not zero; the caller then raises
   the exception. Without a function they do not ask. */
enum { ASKED = 512 };
extern int (*core_interrupted)(void);

static inline int is_interrupted(ptrdiff_t turn) {
    return turn % ASKED == ASKED - 1 && core_interrupted != NULL && core_interrupted();
}

#endif
