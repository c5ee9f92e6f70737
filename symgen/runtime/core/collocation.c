#include "collocation.h"

#include <string.h>

#include "arena.h"

/* Corrections that do not decrease are rounding below this part of the size of the unknowns. */
#define ROUNDING R(1e-10)
/* Largest number of corrections in a step. */
enum { MOST_CORRECTIONS = 30 };
/* Largest ratio of a correction to the previous two, above which they diverge. */
#define DIVERGING R(2)
/* Rounding of places over their sizes; rates have as much over a step. */
#define SPACING (16 * REAL_EPSILON)

static size_t place(struct collocation *c, void *memory) {
    const ptrdiff_t n = c->of->unknowns, m = c->of->multipliers, stages = c->stages, more = stages + 1;
    const struct arena_array arrays[] = {
        ARENA_ARRAY(c->q, n),
        ARENA_ARRAY(c->v, n),
        ARENA_ARRAY(c->a_of, stages * n),
        ARENA_ARRAY(c->lambda_of, stages * m),
        ARENA_ARRAY(c->a_now, n),
        ARENA_ARRAY(c->lambda_now, m),
        ARENA_ARRAY(c->places, more * n),
        ARENA_ARRAY(c->rates, more * n),
        ARENA_ARRAY(c->errors, more * m),
        ARENA_ARRAY(c->still, more * n),
        ARENA_ARRAY(c->forces, stages * n),
        ARENA_ARRAY(c->changes, stages * (n + m)),
        ARENA_ARRAY(c->right, n),
        ARENA_ARRAY(c->times, more),
        ARENA_ARRAY(c->factors, c->pairs * 2 * c->of->slopes.size),
        ARENA_ARRAY(c->metric, c->of->slopes.size),
    };
    return ARENA_PLACE(arrays, memory);
}

size_t collocation_bytes(const struct system *of, ptrdiff_t stages, ptrdiff_t pairs) {
    struct collocation c = {.of = of, .stages = stages, .pairs = pairs};
    return place(&c, NULL);
}

void collocation_bind(struct collocation *c, void *memory) {
    place(c, memory);
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
        const real re = c->eigenvalues[2 * pair], im = c->eigenvalues[2 * pair + 1], size = re * re + im * im;
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
            place = real_fabs(c->h * c->h * place / c->scale[k]), rate = real_fabs(c->h * rate / c->scale[k]);
            if (!real_isfinite(place + rate))
                return REAL_INFINITY;
            size = real_fmax(size, real_fmax(place, rate / fastest));
        }
    return size;
}

/* Correct second rates and multipliers of the stages; false if corrections do not converge. */
static int correct(struct collocation *c, const struct states *s) {
    const ptrdiff_t n = c->of->unknowns, m = c->of->multipliers, both = n + m;
    /* Of this step alone: a resumed run has the same bits. */
    real fastest = SPACING / (c->close * c->h), earlier = 0, before = 0, rate = 1;
    for (int count = 0; count < MOST_CORRECTIONS; count++) {
        move_stages(c);
        for (ptrdiff_t i = 0; i < c->stages; i++)
            for (ptrdiff_t k = 0; k < n; k++)
                fastest = real_fmax(fastest, real_fabs(c->rates[i * n + k]) / c->scale[k]);
        memset(c->forces, 0, (size_t)(c->stages * n) * sizeof(real));
        memset(c->errors, 0, (size_t)(c->stages * m) * sizeof(real));
        system_evaluate(c->of, s, c->forces, NULL, c->errors);
        solve_stages(c);
        const real size = size_of_changes(c, fastest);
        if (!real_isfinite(size))
            return 0;
        for (ptrdiff_t i = 0; i < c->stages; i++) {
            for (ptrdiff_t k = 0; k < n; k++)
                c->a_of[i * n + k] += c->changes[i * both + k];
            for (ptrdiff_t k = 0; k < m; k++)
                c->lambda_of[i * m + k] += c->changes[i * both + n + k];
        }
        c->corrections++;
        if (count) {
            rate = before > 0 ? size / before : 0;
            if (before < ROUNDING && rate > R(0.5))
                return 1;
            /* Corrections by slopes in the middle of the step alternate. */
            if (size > DIVERGING * real_fmax(before, earlier) && count > 3)
                return 0;
        }
        if (size == 0 || size <= c->close * real_fmax(R(1), 1 / rate - 1))
            return 1;
        earlier = before, before = size;
    }
    return 0;
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
        size = real_fmax(size, real_fabs(of->x[of->position[k]]) / c->scale[k]);
    }
    return size;
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
    for (int k = 0; k < MOST_CORRECTIONS; k++) {
        memset(c->errors, 0, row);
        system_evaluate(of, &end, NULL, c->errors, NULL);
        if (!(project_on(c, c->errors, q) > c->close))
            break;
    }
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

int collocation_step(struct collocation *c, const real *z, const real *z_rates) {
    const struct system *of = c->of;
    const ptrdiff_t n = of->unknowns, m = of->multipliers, last = c->stages;
    const real h = c->h, half = c->t + h * R(0.5);
    for (ptrdiff_t k = 0; k < n; k++)
        c->right[k] = c->q[k] + h / 2 * c->v[k];
    const struct states middle = {1, n, m, of->known, &half, c->right, c->v, c->a_now, c->lambda_now, z, z_rates};
    system_refresh(of, &middle);
    for (ptrdiff_t pair = 0; pair < c->pairs; pair++) {
        real *values = c->factors + 2 * pair * of->slopes.size;
        if (!system_factor(of, c->eigenvalues[2 * pair], c->eigenvalues[2 * pair + 1], values,
                           values + of->slopes.size))
            return 0;
    }
    for (ptrdiff_t i = 0; i < last; i++)
        c->times[i] = c->t + h * c->c[i];
    c->times[last] = c->t + h;
    const struct states s = {last, n, m, of->known, c->times, c->places, c->rates, c->a_of, c->lambda_of,
                             z + of->known, z_rates + of->known};
    if (!correct(c, &s))
        return 0;
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
        return 0;
    memcpy(c->q, q, (size_t)n * sizeof(real));
    memcpy(c->v, v, (size_t)n * sizeof(real));
    memcpy(c->a_now, c->a_of + (last - 1) * n, (size_t)n * sizeof(real));
    memcpy(c->lambda_now, c->lambda_of + (last - 1) * m, (size_t)m * sizeof(real));
    c->t += h, c->work += work, c->steps++;
    return 1;
}
