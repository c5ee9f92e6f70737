/* The start of a linkage: assembled from the drawing, and velocities of least kinetic energy. */
#ifndef SYMGEN_START_H
#define SYMGEN_START_H

#include <stddef.h>

#include "equations.h"

/* Kernels of a start; absent kernels are NULL. Those of lanes take one vector where those of a single linkage take a number:
   assembly and points, and what precedes them. */
struct start_kernels {
    kernel assembly;    /* residual [m] and its derivative by q, at the fraction u[0] of the path from the drawing */
    kernel points;      /* positions of all points, those that the scene draws first, and more */
    kernel constraints; /* Phi and the scale of each row */
    kernel jacobian;    /* dPhi/dq */
    kernel drift;       /* dPhi/dt at rest */
    kernel rates;       /* prescribed velocities k, and the K of their rows K u = k */
    kernel mass;        /* mass matrix */
    kernel metric;      /* of corrections; NULL for the identity */
    kernel momentum;    /* of the free points by the velocity of the ground alone */
    kernel setup;       /* quantities that depend on parameters alone, behind them */
    kernel drawn;       /* the drawn coordinates */
};

struct start_sizes {
    ptrdiff_t n, m;         /* coordinates, constraints */
    ptrdiff_t rows;         /* of the assembly */
    ptrdiff_t prescribed;   /* velocities */
    ptrdiff_t points, axes; /* positions of the points that the scene draws */
    ptrdiff_t work, out;    /* numbers of work memory and of results of the largest kernel */
    ptrdiff_t parameters, derived; /* of lanes: of the scene, and those that `setup` writes behind them */
    double tolerance;       /* assembly tolerance [m], if it exceeds `share` of the size of the linkage */
    double share;
    double size;            /* of a linkage without a drawing [m]; 0 otherwise */
};

/* The largest assembly tolerance over the size of the linkage. */
#define MOST_TOLERANCE 1e-5

/* Outcomes of a step of the assembly. OTHER_SIDE: assembled, but not on the assembly branch of the drawing. */
enum start_status { STARTED, ON_THE_WAY, UNASSEMBLED, TOO_TOLERANT, OTHER_SIDE };

struct start {
    struct start_kernels kernels;
    struct start_sizes sizes;
    const wide *p; /* owned by the caller, or those of the lanes */
    real at, step; /* fraction of the path from the drawing; the next step */
    int side;      /* of the drawing */
    int weighted;  /* whether `mass` holds the factor of the metric */
    wide *q, *u, *miss;
    real fastest;  /* the largest right-hand side of the rows of velocities */
    wide *own, *trial, *still, *change, *matrix, *right, *beta, *mass, *work, *out;
    mask *order;
};

/* Interface of starts: see core.h. Of lanes, which have parameters of their own, it has the memory and `assemble`. */
struct start_api {
    size_t start_struct;
    size_t (*bytes)(const struct start_sizes *sizes);
    /* The memory starts at a multiple of 64 bytes. */
    void (*bind)(struct start *s, const struct start_sizes *sizes, const struct start_kernels *kernels, const void *p,
                 void *memory);
    /* Assemble the linkage for a row of parameters in each lane; write rows of coordinates, and whether each is
       assembled. Every lane sees the operations of `advance` in their order, so its bits are the same. A lane fails if it
       needs shorter steps, or if its rows of the assembly, at least as many as coordinates, are dependent; the caller then
       assembles it alone. */
    void (*assemble)(struct start *s, const real *parameters, real *q, unsigned char *assembled);
    /* The size of a linkage [m] by the positions of its points: twice their largest distance from their mean, which no
       rotation changes; NaN if a position is not finite. */
    real (*size)(ptrdiff_t count, ptrdiff_t axes, const real *positions);
    /* The size of the linkage [m] at coordinates. Positions are left in s->out. */
    real (*extent)(struct start *s, const real *q);
    /* Begin at the drawn coordinates s->q. */
    void (*begin)(struct start *s);
    /* Move s->q one step along the path from the drawing to the prescribed lengths and angles; STARTED at the end. */
    int (*advance)(struct start *s);
    /* The outcome at the end of the path, at s->q: STARTED or OTHER_SIDE. */
    int (*outcome)(struct start *s);
    /* Write to s->u the velocities of least kinetic energy that satisfy the prescribed velocities and the constraints
       without the dropped ones, and to s->miss the error [m/s] of each row. Return the number of rows of constraints,
       or -1 if the mass matrix is not positive definite. */
    ptrdiff_t (*velocities)(struct start *s, const char *dropped);
};

extern const struct start_api symgen_start;

#endif
