/* Driven loops followed in the lanes of vectors: one loop with other parameters in each lane.
 *
 * Kernels take one vector where those of a single loop take a number. Every lane has its own times and steps and sees
 * the operations of loop.c and follow.c in their order, so its bits are the same. A lane ends if Newton's method
 * needs shorter steps, near a loss of rank, or if the force transmission of its drives becomes singular; the caller
 * then repeats all of it. The screws of the solved variables are independent: there are at most six. */
#ifndef SYMGEN_LOOP_LANES_H
#define SYMGEN_LOOP_LANES_H

#include "loop.h"

struct loop_lane_task {
    const real *own, *parameters; /* of the scene; of each lane, in rows like all arrays below */
    const real *start;            /* variables, closed with the parameters of the scene */
    const real *stages;           /* fractions of the path from those parameters to the lane's */
    ptrdiff_t stage_count;
    double begin;                 /* value of the input `lead` at the start */
    ptrdiff_t lead;
    int starts_at_zero;           /* the start is at t = 0, for any value of the input */
    const real *values;           /* increasing values of that input, or NULL with prescribed `times` */
    real *times;                  /* times of these values: written, increasing in lanes that reach them */
    ptrdiff_t count;
    double close, longest, apart; /* rounding of a value; the longest step over the range; the least range [s] */
    double least;                 /* a lane ends if the least pivot is below this part of the largest */
    real *out;                    /* entries of the kernel `outputs`: one row of values at all times for each entry */
    real *hold;                   /* determinant of the drives at all times */
    double *closure;              /* the largest of each lane */
    ptrdiff_t *reached;           /* number of times reached; rows of lanes that did not reach all are undefined */
};

struct loop_lanes;

struct loop_lanes_api {
    size_t lanes_struct;
    size_t (*bytes)(const struct loop_sizes *sizes);
    /* The memory is zero and starts at a multiple of 64 bytes; `numbers` and `is_length` as in loop_bind. */
    void (*bind)(struct loop_lanes *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
                 const ptrdiff_t *numbers, const unsigned char *is_length, void *memory);
    void (*follow)(struct loop_lanes *l, const struct loop_lane_task *task);
};

#endif
