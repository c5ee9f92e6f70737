/* The numbers `wide` and the flags `mask` of functions that have one text for a single mechanism and for lanes: vectors
 * of WIDTH doubles if a file defines this constant, otherwise single numbers. */
#ifndef WIDTH
#define WIDTH 1
#endif

#if WIDTH == 1
#include "single.h"
#else
#include "vectors.h"
#endif
