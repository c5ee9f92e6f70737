/* The rigid motion that elastic links move about: a driven linkage at any time, followed along its branch. */
#ifndef SYMGEN_RIGID_MOTION_H
#define SYMGEN_RIGID_MOTION_H

#include "equations.h"

/* Numbers that the kernel `links` writes of each link. */
enum { MOTION = 10 };

/* Kernels of the motion and of the joints; those absent are NULL. */
struct motion_kernels {
    kernel links, joints, torque, loads;
    kernel setup, joints_setup; /* what depends on parameters alone: of all but `joints`, and of `joints` */
};

/* What these write. */
enum { OF_LINKS, OF_JOINTS, OF_TORQUE, OF_LOADS, OF_SETUP, OF_JOINTS_SETUP, WRITTEN };

struct rigid_motion {
    struct equations *e;
    struct motion_kernels kernels;
    long sizes[WRITTEN];
    real stride;   /* the longest time over which a state is a good guess of the next [s] */
    real began_at;
    /* where it is */
    real *t;       /* time [s], in memory */
    long *solved;  /* whether accelerations are those of the state */
    real *y, *began, *still;
    real *motion, *joined, *turning, *loads;
    real *p, *joints_p; /* parameters as the kernels of each take them */
};

/* Bytes of memory, without the struct itself. */
size_t motion_bytes(const struct equations *e, const long *sizes);

/* Fill in over zeroed memory of that size, with the parameters that the equations have. */
void motion_bind(struct rigid_motion *m, struct equations *e, const struct motion_kernels *kernels, const long *sizes,
                 double stride, void *memory);

/* Set a time and the state (q, u, ...) there. */
void motion_start(struct rigid_motion *m, real t, const real *y);

/* Move to a time and evaluate all kernels there; DONE or what went wrong. */
int motion_at(struct rigid_motion *m, real t);

/* Evaluate the kernels in the pose of a time as if nothing moved and nothing loaded the linkage. */
int motion_at_rest(struct rigid_motion *m, real t);

#endif
