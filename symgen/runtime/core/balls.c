#include "balls.h"

/* The rotation matrix and the axes of the three angles, in the frame before the ball. */
struct turns {
    real r[3][3]; /* columns: i, j, k behind the ball */
    real e[3][3]; /* rows: the axes of theta, eta, alpha */
};

static real dot(const real *a, const real *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const real *a, const real *b, real *c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* x += factor * a */
static void add(real factor, const real *a, real *x) {
    for (int i = 0; i < 3; i++)
        x[i] += factor * a[i];
}

/* Rotate a vector by 90 deg about i, or back. */
static void quarter(int back, real *v) {
    const real y = v[1];
    v[1] = back ? v[2] : -v[2];
    v[2] = back ? -y : y;
}

static void apply(const real r[3][3], const real *v, real *out) {
    for (int i = 0; i < 3; i++)
        out[i] = dot(r[i], v);
}

static void apply_transposed(const real r[3][3], const real *v, real *out) {
    for (int i = 0; i < 3; i++)
        out[i] = r[0][i] * v[0] + r[1][i] * v[1] + r[2][i] * v[2];
}

static struct turns turns_of(const real *x, int turned) {
    const real c = real_cos(x[0]), s = real_sin(x[0]), d = real_cos(x[1]), e = real_sin(x[1]);
    const real f = real_cos(x[2]), g = real_sin(x[2]);
    struct turns made = {
        {{c * d, c * e * g - s * f, c * e * f + s * g}, {s * d, s * e * g + c * f, s * e * f - c * g}, {-e, d * g, d * f}},
        {{0, 0, 1}, {-s, c, 0}, {c * d, s * d, -e}},
    };
    for (int j = 0; turned && j < 3; j++) {
        real column[3] = {made.r[0][j], made.r[1][j], made.r[2][j]};
        quarter(0, column);
        for (int i = 0; i < 3; i++)
            made.r[i][j] = column[i];
        quarter(0, made.e[j]);
    }
    return made;
}

static real nearest(real x, real near) {
    const real revolution = R(6.283185307179586476925286766559005768L);
    return x + revolution * R(rint((double)((near - x) / revolution)));
}

/* Compute the angles of a rotation. Two triples of angles are equivalent: choose the nearer to `near`, by theta and
   eta alone if alpha is constant. */
static void angles_of(const real r[3][3], int turned, const real *near, int held, real *x) {
    const real half = R(3.141592653589793238462643383279502884L);
    real rows[3][3], other[3], by[2] = {0, 0};
    for (int j = 0; j < 3; j++) {
        real column[3] = {r[0][j], r[1][j], r[2][j]};
        if (turned)
            quarter(1, column);
        for (int i = 0; i < 3; i++)
            rows[i][j] = column[i];
    }
    x[0] = real_atan2(rows[1][0], rows[0][0]);
    x[1] = real_atan2(-rows[2][0], real_sqrt(rows[0][0] * rows[0][0] + rows[1][0] * rows[1][0]));
    x[2] = held ? near[2] : real_atan2(rows[2][1], rows[2][2]);
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

/* Angular velocity from the rates of the angles. */
static void spin_of(const struct turns *t, const real *rates, real *w) {
    for (int i = 0; i < 3; i++)
        w[i] = rates[0] * t->e[0][i] + rates[1] * t->e[1][i] + rates[2] * t->e[2][i];
}

/* Velocity-dependent terms of the angular acceleration. */
static void bias_of(const struct turns *t, const real *rates, real *w) {
    real before[3], turned[3];
    for (int i = 0; i < 3; i++)
        before[i] = rates[0] * t->e[0][i];
    cross(before, t->e[1], w);
    for (int i = 0; i < 3; i++) {
        w[i] *= rates[1];
        before[i] += rates[1] * t->e[1][i];
    }
    cross(before, t->e[2], turned);
    add(rates[2], turned, w);
}

/* Rates of the angles from the angular velocity; the axis of eta is perpendicular to the other two. */
static void rates_of(const struct turns *t, const real *w, real *rates) {
    real across[3];
    cross(t->e[0], t->e[1], across);
    rates[1] = dot(t->e[1], w);
    rates[2] = dot(across, w) / dot(across, t->e[2]);
    rates[0] = dot(t->e[0], w) - rates[2] * dot(t->e[0], t->e[2]);
}

static void get(const real *from, const ptrdiff_t *at, real none, real *x) {
    for (int i = 0; i < 3; i++)
        x[i] = at[i] < 0 ? none : from[at[i]];
}

static void put(real *into, const ptrdiff_t *at, const real *x) {
    for (int i = 0; i < 3; i++)
        if (at[i] >= 0)
            into[at[i]] = x[i];
}

/* Rotations of a ball and of the next ball, before and after a change of angles. */
struct change {
    const struct ball *ball;
    struct turns from, to, next_from, next_to;
    int carries; /* the next ball takes over the spin */
};

/* Convert rates `v` to the new angles. Return the spin about i that the frame between the balls loses. w receives
   angular velocities before and after: of the ball, then of the next ball. */
static real write_rates(const struct change *c, real *v, real w[4][3]) {
    real x[3], i[3] = {c->from.r[0][0], c->from.r[1][0], c->from.r[2][0]}, seen[3];
    get(v, c->ball->angles, 0, x);
    spin_of(&c->from, x, w[0]);
    rates_of(&c->to, w[0], x);
    put(v, c->ball->angles, x);
    if (!c->carries)
        return 0;
    const real spin = x[2];
    for (int k = 0; k < 3; k++)
        w[1][k] = w[0][k] - spin * i[k];
    get(v, c->ball->next, 0, x);
    spin_of(&c->next_from, x, seen);
    apply(c->from.r, seen, w[2]);
    for (int k = 0; k < 3; k++)
        w[3][k] = w[2][k] + spin * i[k];
    apply_transposed(c->to.r, w[3], seen);
    rates_of(&c->next_to, seen, x);
    put(v, c->ball->next, x);
    return spin;
}

/* Convert accelerations `a` to the new angles, with the rates of both balls before (u0) and after (u), and the spin
   and the angular velocities w of write_rates. */
static void write_second(const struct change *c, const real *u0, const real *u, real w[4][3], real spin, real *a) {
    real x[3], rates[3], bias[3], whole[3], left[3], seen[3], i[3], turned[3];
    get(a, c->ball->angles, 0, x);
    spin_of(&c->from, x, whole);
    bias_of(&c->from, u0, bias);
    add(1, bias, whole);
    for (int k = 0; k < 3; k++)
        i[k] = c->from.r[k][0];
    cross(w[0], i, turned);
    for (int k = 0; k < 3; k++)
        left[k] = c->carries ? whole[k] - spin * turned[k] : whole[k];
    get(u, c->ball->angles, 0, rates);
    bias_of(&c->to, rates, bias);
    for (int k = 0; k < 3; k++)
        seen[k] = left[k] - bias[k];
    rates_of(&c->to, seen, x);
    put(a, c->ball->angles, x);
    if (!c->carries)
        return;
    add(-x[2], i, left);
    /* Angular acceleration of the next ball: the total of both balls is unchanged, and the frame between them
       differs. */
    add(-1, left, whole);
    cross(w[0], w[2], turned);
    add(1, turned, whole);
    cross(w[1], w[3], turned);
    add(-1, turned, whole);
    get(a, c->ball->next, 0, x);
    spin_of(&c->next_from, x, seen);
    bias_of(&c->next_from, u0 + 3, bias);
    add(1, bias, seen);
    apply(c->from.r, seen, turned);
    add(1, turned, whole);
    apply_transposed(c->to.r, whole, seen);
    get(u, c->ball->next, 0, rates);
    bias_of(&c->next_to, rates, bias);
    add(-1, bias, seen);
    rates_of(&c->next_to, seen, x);
    put(a, c->ball->next, x);
}

real ball_off_pole(const struct ball *b, int turned, const real *q) {
    const real c = real_cos(q[b->angles[1]]);
    if (!turned)
        return real_fabs(c);
    const real x = real_cos(q[b->angles[0]]) * c, y = real_sin(q[b->angles[1]]);
    return real_sqrt(x * x + y * y);
}

/* New rotation of the second ball: the inverse of the first ball's new rotation times the total rotation of both. */
static void carry_over(const struct change *c, real r[3][3]) {
    for (int j = 0; j < 3; j++) {
        const real column[3] = {c->next_from.r[0][j], c->next_from.r[1][j], c->next_from.r[2][j]};
        real whole[3], seen[3];
        apply(c->from.r, column, whole);
        apply_transposed(c->to.r, whole, seen);
        for (int i = 0; i < 3; i++)
            r[i][j] = seen[i];
    }
}

void ball_rewrite(const struct ball *b, int turned, const real *near, real *q, real *u, real *a) {
    real x[3], y[3], w[4][3], u0[6], r[3][3];
    struct change c = {.ball = b, .carries = b->next[0] >= 0};
    get(q, b->angles, R(b->alpha), x);
    c.from = turns_of(x, turned);
    get(near, b->angles, R(b->alpha), y);
    angles_of(c.from.r, !turned, y, b->angles[2] < 0, x);
    c.to = turns_of(x, !turned);
    put(q, b->angles, x);
    get(u, b->angles, 0, u0);
    if (c.carries) {
        get(q, b->next, 0, x);
        c.next_from = turns_of(x, 0);
        carry_over(&c, r);
        get(near, b->next, 0, y);
        angles_of(r, 0, y, 0, x);
        c.next_to = turns_of(x, 0);
        put(q, b->next, x);
        get(u, b->next, 0, u0 + 3);
    }
    const real spin = write_rates(&c, u, w);
    if (a)
        write_second(&c, u0, u, w, spin, a);
}
