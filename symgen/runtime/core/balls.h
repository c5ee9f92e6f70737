/* Other angles of ball joints near the poles of their own.
 *
 * Z(theta) Y(eta) X(alpha) loses rank where the axis i behind the ball is along the axis k before it. Near that pole a
 * run writes the rotation as X(90 deg) Z Y X with three angles of the same names, whose pole is where i is along j. The
 * turn in front is a parameter of the kernels, otherwise zero.
 * Where alpha is constant, to hold the idle spin of a link between two balls, the ball behind it takes over what the
 * change makes of that spin.
 */
#ifndef SYMGEN_BALLS_H
#define SYMGEN_BALLS_H

#include <stddef.h>

#include "real.h"

/* Numbers of the variables of a ball, and of the ball behind it; an alpha of -1 is constant, a next of -1 is none. */
struct ball {
    ptrdiff_t angles[3], next[3];
    double alpha; /* the constant */
};

/* Sine of the angle between i behind the ball and k before it: 0 at the pole of the table's own angles. */
real ball_off_pole(const struct ball *b, int turned, const real *q);

/* Write a state in the other angles of a ball, of the choices that are the same rotation that nearest to `near`; `a` may
 * be NULL. The ball behind one with a constant alpha stays in the table's own angles. */
void ball_rewrite(const struct ball *b, int turned, const real *near, real *q, real *u, real *a);

#endif
