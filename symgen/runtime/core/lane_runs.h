/* Runs of fixed explicit steps in the lanes of vectors: one linkage with other parameters and starts in each lane.
 *
 * Kernels take one vector where those of a single run take a number. Every lane sees the operations of a single run
 * in their order, so its bits are the same. A lane fails near a loss of rank, or if its iterations do not converge:
 * the caller repeats its run alone. */
#ifndef SYMGEN_LANE_RUNS_H
#define SYMGEN_LANE_RUNS_H

#include <stddef.h>

#include "run.h"

struct lane_sizes {
    ptrdiff_t lanes;            /* numbers of a vector */
    ptrdiff_t n, m, extra;      /* as in struct sizes, like all below */
    ptrdiff_t parameters, derived, work, first_pivot;
    double rank_tolerance;
};

struct lane_runs {
    struct kernels kernels;
    struct lane_sizes sizes;
    struct scheme scheme;
    struct task task;
    ptrdiff_t dim;
    /* a vector for each entry */
    real *p, *time, *y, *y_new, *stage, *own, *work, *factors, *out, *rhs, *rates, *scale, *energies, *before;
    /* a number for each lane */
    real *previous, *size, *position_drift, *energy_drift, *energy_start;
    char *active, *failed;
};

/* Interface of runs in lanes: see core.h. */
struct lane_api {
    size_t lane_struct;
    size_t (*bytes)(const struct lane_sizes *sizes, const struct scheme *scheme);
    /* The memory starts at a multiple of 64 bytes. */
    void (*bind)(struct lane_runs *l, const struct lane_sizes *sizes, const struct kernels *kernels,
                 const struct scheme *scheme, const struct task *task, void *memory);
    /* Carry out one run per lane. `given` are rows of parameters, `y0` rows of states, `samples` receives
     * task.samples rows of states for each lane, `drifts` the largest errors of constraints and of energy, `failed`
     * whether the caller must repeat the run of a lane. */
    void (*run)(struct lane_runs *l, const void *given, const void *y0, const void *times, void *samples, void *drifts,
                char *failed);
};

extern const struct lane_api symgen_lane_runs;

#endif
