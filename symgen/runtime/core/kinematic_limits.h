/* Limits of a step of a driven linkage, also in lanes. */
#ifndef SYMGEN_KINEMATIC_LIMITS_H
#define SYMGEN_KINEMATIC_LIMITS_H

#include "real.h"

/* Largest difference of the solution from its prediction, over the predicted motion. */
#define ASTRAY R(0.1)
/* Longest step over the size of the linkage. */
#define LONGEST R(0.1)
/* Largest factor by which the determinant of a group changes in a step. */
#define CHANGE R(4)
/* Below this ratio of the least pivot to the greatest, following ends and the caller searches for singular poses. */
#define SOUND R(1e-6)
/* Shortest step over the whole time. */
#define SHORTEST R(1e-12)
/* Round-off of a residual over the coordinates. */
#define ACCEPT (256 * REAL_EPSILON)
enum { POSE_ITERATIONS = 12 };

#endif
