#include "kinematic_lanes.h"

#include "lanes_of.h"

LANES_OF(kinematic_lanes)
