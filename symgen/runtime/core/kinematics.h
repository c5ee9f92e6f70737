/* Driven linkages followed in time on one assembly branch: positions, velocities and accelerations. One linkage, or one
 * with other parameters and starts in each lane of vectors.
 *
 * Kernels of lanes take one vector where those of a single linkage take a number. Every lane has its own time and step
 * and takes the steps of kinematic_steps.h, as a single linkage does, so its bits are the same. A lane ends at a pose
 * near a singular dPhi/dq, or if its prediction fails; the caller computes the rest of its times. */
#ifndef SYMGEN_KINEMATICS_H
#define SYMGEN_KINEMATICS_H

#include <stddef.h>

#include "equations.h"

/* Kernels of the constraints Phi(q, t) = 0: Phi, the scale of each row, dPhi/dt at rest, and the entries of dPhi/dq
   that do not vanish identically; the right-hand side gamma of dPhi/dq a = gamma; quantities that depend on parameters
   alone; and points, required for extremes of forces. Of forces: f - M a, with the accelerations as `work` and
   parameters of their own; the forces of joints, with the multipliers behind the accelerations. Absent kernels are
   NULL. */
struct kinematic_kernels {
    kernel closure, gamma, setup, points;
    kernel balance, joints, setup_forces;
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
    ptrdiff_t n, m;                         /* coordinates, constraints */
    ptrdiff_t work, out;                    /* numbers of work memory and of results of the largest kernel */
    ptrdiff_t parameters, derived;          /* of the kernels of motion, in lanes; behind them the rank tolerance */
    ptrdiff_t derived_forces, joint_forces; /* of the kernels of forces; numbers that `joints` writes, 0 without it */
    ptrdiff_t coordinates;                  /* of all points: half of the numbers that `points` writes */
    ptrdiff_t links;
    double rank_tolerance;
};

/* Rows of extremes. */
enum { GREATEST = 1, LEAST = 2, LONGEST_VECTOR = 4, LAST = 8 };

/* Extremes of the forces of joints over recorded times, instead of the values at all times: four rows of `joint_forces`
 * numbers for each lane, the greatest, the least, those where a vector is longest, and the last. */
struct kinematic_extremes {
    const unsigned char *recorded; /* flag of each time */
    const ptrdiff_t *starts;       /* index of the first number of each vector of forces, and the end of the last */
    ptrdiff_t vectors;
    const unsigned char *wanted;   /* requested rows of each vector, as flags; other rows remain undefined */
    const ptrdiff_t *links;        /* first coordinates of two points of each link of the plane */
    ptrdiff_t link_count;
    double turn;                   /* rotation of a link from one time to the next that counts as small [rad] */
    real *rows;
    double *closure;               /* largest violation of a constraint at recorded times */
    unsigned char *steady;         /* every link rotates by less than `turn`; without this flag a link may rotate by
                                      more */
};

struct kinematic_task {
    double t;               /* of the starts */
    const real *parameters; /* a row for each lane, like all below; of a single linkage with the derived ones */
    const real *q, *lengths; /* starts; size of the linkage [m] */
    const real *times;      /* strictly monotone, the same for all lanes */
    ptrdiff_t count;
    real *rows;             /* q, u, a at each time reached */
    real *forces;           /* of joints */
    ptrdiff_t *reached;     /* number of times reached */
    const struct kinematic_extremes *extremes; /* instead of rows and forces, or NULL */
};

struct kinematics;

struct kinematics_api {
    size_t kinematics_struct;
    size_t (*bytes)(const struct kinematic_sizes *sizes, const struct kinematic_groups *groups);
    /* The memory starts at a multiple of 64 bytes. */
    void (*bind)(struct kinematics *k, const struct kinematic_sizes *sizes, const struct kinematic_kernels *kernels,
                 const struct kinematic_groups *groups, void *memory);
    void (*follow)(struct kinematics *k, const struct kinematic_task *task);
    /* Of a single linkage: write the multipliers lambda of J^T lambda = f - M a at closed poses, rows (q, u, a), and for
       each pose the least pivot over the greatest and the largest error [N] of these equations. Return the number of
       poses done: fewer if dPhi/dq is nearly singular. */
    ptrdiff_t (*multipliers)(struct kinematics *k, const real *p, const real *p_forces, const real *times,
                             const real *rows, ptrdiff_t count, real *multipliers, real *quality);
};

/* Of a single linkage. Those of lanes are in lane_functions.h. */
extern const struct kinematics_api symgen_kinematics;

#endif
