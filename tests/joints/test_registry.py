"""Properties of every joint of the registry, from its row alone."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from symgen.joints import JOINTS
from symgen.mechanics.loop.dual_rows import GROUND, JointMotion, motions, onward, row_transform
from symgen.scene.loop.loop import ENTRIES
from symgen.symbolic.names import Names

PITCH, STEP = 0.3, 1e-6


@pytest.mark.parametrize("letter", JOINTS)
def test_entries_of_a_joint(letter):
    joint = JOINTS[letter]
    coupled = [entry for entry, _ in joint.coupled]
    assert joint.letter == letter and joint.name
    assert {*joint.varies, *joint.zero, *coupled} <= set(ENTRIES)
    assert list(joint.varies) == [e for e in ENTRIES if e in joint.varies], "in the order of the motions"
    assert not set(joint.varies) & {*joint.zero, *coupled}
    assert {freedom for _, freedom in joint.coupled} <= set(joint.varies)
    assert joint.freedoms == len(joint.varies) > 0


def row_of(letter: str, constants) -> tuple[list[sp.Symbol], tuple[JointMotion, ...]]:
    """The row of a joint with its variables, and random constants where it may have them."""
    joint = JOINTS[letter]
    variables = {e: sp.Symbol(e, real=True) for e in joint.varies}
    values = {e: variables.get(e, sp.Float(x, 30)) for e, x in zip(ENTRIES, constants, strict=True)}
    values |= {e: sp.Integer(0) for e in joint.zero}
    for entry, freedom in joint.coupled:
        values[entry] += PITCH * variables[freedom]
    found = list(variables.values())
    return found, motions(1, [values[e] for e in ENTRIES], found)


def numbers(matrix, symbols, at) -> np.ndarray:
    return np.array(
        sp.Matrix(matrix).xreplace(dict(zip(symbols, map(sp.Float, at), strict=True))), dtype=float
    )


def screws_of(row, symbols, at) -> np.ndarray:
    """The screw of every freedom of the joint, in the frame before it."""
    frame, names = GROUND, Names()
    columns = [sp.zeros(6, 1) for _ in symbols]
    for m in row:
        for j, slope in m.slopes:
            columns[j] += slope * frame.screw(m.screw).column
        frame = onward(frame, m, names, m.name)
    known = {}
    for definition in names.definitions:
        known[definition.quantity.symbol] = definition.expression.xreplace(known)
    return np.column_stack([numbers(c.xreplace(known), symbols, at) for c in columns])


@pytest.fixture(params=JOINTS)
def joint(request):
    rng = np.random.default_rng(list(JOINTS).index(request.param))
    symbols, row = row_of(request.param, rng.uniform(0.2, 1.2, len(ENTRIES)))
    return JOINTS[request.param], symbols, row, rng.uniform(0.2, 1.2, len(symbols)), rng


def test_its_row_is_orthogonal_as_a_dual_matrix(joint):
    _, symbols, row, at, _ = joint
    found = row_transform(row)
    product = found.T @ found
    assert np.abs(numbers(product.real, symbols, at) - np.eye(3)).max() < 1e-14
    assert np.abs(numbers(product.dual, symbols, at)).max() < 1e-14


def test_its_screws_have_as_many_dimensions_as_it_has_freedoms(joint):
    kind, symbols, row, at, _ = joint
    assert np.linalg.matrix_rank(screws_of(row, symbols, at), tol=1e-9) == kind.freedoms


def relative_velocity(row, symbols, at, rates) -> np.ndarray:
    """Angular velocity, and velocity at the first origin, by a difference of the row's own dual matrix."""
    transform = row_transform(row)
    ahead, behind = (numbers(transform.beside, symbols, at + h * rates) for h in (STEP, -STEP))
    here = numbers(transform.beside, symbols, at)
    rate = (ahead - behind) / (2 * STEP)
    real = rate[:, :3] @ here[:, :3].T
    dual = rate[:, :3] @ here[:, 3:].T + rate[:, 3:] @ here[:, :3].T
    return np.array([m[i, j] - m[j, i] for m in (real, dual) for i, j in ((2, 1), (0, 2), (1, 0))]) / 2


def test_reactions_do_no_work_on_a_free_joint(joint):
    """A wrench that has no effort at any freedom has no power at any relative motion; another one has."""
    kind, symbols, row, at, rng = joint
    screws = screws_of(row, symbols, at)
    paired = np.vstack([screws[3:], screws[:3]])  # force with velocity, moment with angular velocity
    reactions = np.linalg.svd(paired.T)[2][kind.freedoms :]
    assert len(reactions) == 6 - kind.freedoms
    velocity = relative_velocity(row, symbols, at, rng.standard_normal(len(symbols)))
    reciprocal = np.concatenate([velocity[3:], velocity[:3]])
    assert np.abs(reactions @ reciprocal).max() < 1e-9
    assert abs(paired[:, 0] @ reciprocal) > 1e-3
