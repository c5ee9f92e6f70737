/* Sums of the derivatives of stages. */
#ifndef SYMGEN_STAGES_H
#define SYMGEN_STAGES_H

#include "lanes.h"
#include "run.h"

enum { MOST_BLOCKS = 4 };

/* Blocks of out = base (0 where NULL) + the sum of rows by their factors, from one column on; `wide` is a
 * constant of each call, so that the sums stay in registers. */
static inline void add_blocks(const real *base, const real *factors, const real *rows, long count, long dim, real *out,
                              int wide) {
    block sum[MOST_BLOCKS];
    for (int k = 0; k < wide; k++)
        sum[k] = base ? *(const block *)(base + k * BLOCK) : (block){0};
    for (long j = 0; j < count; j++, rows += dim)
        for (int k = 0; k < wide; k++)
            sum[k] += factors[j] * *(const block *)(rows + k * BLOCK);
    for (int k = 0; k < wide; k++)
        *(block *)(out + k * BLOCK) = sum[k];
}

/* out = base (0 where NULL) + the sum of rows by their factors, one row after the other for every entry. The
 * last block may overlap the one before it. */
LANES static void add_rows(const real *base, const real *factors, const real *rows, long count, long dim,
                           real *restrict out) {
    long at = 0, left;
    if (dim < BLOCK) {
        for (long i = 0; i < dim; i++) {
            out[i] = base ? base[i] : 0;
            for (long j = 0; j < count; j++)
                out[i] += factors[j] * rows[j * dim + i];
        }
        return;
    }
    for (; at + MOST_BLOCKS * BLOCK <= dim; at += MOST_BLOCKS * BLOCK)
        add_blocks(base ? base + at : NULL, factors, rows + at, count, dim, out + at, MOST_BLOCKS);
    left = (dim - at) / BLOCK;
    if (left == 3)
        add_blocks(base ? base + at : NULL, factors, rows + at, count, dim, out + at, 3);
    else if (left == 2)
        add_blocks(base ? base + at : NULL, factors, rows + at, count, dim, out + at, 2);
    else if (left == 1)
        add_blocks(base ? base + at : NULL, factors, rows + at, count, dim, out + at, 1);
    if (at + left * BLOCK < dim) {
        at = dim - BLOCK;
        add_blocks(base ? base + at : NULL, factors, rows + at, count, dim, out + at, 1);
    }
}

/* out = base (0 where NULL) + the first rows by their weights times h. */
static inline void add_stages(const real *weights, long count, real h, const real *rows, long dim, const real *base,
                              real *out) {
    real factors[MOST_STAGES];
    for (long j = 0; j < count; j++)
        factors[j] = h * weights[j];
    add_rows(base, factors, rows, count, dim, out);
}

#endif
