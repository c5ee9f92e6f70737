/* The kernels of a model behind function pointers: solved, watched and projected.
 *
 * y = (q, u[, work]): coordinates, their rates, and the work of loads without potential where it is integrated.
 * Nothing here allocates: the caller owns the memory, so that its bytes are the whole state (checkpoints).
 */
#ifndef SYMGEN_EQUATIONS_H
#define SYMGEN_EQUATIONS_H

#include <stddef.h>

#include "real.h"

/* What steps, projections and factorisations answer. */
enum status {
    DONE,
    MORE,
    NOT_FINITE,
    STEP_TOO_SMALL,
    SINGULAR,
    PROJECTION_FAILED,
    CONTRADICTED,
    DRIFTED,    /* a constraint strayed by more than the run allows */
    ENDED,      /* a terminal event ended the run */
    UNSOLVED,   /* the implicit equations of a fixed step were not solved */
    AGAIN,      /* of adaptive methods only: this step cannot be taken, try state->shrink times its length */
    SLIDING     /* a load keeps the motion at its jump: neither of its branches leaves it */
};

/* A generated kernel; its header lists the arguments that it reads. */
typedef void (*kernel)(const real *t, const real *q, const real *u, const real *p, real *work, real *out);

/* Kernels of a model; those it does not have are NULL. `accelerations` and `energy` are needed.
 * New kernels are appended: their order is that of KERNELS in the binding. */
struct kernels {
    kernel accelerations;        /* out = (q'', lambda); leaves its factorisation in work, as `factor` does */
    kernel factor;               /* factorisation of [M J^T; J 0] into work */
    kernel solve;                /* solves with that factorisation in place: out = right-hand side, then solution */
    kernel constraints;          /* out = (Phi, scales): Phi_i / scale_i is in metres */
    kernel velocity_constraints; /* out = dPhi/dt */
    kernel energy;               /* out = (kinetic, potential, power of loads without potential) */
    kernel residual;             /* of (q'', lambda) in work, into out */
    kernel events;               /* out = g, a value for each event, switching point and angle in loads */
    kernel tangent;              /* slopes of the residual by (q, u), with (q'', lambda) in work, for implicit methods */
    kernel setup;                /* what depends on parameters alone: p + parameters = out, for all of them but tangent */
    kernel tangent_setup;        /* the same for tangent, which is of other equations */
};

/* Sizes and limits of a model. */
struct sizes {
    long n, m;             /* coordinates, constraints */
    long extra;            /* 1 when the work of loads without potential is integrated along */
    long parameters;
    long derived, tangent_derived; /* reals that `setup` and `tangent_setup` write */
    long work;             /* reals of work memory that the largest kernel needs */
    long first_pivot;      /* where `factor` leaves the pivots in its work: pairs (pivot, sum of own-signed terms) */
    long redundant;        /* constraints that follow from the others everywhere: so many pivots must be lost */
    long events;           /* values that `events` writes for events */
    long switches;         /* and for switching points, whose branches are the last of the parameters */
    long windings;         /* and for angles in loads, whose references are the parameters before these;
                            * or choices */
    long turns;            /* angles of links whose revolutions runs count: `events` writes them last, then their rates */
    long choices;          /* of coordinates, which parameters in the place of references tell: see `rewrite` below */
    long tangent;          /* values that `tangent` writes */
    const long *tangent_places; /* of each, column by column: its row, its column, and its place in `out` */
    double rank_tolerance; /* rank is lost where a multiplier's pivot keeps at most this part of its own-signed terms */
    double slack;          /* by how much [m] a redundant constraint may contradict the others */
    double stabilisation;  /* rate [1/s] of Baumgarte's terms in `derivative`; 0: none */
};

/* Where the references of angles in loads are among the parameters. */
static inline long first_reference(const struct sizes *sizes) {
    return sizes->parameters - sizes->switches - sizes->windings;
}

/* Number of the last parameters, which a run sets: references of angles in loads, then branches of switching points. */
static inline long held_parameters(const struct sizes *sizes) {
    return sizes->windings + sizes->switches;
}

/* Results of the last evaluation, and counts: plain numbers of the same type in every core. */
struct account {
    double soundness;                  /* least part that a multiplier's pivot keeps; infinite when none is watched */
    double missed;                     /* error of redundant constraints at the last position_error [m] */
    long weakest;                      /* the unknown of that pivot, -1 when there is none */
    long lost;                         /* pivots of redundant constraints lost */
    long worst;                        /* the constraint of largest error at the last position_error, -1: none */
    long evaluations, factorisations;
};

/* A coordinate has no mass if its pivot keeps at most this part of its own-signed terms. Much may cancel
 * before: rods a million million times heavier than their neighbours leave 1e-12. */
#define MASSLESS 1e-15
#define REFINEMENTS 2
/* Iterations of the projections: with the same factor they converge by the step's own error each time. Each halves the
 * error at least, or ends the iterations: enough from any error down to rounding. */
#define PROJECTIONS 80
#define RATE_PROJECTIONS 3

/* Constraints nearer to a loss of rank than this magnify errors across them too much. */
#define NEAR 1e-2

struct equations;

/* Operations that a run needs of equations. Models of rods use `kernel_behaviour`; loops and elastic linkages (double
 * only) define their own, with `owner`. */
struct behaviour {
    void (*accelerate)(struct equations *e, real t, const real *y);
    void (*derivative)(struct equations *e, real t, const real *y, real *dy);
    real (*position_error)(struct equations *e, real t, const real *y);
    real (*velocity_error)(struct equations *e, real t, const real *y);
    int (*factorise)(struct equations *e, real t, const real *y);
    int (*project)(struct equations *e, real t, real *y);
    int (*project_places)(struct equations *e, real t, real *y); /* NULL where places and velocities go together */
    void (*make_tangent)(struct equations *e, real t, const real *y, real *change);
    void (*measure_energy)(struct equations *e, real t, const real *y);
    /* Where other coordinates serve better at `seen`, change to them and rewrite y; return whether that was done. With
     * `back`, where the usual ones serve again. Asked where sizes.choices is not zero. */
    int (*rewrite)(struct equations *e, const real *seen, real *y, int back);
    /* Write y in the usual coordinates; those in use stay. */
    void (*as_usual)(const struct equations *e, real *y);
    /* Rounding errors of accelerations near a loss of rank, over epsilon times the part of the motion that is magnified. */
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
    size_t bytes;            /* of the memory below */
    struct account *account; /* first in that memory; everything behind it holds no pointers either */
    real *p;                 /* parameters, and behind them what `setup` makes of them */
    real *tangent_p;         /* the same as `tangent` takes them */
    real *work, *factors;    /* work of `accelerations`, and of `factor` */
    real *out;               /* (q'', lambda) after accelerate; (Phi, scales) after position_error */
    real *rates;             /* dPhi/dt after velocity_error */
    real *rhs;               /* right-hand sides and solutions, n + m */
    real *energies;          /* kinetic, potential, power of loads without potential */
    real *before, *zero;     /* n each */
    real *errors;            /* (Phi, scales) of Baumgarte's terms */
    real *gaps;              /* values of `events` after look_at_events */
    char *dropped;           /* constraints found dependent by the last factorisation */
};

/* Bytes of memory for equations of these sizes, without the struct itself. */
size_t equations_bytes(const struct sizes *sizes);

/* Fill in `e` over zeroed memory of that size, aligned for every type. The caller then sets the parameters in e->p and
 * calls set_up. */
void equations_bind(struct equations *e, const struct sizes *sizes, const struct kernels *kernels, void *memory);

/* Compute what depends on parameters alone: whenever e->p was set, before anything else. */
void set_up(struct equations *e);

/* Call a set-up kernel, if there is one, on so many parameters. */
void set_up_with(kernel setup, long parameters, real *p);

/* The shortest scale of the constraints, as the last projection found them: a length of a link or 1 m. Infinite for
 * equations other than those of kernels. */
real shortest_scale(const struct equations *e);

/* Leave accelerations and multipliers in e->out, refined where the model has a residual. */
void accelerate(struct equations *e, real t, const real *y);

/* Write dy/dt; with Baumgarte's terms when sizes.stabilisation is above zero. */
void derivative(struct equations *e, real t, const real *y, real *dy);

/* Return the largest error of an independent constraint over its scale [m]; leave (0, -Phi) in e->rhs. */
real position_error(struct equations *e, real t, const real *y);

/* Return the length that position errors are compared with [m]: the largest of the coordinates and of the scales of
 * constraints that the last position_error left. */
real size_of(const struct equations *e, const real *y);

/* Return the largest constraint rate over its scale [m/s]; leave (0, -dPhi/dt) in e->rhs.
 * The scales are those that position_error left in e->out the call before. */
real velocity_error(struct equations *e, real t, const real *y);

/* Factorise [M J^T; J 0] at y into e->factors and watch the pivots: DONE, SINGULAR or NOT_FINITE. */
int factorise(struct equations *e, real t, const real *y);

/* Solve [M J^T; J 0] x = b in place, b of n + m reals, with the last factor. */
void solve_factored(struct equations *e, real t, const real *y, real *b);

/* Bring positions and velocities back onto the constraints, by mass-weighted steps of one factor; the halves
 * do one of the two with the last factor, velocities at positions on the constraints. */
int project(struct equations *e, real t, real *y);
int project_places(struct equations *e, real t, real *y);
int project_positions(struct equations *e, real t, real *y);
int project_velocities(struct equations *e, real t, real *y);

/* Project `change`, of q or of u at y, onto the tangent space of the constraints, with the last factor. */
void make_tangent(struct equations *e, real t, const real *y, real *change);

/* Leave kinetic and potential energy, and the power of loads without potential, in e->energies. */
void measure_energy(struct equations *e, real t, const real *y);

/* The references of angles in loads, among the parameters; bring them within a quarter turn of these angles as the last
 * look at events found them, and return whether any moved. */
real *references_of_angles(const struct equations *e);
int follow_references(struct equations *e);

/* Leave the values of all events in e->gaps. */
void look_at_events(struct equations *e, real t, const real *y);

#endif
