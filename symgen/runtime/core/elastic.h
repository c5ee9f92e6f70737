/* Interface of elastic links, the same for every number type: see core.h. */
#ifndef SYMGEN_ELASTIC_H
#define SYMGEN_ELASTIC_H

#include "beams.h"

struct elastic_api {
    size_t motion_struct, beams_struct;

    size_t (*motion_bytes)(const struct equations *e, const struct motion_sizes *sizes);
    void (*motion_bind)(struct rigid_motion *m, struct equations *e, const struct motion_kernels *kernels,
                        const struct motion_sizes *sizes, double stride, void *memory);
    void (*motion_start)(struct rigid_motion *m, double t, const void *y);
    void (*motion_follow)(struct rigid_motion *m, const void *rows, const void *references, long count, double spacing,
                          long absent);
    int (*motion_at)(struct rigid_motion *m, double t);
    /* Write y, solutions, the motion of links and loads, one row per time; DONE or the status of the failure. */
    int (*motion_along)(struct rigid_motion *m, const void *times, long count, void *y, void *solutions, void *motion, void *loads);

    size_t (*beams_bytes)(const struct beam_layout *layout);
    void (*beams_bind)(struct beams *b, struct rigid_motion *motion, const struct beam_layout *layout, void *memory);
    int (*beams_assemble)(struct beams *b, double t, int analysis);
    /* Whether the indices in a restored memory are within their arrays. */
    int (*beams_valid)(const struct beams *b);
    void (*beams_unbalanced)(struct beams *b, int analysis, const void *s, void *out);
    size_t (*beams_carry)(struct beams *b, struct beam_tangents *tangents, void *memory);
};

extern const struct elastic_api symgen_elastic;

#endif
