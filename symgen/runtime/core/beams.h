/* The equations of the elastic motion at any time, M S'' + C S' + K S = Q.
 *
 * Superelements have constant matrices in the axes of their links; what changes is how the links move. End
 * displacements are resolved on fixed axes, with both derivatives of that rotation. Constraints that are left
 * are met by a basis R(t) of the motions they allow, with R' and R''.
 */
#ifndef SYMGEN_BEAMS_H
#define SYMGEN_BEAMS_H

#include "bands.h"
#include "linear.h"
#include "rigid_motion.h"

/* Where everything goes: unknowns, superelements and constraints; slots are places in `rows` and `columns`, and
 * -1 is nowhere. Owned by the caller. */
struct beam_counts {
    ptrdiff_t unknowns, constraints, pieces;
    ptrdiff_t most_joints;       /* of a superelement */
    ptrdiff_t coordinates;       /* unknowns of joints */
    ptrdiff_t masses, dampings, stiffnesses; /* slots of the blocks of joints */
    ptrdiff_t shaft, shaft_slot; /* unknown and slot of an elastic crank's turn, -1: none */
    ptrdiff_t damped, apart;     /* modes with damping of their own; whether they are kept apart from the matrices */
    ptrdiff_t damped_at;         /* where their forces begin in `constants`:
                                  * of each mode over the unknowns of all superelements, then over `coordinates` */
    ptrdiff_t entries, band;     /* of the matrices of all unknowns; the band is that of the first `inner` */
    ptrdiff_t inner;             /* unknowns before those of joints; with constraints these come last */
    ptrdiff_t constant_count;
};

struct beam_layout {
    struct beam_counts counts;
    const ptrdiff_t *sizes;        /* of each superelement */
    const ptrdiff_t *constants_at; /* where its matrices begin in `constants` */
    const ptrdiff_t *link_of;
    const ptrdiff_t *joints;       /* so many pairs a superelement: its own numbers of u, w there, -1 without a joint */
    const ptrdiff_t *places, *places_at, *slots, *slots_at;
    const ptrdiff_t *joint_places; /* of the unknowns of joints */
    const ptrdiff_t *joint_at;     /* of each of BLOCKS, where the kernel `joints` writes it */
    const ptrdiff_t *mass_slots, *damping_slots, *stiffness_slots;
    const ptrdiff_t *loads_at;     /* forces of link k: from loads_at[k] to loads_at[k + 1] */
    const ptrdiff_t *rows, *columns;
    long thesis;                   /* take rotations of ends and the basis as constant in time */
};

/* Which terms are assembled: all; those of the structure at rest in its pose, without loads of motion; or stiffness,
 * axial forces and loads of the rigid motion, without the inertia and damping of the elastic motion. */
enum { IN_MOTION, AT_REST, QUASI_STATIC };

struct beams {
    struct equations base; /* first: a run casts to it */
    struct rigid_motion *motion;
    struct beam_layout layout;
    int analysis;
    /* Of `whole` unknowns `free` are independent: `inner` ones, which no constraint has, and `border` of joints. */
    ptrdiff_t whole, free, inner, border;
    ptrdiff_t modes; /* whose damping is a product f (f^T S' + g^T S), apart from the matrices */
    /* the matrices of the independent unknowns: entries, their places, values; the first `banded_entries` are those
     * between inner unknowns, then come (i, r) and (r, i) with i an inner unknown and r one of joints, then (r, r) */
    ptrdiff_t entries, banded_entries;
    const ptrdiff_t *rows, *columns;
    real *mass, *damping, *stiffness, *load;
    real *full_mass, *full_damping, *full_stiffness, *full_load;
    real *constants, *local;
    real *full_forces, *forces; /* of each such mode f and g, of all and of the independent unknowns */
    /* of the unknowns of joints: constraints J, J', J'' (rows of whole - inner), the basis R, R', R'' (border columns),
     * and the numbers of those that depend on the others */
    real *bound, *pivoted, *basis, *product;
    ptrdiff_t *dependent, *independent, *swaps;
    struct bordered system; /* the factorised mass matrix */
    real *solution, *state;
    ptrdiff_t *own_rows, *own_columns;
};

/* Set the numbers of unknowns and entries, on which the memory of steps depends. */
void beams_count(struct beams *b, const struct beam_layout *layout);

/* Bytes of memory, without the struct itself. */
size_t beams_bytes(const struct beam_layout *layout);

/* Fill in over zeroed memory of that size; the constants are set by the caller in b->constants. */
void beams_bind(struct beams *b, struct rigid_motion *motion, const struct beam_layout *layout, void *memory);

/* Assemble mass, damping, stiffness and load of the independent unknowns at a time.
 * With `choose` the dependent unknowns are selected at this time, else those of the time before are kept. */
int beams_assemble(struct beams *b, real t, int choose);

/* Write stiffness times the shape s of all unknowns, less the load, at the time assembled last: of superelement k over its
 * own unknowns in its link's axes; of all unknowns, superelement by superelement.
 * That loses no digits of bending to the entries of stretching, which cancel in the assembled stiffness. */
void beams_holding(const struct beams *b, ptrdiff_t k, const real *s, real *f);
void beams_unbalanced(const struct beams *b, const real *s, real *out);

/* Compute R, R' and R'' of S = R p from the assembled constraints, and write the equations of p. */
int beams_reduce(struct beams *b, int choose);

/* Choose the unknowns that depend on the others by complete pivoting of the constraints' rows. */
int beams_choose(struct beams *b);

/* The number among all unknowns of independent unknown i. */
static inline ptrdiff_t independent_unknown(const struct beams *b, ptrdiff_t i) {
    return i < b->inner ? i : b->inner + b->independent[i - b->inner];
}

/* Subtract the forces of those modes for states in rows of `columns`; rhs has a column of `lead` reals each. */
void subtract_forces_of_modes(const struct beams *b, long columns, const real *p, const real *v, ptrdiff_t lead, real *rhs);

/* Factorise the mass matrix; false when it has no inverse. */
int beams_factor_mass(struct beams *b);

/* Write S, S' or S'' (`derivative` 0, 1, 2) of all unknowns from p, p', p'', `columns` of each. */
void beams_expand(const struct beams *b, int derivative, const real *p, const real *v, const real *a, long columns,
                  real *out);

/* Elastic links as a run steps them, see struct behaviour. */
extern const struct behaviour beam_behaviour;

#endif
