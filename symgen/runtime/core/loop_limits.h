/* When a closed loop counts as closed, and a step of a driven one is taken, by one number or in lanes. */
#ifndef SYMGEN_LOOP_LIMITS_H
#define SYMGEN_LOOP_LIMITS_H

#include "real.h"

/* Defect of closure that rounding leaves at best, and the largest that is taken where it falls no further. */
#define FINE (R(18) * REAL_EPSILON)
#define COARSE (R(4500) * REAL_EPSILON)
/* Below, a drive has no hold on a motion. */
#define NO_DRIVE RANK_TOLERANCE
/* Part of the rates asked that may be left. */
#define LEFT real_fmax(R(1e-7), R(1000) * REAL_EPSILON)
/* The same over the defect of closure that is tolerated: rates miss by as much, more near singular poses. */
#define LEFT_OPEN R(100)
/* Largest step, of those of Gauss and Newton, at a least defect that is not zero. */
#define STILL real_sqrt(REAL_EPSILON)
/* Largest part of a predicted motion by which the solution may differ from the prediction. */
#define ASTRAY R(0.2)
/* Longest step of a variable, in radians or sizes of the loop. */
#define LONGEST R(0.5)

#endif
