/* Fixed implicit steps of the elastic motion: one linear system per step, for a batch of states. */
#ifndef SYMGEN_BEAM_STEPS_H
#define SYMGEN_BEAM_STEPS_H

#include "beams.h"

/* A method: collocation at `stages` nodes, or, with none, one with accelerations at both ends of the step h.
 *
 * A collocation has a and a a (stages squared), the weights b and b a, and the nodes c. Other methods satisfy the
 * equation at the fraction `at` of the step, where S'' = inertia . (S''_0, S''_1), S' = S'_0 + h rate . (S''_0,
 * S''_1) and S = S_0 + at h S'_0 + h^2 place . (S''_0, S''_1); the step ends by Newmark's formulas with gamma and
 * beta. */
struct beam_scheme {
    long stages;
    double at, gamma, beta;
    double inertia[2], rate[2], place[2];
    const double *a, *aa, *b, *ba, *c;
};

struct beam_steps {
    struct beams *b;
    struct beam_scheme scheme;
    long columns, stages; /* states of the batch, of which the first is loaded; stored stages, one or more */
    real *a, *aa, *weights, *weights_a, *nodes;
    real *by_rate, *by_place; /* weights of the accelerations at all stages in S' and S, a row for each stage */
    real *of_entry;           /* one entry of the matrices at all stages */
    real *mass, *damping, *stiffness, *load, *forces; /* one row per stage */
    /* The system of all stages: within each unknown, one entry per stage. Each damped mode adds an unknown, the rate
       f S' + g S. */
    struct bordered system;
    real *rhs;
    real *s, *v, *acc; /* S, S', S'' of all unknowns, rows of `columns` */
    real *p, *pv, *pa; /* the same of the independent unknowns */
};

/* Bytes of memory, without the struct itself. */
size_t beam_steps_bytes(const struct beams *b, const struct beam_scheme *scheme, long columns);

/* Fill in over zeroed memory of that size. */
void beam_steps_bind(struct beam_steps *steps, struct beams *b, const struct beam_scheme *scheme, long columns,
                     void *memory);

/* Start from the states in s and v at a time. */
int beam_steps_start(struct beam_steps *steps, real t);

/* Take `count` steps from t0 to t1; *done counts them. Returns DONE or the status of the failure. */
int beam_steps_advance(struct beam_steps *steps, real t0, real t1, long count, long *done);

/* Take a part of these steps: from number `from` to before number `to`. */
int beam_steps_part(struct beam_steps *steps, real t0, real t1, long count, long from, long to, long *done);

#endif
