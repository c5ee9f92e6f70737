#include "kinematic_follow.h"
