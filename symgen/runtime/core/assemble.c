/* The first closure of a loop by Levenberg's damped least squares, from any start and for screws of any rank.
 *
 * An open loop has a defect of rotation R and of displacement p. The steps x = A^T (A A^T + damping)^-1 b decrease |R
 * - 1|^2/2 + |p|^2. The damping falls with the defect, so that steps become Gauss-Newton steps of minimum norm.
 * Source: J. Nocedal and S. J. Wright, Numerical Optimization, 10.3.
 */
#include <string.h>

#include "linear.h"
#include "loop.h"

/* Newton's method starts below this defect. */
#define CLOSE real_sqrt(REAL_EPSILON)
/* Damping at the start, over the square of the defect. */
#define DAMPING R(0.01)
/* Damping at which the search ends, over the square of the defect. */
#define HOPELESS R(1e12)
/* Decrease of the square of the defect in a step, over it, below which the step is idle. */
#define DECREASE R(1e-3)
/* Damping of an idle step, over the square of the defect: less of it does not decrease the defect further. */
#define FREE R(1e-6)
/* Most steps. */
enum { STEPS = 200 };
/* Idle steps in a row that show a minimum. */
enum { IDLE = 4 };

/* Evaluate the loop at q: scaled screws into the columns of l->matrix, the closure error into b; return its square. */
static real missing(struct loop *l, real t, const real *q, real *b) {
    const long n = l->sizes.n;
    const real *e = l->screws;
    real total = 0;
    l->revision = 0;
    l->kernels.position(&t, q, l->u, l->base.p, l->work, l->screws);
    const real p[3] = {e[3], e[7], e[11]};
    for (int i = 0; i < 12; i++)
        total += i % 4 == 3 ? e[i] / l->size * (e[i] / l->size) : R(0.5) * e[i] * e[i];
    b[0] = R(-0.5) * (e[9] - e[6]);
    b[1] = R(-0.5) * (e[2] - e[8]);
    b[2] = R(-0.5) * (e[4] - e[1]);
    for (int i = 0; i < 3; i++)
        b[3 + i] = -p[i] / l->size;
    for (long k = 0; k < l->sizes.solved; k++) {
        const long j = l->solved[k];
        real s[ROWS], *column = l->matrix + ROWS * k;
        for (int i = 0; i < ROWS; i++)
            s[i] = e[12 + n * i + j] * l->scale[j];
        for (int i = 0; i < 3; i++) {
            const int y = (i + 1) % 3, z = (i + 2) % 3;
            column[i] = s[i];
            column[3 + i] = (s[3 + i] + s[y] * p[z] - s[z] * p[y]) / l->size;
        }
    }
    return total;
}

/* Write (A A^T + damping)^-1 b into y, by Cholesky's method. */
static void damped(const struct loop *l, real damping, const real *b, real *y) {
    real h[ROWS * ROWS];
    for (int i = 0; i < ROWS; i++)
        for (int k = 0; k <= i; k++) {
            real total = i == k ? damping : 0;
            for (long j = 0; j < l->sizes.solved; j++)
                total += l->matrix[ROWS * j + i] * l->matrix[ROWS * j + k];
            h[ROWS * i + k] = total;
        }
    factor_positive(ROWS, h, 0, damping);
    memcpy(y, b, ROWS * sizeof *y);
    solve_positive(ROWS, h, y);
}

int loop_assemble(struct loop *l, real t, real *q, long *rank) {
    const size_t row = (size_t)l->sizes.n * sizeof(real);
    real b[ROWS], y[ROWS], ratio = DAMPING, *next = l->trial;
    int idle = 0;
    loop_prescribe(l, t, q);
    memcpy(next, q, row);
    real left = missing(l, t, q, b);
    for (int k = 0; k < STEPS && left > CLOSE * CLOSE && real_isfinite(left) && ratio < HOPELESS && idle < IDLE; k++) {
        damped(l, real_fmax(ratio * left, R(4) * REAL_EPSILON), b, y);
        for (long i = 0; i < l->sizes.solved; i++)
            next[l->solved[i]] = q[l->solved[i]] + l->scale[l->solved[i]] * qr_dot(l->matrix + ROWS * i, y);
        real c[ROWS];
        const real found = missing(l, t, next, c);
        if (found < left) {
            idle = left - found < DECREASE * left && ratio < FREE ? idle + 1 : 0;
            memcpy(q, next, row);
            memcpy(b, c, sizeof b);
            left = found;
            ratio *= R(0.1);
        } else {
            missing(l, t, q, b);
            ratio *= R(10);
        }
    }
    const real defect = loop_evaluate(l, t, q);
    const struct qr *f = &l->factor;
    for (*rank = 0; *rank < f->steps; ++*rank)
        if (!(real_fabs(f->r[(ROWS + 1) * *rank]) > R(10) * CLOSE * real_fabs(f->r[0])))
            break;
    return !real_isfinite(defect) ? NOT_FINITE : left <= CLOSE * CLOSE ? DONE : OPEN;
}
