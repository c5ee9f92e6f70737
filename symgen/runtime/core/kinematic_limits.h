/* When a step of a driven linkage is taken, by one number or in lanes. */
#ifndef SYMGEN_KINEMATIC_LIMITS_H
#define SYMGEN_KINEMATIC_LIMITS_H

#include "real.h"

/* Largest part of a predicted motion by which the solution may differ from the prediction. */
#define ASTRAY R(0.1)
/* Longest step over the size of the linkage. */
#define LONGEST R(0.1)
/* A least pivot below this part of the greatest is left to those who look for singular poses. */
#define SOUND R(1e-4)
/* Round-off of a residual over the coordinates. */
#define ACCEPT (256 * REAL_EPSILON)
enum { NEWTON = 12, HALVINGS = 12 };

#endif
