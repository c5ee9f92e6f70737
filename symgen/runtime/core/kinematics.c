#define WIDTH 1
#include "single.h"

#include "kinematic_follow.h"
