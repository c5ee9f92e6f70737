/* A driven linkage followed in time on one assembly branch: positions, velocities and accelerations. */
#ifndef SYMGEN_KINEMATICS_H
#define SYMGEN_KINEMATICS_H

#include <stddef.h>

#include "equations.h"

/* Kernels of the constraints Phi(q, t) = 0: Phi, the scale of each row, dPhi/dt at rest, and the entries of dPhi/dq
   that do not vanish identically; the right-hand side gamma of dPhi/dq a = gamma; and f - M a for the forces f, with
   the accelerations as `work` and its own parameters (NULL without requested forces). */
struct kinematic_kernels {
    kernel closure, gamma, balance;
};

/* dPhi/dq of the independent rows in block triangular form. A group is a driven crank or an Assur group; its unknowns
   depend on those of earlier groups. Rows and columns are in the order of the groups. Values are stored as the dense
   matrices of the groups, followed by the couplings: entries in rows of a group and columns of earlier groups. The
   caller owns all arrays. */
struct kinematic_groups {
    ptrdiff_t count, squares;          /* groups; values of their matrices */
    ptrdiff_t filled, couplings;       /* entries that do not vanish identically, and those outside of groups */
    const ptrdiff_t *starts;           /* first row and column of each group, and the end: count + 1 */
    const ptrdiff_t *rows;             /* constraint of each row, n */
    const ptrdiff_t *columns;          /* coordinate of each column, n */
    const ptrdiff_t *entries;          /* four numbers per entry: places among the values and in `closure`,
                                          constraint, coordinate */
    const ptrdiff_t *coupling_starts;  /* first coupling of each row, and the end: n + 1 */
    const ptrdiff_t *coupling_columns; /* of each coupling */
};

struct kinematic_sizes {
    ptrdiff_t n, m;        /* coordinates, constraints */
    ptrdiff_t work;        /* numbers of work memory of the largest kernel */
    ptrdiff_t out;         /* largest number of results of a kernel */
    double length;         /* size of the linkage [m] */
};

struct kinematics {
    struct kinematic_kernels kernels;
    struct kinematic_sizes sizes;
    struct kinematic_groups groups;
    const real *p, *balance_p; /* owned by the caller */
    /* present state */
    real t, stride, length;
    real *q, *past, *next;       /* q, u, a: now, a stride before, after the next step */
    real *change, *still, *phi, *scale, *weight, *solved, *work, *closure, *out;
    real *values, *inverse;  /* of dPhi/dq, its groups factorised; 1 / pivots of groups of two */
    real *matrix, *pivots;   /* the groups of dPhi/dq and their pivots, evaluated last */
    real *matrix_before, *pivots_before, *predicted; /* at the present pose; pivots at the predicted pose */
    real *mean;
    ptrdiff_t *swaps, *spare;
};

/* Interface of kinematics: see core.h. */
struct kinematics_api {
    size_t kinematics_struct;
    size_t (*bytes)(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups);
    void (*bind)(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const struct kinematic_groups *groups, const void *p, const void *balance_p, void *memory);
    /* Follow from the pose q at t through monotone times, one row (q, u, a) for each. Return the number of times
       reached: fewer than `count` near a pose with singular dPhi/dq, or if the prediction fails. */
    ptrdiff_t (*follow)(struct kinematics *k, double t, const void *q, const void *times, ptrdiff_t count, void *rows);
    /* Write the multipliers lambda of J^T lambda = f - M a at closed poses, rows (q, u, a), and for each pose the least
       pivot over the greatest and the largest error [N] of these equations. Return the number of poses done: fewer if
       dPhi/dq is nearly singular. */
    ptrdiff_t (*multipliers)(struct kinematics *k, const void *times, const void *rows, ptrdiff_t count,
                             void *multipliers, void *quality);
};

extern const struct kinematics_api symgen_kinematics;

#endif
