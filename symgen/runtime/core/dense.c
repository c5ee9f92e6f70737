#include "dense.h"

static void exchange(real *a, real *b, long count) {
    for (long i = 0; i < count; i++) {
        real kept = a[i];
        a[i] = b[i], b[i] = kept;
    }
}

int factor_dense(long n, real *a, real *swaps) {
    for (long k = 0; k < n; k++) {
        long best = k;
        for (long i = k + 1; i < n; i++)
            if (real_fabs(a[i * n + k]) > real_fabs(a[best * n + k]))
                best = i;
        swaps[k] = (real)best;
        real pivot = a[best * n + k];
        if (pivot == 0 || !real_isfinite(pivot))
            return 0;
        if (best != k)
            exchange(a + best * n, a + k * n, n);
        for (long i = k + 1; i < n; i++) {
            real factor = a[i * n + k] /= pivot;
            if (factor == 0)
                continue;
            for (long j = k + 1; j < n; j++)
                a[i * n + j] -= factor * a[k * n + j];
        }
    }
    return 1;
}

void solve_dense(long n, const real *a, const real *swaps, real *b) {
    for (long k = 0; k < n; k++)
        exchange(b + k, b + (long)swaps[k], 1);
    for (long i = 1; i < n; i++)
        for (long j = 0; j < i; j++)
            b[i] -= a[i * n + j] * b[j];
    for (long i = n - 1; i >= 0; i--) {
        for (long j = i + 1; j < n; j++)
            b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
}

/* c -= a b */
static void subtract_product(real *c, const real *a, const real *b) {
    c[0] -= a[0] * b[0] - a[1] * b[1];
    c[1] -= a[0] * b[1] + a[1] * b[0];
}

/* c /= a */
static void divide(real *c, const real *a) {
    real size = a[0] * a[0] + a[1] * a[1], re = (c[0] * a[0] + c[1] * a[1]) / size;
    c[1] = (c[1] * a[0] - c[0] * a[1]) / size;
    c[0] = re;
}

static real taxicab(const real *a) {
    return real_fabs(a[0]) + real_fabs(a[1]);
}

int factor_complex(long n, real *a, real *swaps) {
    for (long k = 0; k < n; k++) {
        long best = k;
        for (long i = k + 1; i < n; i++)
            if (taxicab(a + 2 * (i * n + k)) > taxicab(a + 2 * (best * n + k)))
                best = i;
        swaps[k] = (real)best;
        real size = taxicab(a + 2 * (best * n + k));
        if (size == 0 || !real_isfinite(size))
            return 0;
        if (best != k)
            exchange(a + 2 * best * n, a + 2 * k * n, 2 * n);
        for (long i = k + 1; i < n; i++) {
            real *factor = a + 2 * (i * n + k);
            divide(factor, a + 2 * (k * n + k));
            for (long j = k + 1; j < n; j++)
                subtract_product(a + 2 * (i * n + j), factor, a + 2 * (k * n + j));
        }
    }
    return 1;
}

void solve_complex(long n, const real *a, const real *swaps, real *b) {
    for (long k = 0; k < n; k++)
        exchange(b + 2 * k, b + 2 * (long)swaps[k], 2);
    for (long i = 1; i < n; i++)
        for (long j = 0; j < i; j++)
            subtract_product(b + 2 * i, a + 2 * (i * n + j), b + 2 * j);
    for (long i = n - 1; i >= 0; i--) {
        for (long j = i + 1; j < n; j++)
            subtract_product(b + 2 * i, a + 2 * (i * n + j), b + 2 * j);
        divide(b + 2 * i, a + 2 * (i * n + i));
    }
}
