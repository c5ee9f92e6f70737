"""Random linkages written differently: turned, mirrored, moved, in other scales, orders and names, and back in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shared import invariances, invariant_scenes
from shared.full import full
from shared.in_numpy import build
from shared.transformed import TRANSFORMATIONS, Transformed

import symgen
from symgen.errors import SceneError, SymgenError

#: Analysis, its scenes, their axes, and the largest difference over the size of a result.
ANALYSES = {
    "starts": ("start", "moving", 2, 1e-9),
    "starts in space": ("start", "moving", 3, 1e-9),
    "runs": ("run", "moving", 2, 1e-9),
    "runs in space": ("run", "moving", 3, 1e-9),
    "equilibria and modes": ("equilibrium", "resting", 2, 1e-9),
    "equilibria and modes in space": ("equilibrium", "resting", 3, 1e-9),
    "driven": ("driven", "driven", 2, 1e-9),
    "assemblies": ("assemblies", "driven", 2, 1e-9),
    "assemblies by search": ("assemblies", "entangled", 2, 1e-9),
    "sweeps": ("sweep", "moving", 2, 1e-9),
}
#: Analysis, scene and transformation of the default tests.
DEFAULT = [
    ("starts", 3, "turned"),
    ("equilibria and modes", 9, "turned"),
    ("equilibria and modes", 0, "reordered"),
    ("equilibria and modes in space", 408, "reordered"),  # with neutral freedoms
    ("driven", 1, "reordered"),
    ("assemblies", 105, "reordered"),
    ("assemblies by search", 1, "turned"),
]
#: Scenes of each analysis in all tests, in blocks; transformations of each scene, taken in turns.
BLOCKS, SCENES, EACH = 5, 20, 2


def drawn(maker: str, dimension: int, seed: int) -> dict:
    return getattr(invariant_scenes, maker)(np.random.default_rng(seed), dimension)


def compared(kind: str, seed: int, chosen=tuple(TRANSFORMATIONS)) -> bool | None:
    """Compare the results of one scene with those of its transformations; None for a scene that is refused."""
    name, maker, dimension, allowed = ANALYSES[kind]
    analysis, tables = getattr(invariances, name), drawn(maker, dimension, seed)
    order = tuple(p for p in tables["points"])
    try:
        expected = analysis(tables, Transformed(np.eye(dimension), np.zeros(dimension), order=order))
    except SymgenError:  # contradictory start rates, lengths that cannot be met, nothing that is free
        return None
    if "frequencies" in expected:  # round-off of the forces, over the least stiffness
        values = expected["frequencies"]
        least = max(float(np.min(values)), 1e-7 * float(np.max(values)))  # a root of round-off, if not zero
        allowed = max(allowed, min(1e-14 * (np.max(values) / least) ** 2, 1e-6))
    for of in chosen:
        other, by = TRANSFORMATIONS[of](tables, np.random.default_rng([seed, 1]))
        by = replace(by, order=order)
        apart = invariances.differences(expected, analysis(other, by), by)
        assert max(apart.values()) < allowed, (kind, seed, of, apart)
    return True


@pytest.mark.parametrize(("kind", "seed", "of"), DEFAULT)
def test_results_do_not_depend_on_how_a_scene_is_written(kind, seed, of):
    assert compared(kind, seed, (of,))


@pytest.mark.parametrize("block", range(BLOCKS))
@pytest.mark.parametrize("kind", [full(kind) for kind in ANALYSES])
def test_results_of_many_scenes_do_not_depend_on_how_they_are_written(kind, block):
    names, done = list(TRANSFORMATIONS), 0
    for seed in range(100 * block, 100 * block + 3 * SCENES):
        chosen = [names[(EACH * done + i) % len(names)] for i in range(EACH)]
        done += bool(compared(kind, seed, chosen))
        if done == SCENES:
            break
    assert done == SCENES


def reversible(dimension: int, seed: int, damped: bool) -> symgen.Scene:
    """Return a scene whose springs have no damping; ``damped``: -c times its velocity acts on a point."""
    tables = drawn("resting", dimension, seed)
    for spring in (*tables["springs"], *tables.get("torsion_springs", ())):
        spring.pop("damping")
    if damped:
        point = tables["forces"][0]["point"]
        force = [f"-c*{point}.v{axis}" for axis in "xyz"[:dimension]]
        tables["forces"].append({"point": point, "force": force})
        tables["parameters"] = {"c": {"value": "5 N*s/m", "tunable": True}}
    return symgen.Scene(**tables)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize(("dimension", "scenes"), [(2, 2), full(2, 100), full(3, 50)])
def test_motions_return_when_time_is_reversed(dimension, scenes, damped):
    """With negative damping; the smaller the tolerance, the nearer.

    Errors of runs follow the tolerance. With a thousandth of it they are smaller even where the larger happens to
    pass through zero, or the smaller is rounding that the motion magnifies.
    """
    returned = 0
    for seed in range(3 * scenes):
        try:
            model = build(reversible(dimension, seed, damped))
        except SceneError:
            continue
        back, free = model.with_parameters(c=-5.0) if damped else model, model.description.free
        begin, errors = model.initial_state(), []
        for rtol in (1e-9, 1e-12):
            ahead = model.simulate(0.1, rtol=rtol, atol=rtol, samples=2).final
            velocities = {p: -np.asarray(ahead[p]["velocity"]) for p in free}
            state = back.state({p: ahead[p]["position"] for p in free}, velocities)
            end = back.simulate(0.1, rtol=rtol, atol=rtol, samples=2, state=state).final
            errors.append(max(np.max(np.abs(end[p]["position"] - begin.positions[p])) for p in free))
        size = max(np.max(np.abs(x)) for x in begin.positions.values())
        assert errors[0] < 1e-6 * size, (seed, errors)
        assert errors[1] < max(errors[0], 1e-12 * size), (seed, errors)
        returned += 1
        if returned == scenes:
            return
    pytest.fail(f"{returned} scenes")
