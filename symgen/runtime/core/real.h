/* The number type of the core: double, or the type selected by a macro. */
#ifndef SYMGEN_REAL_H
#define SYMGEN_REAL_H

#include <float.h>
#include <math.h>

#if defined(SYMGEN_REAL_FLOAT32)
typedef float real;
#define REAL_NAME "float32"
#define REAL_EPSILON FLT_EPSILON
#define real_sqrt sqrtf
#define real_fabs fabsf
#define real_pow powf
#define real_cos cosf
#define real_sin sinf
#define real_atan2 atan2f
#define real_isfinite isfinite
#elif defined(SYMGEN_REAL_LONGDOUBLE)
typedef long double real;
#define REAL_NAME "longdouble"
#define REAL_EPSILON LDBL_EPSILON
#define real_sqrt sqrtl
#define real_fabs fabsl
#define real_pow powl
#define real_cos cosl
#define real_sin sinl
#define real_atan2 atan2l
#define real_isfinite isfinite
#elif defined(SYMGEN_REAL_FLOAT128)
#include <quadmath.h>
typedef __float128 real;
#define REAL_NAME "float128"
#define REAL_EPSILON FLT128_EPSILON
#define real_sqrt sqrtq
#define real_fabs fabsq
#define real_pow powq
#define real_cos cosq
#define real_sin sinq
#define real_atan2 atan2q
#define real_isfinite finiteq
#else
typedef double real;
#define REAL_NAME "float64"
#define REAL_EPSILON DBL_EPSILON
#define real_sqrt sqrt
#define real_fabs fabs
#define real_pow pow
#define real_cos cos
#define real_sin sin
#define real_atan2 atan2
#define real_isfinite isfinite
#endif

/* Vectors of doubles: the vector extension of GCC and Clang. */
#if defined(__GNUC__) && !defined(SYMGEN_REAL_FLOAT32) && !defined(SYMGEN_REAL_LONGDOUBLE) && !defined(SYMGEN_REAL_FLOAT128)
#define REAL_VECTORS
#endif

/* A constant of the core; infinity, which every type has. */
#define R(x) ((real)(x))
#define REAL_INFINITY ((real)INFINITY)

/* The larger and the smaller of two numbers; a NaN as the second is ignored. */
static inline real real_fmax(real a, real b) {
    return b > a ? b : a;
}

static inline real real_fmin(real a, real b) {
    return b < a ? b : a;
}

/* A generated kernel; its header lists the arguments that it reads. */
typedef void (*kernel)(const real *t, const real *q, const real *u, const real *p, real *work, real *out);

/* Rows are dependent if a pivot over the largest is smaller. */
#define RANK_TOLERANCE real_fmax(R(1e-9), R(100) * REAL_EPSILON)

#endif
