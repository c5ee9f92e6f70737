#include "start_lanes.h"

#include "lanes_of.h"

LANES_OF(start_lanes)
