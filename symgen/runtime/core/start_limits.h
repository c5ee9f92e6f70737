/* Limits of the steps from the drawing of a linkage. */
#ifndef SYMGEN_START_LIMITS_H
#define SYMGEN_START_LIMITS_H

/* First and longest step along the path from the drawing, over the path. */
#define LONGEST_STEP (R(1) / 32)
/* Shortest step, over the part of the path that is done. */
#define SHORTEST_STEP (R(1) / 4096)
/* Step over the path below which the assembly fails. Squares of lengths grow along the path: where they grow by orders
   of magnitude, its first steps are tiny. */
#define LEAST_STEP R(1e-15)
/* Round-off over the size of the linkage. */
#define ROUNDING R(1e-14)
enum { ASSEMBLY_ITERATIONS = 30 };

#endif
