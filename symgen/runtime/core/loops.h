/* Interface of loops, the same for every number type: see core.h. */
#ifndef SYMGEN_LOOPS_H
#define SYMGEN_LOOPS_H

#include "loop.h"

struct loops_api {
    size_t loop_struct;
    size_t (*bytes)(const struct loop_sizes *sizes);
    void (*bind)(struct loop *l, const struct loop_sizes *sizes, const struct loop_kernels *kernels,
                 const ptrdiff_t *numbers, const unsigned char *is_length, const struct ball *balls, void *memory);
    int (*close)(struct loop *l, double t, void *q);
    int (*assemble)(struct loop *l, double t, void *q, long *rank);
    /* Leave the screws of all variables (6 x n reals) at q; return the defect of closure. */
    double (*closed_screws)(struct loop *l, double t, const void *q, void *screws);
    /* Convert a state (q, u) near poles of balls to alternative angles, which remain in use; return whether any
       changed. */
    int (*turn)(struct loop *l, void *y);
    /* Convert a state (q, u) back to the usual angles, those nearest to the variables `near`. */
    void (*turn_back)(struct loop *l, const void *near, void *y);
    int (*follow)(struct loop *l, double *t, void *q, const void *times, long count, double longest, void *states,
                  long row, void *out, long width, double *diagnosis, long *reached);
    /* Mark the outputs that depend on wrenches without work on any screw; see loop.h. */
    void (*undetermined)(struct loop *l, const void *times, const void *states, long row, long count, double least,
                         double part, unsigned char *found);
};

extern const struct loops_api symgen_loops;

#endif
