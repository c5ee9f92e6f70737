#include "bands.h"

#include <stddef.h>

/* Bands from which on LAPACK works in blocks and is faster. */
enum { WIDE = 64 };

static int smaller(int a, int b) {
    return a < b ? a : b;
}

static int larger(int a, int b) {
    return a > b ? a : b;
}

static int by_lapack(const struct lapack *lapack, int band) {
    return lapack->factor && lapack->solve && band >= WIDE && sizeof(real) == sizeof(double);
}

int factor_band(const struct lapack *lapack, int n, int band, real *a, int *pivots) {
    int last = 0, width = 3 * band + 1, info = 0;
    if (by_lapack(lapack, band)) {
        lapack->factor(&n, &n, &band, &band, (double *)(void *)a, &width, pivots, &info);
        return info;
    }
    for (int k = 0; k < n; k++) {
        real *own = a + (ptrdiff_t)k * width + 2 * band;
        const int below = smaller(band, n - 1 - k);
        int best = 0;
        for (int i = 1; i <= below; i++)
            if (real_fabs(own[i]) > real_fabs(own[best]))
                best = i;
        pivots[k] = k + best;
        if (own[best] == 0)
            return k + 1;
        last = larger(last, smaller(k + band + best, n - 1));
        for (int j = k; best && j <= last; j++) {
            real *other = a + (ptrdiff_t)j * width + 2 * band + k - j, kept = other[0];
            other[0] = other[best];
            other[best] = kept;
        }
        const real inverse = 1 / own[0];
        for (int i = 1; i <= below; i++)
            own[i] *= inverse;
        for (int j = k + 1; j <= last; j++) {
            real *other = a + (ptrdiff_t)j * width + 2 * band + k - j;
            const real factor = other[0];
            if (factor != 0)
                for (int i = 1; i <= below; i++)
                    other[i] -= factor * own[i];
        }
    }
    return 0;
}

void solve_band(const struct lapack *lapack, int n, int band, int columns, real *a, int *pivots, real *x) {
    int width = 3 * band + 1, info = 0;
    if (by_lapack(lapack, band)) {
        lapack->solve("N", &n, &band, &band, &columns, (double *)(void *)a, &width, pivots, (double *)(void *)x, &n,
                      &info);
        return;
    }
    for (int c = 0; c < columns; c++) {
        real *b = x + (ptrdiff_t)c * n;
        for (int k = 0; k < n; k++) {
            const real *own = a + (ptrdiff_t)k * width + 2 * band, value = b[pivots[k]];
            b[pivots[k]] = b[k];
            b[k] = value;
            for (int i = 1; i <= smaller(band, n - 1 - k); i++)
                b[k + i] -= value * own[i];
        }
        for (int k = n - 1; k >= 0; k--) {
            const real *own = a + (ptrdiff_t)k * width + 2 * band;
            b[k] /= own[0];
            for (int i = larger(-2 * band, -k); i < 0; i++)
                b[k + i] -= b[k] * own[i];
        }
    }
}
