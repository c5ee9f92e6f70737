/* Banded systems, also with a dense border, by Gaussian elimination with partial pivoting.
 *
 * LAPACK is not called. For narrow bands it takes twice the time of the arithmetic. For wide bands it starts threads,
 * which slow it down many times if other programs use the processors.
 */
#ifndef SYMGEN_BANDS_H
#define SYMGEN_BANDS_H

#include <stddef.h>

#include "real.h"

/* Storage of a band matrix: entry (i, j) at `first` + i + j * `lead`, `size` numbers in all. */
struct band_store {
    ptrdiff_t first, lead, size;
};

/* Bands with room for the fill-in of pivoting, or full columns if they need less memory. */
static inline struct band_store band_store(ptrdiff_t n, ptrdiff_t band) {
    const ptrdiff_t width = 3 * band + 1;
    if (n < width)
        return (struct band_store){0, n, n * n};
    return (struct band_store){2 * band, width - 1, n * width};
}

/* Columns eliminated in one pass. */
enum { TOGETHER = 4 };
/* Rows of B^-1 E in one block. */
enum { PANEL = 32 };

/* Rows of the multipliers of the columns of one pass. */
static inline ptrdiff_t multipliers_rows(ptrdiff_t band) {
    return band + TOGETHER;
}

/* Size of the working memory `panel`. */
static inline ptrdiff_t panel_size(ptrdiff_t border, ptrdiff_t band) {
    const ptrdiff_t rows = PANEL * border, multipliers = TOGETHER * multipliers_rows(band);
    return rows > multipliers ? rows : multipliers;
}

/* The system [B E; F D] of a banded B (inner x inner) and a few rows and columns that couple all unknowns. */
struct bordered {
    ptrdiff_t inner, border, band;
    real *banded;          /* B, see band_store */
    real *right;           /* E by columns, then B^-1 E */
    real *below, *corner;  /* F and D by rows, then the factors of D - F B^-1 E */
    real *panel;           /* working memory, see panel_size */
    int *pivots;
    ptrdiff_t *swaps;
};

/* Set all entries to zero. */
void clear_bordered(struct bordered *a);

/* Set an entry with row or column in the border. */
static inline void set_in_border(struct bordered *a, ptrdiff_t row, ptrdiff_t column, real value) {
    const ptrdiff_t n = a->inner;
    if (row < n)
        a->right[row + n * (column - n)] = value;
    else if (column < n)
        a->below[n * (row - n) + column] = value;
    else
        a->corner[a->border * (row - n) + column - n] = value;
}

/* Factorise in place; false if B or the whole matrix is singular. */
int factor_bordered(struct bordered *a);

/* Solve in place with the factors; right-hand sides are columns of x, inner + border reals each. */
void solve_bordered(const struct bordered *a, ptrdiff_t columns, real *x);

#endif
