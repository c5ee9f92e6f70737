/* Rank-revealing factorisation of six rows: Householder QR with column pivoting, A P = Q R.
 *
 * Matrices are stored column by column, six reals each. All loops over rows have the same length, which
 * compilers unroll: entries that a shorter loop would skip are zero. Source: G. H. Golub and C. F. Van Loan, Matrix
 * Computations, 5.4.2.
 */
#ifndef SYMGEN_QR_H
#define SYMGEN_QR_H

#include <stddef.h>

#include "real.h"

/* MOST: columns that fit the arrays of fixed size. */
enum { ROWS = 6, MOST = 24 };

struct qr {
    real r[ROWS * MOST];
    real vectors[ROWS * ROWS];
    real beta[ROWS];
    ptrdiff_t order[MOST];
    ptrdiff_t columns, steps;
};

/* The product of two columns. */
static inline real qr_dot(const real *a, const real *b) {
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5]);
}

static inline void qr_swap(real *a, real *b) {
    for (int i = 0; i < ROWS; i++) {
        const real kept = a[i];
        a[i] = b[i];
        b[i] = kept;
    }
}

/* Factorise A, which is overwritten; order[k] is the column of A at place k. */
static inline void qr_factorise(real *a, ptrdiff_t columns, struct qr *f) {
    f->columns = columns;
    f->steps = columns < ROWS ? columns : ROWS;
    for (ptrdiff_t j = 0; j < columns; j++)
        f->order[j] = j;
    for (ptrdiff_t k = 0; k < f->steps; k++) {
        ptrdiff_t best = k;
        real largest = -1;
        for (ptrdiff_t j = k; j < columns; j++) {
            const real total = qr_dot(a + ROWS * j, a + ROWS * j);
            if (total > largest) {
                best = j;
                largest = total;
            }
        }
        if (best != k) {
            const ptrdiff_t kept = f->order[k];
            f->order[k] = f->order[best];
            f->order[best] = kept;
            qr_swap(a + ROWS * k, a + ROWS * best);
            qr_swap(f->r + ROWS * k, f->r + ROWS * best);
        }
        /* v = x - norm e_k, scaled to v_k = 1; beta = 2/(v.v) = (norm - x_k)/norm. */
        real *v = f->vectors + ROWS * k;
        real norm = real_sqrt(largest);
        if (a[ROWS * k + k] > 0)
            norm = -norm;
        f->r[ROWS * k + k] = norm;
        f->beta[k] = 0;
        if (norm == 0) {
            for (int i = 0; i < ROWS; i++)
                v[i] = 0;
            continue;
        }
        const real total = a[ROWS * k + k] - norm, factor = 1 / total;
        for (int i = 0; i < ROWS; i++)
            v[i] = a[ROWS * k + i] * factor;
        v[k] = 1;
        f->beta[k] = -total / norm;
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const real part = f->beta[k] * qr_dot(v, a + ROWS * j);
            for (int i = 0; i < ROWS; i++)
                a[ROWS * j + i] -= part * v[i];
            f->r[ROWS * j + k] = a[ROWS * j + k];
            a[ROWS * j + k] = 0;
        }
    }
}

/* Overwrite b by its k-th reflection. */
static inline void qr_turn(const struct qr *f, ptrdiff_t k, real *b) {
    const real total = f->beta[k] * qr_dot(f->vectors + ROWS * k, b);
    for (int i = 0; i < ROWS; i++)
        b[i] -= total * f->vectors[ROWS * k + i];
}

/* Write a least-squares solution of A x = b with at most `rank` nonzero entries; b is overwritten.
 * On return, the entries of b behind the first `rank` are the residual Q^T (b - A x). */
static inline void qr_solve(const struct qr *f, ptrdiff_t rank, real *b, real *x) {
    for (ptrdiff_t k = 0; k < f->steps; k++)
        qr_turn(f, k, b);
    for (ptrdiff_t k = rank - 1; k >= 0; k--) {
        b[k] /= f->r[ROWS * k + k];
        for (ptrdiff_t i = 0; i < k; i++)
            b[i] -= f->r[ROWS * k + i] * b[k];
    }
    for (ptrdiff_t j = 0; j < f->columns; j++)
        x[f->order[j]] = j < rank ? b[j] : 0;
}

/* Write the minimum-norm solution w of the `rank` independent equations of A^T w = b. */
static inline void qr_solve_transposed(const struct qr *f, ptrdiff_t rank, const real *b, real *w) {
    for (int k = 0; k < ROWS; k++)
        w[k] = 0;
    for (ptrdiff_t k = 0; k < rank; k++) {
        w[k] = b[f->order[k]];
        for (ptrdiff_t i = 0; i < k; i++)
            w[k] -= f->r[ROWS * k + i] * w[i];
        w[k] /= f->r[ROWS * k + k];
    }
    for (ptrdiff_t k = f->steps - 1; k >= 0; k--)
        qr_turn(f, k, w);
}

#endif
