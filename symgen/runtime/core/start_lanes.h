/* Linkages assembled from their drawing in the lanes of vectors: each lane has its own parameters.
 *
 * Every lane sees the operations of start.c in their order, so its bits are the same. A lane fails if it needs
 * shorter steps, or if its rows of the assembly are dependent; the caller then assembles it alone. The number of rows
 * must be at least that of coordinates. */
#ifndef SYMGEN_START_LANES_H
#define SYMGEN_START_LANES_H

#include "start.h"

struct start_lane_kernels {
    kernel setup, drawn, assembly, points; /* as in struct start_kernels; setup is NULL without derived parameters */
};

struct start_lanes;

struct start_lanes_api {
    size_t lanes_struct;
    /* Numbers of parameters: of the scene; and with the results of `setup` and one spare number. */
    size_t (*bytes)(const struct start_sizes *sizes, ptrdiff_t parameters);
    /* The memory starts at a multiple of 64 bytes. */
    void (*bind)(struct start_lanes *s, const struct start_sizes *sizes, const struct start_lane_kernels *kernels,
                 ptrdiff_t given, ptrdiff_t parameters, void *memory);
    /* Assemble the linkage for a row of parameters in each lane; write rows of coordinates, and whether each is
       assembled. */
    void (*assemble)(struct start_lanes *s, const real *parameters, real *q, unsigned char *assembled);
};

#endif
