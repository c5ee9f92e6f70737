/* A driven linkage followed in time on one branch: positions, velocities and accelerations. */
#ifndef SYMGEN_KINEMATICS_H
#define SYMGEN_KINEMATICS_H

#include <stddef.h>

#include "equations.h"

/* Kernels of the constraints Phi(q, t) = 0: Phi and the scale of each row; dPhi/dq; dPhi/dt where nothing moves; and the
 * right-hand side of dPhi/dq a = gamma, which takes parameters of its own. */
struct kinematic_kernels {
    kernel constraints, jacobian, drift, gamma;
};

struct kinematic_sizes {
    ptrdiff_t n, m;        /* coordinates, constraints */
    ptrdiff_t work;        /* numbers of work memory of the largest kernel */
    ptrdiff_t out;         /* numbers that the kernels write, at most */
    double length;         /* size of the linkage [m] */
};

struct kinematics {
    struct kinematic_kernels kernels;
    struct kinematic_sizes sizes;
    const real *p, *gamma_p; /* owned by the caller */
    const ptrdiff_t *rows;   /* n independent constraints, owned by the caller */
    /* where it is */
    real t, stride;
    int sign;                /* of the determinant of dPhi/dq; 0 before the first pose */
    real *q, *u, *a, *past;
    real *next, *change, *still, *phi, *weight, *matrix, *solved, *work, *out;
    ptrdiff_t *swaps;
};

size_t kinematics_bytes(const struct kinematic_sizes *sizes);
void kinematics_bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                     const real *p, const real *gamma_p, const ptrdiff_t *rows, void *memory);

/* Follow from the pose q at t through monotone times, one row (q, u, a) for each. Returns how many times were reached:
 * fewer where a step comes near a pose in which dPhi/dq is singular, or where the prediction fails. */
ptrdiff_t kinematics_follow(struct kinematics *k, real t, const real *q, const real *times, ptrdiff_t count, real *rows);

/* Interface of kinematics: see core.h. */
struct kinematics_api {
    size_t kinematics_struct;
    size_t (*bytes)(const struct kinematic_sizes *sizes);
    void (*bind)(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const void *p, const void *gamma_p, const ptrdiff_t *rows, void *memory);
    ptrdiff_t (*follow)(struct kinematics *k, double t, const void *q, const void *times, ptrdiff_t count, void *rows);
};

extern const struct kinematics_api symgen_kinematics;

#endif
