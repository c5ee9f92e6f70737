#include "lane_functions.h"

const struct lane_functions *lanes_of(ptrdiff_t width) {
#ifdef REAL_VECTORS
    static const struct lane_functions *const known[] = {&symgen_lanes_2, &symgen_lanes_4, &symgen_lanes_8};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i]->width == width)
            return known[i];
#endif
    (void)width;
    return NULL;
}
