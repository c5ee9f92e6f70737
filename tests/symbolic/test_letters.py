"""Letters for the constants of a scene: equations with them are those with numbers, and those of the papers."""

from __future__ import annotations

from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp

import symgen
from symgen.lowering.program import lower_system
from symgen.methods import further_of, method_of
from symgen.pipeline.systems import system_of
from symgen.scene.loading import check_scene, read_scene
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import derived_in_letters, in_letters
from symgen.symbolic.exact import Exact
from symgen.symbolic.notation import latex_name

#: Scenes of every method, with bodies, springs, drives, spatial links, loads.
SCENES = (
    "andrews_squeezer", "car_axis", "crank_rocker", "double_four_bar", "peaucellier", "tumbling_body",
    "two_four_bars", "spatial_slider_crank", "thesis_four_bar", "rssr", "screw_jack", "bricard",
    "universal_joint.toml", "delta_robot.toml", "wiper.toml", "gap.toml", "pantograph.toml",
)  # fmt: skip
CASES = Path(__file__).parents[1] / "cases"


def resolved(name: str):
    return resolve(check_scene(read_scene(str(CASES / name) if name.endswith(".toml") else name)))


@pytest.mark.parametrize("name", SCENES)
def test_equations_in_letters_are_those_derived_from_numbers(name):
    scene = resolved(name)
    lettered = system_of(scene)
    numbers = method_of(scene).load("system")(scene)
    generator = np.random.default_rng(0)
    values = {g.name: generator.uniform(0.5, 1.5, len(g.quantities)) for g in numbers.groups}
    assert lettered.constants
    names = [m.name for m in numbers.matrices]
    pairs = zip(Exact(lettered).matrices(names, values), Exact(numbers).matrices(names, values), strict=True)
    for matrix, (a, b) in zip(names, pairs, strict=True):
        size = max((abs(x) for x in b), default=0)
        assert all(abs(x - y) <= mpmath.mpf(10) ** -30 * size for x, y in zip(a, b, strict=True)), matrix


@pytest.mark.parametrize("name", SCENES)
def test_kernels_of_equations_in_letters_have_no_more_operations(name):
    scene = resolved(name)
    kernels = [
        {k.name: k.counts.flops for k in lower_system(s).kernels}
        for s in (system_of(scene), method_of(scene).load("system")(scene))
    ]
    grown = {kernel: n - kernels[1][kernel] for kernel, n in kernels[0].items() if n > kernels[1][kernel]}
    assert not grown


def test_a_uniform_rod_has_the_masses_of_the_source():
    """Attia, section 2.1: m/3 at each end, m/6 between them."""
    system = symgen.derive("four_bar")
    m = {c.quantity.name: c.quantity.symbol for c in system.constants}
    crank, coupler, rocker = (m[f"m_{name}"] for name in ("crank", "coupler", "rocker"))
    a, b, ab = crank / 3 + coupler / 3, coupler / 3 + rocker / 3, coupler / 6
    assert system["mass_matrix"].matrix == sp.Matrix(
        [[a, 0, ab, 0], [0, a, 0, ab], [ab, 0, b, 0], [0, ab, 0, b]]
    )


def test_the_link_joint_table_has_the_letters_of_the_source():
    rows = symgen.derive("slider_crank")["rows"].matrix
    assert [str(x) for x in rows] == [
        "theta1", "s1", "0", "0", "a1",
        "theta2", "0", "eta2", "0", "a2",
        "theta3", "0", "eta3", "alpha3", "0",
        "0", "S4", "0", "alpha4", "a4",
    ]  # fmt: skip


def test_zeros_and_right_angles_have_no_letters():
    system = system_of(resolved("rssr"))
    assert all(not c.expression.is_number or c.expression != 0 for c in system.constants)
    angles = [c.expression for c in system.constants if c.quantity.name[:-1] in ("theta", "eta", "alpha")]
    assert all(sp.N(sp.sin(2 * x)) != 0 for x in angles)


def test_a_letter_may_depend_on_a_parameter():
    """Rods of rho kg/m: the derivative by rho passes through their masses."""
    from symgen.symbolic.derivative import derivative

    system = symgen.derive("peaucellier")
    by = derivative(system, [system["mass_matrix"]], "rho")["mass_matrix_by_rho"].matrix
    masses = system.in_numbers()["mass_matrix"].matrix
    rho = next(x.symbol for x in system.group("p").quantities if x.name == "rho")
    assert sp.simplify(by - masses.diff(rho)) == sp.zeros(*masses.shape)


def test_letters_avoid_the_names_of_a_scene():
    """Those of parameters, coordinates and what is derived from points and links."""
    bar = {"mass": "2 kg", "length": "0.3 m"}
    tables = {
        "points": {"O": {"at": [0, 0], "ground": True}, "l": {"at": ["0.3 m", 0]}, "B": {"at": ["0.6 m", 0]}},
        "links": {"x": {"points": ["O", "l"], **bar}, "dx": {"points": ["l", "B"], **bar}},
        "parameters": {"m_x": {"value": "2 kg", "tunable": True}},
        "masses": [{"point": "B", "mass": "m_x"}],
    }
    system = symgen.derive(symgen.Scene(**tables))
    names = {c.quantity.name: c.expression for c in system.constants}
    assert set(names) == {"l2_x", "l2_dx", "m2_x", "m_dx"}
    written = [latex_name(x.name) for x in system.symbols()]
    assert len(set(written)) == len(written)


def test_the_mass_of_a_body_is_a_letter_of_its_equations():
    """The kinetic energy is proportional to it."""
    system = symgen.derive("tumbling_body")
    energy = system["kinetic_energy"].matrix[0, 0]
    mass = next(c.quantity.symbol for c in system.constants if c.quantity.name == "m_body")
    assert mass in energy.free_symbols
    assert sp.expand(energy.diff(mass) * mass - energy) == 0


def test_what_only_the_start_needs_stays_in_numbers():
    scene = resolved("four_bar")
    written, letters = in_letters(scene)
    assert written.start == scene.start
    assert {c.quantity.name for c in letters.constants} == {
        *(f"{letter}_{link}" for letter in "lm" for link in ("crank", "coupler", "rocker")),
        "x_C",
        "g",
    }


def test_all_systems_of_a_scene_are_derived_from_the_same_letters(monkeypatch):
    scene, calls = resolved("thesis_four_bar"), []
    monkeypatch.setattr("symgen.scene.rods.letters.in_letters", lambda of: calls.append(of) or in_letters(of))
    system_of(scene)
    derived_in_letters(scene, further_of)
    assert calls == [scene]


SWINGING = {
    "parameters": {
        "m1": "2 kg", "a": {"value": "0.3 m", "about": "length of the bar"}, "k": "50 N/m", "none": "0 kg",
        "w": "3 rad/s", "g": "9.81 m/s^2", "F": "4 N", "n": 2, "J": {"value": "0.1 kg*m^2", "tunable": True},
    },
    "points": {
        "O": {"at": [0, 0], "ground": True, "motion": ["a*sin(w*t)/n", "0 m"]},
        "P": {"at": ["0.3 m", 0]}, "Q": {"at": ["0.9 m", 0]}, "R": {"at": ["a", "1 m"], "ground": True},
    },
    "links": {
        "bar": {"points": ["O", "P"], "mass": "m1", "length": "a", "inertia": "J"},
        "rod": {"points": ["P", "Q"], "mass": "2*m1", "length": "0.6 m", "centre": "1/n"},
    },
    "springs": [{"between": ["R", "P"], "stiffness": "k", "length": "2*a"}],
    "masses": [{"point": "Q", "mass": "none"}, {"point": "P", "mass": "2 kg"}],
    "forces": [{"point": "Q", "force": ["F*cos(w*t)", "-F"]}],
    "gravity": {"acceleration": ["0 m/s^2", "-g"]},
}  # fmt: skip


def test_the_parameters_of_a_scene_are_its_letters():
    """Where a value is a product of them; not where another value is only equal to one of them."""
    system = symgen.derive(symgen.Scene(**SWINGING))
    values = {c.quantity.name: c.expression for c in system.constants}
    assert {n: values[n] for n in ("m1", "a", "k", "w", "g", "F")} == {
        "m1": 2, "a": sp.Rational(3, 10), "k": 50, "w": 3, "g": sp.Rational("9.81"), "F": 4,
    }  # fmt: skip
    assert not {"m_bar", "m_rod", "l_bar", "k_spring_0", "l0_spring_0", "x_R", "none"} & values.keys()
    assert {"m_at_P", "l_rod"} <= values.keys()
    assert "m_at_Q" in system.absent
    s = {x.name: x.symbol for x in system.symbols()}
    for name, letters in {
        "mass_matrix": {"m1", "a", "J", "m_at_P"}, "potential_energy": {"m1", "k", "a", "g"},
        "force": {"m1", "k", "a", "g", "F", "w"}, "constraints": {"a", "l_rod"},
    }.items():  # fmt: skip
        needed = set().union(*(e.free_symbols for e in system.expanded(name)))
        assert {s[x] for x in letters} <= needed, name
    assert (
        next(c.quantity.description for c in system.constants if c.quantity.name == "a")
        == "length of the bar"
    )


def test_equations_in_the_parameters_of_a_scene_are_those_in_numbers():
    scene = resolve(symgen.Scene(**SWINGING))
    kernels = [
        {k.name: k.counts.flops for k in lower_system(s).kernels}
        for s in (system_of(scene), method_of(scene).load("system")(scene))
    ]
    assert {k: n for k, n in kernels[0].items() if n > kernels[1][k]} == {}


def test_the_constants_of_a_loop_keep_the_names_of_the_scene():
    system = symgen.derive("bennett")
    assert [str(x) for x in system["rows"].matrix] == [
        "theta1", "0", "0", "short", "b",
        "theta2", "0", "0", "long", "c",
        "theta3", "0", "0", "short", "b",
        "theta4", "0", "0", "long", "c",
    ]  # fmt: skip
