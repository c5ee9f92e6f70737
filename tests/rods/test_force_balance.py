"""Forces at joints, reactions and accelerations of random linkages: balance of each link and each point."""

from __future__ import annotations

import pytest
from shared.force_balance import missing, random_linkage, samples, shaken
from shared.full import full_unless
from shared.in_numpy import build
from shared.linkages import at, ground

import symgen
from symgen.errors import SceneError

SEEDS = 300
#: Over the largest force of a sample.
TOLERANCE = 1e-10


@pytest.mark.parametrize(
    ("seed",), full_unless(lambda seed: seed in (2, 7, 10, 12), [(k,) for k in range(SEEDS)])
)
def test_forces_balance_on_every_link(seed):
    """Newton's and Euler's equations, with all loads at once, at the start and in motion."""
    made = random_linkage(seed)
    try:
        model = build(symgen.Scene(**made.tables))
    except SceneError as error:  # a loop that holds the driven link
        assert "is not independent of the others" in error.problem
        made = random_linkage(seed, driven=False)
        model = build(symgen.Scene(**made.tables))
    run = model.simulate(0.1, samples=2, rtol=1e-5)
    for sample in samples(run):
        for name, rest in missing(made, sample):
            assert rest < TOLERANCE, (name, sample.t)
        for name, rest in shaken(made, sample):
            assert rest < TOLERANCE, ("whole", name, sample.t)


def test_the_draw_covers_every_kind_of_load():
    tables = [random_linkage(seed).tables for seed in range(SEEDS)]
    for half in (tables[::2], tables[1::2]):
        for table in ("masses", "springs", "actuators", "forces", "torques"):
            assert all(table in scene for scene in half)
        for table in ("torsion_springs", "guides", "drivers"):
            assert sum(table in scene for scene in half) > 25, table
        assert sum("motion" in str(scene["points"]) for scene in half) > 25
        assert sum(any("centre" in str(k) for k in scene["links"].values()) for scene in half) > 25
    assert all("distributed_forces" in scene for scene in tables[::2])
    assert sum("'link': 'L" in str(scene["forces"]) for scene in tables) > 100


@pytest.mark.parametrize("mass", [0.0, 2.0])
@pytest.mark.parametrize("axes", [{}, {"link": "rod"}])
def test_a_force_at_the_end_of_a_rod(axes, mass):
    """F l = (m/3 + M) l^2 theta'': the end of the rod gets F less M times its acceleration, however it is written."""
    scene = symgen.Scene(
        points={"O": ground(0.0, 0.0), "P": at(1.0, 0.0)},
        links={"rod": {"points": ["O", "P"], "mass": "1 kg"}},
        masses=[{"point": "P", "mass": f"{mass} kg"}],
        forces=[{"point": "P", "force": ["0 N", "3 N"], **axes}],
        analysis={"outputs": ["rod.P.force", "O.reaction"]},
    )
    run = build(scene).simulate(0.01, samples=2)
    acceleration = 3.0 / (1 / 3 + mass)
    assert run["rod.P.force"].values[0] == pytest.approx([0.0, 3.0 - mass * acceleration], abs=1e-12)
    assert run["O.reaction"].values[0] == pytest.approx([0.0, (0.5 + mass) * acceleration - 3.0], abs=1e-12)
