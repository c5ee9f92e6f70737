"""The building blocks of a loop against 4x4 matrices and the derivation of whole rows."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from symgen.mechanics.loop.dual_rows import motions, row_transform
from symgen.models import BLOCKS

rng = np.random.default_rng(4)
Q, U = rng.uniform(-1.5, 1.5, 5), rng.uniform(-2, 2, 12)


def values(system, **arrays):
    """Evaluate all matrices of a building block, at arrays by group."""
    known = {
        x.symbol: sp.Float(v, 17)
        for g in system.groups
        for x, v in zip(g.quantities, arrays[g.name], strict=True)
    }
    for d in system.definitions:
        known[d.quantity.symbol] = d.expression.xreplace(known)
    return {m.name: np.array(m.matrix.xreplace(known).evalf(17), dtype=float) for m in system.matrices}


def turn(axis, angle):
    found, j, k = np.eye(4), (axis + 1) % 3, (axis + 2) % 3
    found[j, j] = found[k, k] = np.cos(angle)
    found[k, j] = np.sin(angle)
    found[j, k] = -found[k, j]
    return found


def shift(axis, length):
    found = np.eye(4)
    found[axis, 3] = length
    return found


def row(q):
    theta, s, eta, alpha, a = q
    return turn(2, theta) @ shift(2, s) @ turn(1, eta) @ turn(0, alpha) @ shift(0, a)


def test_transform_is_the_product_of_its_motions():
    found = values(BLOCKS["loop_row"](), q=Q)
    assert np.abs(found["transform"] - row(Q)[:3]).max() < 1e-15
    symbols = sp.symbols("a:5", real=True)
    dual = row_transform(motions(1, symbols, symbols)).beside.xreplace(
        dict(zip(symbols, map(sp.Float, Q), strict=True))
    )
    assert np.abs(found["dual_transform"] - np.array(dual, dtype=float)).max() < 1e-15


def test_screws_are_the_derivative_of_the_row():
    before = row(rng.uniform(-1, 1, 5))
    found = values(BLOCKS["loop_screws"](), q=Q, p=before[:3].ravel())["screws"]
    for i, h in enumerate(1e-6 * np.eye(5)):
        moving = before @ (row(Q + h) - row(Q - h)) / 2e-6 @ np.linalg.inv(before @ row(Q))
        expected = [moving[2, 1], moving[0, 2], moving[1, 0], *moving[:3, 3]]
        assert np.abs(found[:, i] - expected).max() < 1e-9


@pytest.fixture
def link():
    root = rng.standard_normal((3, 3))
    return 1.7, rng.standard_normal(3), root @ root.T + np.eye(3)


def test_inertia_of_a_link_by_newton_and_euler(link):
    mass, centre, inertia = link
    upper = [inertia[i, j] for i in range(3) for j in range(i, 3)]
    found = values(BLOCKS["loop_inertia"](), u=U, p=[mass, *centre, *upper])
    w, v, dw, dv = U.reshape(4, 3)
    at_centre = v + np.cross(w, centre)
    acceleration = dv + np.cross(w, v) + np.cross(dw, centre) + np.cross(w, np.cross(w, centre))
    moment = inertia @ dw + np.cross(w, inertia @ w) + np.cross(centre, mass * acceleration)
    wrench = [*(mass * acceleration), *moment]
    assert np.abs(found["inertia_wrench"].ravel() - wrench).max() < 1e-12
    momentum = [*(mass * at_centre), *(inertia @ w + np.cross(centre, mass * at_centre))]
    assert np.abs(found["momentum"].ravel() - momentum).max() < 1e-12
    energy = mass * at_centre @ at_centre / 2 + w @ inertia @ w / 2
    assert abs(found["kinetic_energy"][0, 0] - energy) < 1e-12
