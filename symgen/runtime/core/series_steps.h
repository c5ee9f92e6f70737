/* Power series of a motion, one text for a single run and for lanes: see wide.h. The kernel `series` of the equations
 * writes coefficients, one row for each order.
 */
#ifndef SYMGEN_SERIES_STEPS_H
#define SYMGEN_SERIES_STEPS_H

#include <math.h>

#include "run.h"
#include "wide.h"

/* The count of a scheme: the order of the series; 0 for the order that the tolerance needs. */
enum { ORDER };
enum { LOWEST = 3, HIGHEST = MOST_COEFFICIENTS };
/* Rows of coefficients of a series: the kernel writes one more than the order, there is one of order 0, and numbers behind
   the last row that is evaluated. */
static inline ptrdiff_t rows_of(long order) {
    return order + 3;
}
/* Coordinates that are evaluated side by side, since each operation waits for the one before; behind the last of a row are
   other numbers. */
enum { BESIDE = 4, PLACES_BESIDE = 8 };
/* Series at y and at y_new. */
enum { BOTH = 2 };

struct series {
    ptrdiff_t n, row;   /* coordinates, and numbers of a row */
    ptrdiff_t work;     /* place of the work of loads in a row; -1 if it is not integrated */
    long order;
    wide *rows;
};

/* Every order takes a substitution, which takes longer than the loops over the orders unless the model is large; so do ten
   orders as what a step takes besides: factorisation, projection, energy. With steps proportional to
   tolerance^(1 / order), the time of a run is least near 8 - log(tolerance), within 5 % from chains of 3 to 40 rods. */
static inline long order_of(const long *counts, const struct task *task) {
    const long given = counts[ORDER];
    const double wanted = fmax(task->rtol, (double)REAL_EPSILON);
    return given > 0 ? given : (long)fmax(LOWEST, fmin(ceil(8 - log(wanted)), HIGHEST));
}

/* One of two series of equations, whose rows stand one behind the other. */
static inline struct series series_at(const struct equations *e, long order, wide *rows, long which) {
    const ptrdiff_t row = e->sizes.series_rows, work = e->extra ? row - 1 - e->sizes.series_watched : -1;
    return (struct series){e->n, row, work, order, rows + which * rows_of(order) * row};
}

/* Expand the motion from (t, y), at which equations are factorised, up to an order of the accelerations; write dy/dt. */
static inline void expand_series(struct equations *e, const struct series *s, long order, wide t, const wide *y, wide *dy) {
    const wide at[] = {t, all(R(order + (e->extra || e->sizes.series_watched)))};
    for (ptrdiff_t i = 0; i < s->n; i++)
        s->rows[i] = y[i], s->rows[s->row + i] = y[s->n + i];
    call(e->kernels.series, at, NULL, NULL, e->p, e->factors, s->rows);
    e->account->evaluations++;
    for (ptrdiff_t i = 0; i < s->n; i++)
        dy[i] = y[s->n + i], dy[s->n + i] = R(2) * s->rows[2 * s->row + i];
    if (s->work >= 0) {
        s->rows[s->work] = y[2 * s->n];
        dy[2 * s->n] = s->rows[s->row + s->work];
    }
}

/* Write the coordinates a time h after y. */
static inline void places_of_series(const struct series *s, wide h, wide *q) {
    for (ptrdiff_t first = 0; first < s->n; first += PLACES_BESIDE) {
        const wide *c = s->rows + s->order * s->row + first;
        wide place[PLACES_BESIDE];
        for (int i = 0; i < PLACES_BESIDE; i++)
            place[i] = c[i];
        for (long k = s->order; k > 0; k--) {
            c -= s->row;
            for (int i = 0; i < PLACES_BESIDE; i++)
                place[i] = place[i] * h + c[i];
        }
        for (int i = 0; i < PLACES_BESIDE && first + i < s->n; i++)
            q[first + i] = place[i];
    }
}

/* Write the state a time h after y; its accelerations and the power behind them to `changes`. */
static inline void state_of_series(const struct series *s, wide h, wide *y, wide *changes) {
    const ptrdiff_t n = s->n;
    for (ptrdiff_t first = 0; first < n; first += BESIDE) {
        const wide *c = s->rows + s->order * s->row + first;
        wide place[BESIDE], rate[BESIDE], change[BESIDE];
        for (int i = 0; i < BESIDE; i++)
            place[i] = c[i], rate[i] = change[i] = all(0);
        for (long k = s->order; k > 0; k--) {
            c -= s->row;
            for (int i = 0; i < BESIDE; i++) {
                change[i] = change[i] * h + rate[i];
                rate[i] = rate[i] * h + place[i];
                place[i] = place[i] * h + c[i];
            }
        }
        for (int i = 0; i < BESIDE && first + i < n; i++)
            y[first + i] = place[i], y[n + first + i] = rate[i], changes[first + i] = R(2) * change[i];
    }
    if (s->work >= 0) {
        const wide *work = s->rows + s->work;
        wide sum = work[s->order * s->row], rate = all(0);
        for (long k = s->order - 1; k >= 0; k--) {
            rate = rate * h + sum;
            sum = sum * h + work[k * s->row];
        }
        y[2 * n] = sum, changes[n] = rate;
    }
}

/* The step whose last terms are within a tenth of the tolerance: those of two orders, since every other one may vanish.
   Both may vanish: the length is infinite then, and a step compares the accelerations at its end. Zero where coefficients
   are not finite. */
static inline wide length_of_series(const struct series *s, const struct task *task, const wide *y) {
    const real atol = R(0.1) * R(task->atol), rtol = R(0.1) * R(task->rtol);
    wide length = all(REAL_INFINITY);
    mask finite = ~(mask){0};
    for (long k = s->order - 1; k <= s->order; k++) {
        wide places = all(0), rates = all(0);
        for (ptrdiff_t i = 0; i < s->n; i++) {
            const wide last = magnitude(s->rows[k * s->row + i]);
            finite &= is_finite(last);
            places = larger(places, last / (atol + rtol * magnitude(y[i])));
            rates = larger(rates, R(k) * last / (atol + rtol * magnitude(y[s->n + i])));
        }
        /* infinite where they vanish; rates above one and twice the places have the shorter step */
        length = smaller(length, powered(rates, R(-1) / R(k - 1)));
        if (any(~((rates >= all(1)) & (rates >= R(2) * places))))
            length = smaller(length, powered(places, R(-1) / R(k)));
    }
    return chosen(finite, length, all(0));
}

/* Part of the difference of accelerations and power, of the series and at its end, that is the error of a step. */
static inline wide error_of_series(wide h, wide of_series, wide at_end) {
    return R(0.25) * h * (of_series - at_end);
}

#endif
