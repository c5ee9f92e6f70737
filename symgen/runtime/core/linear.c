#include "linear.h"

#include "lanes.h"
#include "wide.h"

real largest_or_nan(const real *values, ptrdiff_t count) {
    real largest = 0;
    for (ptrdiff_t i = 0; i < count && largest == largest; i++)
        if (!(real_fabs(values[i]) <= largest))
            largest = real_fabs(values[i]);
    return largest;
}

LANES void add_multiple(ptrdiff_t count, real factor, const real *restrict from, real *restrict to) {
    for (ptrdiff_t i = 0; i < count; i++)
        to[i] += factor * from[i];
}

LANES void multiply_dense(ptrdiff_t rows, ptrdiff_t inner, ptrdiff_t columns, const real *restrict a, ptrdiff_t stride,
                          const real *restrict b, real *restrict c) {
    for (ptrdiff_t i = 0; i < rows; i++) {
        real *restrict to = c + i * columns;
        for (ptrdiff_t j = 0; j < columns; j++)
            to[j] = 0;
        for (ptrdiff_t r = 0; r < inner; r++)
            for (ptrdiff_t j = 0; j < columns; j++)
                to[j] += a[i * stride + r] * b[r * columns + j];
    }
}

/* -- LU factorisation ------------------------------------------------------------------------------------ */

#define DENSE
#include "dense.h"

/* to -= factor * from, for a row of right-hand sides. */
static void subtract_row(real *restrict to, const real *restrict from, real factor, ptrdiff_t wide) {
    for (ptrdiff_t c = 0; c < wide; c++)
        to[c] -= factor * from[c];
}

void solve_dense_wide(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, ptrdiff_t wide, real *b) {
    for (ptrdiff_t k = 0; k < n; k++)
        exchange_rows(swaps[k], k, n, wide, b);
    for (ptrdiff_t i = 1; i < n; i++)
        for (ptrdiff_t j = 0; j < i; j++)
            subtract_row(b + i * wide, b + j * wide, a[i * n + j], wide);
    for (ptrdiff_t i = n - 1; i >= 0; i--) {
        for (ptrdiff_t j = i + 1; j < n; j++)
            subtract_row(b + i * wide, b + j * wide, a[i * n + j], wide);
        for (ptrdiff_t c = 0; c < wide; c++)
            b[i * wide + c] /= a[i * n + i];
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

int factor_complex(ptrdiff_t n, real *a, ptrdiff_t *swaps) {
    for (ptrdiff_t k = 0; k < n; k++) {
        ptrdiff_t best = k;
        for (ptrdiff_t i = k + 1; i < n; i++)
            if (taxicab(a + 2 * (i * n + k)) > taxicab(a + 2 * (best * n + k)))
                best = i;
        swaps[k] = best;
        real size = taxicab(a + 2 * (best * n + k));
        if (size == 0 || !real_isfinite(size))
            return 0;
        if (best != k)
            exchange_rows(best, k, n, 2 * n, a);
        for (ptrdiff_t i = k + 1; i < n; i++) {
            real *factor = a + 2 * (i * n + k);
            divide(factor, a + 2 * (k * n + k));
            for (ptrdiff_t j = k + 1; j < n; j++)
                subtract_product(a + 2 * (i * n + j), factor, a + 2 * (k * n + j));
        }
    }
    return 1;
}

void solve_complex(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, real *b) {
    for (ptrdiff_t k = 0; k < n; k++)
        exchange_rows(swaps[k], k, n, 2, b);
    for (ptrdiff_t i = 1; i < n; i++)
        for (ptrdiff_t j = 0; j < i; j++)
            subtract_product(b + 2 * i, a + 2 * (i * n + j), b + 2 * j);
    for (ptrdiff_t i = n - 1; i >= 0; i--) {
        for (ptrdiff_t j = i + 1; j < n; j++)
            subtract_product(b + 2 * i, a + 2 * (i * n + j), b + 2 * j);
        divide(b + 2 * i, a + 2 * (i * n + i));
    }
}

/* -- Cholesky factorisation ------------------------------------------------------------------------------ */

ptrdiff_t factor_positive(ptrdiff_t n, real *a, real part, real least) {
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t k = 0; k <= i; k++) {
            const real entry = a[n * i + k];
            real total = entry;
            for (ptrdiff_t j = 0; j < k; j++)
                total -= a[n * i + j] * a[n * k + j];
            if (i > k) {
                a[n * i + k] = total / a[n * k + k];
                continue;
            }
            total = real_fmax(total, least);
            if (!(total > part * entry))
                return i;
            a[n * i + i] = real_sqrt(total);
        }
    return n;
}

void solve_positive(ptrdiff_t n, const real *a, real *b) {
    for (ptrdiff_t i = 0; i < n; i++) {
        for (ptrdiff_t j = 0; j < i; j++)
            b[i] -= a[n * i + j] * b[j];
        b[i] /= a[n * i + i];
    }
    for (ptrdiff_t i = n - 1; i >= 0; i--) {
        for (ptrdiff_t j = i + 1; j < n; j++)
            b[i] -= a[n * j + i] * b[j];
        b[i] /= a[n * i + i];
    }
}

/* -- complete pivoting ----------------------------------------------------------------------------------- */

/* Find the largest entry below row k in the remaining columns; return its magnitude. */
static real largest_left(ptrdiff_t rows, ptrdiff_t columns, const real *a, const ptrdiff_t *left, ptrdiff_t k,
                         ptrdiff_t *row, ptrdiff_t *column) {
    real best = 0;
    *row = k, *column = 0;
    for (ptrdiff_t i = k; i < rows; i++)
        for (ptrdiff_t j = 0; j < columns; j++)
            if (left[j] && real_fabs(a[columns * i + j]) > best) {
                best = real_fabs(a[columns * i + j]);
                *row = i, *column = j;
            }
    return best;
}

int choose_columns(ptrdiff_t rows, ptrdiff_t columns, real *a, ptrdiff_t *chosen, ptrdiff_t *others,
                   struct least_pivot *least) {
    real first = 0;
    *least = (struct least_pivot){INFINITY, -1};
    for (ptrdiff_t j = 0; j < columns; j++)
        others[j] = 1;
    for (ptrdiff_t k = 0; k < rows; k++) {
        ptrdiff_t row, column;
        const real best = largest_left(rows, columns, a, others, k, &row, &column);
        if (k == 0)
            first = best;
        const double part = first > 0 ? (double)(best / first) : 0;
        if (part < least->part)
            *least = (struct least_pivot){part, row};
        if (!(R(least->part) > RANK_TOLERANCE))
            return 0;
        chosen[k] = column;
        others[column] = 0;
        if (row != k)
            exchange_rows(row, k, rows, columns, a);
        for (ptrdiff_t i = k + 1; i < rows; i++) {
            const real factor = a[columns * i + column] / a[columns * k + column];
            for (ptrdiff_t j = 0; j < columns; j++)
                a[columns * i + j] -= factor * a[columns * k + j];
        }
    }
    for (ptrdiff_t i = 0, j = 0; j < columns; j++)
        if (others[j])
            others[i++] = j;
    return 1;
}
