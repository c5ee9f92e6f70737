#include "envelope.h"

#include "lanes.h"

/* Real and imaginary part of a number or of a vector of numbers. */
struct number {
    real re, im;
};

static inline real sum_of(const block *lanes) {
    const real *of = (const real *)lanes;
    real sum = 0;
    for (int k = 0; k < BLOCK; k++)
        sum += of[k];
    return sum;
}

static inline real dot(const real *a, const real *b, ptrdiff_t count) {
    block lanes = {0};
    ptrdiff_t i = 0;
    for (; i + BLOCK <= count; i += BLOCK)
        lanes += *(const block *)(a + i) * *(const block *)(b + i);
    real sum = sum_of(&lanes);
    for (; i < count; i++)
        sum += a[i] * b[i];
    return sum;
}

static inline struct number complex_dot(const real *a, const real *ai, const real *b, const real *bi, ptrdiff_t count) {
    block re = {0}, im = {0};
    ptrdiff_t i = 0;
    for (; i + BLOCK <= count; i += BLOCK) {
        const block x = *(const block *)(a + i), xi = *(const block *)(ai + i);
        const block y = *(const block *)(b + i), yi = *(const block *)(bi + i);
        re += x * y - xi * yi;
        im += x * yi + xi * y;
    }
    struct number sum = {sum_of(&re), sum_of(&im)};
    for (; i < count; i++) {
        sum.re += a[i] * b[i] - ai[i] * bi[i];
        sum.im += a[i] * bi[i] + ai[i] * b[i];
    }
    return sum;
}

static inline struct number inverse(real re, real im) {
    const real size = re * re + im * im;
    return (struct number){re / size, -im / size};
}

LANES static int factor_real(const struct envelope *e, real *a) {
    real *lower = a, *upper = a + e->at[e->n], *diagonal = upper + e->at[e->n];
    for (ptrdiff_t i = 0; i < e->n; i++) {
        const ptrdiff_t from = e->first[i];
        real *row = lower + e->at[i] - from, *column = upper + e->at[i] - from;
        for (ptrdiff_t j = from; j < i; j++) {
            const ptrdiff_t k = from > e->first[j] ? from : e->first[j], other = e->at[j] - e->first[j] + k;
            column[j] -= dot(lower + other, column + k, j - k);
            row[j] = (row[j] - dot(row + k, upper + other, j - k)) * diagonal[j];
        }
        diagonal[i] = 1 / (diagonal[i] - dot(row + from, column + from, i - from));
        if (!real_isfinite(diagonal[i]))
            return 0;
    }
    return 1;
}

LANES static int factor_complex(const struct envelope *e, real *a, real *ai) {
    const ptrdiff_t count = e->at[e->n];
    for (ptrdiff_t i = 0; i < e->n; i++) {
        const ptrdiff_t from = e->first[i], own = e->at[i] - from, to = own + count;
        for (ptrdiff_t j = from; j < i; j++) {
            const ptrdiff_t k = from > e->first[j] ? from : e->first[j], other = e->at[j] - e->first[j] + k;
            const struct number up =
                complex_dot(a + other, ai + other, a + to + k, ai + to + k, j - k);
            a[to + j] -= up.re;
            ai[to + j] -= up.im;
            const struct number left =
                complex_dot(a + own + k, ai + own + k, a + count + other, ai + count + other, j - k);
            const real x = a[own + j] - left.re, y = ai[own + j] - left.im;
            const real d = a[2 * count + j], di = ai[2 * count + j];
            a[own + j] = x * d - y * di;
            ai[own + j] = x * di + y * d;
        }
        const struct number sum =
            complex_dot(a + own + from, ai + own + from, a + to + from, ai + to + from, i - from);
        real *d = a + 2 * count + i, *di = ai + 2 * count + i;
        const struct number pivot = inverse(*d - sum.re, *di - sum.im);
        *d = pivot.re;
        *di = pivot.im;
        if (!real_isfinite(*d) || !real_isfinite(*di))
            return 0;
    }
    return 1;
}

int envelope_factor(const struct envelope *e, real *values, real *imaginary) {
    return imaginary == NULL ? factor_real(e, values) : factor_complex(e, values, imaginary);
}

LANES static void solve_real(const struct envelope *e, const real *a, real *x) {
    const real *lower = a, *upper = a + e->at[e->n], *diagonal = upper + e->at[e->n];
    for (ptrdiff_t i = 0; i < e->n; i++)
        x[i] -= dot(lower + e->at[i], x + e->first[i], i - e->first[i]);
    for (ptrdiff_t i = e->n - 1; i >= 0; i--) {
        x[i] *= diagonal[i];
        for (ptrdiff_t j = e->first[i], k = e->at[i]; j < i; j++, k++)
            x[j] -= upper[k] * x[i];
    }
}

LANES static void solve_complex(const struct envelope *e, const real *a, const real *ai, real *x, real *y) {
    const ptrdiff_t count = e->at[e->n];
    for (ptrdiff_t i = 0; i < e->n; i++) {
        const ptrdiff_t from = e->first[i], at = e->at[i];
        const struct number sum = complex_dot(a + at, ai + at, x + from, y + from, i - from);
        x[i] -= sum.re;
        y[i] -= sum.im;
    }
    for (ptrdiff_t i = e->n - 1; i >= 0; i--) {
        const real d = a[2 * count + i], di = ai[2 * count + i], re = x[i] * d - y[i] * di, im = x[i] * di + y[i] * d;
        x[i] = re;
        y[i] = im;
        for (ptrdiff_t j = e->first[i], k = count + e->at[i]; j < i; j++, k++) {
            x[j] -= a[k] * re - ai[k] * im;
            y[j] -= a[k] * im + ai[k] * re;
        }
    }
}

void envelope_solve(const struct envelope *e, const real *values, const real *imaginary, real *x, real *y) {
    if (imaginary == NULL)
        solve_real(e, values, x);
    else
        solve_complex(e, values, imaginary, x, y);
}
