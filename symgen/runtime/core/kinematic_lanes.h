/* Driven linkages followed in the lanes of vectors: one linkage with other parameters and starts in each lane.
 *
 * Kernels take one vector where those of a single linkage take a number. Every lane has its own time and step and
 * takes the steps of kinematic_steps.h, as a single linkage does, so its bits are the same. A lane ends at a pose near
 * a singular dPhi/dq, or if its prediction fails; the caller computes the rest of its times. */
#ifndef SYMGEN_KINEMATIC_LANES_H
#define SYMGEN_KINEMATIC_LANES_H

#include "kinematics.h"

/* `balance`, `joints` and `setup_forces` are NULL without requested forces; setups are NULL without derived
   parameters. `points` is required for extremes of forces alone. */
struct kinematic_lane_kernels {
    kernel closure, gamma, setup, points;
    kernel balance, joints, setup_forces;
};

struct kinematic_lane_sizes {
    ptrdiff_t n, m, work, out;             /* as in struct kinematic_sizes, and the same of the kernels of forces */
    ptrdiff_t parameters, derived;         /* of the kernels of motion; behind them the rank tolerance */
    ptrdiff_t derived_forces, joint_forces; /* of the kernels of forces; numbers that `joints` writes, 0 without it */
    ptrdiff_t coordinates;                 /* of all points: half of the numbers that `points` writes */
    ptrdiff_t links;
    double rank_tolerance;
};

/* Rows of extremes. */
enum { GREATEST = 1, LEAST = 2, LONGEST_VECTOR = 4, LAST = 8 };

/* Extremes of the forces of joints over recorded times, instead of the values at all times: four rows of `joint_forces`
 * numbers for each lane, the greatest, the least, those where a vector is longest, and the last. */
struct kinematic_lane_extremes {
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

struct kinematic_lane_task {
    double t;              /* of the starts */
    const real *parameters; /* a row for each lane, like all below */
    const real *q, *lengths; /* starts; size of the linkage [m] */
    const real *times;     /* monotone, the same for all lanes */
    ptrdiff_t count;
    real *rows;            /* q, u, a at each time reached */
    real *forces;          /* of joints */
    ptrdiff_t *reached;    /* number of times reached */
    const struct kinematic_lane_extremes *extremes; /* instead of rows and forces, or NULL */
};

struct kinematic_lanes;

struct kinematic_lanes_api {
    ptrdiff_t width; /* numbers of a vector */
    size_t lanes_struct;
    size_t (*bytes)(const struct kinematic_lane_sizes *sizes, const struct kinematic_groups *groups);
    /* The memory starts at a multiple of 64 bytes. */
    void (*bind)(struct kinematic_lanes *k, const struct kinematic_lane_sizes *sizes,
                 const struct kinematic_lane_kernels *kernels, const struct kinematic_groups *groups, void *memory);
    void (*follow)(struct kinematic_lanes *k, const struct kinematic_lane_task *task);
};

/* The functions for vectors of `width` doubles, NULL if absent. */
const struct kinematic_lanes_api *kinematic_lanes_of(ptrdiff_t width);

extern const struct kinematic_lanes_api symgen_kinematic_lanes_2, symgen_kinematic_lanes_4, symgen_kinematic_lanes_8;

#endif
