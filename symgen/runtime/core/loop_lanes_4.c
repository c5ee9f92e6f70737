#include "loop_lanes.h"

#ifdef REAL_VECTORS
#define WIDTH 4
#include "loop_vectors.h"
#endif
