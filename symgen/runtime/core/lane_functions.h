/* The functions for vectors of one width: starts, driven linkages, driven loops and runs of fixed steps, one with other
   parameters in each lane. */
#ifndef SYMGEN_LANE_FUNCTIONS_H
#define SYMGEN_LANE_FUNCTIONS_H

#include "kinematics.h"
#include "lane_runs.h"
#include "loop_lanes.h"
#include "start.h"

struct lane_functions {
    ptrdiff_t width; /* numbers of a vector */
    const struct start_api *starts;
    const struct kinematics_api *kinematics;
    const struct loop_lanes_api *loops;
    const struct lane_runs_api *runs;
};

/* The functions for vectors of `width` doubles: 2, 4 or 8. NULL for another width, and without vectors. */
const struct lane_functions *lanes_of(ptrdiff_t width);

extern const struct lane_functions symgen_lanes_2, symgen_lanes_4, symgen_lanes_8;

#endif
