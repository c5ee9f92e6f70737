"""Equation numbers of the sources: every named matrix of all methods has them, and they are the printed ones."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from shared.commands import call
from shared.equations import found

from symgen.inspection.explanation import explanation
from symgen.mechanics.rods.particles import particle_masses
from symgen.models import BLOCKS, RECURSIONS
from symgen.pipeline.subject import Subject
from symgen.symbolic.system import NO_SOURCE

SCENES = ["four_bar", "slider_crank", "rssr", "thesis_four_bar", "tumbling_body"]
_FORM = re.compile(r"(.*Attia|.*Rahman|.*[Tt]hesis)[ ,(].*\d")


@cache
def subject(name):
    return Subject(name, {})


@pytest.mark.parametrize(
    "name",
    [
        *SCENES,
        *RECURSIONS,
        "rod",
        "loop_row",
        "element_beam8",
        "element_cubic",
        "direction",
        "corotational_node",
    ],
)
def test_every_matrix_states_its_source(name):
    """An equation of a source, that there is none, or the matrix of which it is a part; also of all steps."""
    derived = subject(name)
    matrices = [m for prefix, part in derived.parts if not prefix for m in part.matrices]
    matrices += [m for step in derived.record for m in step.matrices]
    names = {m.name for m in matrices}
    for m in matrices:
        assert m.source, m.name
        stated = m.source.startswith(NO_SOURCE) or _FORM.match(m.source)
        assert stated or names & {*re.findall(r"[\w.]+", m.source)}, (m.name, m.source)
    if name not in ("direction", "corotational_node"):
        assert sum(not m.source.startswith(NO_SOURCE) for m in matrices) >= 2


@pytest.mark.parametrize(
    ("name", "matrix", "source"),
    [
        ("rod", "linear_momentum", "Attia (6)"),
        ("rod", "angular_momentum", "Attia (7)"),
        ("four_bar", "constraints", "Attia (3a) halved"),
        ("elastic_slider_crank", "constraints", "Attia (3a) halved; guide_* (16b)"),
        ("rod_spatial", "acceleration_constraint", "Attia (5a)"),
        (
            "four_bar",
            "momentum_rows.crank_moment",
            "Attia (12), the masses at a joint are those of both rods; for rod j = crank, particle 2j-1 = O; "
            "uniform rods: m1 = m/6, m2 = 2 m/3, m3 = m/6",
        ),
        (
            "triple_pendulum",
            "momentum_rows.BC_moment",
            "Attia (9), (12); for rod N = BC, particle 2N-1 = B",  # its centre of mass is not in the middle
        ),
        (
            "vertical_rods",
            "momentum_rows.lower_moment",
            "Attia (10), (13), corrected: couples across the rod; for rod N = lower, particle 2N-1 = A; uniform "
            "rod: m1 = m/6, m2 = 2 m/3, m3 = m/6; u_bar, u_hat of section 2.2 for e in place of z, the axis "
            "along which the rod is shortest; u_bar_lower (10a), (13a); u_hat_lower (10b), (13b)",
        ),
        (
            "rod_spatial",
            "projected_momentum",
            "Attia, section 2.2, corrected: theta in the quadrant of the rod; theta and phi are eliminated by "
            "r31_x = rho cos(theta), r31_y = rho sin(theta), rho = l cos(phi), r31_z = l sin(phi); G: the "
            "right side of angular_momentum; u_bar (8a), printed as (1); u_hat (8b), printed as (2)",
        ),
        ("four_bar", "momentum_rows.crank_length", "Attia (14)"),
        ("four_bar", "momentum_rows.O_momentum", "Attia (15), the masses at a joint are those of both rods"),
        ("slider_crank", "row_1_transform", "Rahman (1)"),
        ("slider_crank", "row_2_transform", "Rahman (2)"),
        ("slider_crank", "row_3_transform", "Rahman (3), corrected: alpha3 varies"),
        ("slider_crank", "row_4_transform", "Rahman (4)"),
        ("slider_crank", "rod_binor", "Rahman (47), corrected: g2 = -a2/2"),
        ("rssr", "theta1_operator", "Rahman (17)"),
        ("element_beam8", "constant_mass", "thesis (F.1); [MD] of (7.28)"),
        ("element_beam8", "thesis_stiffness", "thesis (E.13)-(E.17), (F.6), corrected"),
        ("element_beam8", "weak_form", "thesis (7.10)-(7.23)"),
        ("element_cubic", "geometric0", NO_SOURCE),
        (
            "synthesis_limits",
            "residual",
            "thesis (3.3)-(3.17); extended_along (3.7), (3.9), (3.16); extended_across (3.6); "
            "extended_angles (3.5), corrected: -180 deg; extended_angles (3.12); folded_along (3.7); "
            "folded_across (3.14), (3.17); folded_angles (3.13); swing (3.4), (3.11); least (3.8)",
        ),
        (
            "rigid_element",
            "inertia",
            "thesis (4.10), (4.10a), right side; x (4.5), (4.7); y (4.5), (4.8); moment (4.6), (4.9)",
        ),
    ],
)
def test_sources_are_shown(name, matrix, source):
    (m,) = subject(name).choose(matrix).matrices
    assert m.source == source
    assert f"; {source}" in " ".join(call("show", name, matrix).split())
    assert source in " ".join(call("show", name, matrix, "--format", "latex").replace("%", "").split())


@pytest.mark.parametrize("x", [0.3, -0.3])
def test_moments_of_a_rod_in_space_are_along_the_unit_vectors_of_the_print(x):
    """Eqs. (8a), (8b) with theta and phi in the quadrant of the rod; as printed for x > 0."""
    system = BLOCKS["rod_spatial"]()
    d = np.array([x, -0.5, 0.7])
    length = np.linalg.norm(d)
    values = {q.symbol: sp.Float(0.1 + 0.37 * i, 30) for i, q in enumerate(system.symbols())}
    values |= {sp.Symbol(f"r1_{a}", real=True): 0 for a in "xyz"}
    values |= {sp.Symbol(f"r3_{a}", real=True): c for a, c in zip("xyz", d, strict=True)}
    values[sp.Symbol("l", real=True)] = length
    theta, phi = np.arctan2(d[1], d[0]), np.arctan(d[2] / np.hypot(d[0], d[1]))
    u_bar = [-np.sin(theta), np.cos(theta), 0]
    u_hat = [-np.cos(theta) * np.sin(phi), -np.sin(theta) * np.sin(phi), np.cos(phi)]
    assert np.allclose([d @ u_bar, d @ u_hat, np.dot(u_bar, u_hat)], 0, atol=1e-15)
    moment, found = (np.array(system.expanded(m).xreplace(values), dtype=float)[:, 0]
                     for m in ("angular_momentum", "projected_momentum"))  # fmt: skip
    assert np.allclose(found, [moment @ u_bar, moment @ u_hat], rtol=1e-13)


def test_explanations_and_derivatives_state_sources():
    lines = "\n".join(explanation("four_bar", {}))
    assert "acceleration_rhs" in lines and "; Attia (5a), right side" in lines
    slope = subject("peaucellier").choose("mass_matrix").by("rho").matrices[0]
    assert slope.source == NO_SOURCE


@pytest.mark.parametrize("name", ["rod", "rod_spatial"])
def test_particles_of_a_rod_are_those_of_the_print(name):
    """Section 2.1: the three conditions, their solution, and (6) and (7) in the masses of the particles."""
    system = BLOCKS[name]()
    m, l, c, i, j = (sp.Symbol(x, real=True) for x in ("m", "l", "l_c", "I_c", "I_o"))
    about_start = i + m * c**2
    assert system.expanded("particle_conditions").applyfunc(sp.simplify) == sp.zeros(3, 1)
    middle, end = 4 / l**2 * (m * l * c - j), 2 / l**2 * (j - m / 2 * l * c)
    printed = sp.Matrix([m - middle - end, middle, end]).subs(j, about_start)
    assert (system.expanded("particle_masses") - printed).applyfunc(sp.simplify) == sp.zeros(3, 1)
    assert (printed - sp.Matrix(particle_masses(m, l, c, i))).applyfunc(sp.simplify) == sp.zeros(3, 1)
    ends = system["mass_matrix"].part(["r1_x", "r3_x"], ["r1_x", "r3_x"])
    difference = replace(system, matrices=(ends,), exports=()).expanded("mass_matrix") - system.expanded(
        "end_masses"
    )
    assert difference.applyfunc(sp.simplify) == sp.zeros(2, 2)
    m1, m2, m3, a, b = (
        sp.Symbol(x, real=True) for x in ("m_1", "m_2", "m_3", "r1_x_acceleration", "r3_x_acceleration")
    )
    assert system["linear_momentum"].matrix[0] == (m1 + m2 / 2) * a + (m3 + m2 / 2) * b
    text = call("show", name, "end_masses")
    assert (
        "row sums are the coefficients" in text
        and "m₂ = 4⋅(-I_o + l⋅l_c⋅m)/l²" in text
        and "m₁ = m - m₂ - m₃" in text
    )


@pytest.mark.parametrize("name", ["rod", "rod_spatial"])
def test_momenta_of_a_rod_are_those_of_its_end_masses(name):
    """Attia (6) and (7), derived of three particles, against M a of the end mass matrix."""
    system = BLOCKS[name]()
    axes = "xy" if name == "rod" else "xyz"
    a = sp.Matrix([sp.Symbol(f"r{k}_{x}_acceleration", real=True) for k in (1, 3) for x in axes])
    forces = system.expanded("mass_matrix") * a
    inner, outer = forces[: len(axes), :], forces[len(axes) :, :]
    assert (system.expanded("linear_momentum") - inner - outer).expand() == sp.zeros(len(axes), 1)
    d = sp.Matrix([sp.Symbol(f"r3_{x}", real=True) - sp.Symbol(f"r1_{x}", real=True) for x in axes])
    turned = d.cross(outer) if len(axes) == 3 else sp.Matrix([d[0] * outer[1] - d[1] * outer[0]])
    assert (system.expanded("angular_momentum") - turned).applyfunc(sp.simplify) == sp.zeros(*turned.shape)


@pytest.mark.parametrize("name", ["rod", "rod_spatial"])
def test_without_the_middle_particle_its_equations_become_those_of_the_ends(name):
    """(1) and (2) with the motion of (3b), (4b), (5b) are (6) and (7)."""
    system = BLOCKS[name]()
    axes = "xy" if name == "rod" else "xyz"
    ends = {
        sp.Symbol(f"r2_{x}{v}", real=True): (
            sp.Symbol(f"r1_{x}{v}", real=True) + sp.Symbol(f"r3_{x}{v}", real=True)
        )
        / 2
        for v in ("", "_rate", "_acceleration")
        for x in axes
    }
    for noun in ("position", "velocity", "acceleration"):
        constraint = system[f"middle_{noun}"].matrix
        assert constraint.subs(ends).expand() == sp.zeros(len(axes), 1)
        assert len(constraint.free_symbols & ends.keys()) == len(axes)
    for own, eliminated in (
        ("particle_momentum", "linear_momentum"),
        ("particle_moment", "angular_momentum"),
    ):
        difference = system.expanded(own).subs(ends) - system.expanded(eliminated)
        assert difference.applyfunc(sp.simplify) == sp.zeros(*difference.shape)
    shown = {"(1)": "particle_momentum", "(2)": "particle_moment", "(3b)": "middle_position"}
    shown |= {"(4b)": "middle_velocity", "(5b)": "middle_acceleration"}
    shown |= {"(3a)": "distance", "(4a)": "velocity_constraint", "(5a)": "acceleration_constraint"}
    shown |= {"(6)": "linear_momentum"}
    for number, matrix in shown.items():
        names = [m.name for m in found(subject(name), number)]
        assert [x for x in names if x != "projected_momentum"] == [matrix]  # (8a), (8b), printed as (1), (2)


@pytest.mark.parametrize(
    ("model", "number", "left"),
    [
        *(("rod_spatial", *x) for x in (("1", "R"), ("2", "G₁"), ("6", "R"), ("7", "G₁"))),
        *(("rod_spatial", x, "0") for x in ("3a", "3b", "4a", "4b", "5a", "5b")),
        ("four_bar_motion", "4.45", "B_y"),
    ],
)
def test_the_left_side_is_that_of_the_print(model, number, left):
    assert f"\n{left} =" in call("show", model, number)


def test_both_moments_of_a_rod_in_a_chain_are_those_of_one_rod():
    """(10) of the last rod is (8) where the axis e is z: u_bar and u_hat by (8), for e = z."""
    chain, rod = subject("vertical_rods").choose("momentum_rows.lower_moment").system, BLOCKS["rod_spatial"]()
    numbers = [sp.Integer(x) for x in (13, 1, 2, 3, 13, 6, 6)]  # 12, 4, 3: shortest along z, of length 13

    def vector(system, name, arguments):
        known = {sp.Symbol(x, real=True): value for x, value in zip(arguments, numbers, strict=True)}
        for d in system.definitions:
            known[d.quantity.symbol] = d.expression.xreplace(known)
        return [known.get(sp.Symbol(f"{name}_{a}", real=True), 0) for a in "xyz"]  # zero has no letter

    for name in ("u_bar", "u_hat"):
        in_chain = vector(chain, f"{name}_lower", ("l_lower", "A_x", "A_y", "A_z", "B_x", "B_y", "B_z"))
        assert in_chain == vector(rod, name, ("l", "r1_x", "r1_y", "r1_z", "r3_x", "r3_y", "r3_z"))


@pytest.mark.parametrize("name", ["rod", "rod_spatial"])
def test_the_distance_of_the_ends_and_its_rates_are_printed(name):
    """(3a), (4a), (5a): r31.r31 - l^2, r31.r31', r31.(r3'' - r1'') + r31'.r31'."""
    system = BLOCKS[name]()
    r1, r3 = (
        [sp.Matrix([sp.Symbol(f"r{k}_{x}{v}", real=True) for x in ("xyz" if "_" in name else "xy")])
         for v in ("", "_rate", "_acceleration")]
        for k in (1, 3)
    )  # fmt: skip
    d, v, a = (y - x for x, y in zip(r1, r3, strict=True))
    length = sp.Symbol("l", real=True)
    for matrix, printed in (
        ("distance", d.dot(d) - length**2),
        ("velocity_constraint", d.dot(v)),
        ("acceleration_constraint", d.dot(a) + v.dot(v)),
    ):
        assert sp.expand(system.expanded(matrix)[0] - printed) == 0
