#include "bands.h"

#include <stddef.h>

#include "lanes.h"

static int smaller(int a, int b) {
    return a < b ? a : b;
}

static int larger(int a, int b) {
    return a > b ? a : b;
}

static int by_lapack(const struct lapack *lapack, int band) {
    return lapack->factor && lapack->solve && band >= WIDE && sizeof(real) == sizeof(double);
}

/* to -= factor * from, for so many numbers. */
static inline void subtract(real *restrict to, const real *restrict from, real factor, int count) {
    int i = 0;
    for (; i + BLOCK <= count; i += BLOCK)
        *(block *)(to + i) -= factor * *(const block *)(from + i);
    for (; i < count; i++)
        to[i] -= factor * from[i];
}

LANES int factor_band(const struct lapack *lapack, int n, int band, real *a, int *pivots) {
    int last = 0, width = 3 * band + 1, info = 0;
    if (by_lapack(lapack, band)) {
        lapack->factor(&n, &n, &band, &band, (double *)(void *)a, &width, pivots, &info);
        return info;
    }
    const struct band_store at = band_store(n, band);
    for (int k = 0; k < n; k++) {
        real *own = a + at.first + k * (at.lead + 1);
        /* What lies beyond the band is zero: whole blocks of it cost less than single numbers. */
        const int below = smaller(at.first ? band : (band + BLOCK - 1) / BLOCK * BLOCK, n - 1 - k);
        int best = 0;
        for (int i = 1; i <= below; i++)
            if (real_fabs(own[i]) > real_fabs(own[best]))
                best = i;
        pivots[k] = k + best;
        if (own[best] == 0)
            return k + 1;
        last = larger(last, smaller(k + band + best, n - 1));
        for (int j = k; best && j <= last; j++) {
            real *other = a + at.first + k + j * at.lead, kept = other[0];
            other[0] = other[best];
            other[best] = kept;
        }
        const real inverse = 1 / own[0];
        for (int i = 1; i <= below; i++)
            own[i] *= inverse;
        for (int j = k + 1; j <= last; j++) {
            real *other = a + at.first + k + j * at.lead;
            const real factor = other[0];
            if (factor != 0)
                subtract(other + 1, own + 1, factor, below);
        }
    }
    return 0;
}

LANES void solve_band(const struct lapack *lapack, int n, int band, int columns, real *a, int *pivots, real *x) {
    int width = 3 * band + 1, info = 0;
    if (by_lapack(lapack, band)) {
        lapack->solve("N", &n, &band, &band, &columns, (double *)(void *)a, &width, pivots, (double *)(void *)x, &n,
                      &info);
        return;
    }
    const struct band_store at = band_store(n, band);
    for (int c = 0; c < columns; c++) {
        real *b = x + (ptrdiff_t)c * n;
        for (int k = 0; k < n; k++) {
            const real *own = a + at.first + k * (at.lead + 1), value = b[pivots[k]];
            b[pivots[k]] = b[k];
            b[k] = value;
            subtract(b + k + 1, own + 1, value, smaller(band, n - 1 - k));
        }
        for (int k = n - 1; k >= 0; k--) {
            const real *own = a + at.first + k * (at.lead + 1);
            b[k] /= own[0];
            const int above = smaller(2 * band, k);
            subtract(b + k - above, own - above, b[k], above);
        }
    }
}
