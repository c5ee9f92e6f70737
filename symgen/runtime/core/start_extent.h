/* The size of a linkage in numbers of the type NUMBER, `real` or a vector. The including file defines NUMBER, ROOT, and
   LARGEST, the largest magnitude of some numbers or NaN. */
#include <string.h>

/* Twice the largest distance of points from their mean, which no rotation changes. */
static NUMBER size_of_points(ptrdiff_t count, ptrdiff_t axes, const NUMBER *positions) {
    NUMBER squares[2], mean[3]; /* the largest square of a distance, and that of a point */
    memset(squares, 0, sizeof squares);
    memset(mean, 0, sizeof mean);
    for (ptrdiff_t i = 0; i < count; i++)
        for (ptrdiff_t axis = 0; axis < axes; axis++)
            mean[axis] += positions[i * axes + axis] / (real)count;
    for (ptrdiff_t i = 0; i < count; i++) {
        memset(squares + 1, 0, sizeof *squares);
        for (ptrdiff_t axis = 0; axis < axes; axis++) {
            const NUMBER apart = positions[i * axes + axis] - mean[axis];
            squares[1] += apart * apart;
        }
        squares[0] = LARGEST(squares, 2);
    }
    return 2 * ROOT(squares[0]);
}
