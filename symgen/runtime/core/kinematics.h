/* A driven linkage followed in time on one branch: positions, velocities and accelerations. */
#ifndef SYMGEN_KINEMATICS_H
#define SYMGEN_KINEMATICS_H

#include <stddef.h>

#include "equations.h"

/* Kernels of the constraints Phi(q, t) = 0: Phi, the scale of each row, dPhi/dt where nothing moves, and the entries of
 * dPhi/dq that do not vanish everywhere; the right-hand side gamma of dPhi/dq a = gamma; and f - M a of the forces f, which
 * takes the accelerations as `work` and parameters of its own (NULL where no forces are asked). */
struct kinematic_kernels {
    kernel closure, gamma, balance;
};

/* dPhi/dq of the independent rows in block triangular form. The unknowns of a group, a driven crank or an Assur group,
 * depend on those of groups before it. Rows and columns are in the order of the groups. Its values are kept as the dense
 * matrix of each group, one after another, and behind them the couplings: entries of rows of a group in columns of groups
 * before it. All arrays are the caller's. */
struct kinematic_groups {
    ptrdiff_t count, squares;          /* groups; values of their matrices */
    ptrdiff_t filled, couplings;       /* entries that do not vanish everywhere, and those outside of groups */
    const ptrdiff_t *starts;           /* of each group among rows and columns, count + 1 */
    const ptrdiff_t *rows;             /* constraint of each row, n */
    const ptrdiff_t *columns;          /* coordinate of each column, n */
    const ptrdiff_t *entries;          /* fours: place of each entry among the values, in `closure`, its constraint and
                                        * coordinate */
    const ptrdiff_t *coupling_starts;  /* of each row among the couplings, n + 1 */
    const ptrdiff_t *coupling_columns; /* of each coupling */
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
    struct kinematic_groups groups;
    const real *p, *balance_p; /* owned by the caller */
    /* where it is */
    real t, stride;
    int sign;                /* of the determinant of dPhi/dq; 0 before the first pose */
    real *q, *u, *a, *past;
    real *next, *change, *still, *phi, *weight, *solved, *work, *closure, *out;
    real *values, *inverse;  /* of dPhi/dq, its groups factorised; 1 / pivots of groups of two */
    ptrdiff_t *swaps;
};

size_t kinematics_bytes(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups);
void kinematics_bind(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                     const struct kinematic_groups *groups, const real *p, const real *balance_p, void *memory);

/* Follow from the pose q at t through monotone times, one row (q, u, a) for each. Returns how many times were reached:
 * fewer where a step comes near a pose in which dPhi/dq is singular, or where the prediction fails. */
ptrdiff_t kinematics_follow(struct kinematics *k, real t, const real *q, const real *times, ptrdiff_t count, real *rows);

/* Leave the multipliers lambda of J^T lambda = f - M a at closed poses, rows (q, u, a), and for each the least pivot over
 * the greatest and the largest error [N] of these equations. Returns how many poses were done: fewer where dPhi/dq is near
 * to singular. */
ptrdiff_t kinematics_multipliers(struct kinematics *k, const real *times, const real *rows, ptrdiff_t count,
                                 real *multipliers, real *quality);

struct kinematic_lanes_api;

/* Interface of kinematics: see core.h. */
struct kinematics_api {
    size_t kinematics_struct;
    size_t (*bytes)(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups);
    void (*bind)(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const struct kinematic_groups *groups, const void *p, const void *balance_p, void *memory);
    ptrdiff_t (*follow)(struct kinematics *k, double t, const void *q, const void *times, ptrdiff_t count, void *rows);
    ptrdiff_t (*multipliers)(struct kinematics *k, const void *times, const void *rows, ptrdiff_t count,
                             void *multipliers, void *quality);
    const struct kinematic_lanes_api *(*lanes)(ptrdiff_t width);
};

extern const struct kinematics_api symgen_kinematics;

#endif
