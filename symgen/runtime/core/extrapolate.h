/* The change of a coordinate over a step, predicted from the state where it begins and the one before. */
#ifndef SYMGEN_EXTRAPOLATE_H
#define SYMGEN_EXTRAPOLATE_H

#include "real.h"

/* Up to so many times the stride before, the polynomial through both states is a better guess than that of one. */
#define STRIDES R(1.5)

/* h: the step; g: the stride before, 0 without one; q, u, a: coordinate, rate and second rate where the step begins,
 * q0, u0, a0 where the stride began. By the quintic through both, unless the step is much longer than the stride. */
static inline real extrapolated(real h, real g, real q, real u, real a, real q0, real u0, real a0) {
    real change = h * (u + R(0.5) * h * a);
    if (g * h > 0 && real_fabs(h) <= STRIDES * real_fabs(g)) {
        const real e0 = q0 - q + g * (u - R(0.5) * g * a);
        const real e1 = g * (u0 - u + g * a), e2 = g * g * (a0 - a);
        const real c3 = R(-0.5) * (e2 + 20 * e0 + 8 * e1), c5 = e1 + 4 * e0 + c3, c4 = e0 + c3 + c5;
        const real s = h / g;
        change += s * s * s * (c3 + s * (c4 + s * c5));
    }
    return change;
}

#endif
