"""(4.11)-(4.16) of the thesis: the assembled system of rigid elements, by forces that are computed independently."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from shared.elastic_rigid import FourBar
from shared.equations import found

import symgen
from symgen.errors import ModelError
from symgen.inspection.state import state_of
from symgen.pipeline.subject import Subject

LBF, FT = 4.4482216152605, 0.3048
LINKS = ("crank", "coupler", "output")
RODS = {"crank": "OA", "coupler": "AB", "rocker": "CB"}


def divided(elements):
    return {f"links.{link}.elastic.elements": elements for link in LINKS}


def system_of(subject):
    (chosen,) = subject.found("rigid_matrix")
    return chosen.system


def numbers(system, name, values):
    known = {q.symbol: values[q.name] for q in system.arguments() if q.name in values}
    known |= {c.quantity.symbol: c.expression for c in system.constants}
    return np.array(system.expanded(name).xreplace(known), dtype=float)


@pytest.mark.parametrize("elements", [1, 2, 3])
@pytest.mark.parametrize("angle", [0, 60, 200])
def test_forces_by_newton_and_euler_solve_the_assembled_equations(elements, angle):
    """Of the bars with bearings at A and B, which belong to the elements before them."""
    model, subject = (
        symgen.build("thesis_four_bar", set=divided(elements)),
        Subject("thesis_four_bar", divided(elements)),
    )
    system = system_of(subject)
    values = state_of(model, f"{angle} deg").of(system, {})
    left, right = (numbers(system, name, values) for name in ("rigid_matrix", "rigid_load"))
    assert left.shape == (9 * elements, 9 * elements)
    motion = FourBar().motion(math.radians(angle)).forces
    at = dict(zip("MAB", -motion["first"][:, 0] * LBF, strict=True)) | {"Q": motion["Q"][0] * LBF}
    of_model = model.inverse_dynamics(at=[math.radians(angle)], elements=elements)
    named = dict(zip(system["rigid_matrix"].columns, np.linalg.solve(left, right)[:, 0], strict=True))
    size = max(map(abs, named.values()))
    for node, force in at.items():
        assert [named[f"Fx at {node}"], named[f"Fy at {node}"]] == pytest.approx(force, abs=1e-7 * size)
    assert named["M at M"] == pytest.approx(motion["torque"][0] * LBF * FT, abs=1e-7 * size)
    forces = []
    for column in system["rigid_matrix"].columns:
        kind, node = column.split(" at ")
        if "@" not in node:
            forces.append({"Fx": at[node][0], "Fy": at[node][1], "M": motion["torque"][0] * LBF * FT}[kind])
            continue
        link = LINKS.index(node.partition("@")[0])
        e = np.exp(1j * motion_direction(angle)[link])
        along, across, moment = (
            of_model.variable(f"{node}.{x}").values[0] for x in ("axial_force", "shear_force", "moment")
        )
        force = (along + 1j * across) * e
        forces.append({"Fx": force.real, "Fy": force.imag, "M": moment}[kind])
    assert left @ forces == pytest.approx(right[:, 0], abs=1e-7 * size)


def motion_direction(angle):
    return FourBar().motion(math.radians(angle)).directions[:, 0]


def test_sizes_and_blocks_are_those_of_the_print():
    """L = 3n, M = 6n, K = 3n + 3; [D] = diag([d]) [a] without the moments at pins that have no drive."""
    for elements in (1, 3):
        n, system = 3 * elements, system_of(Subject("thesis_four_bar", divided(elements)))
        blocks, shared, whole = (system[f"rigid_{x}"] for x in ("elements", "assembly", "matrix"))
        assert blocks.matrix.shape == (3 * n, 6 * n) and shared.matrix.shape == (6 * n, 3 * n + 3)
        assert [sum(row) for row in shared.matrix.tolist()] == [1] * 6 * n
        zero = [int(k) - 1 for k in system["rigid_boundary"].matrix]
        assert [shared.columns[k] for k in zero] == ["M at A", "M at B", "M at Q"]
        kept = [k for k in range(3 * n + 3) if k not in zero]
        assert whole.matrix == (blocks.matrix * shared.matrix)[:, kept]
        assert [shared.columns[k] for k in kept] == [*whole.columns]
    block = Subject("rigid_element", {}).system.expanded("nodal_matrix")
    x, y = (sp.Symbol(f"crank_d{axis}", real=True) for axis in "xy")
    placed = {"i_x": 0, "i_y": 0, "k_x": x, "k_y": y, "c_along": sp.Rational(1, 2), "c_across": 0}
    block = block.xreplace({sp.Symbol(name, real=True): value for name, value in placed.items()})
    first = system_of(Subject("thesis_four_bar", {}))["rigid_elements"].matrix[:3, :6]
    assert first == block


def test_rigid_links_have_it_too():
    """The forces of a run of the rods, by the multipliers of their lengths, solve the equations by elements."""
    names = [f"{link}.{point}.force" for link, points in RODS.items() for point in points]
    outputs = {"analysis.outputs": [*names, "crank.torque"]}
    model, angle = symgen.build("crank_rocker", set=outputs), 70
    system = system_of(Subject("crank_rocker", outputs))
    t = angle / 360  # [s] at 60 rpm
    run = model.simulate(t, t_eval=[t], rtol=1e-10)
    values = state_of(model, f"{t!r} s").of(system, {})
    left, right = (numbers(system, name, values) for name in ("rigid_matrix", "rigid_load"))
    acting = {"O": ("crank", -1), "A": ("crank", 1), "B": ("coupler", 1), "C": ("rocker", 1)}
    forces = []
    for column in system["rigid_matrix"].columns:
        kind, node = column.split(" at ")
        link, sign = acting[node]
        name = "crank.torque" if kind == "M" else f"{link}.{node}.force.{kind[1]}"
        forces.append(run.variable(name).values[0] * (1 if kind == "M" else sign))
    assert left @ forces == pytest.approx(right[:, 0], abs=1e-8 * max(map(abs, forces)))


def test_a_point_without_mass_changes_nothing():
    """Such as one that outputs follow; a mass on a link, apart from its ends, is not in the equations."""
    point = {"points.G": {"on": "output", "fraction": 0.5}}
    plain, marked = (system_of(Subject("thesis_four_bar", of)) for of in ({}, point))
    for m in plain.matrices:
        assert (marked[m.name].matrix, marked[m.name].rows) == (m.matrix, m.rows)
    heavy = point | {"masses": [{"point": "G", "mass": "1 kg"}]}
    with pytest.raises(ModelError, match="nothing called"):
        Subject("thesis_four_bar", heavy).found("rigid_matrix")


@pytest.mark.parametrize(
    "uneven",
    [{"section": {"width": ["width", "2*width"], "thickness": "thickness"}}, {"element": "rayleigh"}],
)
def test_links_that_stay_undivided_are_said_to(uneven):
    at = {"section": "links.coupler.section", "element": "links.coupler.elastic.element"}
    changes = divided(2) | {at[key]: value for key, value in uneven.items()}
    system = system_of(Subject("thesis_four_bar", changes))
    assert [row for row in system["rigid_matrix"].rows if row.endswith(".x")] == [
        f"{part}.x" for part in ("crank_1", "crank_2", "coupler_1", "output_1", "output_2")
    ]
    assert "; coupler: one element each" in system["rigid_matrix"].description
    assert "one element" not in system_of(Subject("thesis_four_bar", divided(2)))["rigid_matrix"].description


def test_units_are_those_of_rows_over_those_of_columns():
    """Of every entry that is not zero: N or N m by N or N m."""
    for name, system in (
        ("rigid_matrix", system_of(Subject("thesis_four_bar", {}))),
        ("rigid_elements", system_of(Subject("thesis_four_bar", {}))),
        ("nodal_matrix", Subject("rigid_element", {}).system),
    ):
        m = system[name]
        for (i, j), _ in m.matrix.todok().items():
            row, column = m.rows[i], m.columns[j]
            lengths = row.endswith("moment") - column.rpartition(".")[2].startswith("M ")
            assert m.part([row], [column]).unit == {0: "1", 1: "m"}[lengths], (name, row, column)


def test_the_equations_are_found_by_their_numbers():
    scene = Subject("thesis_four_bar", {})
    for number, names in {
        "4.11": ["rigid_elements", "rigid_assembly", "rigid_matrix"],
        "4.15": ["rigid_assembly"],
        "4.16": ["rigid_boundary", "rigid_matrix", "rigid_load"],
    }.items():
        assert [m.name for m in found(scene, number)] == names
    assert "rigid_matrix" in [m.name for step in scene.record for m in step.matrices]
    slider = Subject("elastic_slider_crank", {})
    assert "rigid_matrix" not in [m.name for step in slider.record for m in step.matrices]
