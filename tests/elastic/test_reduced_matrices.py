"""(E.21)-(E.29) of the thesis: matrices of inextensible links in a pose, with a constant condensing matrix."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import eigh
from shared.commands import call
from shared.elastic_rigid import FourBar
from shared.thesis_assembly import assembled

import symgen
from symgen.errors import ModelError
from symgen.inspection.state import state_of
from symgen.pipeline.subject import Subject

#: Drawn with the crank across the frame, where A.x is the independent unknown.
UPRIGHT = {"points.A.at": ["0 in", "7 in"], "points.B.at": ["7.6 in", "11.5 in"]}
INEXTENSIBLE = {f"links.{link}.elastic.axial": False for link in ("crank", "coupler", "output")}


@pytest.fixture(scope="module")
def four_bar():
    return symgen.build("thesis_four_bar", set=INEXTENSIBLE), Subject(
        "thesis_four_bar", INEXTENSIBLE
    ).assembled


def numbers(system, name, values):
    """Evaluate a matrix by its shared terms, one after the other."""
    known = {q.symbol: sp.Float(values[q.name]) for q in system.arguments() if q.name in values}
    known |= {c.quantity.symbol: sp.N(c.expression) for c in system.constants}
    for d in system.definitions:
        known[d.quantity.symbol] = d.expression.xreplace(known)
    return system[name].matrix.xreplace(known)


def allowed(angle, unknown="B.x"):
    """Return R by (E.43)-(E.46): A moves across the crank, B across the output link, by the unit of B.x or A.x."""
    t1, t2, t3 = FourBar().motion(math.radians(angle)).angles[:, 0]
    g = math.sin(t2 - t1) / math.sin(t2 - t3)
    a_x, a_y, b_x, b_y = -math.sin(t1), math.cos(t1), -g * math.sin(t3), g * math.cos(t3)
    r = np.zeros((10, 7))
    column = 1 if unknown == "A.x" else 3
    for row, k in zip((0, 3, 4, 7, 8, 9), (k for k in range(7) if k != column), strict=True):
        r[row, k] = 1.0
    r[[1, 2, 5, 6], column] = np.array([a_x, a_y, b_x, b_y]) / (a_x if unknown == "A.x" else b_x)
    return r


def show(name, *options):
    settings = {key: str(value).lower() for key, value in INEXTENSIBLE.items()} | UPRIGHT
    changed = (x for key, value in settings.items() for x in ("--set", f"{key}={value}"))
    return call("show", "thesis_four_bar", name, *options, *changed)


def test_independent_unknowns_are_those_of_the_drawn_pose():
    """Headers name them; where they do not determine the motion, an error does."""
    model = symgen.build("thesis_four_bar", set=INEXTENSIBLE | UPRIGHT)
    system = Subject("thesis_four_bar", INEXTENSIBLE | UPRIGHT).assembled
    assert "p has A.x of the joints" in system["condensation"].description
    values = state_of(model, "60 deg").of(system, {})
    r, mass = allowed(60, "A.x"), assembled(math.radians(60))["elastic_mass"]
    found = np.array(numbers(system, "reduced_mass", values), dtype=float)
    assert found == pytest.approx(r.T @ mass @ r, abs=1e-9 * np.max(found))
    numeric = "reduced_mass", "--format", "numeric"
    assert f"{found[1, 1]:.10e}" in show(*numeric, "--at", "60")
    for angle in (0, 180):  # A moves along y alone
        message = f"A.x, independent in the drawn pose, does not determine the motion at {angle} deg"
        with pytest.raises(ModelError, match=message):
            show(*numeric, "--at", angle)
        assert f"condensed_mass at {angle} deg" in show("condensed_mass", "--at", angle)


@pytest.mark.parametrize("angle", [60, 200])
def test_reduced_matrices_are_those_of_the_thesis(four_bar, angle):
    model, system = four_bar
    values = state_of(model, f"{angle} deg").of(system, {})
    r, expected = allowed(angle), assembled(math.radians(angle))
    assert np.array(numbers(system, "condensation", values), dtype=float) == pytest.approx(r, abs=1e-9)
    reduced = {}
    for name in ("stiffness", "mass", "gyroscopic", "load"):
        whole = expected[f"elastic_{name}"]
        reduced[name] = r.T @ whole @ r if whole.ndim == 2 else r.T @ whole
        found = np.array(numbers(system, f"reduced_{name}", values), dtype=float)
        size = np.max(np.abs(reduced[name]))
        assert found.reshape(reduced[name].shape) == pytest.approx(reduced[name], abs=1e-9 * size), name
    squares = eigh(reduced["stiffness"], reduced["mass"], eigvals_only=True)
    scale = np.sqrt(np.diag(reduced["stiffness"]))
    for square in squares[:3]:
        at = values | {"omega_free": math.sqrt(square)}
        free = np.array(numbers(system, "free_vibration", at), dtype=float)
        assert np.min(np.abs(np.linalg.eigvalsh(free / np.outer(scale, scale)))) < 1e-8


def test_lengths_cancel_in_the_condensing_matrix(four_bar):
    """Rows of the constraints are over lengths, by which no entry of R depends."""
    _, system = four_bar
    entries = system.expanded("condensation")
    assert {str(s) for s in entries.free_symbols} == {"A_x", "A_y", "B_x", "B_y", "frame"}
    of_basis = [d for d in system.definitions if d.quantity.name.startswith(("eliminated_", "condensation_"))]
    lengths = {sp.Symbol(x, real=True) for x in "abc"}
    assert of_basis and not any(d.expression.free_symbols & lengths for d in of_basis)
