#include "bands.h"

#include <stddef.h>

#include "lanes.h"
#include "linear.h"

static ptrdiff_t smaller(ptrdiff_t a, ptrdiff_t b) {
    return a < b ? a : b;
}

static ptrdiff_t larger(ptrdiff_t a, ptrdiff_t b) {
    return a > b ? a : b;
}

/* to -= factor * from, for so many numbers. */
static inline void subtract(real *restrict to, const real *restrict from, real factor, ptrdiff_t count) {
    ptrdiff_t i = 0;
    for (; i + BLOCK <= count; i += BLOCK)
        *(block *)(to + i) -= factor * *(const block *)(from + i);
    for (; i < count; i++)
        to[i] -= factor * from[i];
}

/* Multipliers of several columns, with rows in the final order: `lead` reals per column. */
struct multipliers {
    real *of;
    ptrdiff_t lead;
};

/* Index of the first entry of largest magnitude. A first pass finds the magnitude alone: it needs no chain of
   dependent indices. */
static inline ptrdiff_t largest(const real *x, ptrdiff_t count) {
    real most[BLOCK] = {0}, all = 0;
    ptrdiff_t i = 0;
    for (; i + BLOCK <= count; i += BLOCK)
        for (int k = 0; k < BLOCK; k++)
            most[k] = real_fabs(x[i + k]) > most[k] ? real_fabs(x[i + k]) : most[k];
    for (; i < count; i++)
        all = real_fabs(x[i]) > all ? real_fabs(x[i]) : all;
    for (int k = 0; k < BLOCK; k++)
        all = most[k] > all ? most[k] : all;
    for (i = 0; i < count; i++)
        if (real_fabs(x[i]) == all)
            return i;
    return 0;
}

static inline void swap(real *a, real *b) {
    const real kept = *a;
    *a = *b;
    *b = kept;
}

/* Factorise a panel of columns from k on. Write to `last`, for the pivot row of each, the last column with an entry.
   Rows of the other columns are not swapped. False without a pivot. */
static inline int factor_columns(struct band_store at, ptrdiff_t n, ptrdiff_t band, ptrdiff_t k, real *a, int *pivots,
                                 ptrdiff_t *last) {
    const ptrdiff_t from = k, to = smaller(k + TOGETHER, n);
    ptrdiff_t reached = last[TOGETHER - 1];
    for (; k < to; k++) {
        real *own = a + at.first + k * (at.lead + 1);
        const ptrdiff_t below = smaller(band, n - 1 - k), best = largest(own, below + 1);
        pivots[k] = (int)(k + best);
        if (own[best] == 0)
            return 0;
        last[k - from] = reached = larger(reached, smaller(k + band + best, n - 1));
        const ptrdiff_t columns = smaller(to - 1, reached) - k;
        for (ptrdiff_t j = 0; j <= columns; j++)
            swap(own + j * at.lead, own + j * at.lead + best);
        const real inverse = 1 / own[0];
        for (ptrdiff_t i = 1; i <= below; i++)
            own[i] *= inverse;
        for (ptrdiff_t j = 1; j <= columns; j++)
            subtract(own + j * at.lead + 1, own + 1, own[j * at.lead], below);
    }
    return 1;
}

/* Copy the multipliers of the columns from k on, of `count` rows from k on. */
static inline void take_multipliers(struct band_store at, ptrdiff_t band, ptrdiff_t k, ptrdiff_t count, const real *a,
                                    const int *pivots, struct multipliers m) {
    for (ptrdiff_t c = 0; c < TOGETHER; c++) {
        real *to = m.of + c * m.lead;
        const ptrdiff_t below = smaller(band, count - 1 - c);
        memset(to, 0, (size_t)count * sizeof(real));
        memcpy(to + c + 1, a + at.first + (k + c) * (at.lead + 1) + 1, (size_t)below * sizeof(real));
        for (ptrdiff_t later = c + 1; later < TOGETHER; later++)
            swap(to + later, to + pivots[k + later] - k);
    }
}

/* Subtract all multipliers from a column, from its row k on. */
static inline void subtract_all(real *restrict to, struct multipliers m, ptrdiff_t count) {
    real by[TOGETHER];
    int none = 1;
    for (ptrdiff_t row = 0; row < TOGETHER; row++) {
        for (ptrdiff_t c = 0; c < row; c++)
            to[row] -= m.of[c * m.lead + row] * by[c];
        by[row] = to[row];
        none = none && by[row] == 0;
    }
    if (none)
        return;
    ptrdiff_t i = TOGETHER;
    for (; i + BLOCK <= count; i += BLOCK) {
        block value = *(block *)(to + i);
        for (ptrdiff_t c = 0; c < TOGETHER; c++)
            value -= by[c] * *(const block *)(m.of + c * m.lead + i);
        *(block *)(to + i) = value;
    }
    for (; i < count; i++)
        for (ptrdiff_t c = 0; c < TOGETHER; c++)
            to[i] -= by[c] * m.of[c * m.lead + i];
}

/* Factorise in place; false without a pivot. One pass over the other columns eliminates several columns, since loads
   and stores take most of the time. The operations on every entry have the order of single columns. */
LANES static int factor_band(ptrdiff_t n, ptrdiff_t band, real *a, int *pivots, real *panel) {
    const struct band_store at = band_store(n, band);
    const struct multipliers m = {panel, multipliers_rows(band)};
    ptrdiff_t last[TOGETHER] = {0};
    for (ptrdiff_t k = 0; k < n; k += TOGETHER) {
        if (!factor_columns(at, n, band, k, a, pivots, last))
            return 0;
        if (k + TOGETHER >= n)
            break;
        const ptrdiff_t count = smaller(TOGETHER + band, n - k);
        take_multipliers(at, band, k, count, a, pivots, m);
        for (ptrdiff_t j = k + TOGETHER; j <= last[TOGETHER - 1]; j++) {
            real *to = a + at.first + k + j * at.lead;
            ptrdiff_t c = 0;
            while (j > last[c]) /* the column is zero in these rows, which the store does not contain */
                c++;
            for (ptrdiff_t row = c; row < TOGETHER; row++)
                swap(to + row, to + pivots[k + row] - k);
            if (c == 0)
                subtract_all(to, m, count);
            else
                for (; c < TOGETHER; c++)
                    subtract(to + c + 1, m.of + c * m.lead + c + 1, to[c], count - c - 1);
        }
    }
    return 1;
}

/* Solve for right sides in the columns of x, `lead` reals apart, in place, by the factors. */
LANES static void solve_band(ptrdiff_t n, ptrdiff_t band, ptrdiff_t columns, const real *a, const int *pivots, real *x,
                             ptrdiff_t lead) {
    const struct band_store at = band_store(n, band);
    /* Each column of the factors, which do not fit into the caches, is read once for all right-hand sides. */
    for (ptrdiff_t k = 0; k < n; k++) {
        const real *own = a + at.first + k * (at.lead + 1);
        const ptrdiff_t below = smaller(band, n - 1 - k);
        for (ptrdiff_t c = 0; c < columns; c++) {
            real *b = x + c * lead, value = b[pivots[k]];
            b[pivots[k]] = b[k];
            b[k] = value;
            subtract(b + k + 1, own + 1, value, below);
        }
    }
    for (ptrdiff_t k = n - 1; k >= 0; k--) {
        const real *own = a + at.first + k * (at.lead + 1);
        const ptrdiff_t above = smaller(2 * band, k);
        for (ptrdiff_t c = 0; c < columns; c++) {
            real *b = x + c * lead;
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
    if (!factor_band(n, a->band, a->banded, a->pivots, a->panel))
        return 0;
    if (m == 0)
        return 1;
    solve_band(n, a->band, m, a->banded, a->pivots, a->right, n);
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
    solve_band(n, a->band, columns, a->banded, a->pivots, x, n + m);
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
