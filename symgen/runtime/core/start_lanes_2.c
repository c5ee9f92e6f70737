#include "start_lanes.h"

#ifdef REAL_VECTORS
#define WIDTH 2
#include "start_vectors.h"
#endif
