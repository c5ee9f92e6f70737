/* Changes of coordinates between steps, for equations with alternative coordinates. */
#include "run.h"

#include <string.h>

/* Restart the method from y in the new coordinates. */
static void begin_again(struct run *run) {
    run->scheme.kind->begin(run);
    memcpy(run->y_old, run->y, (size_t)run->dim * sizeof(real));
}

int rewritten(struct run *run, real h) {
    struct equations *e = run->e;
    for (int k = 1; e->sizes.choices && k <= SWITCH_PROBES / 2; k++) {
        const real part = R(2 * k) / R(SWITCH_PROBES);
        if (run->scheme.kind->places)
            run->scheme.kind->places(run, part * h, run->stage);
        else
            hermite(run, h, part, run->stage);
        if (e->of->rewrite(e, run->stage, run->y, 0)) {
            begin_again(run);
            if (run->scheme.adaptive)
                run->state->h = h;
            return 1;
        }
    }
    return 0;
}

void rewrite_back(struct run *run) {
    if (run->e->sizes.choices && run->e->of->rewrite(run->e, run->y, run->y, 1))
        begin_again(run);
}

void release_choices(struct run *run) {
    if (run->e->sizes.choices)
        run->e->of->as_usual(run->e, run->y, 1);
}
