#include "loop_lanes.h"

const struct loop_lanes_api *loop_lanes_of(ptrdiff_t width) {
#ifdef REAL_VECTORS
    static const struct loop_lanes_api *const known[] = {
        &symgen_loop_lanes_2, &symgen_loop_lanes_4, &symgen_loop_lanes_8,
    };
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i]->width == width)
            return known[i];
#else
    (void)width;
#endif
    return NULL;
}
