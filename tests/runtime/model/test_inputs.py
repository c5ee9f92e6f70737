"""``[inputs]``: external signals in forces and torques, with their values passed to ``model.rhs(t, y, u)``."""

from __future__ import annotations

import numpy as np
import pytest
from shared.controlled import CART, CART_POLE, POLE, cart_pole
from shared.linkages import G, at, ground

import symgen
from symgen.errors import ModelError, SceneError


@pytest.fixture(scope="module")
def model():
    return symgen.build(CART_POLE)


@pytest.mark.parametrize(
    "x, theta, v, omega", [(0.0, 0.0, 0.0, 0.0), (0.3, 0.7, -0.4, 2.0), (-0.2, 2.5, 1, -3)]
)
@pytest.mark.parametrize("u", [(0.0, 0.0), (3.0, 0.0), (-1.0, 0.4)])
def test_a_cart_pole_accelerates_by_its_closed_form(model, x, theta, v, omega, u):
    """M of (x, theta) is [[m + mp, c cos], [c cos, mp l^2/3]], c = mp l/2, theta clockwise from the vertical."""
    f, (y, back) = model.rhs, cart_pole(model, x, theta, v, omega)
    c, inertia = POLE * 0.5 / 2, POLE * 0.5**2 / 3
    force, torque = u
    mass = np.array([[CART + POLE, c * np.cos(theta)], [c * np.cos(theta), inertia]])
    right = [force - 0.3 * v + c * np.sin(theta) * omega**2, c * G * np.sin(theta) + torque]
    assert back(f(0.0, y, u)[4:]) == pytest.approx(np.linalg.solve(mass, right), rel=1e-12, abs=1e-12)


def test_without_inputs_the_values_of_the_model_stand(model):
    f, y = model.rhs, cart_pole(model, 0.1, 0.4, 0.0, 1.0)[0]
    assert f.inputs == ("F", "T")
    before = f(0.0, y)
    other = f(0.0, y, [2.0, 0.1])
    assert not np.array_equal(before, other)
    assert np.array_equal(f(0.0, y), before)
    assert np.array_equal(model.with_parameters(F=2.0, T=0.1).rhs(0.0, y), other)
    assert np.array_equal(symgen.build(CART_POLE, set={"F": "2 N", "T": "10 N*cm"}).rhs(0.0, y), other)


def test_a_run_holds_inputs_at_their_values_in_the_model():
    scene = symgen.Scene(
        inputs={"F": "2 N"},
        points={"A": ground(0, 0), "B": ground(1, 0), "P": at(0, 0)},
        links={"rail": {"points": ["A", "B"]}},
        masses=[{"point": "P", "mass": "4 kg"}],
        guides=[{"points": ["P"], "along": "rail"}],
        forces=[{"point": "P", "force": ["F", "0 N"]}],
    )
    result = symgen.build(scene).with_parameters(F=3.0).simulate(0.5)
    assert result["P.position"][-1, 0] == pytest.approx(3.0 * 0.5**2 / (2 * 4.0), rel=1e-12)


def faulty(**tables):
    kept = {**CART_POLE.model_dump(exclude_unset=True), **tables}
    return symgen.build(symgen.Scene(**kept))


@pytest.mark.parametrize(
    "tables, text",
    [
        (
            {"masses": [{"point": "C", "mass": "F"}]},
            "F is an input, and inputs may occur in forces and torques",
        ),
        ({"inputs": {"c": "0 N"}}, "'c' is a parameter already"),
        ({"inputs": {"C_x": "0 N"}}, "component of the point C"),
        ({"inputs": {"t": "0 N"}}, "'t' already has a meaning"),
        ({"inputs": {"F": "0 N", "T": "0 N"}}, r"expected .*torque"),
        ({"inputs": {"F": "0 N", "T": {"about": "no value"}}}, r"\[inputs.T\] value: this key is missing"),
    ],
)
def test_wrong_inputs_are_refused(tables, text):
    with pytest.raises(SceneError, match=text):
        faulty(**tables)


@pytest.mark.parametrize("u", [[1.0], [1.0, 2.0, 3.0], 1.0, "ab", [[1.0, 2.0]]])
def test_wrong_values_are_refused(model, u):
    f = model.rhs
    with pytest.raises(ModelError, match=r"expected 2 inputs u \(F, T\)"):
        f(0.0, f.start, u)
