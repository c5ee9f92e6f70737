/* Consecutive arrays in one block of memory: sizes and offsets follow from one list. */
#ifndef SYMGEN_ARENA_H
#define SYMGEN_ARENA_H

#include <stddef.h>
#include <string.h>

/* An array of the list: the address of the pointer to it, and its size. */
struct arena_array {
    void *pointer;
    size_t bytes;
};

/* The entry of the list for a pointer of any type and a number of elements. */
#define ARENA_ARRAY(pointer, count) {&(pointer), (size_t)(count) * sizeof *(pointer)}

/* Round up to the next address at which any type may start. */
static inline size_t rounded(size_t bytes) {
    return (bytes + 63) / 64 * 64;
}

/* Return the bytes of all arrays together; point them into memory unless that is NULL. */
static inline size_t arena_place(const struct arena_array *arrays, size_t count, void *memory) {
    size_t taken = 0;
    for (size_t i = 0; i < count; i++) {
        if (memory != NULL) {
            void *start = (char *)memory + taken;
            memcpy(arrays[i].pointer, &start, sizeof start);
        }
        taken += rounded(arrays[i].bytes);
    }
    return taken;
}

#define ARENA_PLACE(arrays, memory) arena_place(arrays, sizeof(arrays) / sizeof *(arrays), memory)

#endif
