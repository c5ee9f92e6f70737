"""Starts of driven linkages of dyads, drawn anywhere, against circles that are intersected one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from shared.full import full
from shared.linkages import circles

import symgen
from symgen.errors import InitialStateError, SceneError
from symgen.runtime.rods import search

#: Errors of positions [m] that rounding leaves, magnified near stretched dyads, where circles touch.
ROUNDING = 1e-9
#: Least height of a dyad [m] and least drawn height: flatter ones have no side.
FLAT = 1e-3
#: Points of each dyad: its base points and its own point, with the links between them.
DYADS = {"B": ("A", "C"), "E": ("D", "F")}
DRIVERS = {"drivers": [{"link": "crank", "angle": "angle + w*t"}]}
LENGTHS = ("a", "b", "c", "d", "e")


def scene(bars, reverse=False, released=False):
    """A driven or released four-bar or six-bar linkage; drawing, lengths and angle are tunable parameters."""
    names = "OAB" + "C" * (bars > 3) + "EF" * (bars > 4)
    values = {f"{point}{axis}": "1 m" for point in names for axis in "xy"} | dict.fromkeys(LENGTHS, "1 m")
    values |= {"offset": "0.1 m", "angle": "1 rad", "Ax": "0.5 m", "By": "0.8 m", "Ey": "0.3 m", "Fx": "2 m"}
    points = {p: {"at": [f"{p}x", f"{p}y"]} | ({"ground": True} if p in "OCF" else {}) for p in names}
    links = {
        "crank": {"points": ["O", "A"], "mass": "1 kg", "length": "a"},
        "coupler": {"points": ["A", "B"], "mass": "1 kg", "length": "b"},
        "rocker": {"points": ["B", "C"], "mass": "1 kg", "length": "c"},
    }
    if bars > 4:
        points["D"] = {"on": "rocker", "fraction": 0.5, "offset": "offset"}
        links["rod"] = {"points": ["D", "E"], "mass": "1 kg", "length": "d"}
        links["swing"] = {"points": ["E", "F"], "mass": "1 kg", "length": "e"}
    if reverse:
        points, links = dict(reversed(points.items())), dict(reversed(links.items()))
    tunable = {name: {"value": value, "tunable": True} for name, value in values.items()}
    return symgen.Scene(
        parameters={"w": "1 rad/s"} | tunable,
        points=points,
        links=links,
        **({"start": {"angles": {"crank": "angle"}}} if released else DRIVERS),
    )


def turned(vector):
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def height(places, point):
    """Height of a dyad's point above the line of its base points, to the left positive."""
    base, other = (places[p] for p in DYADS[point])
    return turned(other - base) @ (places[point] - base) / np.hypot(*(other - base))


def on_the_rocker(places, numbers):
    """The place of D, rigid with the rocker; a drawing of another size has it in proportion."""
    along = places["C"] - places["B"]
    return (places["B"] + places["C"]) / 2 + numbers["offset"] / numbers["c"] * turned(along)


def poses(bars, numbers, places):
    """All poses with the sides of their dyads, from the places of the ground."""
    found = {}
    crank = numbers["a"] * np.array([np.cos(numbers["angle"]), np.sin(numbers["angle"])])
    for sides in product((1, -1), repeat=1 + (bars > 4)):
        pose = places | {"A": places["O"] + crank}
        with np.errstate(invalid="ignore"):
            pose["B"] = circles(pose["A"], places["C"], numbers["b"], numbers["c"], sides[0])
            if bars > 4:
                pose["D"] = on_the_rocker(pose, numbers)
                pose["E"] = circles(pose["D"], places["F"], numbers["d"], numbers["e"], sides[1])
        if all(np.isfinite(pose[p]).all() and abs(height(pose, p)) > FLAT for p in list("BE")[: len(sides)]):
            found[sides] = pose
    return found


def cases(bars, count):
    """Random linkages that close, each with a drawing that is no guide to it: lengths, drawing, poses."""
    rng = np.random.default_rng(bars)
    while count:
        numbers = dict(zip(LENGTHS, rng.uniform(0.2, 1.2, 5), strict=True))
        numbers |= {"offset": rng.uniform(-0.5, 0.5), "angle": rng.uniform(-np.pi, np.pi)}
        drawn = {p: rng.uniform(-1, 1, 2) + (0.5, 0) for p in ("ABCE" if bars > 4 else "ABC")}
        drawn |= {"O": np.zeros(2)} | ({"F": rng.uniform(-1, 1, 2) + (1.5, 0)} if bars > 4 else {})
        ends = [p for p in drawn if p in "OCF"]
        closed = poses(bars, numbers, {p: drawn[p] for p in ends})
        if bars > 4:
            drawn["D"] = on_the_rocker(drawn, numbers)
        if closed and all(abs(height(drawn, p)) > FLAT for p in list("BE")[: 1 + (bars > 4)]):
            count -= 1
            yield numbers, drawn, closed


def started(model, numbers, drawn):
    places = {
        f"{p}{axis}": x for p, at in drawn.items() if p != "D" for axis, x in zip("xy", at, strict=True)
    }
    used = {p.name for p in model.description.tunable}
    return model.with_parameters(**{k: v for k, v in (numbers | places).items() if k in used}).initial_state()


@pytest.mark.parametrize(
    ("bars", "count", "released"),
    [
        (4, 40, False),
        (4, 20, True),
        (6, 40, False),
        full(4, 2000, False),
        full(4, 500, True),
        full(6, 2000, False),
    ],
)
def test_linkages_whose_circles_intersect_start(bars, count, released):
    """On the drawn side of every dyad, or where they do not close so, with fewest dyads on their other side."""
    model = symgen.build(scene(bars, released=released), backend="numpy")
    for numbers, drawn, closed in cases(bars, count):
        positions = started(model, numbers, drawn).positions
        own = [1 if height(drawn, p) > 0 else -1 for p in list("BE")[: 1 + (bars > 4)]]
        others = {sides: int(np.sum(np.array(sides) != own)) for sides in closed}
        best = [closed[sides] for sides in closed if others[sides] == min(others.values())]
        apart = [max(np.abs(positions[p] - x).max() for p, x in pose.items()) for pose in best]
        assert min(apart) < ROUNDING, (numbers, drawn)


@pytest.mark.parametrize(("bars", "count"), [(4, 8), (6, 8), full(4, 500), full(6, 500)])
def test_starts_do_not_depend_on_orientation_and_order(bars, count):
    model, reordered = (symgen.build(scene(bars, order), backend="numpy") for order in (False, True))
    for numbers, drawn, _ in cases(bars, count):
        positions = started(model, numbers, drawn).positions
        for angle, mirror in ((0.0, 1.0), (np.pi / 6, 1.0), (2.0, 1.0), (0.0, -1.0)):
            axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            axes = axes @ np.diag([1.0, mirror])
            moved = numbers | {
                "angle": mirror * numbers["angle"] + angle,
                "offset": mirror * numbers["offset"],
            }
            state = started(reordered, moved, {p: axes @ x for p, x in drawn.items()})
            for point, place in positions.items():
                assert state.positions[point] == pytest.approx(axes @ place, abs=ROUNDING), (numbers, drawn)


TRIAD = {"crank": "FE", "third": "PE", "first": "OA", "second": "CB", "ternary": "AB"}


def triad(rng):
    """A ternary link A B P on three links, one of them on the driven crank: lengths and angle of a random pose."""
    at = dict(zip("OCFABE", rng.uniform(-1, 1, (6, 2)), strict=True))
    offset, along, crank = rng.uniform(-0.5, 0.5), at["B"] - at["A"], at["E"] - at["F"]
    at["P"] = (at["A"] + at["B"]) / 2 + offset * turned(along) / np.hypot(*along)
    lengths = {name: np.hypot(*(at[x] - at[y])) for name, (x, y) in TRIAD.items()}
    return lengths | {"offset": offset, "angle": np.arctan2(crank[1], crank[0])}, at


@pytest.mark.parametrize("count", [20, full(500)])
def test_driven_triads_start(count):
    rng = np.random.default_rng(3)
    numbers, at = triad(rng)
    numbers |= {f"{p}{axis}": x for p in "OCFABE" for axis, x in zip("xy", at[p], strict=True)}
    points = {p: {"at": [f"{p}x", f"{p}y"]} | ({"ground": True} if p in "OCF" else {}) for p in "OCFABE"}
    unit = dict.fromkeys(numbers, "m") | {"angle": "rad"}
    tunable = {name: {"value": f"{float(x)!r} {unit[name]}", "tunable": True} for name, x in numbers.items()}
    scene = symgen.Scene(
        parameters={"w": "1 rad/s"} | tunable,
        points=points | {"P": {"on": "ternary", "fraction": 0.5, "offset": "offset"}},
        links={name: {"points": [*ends], "mass": "1 kg", "length": name} for name, ends in TRIAD.items()},
        **DRIVERS,
    )
    model = symgen.build(scene, backend="numpy")
    for _ in range(count):
        numbers, at = triad(rng)
        drawn = {p: at[p] if p in "OCF" else rng.uniform(-1, 1, 2) for p in points}
        found = started(model, numbers, drawn).positions
        assert found["E"] == pytest.approx(at["E"], abs=ROUNDING)
        for name, (x, y) in TRIAD.items():
            assert np.hypot(*(found[x] - found[y])) == pytest.approx(numbers[name], abs=ROUNDING)


def test_variants_start_alone_and_in_one_call_alike():
    model = symgen.build(scene(4), backend="c")
    numbers, drawn, _ = zip(*cases(4, 40), strict=True)
    columns = {name: [n[name] for n in numbers] for name in (*LENGTHS[:3], "angle")}
    columns |= {f"{p}{axis}": [d[p][i] for d in drawn] for p in drawn[0] for i, axis in enumerate("xy")}
    runs = model.simulate_many(columns, t_end=1e-6, samples=2)
    alone = [started(model, n, d).positions["B"] for n, d in zip(numbers, drawn, strict=True)]
    np.testing.assert_allclose(runs["B.position"].values[:, 0], alone, atol=ROUNDING)


def test_a_dyad_that_cannot_close_is_refused_without_a_search(monkeypatch):
    """Closed forms tell; a search takes hundreds of times as long, in each design of a sweep without a start."""
    monkeypatch.setattr(search, "search", lambda *_: pytest.fail("a search"))
    model = symgen.build(scene(4), backend="numpy")
    with pytest.raises(InitialStateError, match="cannot be assembled"):
        model.with_parameters(b=0.1, c=0.2).initial_state()


def test_assemblies_of_a_sketch_drawn_far_from_the_start():
    """Its lengths block every path from the drawing at 20 degrees to the crank angle."""
    model = symgen.build(scene(4), backend="numpy")
    numbers = {"a": 0.5929, "b": 1.1257, "c": 0.4152, "angle": -1.8085}
    crank = 0.5929 * np.array([np.cos(0.35), np.sin(0.35)])
    drawn = {"O": np.zeros(2), "C": np.array([0.5157, 0.0]), "A": crank, "B": np.array([0.7, 0.4])}
    closed = poses(4, numbers, {p: drawn[p] for p in "OC"})
    drives = {f"{p}{axis}": x for p, at in drawn.items() for axis, x in zip("xy", at, strict=True)}
    found = model.with_parameters(**numbers, **drives).assemblies()
    assert found.complete and len(found) == len(closed) == 2
    for pose in closed.values():
        assert min(np.abs(state.positions["B"] - pose["B"]).max() for state in found) < 1e-12


def legs(rng):
    """A triangle of rods on three parallel legs, one of them driven: its lengths, and a rough drawing."""
    at = {f"F{i}": np.array([rng.uniform(0.5, 1) * i, rng.uniform(-0.3, 0.3)]) for i in range(3)}
    at |= {f"T{i}": at[f"F{i}"] + shift for shift in [rng.uniform(-1, 1, 2)] for i in range(3)}
    ends = {f"leg{i}": (f"F{i}", f"T{i}") for i in range(3)}
    return at, ends | {f"side{i}": (f"T{i}", f"T{(i + 1) % 3}") for i in range(3)}, 0.4


def six_bar(rng):
    """Two dyads on a crank that nothing prescribes: its lengths, and a drawing that is no guide to them."""
    at = dict(zip("OCFABE", rng.uniform(-1, 1, (6, 2)), strict=True))
    return at, dict(zip(("OA", "AB", "BC", "BE", "EF"), ("OA", "AB", "BC", "BE", "EF"), strict=True)), 2.0


@pytest.mark.parametrize(("make", "driven"), [(legs, True), (legs, False), (six_bar, False)])
@pytest.mark.parametrize("count", [20, full(200)])
def test_redundant_linkages_and_free_ones_start(make, driven, count):
    rng, model, failed = np.random.default_rng(7), None, 0
    for _ in range(count):
        at, ends, rough = make(rng)
        lengths = {f"l_{k}": float(np.hypot(*(at[a] - at[b]))) for k, (a, b) in ends.items()}
        ground = [p for p in at if p in "OCF" or p[0] == "F"]
        drawn = {p: x if p in ground else x + rng.uniform(-rough, rough, 2) for p, x in at.items()}
        values = lengths | {
            f"{p}{axis}": float(v) for p, x in drawn.items() for axis, v in zip("xy", x, strict=True)
        }
        tunable = {k: {"value": f"{x!r} m", "tunable": True} for k, x in values.items()}
        direction = at["T0"] - at["F0"] if driven else np.array([1.0, 0.0])
        values |= {"angle": float(np.arctan2(direction[1], direction[0]))} if driven else {}
        tunable |= {"angle": {"value": f"{values['angle']!r} rad", "tunable": True}} if driven else {}
        if model is None:
            scene = symgen.Scene(
                parameters={"w": "1 rad/s"} | tunable,
                points={p: {"at": [f"{p}x", f"{p}y"], "ground": p in ground} for p in at},
                links={
                    k: {"points": [*pair], "mass": "1 kg", "length": f"l_{k}"} for k, pair in ends.items()
                },
                drivers=[{"link": "leg0", "angle": "angle + w*t"}] if driven else [],
            )
            model = symgen.build(scene, backend="numpy")
        try:
            found = model.with_parameters(**values).initial_state().positions
        except InitialStateError:
            failed += 1
            continue
        for k, (a, b) in ends.items():
            assert np.hypot(*(found[a] - found[b])) == pytest.approx(lengths[f"l_{k}"], abs=ROUNDING)
        if driven:
            along = found["T0"] - found["F0"]
            assert along @ direction == pytest.approx(np.hypot(*along) * np.hypot(*direction), abs=ROUNDING)
    assert failed <= max(1, 0.02 * count)  # of nearly flat triangles


@pytest.mark.parametrize("angle", ["1.7", "2 + w*t"])
def test_more_drives_than_freedoms_are_counted(angle):
    drivers = [{"link": "crank", "angle": "w*t"}, {"link": "rocker", "angle": angle}]
    data = {
        "parameters": {"w": "1 rad/s"},
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["0.1 m", "0.2 m"]},
            "B": {"at": ["0.5 m", "0.4 m"]},
            "C": {"at": ["0.6 m", "0 m"], "ground": True},
        },
        "links": {
            name: {"points": list(ends), "mass": "1 kg"}
            for name, ends in (("crank", "OA"), ("coupler", "AB"), ("rocker", "BC"))
        },
    }
    with pytest.raises(SceneError, match="has 1 freedom and 2 drives.* link crank, .* link rocker") as caught:
        symgen.build(symgen.Scene(**data, drivers=drivers), backend="numpy").initial_state()
    assert caught.value.where == "drivers.1"
    one = symgen.build(symgen.Scene(**data, drivers=drivers[:1]), backend="numpy")
    assert one.mobility[0] == "4 coordinates, 4 constraints (1 drive): 0 degrees of freedom at the start"
