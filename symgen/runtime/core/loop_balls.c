/* The choice of angles of a loop's ball joints in a run: see balls.h. */
#include <math.h>
#include <string.h>

#include "loop.h"

/* Sine of the angle from a pole below which angles change to the alternative ones, and above which they change back.
   */
#define NEAR_POLE R(0.1)
#define FAR_POLE R(0.3)
/* An angle nearer to a multiple of pi than CLEAR pi has a cosine above NEAR_POLE in magnitude. */
#define CLEAR 0.465
#define RIGHT_ANGLE R(1.570796326794896619231321691639751442L)

/* The leading angles of the balls are the parameters before the branches of switching points. */
static real *turn_of(const struct loop *l, long k) {
    return l->base.p + l->sizes.parameters - l->sizes.switches - l->sizes.balls + k;
}

/* Whether the table's angles of a ball are away from their pole, by a test without a cosine. */
static int is_clear(const struct ball *b, const real *q) {
    const double x = (double)q[b->angles[1]] / 3.14159265358979323846;
    return fabs(x - rint(x)) < CLEAR;
}

static int is_turned(const struct loop *l, long k) {
    return *turn_of(l, k) != 0;
}

/* Use the angles that these leading angles of the balls select. */
static void take(struct loop *l, const char *turned) {
    for (long k = 0; k < l->sizes.balls; k++)
        *turn_of(l, k) = turned[k] ? RIGHT_ANGLE : 0;
    set_up(&l->base);
}

/* Convert a state from the angles in use to those of the table; the last ball comes first. */
static void to_table(const struct loop *l, const real *near, real *q, real *u, real *a) {
    for (long k = l->sizes.balls - 1; k >= 0; k--)
        if (is_turned(l, k))
            ball_rewrite(l->balls + k, 1, near, q, u, a);
}

/* Convert a state from the table's angles to those in use. */
static void from_table(const struct loop *l, real *q, real *u) {
    for (long k = 0; k < l->sizes.balls; k++)
        if (is_turned(l, k))
            ball_rewrite(l->balls + k, 0, q, q, u, NULL);
}

/* Choose the angles of every ball at a state, given in the angles in use; return whether any choice changes. A change
   at one ball rotates the frame before the next one and changes its distance from the pole. */
static int choose(struct loop *l, const real *seen, int back, char *turned) {
    const long n = l->sizes.n;
    real *q = l->near_y, *u = q + n;
    int changed = 0;
    for (long k = 0; k < l->sizes.balls; k++) {
        const int now = is_turned(l, k);
        turned[k] = 0;
        if (!now && !changed && is_clear(l->balls + k, seen))
            continue;
        const real off = ball_off_pole(l->balls + k, changed ? 0 : now, changed ? q : seen);
        turned[k] = now && !changed ? !(back && off > FAR_POLE) : off < NEAR_POLE;
        if (turned[k] != now && !changed) {
            changed = 1;
            memcpy(q, seen, (size_t)n * sizeof(real));
            memset(u, 0, (size_t)n * sizeof(real));
            to_table(l, l->usual, q, u, NULL);
            for (long j = 0; j < k; j++)
                if (turned[j])
                    ball_rewrite(l->balls + j, 0, q, q, u, NULL);
        }
        if (changed && turned[k])
            ball_rewrite(l->balls + k, 0, q, q, u, NULL);
    }
    return changed;
}

int loop_rewrite(struct equations *e, const real *seen, real *y, int back) {
    struct loop *l = e->owner;
    const long n = l->sizes.n;
    int any = 0;
    char turned[MOST];
    for (long k = 0; k < l->sizes.balls; k++)
        any |= is_turned(l, k);
    const int changed = choose(l, seen, back, turned);
    if (!back && !changed)
        return 0;
    memcpy(l->trial, y, (size_t)n * sizeof(real));
    memcpy(l->step, y + n, (size_t)n * sizeof(real));
    if (any)
        to_table(l, l->usual, l->trial, l->step, NULL);
    memcpy(l->usual, l->trial, (size_t)n * sizeof(real));
    if (!changed)
        return 0;
    take(l, turned);
    from_table(l, l->trial, l->step);
    memcpy(y, l->trial, (size_t)n * sizeof(real));
    memcpy(y + n, l->step, (size_t)n * sizeof(real));
    return 1;
}

void loop_as_usual(const struct equations *e, real *y) {
    const struct loop *l = e->owner;
    to_table(l, l->usual, y, y + l->sizes.n, NULL);
}

void loop_in_table(const struct loop *l, const real *near, real *q, real *u, real *a) {
    to_table(l, near, q, u, a);
}

int loop_turn_near(struct loop *l, const real *y) {
    const long n = l->sizes.n;
    char turned[MOST];
    for (long k = 0; k < l->sizes.balls; k++)
        if (is_turned(l, k))
            return 0;
    if (!choose(l, y, 0, turned))
        return 0;
    memcpy(l->near_y, y, (size_t)(2 * n) * sizeof(real));
    memcpy(l->usual, y, (size_t)n * sizeof(real));
    take(l, turned);
    from_table(l, l->near_y, l->near_y + n);
    return 1;
}

void loop_turn_back(struct loop *l, real *a) {
    const char none[MOST] = {0};
    to_table(l, l->usual, l->near_y, l->near_y + l->sizes.n, a);
    take(l, none);
}
