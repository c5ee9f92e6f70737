#include "kinematic_lanes.h"

#ifdef REAL_VECTORS
#define WIDTH 2
#include "kinematic_vectors.h"
#endif
