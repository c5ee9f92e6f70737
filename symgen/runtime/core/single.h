/* Numbers and flags of a single linkage, as in vectors.h: the lowest bit of a flag counts. */
#ifndef SYMGEN_SINGLE_H
#define SYMGEN_SINGLE_H

#include "lanes.h"
#include "linear.h"

typedef real wide;
typedef ptrdiff_t mask, flag;

static inline wide all(real x) {
    return x;
}

static inline int any(mask which) {
    return which & 1;
}

static inline int has(mask which, int lane) {
    return (which >> lane) & 1;
}

static inline real number_of(wide x, int lane) {
    (void)lane;
    return x;
}

static inline wide chosen(mask which, wide yes, wide no) {
    return which & 1 ? yes : no;
}

static inline mask chosen_index(mask which, mask yes, mask no) {
    return which & 1 ? yes : no;
}

/* One of some values, by its index; and its change. */
static inline wide value_at(mask index, const wide *values, ptrdiff_t count) {
    (void)count;
    return values[index];
}

static inline void set_at(mask index, wide value, ptrdiff_t count, wide *values) {
    (void)count;
    values[index] = value;
}

/* Exchange a row with the one of an index, which is not less; numbers or indices. */
static inline void exchange_rows(mask index, ptrdiff_t row, ptrdiff_t rows, ptrdiff_t columns, wide *a) {
    (void)rows;
    for (ptrdiff_t i = 0; i < columns && index != row; i++) {
        const wide kept = a[row * columns + i];
        a[row * columns + i] = a[index * columns + i], a[index * columns + i] = kept;
    }
}

static inline void exchange_indices(mask index, ptrdiff_t row, ptrdiff_t rows, mask *a) {
    const mask kept = a[row];
    (void)rows;
    a[row] = a[index], a[index] = kept;
}

static inline wide magnitude(wide x) {
    return real_fabs(x);
}

static inline mask is_finite(wide x) {
    return real_isfinite(x);
}

static inline wide larger(wide a, wide b) {
    return b > a ? b : a;
}

static inline wide smaller(wide a, wide b) {
    return b < a ? b : a;
}

static inline wide root(wide x) {
    return real_sqrt(x);
}

static inline wide powered(wide x, real exponent) {
    return real_pow(x, exponent);
}

static inline wide largest_in(const wide *values, ptrdiff_t count) {
    return largest_or_nan(values, count);
}

static inline void exchange(mask which, wide *a, wide *b, ptrdiff_t count) {
    if (which & 1)
        for (ptrdiff_t i = 0; i < count; i++) {
            const wide kept = a[i];
            a[i] = b[i], b[i] = kept;
        }
}

static inline void copy_where(mask which, const wide *from, ptrdiff_t count, wide *to) {
    if (which & 1)
        copy(from, count, to);
}

static inline void call(kernel function, const wide *t, const wide *q, const wide *u, const wide *p, wide *work,
                        wide *out) {
    function(t, q, u, p, work, out);
}

static inline void load(const real *row, ptrdiff_t count, wide *to) {
    copy(row, count, to);
}

#endif
