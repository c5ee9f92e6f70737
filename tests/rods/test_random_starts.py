"""Starts of random and of shipped scenes against plain geometry."""

from __future__ import annotations

import pytest
from shared.full import full
from shared.written_linkages import judged, worst_miss

import symgen
from symgen.scene.loading import SHIPPED, read_scene

#: Errors of positions over the size of a linkage that rounding leaves.
ROUNDING = 1e-13
POINTS_AND_LINKS = [p.stem for p in sorted(SHIPPED.glob("*.toml")) if "loop" not in read_scene(p.stem).data]


@pytest.mark.parametrize(("count", "least"), [(6, 5), full(200, 170)])
def test_starts_of_random_scenes(count, least):
    outcomes, errors = judged(range(count))
    assert {seed: error for seed, error in errors.items() if error > ROUNDING} == {}
    assert outcomes["started"] >= least, outcomes


@pytest.mark.parametrize("name", POINTS_AND_LINKS)
def test_starts_of_shipped_scenes(name):
    assert worst_miss(name, symgen.build(name, backend="numpy")) < ROUNDING
