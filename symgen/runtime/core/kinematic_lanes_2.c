#include "kinematic_lanes.h"

#ifdef KINEMATIC_VECTORS
#define WIDTH 2
#include "kinematic_vectors.h"
#endif
