#include "loop_lanes.h"

#ifdef REAL_VECTORS
#define WIDTH 8
#include "loop_vectors.h"
#endif
