#include "real.h"

#ifdef REAL_VECTORS
#define WIDTH 4
#include "lanes_of_width.h"
#endif
