/* Whether stability, not accuracy, limits the steps of a motion. */
#include "run.h"

/* The test runs every STIFF_EVERY steps, and in every step while stability seems to limit the step. Stiff after STIFF_ROW
   such steps in a row; not stiff after EASY_ROW others. */
enum { STIFF_EVERY = 16 };
enum { STIFF_ROW = 15 };
enum { EASY_ROW = 6 };

int is_stiffness_due(const struct run *run) {
    const struct state *s = run->state;
    return !s->stiff && (s->stiff_row > 0 || s->steps % STIFF_EVERY == STIFF_EVERY - 1);
}

void watch_stiffness(struct run *run, real t_new, int is_limited) {
    struct state *s = run->state;
    if (is_limited) {
        s->easy_row = 0;
        if (s->stiff_row++ == 0)
            s->t_stiff = t_new;
        s->stiff = s->stiff_row == STIFF_ROW;
    } else if (s->stiff_row && ++s->easy_row == EASY_ROW) {
        s->stiff_row = s->easy_row = 0;
    }
}
