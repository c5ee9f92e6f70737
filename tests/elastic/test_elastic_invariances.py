"""Random scenes with elastic links written differently: turned, mirrored, moved, in other scales, orders and names."""

from __future__ import annotations

import numpy as np
import pytest
from shared import elastic_drawn, elastic_invariances
from shared.elastic_written import written
from shared.full import full
from shared.in_numpy import build
from shared.invariances import differences
from shared.transformed import TRANSFORMATIONS, Transformed

import symgen
from symgen.errors import SceneError, SymgenError

#: Analyses of each kind of scene.
ANALYSES = {
    "in_plane": ("run", "steady", "static", "sweep", "modes", "large", "equilibrium"),
    "in_space": ("in_space", "quasi_static_in_space", "modes", "equilibrium_in_space"),
}
#: Transformations of each scene in all tests, in turn: builds take most of the time.
EACH = {"in_plane": 3, "in_space": 2}
#: Round-off of a stiffness, over that of bending: 12 (l/h)^2 is up to 1e5 there, and terms are a hundred.
ROUNDED = 1e-9
#: Rounded places of an element and of what holds it, whose forces add.
PLACES = 64
NAMES = list(TRANSFORMATIONS)


def constrained(tables: dict) -> bool:
    """Return whether a linear theory selects unknowns by pivots, which the axes decide, so that steps differ.

    A motor has the errors of the integration of its motion, and runs in space have those of their iterations.
    """
    links = [link for name, link in tables["links"].items() if name != "rail"]
    rigid = any("elastic" not in link or not link["elastic"].get("axial", True) for link in links)
    motor = tables.get("crank", {}).get("mode") == "motor"
    return rigid or motor or "guides" in tables or "crank" not in tables


def compared(kind: str, seed: int, chosen, analyses=None) -> dict[str, int]:
    """Compare results of one scene with those of its transformations; return how many of each analysis."""
    tables = getattr(elastic_drawn, kind)(np.random.default_rng(seed))
    dimension = 2 if kind == "in_plane" else 3
    same = Transformed(np.eye(dimension), np.zeros(dimension))
    expected, counts = {}, dict.fromkeys(ANALYSES[kind], 0)
    try:
        model = build(symgen.Scene(**tables))
    except SceneError:
        return counts
    for name in analyses or ANALYSES[kind]:
        try:
            expected[name] = getattr(elastic_invariances, name)(model, tables, same)
        except SymgenError:  # an analysis that this scene does not have
            continue
    for of in chosen:
        other, by = written(of, tables, np.random.default_rng([seed, 1]))
        model = build(symgen.Scene(**other))
        for name, before in expected.items():
            after = getattr(elastic_invariances, name)(model, other, by)
            results, errors = dict(before), {}
            both = [x.pop("errors", {}) for x in (results, after)]
            if constrained(tables) and both[0]:  # outputs without a stated error are not compared
                errors = {word: both[0][word] + both[1][word] for word in both[0]}
                results = {k: v for k, v in results.items() if k.rpartition(".")[2] in errors}
            rounded = ROUNDED + PLACES * elastic_invariances.round_off(tables, by, before)
            apart = differences(results, after, by)
            beyond = {word: x for word, x in apart.items() if not x < rounded + errors.get(word, 0.0)}
            assert not beyond, (kind, seed, of, name, beyond, errors, rounded)
            counts[name] += 1
    return counts


@pytest.mark.parametrize(
    ("kind", "seed", "of"),
    [
        ("in_plane", 8, "mirrored"),
        ("in_plane", 18, "reordered"),
        ("in_space", 5, "scaled"),
        ("in_space", 6, "turned"),
    ],
)
def test_results_do_not_depend_on_how_a_scene_is_written(kind, seed, of):
    assert sum(compared(kind, seed, (of,)).values())


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("kind", "count"), [full(kind, 100) for kind in ANALYSES])
def test_results_of_many_scenes_do_not_depend_on_how_they_are_written(kind, count):
    total = dict.fromkeys(ANALYSES[kind], 0)
    for seed in range(count):
        chosen = [NAMES[(EACH[kind] * seed + k) % len(NAMES)] for k in range(EACH[kind])]
        for name, compared_with in compared(kind, seed, chosen).items():
            total[name] += compared_with
    assert min(total.values()) >= count / 10, total


@pytest.mark.parametrize("seeds", [range(6, 7), full(range(100))])
def test_static_shapes_do_not_depend_on_the_sense_of_rotation(seeds):
    """Without damping, forces of the reverse motion are those of the same poses, and powers change sign."""
    same, compared_with = Transformed(np.eye(2), np.zeros(2)), 0
    for seed in seeds:
        tables = elastic_drawn.undamped(elastic_drawn.in_plane(np.random.default_rng(seed)))
        if "pace" not in tables["parameters"] or "mode" in tables["crank"]:
            continue
        try:
            ahead, back = elastic_invariances.there_and_back(build(symgen.Scene(**tables)))
        except SceneError:
            continue
        apart = differences(ahead, back, same)
        allowed = ROUNDED + PLACES * elastic_invariances.round_off(tables, same, ahead)
        assert max(apart.values()) < allowed, (seed, apart)
        compared_with += 1
    assert compared_with >= len(seeds) / 4


def test_springs_between_links_in_large_rotation_do_not_depend_on_the_order_of_points():
    """Where one link ends on the ground, the joint moves with its section, and the other link follows."""
    at = {"O": (0, 0), "A": (0.1, 0.02), "B": (0.3, 0.35), "Q": (0.4, 0)}
    bar = {
        "density": "2700 kg/m^3",
        "section": {"width": "15 mm", "thickness": "5 mm"},
        "elastic": {"E": "70 GPa", "elements": 2},
    }
    energies = []
    for first, second in (("AB", "BQ"), ("BA", "QB")):
        drawn = [np.arctan2(*np.subtract(at[q], at[p])[::-1]) for p, q in (first, second)]
        angle = float((drawn[0] - drawn[1] + 0.5 + np.pi) % (2 * np.pi) - np.pi)
        spring = {"link": "L1", "against": "L2", "point": "B", "stiffness": "2 N*m", "angle": angle}
        scene = symgen.Scene(
            points={p: {"at": [f"{x} m" for x in xy], "ground": p in "OQ"} for p, xy in at.items()},
            links={
                "L0": {"points": ["O", "A"], "mass": "0.2 kg"},
                "L1": {"points": list(first), **bar},
                "L2": {"points": list(second), **bar},
            },
            crank={"link": "L0", "speed": "10 rad/s"},
            torsion_springs=[spring],
        )
        run = build(scene).large_rotation(elements=2, revolutions=0.005, samples=3, rtol=5e-4)
        energies.append(run["strain_energy"].values[-1])
    assert energies[0] == pytest.approx(energies[1], rel=1e-9)
