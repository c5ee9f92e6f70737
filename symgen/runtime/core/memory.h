/* Arrays given out one behind the other from one piece of memory. */
#ifndef SYMGEN_MEMORY_H
#define SYMGEN_MEMORY_H

#include <stddef.h>

/* Bytes of an array, and the gap behind it that lets any type follow. */
static inline size_t rounded(size_t bytes) {
    return (bytes + 63) / 64 * 64;
}

#endif
