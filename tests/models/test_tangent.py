"""The generated Jacobian of the equations of motion: against slopes at 30 digits and differences of accelerations."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy as sp
from shared.full import full_unless
from shared.oracle import DIGITS, Oracle
from shared.rich_scenes import SCENES, joined_bodies
from shared.shipped import LINKAGES, REPEATED, derived, rigid
from shared.states import values_of

import symgen
from symgen.models.analyses import analysis_system
from symgen.pipeline.build import check_scene, text_of
from symgen.scene.resolve import resolve


def dense(system, listed):
    """The lists of nonzero entries as one matrix d(residual)/d(q, u)."""
    unknowns = [x.name for x in system.group("work").quantities]
    state = [x.name for g in ("q", "u") for x in system.group(g).quantities]
    whole = np.zeros((len(unknowns), len(state)))
    for name, entries in listed.items():
        for label, value in zip(system[name].rows, entries, strict=True):
            row, column = label.split()
            whole[unknowns.index(row), state.index(column)] = float(value)
    return whole


def tangent_of(scene):
    return analysis_system(resolve(check_scene(text_of(scene))), "tangent")


@pytest.mark.parametrize("scene", ["four_bar", "peaucellier", "vertical_rods", "loaded", "bodies"])
def test_slopes_of_the_residual_at_thirty_digits(scene):
    """Central differences, at 30 digits, of the residual that the equations of motion themselves give."""
    scene = symgen.Scene(**joined_bodies()) if scene == "bodies" else SCENES[scene]()
    model, dynamics, system = rigid(symgen.build(scene)), derived(scene).in_numbers(), tangent_of(scene)
    values = values_of(model, dynamics, np.random.default_rng(5))
    n = len(values["q"])
    names = ("mass_matrix", "constraint_jacobian", "force", "acceleration_rhs")
    symbols = [x.symbol for g in dynamics.groups for x in g.quantities]
    expanded = [
        sp.lambdify(symbols, sp.Matrix(dynamics.expanded(name)), modules="mpmath", cse=True) for name in names
    ]

    def residual(arguments):
        mass, jacobian, force, gamma = (f(*arguments) for f in expanded)
        work = mpmath.matrix([mpmath.mpf(float(x)) for x in values["work"]])
        a, multipliers = work[:n, 0], work[n:, 0]
        return [*(force - mass * a - jacobian.T * multipliers), *(gamma - jacobian * a)]

    own = Oracle(system)
    found = dense(system, {m.name: own.matrix(m.name, values) for m in system.matrices})
    exact, step = np.zeros_like(found), mpmath.mpf(10) ** -10
    with mpmath.workdps(DIGITS):
        here = [mpmath.mpf(float(x)) for g in dynamics.groups for x in values[g.name]]
        for j in range(2 * n):
            sides = []
            for sign in (1, -1):
                moved = list(here)
                moved[1 + j] += sign * step
                sides.append(residual(moved))
            exact[:, j] = [float((a - b) / (2 * step)) for a, b in zip(*sides, strict=True)]
    assert np.max(np.abs(found - exact)) <= 1e-13 * np.max(np.abs(exact))


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene not in REPEATED, [*LINKAGES, "loaded"]))
def test_slopes_of_accelerations(scene):
    """d(a, lambda) = KKT^-1 dR, with the model's own factors, against central differences of the solution."""
    scene = SCENES[scene]()
    model, system = rigid(symgen.build(scene)), tangent_of(scene)
    if model.redundant:
        pytest.skip("its multipliers are not unique, and are lost differently beside a state")
    evaluator, kernels, dynamics = model.evaluator, model.analysis("tangent"), Oracle(derived(scene))
    values = values_of(model, system, np.random.default_rng(11))
    t, q, u = float(values["t"][0]), values["q"], values["u"]
    n = len(q)

    def solution(moved):
        return evaluator("accelerations", t, moved[:n], moved[n:])

    here = np.concatenate([q, u])
    found = kernels.blocks("tangent", t, q, u, np.append(solution(here), np.zeros(kernels.work_size + 1)))
    slopes = dense(system, {name: np.ravel(block) for name, block in found.items()})
    mass, jacobian = (dynamics.matrix(k, values) for k in ("mass_matrix", "constraint_jacobian"))
    m = jacobian.rows
    whole = np.zeros((n + m, n + m))
    whole[:n, :n] = np.array(mass.tolist(), float)
    if m:
        whole[n:, :n] = np.array(jacobian.tolist(), float)
        whole[:n, n:] = whole[n:, :n].T
    exact = np.linalg.solve(whole, slopes)[:n]
    difference = np.zeros_like(exact)
    for j, size in enumerate(np.abs(here) + 0.1 * np.max(np.abs(here))):
        step = np.zeros_like(here)
        step[j] = 1e-5 * size
        difference[:, j] = (solution(here + step) - solution(here - step))[:n] / (2 * step[j])
    scale = np.max(np.abs(exact), axis=0, initial=1e-300) + 1e-6 * np.max(np.abs(exact), initial=1e-300)
    # Masses of a million to one leave their round-off in the differences; a wrong slope is wrong by its own size.
    assert np.max(np.abs(exact - difference) / scale) < 1e-4
