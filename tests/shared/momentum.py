"""Momentum rows in numbers: as derived, solved densely; and as printed, for a pinned chain."""

from __future__ import annotations

import numpy as np
import sympy as sp
from shared.golden import reference

from symgen.report.mathematics.equations import used_terms


def in_numbers(rows):
    """A and b as a function of t, q, u and p, through the shared subexpressions."""
    symbols = [x.symbol for g in rows.groups if g.name != "x" for x in g.quantities]
    shared = [*used_terms(rows, [rows["matrix"], rows["rhs"]]).items()]
    entries = [list(rows[n].matrix) for n in ("matrix", "rhs")]
    return sp.lambdify(symbols, entries, "math", cse=lambda e: (shared, e))


def equations(rows, model, state, function=None):
    """A and b of the square system at a state."""
    held = [0.0] * model.description.held  # references of angles, branches of switching points
    values = [state.t, *state.q, *state.u, *model.parameters.values(), *held]
    a, b = (np.array(x, dtype=float) for x in (function or in_numbers(rows))(*values))
    return a.reshape(len(b), len(b)), b


def solved(rows, model, state, function=None):
    """Solve the momentum rows with the constraints densely; unknowns by name."""
    a, b = equations(rows, model, state, function)
    scale = np.max(np.abs(a), axis=1)
    a, b = a / scale[:, None], b / scale
    x = np.linalg.lstsq(a, b, rcond=1e-10)[0] if model.redundant else np.linalg.solve(a, b)
    return dict(zip(rows["matrix"].columns, x.tolist(), strict=True))


def chain_system(place, speed, rods, gravity, *, own_mass=False, couples=None, project=None):
    """Eqs. (12), (13) and (14) of a pinned chain as printed, in numbers: A a = b.

    ``own_mass`` takes m_{2i+1} for the third particle of rod i alone; ``couples`` are couples on the rods, taken
    whole; ``project`` gives the two directions of Eq. (13).
    """
    n, dim = len(rods), place.shape[1]
    rows, rhs = [], []

    def skew(h):
        return np.array([[-h[1], h[0]]]) if dim == 2 else np.cross(h, np.eye(3)).T

    for j in range(n):
        left, right = np.zeros((2 * dim - 3, (n + 1) * dim)), np.zeros(2 * dim - 3)
        for i in range(j, n):
            m, lc, l, masses = rods[i]["m"], rods[i]["lc"], rods[i]["l"], list(rods[i]["particles"])
            end = masses[2] + (0 if own_mass or i + 1 == n else rods[i + 1]["particles"][0])
            a, b = place[i] - place[j], place[i + 1] - place[j]
            middle = (a + b) / 2
            left[:, i * dim : (i + 1) * dim] += masses[1] / 2 * skew(middle)
            left[:, (i + 1) * dim : (i + 2) * dim] += end * skew(b) + masses[1] / 2 * skew(middle)
            right += skew(a + lc / l * (b - a)) @ (m * gravity)
            if couples is not None:
                right += couples[i]
        axes = np.eye(1) if dim == 2 else np.array(project(place[j + 1] - place[j]))
        rows.append(axes @ left)
        rhs.append(axes @ right)
        d, rate = place[j + 1] - place[j], speed[j + 1] - speed[j]
        length = np.zeros((1, (n + 1) * dim))
        length[0, j * dim : (j + 1) * dim], length[0, (j + 1) * dim : (j + 2) * dim] = -d, d
        rows.append(length)
        rhs.append([-rate @ rate])
    return np.vstack(rows)[:, dim:], np.concatenate(rhs)


def from_reference(name):
    n = reference(name)
    place, speed, acc = (np.array(n[k], dtype=float) for k in ("pos", "vel", "acc"))
    rods = [{k: float(r[k]) for k in ("m", "lc", "l", "Io")} | {"particles": [float(x) for x in r["particles"]]}
            for r in n["rods"]]  # fmt: skip
    return n, place, speed, acc[1:].ravel(), rods, np.array(n["gravity"], dtype=float)
