/* Dense linear systems, single and in the lanes of vectors: functions of linear.h. The including file defines DENSE, the
 * storage class of the functions. */

DENSE mask factor_dense(ptrdiff_t n, wide *a, mask *swaps) {
    mask regular = ~(mask){0};
    for (ptrdiff_t k = 0; k < n && any(regular); k++) {
        mask best = (mask){0} + k;
        wide pivot = a[k * n + k];
        for (ptrdiff_t i = k + 1; i < n; i++) {
            const mask greater = magnitude(a[i * n + k]) > magnitude(pivot);
            pivot = chosen(greater, a[i * n + k], pivot);
            best = chosen_index(greater, (mask){0} + i, best);
        }
        swaps[k] = best;
        regular &= (pivot != 0) & is_finite(pivot);
        exchange_rows(best, k, n, n, a);
        for (ptrdiff_t i = k + 1; i < n; i++) {
            const wide factor = a[i * n + k] /= pivot;
            for (ptrdiff_t j = k + 1; j < n && any(factor != 0); j++)
                a[i * n + j] -= factor * a[k * n + j];
        }
    }
    return regular;
}

DENSE void solve_dense(ptrdiff_t n, const wide *a, const mask *swaps, wide *b) {
    for (ptrdiff_t k = 0; k < n; k++)
        exchange_rows(swaps[k], k, n, 1, b);
    for (ptrdiff_t i = 1; i < n; i++)
        for (ptrdiff_t j = 0; j < i; j++)
            b[i] -= a[i * n + j] * b[j];
    for (ptrdiff_t i = n - 1; i >= 0; i--) {
        for (ptrdiff_t j = i + 1; j < n; j++)
            b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
}

DENSE void solve_dense_transposed(ptrdiff_t n, const wide *a, const mask *swaps, wide *b) {
    for (ptrdiff_t i = 0; i < n; i++) {
        for (ptrdiff_t j = 0; j < i; j++)
            b[i] -= a[j * n + i] * b[j];
        b[i] /= a[i * n + i];
    }
    for (ptrdiff_t i = n - 1; i >= 0; i--)
        for (ptrdiff_t j = i + 1; j < n; j++)
            b[i] -= a[j * n + i] * b[j];
    for (ptrdiff_t k = n - 1; k >= 0; k--)
        exchange_rows(swaps[k], k, n, 1, b);
}

static inline wide dot(ptrdiff_t count, const wide *a, const wide *b) {
    wide total = all(0);
    for (ptrdiff_t i = 0; i < count; i++)
        total += a[i] * b[i];
    return total;
}

/* Reflect (first, rest) to (returned value, 0) by 1 - beta v v^T, v = (1, rest); v is written to rest. Entries of
   rest are `stride` apart. */
static inline wide reflect(wide first, wide *rest, ptrdiff_t count, ptrdiff_t stride, wide *beta) {
    wide norm = first * first;
    for (ptrdiff_t i = 0; i < count; i++)
        norm += rest[i * stride] * rest[i * stride];
    norm = root(norm);
    const mask zero = norm == 0;
    norm = chosen(first > 0, -norm, norm);
    const wide divisor = chosen(zero, all(1), first - norm);
    for (ptrdiff_t i = 0; i < count; i++)
        rest[i * stride] /= divisor;
    *beta = chosen(zero, all(0), (norm - first) / norm);
    return norm;
}

DENSE mask solve_least(ptrdiff_t rows, ptrdiff_t columns, wide *a, wide *b, wide part, wide *x, mask *order,
                       wide *beta) {
    const ptrdiff_t most = rows < columns ? rows : columns;
    mask independent = ~(mask){0};
    wide first = all(0);
    ptrdiff_t rank = 0;
    for (ptrdiff_t j = 0; j < columns; j++)
        order[j] = (mask){0} + j;
    for (; rank < most; rank++) {
        mask best = (mask){0} + rank;
        wide largest = all(-1);
        for (ptrdiff_t j = rank; j < columns; j++) {
            const wide total = dot(rows - rank, a + rows * j + rank, a + rows * j + rank);
            const mask greater = total > largest;
            best = chosen_index(greater, (mask){0} + j, best);
            largest = chosen(greater, total, largest);
        }
        exchange_rows(best, rank, columns, rows, a);
        exchange_indices(best, rank, columns, order);
        largest = root(largest);
        if (rank == 0)
            first = largest;
        independent &= largest > part * first;
        if (!any(independent))
            break;
        wide *own = a + rows * rank + rank, reflected;
        *own = reflect(*own, own + 1, rows - rank - 1, 1, &reflected);
        for (ptrdiff_t j = rank + 1; j <= columns; j++) {
            wide *other = j < columns ? a + rows * j + rank : b + rank;
            const wide along = reflected * (*other + dot(rows - rank - 1, own + 1, other + 1));
            *other -= along;
            for (ptrdiff_t i = 1; i < rows - rank; i++)
                other[i] -= along * own[i];
        }
    }
    /* R = (T 0) Z: reflections from the right, the last row first */
    const ptrdiff_t beyond = columns - rank;
    for (ptrdiff_t k = rank - 1; k >= 0 && beyond; k--) {
        wide *rest = a + rows * rank + k;
        a[rows * k + k] = reflect(a[rows * k + k], rest, beyond, rows, &beta[k]);
        for (ptrdiff_t i = 0; i < k; i++) {
            wide along = a[rows * k + i];
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
    for (ptrdiff_t j = 0; j < columns; j++)
        x[j] = all(0);
    for (ptrdiff_t k = 0; k < rank; k++)
        set_at(order[k], b[k], columns, x);
    for (ptrdiff_t k = 0; k < rank && beyond; k++) {
        const wide *rest = a + rows * rank + k, value = value_at(order[k], x, columns);
        wide along = value;
        for (ptrdiff_t j = 0; j < beyond; j++)
            along += value_at(order[rank + j], x, columns) * rest[rows * j];
        along *= beta[k];
        set_at(order[k], value - along, columns, x);
        for (ptrdiff_t j = 0; j < beyond; j++)
            set_at(order[rank + j], value_at(order[rank + j], x, columns) - along * rest[rows * j], columns, x);
    }
    return independent;
}
