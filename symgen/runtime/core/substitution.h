/* Substitution with the dense factors of linear.c, for numbers or for lanes: the including file defines NUMBER. Rows
   of the right-hand side must be exchanged before; with the transpose, rows of the solution must be exchanged
   afterwards. */

static inline void substitute(ptrdiff_t n, const NUMBER *a, NUMBER *b) {
    for (ptrdiff_t i = 1; i < n; i++)
        for (ptrdiff_t j = 0; j < i; j++)
            b[i] -= a[i * n + j] * b[j];
    for (ptrdiff_t i = n - 1; i >= 0; i--) {
        for (ptrdiff_t j = i + 1; j < n; j++)
            b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
}

static inline void substitute_transposed(ptrdiff_t n, const NUMBER *a, NUMBER *b) {
    for (ptrdiff_t i = 0; i < n; i++) {
        for (ptrdiff_t j = 0; j < i; j++)
            b[i] -= a[j * n + i] * b[j];
        b[i] /= a[i * n + i];
    }
    for (ptrdiff_t i = n - 1; i >= 0; i--)
        for (ptrdiff_t j = i + 1; j < n; j++)
            b[i] -= a[j * n + i] * b[j];
}
