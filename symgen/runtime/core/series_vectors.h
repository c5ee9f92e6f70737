/* Steps of power series in the lanes of run_vectors.h, as taylor.c and the loop of run.c take those of a single run. */

/* One of the two series. */
static struct series series_of(const struct lane_runs *l, long which) {
    return series_at(&l->e, l->series.order, l->series.rows, which);
}

/* As `expand` of taylor.c. */
static void expand_lanes(struct lane_runs *l, long which, wide t, const wide *y) {
    const struct series s = series_of(l, which);
    lane_factor(l, t, y);
    expand_series(&l->e, &s, s.order - 1, t, y, l->series.f_new);
    fail_unless_finite(l, l->series.f_new);
    if (!l->adaptive)
        return;
    l->series.longest[which] = length_of_series(&s, &l->task, y);
    l->failed |= ~(l->series.longest[which] > 0);
}

static void begin_series_of_lanes(struct lane_runs *l, wide t) {
    l->series.present = 0, l->series.order = order_of(l->scheme.counts, &l->task);
    l->series.limit = all(l->task.step > 0.0 ? R(l->task.step) : R(l->task.t_end) - R(l->task.t0));
    l->series.growth = all(R(GROW));
    expand_lanes(l, 0, t, l->y);
}

static wide length_of_step(const struct lane_runs *l) {
    const wide length = smaller(l->series.limit, l->series.longest[l->series.present]);
    return l->task.max_step > 0.0 ? smaller(length, all(R(l->task.max_step))) : length;
}

/* Norm of the error of a step over the tolerance, and of the correction at its end if the error is within it. `shortest` is
   the least scale of the constraints. */
static wide norm_of_step(const struct lane_runs *l, const struct lane_step *x, wide shortest) {
    const ptrdiff_t n = l->e.n;
    wide total = all(0);
    for (ptrdiff_t i = n; i < l->e.dim; i++) {
        const wide error = error_of_series(x->h, l->series.changes[i - n], l->series.f_new[i]);
        const wide size = larger(magnitude(l->y[i]), magnitude(l->y_new[i]));
        const wide part = error / (R(l->task.atol) + R(l->task.rtol) * size);
        total += part * part;
    }
    const wide norm = root(total / R(l->e.dim));
    if (l->e.m == 0)
        return norm;
    const struct projected end = {n, l->e.dim, l->y, l->stage, l->y_new, shortest};
    return chosen(norm <= R(1), correction_norm(&end, &l->task), norm);
}

/* Take a step of at most these lengths: lanes beyond the tolerance do not, and take a shorter one next. */
static void take_series_step(struct lane_runs *l, struct lane_step *x, wide lengths) {
    struct lane_series *of = &l->series;
    const struct series s = series_of(l, of->present);
    state_of_series(&s, x->h, l->y_new, of->changes);
    fail_unless_finite(l, l->y_new);
    copy(l->y_new, l->e.dim, l->stage);
    project_lanes(l, x->t_new, l->y_new, 0);
    const wide shortest = shortest_scale(&l->e);
    expand_lanes(l, 1 - of->present, x->t_new, l->y_new);
    if (l->adaptive) {
        const wide norm = norm_of_step(l, x, shortest);
        x->taken &= norm <= R(1);
        const wide grown = chosen(x->h == lengths, x->h * of->growth, lengths);
        of->limit = chosen(x->taken, grown, of->limit), of->growth = chosen(x->taken, all(R(GROW)), all(1));
        const mask again = x->open & ~x->taken;
        if (any(again)) {
            const wide least = R(CAREFUL) * powered(norm, R(-1) / R(l->scheme.error_order + 1));
            of->limit = chosen(again, x->h * larger(all(R(SHRINK)), least), of->limit);
        }
    }
}

/* The series at y_new becomes that at y, in the lanes that took the step. */
static void accept_series(struct lane_runs *l, const struct lane_step *x) {
    struct lane_series *of = &l->series;
    const struct series old = series_of(l, of->present), s = series_of(l, 1 - of->present);
    const mask again = x->open & ~x->taken;
    if (any(again)) {
        copy_where(again, old.rows, (s.order + 2) * s.row, s.rows);
        copy_where(again, &of->longest[of->present], 1, &of->longest[1 - of->present]);
    }
    of->present = 1 - of->present;
}
