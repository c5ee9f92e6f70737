/* Alternative angles of ball joints near the poles of the table's own angles.
 *
 * Z(theta) Y(eta) X(alpha) loses rank where the axis i behind the ball is along the axis k before it. Near that pole a
 * run writes the rotation as X(90 deg) Z Y X with three angles of the same names, whose pole is where i is along j. The
 * leading angle of 90 deg is a parameter of the kernels, otherwise zero.
 * A constant alpha holds the idle spin of a link between two balls; the next ball then takes over the spin that
 * the change of angles causes.
 */
#ifndef SYMGEN_BALLS_H
#define SYMGEN_BALLS_H

#include <stddef.h>

#include "real.h"

struct equations;

/* Numbers of the variables theta, eta, alpha. Alpha is constant if its number is -1: the next ball then follows in the
   list, and has all three angles. The constant is not needed: changes of angles rotate the frame between about i. */
struct ball {
    ptrdiff_t angles[3];
};

/* See struct behaviour. */
int loop_rewrite(struct equations *e, const real *seen, real *y, int back);
void loop_usual(const struct equations *e, const real *y, real *q);
void loop_as_usual(struct equations *e, real *y, int release);

#endif
