#include "slopes.h"

#include <string.h>

#include "linear.h"

int find_slopes(struct equations *e, real t, const real *y, real *values, real *by_q, real *by_u) {
    const real *u = y + e->n;
    long n = e->n, entries = e->sizes.tangent;
    const long *places = e->sizes.tangent_places;
    memset(by_q, 0, (size_t)(n * n) * sizeof(real));
    memset(by_u, 0, (size_t)(n * n) * sizeof(real));
    if (entries == 0)
        return DONE;
    accelerate(e, t, y);
    e->kernels.tangent(&t, y, u, e->tangent_p, e->out, values);
    /* The entries come column by column: each column of the residual's slopes is a right-hand side. */
    for (long k = 0; k < entries;) {
        long column = places[3 * k + 1];
        real *slopes = column < n ? by_q + column : by_u + column - n;
        memset(e->rhs, 0, (size_t)(n + e->m) * sizeof(real));
        for (; k < entries && places[3 * k + 1] == column; k++)
            e->rhs[places[3 * k]] = values[places[3 * k + 2]];
        e->kernels.solve(&t, y, u, e->p, e->work, e->rhs);
        for (long i = 0; i < n; i++) {
            if (!real_isfinite(e->rhs[i]))
                return NOT_FINITE;
            slopes[i * n] = e->rhs[i];
        }
    }
    return DONE;
}

void derivative_along(struct run *run, real t, real *y, real *dy) {
    size_t bytes = (size_t)run->dim * sizeof(real);
    memcpy(run->error, y, bytes);
    if (run->e->of->project(run->e, t, run->error) == DONE)
        memcpy(y, run->error, bytes);
    run->e->of->derivative(run->e, t, y, dy);
}

void reduced_matrix(long n, real x, const real *by_q, const real *by_u, real *matrix) {
    for (long i = 0; i < n * n; i++)
        matrix[i] = -x * by_u[i] - by_q[i];
    for (long i = 0; i < n; i++)
        matrix[i * n + i] += x * x;
}

void reduced_complex(long n, const real *x, const real *by_q, const real *by_u, real *matrix) {
    for (long i = 0; i < n * n; i++) {
        matrix[2 * i] = -x[0] * by_u[i] - by_q[i];
        matrix[2 * i + 1] = -x[1] * by_u[i];
    }
    for (long i = 0; i < n; i++) {
        matrix[2 * (i * n + i)] += x[0] * x[0] - x[1] * x[1];
        matrix[2 * (i * n + i) + 1] += R(2) * x[0] * x[1];
    }
}

void solve_reduced(long n, real x, const real *by_u, const real *matrix, const ptrdiff_t *swaps, real *r) {
    real *s = r + n;
    for (long i = 0; i < n; i++) {
        s[i] += x * r[i];
        for (long j = 0; j < n; j++)
            s[i] -= by_u[i * n + j] * r[j];
    }
    solve_dense(n, matrix, swaps, s);
    for (long i = 0; i < n; i++) {
        real dq = s[i];
        s[i] = x * dq - r[i];
        r[i] = dq;
    }
}

void solve_reduced_complex(long n, const real *x, const real *by_u, const real *matrix, const ptrdiff_t *swaps, real *r) {
    real *s = r + 2 * n;
    for (long i = 0; i < n; i++) {
        s[2 * i] += x[0] * r[2 * i] - x[1] * r[2 * i + 1];
        s[2 * i + 1] += x[0] * r[2 * i + 1] + x[1] * r[2 * i];
        for (long j = 0; j < n; j++) {
            s[2 * i] -= by_u[i * n + j] * r[2 * j];
            s[2 * i + 1] -= by_u[i * n + j] * r[2 * j + 1];
        }
    }
    solve_complex(n, matrix, swaps, s);
    for (long i = 0; i < n; i++) {
        real re = s[2 * i], im = s[2 * i + 1];
        s[2 * i] = x[0] * re - x[1] * im - r[2 * i];
        s[2 * i + 1] = x[0] * im + x[1] * re - r[2 * i + 1];
        r[2 * i] = re, r[2 * i + 1] = im;
    }
}
