/* Collocation at Gauss points: the kind of runs of systems of parts.
 *
 * The equation of motion and the rates of the constraints hold at every Gauss point. At the end of a step, places and
 * rates are projected on the constraints along M^-1 J^T there, which keeps the order of both at twice the number of
 * stages: U. M. Ascher, L. R. Petzold, Projected implicit Runge-Kutta methods for differential-algebraic equations,
 * SIAM Journal on Numerical Analysis 28 (1991). In the eigenvectors of the matrix of coefficients the stages of
 * Newton's correction separate: see system_factor. One of each complex pair is solved. The tolerance `rtol` of the run
 * is the largest last correction of the unknowns over their sizes, and of rates over the largest in the step.
 */
#include <string.h>

#include "arena.h"
#include "newton.h"
#include "run.h"
#include "system.h"

/* Corrections that do not decrease are rounding below this part of the size of the unknowns. */
#define ROUNDING R(1e-10)
/* Largest number of corrections in a step. */
enum { MOST_CORRECTIONS = 30 };
/* Largest ratio of a correction to the previous two, above which they diverge. */
#define DIVERGING R(2)
/* Rounding of places over their sizes; rates have as much over a step. */
#define SPACING (16 * REAL_EPSILON)

/* Part of a step within which times of samples and of ends of steps are the same but for rounding. */
#define AT_END R(1e-9)

struct collocation {
    const struct system_motion *motion;
    const struct system *of;
    const struct run *run;
    ptrdiff_t stages, pairs;
    real t, h, close;
    /* The method: rates of the stages by `a`, places by `aa`, ends by `b` and `ba`, at `c`. */
    const real *a, *aa, *b, *ba, *c;
    /* One of each pair of eigenvalues of `a`; eigenvectors (stages, pairs) and rows of their inverse (pairs, stages);
       complex, real before imaginary parts. */
    const real *eigenvalues, *vectors, *inverse;
    const real *powers; /* coefficients of second rates by powers of the time in a step, by those of the stages */
    const real *q, *v;  /* at the start of the step */
    real *a_of, *lambda_of; /* second rates and multipliers of the stages; before a step, those of the last one */
    real *f, *f_new;
    /* Scratch: of the stages and, one more row, of the end. */
    real *places, *rates, *errors, *still, *forces, *changes, *right, *times;
    real *factors, *metric; /* a real and an imaginary matrix for each pair; a real one */
};

static size_t place(const struct equations *e, ptrdiff_t stages, void *memory, struct collocation *c) {
    const struct system *of = ((const struct system_motion *)e->owner)->of;
    const ptrdiff_t n = of->unknowns, m = of->multipliers, more = stages + 1;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(c->a_of, stages * n),
        ARENA_ARRAY(c->lambda_of, stages * m),
        ARENA_ARRAY(c->f, e->dim),
        ARENA_ARRAY(c->f_new, e->dim),
        ARENA_ARRAY(c->places, more * n),
        ARENA_ARRAY(c->rates, more * n),
        ARENA_ARRAY(c->errors, more * m),
        ARENA_ARRAY(c->still, more * n),
        ARENA_ARRAY(c->forces, stages * n),
        ARENA_ARRAY(c->changes, stages * (n + m)),
        ARENA_ARRAY(c->right, n),
        ARENA_ARRAY(c->times, more),
        ARENA_ARRAY(c->factors, stages * of->slopes.size),
        ARENA_ARRAY(c->metric, of->slopes.size),
    };
    return ARENA_PLACE(arrays, memory);
}

static size_t bytes(const struct run *run, const long *counts) {
    struct collocation c;
    return place(run->e, counts[0], NULL, &c);
}

/* Counts: stages. Numbers: those of struct collocation, in its order. */
static ptrdiff_t numbers(const long *counts) {
    const long stages = counts[0];
    return stages < 2 || stages > MOST_STAGES || stages % 2 ? -1 : (5 * stages + 4) * stages;
}

/* The step of length h from the present state. */
static struct collocation step_of(const struct run *run, real h) {
    const ptrdiff_t stages = run->scheme.counts[0], square = stages * stages;
    struct collocation c = {.motion = run->e->owner, .run = run, .stages = stages, .pairs = stages / 2, .h = h};
    place(run->e, stages, run->own, &c);
    c.of = c.motion->of, c.t = run->state->t, c.close = R(run->task.rtol);
    c.q = run->y, c.v = run->y + c.of->unknowns;
    c.a = run->scheme.numbers, c.aa = c.a + square, c.b = c.aa + square, c.ba = c.b + stages, c.c = c.ba + stages;
    c.eigenvalues = c.c + stages, c.vectors = c.eigenvalues + stages, c.inverse = c.vectors + square;
    c.powers = c.inverse + square;
    return c;
}

static void bind(struct run *run) {
    const struct collocation c = step_of(run, 0);
    struct system_motion *motion = run->e->owner;
    run->f = c.f, run->f_new = c.f_new;
    motion->a_of = c.a_of, motion->lambda_of = c.lambda_of;
}

static int begin(struct run *run) {
    const struct collocation c = step_of(run, 0);
    const ptrdiff_t n = c.of->unknowns, stages = c.stages;
    if (run->state->steps == 0) { /* after a change of loads the last step is nearer */
        memcpy(c.a_of, c.motion->a, (size_t)(stages * n) * sizeof(real));
        memcpy(c.lambda_of, c.motion->lambda, (size_t)(stages * c.of->multipliers) * sizeof(real));
    }
    memcpy(c.f, c.v, (size_t)n * sizeof(real));
    memcpy(c.f + n, c.a_of, (size_t)n * sizeof(real));
    return DONE;
}

/* Places and rates of the stages, by their second rates. */
static void move_stages(struct collocation *c) {
    const ptrdiff_t n = c->of->unknowns;
    for (ptrdiff_t i = 0; i < c->stages; i++)
        for (ptrdiff_t k = 0; k < n; k++) {
            real place = 0, rate = 0;
            for (ptrdiff_t j = 0; j < c->stages; j++) {
                place += c->aa[i * c->stages + j] * c->a_of[j * n + k];
                rate += c->a[i * c->stages + j] * c->a_of[j * n + k];
            }
            c->places[i * n + k] = c->q[k] + c->h * (c->c[i] * c->v[k] + c->h * place);
            c->rates[i * n + k] = c->v[k] + c->h * rate;
        }
}

/* Set the corrections of second rates and multipliers, by the forces and rates of constraints of the stages. */
static void solve_stages(struct collocation *c) {
    const struct system *of = c->of;
    const ptrdiff_t n = of->unknowns, m = of->multipliers, both = n + m;
    memset(c->changes, 0, (size_t)(c->stages * both) * sizeof(real));
    for (ptrdiff_t pair = 0; pair < c->pairs; pair++) {
        const real re = c->h * c->eigenvalues[2 * pair], im = c->h * c->eigenvalues[2 * pair + 1];
        const real size = re * re + im * im;
        const real *factors = c->factors + 2 * pair * of->slopes.size;
        for (ptrdiff_t k = 0; k < both; k++) {
            real x = 0, y = 0;
            for (ptrdiff_t i = 0; i < c->stages; i++) {
                const real *by = c->inverse + 2 * (pair * c->stages + i);
                const real force = k < n ? c->forces[i * n + k] : c->errors[i * m + k - n];
                x += by[0] * force;
                y += by[1] * force;
            }
            const ptrdiff_t at = of->position[k];
            of->x[at] = k < n ? x : (x * re + y * im) / size;
            of->y[at] = k < n ? y : (y * re - x * im) / size;
        }
        envelope_solve(&of->envelope, factors, factors + of->slopes.size, of->x, of->y);
        for (ptrdiff_t i = 0; i < c->stages; i++) {
            const real *weight = c->vectors + 2 * (i * c->pairs + pair);
            for (ptrdiff_t k = 0; k < both; k++) {
                const ptrdiff_t at = of->position[k];
                c->changes[i * both + k] -= 2 * (weight[0] * of->x[at] - weight[1] * of->y[at]);
            }
        }
    }
}

/* The largest correction of the stages: of places over their sizes, or of rates over these and the fastest one. */
static real size_of_changes(const struct collocation *c, real fastest) {
    const ptrdiff_t n = c->of->unknowns, both = n + c->of->multipliers;
    real size = 0;
    for (ptrdiff_t i = 0; i < c->stages; i++)
        for (ptrdiff_t k = 0; k < n; k++) {
            real place = 0, rate = 0;
            for (ptrdiff_t j = 0; j < c->stages; j++) {
                place += c->aa[i * c->stages + j] * c->changes[j * both + k];
                rate += c->a[i * c->stages + j] * c->changes[j * both + k];
            }
            place = real_fabs(c->h * c->h * place / c->motion->scale[k]), rate = real_fabs(c->h * rate / c->motion->scale[k]);
            if (!real_isfinite(place + rate))
                return REAL_INFINITY;
            size = real_fmax(size, real_fmax(place, rate / fastest));
        }
    return size;
}

/* Second rates and multipliers of the stages, and the fastest rate over its size. */
struct stages {
    struct collocation *c;
    const struct states *s;
    real fastest;
};

static real correct(void *of, struct newton *w) {
    struct stages *stages = of;
    struct collocation *c = stages->c;
    const ptrdiff_t n = c->of->unknowns, m = c->of->multipliers, both = n + m;
    move_stages(c);
    for (ptrdiff_t i = 0; i < c->stages; i++)
        for (ptrdiff_t k = 0; k < n; k++)
            stages->fastest = real_fmax(stages->fastest, real_fabs(c->rates[i * n + k]) / c->motion->scale[k]);
    memset(c->forces, 0, (size_t)(c->stages * n) * sizeof(real));
    memset(c->errors, 0, (size_t)(c->stages * m) * sizeof(real));
    system_evaluate(c->of, stages->s, c->forces, NULL, c->errors);
    c->run->e->account->evaluations++;
    solve_stages(c);
    for (ptrdiff_t i = 0; i < c->stages; i++) {
        for (ptrdiff_t k = 0; k < n; k++)
            c->a_of[i * n + k] += c->changes[i * both + k];
        for (ptrdiff_t k = 0; k < m; k++)
            c->lambda_of[i * m + k] += c->changes[i * both + n + k];
    }
    (void)w;
    return size_of_changes(c, stages->fastest);
}

/* Until corrections vanish, or their rate of convergence shows that the next one would. Those by slopes in the middle of
   the step alternate. */
static int converge(const struct collocation *c, newton_step *step, void *of) {
    struct newton w = {.most = MOST_CORRECTIONS, .close = c->close, .left = c->close, .rounded = ROUNDING,
                       .grows = DIVERGING, .alternate = 1};
    return (int)newton_solve(&w, 1, step, of);
}

/* Subtract from values the least change, in the metric of the mass matrix, that satisfies the constraints with these
   errors, which are left in `x` with their multipliers. Return its size. */
static real project_on(const struct collocation *c, const real *errors, real *values) {
    const struct system *of = c->of;
    const ptrdiff_t n = of->unknowns;
    real size = 0;
    for (ptrdiff_t k = 0; k < of->envelope.n; k++)
        of->x[of->position[k]] = k < n ? 0 : errors[k - n];
    envelope_solve(&of->envelope, c->metric, NULL, of->x, NULL);
    for (ptrdiff_t k = 0; k < n; k++) {
        values[k] -= of->x[of->position[k]];
        size = real_fmax(size, real_fabs(of->x[of->position[k]]) / c->motion->scale[k]);
    }
    return size;
}

/* The end of a step, whose places are projected. */
struct end {
    const struct collocation *c;
    const struct states *s;
    real *q;
};

static real correct_end(void *of, struct newton *w) {
    const struct end *end = of;
    (void)w;
    memset(end->c->errors, 0, (size_t)end->c->of->multipliers * sizeof(real));
    system_evaluate(end->c->of, end->s, NULL, end->c->errors, NULL);
    return project_on(end->c, end->c->errors, end->q);
}

/* Work of inertia at moving ground by a change of the rates at the end of a step [J]: power is linear in second
   rates. */
static real work_of_change(struct collocation *c, struct states end, const real *change) {
    real work = 0;
    for (ptrdiff_t k = 0; k < c->of->count; k++) {
        const struct part *part = c->of->parts[k];
        if (part->input == NULL)
            continue;
        end.a = change;
        work += part->input(part, &end, 0);
        end.a = c->still;
        work -= part->input(part, &end, 0);
    }
    return work;
}

/* Project the end of a step on the constraints, and add the work of these to `work`. */
static int project_end(struct collocation *c, const struct states *s, real *work) {
    const struct system *of = c->of;
    const ptrdiff_t n = of->unknowns, m = of->multipliers, last = c->stages, z = last * of->known;
    real *q = c->places + last * n, *v = c->rates + last * n;
    const size_t row = (size_t)m * sizeof(real);
    struct states end = {1, n, m, of->known, c->times + last, q, v, c->a_of + (last - 1) * n,
                         c->lambda_of + (last - 1) * m, s->z + z, s->z_rates + z};
    /* Along M^-1 J^T in the middle of the step the order of the projected rates would be lower. */
    system_refresh(of, &end);
    if (!system_factor(of, 0, 0, c->metric, NULL))
        return 0;
    if (!converge(c, correct_end, &(struct end){c, &end, q}))
        return 0;
    /* Rates of the constraints at rest, by motions of the ground, at the stages and at the end. */
    struct states still = *s;
    still.count = last + 1, still.v = c->still;
    memset(c->errors, 0, (size_t)(last + 1) * row);
    system_evaluate(of, &still, NULL, NULL, c->errors);
    for (ptrdiff_t i = 0; i < last; i++) {
        real power = 0;
        for (ptrdiff_t k = 0; k < m; k++)
            power += c->lambda_of[i * m + k] * c->errors[i * m + k];
        *work += c->h * c->b[i] * power;
    }
    memcpy(c->right, v, (size_t)n * sizeof(real));
    real *by_ground = c->errors + last * m;
    memset(c->errors, 0, row);
    system_evaluate(of, &end, NULL, NULL, c->errors);
    project_on(c, c->errors, v);
    /* Impulses that put the rates on the constraints do work too; the power of the multipliers of the stages alone has
       the fourth order. */
    for (ptrdiff_t k = 0; k < m; k++)
        *work -= by_ground[k] * of->x[of->position[n + k]];
    for (ptrdiff_t k = 0; k < n; k++)
        c->right[k] = v[k] - c->right[k];
    *work += work_of_change(c, end, c->right);
    return 1;
}

/* The prescribed numbers of the step and their rates: false if there are none. */
static int prescribed(const struct collocation *c, const real **z, const real **z_rates) {
    struct system_motion *motion = c->run->e->owner;
    const long step = c->run->state->steps;
    if (motion->each || step < motion->first || step >= motion->first + motion->count)
        motion->prescribe(motion->owner, step, c->t, c->h, c->run->y);
    if (step < motion->first || step >= motion->first + motion->count)
        return 0;
    const ptrdiff_t at = (step - motion->first) * (c->stages + 2) * c->of->known;
    *z = motion->z + at, *z_rates = motion->z_rates + at;
    return 1;
}

static int step(struct run *run, real t, real h, real t_new) {
    struct collocation now = step_of(run, h), *c = &now;
    const struct system *of = c->of;
    const ptrdiff_t n = of->unknowns, m = of->multipliers, last = c->stages;
    const real half = t + h * R(0.5), *z, *z_rates;
    if (!prescribed(c, &z, &z_rates))
        return UNSOLVED;
    for (ptrdiff_t k = 0; k < n; k++)
        c->right[k] = c->q[k] + h / 2 * c->v[k];
    const struct states middle = {1, n, m, of->known, &half, c->right, c->v, c->a_of + (last - 1) * n,
                                  c->lambda_of + (last - 1) * m, z, z_rates};
    system_refresh(of, &middle);
    for (ptrdiff_t pair = 0; pair < c->pairs; pair++) {
        real *values = c->factors + 2 * pair * of->slopes.size;
        if (!system_factor(of, h * c->eigenvalues[2 * pair], h * c->eigenvalues[2 * pair + 1], values,
                           values + of->slopes.size))
            return UNSOLVED;
    }
    run->e->account->factorisations++;
    for (ptrdiff_t i = 0; i < last; i++)
        c->times[i] = t + h * c->c[i];
    c->times[last] = t_new;
    const struct states s = {last, n, m, of->known, c->times, c->places, c->rates, c->a_of, c->lambda_of,
                             z + of->known, z_rates + of->known};
    /* Of this step alone: a resumed run has the same bits. */
    struct stages stages = {c, &s, SPACING / (c->close * c->h)};
    if (!converge(c, correct, &stages))
        return UNSOLVED;
    real work = 0, *q = c->places + last * n, *v = c->rates + last * n;
    for (ptrdiff_t i = 0; i < last; i++)
        work += h * c->b[i] * system_power(of, &s, i);
    for (ptrdiff_t k = 0; k < n; k++) {
        real place = 0, rate = 0;
        for (ptrdiff_t i = 0; i < last; i++) {
            place += c->ba[i] * c->a_of[i * n + k];
            rate += c->b[i] * c->a_of[i * n + k];
        }
        q[k] = c->q[k] + h * c->v[k] + h * h * place;
        v[k] = c->v[k] + h * rate;
    }
    if (m && !project_end(c, &s, &work))
        return UNSOLVED;
    memcpy(run->y_new, q, (size_t)n * sizeof(real));
    memcpy(run->y_new + n, v, (size_t)n * sizeof(real));
    run->y_new[2 * n] = run->y[2 * n] + work;
    return DONE;
}

/* Rates and second rates near both ends of the step. */
static int finish(struct run *run, real h, real t_new) {
    const struct collocation c = step_of(run, h);
    const size_t row = (size_t)c.of->unknowns * sizeof(real);
    (void)t_new;
    memcpy(c.f, c.v, row);
    memcpy(c.f + c.of->unknowns, c.a_of, row);
    memcpy(c.f_new, run->y_new + c.of->unknowns, row);
    memcpy(c.f_new + c.of->unknowns, c.a_of + (c.stages - 1) * c.of->unknowns, row);
    return DONE;
}

/* The polynomial with the second rates of the stages, less a linear part: the end is on the constraints. */
static void interpolate(struct run *run, real h, real theta, real *y) {
    const struct collocation c = step_of(run, h);
    const ptrdiff_t n = c.of->unknowns;
    real of_places[MOST_STAGES], of_rates[MOST_STAGES];
    if (theta < AT_END || theta > 1 - AT_END) {
        memcpy(y, theta < AT_END ? run->y : run->y_new, (size_t)run->dim * sizeof(real));
        return;
    }
    for (ptrdiff_t j = 0; j < c.stages; j++) {
        real power = theta;
        of_places[j] = of_rates[j] = 0;
        for (ptrdiff_t k = 0; k < c.stages; k++, power *= theta) {
            const real part = power * c.powers[k * c.stages + j] / R(k + 1);
            of_rates[j] += part;
            of_places[j] += theta * part / R(k + 2);
        }
    }
    for (ptrdiff_t k = 0; k < n; k++) {
        real place = 0, rate = 0, place_end = 0, rate_end = 0;
        for (ptrdiff_t j = 0; j < c.stages; j++) {
            const real second = c.a_of[j * n + k];
            place += of_places[j] * second, rate += of_rates[j] * second;
            place_end += c.ba[j] * second, rate_end += c.b[j] * second;
        }
        const real off = c.q[k] + h * (c.v[k] + h * place_end) - run->y_new[k];
        const real off_rate = c.v[k] + h * rate_end - run->y_new[n + k];
        y[k] = c.q[k] + h * (theta * c.v[k] + h * place) - theta * off;
        y[n + k] = c.v[k] + h * rate - theta * off_rate;
    }
    y[2 * n] = run->y[2 * n] + theta * (run->y_new[2 * n] - run->y[2 * n]);
}

const struct kind collocation_kind = {
    "collocation", "stages", "a aa b ba c eigenvalues vectors inverse powers", 1, bytes, numbers, bind, begin, step, finish,
    NULL, interpolate, NULL, NULL, NULL, NULL, NULL, NULL,
};
