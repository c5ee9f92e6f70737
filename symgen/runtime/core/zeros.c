#include "zeros.h"

#include "lanes.h"

real value_of(const real *c, long degree, real x) {
    real sum = c[degree];
    for (long k = degree - 1; k >= 0; k--)
        sum = sum * x + c[k];
    return sum;
}

real reach_of(const real *c, long degree) {
    real sum = 0;
    for (long k = 1; k <= degree; k++)
        sum += real_fabs(c[k]);
    return sum;
}

void bernstein(const real *c, long degree, real from, real to, real *b) {
    const real width = to - from;
    real power = 1, choose = 1;
    copy(c, degree + 1, b);
    for (long i = 0; i < degree && from != 0; i++)
        for (long k = degree - 1; k >= i; k--)
            b[k] += from * b[k + 1];
    for (long k = 0; k <= degree; k++) {
        b[k] *= power / choose;
        power *= width, choose *= R(degree - k) / R(k + 1);
    }
    for (long i = 1; i <= degree; i++)
        for (long k = degree; k >= i; k--)
            b[k] += b[k - 1];
}

real bisected(const real *c, long degree, real from, real to, int sign) {
    for (;;) {
        const real middle = from + (to - from) / R(2);
        if (!(from < middle && middle < to))
            return to;
        if (sign_of(value_of(c, degree, middle), 0) == sign)
            from = middle;
        else
            to = middle;
    }
}

int next_zero(struct zeros *z) {
    real b[MOST_COEFFICIENTS];
    while (z->at < 1) {
        const real end = z->width < 1 - z->at ? z->at + z->width : 1;
        int changes = 0, sign = z->sign, now = 0;
        bernstein(z->c, z->degree, z->at, end, b);
        for (long j = 0; j <= z->degree; j++) {
            now = sign_of(b[j], z->noise);
            if (j == z->degree && end == 1 && z->ends)
                now = z->last ? z->last : -sign;
            if (now == 0 || now == sign)
                continue;
            changes += sign != 0;
            sign = now;
        }
        /* one change is certain if both ends have a sign */
        if ((changes > 1 || (changes && !(z->sign && now))) && end - z->at > R(4) * REAL_EPSILON) {
            z->width = (end - z->at) / R(2);
            continue;
        }
        z->from = z->clear, z->to = end, z->before = z->sign;
        z->at = end, z->width *= R(2), z->sign = sign;
        if (now)
            z->clear = end;
        if (z->before && sign != z->before)
            return 1;
    }
    return 0;
}
