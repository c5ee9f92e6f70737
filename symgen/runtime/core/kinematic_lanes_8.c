#include "kinematic_lanes.h"

#ifdef REAL_VECTORS
#define WIDTH 8
#include "kinematic_vectors.h"
#endif
