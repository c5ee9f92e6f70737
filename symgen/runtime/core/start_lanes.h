/* Linkages led from their drawing in the lanes of vectors: one linkage with other parameters in each lane.
 *
 * Every lane sees the operations of start.c in their order, so its bits are the same. A lane that needs shorter steps on
 * the way, or whose rows of the assembly are dependent, is left to the caller. There are no fewer rows than coordinates. */
#ifndef SYMGEN_START_LANES_H
#define SYMGEN_START_LANES_H

#include "start.h"

struct start_lane_kernels {
    kernel setup, drawn, assembly, points; /* as in struct start_kernels; setup is NULL where it derives nothing */
};

struct start_lanes;

struct start_lanes_api {
    ptrdiff_t width; /* numbers of a vector */
    size_t lanes_struct;
    /* Numbers of parameters: those given, and with those that `setup` derives and one behind them. */
    size_t (*bytes)(const struct start_sizes *sizes, ptrdiff_t parameters);
    /* The memory starts at a multiple of 64 bytes. */
    void (*bind)(struct start_lanes *s, const struct start_sizes *sizes, const struct start_lane_kernels *kernels,
                 ptrdiff_t given, ptrdiff_t parameters, void *memory);
    /* Take a row of parameters for each lane; leave rows of coordinates, and whether the linkage is assembled. */
    void (*assemble)(struct start_lanes *s, const real *parameters, real *q, unsigned char *assembled);
};

/* The functions for vectors of so many doubles, NULL where there are none. */
const struct start_lanes_api *start_lanes_of(ptrdiff_t width);

extern const struct start_lanes_api symgen_start_lanes_2, symgen_start_lanes_4, symgen_start_lanes_8;

#endif
