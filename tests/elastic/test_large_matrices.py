"""Residual and slopes of large rotation: an assembly from energies, differences of the residual, names."""

from __future__ import annotations

import numpy as np
import pytest
from shared.commands import call
from shared.full import full
from shared.large_assembly import Assembly

import symgen
from symgen.errors import ModelError
from symgen.runtime.elastic.large.matrices import reached_at

TIME = 2e-3
#: Sizes of the unknowns in comparisons.
_SIZE = {"m": 1.0, "rad": 5.0}
PENDULUM = {
    "title": "Elastic rod on a rigid one",
    "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["0.4 m", "0.1 m"]}, "B": {"at": ["0.9 m", "0 m"]}, "S": {"at": ["0 m", "0.5 m"], "ground": True},},
    "links": {
        "arm": {"points": ["O", "A"], "mass": "1 kg"},
        "rod": {
            "points": ["A", "B"], "density": "7850 kg/m^3", "section": {"width": "20 mm", "thickness": "4 mm"},
            "elastic": {"E": "210 GPa", "elements": 2, "damping": {"stiffness": "1e-4 s"}},
        },
    },
    "masses": [{"point": "B", "mass": "0.5 kg"}],
    "springs": [{"between": ["A", "S"], "stiffness": "100 N/m", "length": "0.1 m"}],
    "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    "crank": {"link": "arm", "mode": "free", "speed": "0 rpm"},
}  # fmt: skip


def pendulum():
    return symgen.build(symgen.Scene(**PENDULUM))


def scaled(matrix, *of_names):
    """Values with rotations in units of 0.2 rad."""
    for axis, units in enumerate(of_names):
        size = np.array([_SIZE[unit] for unit in units])
        matrix = matrix * size.reshape([-1 if k == axis else 1 for k in range(matrix.ndim)])
    return matrix


def test_matrices_are_those_of_an_assembly_from_energies():
    count = 2
    found = symgen.build("thesis_four_bar").matrices(TIME, over="time", elements=count)
    value = {name: matrix.values for name, matrix in found.items()}
    names, units = found["large_state"].rows, found["large_state"].row_units
    q, v, a = value["large_state"].T
    of = Assembly(names, count)
    turned = np.ptp([q[names.index(f"crank.theta@{k + 1}")] for k in range(count + 1)])
    assert turned > 0.003  # the crank is bent

    def near(mine, theirs, error, *of_names):
        theirs = scaled(theirs, *of_names)
        return np.max(np.abs(scaled(mine, *of_names) - theirs)) < error * np.max(np.abs(theirs))

    mass, residual = of.mass(q), of.residual(q, v)
    assert near(value["large_mass"], mass, 1e-12, units, units)
    assert near(value["large_residual"], residual, 1e-9, units)
    whole = mass @ a + residual + value["large_jacobian"].T @ value["large_multipliers"]
    assert np.max(np.abs(whole)) < 1e-8 * np.max(np.abs(residual))
    step = 1e-7
    by_rates, by_places = (
        np.array([
            (of.residual(q + e * step, v) + of.momentum(q + e * step, a)
             - of.residual(q - e * step, v) - of.momentum(q - e * step, a)) / (2 * step)
            if places else (of.residual(q, v + e) - of.residual(q, v - e)) / 2
            for e in np.eye(len(q))
        ]).T
        for places in (False, True)
    )  # fmt: skip
    assert near(value["large_damping"], by_rates, 1e-9, units, units)
    assert near(value["large_stiffness"], by_places, 1e-6, units, units)
    jacobian = found["large_jacobian"]
    held = ["crank.x@1", "crank.y@1", *(f"output.{x}@{count + 1}" for x in "xy"), "crank.theta@1"]
    assert [*jacobian.rows] == held
    assert np.array_equal(jacobian.values, np.array([[float(x == y) for y in names] for x in held]))


@pytest.mark.parametrize("name", ["elastic_slider_crank", "pendulum", full("elastic_four_bar_motor")])
def test_slopes_are_differences_of_the_residual(name):
    """With rigid links, guides, springs, damping, gravity, a motor; at bent links that rotate."""
    model = pendulum() if name == "pendulum" else symgen.build(name)
    linkage, at = reached_at(model.motion(True), 2, TIME)
    n, t, multipliers = linkage.unknowns, np.array([at.t]), at.multipliers[None]
    found = linkage.slopes(at.t, at.q, at.v, at.a, at.multipliers)

    def of(q, v, a):
        return linkage.residual(t, q[None], v[None], a[None], multipliers)[0]

    state, steps = (at.q, at.v, at.a), (1e-7, 1e-4 * np.max(np.abs(at.v)), np.max(np.abs(at.a)))
    units = ["rad" if ".theta" in name else "m" for name in linkage.names]
    for k, kind in enumerate(("stiffness", "damping", "mass")):
        columns = []
        for e in np.eye(n):
            up, down = ([x + sign * steps[k] * e * (k == j) for j, x in enumerate(state)] for sign in (1, -1))
            columns.append((of(*up) - of(*down)) / (2 * steps[k]))
        expected = scaled(np.array(columns).T, units, units)
        slopes = scaled(linkage.pattern.matrix(getattr(found, kind)).toarray()[:n, :n], units, units)
        assert np.max(np.abs(slopes - expected)) < 1e-6 * np.max(np.abs(expected)), kind


def test_linkages_with_free_coordinates_have_matrices_of_large_rotation():
    model = pendulum()
    start = model.matrices(0.0, over="time")
    assert [*start["large_state"].rows[:4]] == ["A.x", "A.y", "B.x", "B.y"]
    assert start["large_state"].row_units[-1] == "rad"
    assert [*start["large_jacobian"].rows] == ["arm"]
    value = {name: matrix.values for name, matrix in start.items()}
    a = value["large_state"][:, 2]
    whole = (
        value["large_mass"] @ a
        + value["large_residual"]
        + value["large_jacobian"].T @ value["large_multipliers"]
    )
    assert np.max(np.abs(whole)) < 1e-9 * np.max(np.abs(value["large_residual"]))
    assert np.array_equal(
        model.matrices(0.0, over="time", elements=4)["large_mass"].values, value["large_mass"]
    )
    with pytest.raises(ModelError, match="no assembled matrix 'elastic_mass'"):
        start["elastic_mass"]
    with pytest.raises(ModelError, match="time of zero or more"):
        model.matrices(-1.0, over="time")
    with pytest.raises(ModelError, match="from 1 to 1000 elements"):
        model.matrices(elements=0)


def test_show_prints_them_with_their_names():
    text = call(
        "show", "thesis_four_bar", "large_stiffness", "--rows", "A.x", "--columns", "A.x,crank.theta@1"
    )
    assert text.startswith("large_stiffness at the start") and "crank.theta@1" in text
    assert "large_residual" in call("show", "thesis_four_bar")
    with pytest.raises(ModelError, match="four_bar has no elastic links in the plane"):
        call("show", "four_bar", "large_mass")
