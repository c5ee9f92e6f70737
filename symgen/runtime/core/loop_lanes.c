#include "loop_lanes.h"

#include "lanes_of.h"

LANES_OF(loop_lanes)
