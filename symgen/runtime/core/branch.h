/* The assembly branch of a linkage whose motion drives prescribe. */
#ifndef SYMGEN_BRANCH_H
#define SYMGEN_BRANCH_H

#include "equations.h"

/* Bytes of the memory that return_to_branch needs; 0 if drives do not prescribe all motion: then it must not be called. */
size_t branch_bytes(const struct equations *e);

/* Return whether the pose q at t, just projected, is on another assembly branch than q0 at t0. It is then replaced by
   that on the branch; velocities are not. Near a loss of rank a projection may end on either branch. */
int return_to_branch(struct equations *e, void *memory, real t0, const real *q0, real t, real *q);

#endif
