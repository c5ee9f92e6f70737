/* Alternative angles of ball joints near the poles of the table's own angles.
 *
 * Z(theta) Y(eta) X(alpha) loses rank where the axis i behind the ball is along the axis k before it. Near that pole a
 * run writes the rotation as X(90 deg) Z Y X with three angles of the same names, whose pole is where i is along j. The
 * leading angle of 90 deg is a parameter of the kernels, otherwise zero.
 * A constant alpha holds the idle spin of a link between two balls; the ball behind it then takes over the spin that
 * the change of angles causes.
 */
#ifndef SYMGEN_BALLS_H
#define SYMGEN_BALLS_H

#include <stddef.h>

#include "real.h"

/* Numbers of the variables of a ball and of the next ball. Alpha is constant if its number is -1; next is -1 without
   a next ball. */
struct ball {
    ptrdiff_t angles[3], next[3];
    double alpha; /* the constant */
};

/* Sine of the angle between i behind the ball and k before it: 0 at the pole of the table's own angles. */
real ball_off_pole(const struct ball *b, int turned, const real *q);

/* Convert a state to the alternative angles of a ball, of equivalent angles those nearest to `near`; `a` may be NULL.
   The next ball after one with a constant alpha keeps the angles of the table. */
void ball_rewrite(const struct ball *b, int turned, const real *near, real *q, real *u, real *a);

#endif
