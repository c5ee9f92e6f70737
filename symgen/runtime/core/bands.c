#include "bands.h"

#include <stddef.h>

#include "lanes.h"
#include "linear.h"

static int smaller(int a, int b) {
    return a < b ? a : b;
}

static int larger(int a, int b) {
    return a > b ? a : b;
}

/* to -= factor * from, for so many numbers. */
static inline void subtract(real *restrict to, const real *restrict from, real factor, int count) {
    int i = 0;
    for (; i + BLOCK <= count; i += BLOCK)
        *(block *)(to + i) -= factor * *(const block *)(from + i);
    for (; i < count; i++)
        to[i] -= factor * from[i];
}

LANES int factor_band(int n, int band, real *a, int *pivots) {
    int last = 0;
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

LANES void solve_band(int n, int band, int columns, const real *a, const int *pivots, real *x, int lead) {
    const struct band_store at = band_store(n, band);
    /* All right sides at each column of the factors, which do not fit into the caches. */
    for (int k = 0; k < n; k++) {
        const real *own = a + at.first + k * (at.lead + 1);
        const int below = smaller(band, n - 1 - k);
        for (int c = 0; c < columns; c++) {
            real *b = x + (ptrdiff_t)c * lead, value = b[pivots[k]];
            b[pivots[k]] = b[k];
            b[k] = value;
            subtract(b + k + 1, own + 1, value, below);
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        const real *own = a + at.first + k * (at.lead + 1);
        const int above = smaller(2 * band, k);
        for (int c = 0; c < columns; c++) {
            real *b = x + (ptrdiff_t)c * lead;
            b[k] /= own[0];
            subtract(b + k - above, own - above, b[k], above);
        }
    }
}

void clear_bordered(struct bordered *a) {
    const ptrdiff_t sides = a->inner * a->border;
    memset(a->banded, 0, (size_t)band_store(a->inner, a->band).size * sizeof(real));
    if (a->border == 0)
        return;
    memset(a->right, 0, (size_t)sides * sizeof(real));
    memset(a->below, 0, (size_t)sides * sizeof(real));
    memset(a->corner, 0, (size_t)(a->border * a->border) * sizeof(real));
}

LANES int factor_bordered(struct bordered *a) {
    const ptrdiff_t n = a->inner, m = a->border;
    if (factor_band((int)n, (int)a->band, a->banded, a->pivots) != 0)
        return 0;
    if (m == 0)
        return 1;
    solve_band((int)n, (int)a->band, (int)m, a->banded, a->pivots, a->right, (int)n);
    for (ptrdiff_t from = 0; from < n; from += PANEL) {
        const ptrdiff_t rows = n - from < PANEL ? n - from : PANEL;
        for (ptrdiff_t j = 0; j < m; j++)
            for (ptrdiff_t k = 0; k < rows; k++)
                a->panel[m * k + j] = a->right[n * j + from + k];
        for (ptrdiff_t i = 0; i < m; i++)
            for (ptrdiff_t k = 0; k < rows; k++) {
                const real left = a->below[n * i + from + k];
                if (left != 0)
                    subtract(a->corner + m * i, a->panel + m * k, left, (int)m);
            }
    }
    return factor_dense(m, a->corner, a->swaps);
}

void solve_bordered(const struct bordered *a, ptrdiff_t columns, real *x) {
    const ptrdiff_t n = a->inner, m = a->border;
    solve_band((int)n, (int)a->band, (int)columns, a->banded, a->pivots, x, (int)(n + m));
    for (ptrdiff_t c = 0; m && c < columns; c++) {
        real *top = x + c * (n + m), *bottom = top + n;
        for (ptrdiff_t i = 0; i < m; i++)
            for (ptrdiff_t k = 0; k < n; k++)
                bottom[i] -= a->below[n * i + k] * top[k];
        solve_dense(m, a->corner, a->swaps, bottom);
        for (ptrdiff_t j = 0; j < m; j++)
            for (ptrdiff_t k = 0; k < n; k++)
                top[k] -= a->right[n * j + k] * bottom[j];
    }
}
