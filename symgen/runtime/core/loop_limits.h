/* Limits of the closure of a loop, and of the steps of a driven loop, also in lanes. */
#ifndef SYMGEN_LOOP_LIMITS_H
#define SYMGEN_LOOP_LIMITS_H

#include "real.h"

/* Rounding of the closure. */
#define FINE (R(18) * REAL_EPSILON)
/* Largest defect of closure that is accepted if iterations do not decrease it further. */
#define COARSE (R(4500) * REAL_EPSILON)
/* Least determinant of the drives: below, force transmission is singular. */
#define NO_DRIVE RANK_TOLERANCE
/* Largest part of the required rates that the motion may miss. */
#define LEFT real_fmax(R(1e-7), R(1000) * REAL_EPSILON)
/* The same over the tolerated defect of closure: rates have errors of this size, larger ones near singular poses. */
#define LEFT_OPEN R(100)
/* Largest Gauss-Newton step at a minimum of the defect that is not zero. */
#define STILL real_sqrt(REAL_EPSILON)
/* Largest difference of the solution from its prediction, over the predicted motion. */
#define LOOP_ASTRAY R(0.2)
/* Longest step of a variable, in radians or sizes of the loop. */
#define LOOP_LONGEST R(0.5)

#endif
