#include "kinematic_lanes.h"

#ifdef KINEMATIC_VECTORS
#if defined(__x86_64__) && !defined(__clang__)
#pragma GCC target("avx2")
#endif
#define WIDTH 4
#include "kinematic_vectors.h"
#endif
