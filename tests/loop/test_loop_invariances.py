"""Random loops written differently: turned, mirrored, in the other sense, in other scales, orders and names, and back in time."""

from __future__ import annotations

import numpy as np
import pytest
from shared import loop_invariances
from shared.full import full
from shared.loop_invariances import differences
from shared.loop_written import TRANSFORMATIONS, Change, drawn

from symgen.errors import SymgenError

#: Closures are corrected to round-off, which the least singular value of a drawn loop, 0.03, magnifies; forces
#: and accelerations are solutions of systems as well-conditioned.
ROUNDED = 1e-9
NAMES = list(TRANSFORMATIONS)
EACH = 2


def compared(analysis: str, seed: int, chosen) -> int:
    """Compare results of one loop with those of its transformations; return how many."""
    loop, count = drawn(np.random.default_rng(seed), analysis == "forward"), 0
    try:
        expected = getattr(loop_invariances, analysis)(loop)
    except SymgenError:  # a dead centre within the motion
        return 0
    for of in chosen:
        made, by = TRANSFORMATIONS[of](loop, np.random.default_rng([seed, 1]))
        apart = differences(expected, getattr(loop_invariances, analysis)(made), by)
        assert max(apart.values()) < ROUNDED, (analysis, seed, of, loop.joints, loop.lead, apart)
        count += 1
    return count


@pytest.mark.parametrize(("analysis", "seed", "of"), [("inverse", 18, "backward")])
def test_results_do_not_depend_on_how_a_loop_is_written(analysis, seed, of):
    assert compared(analysis, seed, (of,))


@pytest.mark.parametrize(
    ("analysis", "count"), [full("inverse", 100), full("forward", 100), full("many", 20)]
)
def test_results_of_many_loops_do_not_depend_on_how_they_are_written(analysis, count):
    total = 0
    for seed in range(count):
        total += compared(analysis, seed, [NAMES[(EACH * seed + k) % len(NAMES)] for k in range(EACH)])
    assert total >= count


@pytest.mark.parametrize("count", [full(9)])
def test_assemblies_do_not_depend_on_how_a_loop_is_written(count):
    """Of loops without screws and balls: of their few closures a search finds all."""
    done = 0
    for seed in range(10 * count):
        loop = drawn(np.random.default_rng(seed))
        if {"H", "S"}.isdisjoint(loop.joints):
            done += compared("assemblies", seed, [NAMES[done % len(NAMES)]])
        if done == count:
            break
    assert done == count


@pytest.mark.parametrize("count", [full(30)])
def test_forces_do_not_depend_on_the_sense_of_a_motion(count):
    for seed in range(count):
        loop = drawn(np.random.default_rng(seed))
        try:
            ahead = loop_invariances.inverse(loop)
        except SymgenError:
            continue
        back = loop_invariances.inverse(loop, -1.0)
        odd = (".rate", ".angular_velocity")
        expected = {name: -x if name.endswith(odd) else x for name, x in ahead.items()}
        apart = differences(expected, back, Change())
        assert max(apart.values()) < ROUNDED, (seed, apart)
