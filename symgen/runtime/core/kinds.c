/* The kinds of methods. A new kind is a file that defines it, and two lines here. */
#include "run.h"

#include <string.h>

extern const struct kind explicit_kind, rattle_kind, radau_kind, alpha_kind, collocation_kind, beam_kind, taylor_kind;

static const struct kind *const KINDS[] = {
    &explicit_kind,
    &rattle_kind,
    &radau_kind,
    &alpha_kind,
    &collocation_kind,
    &beam_kind,
    &taylor_kind,
};

const struct kind *find_kind(const char *name) {
    for (size_t i = 0; i < sizeof KINDS / sizeof *KINDS; i++)
        if (strcmp(KINDS[i]->name, name) == 0)
            return KINDS[i];
    return NULL;
}
