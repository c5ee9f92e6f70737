/* Changes of sign of a polynomial between 0 and 1, in order, none missed.
 *
 * On an interval the coefficients in Bernstein's basis enclose the polynomial, and it has at most as many zeros as they have
 * changes of sign, with the same parity (G. Farin, Curves and Surfaces for CAGD, chapter 5). Intervals with several changes
 * are halved.
 */
#ifndef SYMGEN_ZEROS_H
#define SYMGEN_ZEROS_H

#include "run.h"

struct zeros {
    const real *c;     /* coefficients by powers */
    long degree;
    real noise;        /* values up to this size have no sign */
    int sign;          /* at the last place with a sign; at first that at 0, or 0 if it has none there */
    int ends, last;    /* whether the sign at 1 is given, and this sign; 0 is a change there */
    real at, width;    /* the next interval, at first from 0 to 1 */
    real clear;        /* the last place with a sign */
    /* the change found last: between these places; the sign before it */
    real from, to;
    int before;
};

/* Find the next change of sign: whether there is one. */
int next_zero(struct zeros *z);

/* Return the zero of a polynomial between two places, at the first of which it has this sign. */
real bisected(const real *c, long degree, real from, real to, int sign);

/* Write the coefficients in Bernstein's basis between two places. */
void bernstein(const real *c, long degree, real from, real to, real *b);

/* Return the value of a polynomial, and the sum of the sizes of its terms but the first at 1. */
real value_of(const real *c, long degree, real x);
real reach_of(const real *c, long degree);

static inline int sign_of(real x, real noise) {
    return x > noise ? 1 : x < -noise ? -1 : 0;
}

#endif
