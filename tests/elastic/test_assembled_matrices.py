"""Assembled matrices of elastic links: an assembly from the equations of the thesis, modes, sums of the parts."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import eigh
from shared.commands import call
from shared.elastic_linkages import six_bar_scene, two_loops_scene
from shared.full import full
from shared.thesis_assembly import BOUNDARY, HELD, assembled, assembly

import symgen
from symgen.errors import ModelError
from symgen.mechanics.rods.condensation import BASIS
from symgen.models.assembled.condensed import REDUCED
from symgen.pipeline.subject import Subject
from symgen.runtime._beams import AT_REST
from symgen.scene.loading import text_of
from symgen.symbolic.exact import Exact

ANGLES = (0.0, 60.0, 120.0, 200.0, 300.0)
#: Unknowns of the four-bar in the order of the thesis.
UNKNOWNS = [
    *("M.x", "M.y", "crank.theta@1", "crank.kappa@1", "A.x", "A.y", "crank.theta@2", "crank.kappa@2"),
    *("coupler.theta@1", "coupler.kappa@1", "B.x", "B.y", "coupler.theta@2", "coupler.kappa@2"),
    *("output.theta@1", "output.kappa@1", "Q.x", "Q.y", "output.theta@2", "output.kappa@2"),
]
#: Sizes of unknowns for one metre on a link of a foot.
_SIZE = {"m": 1.0, "rad": 1 / 0.3, "1/m": 1 / 0.3**2}


@cache
def model(name="thesis_four_bar"):
    return symgen.build(name)


def test_rows_of_inextensible_links():
    """(E.40)-(E.42): the displacements of both ends of a link along it are equal."""
    links = {f"links.{link}.elastic.axial": False for link in ("crank", "coupler", "output")}
    system = Subject("thesis_four_bar", links).further["elastic_joints"]
    source = (
        "thesis (E.30)-(E.42); crank (E.30), (E.34), (E.40): q3 cos(theta1) + q4 sin(theta1) = 0; "
        "coupler (E.31), (E.41): q3 cos(theta2) + q4 sin(theta2) = q7 cos(theta2) + q8 sin(theta2); "
        "output (E.32), (E.42): q7 cos(theta3) + q8 sin(theta3) = 0"
    )
    assert system["jacobian"].source == source
    a, b, q = sp.symbols("A_x A_y"), sp.symbols("B_x B_y"), (sp.Symbol("frame"), sp.Integer(0))
    zero = (sp.Integer(0),) * 2
    along = [
        [(end - start) / sp.Symbol(length) for start, end in zip(*ends, strict=True)]
        for length, ends in (("a", (zero, a)), ("b", (a, b)), ("c", (b, q)))
    ]
    crank, coupler, output = along
    back, none = [[-e for e in row] for row in (coupler, output)], [0, 0]
    expected = sp.Matrix([[*crank, *none], [*back[0], *coupler], [*none, *back[1]]])
    found = system.expanded("jacobian")
    plain = found.xreplace({s: sp.Symbol(s.name) for s in found.free_symbols})
    assert (plain - expected).expand() == sp.zeros(3, 4)


@pytest.mark.parametrize("angle", ANGLES)
def test_matrices_of_the_thesis_linkage(angle):
    found, expected = model().matrices(np.radians(angle)), assembled(np.radians(angle))
    free = [name for k, name in enumerate(UNKNOWNS, 1) if k not in (*BOUNDARY, HELD)]
    size = np.array([_SIZE[unit] for unit in found["elastic_mass"].row_units])
    for name, matrix in expected.items():
        assert [*found[name].rows] == free
        scale = np.outer(size, size) if matrix.ndim == 2 else size
        gap = np.abs(found[name].values - matrix) * scale
        assert np.max(gap) < 1e-12 * np.max(np.abs(matrix * scale)), name
    assert not found["elastic_damping"].values.any()


def test_assembly_and_boundary_are_those_of_the_thesis():
    z, boundary = (model().matrices()[name] for name in ("assembly", "boundary"))
    assert [*z.columns] == UNKNOWNS
    assert np.array_equal(z.values, assembly())
    assert z.rows[9:11] == ("coupler_1.w@1", "coupler_1.theta@1")
    assert [*boundary.values] == sorted((*BOUNDARY, HELD))
    matrices = model("elastic_four_bar_free").matrices()
    free = matrices["boundary"]
    assert [*free.values] == [*BOUNDARY] and free.rows[2] == "crank.kappa@2"
    assert len(matrices["elastic_mass"].rows) == 4 * 4 - 5  # (8.2)
    shown = call("show", "elastic_four_bar_free", "boundary", "--at", "0").splitlines()
    assert [line.split()[-1] for line in shown[-len(BOUNDARY) :]] == [str(k) for k in BOUNDARY]


@pytest.mark.parametrize("angle", ANGLES)
def test_frequencies_of_the_matrices_are_those_of_modes(angle):
    found = model().matrices(np.radians(angle))
    squares = eigh(found["elastic_stiffness"].values, found["elastic_mass"].values, eigvals_only=True)
    modes = model().modes(np.radians(angle))
    assert np.sqrt(squares) / (2 * np.pi) == pytest.approx(modes.frequencies, rel=1e-9)


def spread():
    """A blade under a force along it that turns with its sections."""
    blade = {
        "points": ["O", "tip"], "mass_per_length": "1 kg/m",
        "section": {"area": "1 m^2", "second_moment": "1e-6 m^4", "fibre": "0.01 m"},
        "elastic": {"E": "1e6 Pa", "elements": 3},
    }  # fmt: skip
    force = {"link": "blade", "force": ["-3 N/m", "2 N/m"], "end": ["1 N/m", "4 N/m"], "axes": "section"}
    return {
        "title": "Blade",
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "tip": {"at": ["1 m", "0 m"]}},
        "links": {"blade": blade},
        "distributed_forces": [force],
        "crank": {"link": "blade", "speed": "3 rad/s"},
    }


SCENES = {
    "spread": spread,
    "loops": lambda: two_loops_scene({"mode": "motor", "torque": "stall*cos(this.angle) - drag*this.rate"}),
    "turned": lambda: six_bar_scene(("coupler", "rocker", "lever"), turned=True),
    "bodies": lambda: six_bar_scene(("rocker", "link"), 0.3),
}


@pytest.mark.parametrize(
    "name",
    ["elastic_four_bar_motor", "elastic_slider_crank", "spread", "loops", full("turned"), full("bodies")],
)
def test_parts_sum_to_the_matrices_of_runs(name):
    """With dampers, torsion springs, forces along links, a motor, damping ratios, rigid links: what runs take."""
    built = symgen.build(symgen.Scene(**SCENES[name]())) if name in SCENES else model(name)
    motion, found = built.motion(True), built.matrices(0.013, over="time")
    status, *expected, basis = motion.equations().matrices(0.013)
    _, _, _, rest, _, _ = motion.equations().matrices(0.013, AT_REST)
    assert status == 0
    names = found["elastic_mass"].rows
    order = [motion.layout.names.index(unknown) for unknown in names]
    value = {key: matrix.values for key, matrix in found.items()}
    parts = (
        value["elastic_mass"],
        value["elastic_damping"] + value["elastic_gyroscopic"],
        sum(value[f"elastic_{kind}stiffness"] for kind in ("", "geometric_", "motion_")),
    )
    if basis is None:
        there = np.ix_(order, order)
        for part, whole in zip(parts, expected[:3], strict=True):
            assert part == pytest.approx(whole[there], rel=1e-12, abs=1e-13 * np.max(np.abs(whole)))
        assert value["elastic_load"] == pytest.approx(expected[3][order])
        assert value["elastic_stiffness"] == pytest.approx(rest[there], abs=1e-13 * np.max(rest))
        return
    r, rate, second = (value[f"condensation{k}"] for k in ("", "_rate", "_second_rate"))
    mass, damping, stiffness = parts
    for kind, matrix in {
        "mass": r.T @ mass @ r,
        "damping": r.T @ (damping @ r + 2 * mass @ rate),
        "stiffness": r.T @ (stiffness @ r + damping @ rate + mass @ second),
        "load": r.T @ value["elastic_load"],
    }.items():
        whole = value[f"condensed_{kind}"]
        assert matrix == pytest.approx(whole, rel=1e-9, abs=1e-13 * np.max(np.abs(whole)))
    assert sorted(np.diag(value["condensed_mass"])) == pytest.approx(sorted(np.diag(expected[0])))


def test_show_prints_the_matrices_of_a_crank_angle():
    text = call("show", "thesis_four_bar", "elastic_mass", "--at", "60", "--rows", "A.x,B.y")
    expected = model().matrices(np.radians(60))["elastic_mass"]
    lines = text.splitlines()
    assert lines[0] == "elastic_mass at 60 deg: mass matrix [kg; *m per angle, *m^2 per curvature]"
    assert max(map(len, lines)) <= 100
    row = [float(x) for line in lines if "A.x [m]" in line for x in line.split("]")[1].split()]
    assert row == pytest.approx(expected.values[expected.rows.index("A.x")], rel=1e-9)
    assert "at t = 0.01 s" in call("show", "thesis_four_bar", "boundary", "--at", "0.01 s")
    with pytest.raises(ModelError, match="has no row 'A'"):
        call("show", "thesis_four_bar", "elastic_mass", "--rows", "A")
    with pytest.raises(ModelError, match="four_bar has no elastic links in the plane"):
        call("show", "four_bar", "elastic_mass")
    with pytest.raises(ModelError, match="no assembled matrix 'elastic_mas'"):
        model().matrices()["elastic_mas"]
    with pytest.raises(ModelError, match="have no variable"):
        model().matrices(0.0, over="angle")


def without_ratios(data):
    """Damping ratios and reductions are numbers alone."""
    for link in data["links"].values():
        elastic = link.get("elastic", {})
        elastic.pop("reduction", None)
        if "ratio" in elastic.get("damping", {}):
            elastic.pop("damping")
    return data


_OF_METRE = {"rad": 3.0, "1/m": 10.0}
#: Scenes by what their equations have.
IN_LETTERS = {
    "thesis_four_bar": {},
    "elastic_slider_crank": {
        "links.rod.elastic.axial": False,
        "links.rod.elastic.element": "beam9",
        "links.rod.elastic.damping": {"mass": "2 1/s", "stiffness": "1e-5 s"},
    },
    "rotating_cantilever": {"links.strip.elastic.element": "beam9"},
    "elastic_four_bar_free": {f"links.{k}.elastic.axial": False for k in ("crank", "coupler", "output")},
}


@pytest.mark.parametrize("name", [*IN_LETTERS, *SCENES][:-2] + [full(name) for name in [*SCENES][-2:]])
def test_matrices_in_letters_have_the_values_of_runs(name):
    if name in SCENES:
        scene = symgen.Scene(**without_ratios(SCENES[name]()))
        built, subject = symgen.build(scene), Subject.of(text_of(scene))
    else:
        built, subject = symgen.build(name, set=IN_LETTERS[name]), Subject(name, IN_LETTERS[name])
    system, t = subject.assembled, 0.013
    motion, found = built.motion(True), built.matrices(t, over="time")
    (q, u, solution), _, _ = motion.rigid_motion(motion.equations(), np.array([t]))
    state = {"t": [t], "q": q[0], "u": u[0], "p": built.rigid.parameter_values, "work": solution[0]}
    state["condensed"] = [0.0] * len(system.group("condensed").quantities)
    state = {group.name: state[group.name][: len(group.quantities)] for group in system.groups}
    names = [m.name for m in system.matrices]
    value = {
        k: np.array(m.tolist(), dtype=float)
        for k, m in zip(names, Exact(system).matrices(names, state), strict=True)
    }
    for matrix in system.matrices:
        if "condensation" in matrix.name or "." in matrix.name or matrix.name in REDUCED:
            continue
        expected = found[matrix.name]
        assert matrix.rows == expected.rows and matrix.columns == expected.columns, matrix.name
        whole = expected.values.reshape(matrix.matrix.shape)
        size = np.array([_OF_METRE.get(unit, 1.0) for unit in expected.row_units])
        scale = np.outer(size, size) if matrix.columns and matrix.rows == matrix.columns else 1.0
        gap = np.abs(value[matrix.name] - whole) * scale
        assert np.max(gap) <= 1e-12 * np.max(np.abs(whole * scale)), matrix.name
    if "condensation" in names:
        _compare_condensation(system, value, found)


def test_names_of_a_scene_may_be_those_of_letters():
    """Parameters like the mass per length of a link, and links like the elements of another one."""
    data = without_ratios(two_loops_scene({"mode": "held"}))
    data["parameters"]["mu_rod"] = {"value": "200 N/m", "tunable": True}
    data["springs"][0]["stiffness"] = "mu_rod"
    data["links"] = {{"follower": "rod_2"}.get(k, k): link for k, link in data["links"].items()}
    system = Subject.of(text_of(symgen.Scene(**data))).assembled
    letters = {c.quantity.description: c.quantity.name for c in system.constants}
    assert letters["mass per length of rod"] == "mu2_rod"
    assert letters["mass per length of rod_2"] == "mu_rod_2"
    assert system.group("p").quantities[-1].name == "mu_rod"


def test_constants_are_letters_that_options_replace():
    """Of the rod of a slider-crank with a piston: printed as letters, with their values, or one of them."""
    name, entry = "elastic_slider_crank", ("elastic_mass", "--rows", "P.x", "--columns", "P.x")
    system = Subject(name, {}).assembled
    numbers = {c.quantity.name: c.expression for c in system.constants}
    for matrix in system.matrices:
        floats = {x for x in sp.preorder_traversal(matrix.matrix) if x.is_Float}
        assert not floats, matrix.name
    piston = call("show", name, *entry)
    assert "m_at_P" in piston and "\u03bc_rod" in piston and "= 0.3" in piston
    assert "m_at_P" not in call("show", name, *entry, "--numeric")
    assert "m_at_P" not in call("show", name, *entry, "--with", "m_at_P=2")
    shown = call("show", name, *entry, "--format", "numeric", "--with", "m_at_P=2.3")
    assert numbers["m_at_P"] == sp.Rational(3, 10)
    plain = model(name).matrices()["elastic_mass"].part(["P.x"], ["P.x"]).values[0, 0]
    assert float(shown.split("P.x")[-1].split()[0]) == pytest.approx(plain + 2.0, rel=1e-6)


def test_matrices_in_letters_are_those_of_the_thesis():
    """(F.2): A cos^2 + D sin^2 with A = m L/3, D = 181 m L/462 of crank and coupler, and the bearing."""
    system = Subject("thesis_four_bar", {}).assembled
    terms = {d.quantity.name: d.expression for d in system.definitions}
    values = {c.quantity.symbol: c.expression for c in system.constants}
    entry = system["elastic_mass"].part(["A.x"], ["A.x"]).matrix[0]
    symbol = {s.name: s for s in entry.free_symbols}
    # The two ends of a symmetric element have the same shared terms.
    expected = sum(
        symbol[f"{k}_M_{i}_{i}"] * symbol[f"{k}_{of}"] ** 2
        for k in ("crank", "coupler")
        for i, of in ((1, "cosine"), (2, "sine"))
    )
    bearing = sp.expand(entry - expected)
    length, mass = (sp.Symbol(x, real=True) for x in ("b", "mu_coupler"))
    assert terms["coupler_M_1_1"] == mass * length / 3 and terms["coupler_M_2_2"] == 181 * mass * length / 462
    assert float(bearing.xreplace(values)) == pytest.approx(0.0040803133 * 14.593902937206364)
    shown = call("show", "thesis_four_bar", "elastic_mass", "--rows", "A.x", "--columns", "A.x")
    assert "thesis (F.2)\n" in shown and "coupler" in shown
    assert model().equations["elastic_mass"] == system["elastic_mass"].matrix
    listed = call("show", "thesis_four_bar")
    assert all(name in listed for name in ("elastic_geometric_stiffness", "assembly", "boundary"))
    assert "condensation" not in listed and "condensation" in call("show", "elastic_slider_crank")


def test_elements_and_strains_are_those_of_the_thesis():
    """(F.1); at mid-span w'' = (-1.5 theta1 - kappa1 L/4 + 1.5 theta2 - kappa2 L/4)/L and u' = (u2 - u1)/L."""
    subject = Subject("thesis_four_bar", {})
    system = subject.assembled
    length, mass = (sp.Symbol(x, real=True) for x in ("b", "mu_coupler"))
    element = system["coupler.mass"]
    assert element.part(["theta@1"], ["w@1"]).matrix[0] == 311 * mass * length**2 / 4620
    assert element.part(["w@1"], ["w@2"]).matrix[0] == 25 * mass * length / 231
    values = {c.quantity.symbol: c.expression for c in system.constants}
    height = next(d for d in system.definitions if d.quantity.name == "h_coupler")
    values[height.quantity.symbol] = height.expression.xreplace(values)
    half = sp.Rational(125, 2000) * sp.Rational(254, 10000)  # of an eighth of an inch
    row = system["strain_recovery"].part(["coupler"])
    for unknown, factor in (("coupler.theta@1", -1.5), ("coupler.theta@2", 1.5)):
        assert float(row.part((), [unknown]).matrix[0].xreplace(values) / half * values[length]) == factor
    cosine = sp.Symbol("coupler_cosine", real=True)
    assert sp.expand(row.part((), ["B.x"]).matrix[0] - cosine / length).coeff(cosine) == 0
    stress = system["stress_recovery"].part(["coupler"], ["coupler.theta@2"]).matrix[0]
    modulus = stress / row.part((), ["coupler.theta@2"]).matrix[0]
    assert float(modulus.xreplace(values)) == pytest.approx(10.3e6 * 6894.757293168361)
    titles = [step.title for step in subject.record]
    assert titles[-3:] == [
        "Elastic link: element",
        "Elastic linkage: assembly",
        "Elastic linkage: strain and stress",
    ]
    assert subject.choose("coupler.mass").matrices == (element,)


def _compare_condensation(system, value, found):
    """Independent unknowns may be others: p of runs by those of the letters, at this time with its rates."""
    numbers = [found[name].values for name, _ in BASIS]
    rows = [found["elastic_mass"].rows.index(name) for name in system["condensation"].columns]
    r, rate, second = (m[rows] for m in numbers)
    turned = np.linalg.inv(r)
    first = -turned @ rate @ turned
    twice = -turned @ (second @ turned + 2 * rate @ first)
    expected = (
        numbers[0] @ turned,
        numbers[1] @ turned + numbers[0] @ first,
        numbers[2] @ turned + 2 * numbers[1] @ first + numbers[0] @ twice,
    )
    for (name, _), matrix in zip(BASIS, expected, strict=True):
        assert value[name] == pytest.approx(matrix, rel=1e-9, abs=1e-10 * max(1.0, np.max(np.abs(matrix)))), (
            name
        )
