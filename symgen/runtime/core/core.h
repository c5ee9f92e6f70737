/* Interface of a core, the same for every number type.
 *
 * A core is linked into the extension symgen.runtime._core (double), or a shared library of its own that
 * exports one symbol, `symgen_core`. Scalars cross as double or long, arrays of the core's type as void *.
 */
#ifndef SYMGEN_CORE_H
#define SYMGEN_CORE_H

#include <stddef.h>

#include "elastic.h"
#include "lane_functions.h"
#include "loops.h"
#include "run.h"
#include "start.h"
#include "system.h"
#include "variations.h"

#if defined(_WIN32)
#define SYMGEN_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define SYMGEN_EXPORT __attribute__((visibility("default")))
#else
#define SYMGEN_EXPORT
#endif

/* The binding refuses a compiled core with another version. */
#define CORE_VERSION 24L

/* A run in doubles. */
struct report {
    double t, t_end, h;
    double position_drift, velocity_drift, energy_drift;
    double kinetic_min, kinetic_max, potential_min, potential_max;
    double t_stiff, t_blind;
    long steps, rejected, recorded, moved, passages, events, ended_by, worst, stiff, blind, switchings, slid;
};

struct found_event {
    double t;
    long index, rising;
};

struct core_api {
    long version;
    long real_bytes;
    double epsilon;
    const char *real_name;
    /* Set the function that long loops ask whether to end early; see equations.h. */
    void (*watch)(int (*interrupted)(void));

    const struct loops_api *loops;
    const struct elastic_api *elastic;
    const struct system_api *system;
    const struct kinematics_api *kinematics;
    const struct start_api *start;
    const struct lane_functions *(*lanes)(ptrdiff_t width);
    const struct variation_api *variations;

    /* Convert high + low to the core's type; low may be NULL. And back: low, if not NULL, receives the remainder. */
    void (*widen)(long count, const double *high, const double *low, void *reals);
    void (*narrow)(long count, const void *reals, double *high, double *low);

    /* Call one kernel for rows of (t, y, work) with these strides in reals; a stride of 0 repeats one row of work. */
    void (*call_rows)(kernel function, long rows, const void *t, const void *y, long y_stride, long n,
                      const void *p, void *work, long work_stride, void *out, long out_stride);

    size_t equations_struct, run_struct;
    size_t (*equations_bytes)(const struct sizes *sizes);
    void (*equations_bind)(struct equations *e, const struct sizes *sizes, const struct kernels *kernels,
                           void *memory);
    /* Set parameters (high + low) and compute the quantities that depend on them alone. */
    void (*set_parameters)(struct equations *e, const double *high, const double *low);
    /* Accelerations, multipliers and couples at rows of y: n + m + sizes.couples reals per row of `out`. */
    void (*solve_rows)(struct equations *e, long rows, const void *t, const void *y, long y_stride, void *out,
                       long out_stride);
    int (*check)(struct equations *e, double t, const void *y);
    void (*derivative)(struct equations *e, double t, const void *y, void *dy);

    const struct kind *(*find_kind)(const char *name);
    size_t (*run_bytes)(const struct equations *e, const struct scheme *scheme, const struct task *task);
    void (*run_bind)(struct run *run, struct equations *e, const struct scheme *scheme, const struct task *task,
                     void *memory);
    /* Set the start: y0 and times in doubles (low parts or NULL), directions and terminal of the events. */
    void (*run_start)(struct run *run, const double *y0, const double *y0_low, const double *times,
                      const signed char *directions, const char *terminal);
    void (*run_set_nodes)(struct run *run, const double *nodes, const long *counts);
    int (*run_valid)(const struct run *run);
    int (*run_begin)(struct run *run);
    void (*run_extend)(struct run *run, double t_end);
    int (*run_restart)(struct run *run, int moves);
    void (*run_record)(struct run *run);
    int (*run_advance)(struct run *run, long most);
    void (*run_report)(const struct run *run, struct report *report);
    const void *(*run_state)(const struct run *run);     /* y, dim reals */
    /* Copy the recorded events or passages (states in reals) and clear the record; return their number. */
    long (*take_events)(struct run *run, struct found_event *events, void *states);
    long (*take_passages)(struct run *run, struct passage *passages);
};

extern SYMGEN_EXPORT const struct core_api symgen_core;

#endif
