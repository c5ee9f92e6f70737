/* Vectors of WIDTH doubles, a constant that the including file defines, and systems of equations in them. */
#ifndef SYMGEN_VECTORS_H
#define SYMGEN_VECTORS_H

#include <string.h>

#if defined(__x86_64__) && !defined(__clang__)
#if WIDTH == 4
#pragma GCC target("avx2")
#elif WIDTH == 8
#pragma GCC target("avx512f")
#endif
#endif
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "real.h"

#pragma GCC diagnostic ignored "-Wpsabi" /* no vector is passed to another file */

typedef real wide __attribute__((vector_size(WIDTH * sizeof(real)), may_alias));
typedef long long flag;
typedef flag mask __attribute__((vector_size(WIDTH * sizeof(flag)), may_alias));

static inline wide all(real x) {
    return (wide){0} + x;
}

static inline int has(mask which, int lane) {
    return which[lane] != 0;
}

static inline real number_of(wide x, int lane) {
    return x[lane];
}

static inline wide chosen(mask which, wide yes, wide no) {
    return (wide)((which & (mask)yes) | (~which & (mask)no));
}

static inline mask chosen_index(mask which, mask yes, mask no) {
    return (which & yes) | (~which & no);
}

/* One of some values in each lane, by its index; and its change. */
static inline wide value_at(mask index, const wide *values, ptrdiff_t count) {
    wide value = values[0];
    for (ptrdiff_t i = 1; i < count; i++)
        value = chosen(index == i, values[i], value);
    return value;
}

static inline void set_at(mask index, wide value, ptrdiff_t count, wide *values) {
    for (ptrdiff_t i = 0; i < count; i++)
        values[i] = chosen(index == i, value, values[i]);
}

static inline wide magnitude(wide x) {
    return (wide)((mask)x & ((mask){0} + 0x7fffffffffffffffLL));
}

static inline mask is_finite(wide x) {
    return magnitude(x) < all(REAL_INFINITY);
}

static inline int any(mask which) {
#if defined(__AVX512F__) && WIDTH == 8
    return _mm512_test_epi64_mask((__m512i)which, (__m512i)which) != 0;
#elif defined(__AVX__) && WIDTH == 4
    return !_mm256_testz_si256((__m256i)which, (__m256i)which);
#else
    long long found = 0;
    for (int lane = 0; lane < WIDTH; lane++)
        found |= which[lane];
    return found != 0;
#endif
}

static inline void exchange(mask which, wide *a, wide *b, ptrdiff_t count) {
    for (ptrdiff_t i = 0; i < count; i++) {
        const wide kept = a[i];
        a[i] = chosen(which, b[i], kept);
        b[i] = chosen(which, kept, b[i]);
    }
}

/* The larger of two values; the first if one is NaN. */
static inline wide larger(wide a, wide b) {
#if defined(__AVX512F__) && WIDTH == 8
    return (wide)_mm512_max_pd((__m512d)b, (__m512d)a);
#elif defined(__AVX__) && WIDTH == 4
    return (wide)_mm256_max_pd((__m256d)b, (__m256d)a);
#else
    return chosen(b > a, b, a);
#endif
}

static inline wide smaller(wide a, wide b) {
#if defined(__AVX512F__) && WIDTH == 8
    return (wide)_mm512_min_pd((__m512d)b, (__m512d)a);
#elif defined(__AVX__) && WIDTH == 4
    return (wide)_mm256_min_pd((__m256d)b, (__m256d)a);
#else
    return chosen(b < a, b, a);
#endif
}

/* The largest magnitude in each lane; NaN if one value is NaN. Bits without signs, read as integers, have the order
   of the magnitudes, and NaN is the largest. */
static inline wide largest_in(const wide *values, ptrdiff_t count) {
    mask largest = {0};
    for (ptrdiff_t i = 0; i < count; i++) {
        const mask size = (mask)magnitude(values[i]);
#if defined(__AVX512F__) && WIDTH == 8
        largest = (mask)_mm512_max_epi64((__m512i)size, (__m512i)largest);
#else
        const mask greater = size > largest;
        largest = (greater & size) | (~greater & largest);
#endif
    }
    return (wide)largest;
}

static inline wide root(wide x) {
#if defined(__AVX512F__) && WIDTH == 8
    return (wide)_mm512_sqrt_pd((__m512d)x);
#elif defined(__AVX__) && WIDTH == 4
    return (wide)_mm256_sqrt_pd((__m256d)x);
#else
    wide y = x;
    for (int lane = 0; lane < WIDTH; lane++)
        y[lane] = __builtin_sqrt(x[lane]);
    return y;
#endif
}

static inline wide powered(wide x, real exponent) {
    for (int lane = 0; lane < WIDTH; lane++)
        x[lane] = real_pow(x[lane], exponent);
    return x;
}

static inline void copy(const wide *from, ptrdiff_t count, wide *to) {
    memcpy(to, from, (size_t)count * sizeof(wide));
}

static inline void copy_fresh(const wide *from, ptrdiff_t count, wide *to) {
    copy(from, count, to);
}

static inline void copy_where(mask which, const wide *from, ptrdiff_t count, wide *to) {
    for (ptrdiff_t i = 0; i < count; i++)
        to[i] = chosen(which, from[i], to[i]);
}

static inline void call(kernel function, const wide *t, const wide *q, const wide *u, const wide *p, wide *work, wide *out) {
    function((const real *)t, (const real *)q, (const real *)u, (const real *)p, (real *)work, (real *)out);
}

static inline void load(const real *rows, ptrdiff_t count, wide *to) {
    for (ptrdiff_t i = 0; i < count; i++)
        for (int lane = 0; lane < WIDTH; lane++)
            to[i][lane] = rows[lane * count + i];
}

/* Exchange a row with the one of an index, which is not less; numbers or indices. */
static inline void exchange_rows(mask index, ptrdiff_t row, ptrdiff_t rows, ptrdiff_t columns, wide *a) {
    for (ptrdiff_t i = row + 1; i < rows; i++) {
        const mask here = index == i;
        if (any(here))
            exchange(here, a + i * columns, a + row * columns, columns);
    }
}

static inline void exchange_indices(mask index, ptrdiff_t row, ptrdiff_t rows, mask *a) {
    exchange_rows(index, row, rows, 1, (wide *)a);
}

#define DENSE static inline
#include "dense.h"

#endif
