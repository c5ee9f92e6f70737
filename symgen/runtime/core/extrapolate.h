/* The change of a coordinate over a step, predicted from the state at its start and from the previous state. */
#ifndef SYMGEN_EXTRAPOLATE_H
#define SYMGEN_EXTRAPOLATE_H

#include "real.h"

/* Up to STRIDES times the previous stride, the polynomial through both states predicts better than the parabola of
   one. */
#define STRIDES R(1.5)

/* Defines PARABOLA, the change predicted by the state at the start of the step, and QUINTIC, the correction by the
   polynomial through both states; for numbers or vectors of numbers. h: the step; g: the previous stride; s = h / g;
   q, u, a: coordinate, rate and second rate at the start of the step; q0, u0, a0: at the start of the stride. */
#define EXTRAPOLATION(NUMBER, PARABOLA, QUINTIC)                                                                        \
    static inline NUMBER PARABOLA(NUMBER h, NUMBER u, NUMBER a) {                                                       \
        return h * (u + R(0.5) * h * a);                                                                                \
    }                                                                                                                   \
    static inline NUMBER QUINTIC(NUMBER s, NUMBER g, NUMBER q, NUMBER u, NUMBER a, NUMBER q0, NUMBER u0, NUMBER a0) {   \
        const NUMBER e0 = q0 - q + g * (u - R(0.5) * g * a);                                                            \
        const NUMBER e1 = g * (u0 - u + g * a), e2 = g * g * (a0 - a);                                                  \
        const NUMBER c3 = R(-0.5) * (e2 + 20 * e0 + 8 * e1), c5 = e1 + 4 * e0 + c3, c4 = e0 + c3 + c5;                  \
        return s * s * s * (c3 + s * (c4 + s * c5));                                                                    \
    }

EXTRAPOLATION(real, parabola, quintic)

/* The change by the quintic through both states; by the parabola if the step is much longer than the stride, or if
   the stride is 0, without a previous state. */
static inline real extrapolated(real h, real g, real q, real u, real a, real q0, real u0, real a0) {
    const real change = parabola(h, u, a);
    const int near = g * h > 0 && real_fabs(h) <= STRIDES * real_fabs(g);
    return near ? change + quintic(h / g, g, q, u, a, q0, u0, a0) : change;
}

#endif
