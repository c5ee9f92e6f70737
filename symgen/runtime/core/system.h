/* A mechanical system of parts: M a + ... + J^T lambda = 0, Phi = 0.
 *
 * A part adds its forces, constraints and slopes to those of the system. Vectors in constraints are unknowns, or
 * prescribed numbers behind these, such as positions of the ground. Nothing here allocates: the caller owns all arrays.
 */
#ifndef SYMGEN_SYSTEM_H
#define SYMGEN_SYSTEM_H

#include <stddef.h>

#include "envelope.h"
#include "equations.h"

/* States at `count` times, a row of each array for each time. Arrays without numbers may be NULL. */
struct states {
    ptrdiff_t count, unknowns, multipliers, known;
    const real *t, *q, *v, *a, *lambda; /* times, unknowns with first and second rates, multipliers */
    const real *z, *z_rates;            /* prescribed numbers and their rates */
};

/* Slopes of a system at the slots of its matrix, `size` numbers each. */
struct slopes {
    ptrdiff_t size;
    real *by_a, *by_v, *by_q, *jacobian;
};

/* The head of every part; absent functions add nothing. */
struct part {
    /* Add forces, errors of constraints and their rates at all states; each may be NULL. */
    void (*evaluate)(const struct part *part, const struct states *s, real *forces, real *errors, real *rates);
    /* Add slopes at the first state. */
    void (*add_slopes)(const struct part *part, const struct states *s, const struct slopes *to);
    /* Power dissipated by damping at a state [W]. */
    real (*dissipation)(const struct part *part, const struct states *s, ptrdiff_t row);
    /* Power of loads without potential, and of inertia and loads at moving ground, at a state [W]. */
    real (*input)(const struct part *part, const struct states *s, ptrdiff_t row);
    /* Slots of the slopes, and of those of constraints below and right of the diagonal; -1 by prescribed numbers. */
    const ptrdiff_t *slots, *below, *right;
};

/* Elements of a link with kernels over their unknowns. */
struct elements {
    struct part part;
    kernel residual, tangent, energies;
    ptrdiff_t count, size, stride; /* elements; unknowns of one; numbers between the properties of two, 0 for equal ones */
    const ptrdiff_t *places;       /* unknowns, `size` for each element */
    const real *properties;
    real *state, *out;             /* 3 size, 3 size^2 */
};

/* The most places, factors or numbers of work of a constraint. */
enum { WIDEST_ROW = 21 };

/* Constraints by a kernel, which writes the error, its rate, and the slopes by the places of the row. */
struct rows {
    struct part part;
    kernel row;
    ptrdiff_t count, size, first;       /* constraints, places of one, number of the first */
    ptrdiff_t factors_of, properties_of, acting_of; /* numbers of each constraint */
    const ptrdiff_t *places;
    const real *factors, *properties, *acting; /* behind the rates; parameters; work of the kernel */
    /* Entries of second slopes by increasing number (constraint, place, place), and their values; without these the
       kernel writes second slopes behind the slopes. */
    ptrdiff_t inner_count;
    const ptrdiff_t *inner;
    const real *curvature;
    real *out; /* 2 + size + size^2 */
};

/* Linear constraints: entries with row, place and factor. */
struct ties {
    struct part part;
    ptrdiff_t count;
    const ptrdiff_t *rows, *places;
    const real *factors;
};

/* Rigid links, particles and loads, over the first n unknowns; their constraints are the first rows. */
struct rigid {
    struct part part;
    kernel joints, rates, constraints, energy; /* `energy`: NULL without loads that have no potential */
    ptrdiff_t n, count;
    /* Offsets in the results of kernels: load, Jacobian with so many columns, power; slopes by a, v, q with so many
       entries. */
    ptrdiff_t load, jacobian, columns, power, at[3], entries[3];
    const ptrdiff_t *of_rows, *in_jacobian; /* numbers of the constraints in the linkage and in the Jacobian */
    const real *p_joints, *p, *sizes;       /* parameters; scales of the constraints */
    real *work, *spare, *out;
};

/* Forces and slopes from functions of the caller; slopes are of the forces on some unknowns by these. */
struct added {
    struct part part;
    void *owner;
    void (*forces)(void *owner, const struct states *s, real *forces);
    void (*slopes)(void *owner, const struct states *s, real *found); /* `entries` by a, v, q each */
    real (*power)(void *owner, ptrdiff_t row);
    ptrdiff_t entries;
    real *found;
};

/* Set the functions of each kind of part. */
void bind_elements(struct elements *part, int damped);
void bind_rows(struct rows *part);
void bind_ties(struct ties *part);
void bind_rigid(struct rigid *part);
void bind_added(struct added *part);

struct system {
    ptrdiff_t unknowns, multipliers, known, count;
    const struct part *const *parts;
    struct envelope envelope;
    const ptrdiff_t *position; /* place of each unknown and multiplier in the matrix */
    struct slopes slopes;
    real *x, *y;               /* right-hand sides and solutions, in the order of the matrix */
};

/* Add forces, errors and rates of all parts; each may be NULL. */
void system_evaluate(const struct system *of, const struct states *s, real *forces, real *errors, real *rates);

/* Set the slopes at the first state. */
void system_refresh(const struct system *of, const struct states *s);

/* Factorise [M + g C + g^2 K, J^T; J, 0] by the slopes, with g = re + im i; M alone without `imaginary`. False without a
   pivot. */
int system_factor(const struct system *of, real re, real im, real *values, real *imaginary);

/* Power of loads and of moving ground less that of damping, at a state [W]. */
real system_power(const struct system *of, const struct states *s, ptrdiff_t row);

/* A system as equations of a run: y = (q, v, work), the work of moving constraints and of loads without potential less
   what damping dissipates. Steps by collocation keep the constraints; their errors, and energies, are those of samples. */
struct system_motion {
    struct system *of;
    const real *scale;      /* sizes of the unknowns */
    const real *a, *lambda; /* second rates and multipliers of the stages with which the first step begins */
    /* Prescribed numbers and their rates in `count` steps from number `first` on: a row in the middle of each step, at
       its stages and at its end. `prescribe` sets those around a step; it is called before others, or before `each`. */
    long first, count, each;
    const real *z, *z_rates;
    void (*prescribe)(void *owner, long step, real t, real h, const real *y);
    void *owner;
    const real *a_of, *lambda_of; /* second rates and multipliers of the stages of the last step, in memory of the run */
};

void bind_motion(struct equations *e, struct system_motion *motion);

/* Interface of systems: see core.h. */
struct system_api {
    void (*bind_elements)(struct elements *part, int damped);
    void (*bind_rows)(struct rows *part);
    void (*bind_ties)(struct ties *part);
    void (*bind_rigid)(struct rigid *part);
    void (*bind_added)(struct added *part);
    void (*evaluate)(const struct system *of, const struct states *s, void *forces, void *errors, void *rates);
    void (*refresh)(const struct system *of, const struct states *s);
    /* Solve in place by M and the constraints at the last slopes: forces and rows of constraints become second rates
       and multipliers. False without a pivot. */
    int (*accelerate)(const struct system *of, void *factors, void *right);
    void (*bind_motion)(struct equations *e, struct system_motion *motion);
};

extern const struct system_api symgen_system;

#endif
