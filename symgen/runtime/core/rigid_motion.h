/* The rigid reference motion of elastic links at any time: a driven linkage on its assembly branch, or a motion that
   was integrated before. */
#ifndef SYMGEN_RIGID_MOTION_H
#define SYMGEN_RIGID_MOTION_H

#include "elastic_columns.h"
#include "equations.h"

/* Kernels of the motion and of the joints; absent kernels are NULL. */
struct motion_kernels {
    kernel links, joints, shaft, loads;
    kernel setup, joints_setup; /* quantities that depend on parameters alone: for all kernels but `joints`, and for
                                   `joints` */
};

/* Sizes of the results of these kernels. */
struct motion_sizes {
    long links, joints, shaft, loads, setup, joints_setup;
};

/* A motion that was integrated: rows of q, q' and q'' at equal spacing from t = 0. Its linkage lacks one constraint
   of the kernels, number `absent`, whose multiplier is zero. */
struct motion_path {
    const real *rows; /* owned by the caller */
    const real *references; /* of angles in loads, at each row */
    long count, absent;
    real spacing;
};

struct rigid_motion {
    struct equations *e;
    /* present state: what the binding reads is at the same places in every core */
    real *t;       /* time [s], in memory */
    real *y, *motion, *joined, *shaft, *loads;
    long *solved;  /* whether accelerations are those of the state */
    real *began, *before, *still, *out;
    void *branch; /* memory of return_to_branch, if the motion is driven */
    int driven;
    real *p, *joints_p; /* parameters of the kernels of the motion and of the joints */
    struct motion_path path; /* no rows: the drives determine the motion */
    struct motion_kernels kernels;
    struct motion_sizes sizes;
    real stride;   /* longest time over which a state is a good prediction of the next [s] */
    real began_at;
};

/* Bytes of memory, without the struct itself. */
size_t motion_bytes(const struct equations *e, const struct motion_sizes *sizes);

/* Set up over zeroed memory of that size, with the parameters of the equations. */
void motion_bind(struct rigid_motion *m, struct equations *e, const struct motion_kernels *kernels, const struct motion_sizes *sizes,
                 double stride, void *memory);

/* Set a time and the state (q, u, ...) there. */
void motion_start(struct rigid_motion *m, real t, const real *y);

/* Take the motion from a path. */
void motion_follow(struct rigid_motion *m, const void *rows, const void *references, long count, double spacing,
                   long absent);

/* Move to a time and evaluate all kernels there; DONE or the status of the failure. */
int motion_at(struct rigid_motion *m, real t);

/* Evaluate the kernels in the pose of a time, at rest and without loads. */
int motion_at_rest(struct rigid_motion *m, real t);

#endif
