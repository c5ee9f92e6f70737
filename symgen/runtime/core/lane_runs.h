/* Runs of fixed explicit steps, and of power series, in the lanes of vectors: one linkage with other parameters and
 * starts in each lane. Each lane of power series has steps of its own within the tolerance.
 *
 * Kernels take one vector where those of a single run take a number. Every lane sees the operations of a single run
 * in their order, so its bits are the same. A lane fails near a loss of rank, or if its iterations do not converge:
 * the caller repeats its run alone. */
#ifndef SYMGEN_LANE_RUNS_H
#define SYMGEN_LANE_RUNS_H

#include <stddef.h>

#include "run.h"

struct lane_runs;

struct lane_runs_api {
    size_t lanes_struct;
    size_t (*bytes)(const struct sizes *sizes, const struct scheme *scheme);
    /* The memory is zero and starts at a multiple of 64 bytes; series_rows are 0 for explicit steps. */
    void (*bind)(struct lane_runs *l, const struct sizes *sizes, const struct kernels *kernels,
                 const struct scheme *scheme, const struct task *task, void *memory);
    /* Carry out one run per lane of `most` steps at most, from rows of parameters and of states y0. `samples` receives
     * task.samples rows of states for each lane, `drifts` the largest errors of constraints and of energy, `failed`
     * whether the caller must repeat the run of a lane. */
    void (*run)(struct lane_runs *l, const real *parameter_rows, const real *y0, const real *times, long most,
                real *samples, real *drifts, char *failed);
};

#endif
