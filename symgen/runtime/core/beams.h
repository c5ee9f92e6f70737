/* The equations of the elastic motion, M S'' + C S' + K S = Q, at any time.
 *
 * Superelements have constant matrices in the axes of their links; only the weights of these matrices depend on the
 * motion. End displacements are resolved on fixed axes, with both derivatives of that rotation. The remaining
 * constraints are satisfied by a basis R(t) of the motions that they allow, with R' and R''.
 */
#ifndef SYMGEN_BEAMS_H
#define SYMGEN_BEAMS_H

#include "bands.h"
#include "linear.h"
#include "rigid_motion.h"

/* Layout of unknowns, superelements and constraints. Slots are places in `rows` and `columns`; -1 means absent. Owned
   by the caller. */
struct beam_counts {
    ptrdiff_t unknowns, constraints, pieces;
    ptrdiff_t most_joints;       /* of a superelement */
    ptrdiff_t coordinates;       /* unknowns of joints */
    ptrdiff_t masses, dampings, stiffnesses; /* slots of the blocks of joints */
    ptrdiff_t shaft, shaft_slot; /* unknown and slot of an elastic crank's rotation, -1: none */
    ptrdiff_t damped, apart;     /* modes with modal damping; whether it stays outside of the matrices */
    ptrdiff_t damped_at;         /* start of their forces in `constants`: of each mode over the unknowns of all
                                    superelements, then over `coordinates` */
    ptrdiff_t entries, band;     /* of the matrices of all unknowns; bandwidth of the first `inner` */
    ptrdiff_t inner;             /* unknowns of links; with constraints, unknowns of joints follow */
    ptrdiff_t constant_count;
};

struct beam_layout {
    struct beam_counts counts;
    const ptrdiff_t *sizes;        /* of each superelement */
    const ptrdiff_t *constants_at; /* start of the matrices of each superelement in `constants` */
    const ptrdiff_t *link_of;
    const ptrdiff_t *joints;       /* most_joints pairs per superelement: its local numbers of u, w at each joint, -1
                                      without a joint */
    const ptrdiff_t *places, *places_at, *slots, *slots_at;
    const ptrdiff_t *joint_places; /* of the unknowns of joints */
    const ptrdiff_t *joint_at;     /* place of each of BLOCKS in the output of the kernel `joints` */
    const ptrdiff_t *mass_slots, *damping_slots, *stiffness_slots;
    const ptrdiff_t *loads_at;     /* forces of link k: from loads_at[k] to loads_at[k + 1] */
    const ptrdiff_t *rows, *columns;
    long thesis;                   /* constant-transformation form: rotations of ends and the basis are taken as
                                      constant in time */
};

/* Assembled terms. IN_MOTION: all. AT_REST: the structure at rest in its pose, without loads of the motion.
   QUASI_STATIC: stiffness, axial forces and loads of the rigid motion, without inertia and damping of the elastic
   motion. */
enum { IN_MOTION, AT_REST, QUASI_STATIC };

/* Tangents of the equations by parameters, which a batch of states carries in its columns after the first; states
   without load may follow. They are polynomials of the time through points. The caller owns all arrays. */
struct beam_tangents {
    ptrdiff_t parameters, points, entries; /* entries of matrices with tangents */
    const ptrdiff_t *rows, *columns;       /* of these entries, among all unknowns */
    const real *times, *weights;           /* points, and their weights in barycentric interpolation */
    const real *values;   /* of each parameter, a row for each point: dM, dC, dK (entries), dQ, dJ, dJ', dJ'' */
    /* working memory */
    ptrdiff_t known;      /* number of times in `at` */
    real *at, *between;   /* times whose tangents are in `now`; weights of the points for each */
    real *now;            /* of each parameter, a row for each of these times */
    real *first;          /* p, p', p'' of the first column */
    real *state, *opened; /* its S, S', S''; z, z', z'': see beam_tangents.c */
    real *forces, *load, *multipliers, *right;
};

struct beams {
    struct equations base; /* first: a run casts to it */
    struct rigid_motion *motion;
    struct beam_layout layout;
    int analysis;
    /* Of `whole` unknowns, `free` are independent: `inner` unknowns without constraints, and `border` unknowns of
       joints. */
    ptrdiff_t whole, free, inner, border;
    ptrdiff_t modes; /* modes whose damping f (f^T S' + g^T S) stays outside of the matrices */
    /* Matrices of the independent unknowns: entries, their places and values. The first `banded_entries` couple inner
       unknowns i; entries (i, r) and (r, i) with unknowns r of joints follow, then (r, r). */
    ptrdiff_t entries, banded_entries;
    const ptrdiff_t *rows, *columns;
    real *mass, *damping, *stiffness, *load;
    real *full_mass, *full_damping, *full_stiffness, *full_load;
    real *constants, *local;
    real *full_forces, *forces; /* f and g of each of these modes, for all and for the independent unknowns */
    /* for the unknowns of joints: constraints J, J', J'' (rows of whole - inner), the basis R, R', R'' (border
       columns), and the numbers of the dependent unknowns */
    real *bound, *pivoted, *basis, *product;
    ptrdiff_t *dependent, *independent, *swaps;
    struct bordered system; /* the factorised mass matrix */
    ptrdiff_t *own_rows, *own_columns;
    struct beam_tangents *tangents;           /* NULL: none */
    const struct tangents_behaviour *tangent; /* of beam_tangents.c, which exported programs do not have */
};

/* Number of states of equations of `beam_behaviour`. */
static inline long columns_of(const struct equations *e, const struct beams *b) {
    return e->n / (long)b->whole;
}

/* Set the numbers of unknowns and entries, on which the memory of steps depends. */
void beams_count(struct beams *b, const struct beam_layout *layout);

/* Bytes of memory, without the struct itself. */
size_t beams_bytes(const struct beam_layout *layout);

/* Fill in over zeroed memory of that size; the constants are set by the caller in b->constants. */
void beams_bind(struct beams *b, struct rigid_motion *motion, const struct beam_layout *layout, void *memory);

/* Assemble mass, damping, stiffness and load of the independent unknowns at a time.
 * With `choose` the dependent unknowns are selected at this time; otherwise the previous selection remains. */
int beams_assemble(struct beams *b, real t, int choose);

/* Write stiffness times the displacements s, less the load, at the time assembled last. beams_holding: of
   superelement k, over its local unknowns in its link's axes. beams_unbalanced: of all unknowns, summed by
   superelements. Axial entries, which cancel in the assembled stiffness, then take no digits from bending. */
void beams_holding(const struct beams *b, ptrdiff_t k, const real *s, real *f);
void beams_unbalanced(const struct beams *b, const real *s, real *out);

/* Compute R, R' and R'' of S = R p from the assembled constraints, and write the equations of p. */
int beams_reduce(struct beams *b, int choose);

/* Select the dependent unknowns by complete pivoting of the constraints' rows. */
int beams_choose(struct beams *b);

/* The number among all unknowns of independent unknown i. */
static inline ptrdiff_t independent_unknown(const struct beams *b, ptrdiff_t i) {
    return i < b->inner ? i : b->inner + b->independent[i - b->inner];
}

/* Subtract the forces of modal damping outside of the matrices. States are rows of `columns`; rhs has a column of
   `lead` reals for each. */
void subtract_forces_of_modes(const struct beams *b, long columns, const real *p, const real *v, ptrdiff_t lead, real *rhs);

/* Factorise the mass matrix; false when it has no inverse. */
int beams_factor_mass(struct beams *b);

/* States, rates and accelerations p, v, a of independent unknowns are rows of `columns`. */
struct tangents_behaviour {
    /* Prepare tangents at some times, at most MOST_STAGES + 1. */
    void (*prepare)(struct beam_tangents *x, const struct beams *b, ptrdiff_t count, const real *times);
    /* Add the loads of the tangents in the motion of the first column, at the time assembled last. The load of each
       column of states is `lead` numbers after that of the column before, its numbers `stride` apart. */
    void (*load)(const struct beams *b, const real *p, const real *v, const real *a, long columns, real *rhs, ptrdiff_t lead,
                 ptrdiff_t stride);
    /* Add the part of dS, dS' or dS'' that does not depend on dp, of dependent unknowns, to `out`, rows of `columns`. */
    void (*open)(const struct beams *b, int derivative, const real *p, const real *v, const real *a, long columns, real *out);
};

/* Let batches carry tangents, with this working memory; return its bytes, with NULL nothing else. */
size_t beams_carry(struct beams *b, struct beam_tangents *tangents, void *memory);

/* Whether a batch of so many columns has tangents. */
static inline int tangents_in(const struct beams *b, long columns) {
    return b->tangents != NULL && columns > 1;
}

/* R^T times a load of all unknowns. */
void beams_reduce_load(const struct beams *b, const real *load, real *reduced);

/* Write S, S' or S'' (`derivative` 0, 1, 2) of all unknowns from p, p', p'', `columns` of each. */
void beams_expand(const struct beams *b, int derivative, const real *p, const real *v, const real *a, long columns,
                  real *out);

/* Copy the independent unknowns from all, rows of `columns`. */
void beams_take(const struct beams *b, const real *all, long columns, real *free);

/* Behaviour of elastic links in a run, see struct behaviour: of one state, or of a batch of states in rows of `columns`,
   of which the first is loaded. */
extern const struct behaviour beam_behaviour;

#endif
