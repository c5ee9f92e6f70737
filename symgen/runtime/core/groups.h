/* Solutions with the factors of the groups of dPhi/dq, for one linkage or for lanes of them: the including file defines
 * NUMBER, LINKAGE, and the solutions of a single group before it. */

/* Solve dPhi/dq x = rows over their scales; rows are results of a kernel for all constraints. */
static void solve(LINKAGE *k, const NUMBER *rows, NUMBER *x) {
    const struct kinematic_groups *g = &k->groups;
    const NUMBER *group = k->values, *coupling = k->values + g->squares, *weight = k->weight;
    NUMBER *solved = k->solved;
    for (ptrdiff_t c = 0; c < g->count; c++) {
        const ptrdiff_t start = g->starts[c], end = g->starts[c + 1], width = end - start;
        for (ptrdiff_t i = start; i < end; i++) {
            NUMBER value = rows[g->rows[i]] * weight[g->rows[i]];
            for (ptrdiff_t e = g->coupling_starts[i]; e < g->coupling_starts[i + 1]; e++)
                value -= coupling[e] * solved[g->coupling_columns[e]];
            solved[i] = value;
        }
        if (width == 2)
            solve_pair(group, k->swaps + start, k->inverse + start, solved + start);
        else
            solve_dense(width, group, k->swaps + start, solved + start);
        group += width * width;
        for (ptrdiff_t i = start; i < end; i++)
            x[g->columns[i]] = solved[i];
    }
}

/* Solve J^T lambda = forces; lambda of the constraints that are not among the rows is zero. */
static void solve_transposed(LINKAGE *k, const NUMBER *forces, NUMBER *lambda) {
    const struct kinematic_groups *g = &k->groups;
    const NUMBER *group = k->values + g->squares, *coupling = group;
    NUMBER *solved = k->solved;
    for (ptrdiff_t j = 0; j < k->sizes.n; j++)
        solved[j] = forces[g->columns[j]];
    for (ptrdiff_t i = 0; i < k->sizes.m; i++)
        lambda[i] = (NUMBER){0};
    for (ptrdiff_t c = g->count - 1; c >= 0; c--) {
        const ptrdiff_t start = g->starts[c], end = g->starts[c + 1], width = end - start;
        group -= width * width;
        if (width == 2)
            solve_pair_transposed(group, k->swaps + start, k->inverse + start, solved + start);
        else
            solve_dense_transposed(width, group, k->swaps + start, solved + start);
        for (ptrdiff_t i = start; i < end; i++) {
            for (ptrdiff_t e = g->coupling_starts[i]; e < g->coupling_starts[i + 1]; e++)
                solved[g->coupling_columns[e]] -= coupling[e] * solved[i];
            lambda[g->rows[i]] = solved[i] * k->weight[g->rows[i]];
        }
    }
}
