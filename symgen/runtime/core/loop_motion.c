/* Equations of motion of a loop under forces, solved for dependent and free variables: `loop_behaviour`. */
#include <math.h>
#include <string.h>

#include "linear.h"
#include "loop.h"

/* Least singular value at which steps may end, over the largest. */
#define BLURRED 1e-4
/* The same over that of the best pose so far. */
#define BLURRED_PART 1e-2
/* Least inertia of a free motion over the sum of its terms. */
#define NO_MASS (R(450) * REAL_EPSILON)

static struct loop *of(struct equations *e) {
    return e->owner;
}

/* Judge the rank of the last screws and set the soundness, which a run watches: the square of the least pivot over
   the first, comparable with the pivots of a matrix times its transpose. Steps do not end at poses in which rates and
   accelerations have no correct digits. */
static int judge(struct equations *e) {
    struct loop *l = of(e);
    const double part = e->account->soundness;
    l->soundest = fmax(l->soundest, part);
    e->account->soundness = part * part;
    return part <= fmax(e->sizes.rank_tolerance, fmin(BLURRED, BLURRED_PART * l->soundest)) ? SINGULAR : DONE;
}

/* Factorise the screws at y, with the inputs at their prescribed values. */
static int factorise_loop(struct equations *e, real t, const real *y) {
    struct loop *l = of(e);
    memcpy(l->q, y, (size_t)l->sizes.n * sizeof(real));
    loop_prescribe(l, t, l->q);
    if (!real_isfinite(loop_evaluate(l, t, l->q)))
        return NOT_FINITE;
    return judge(e);
}

/* Write the free motions of the closed loop, over all variables, to `basis`: rows of n + 1. */
static void span(struct loop *l) {
    const long n = l->sizes.n, rank = l->sizes.rank;
    const struct qr *f = &l->factor;
    for (long g = 0; g < l->free; g++) {
        real c[ROWS], *row = l->basis + (n + 1) * g;
        for (long k = 0; k < n; k++)
            row[k] = 0;
        for (long i = 0; i < rank; i++)
            c[i] = -f->r[ROWS * (rank + g) + i];
        for (long i = rank - 1; i >= 0; i--) {
            c[i] /= f->r[ROWS * i + i];
            for (long k = 0; k < i; k++)
                c[k] -= f->r[ROWS * i + k] * c[i];
        }
        for (long i = 0; i < rank; i++)
            row[l->solved[f->order[i]]] = c[i] * l->scale[l->solved[f->order[i]]];
        row[l->solved[f->order[rank + g]]] = l->scale[l->solved[f->order[rank + g]]];
    }
}

/* The inertia that the kernel `inverse` wrote last. */
static const real *inertia_of(const struct loop *l) {
    return l->loads + l->sizes.n;
}

/* Assemble the equations of the free motions: inertia (lower part) into r, the right-hand side behind it. */
static void reduce(struct loop *l) {
    const long n = l->sizes.n, d = l->free;
    const real *mass = inertia_of(l);
    real *r = l->reduced, *z = r + d * d;
    for (long i = 0; i < d; i++) {
        const real *row = l->basis + (n + 1) * i;
        for (long j = 0; j < n; j++) {
            real total = 0;
            for (long k = 0; k < n; k++)
                total += mass[n * j + k] * row[k];
            l->step[j] = total;
        }
        for (long k = 0; k <= i; k++) {
            real total = 0;
            for (long j = 0; j < n; j++)
                total += l->basis[(n + 1) * k + j] * l->step[j];
            r[d * i + k] = total;
        }
        z[i] = 0;
        for (long j = 0; j < n; j++)
            z[i] += row[j] * (l->efforts[j] - l->loads[j]);
    }
}

/* Solve them; false if a free motion has no mass. */
static int balance(struct loop *l) {
    const ptrdiff_t d = l->free, made = factor_positive(d, l->reduced, NO_MASS, -REAL_INFINITY);
    if (made < d) {
        l->base.account->weakest = l->solved[l->factor.order[l->sizes.rank + made]];
        return 0;
    }
    solve_positive(d, l->reduced, l->reduced + d * d);
    return 1;
}

/* Leave accelerations and the closing wrench in e->out. */
static void accelerate_loop(struct equations *e, real t, const real *y) {
    struct loop *l = of(e);
    const long n = l->sizes.n;
    real b[MOST], *q = l->q, *u = l->u, *a = e->out;
    factorise_loop(e, t, y);
    memcpy(u, y + n, (size_t)n * sizeof(real));
    for (long k = 0; k < l->sizes.inputs; k++)
        u[l->driven[k]] = l->prescribed[3 * k + 1];
    l->kernels.motion(&t, q, u, e->p, l->work, l->loads);
    loop_changes(l, 2, l->loads + ROWS * n, b, a);
    l->kernels.inverse(&t, q, u, e->p, a, l->loads);
    memset(l->efforts, 0, (size_t)n * sizeof(real));
    l->kernels.given(&t, q, u, e->p, a, l->efforts);
    if (l->free) {
        const real *found = l->reduced + l->free * l->free, *mass = inertia_of(l);
        span(l);
        reduce(l);
        if (!balance(l)) {
            a[0] = REAL_INFINITY;
            return;
        }
        for (long j = 0; j < n; j++) {
            real total = 0;
            for (long k = 0; k < l->free; k++)
                total += l->basis[(n + 1) * k + j] * found[k];
            a[j] += total;
            l->step[j] = total;
        }
        for (long i = 0; i < n; i++)
            for (long j = 0; j < n; j++)
                l->loads[i] += mass[n * i + j] * l->step[j];
    }
    for (long k = 0; k < l->sizes.solved; k++)
        b[k] = l->efforts[l->solved[k]] - l->loads[l->solved[k]];
    loop_hold(l, b, a + n);
}

/* Write the unit screws of the meeting frame, about its axes and along them, in the first frame: the columns of 6 x 6. */
static void units_of_meeting(const struct loop *l, real *units) {
    const real *frame = l->screws + 12 + ROWS * l->sizes.n;
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const real axis = frame[4 * i + c];
            units[ROWS * i + c] = units[ROWS * (3 + i) + 3 + c] = axis;
            units[ROWS * i + 3 + c] = 0;
            units[ROWS * (3 + i) + c] = frame[4 * j + 3] * frame[4 * k + c] - frame[4 * k + 3] * frame[4 * j + c];
        }
}

/* Write the changes of all variables that close unit errors of closure, n rows of ROWS; times efforts, transposed, they are
   the closing wrench: its moment, then its force. */
static void closing_changes(const struct loop *l, real *changes) {
    const struct qr *f = &l->factor;
    real b[ROWS][ROWS] = {{0}};
    memset(changes, 0, (size_t)(ROWS * l->sizes.n) * sizeof(real));
    for (int c = 0; c < ROWS; c++)
        b[c][c] = c < 3 ? 1 : 1 / l->size;
    for (long k = 0; k < f->steps; k++) { /* all columns of b side by side, each as by qr_solve */
        const real *v = f->vectors + ROWS * k;
        real total[ROWS];
        for (int c = 0; c < ROWS; c++)
            total[c] = f->beta[k] * ((v[0] * b[0][c] + v[1] * b[1][c]) + (v[2] * b[2][c] + v[3] * b[3][c])
                                     + (v[4] * b[4][c] + v[5] * b[5][c]));
        for (int i = 0; i < ROWS; i++)
            for (int c = 0; c < ROWS; c++)
                b[i][c] -= total[c] * v[i];
    }
    for (long k = l->sizes.rank - 1; k >= 0; k--) {
        const long j = l->solved[f->order[k]];
        for (int c = 0; c < ROWS; c++)
            b[k][c] /= f->r[ROWS * k + k];
        for (long i = 0; i < k; i++)
            for (int c = 0; c < ROWS; c++)
                b[i][c] -= f->r[ROWS * k + i] * b[k][c];
        for (int c = 0; c < ROWS; c++)
            changes[ROWS * j + c] = b[k][c] * l->scale[j];
    }
}

/* As loop_answer, with these changes. */
static void answer_with(const struct loop *l, const real *changes, real *answer) {
    const long n = l->sizes.n, d = l->free, row = ROWS + n;
    real push[MOST * ROWS], pushed[MOST * ROWS], found[MOST * (ROWS + MOST)];
    memset(answer, 0, (size_t)(n * row) * sizeof(real));
    for (long j = 0; j < n; j++)
        for (int c = 0; c < ROWS; c++)
            answer[row * j + c] = -changes[ROWS * j + c];
    multiply_dense(n, n, ROWS, inertia_of(l), n, changes, push);
    multiply_dense(d, n, ROWS, l->basis, n + 1, push, pushed);
    for (long c = 0; c < row; c++) {
        real x[MOST];
        for (long i = 0; i < d; i++)
            x[i] = c < ROWS ? -pushed[ROWS * i + c] : l->basis[(n + 1) * i + c - ROWS];
        solve_positive(d, l->reduced, x);
        for (long i = 0; i < d; i++)
            found[row * i + c] = x[i];
    }
    for (long i = 0; i < d; i++)
        for (long j = 0; j < n; j++)
            add_multiple(row, -l->basis[(n + 1) * i + j], found + row * i, answer + row * j);
}

void loop_answer(struct loop *l, real *answer) {
    real changes[MOST * ROWS];
    closing_changes(l, changes);
    answer_with(l, changes, answer);
}

/* Write the accelerations (n) due to a unit acceleration of input c, by the answer. */
static void of_input(const struct loop *l, const real *answer, long c, long stride, real *a) {
    const long n = l->sizes.n;
    for (long j = 0; j < n; j++, a += stride, answer += ROWS + n) {
        *a = j == c;
        for (int i = 0; i < ROWS; i++)
            *a += answer[i] * l->screws[12 + n * i + c];
        for (long k = 0; k < n; k++)
            *a += answer[ROWS + k] * inertia_of(l)[n * k + c];
    }
}

/* Whether the kernel of power series takes the motion of unit inertia: see one_freedom. */
static int has_one_freedom(const struct loop *l) {
    return l->free == 1 && l->sizes.inputs == 0;
}

/* Write to e->factors, of one freedom: the free motion c of unit inertia; the speed; and the inverse of the matrix of the
   inertia along and of the accelerations of closure in the meeting frame, column by column. Of motions that are not closed,
   the inertia is that of a motion with c on its left, since links behind the meeting point move by their own path. */
static void one_freedom(const struct loop *l, const real *u, real inertia, real *factors) {
    const long n = l->sizes.n;
    const real size = real_sqrt(inertia);
    real changes[MOST * ROWS], units[ROWS * ROWS], closed[MOST * ROWS], momentum[MOST], *column = factors + n + 1;
    for (long j = 0; j < n; j++)
        factors[j] = l->basis[j] / size;
    multiply_dense(1, n, n, factors, n, inertia_of(l), momentum);
    factors[n] = 0;
    for (long j = 0; j < n; j++)
        factors[n] += momentum[j] * u[j], column[j] = R(0.5) * factors[j];
    closing_changes(l, changes);
    units_of_meeting(l, units);
    multiply_dense(n, ROWS, ROWS, changes, ROWS, units, closed);
    for (int c = 0; c < ROWS; c++) {
        real part = 0;
        column += n;
        for (long j = 0; j < n; j++)
            part += momentum[j] * closed[ROWS * j + c];
        for (long j = 0; j < n; j++)
            column[j] = closed[ROWS * j + c] - part * factors[j];
    }
}

/* Write the inverse of the matrix of accelerations and closing wrench to e->factors, column by column. Its rows are the
   efforts of variables, for inputs their accelerations, and the accelerations of closure in the meeting frame. */
static int invert_loop(struct equations *e, real t, const real *y) {
    struct loop *l = of(e);
    const long n = l->sizes.n, row = ROWS + n;
    real changes[MOST * ROWS], turned[ROWS * MOST], units[ROWS * ROWS], wrenches[ROWS * (ROWS + MOST)];
    real answer[MOST * (ROWS + MOST)], a[MOST * (ROWS + MOST)], left[MOST * ROWS], inertia[ROWS * MOST];
    const int status = factorise_loop(e, t, y);
    if (status != DONE)
        return status;
    memset(e->out, 0, (size_t)n * sizeof(real));
    l->kernels.inverse(&t, l->q, y + n, e->p, e->out, l->loads);
    memcpy(l->efforts, l->loads, (size_t)n * sizeof(real));
    span(l);
    reduce(l);
    const real along = l->reduced[0];
    if (!balance(l))
        return NOT_FINITE;
    if (has_one_freedom(l)) {
        one_freedom(l, y + n, along, e->factors);
        return DONE;
    }
    closing_changes(l, changes);
    answer_with(l, changes, answer);
    units_of_meeting(l, units);
    multiply_dense(n, ROWS, ROWS, answer, row, units, left);
    for (long j = 0; j < n; j++) {
        for (long c = 0; c < n; c++)
            a[row * j + c] = -answer[row * j + ROWS + c];
        for (int c = 0; c < ROWS; c++)
            a[row * j + n + c] = -left[ROWS * j + c], turned[n * c + j] = changes[ROWS * j + (c + 3) % ROWS];
    }
    for (long k = 0; k < l->sizes.inputs; k++)
        of_input(l, answer, l->driven[k], row, a + l->driven[k]);
    multiply_dense(ROWS, n, n, turned, n, inertia_of(l), inertia);
    multiply_dense(ROWS, n, row, inertia, n, a, wrenches);
    for (int i = 0; i < ROWS; i++)
        for (long c = 0; c < row; c++)
            wrenches[row * i + c] = (c < n ? turned[n * i + c] : 0) - wrenches[row * i + c];
    for (long c = 0; c < row; c++) {
        real *column = e->factors + row * c;
        for (long j = 0; j < n; j++)
            column[j] = a[row * j + c];
        for (int i = 0; i < ROWS; i++)
            column[n + i] = wrenches[row * i + c];
    }
    return DONE;
}

/* The rate of closure (6) due to rates v of all variables, with the last screws. */
static void closing(const struct loop *l, const real *v, real *b) {
    const long n = l->sizes.n;
    for (int i = 0; i < ROWS; i++) {
        b[i] = 0;
        for (long j = 0; j < n; j++)
            b[i] += l->screws[12 + n * i + j] * v[j];
    }
}

/* The defect of closure [m]; `worst` is the entry (of 3 x 4) of largest error. */
static real position_error_loop(struct equations *e, real t, const real *y) {
    const struct loop *l = of(e);
    const real defect = loop_evaluate(of(e), t, y);
    e->account->worst = 0;
    for (long i = 1; i < 12; i++)
        if (real_fabs(l->screws[i]) / (i % 4 == 3 ? l->size : 1)
            > real_fabs(l->screws[e->account->worst]) / (e->account->worst % 4 == 3 ? l->size : 1))
            e->account->worst = i;
    return l->size * defect;
}

/* The largest rate of closure [m/s], with the screws of the last position_error. */
static real velocity_error_loop(struct equations *e, real t, const real *y) {
    const struct loop *l = of(e);
    real b[ROWS], worst = 0;
    (void)t;
    closing(l, y + l->sizes.n, b);
    for (int i = 0; i < ROWS; i++)
        worst = real_fmax(worst, real_fabs(b[i]) * (i < 3 ? l->size : 1));
    return worst;
}

/* Subtract from v the part that violates closure, with the last factor. */
static void close_rates(struct loop *l, real *v) {
    real b[ROWS], x[MOST];
    closing(l, v, b);
    for (int i = 0; i < ROWS; i++)
        b[i] = -b[i];
    loop_solve(l, l->sizes.rank, b, x);
    for (long k = 0; k < l->sizes.solved; k++)
        v[l->solved[k]] += x[k];
}

/* Project positions and rates onto closure, with prescribed inputs. */
static int project_loop(struct equations *e, real t, real *y) {
    struct loop *l = of(e);
    const int status = loop_close(l, t, y);
    if (status != DONE)
        return status == OPEN ? PROJECTION_FAILED : status;
    if (judge(e) != DONE)
        return SINGULAR;
    for (long k = 0; k < l->sizes.inputs; k++)
        y[l->sizes.n + l->driven[k]] = l->prescribed[3 * k + 1];
    close_rates(l, y + l->sizes.n);
    return DONE;
}

/* Subtract from a change of q or of u the part that violates closure, with constant inputs and the last factor. */
static void make_tangent_loop(struct equations *e, real t, const real *y, real *change) {
    struct loop *l = of(e);
    (void)t;
    (void)y;
    for (long k = 0; k < l->sizes.inputs; k++)
        change[l->driven[k]] = 0;
    close_rates(l, change);
}

/* Leave kinetic and potential energy, and the power of loads without potential, in e->energies.
 * The power is not valid: it needs the closing wrench, which is not computed here. */
static void measure_energy_loop(struct equations *e, real t, const real *y) {
    of(e)->kernels.energy(&t, y, y + e->n, e->p, e->out, e->energies);
}

/* dy/dt; the power of loads without potential uses the closing wrench of accelerate_loop. */
static void derivative_loop(struct equations *e, real t, const real *y, real *dy) {
    const long n = e->n;
    accelerate_loop(e, t, y);
    memcpy(dy, y + n, (size_t)n * sizeof(real));
    memcpy(dy + n, e->out, (size_t)n * sizeof(real));
    if (e->extra) {
        measure_energy_loop(e, t, y);
        dy[2 * n] = e->energies[2];
    }
    e->account->evaluations++;
}

const struct behaviour loop_behaviour = {
    .accelerate = accelerate_loop,
    .derivative = derivative_loop,
    .position_error = position_error_loop,
    .velocity_error = velocity_error_loop,
    .factorise = factorise_loop,
    .prepare_series = invert_loop,
    .project = project_loop,
    .make_tangent = make_tangent_loop,
    .measure_energy = measure_energy_loop,
    .rewrite = loop_rewrite,
    .usual = loop_usual,
    .as_usual = loop_as_usual,
    .rounding = 20.0, /* closure is met to FINE */
};
