/* Rank-revealing factorisation of six rows: Householder QR with column pivoting, A P = Q R; of one matrix, or of one in
 * each lane of vectors.
 *
 * Matrices are stored column by column, six numbers each. All loops over rows have the same length, which
 * compilers unroll: entries that a shorter loop would skip are zero. Source: G. H. Golub and C. F. Van Loan, Matrix
 * Computations, 5.4.2.
 */
#ifndef SYMGEN_QR_H
#define SYMGEN_QR_H

#include <stddef.h>

#include "wide.h"

/* Rows of a screw. */
enum { ROWS = 6 };
/* Columns that fit the arrays of fixed size. */
enum { MOST = 24 };

struct qr {
    wide r[ROWS * MOST];
    wide vectors[ROWS * ROWS];
    wide beta[ROWS];
    mask order[MOST];
    wide sign; /* of the determinant of as many columns as rows: 1, -1, or 0 */
    ptrdiff_t columns, steps;
};

/* The product of two columns. */
static inline wide qr_dot(const wide *a, const wide *b) {
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5]);
}

/* Factorise A, which is overwritten; order[k] is the column of A at place k. */
static inline void qr_factorise(wide *a, ptrdiff_t columns, struct qr *f) {
    f->columns = columns;
    f->steps = columns < ROWS ? columns : ROWS;
    f->sign = all(1);
    for (ptrdiff_t j = 0; j < columns; j++)
        f->order[j] = (mask){0} + j;
    for (ptrdiff_t k = 0; k < f->steps; k++) {
        mask best = (mask){0} + k;
        wide largest = qr_dot(a + ROWS * k, a + ROWS * k);
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const wide total = qr_dot(a + ROWS * j, a + ROWS * j);
            const mask greater = total > largest;
            best = chosen_index(greater, (mask){0} + j, best);
            largest = chosen(greater, total, largest);
        }
        exchange_indices(best, k, columns, f->order);
        exchange_rows(best, k, columns, ROWS, a);
        exchange_rows(best, k, columns, ROWS, f->r);
        /* v = x - norm e_k, scaled to v_k = 1; beta = 2/(v.v) = (norm - x_k)/norm. Columns of zeros stay. */
        wide *v = f->vectors + ROWS * k, norm = root(largest);
        norm = chosen(a[ROWS * k + k] > 0, -norm, norm);
        f->r[ROWS * k + k] = norm;
        const mask zero = norm == 0;
        const wide total = a[ROWS * k + k] - norm, factor = 1 / chosen(zero, all(1), total);
        for (int i = 0; i < ROWS; i++)
            v[i] = a[ROWS * k + i] * factor;
        v[k] = all(1);
        f->beta[k] = chosen(zero, all(0), -total / norm);
        /* A reflection and an exchange change the sign each. */
        f->sign = chosen((norm > 0) ^ (best != k), -f->sign, f->sign);
        f->sign = chosen(zero, all(0), f->sign);
        for (ptrdiff_t j = k + 1; j < columns; j++) {
            const wide part = f->beta[k] * qr_dot(v, a + ROWS * j);
            for (int i = 0; i < ROWS; i++)
                a[ROWS * j + i] -= part * v[i];
            f->r[ROWS * j + k] = a[ROWS * j + k];
            a[ROWS * j + k] = all(0);
        }
    }
}

/* Overwrite b by its k-th reflection. */
static inline void qr_turn(const struct qr *f, ptrdiff_t k, wide *b) {
    const wide total = f->beta[k] * qr_dot(f->vectors + ROWS * k, b);
    for (int i = 0; i < ROWS; i++)
        b[i] -= total * f->vectors[ROWS * k + i];
}

/* Write a least-squares solution of A x = b with at most `rank` nonzero entries; b is overwritten.
 * On return, the entries of b behind the first `rank` are the residual Q^T (b - A x). */
static inline void qr_solve(const struct qr *f, ptrdiff_t rank, wide *b, wide *x) {
    for (ptrdiff_t k = 0; k < f->steps; k++)
        qr_turn(f, k, b);
    for (ptrdiff_t k = rank - 1; k >= 0; k--) {
        b[k] /= f->r[ROWS * k + k];
        for (ptrdiff_t i = 0; i < k; i++)
            b[i] -= f->r[ROWS * k + i] * b[k];
    }
    for (ptrdiff_t j = 0; j < f->columns; j++)
        x[j] = all(0);
    for (ptrdiff_t j = 0; j < rank; j++)
        set_at(f->order[j], b[j], f->columns, x);
}

/* Write the minimum-norm solution w of the `rank` independent equations of A^T w = b. */
static inline void qr_solve_transposed(const struct qr *f, ptrdiff_t rank, const wide *b, wide *w) {
    for (int k = 0; k < ROWS; k++)
        w[k] = all(0);
    for (ptrdiff_t k = 0; k < rank; k++) {
        w[k] = value_at(f->order[k], b, f->columns);
        for (ptrdiff_t i = 0; i < k; i++)
            w[k] -= f->r[ROWS * k + i] * w[i];
        w[k] /= f->r[ROWS * k + k];
    }
    for (ptrdiff_t k = f->steps - 1; k >= 0; k--)
        qr_turn(f, k, w);
}

#endif
