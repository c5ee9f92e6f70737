#include "start_lanes.h"

#ifdef REAL_VECTORS
#define WIDTH 8
#include "start_vectors.h"
#endif
