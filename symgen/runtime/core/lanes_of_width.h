/* The functions of lane_functions.h for vectors of WIDTH doubles, a constant that the including file defines. */
#include "lane_functions.h"

#define EQUATIONS static inline
#include "equation_steps.h"
#include "kinematic_follow.h"
#include "loop_vectors.h"
#include "run_vectors.h"
#include "start_vectors.h"

#define JOINED(name, width) name##width
#define TABLE(width) JOINED(symgen_lanes_, width)

const struct lane_functions TABLE(WIDTH) = {
    WIDTH, &start_functions, &kinematic_functions, &loop_functions, &run_functions,
};
