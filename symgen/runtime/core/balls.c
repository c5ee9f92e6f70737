#include "balls.h"

#include <math.h>
#include <string.h>

#include "loop.h"

/* Sine of the angle from a pole below which angles change to the alternative ones. */
#define NEAR_POLE R(0.1)
/* Sine of the angle from a pole above which they change back. */
#define FAR_POLE R(0.3)
/* An angle nearer to a multiple of pi than CLEAR pi has a cosine above NEAR_POLE in magnitude. */
#define CLEAR 0.465
#define RIGHT_ANGLE R(1.570796326794896619231321691639751442L)

/* -- one ball --------------------------------------------------------------------------------------------- */

/* The axes i, j, k behind a ball, the columns of r, by its angles. */
static void rotation_of(const real *x, int turned, real r[3][3]) {
    const real c = real_cos(x[0]), s = real_sin(x[0]), d = real_cos(x[1]), e = real_sin(x[1]);
    const real f = real_cos(x[2]), g = real_sin(x[2]);
    const real rows[3][3] = {
        {c * d, c * e * g - s * f, c * e * f + s * g}, {s * d, s * e * g + c * f, s * e * f - c * g}, {-e, d * g, d * f}};
    for (int k = 0; k < 3; k++) {
        r[0][k] = rows[0][k];
        r[1][k] = turned ? -rows[2][k] : rows[1][k];
        r[2][k] = turned ? rows[1][k] : rows[2][k];
    }
}

static real nearest(real x, real near) {
    const real revolution = 4 * RIGHT_ANGLE;
    return x + revolution * R(rint((double)((near - x) / revolution)));
}

/* Compute the angles of a rotation. Two triples of angles are equivalent: choose the nearer to `near`, by theta and
   eta alone if alpha is constant. */
static void angles_of(const real r[3][3], int turned, const real *near, int held, real *x) {
    const real *first = r[0], *second = r[turned ? 2 : 1], *third = r[turned ? 1 : 2], sign = turned ? -1 : 1;
    const real half = 2 * RIGHT_ANGLE;
    real other[3], by[2] = {0, 0};
    x[0] = real_atan2(second[0], first[0]);
    x[1] = real_atan2(-sign * third[0], real_sqrt(first[0] * first[0] + second[0] * second[0]));
    x[2] = held ? near[2] : real_atan2(sign * third[1], sign * third[2]);
    other[0] = x[0] + half, other[1] = half - x[1], other[2] = held ? near[2] : x[2] + half;
    for (int i = 0; i < 3; i++) {
        x[i] = nearest(x[i], near[i]);
        other[i] = nearest(other[i], near[i]);
        by[0] += real_fabs(x[i] - near[i]);
        by[1] += real_fabs(other[i] - near[i]);
    }
    for (int i = 0; i < 3 && by[1] < by[0]; i++)
        x[i] = other[i];
}

/* Sine of the angle between i behind the ball and k before it: 0 at the pole of the table's own angles. */
static real off_pole(const struct ball *b, int turned, const real *q) {
    const real c = real_cos(q[b->angles[1]]);
    if (!turned)
        return real_fabs(c);
    const real x = real_cos(q[b->angles[0]]) * c, y = real_sin(q[b->angles[1]]);
    return real_sqrt(x * x + y * y);
}

/* Whether the table's angles of a ball are away from their pole, by a test without a cosine. */
static int is_clear(const struct ball *b, const real *q) {
    const double x = (double)q[b->angles[1]] / 3.14159265358979323846;
    return fabs(x - rint(x)) < CLEAR;
}

static int is_held(const struct ball *b) {
    return b->angles[2] < 0;
}

/* -- all balls: bit k of a choice is set if ball k has its alternative angles ----------------------------- */

/* The leading angles of the balls are the parameters before the branches of switching points. */
static real *turns_of(const struct loop *l) {
    return l->base.p + l->sizes.parameters - l->sizes.switches - l->sizes.balls;
}

static unsigned choice_of(const struct loop *l) {
    unsigned choice = 0;
    for (long k = 0; k < l->sizes.balls; k++)
        choice |= (unsigned)(turns_of(l)[k] != 0) << k;
    return choice;
}

static void take(struct loop *l, unsigned choice) {
    for (long k = 0; k < l->sizes.balls; k++)
        turns_of(l)[k] = choice >> k & 1 ? RIGHT_ANGLE : 0;
    set_up(&l->base);
}

static void get(const struct ball *b, const real *q, real *x) {
    for (int i = 0; i < 3; i++)
        x[i] = b->angles[i] < 0 ? 0 : q[b->angles[i]];
}

/* c = a^T b */
static void relative(const real a[3][3], const real b[3][3], real c[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            c[i][j] = a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j];
}

/* Convert variables from the angles of one choice to those of another, of equivalent angles those nearest to the usual
   ones at the last accepted state. Behind a ball with a constant alpha the frame between the two balls is `turned` by
   this, and the next ball takes that over. */
static void write_angles(const struct loop *l, unsigned from, unsigned to, real *q) {
    real turned[3][3];
    int takes_over = 0;
    for (long k = 0; k < l->sizes.balls; k++) {
        const struct ball *b = l->balls + k;
        const int before = from >> k & 1, after = to >> k & 1;
        real x[3], beside[3], old[3][3], r[3][3];
        if (!takes_over && before == after)
            continue;
        get(b, q, x);
        get(b, l->usual, beside);
        rotation_of(x, before, r);
        if (takes_over) {
            memcpy(old, r, sizeof old);
            relative(turned, old, r);
        }
        angles_of(r, after, beside, is_held(b), x);
        for (int i = 0; i < 3; i++)
            if (b->angles[i] >= 0)
                q[b->angles[i]] = x[i];
        takes_over = is_held(b);
        if (takes_over) {
            rotation_of(x, after, old);
            relative(r, old, turned);
        }
    }
}

/* Choose the angles of every ball at variables in the angles in use. A change at one ball turns the frame before the
   next one and changes its distance from the pole. */
static unsigned choose(struct loop *l, const real *seen, int back) {
    const unsigned now = choice_of(l);
    unsigned choice = now;
    const real *q = seen;
    for (long k = 0; k < l->sizes.balls; k++) {
        const unsigned turned = now >> k & 1;
        if (!turned && choice == now && is_clear(l->balls + k, q))
            continue;
        const real off = off_pole(l->balls + k, (int)turned, q);
        const int stays = turned && !((back || choice != now) && off > FAR_POLE);
        if ((off < NEAR_POLE || stays) == (int)turned)
            continue;
        choice ^= 1u << k;
        memcpy(l->trial, seen, (size_t)l->sizes.n * sizeof(real));
        write_angles(l, now, choice, l->trial);
        q = l->trial;
    }
    return choice;
}

/* The scaled screw of a variable, evaluated last. */
static void screw_of(const struct loop *l, ptrdiff_t j, real *to) {
    for (int i = 0; i < ROWS; i++)
        to[i] = l->loads[12 + l->sizes.n * i + j] / (i < 3 ? 1 : l->size);
}

/* Write the numbers of the angles of ball k, with those of the next ball behind a constant alpha: the motion of all of
   them is the same in other angles. Return how many there are. */
static long together(const struct loop *l, long k, ptrdiff_t *numbers) {
    long count = 0;
    for (long j = k; j <= k + is_held(l->balls + k); j++)
        for (int i = 0; i < 3; i++)
            if (l->balls[j].angles[i] >= 0)
                numbers[count++] = l->balls[j].angles[i];
    return count;
}

/* Convert y to the angles of another choice, which are used from then on. */
static void rewrite(struct loop *l, unsigned choice, real *y) {
    const unsigned changed = choice_of(l) ^ choice;
    const real t = 0;
    real *u = y + l->sizes.n, motion[MOST][ROWS] = {{0}}, matrix[ROWS * MOST], x[MOST];
    ptrdiff_t numbers[6];
    struct qr factor;
    if (!changed)
        return;
    l->kernels.position(&t, y, u, l->base.p, l->work, l->loads);
    for (long k = 0; k < l->sizes.balls; k += 1 + is_held(l->balls + k))
        for (long j = together(l, k, numbers) - 1; j >= 0; j--) {
            screw_of(l, numbers[j], matrix);
            for (int i = 0; i < ROWS; i++)
                motion[k][i] += u[numbers[j]] * matrix[i];
        }
    write_angles(l, choice_of(l), choice, y);
    take(l, choice);
    l->kernels.position(&t, y, u, l->base.p, l->work, l->loads);
    for (long k = 0; k < l->sizes.balls; k += 1 + is_held(l->balls + k)) {
        const long count = together(l, k, numbers);
        long rank = 0;
        if (!(changed >> k & (is_held(l->balls + k) ? 3 : 1)))
            continue;
        for (long j = 0; j < count; j++)
            screw_of(l, numbers[j], matrix + ROWS * j);
        qr_factorise(matrix, count, &factor);
        while (rank < factor.steps
               && real_fabs(factor.r[(ROWS + 1) * rank]) > REAL_EPSILON * real_fabs(factor.r[0]))
            rank++;
        qr_solve(&factor, rank, motion[k], x);
        for (long j = 0; j < count; j++)
            u[numbers[j]] = x[j];
    }
}

int loop_rewrite(struct equations *e, const real *seen, real *y, int back) {
    struct loop *l = e->owner;
    const unsigned choice = choose(l, seen, back);
    if (!back && choice == choice_of(l))
        return 0;
    loop_usual(e, y, l->trial);
    memcpy(l->usual, l->trial, (size_t)l->sizes.n * sizeof(real));
    if (choice == choice_of(l))
        return 0;
    rewrite(l, choice, y);
    return 1;
}

void loop_usual(const struct equations *e, const real *y, real *q) {
    const struct loop *l = e->owner;
    memcpy(q, y, (size_t)l->sizes.n * sizeof(real));
    write_angles(l, choice_of(l), 0, q);
}

void loop_as_usual(struct equations *e, real *y, int release) {
    struct loop *l = e->owner;
    const unsigned choice = choice_of(l);
    rewrite(l, 0, y);
    if (!release)
        take(l, choice);
}
