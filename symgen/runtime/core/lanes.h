/* Blocks of numbers that are worked on at once. Where the compiler has vectors a block is one, and a function
 * marked LANES is compiled for wide ones too, chosen when the library is opened; elsewhere blocks are single
 * numbers. Every entry sees the same operations in the same order, so the bits are the same each way. */
#ifndef SYMGEN_LANES_H
#define SYMGEN_LANES_H

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

/* Copy so many numbers, few as a rule: calls of memcpy would take longer. The last block may overlap. */
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

/* The same of what was just written number by number: wide loads would wait until all of it is in the cache. */
static inline void copy_fresh(const real *from, long count, real *to) {
    for (long i = 0; i < count; i++) {
        real one = from[i];
#if defined(__GNUC__) && defined(__x86_64__) && !defined(SYMGEN_REAL_LONGDOUBLE) && !defined(SYMGEN_REAL_FLOAT128)
        __asm__("" : "+x"(one)); /* keeps the compiler from making wide ones of them */
#endif
        to[i] = one;
    }
}

#endif
