#include "linear.h"

#include "lanes.h"

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

static void exchange(real *a, real *b, ptrdiff_t count) {
    for (ptrdiff_t i = 0; i < count; i++) {
        real kept = a[i];
        a[i] = b[i], b[i] = kept;
    }
}

int factor_dense(ptrdiff_t n, real *a, ptrdiff_t *swaps) {
    for (ptrdiff_t k = 0; k < n; k++) {
        ptrdiff_t best = k;
        for (ptrdiff_t i = k + 1; i < n; i++)
            if (real_fabs(a[i * n + k]) > real_fabs(a[best * n + k]))
                best = i;
        swaps[k] = best;
        real pivot = a[best * n + k];
        if (pivot == 0 || !real_isfinite(pivot))
            return 0;
        if (best != k)
            exchange(a + best * n, a + k * n, n);
        for (ptrdiff_t i = k + 1; i < n; i++) {
            real factor = a[i * n + k] /= pivot;
            if (factor == 0)
                continue;
            for (ptrdiff_t j = k + 1; j < n; j++)
                a[i * n + j] -= factor * a[k * n + j];
        }
    }
    return 1;
}

#define NUMBER real
#include "substitution.h"

void solve_dense(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, real *b) {
    for (ptrdiff_t k = 0; k < n; k++)
        exchange(b + k, b + swaps[k], 1);
    substitute(n, a, b);
}

void solve_dense_transposed(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, real *b) {
    substitute_transposed(n, a, b);
    for (ptrdiff_t k = n - 1; k >= 0; k--)
        exchange(b + k, b + swaps[k], 1);
}

/* to -= factor * from, for a row of right-hand sides. */
static void subtract_row(real *restrict to, const real *restrict from, real factor, ptrdiff_t wide) {
    for (ptrdiff_t c = 0; c < wide; c++)
        to[c] -= factor * from[c];
}

void solve_dense_wide(ptrdiff_t n, const real *a, const ptrdiff_t *swaps, ptrdiff_t wide, real *b) {
    for (ptrdiff_t k = 0; k < n; k++)
        if (swaps[k] != k)
            exchange(b + k * wide, b + swaps[k] * wide, wide);
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
            exchange(a + 2 * best * n, a + 2 * k * n, 2 * n);
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
        exchange(b + 2 * k, b + 2 * swaps[k], 2);
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

/* -- least squares --------------------------------------------------------------------------------------- */

static real dot(ptrdiff_t count, const real *a, const real *b) {
    real total = 0;
    for (ptrdiff_t i = 0; i < count; i++)
        total += a[i] * b[i];
    return total;
}

/* Reflect (first, rest) to (returned value, 0) by 1 - beta v v^T, v = (1, rest); v is written to rest. Entries of
   rest are `stride` apart. */
static real reflect(real first, real *rest, ptrdiff_t count, ptrdiff_t stride, real *beta) {
    real total = first * first;
    for (ptrdiff_t i = 0; i < count; i++)
        total += rest[i * stride] * rest[i * stride];
    real norm = real_sqrt(total);
    *beta = 0;
    if (norm == 0)
        return 0;
    if (first > 0)
        norm = -norm;
    for (ptrdiff_t i = 0; i < count; i++)
        rest[i * stride] /= first - norm;
    *beta = (norm - first) / norm;
    return norm;
}

/* Swap the column of largest norm below row k to place k; return the square of that norm. */
static real pivot_column(ptrdiff_t rows, ptrdiff_t columns, real *a, ptrdiff_t k, ptrdiff_t *order) {
    ptrdiff_t best = k;
    real largest = -1;
    for (ptrdiff_t j = k; j < columns; j++) {
        const real total = dot(rows - k, a + rows * j + k, a + rows * j + k);
        if (total > largest)
            best = j, largest = total;
    }
    if (best != k) {
        const ptrdiff_t kept = order[k];
        order[k] = order[best], order[best] = kept;
        exchange(a + rows * k, a + rows * best, rows);
    }
    return largest;
}

void solve_least(ptrdiff_t rows, ptrdiff_t columns, real *a, real *b, real part, real *x, ptrdiff_t *order, real *beta) {
    const ptrdiff_t most = rows < columns ? rows : columns;
    ptrdiff_t rank = 0;
    for (ptrdiff_t j = 0; j < columns; j++)
        order[j] = j;
    for (real first = 0; rank < most; rank++) {
        const real largest = real_sqrt(pivot_column(rows, columns, a, rank, order));
        if (rank == 0)
            first = largest;
        if (!(largest > part * first))
            break;
        real *own = a + rows * rank + rank, reflected;
        *own = reflect(*own, own + 1, rows - rank - 1, 1, &reflected);
        for (ptrdiff_t j = rank + 1; j <= columns; j++) {
            real *other = j < columns ? a + rows * j + rank : b + rank;
            const real along = reflected * (*other + dot(rows - rank - 1, own + 1, other + 1));
            *other -= along;
            for (ptrdiff_t i = 1; i < rows - rank; i++)
                other[i] -= along * own[i];
        }
    }
    /* R = (T 0) Z: reflections from the right, the last row first */
    const ptrdiff_t beyond = columns - rank;
    for (ptrdiff_t k = rank - 1; k >= 0 && beyond; k--) {
        real *rest = a + rows * rank + k;
        a[rows * k + k] = reflect(a[rows * k + k], rest, beyond, rows, &beta[k]);
        for (ptrdiff_t i = 0; i < k; i++) {
            real along = a[rows * k + i];
            for (ptrdiff_t j = 0; j < beyond; j++)
                along += a[rows * (rank + j) + i] * rest[rows * j];
            along *= beta[k];
            a[rows * k + i] -= along;
            for (ptrdiff_t j = 0; j < beyond; j++)
                a[rows * (rank + j) + i] -= along * rest[rows * j];
        }
    }
    for (ptrdiff_t k = rank - 1; k >= 0; k--) {
        b[k] /= a[rows * k + k];
        for (ptrdiff_t i = 0; i < k; i++)
            b[i] -= a[rows * k + i] * b[k];
    }
    for (ptrdiff_t k = 0; k < rank; k++)
        x[order[k]] = b[k];
    for (ptrdiff_t j = rank; j < columns; j++)
        x[order[j]] = 0;
    for (ptrdiff_t k = 0; k < rank && beyond; k++) {
        const real *rest = a + rows * rank + k;
        real along = x[order[k]];
        for (ptrdiff_t j = 0; j < beyond; j++)
            along += x[order[rank + j]] * rest[rows * j];
        along *= beta[k];
        x[order[k]] -= along;
        for (ptrdiff_t j = 0; j < beyond; j++)
            x[order[rank + j]] -= along * rest[rows * j];
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
            exchange(a + columns * row, a + columns * k, columns);
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
