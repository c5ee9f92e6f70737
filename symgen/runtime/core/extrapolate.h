/* The change of a coordinate over a step, predicted from the state at its start and from the previous state. h: the
   step; g: the previous stride, or 0 without a previous state; q, u, a: coordinate, rate and second rate at the start of
   the step; q0, u0, a0: at the start of the stride. */
#ifndef SYMGEN_EXTRAPOLATE_H
#define SYMGEN_EXTRAPOLATE_H

#include "wide.h"

/* Up to STRIDES times the previous stride, the polynomial through both states predicts better than the parabola of
   one. */
#define STRIDES R(1.5)

static inline mask near_stride(wide h, wide g) {
    return (g * h > 0) & (magnitude(h) <= STRIDES * magnitude(g));
}

/* The change predicted by the state at the start of the step. */
static inline wide parabola(wide h, wide u, wide a) {
    return h * (u + R(0.5) * h * a);
}

/* The change by the quintic through both states in the lanes `near`, where s = h / g; by the parabola in others. */
static inline wide extrapolated(mask near, wide h, wide s, wide g, wide q, wide u, wide a, wide q0, wide u0, wide a0) {
    const wide change = parabola(h, u, a);
    const wide e0 = q0 - q + g * (u - R(0.5) * g * a);
    const wide e1 = g * (u0 - u + g * a), e2 = g * g * (a0 - a);
    const wide c3 = R(-0.5) * (e2 + 20 * e0 + 8 * e1), c5 = e1 + 4 * e0 + c3, c4 = e0 + c3 + c5;
    return chosen(near, change + s * s * s * (c3 + s * (c4 + s * c5)), change);
}

#endif
