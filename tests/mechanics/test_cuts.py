"""Cuts selected by the user: Attia's system of 28 equations, and any other cuts that leave no loop."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from shared.commands import call
from shared.full import full_unless
from shared.momentum import chain_system, equations, from_reference, solved
from shared.random_mechanisms import draw
from shared.shipped import rigid
from shared.states import outputs_at_start

import symgen
from symgen.errors import ModelError
from symgen.mechanics.rods.momentum import on_loop, open_tree
from symgen.models.momentum.rows import momentum_system
from symgen.models.rods.linkage import RodsModel
from symgen.scene.resolve import resolve

#: Fig. 4b: the chain O A B C D E, and the branches BE and AD.
FIG_4B = ("AD.A", "BE.B", "AD.D", "DE.E", "BE.E")


def test_the_paper_has_28_equations():
    """Chain O A B C D E by (12) and (14), branches by (12), (14), (15), five cuts of two equations each."""
    system = symgen.derive("peaucellier", cut=FIG_4B)
    matrix = system["matrix"]
    assert matrix.matrix.shape == (28, 28)
    assert sum(name.endswith(("_ax", "_ay")) for name in matrix.columns) == 18
    assert sum("_cut_" in name for name in matrix.columns) == 10
    count = {ending: sum(m.name.endswith(ending) for m in system.matrices)
             for ending in ("_moment", "_length", "_momentum", "_closure")}  # fmt: skip
    assert count == {"_moment": 7, "_length": 7, "_momentum": 2, "_closure": 5}
    assert system["AD_A_closure"].matrix[0] == sp.Symbol("AD_A_ax", real=True) - sp.Symbol("A_ax", real=True)
    assert system["BE_E_closure"].matrix[0] == sp.Symbol("BE_E_ax", real=True)
    assert "AD where it is cut at A" in next(x.description for x in system.quantities() if x.name == "AD_A_x")


@pytest.mark.parametrize("case", ["peaucellier_rest_horizontal", "peaucellier_moving"])
def test_the_28_equations_are_those_of_the_print_and_have_the_reference_as_solution(case):
    """The chain's rows are Eqs. (12) and (14) in numbers; accelerations are those of 30 digits."""
    n, place, speed, _, rods, gravity = from_reference(f"rods_{case}")
    points = dict(zip("OABCDE", range(6), strict=True))
    model = symgen.build("peaucellier")
    state = model.state({p: place[i] for p, i in points.items()}, {p: speed[i] for p, i in points.items()})
    rows = momentum_system(resolve(symgen.load_scene("peaucellier")), FIG_4B, joined=True)
    found = solved(rows, model, state)
    a, b = equations(rows, model, state)

    chain = [points[p] for p in "OABCDE"]
    expected, right = chain_system(place[chain], speed[chain], rods[:5], gravity)
    names = [f"{p}_a{axis}" for p in ("A", "B", "C", "D", "DE_E") for axis in "xy"]
    mine = [rows["matrix"].rows.index(x) for k in ("OA", "AB", "BC", "CD", "DE") for x in (k, f"{k}_length")]
    part = a[np.ix_(mine, [rows["matrix"].columns.index(x) for x in names])]
    np.testing.assert_allclose(part, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))
    np.testing.assert_allclose(b[mine], right, rtol=0, atol=1e-13 * np.max(np.abs(right)))

    exact = np.array(n["acc"], dtype=float)
    size = np.max(np.abs(exact))
    own = {"AD_A": "A", "AD_D": "D", "BE_B": "B", "BE_E": "E", "DE_E": "E"}
    for point in (*"ABCD", *own):
        mine = [found[f"{point}_ax"], found[f"{point}_ay"]]
        assert np.max(np.abs(mine - exact[points[own.get(point, point)]])) < 1e-11 * size, point
    ground = np.array(n["ground_reaction"]["5"], dtype=float)
    forces = [sum(found[f"{k}_E_cut_{axis}"] for k in ("DE", "BE")) for axis in "xy"]
    assert np.max(np.abs(forces - ground)) < 1e-11 * np.max(np.abs(ground))


def any_cuts(rng, scene):
    """Cuts in any order that leave no loop; branches may be separated, as in Fig. 4b."""
    model = RodsModel(resolve(scene))
    bodies = {k.name: (*k.base, *(c.name for c in k.carried)) for k in model.rods}
    ground = [p for p in model.points if model.is_fixed(p)]
    joints = [(k, p) for k, its in bodies.items() for p in its if on_loop(ground, bodies, k, p)]
    left = {k: list(its) for k, its in bodies.items()}
    cuts = []
    for i in rng.permutation(len(joints)):
        link, point = joints[i]
        free = [p for p in {q for its in left.values() for q in its} if p not in ground]
        if not open_tree(ground, free, left).cuts:
            break
        if point in ground or sum(point in its for its in left.values()) > 1:
            left[link][left[link].index(point)] = f"{link}.{point}"
            cuts.append(f"{link}.{point}")
    return cuts


def agrees_with_the_model(scene, cuts, tolerance=1e-11):
    """Accelerations of points and of particles of cut links are those of the kernels, and so are the forces."""
    named = {"analysis.outputs": [f"{cut}.force" for cut in cuts]}
    model = rigid(symgen.build(scene, set=named))
    text = symgen.load_scene(scene) if isinstance(scene, str) else scene
    state = model.initial_state()
    found = solved(momentum_system(resolve(text), cuts, joined=True), model, state)
    expected, axes = model.accelerations(state), model.description.axes
    forces = outputs_at_start(model)
    size, force = (max(np.max(np.abs(x)) for x in of.values()) for of in (expected.points, forces))
    for point in model.description.free:
        mine = [found[f"{point}_a{axis}"] for axis in axes]
        assert np.max(np.abs(mine - expected[point])) <= tolerance * size, point
    for cut in cuts:
        link, point = cut.split(".")
        if f"{link}_{point}_ax" in found:
            mine = [found[f"{link}_{point}_a{axis}"] for axis in axes]
            assert np.max(np.abs(mine - expected[point])) <= tolerance * size, cut
        mine = [found[f"{link}_{point}_cut_{axis}"] for axis in axes]
        if not model.redundant:
            assert np.max(np.abs(mine - forces[f"{cut}.force"])) <= tolerance * force, cut


RANDOM = [
    (dimension, count, free, seed)
    for dimension, count, free in ((2, 7, True), (3, 5, False), (2, 6, False), (3, 6, True))
    for seed in range(4)
]


@pytest.mark.parametrize(("case",), full_unless(lambda c: c in RANDOM[:5:4], ((c,) for c in RANDOM)), ids=str)
def test_any_cuts_of_random_loops(case):
    dimension, count, free, seed = case
    rng = np.random.default_rng([dimension, count, seed])
    scene, _, _, _ = draw(rng, dimension, count, "loop", free)
    cuts = any_cuts(rng, scene)
    assert cuts
    agrees_with_the_model(scene, cuts)


@pytest.mark.parametrize(
    "scene",
    full_unless(
        lambda scene: scene == "andrews_squeezer", ("andrews_squeezer", "parallelogram", "double_four_bar")
    ),
)
def test_shipped_scenes(scene):
    """Bodies with three points; redundant constraints."""
    rng = np.random.default_rng(5)
    cuts = any_cuts(rng, symgen.load_scene(scene))
    assert cuts
    agrees_with_the_model(scene, cuts)


def test_a_cut_from_moving_ground_with_loads():
    """Its constraint has the acceleration of the ground; loads at the joint stay there."""
    scene = symgen.Scene(
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "C": {"at": ["2 m", "0 m"], "ground": True, "motion": ["0 m", "0.05*unit*sin(6*t*hz)"]},
            "A": {"at": ["0.2 m", "0.5 m"]},
            "B": {"at": ["1.7 m", "1 m"]},
            "P": {"on": "coupler", "fraction": 0.7},
            "T": {"at": ["1 m", "-0.8 m"]},
        },
        parameters={"unit": "1 m", "hz": "1 rad/s"},
        links={
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "coupler": {"points": ["A", "B"], "mass": "2 kg"},
            "rocker": {"points": ["C", "B"], "mass": "1.5 kg"},
            "strut": {"points": ["P", "T"], "mass": "0.4 kg"},
            "foot": {"points": ["O", "T"], "mass": "0.6 kg"},
        },
        masses=[{"point": "B", "mass": "0.3 kg"}],
        springs=[{"between": ["B", "O"], "stiffness": "40 N/m", "length": "1 m"}],
        torques=[{"link": "coupler", "against": "crank", "torque": "3 N*m"}],
        forces=[{"point": "T", "force": ["2 N", "-1 N"]}],
        gravity={"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    )
    for cuts in (["rocker.C", "strut.T"], ["rocker.B", "coupler.P"], ["coupler.B", "rocker.C", "foot.O"]):
        agrees_with_the_model(scene, cuts)


WRONG = {
    "AD": r"expected LINK.POINT for a cut, such as OA.A, got 'AD'",
    "AX.A": "peaucellier has no moving link 'AX'. Known: AB, AD,",
    "AD.X": "link AD has no point 'X'. Known: A, D",
    "AD.A,AD.A": "cut AD.A is given twice",
    "AD.A,AB.A,OA.A": "all links are cut from A: OA.A, AB.A, AD.A\n  Leave one",
    "AD.A": "the cuts leave 2 loops\n  Cut one more joint, such as AB.B: --cut AD.A,AB.B",
    "AD.A,AD.D,BE.B,BE.E": "the cuts leave 1 loop\n  Cut one more joint, such as BC.C",
}


@pytest.mark.parametrize("cuts", WRONG)
def test_cuts_that_are_no_cuts(cuts):
    with pytest.raises(ModelError) as caught:
        symgen.derive("peaucellier", cut=cuts.split(","))
    assert WRONG[cuts] in str(caught.value)


def test_cuts_of_no_loop():
    for scene, cut in (("triple_pendulum", "AB.A"), ("triple_pendulum", "BC.C")):
        with pytest.raises(ModelError, match="on no loop: the cut would only separate"):
            symgen.derive(scene, cut=[cut])
    for scene in ("rod", "slider_crank"):
        with pytest.raises(symgen.SymgenError, match="no momentum rows"):
            symgen.derive(scene, cut=["AB.A"])
    with pytest.raises(ModelError, match="cuts apply to momentum_rows"):
        call("show", "four_bar", "mass_matrix", "--cut", "rocker.C")
    with pytest.raises(ModelError, match="--cut applies to momentum_rows"):
        call("show", "four_bar", "--cut", "rocker.C")


def test_the_joint_of_a_body_is_on_a_loop():
    bodies = {k: tuple(k) for k in ("OA", "AB", "BE", "BC")}
    assert all(on_loop("OE", bodies, k, p) for k in ("OA", "AB", "BE") for p in k)
    assert not on_loop("OE", bodies, "BC", "B") and not on_loop("O", bodies, "AB", "A")


def test_show_and_equations():
    """The command, model.equations and derive give the same rows; the solution is printed with units."""
    rows = symgen.build("four_bar").equations.cut("rocker.C")
    assert rows["matrix"].matrix == symgen.derive("four_bar", cut=["rocker.C"])["matrix"].matrix
    assert rows["matrix"].matrix.shape == (8, 8)
    assert call("show", "four_bar", "momentum_rows.rocker_C_closure", "--cut", "rocker.C").startswith(
        "rocker_C_closure: acceleration of rocker where it is cut at C, less that of C; zero [m/s^2]; Attia"
    )
    whole, cut = (call("show", "four_bar", "momentum_rows", "--format", "numeric", *options)
                  for options in ((), ("--cut", "rocker.C")))  # fmt: skip
    found, expected = (
        {x[0]: float(x[1]) for x in map(str.split, text[text.index("solution x") :].splitlines()[1:])}
        for text in (cut, whole)
    )
    assert {"A_ax", "B_ay", "rocker_C_ax", "rocker_C_cut_y"} <= {*found}
    for name in ("A_ax", "A_ay", "B_ax", "B_ay"):
        assert found[name] == pytest.approx(expected[name], rel=1e-9)
    for axis in "xy":
        assert found[f"rocker_C_cut_{axis}"] == pytest.approx(expected[f"C_reaction_{axis}"], rel=1e-9)


def test_numbers_of_elastic_links_in_space():
    """Those of the linkage with rigid links."""
    text = call("show", "spatial_four_bar", "momentum_rows", "--format", "numeric")
    found = {x[0]: float(x[1]) for x in map(str.split, text[text.index("solution x") :].splitlines()[1:])}
    expected = rigid(symgen.build("spatial_four_bar")).accelerations()
    for point in "BC":
        mine = [found[f"{point}_a{axis}"] for axis in "xyz"]
        assert mine == pytest.approx(expected[point], rel=1e-9, abs=1e-9)
