/* Blocks of numbers for SIMD instructions. If the compiler has vectors, a block is a vector, and functions marked
   LANES are also compiled for wider vectors, selected when the library is opened. Otherwise blocks are single
   numbers. Every entry sees the same operations in the same order, so the bits do not depend on the width. */
#ifndef SYMGEN_LANES_H
#define SYMGEN_LANES_H

#include <stddef.h>
#include <string.h>

#include "real.h"

#if defined(__GNUC__) && !defined(SYMGEN_REAL_FLOAT128) && !defined(SYMGEN_REAL_LONGDOUBLE)
enum { BLOCK = 4 };
typedef real block __attribute__((vector_size(4 * sizeof(real)), aligned(sizeof(real)), may_alias));
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define LANES __attribute__((target_clones("avx", "default")))
#endif
#else
enum { BLOCK = 1 };
typedef real block;
#endif

#ifndef LANES
#define LANES
#endif

/* Copy `count` numbers. They are few as a rule, and calls of memcpy would take longer. The last block may overlap. */
static inline void copy(const real *from, long count, real *to) {
    long at = 0;
    for (; at + BLOCK <= count; at += BLOCK)
        *(block *)(to + at) = *(const block *)(from + at);
    if (at < count && count >= BLOCK)
        *(block *)(to + count - BLOCK) = *(const block *)(from + count - BLOCK);
    else
        for (; at < count; at++)
            to[at] = from[at];
}

/* The same for numbers just written one by one. A wide load would wait until all of them are in the cache; `volatile`
   prevents it. */
static inline void copy_fresh(const real *from, ptrdiff_t count, real *to) {
    const volatile real *fresh = from;
    for (ptrdiff_t i = 0; i < count; i++)
        to[i] = fresh[i];
}

#endif
