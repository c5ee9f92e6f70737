/* Driven loops followed in the lanes of vectors: one loop with other parameters in each lane.
 *
 * Kernels take one vector where those of a single loop take a number. Every lane has its own times and steps and sees the
 * operations of loop.c and follow.c in their order, so its bits are the same. A lane whose closing needs shorter steps of
 * Newton's method, that comes near a loss of rank, or whose drives lose their hold ends there: all of it is left to the
 * caller. The screws of the solved variables are independent: there are at most six. */
#ifndef SYMGEN_LOOP_LANES_H
#define SYMGEN_LOOP_LANES_H

#include "loop.h"

struct loop_lane_task {
    const real *own, *parameters; /* of the scene, and of each lane, in rows like all below */
    const real *start;            /* variables, closed with the parameters of the scene */
    const real *stages;           /* parts of the way from those parameters to the lane's */
    ptrdiff_t stage_count;
    double begin;                 /* value of the input `lead` at the start */
    ptrdiff_t lead;
    int starts_at_zero;           /* the start is at t = 0, whatever the value */
    const real *values;           /* of that input, increasing, or NULL where `times` are given */
    real *times;                  /* at which it has them: written, increasing in lanes that are reached */
    ptrdiff_t count;
    double close, longest, apart; /* rounding of a value; the longest step's part of the range, and the least range [s] */
    double least;                 /* part of the largest pivot below which the least one ends a lane */
    real *out;                    /* entries of the kernel `outputs`, the values of each at all times in a row */
    real *hold;                   /* hold of the drives there */
    double *closure;              /* the largest of each lane */
    ptrdiff_t *reached;           /* how many times were; undefined rows are left where not all were */
};

struct loop_lanes;

struct loop_lanes_api {
    ptrdiff_t width; /* numbers of a vector */
    size_t lanes_struct;
    size_t (*bytes)(const struct loop_sizes *sizes);
    /* The memory starts at a multiple of 64 bytes; `numbers` and `is_length` as in loop_bind. */
    void (*bind)(struct loop_lanes *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
                 const ptrdiff_t *numbers, const unsigned char *is_length, void *memory);
    void (*follow)(struct loop_lanes *l, const struct loop_lane_task *task);
};

/* The functions for vectors of so many doubles, or NULL. */
const struct loop_lanes_api *loop_lanes_of(ptrdiff_t width);

extern const struct loop_lanes_api symgen_loop_lanes_2, symgen_loop_lanes_4, symgen_loop_lanes_8;

#endif
