/* Newton's method and its simplified forms: corrections of unknowns until their equations are satisfied to rounding.
 *
 * As in the nonlinear solvers of SUNDIALS, equations, matrix and its factorisation belong to the caller: a step. The
 * function below decides when steps end, for one problem or for one in each lane: see wide.h.
 */
#ifndef SYMGEN_NEWTON_H
#define SYMGEN_NEWTON_H

#include "wide.h"

/* In its caller, so that the compiler sees the step. */
#if defined(__GNUC__)
#define INLINED static inline __attribute__((always_inline))
#else
#define INLINED static inline
#endif

struct newton;

/* Correct the unknowns in the open lanes and return the error there: what is left of the equations, or the size of the
   correction. An infinite error: there is no correction. */
typedef wide newton_step(void *of, struct newton *w);

struct newton {
    /* When to end. Errors are relative to `size`, which is 1 unless the caller's steps set it. */
    int most;      /* steps, at least 1 */
    wide close;    /* largest error of a solution */
    wide rounded;  /* largest error that is rounding if it exceeds half of the one before */
    real left;     /* largest error of a solution by the rate of convergence; 0: not estimated */
    real grows;    /* ratio of an error to the one before, or to the larger of two, above which steps diverge */
    real tolerated; /* largest error that may grow */
    int alternate; /* whether errors alternate: the larger of the last two counts */
    int halvings;  /* of a diverging step, in a row; the last one stands */
    /* The present step: its number, from 0; how often the correction was halved, 0 if it is a new one; lanes without
       a solution; those whose solution has a larger error than the step before; the last errors. */
    int count, halved;
    mask open, worse;
    wide size, error, before, earlier;
};

/* Take steps to a solution; return the lanes of `open` that have one. The last errors remain. */
INLINED mask newton_solve(struct newton *w, mask open, newton_step *step, void *of) {
    mask solved = {0};
    w->open = open, w->worse = solved, w->halved = 0;
    w->size = all(1), w->error = w->before = w->earlier = all(REAL_INFINITY);
    for (w->count = 0; w->count < w->most && any(w->open); w->count++) {
        if (!w->halved)
            w->earlier = w->before, w->before = w->error;
        w->error = step(of, w);
        w->open &= w->error < all(REAL_INFINITY);
        mask here = (w->error <= w->close * w->size)
                    | ((w->error > R(0.5) * w->before) & (w->error <= w->rounded * w->size));
        if (w->left > 0 && w->count)
            here |= w->error * w->error <= w->left * w->size * (w->before - w->error);
        here &= w->open;
        solved |= here;
        w->worse |= here & (w->error > w->before);
        w->open &= ~here;
        if (w->grows == REAL_INFINITY)
            continue;
        const wide last = w->alternate ? larger(w->before, w->earlier) : w->before;
        const mask converges = (w->error <= w->grows * last) | (w->error <= w->tolerated * w->size);
        w->halved = w->halved < w->halvings && any(w->open & ~converges) ? w->halved + 1 : 0;
        if (!w->halvings)
            w->open &= converges;
    }
    return solved;
}

#endif
