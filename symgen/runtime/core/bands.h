/* Banded systems by Gauss's elimination with partial pivoting, and such with a dense border.
 *
 * LAPACK is not called: for narrow bands it takes twice as long as the arithmetic, and for wide ones it starts threads,
 * which take many times longer where other programs use the processors.
 */
#ifndef SYMGEN_BANDS_H
#define SYMGEN_BANDS_H

#include <stddef.h>

#include "real.h"

/* Where a band matrix keeps its entries: (i, j) at `first` + i + j * `lead`, `size` numbers in all. */
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

/* Factorise in place; return zero, or the number from one of the column without a pivot. */
int factor_band(int n, int band, real *a, int *pivots);

/* Solve for right sides in the columns of x, `lead` reals apart, in place, by the factors. */
void solve_band(int n, int band, int columns, const real *a, const int *pivots, real *x, int lead);

enum { PANEL = 32 };

/* The system [B E; F D] of a banded B (inner x inner) and a few rows and columns that couple all unknowns. */
struct bordered {
    ptrdiff_t inner, border, band;
    real *banded;          /* B, see band_store */
    real *right;           /* E by columns, then B^-1 E */
    real *below, *corner;  /* F and D by rows, then the factors of D - F B^-1 E */
    real *panel;           /* so many rows of B^-1 E, border reals each */
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

/* Factorise in place; false where B or the whole has no inverse. */
int factor_bordered(struct bordered *a);

/* Solve for right sides in the columns of x, inner + border reals each, in place, by the factors. */
void solve_bordered(const struct bordered *a, ptrdiff_t columns, real *x);

#endif
