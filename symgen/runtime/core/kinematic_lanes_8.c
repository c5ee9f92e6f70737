#include "kinematic_lanes.h"

#ifdef KINEMATIC_VECTORS
#if defined(__x86_64__) && !defined(__clang__)
#pragma GCC target("avx512f")
#endif
#define WIDTH 8
#include "kinematic_vectors.h"
#endif
