"""Derivatives of steady states of elastic links by parameters, at angles of the crank."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from shared.elastic_exact import CASES
from shared.elastic_steady import of_four_bar, of_strip

import symgen
from symgen.errors import ModelError

ANGLES = np.radians([1.0, 40.0, 110.0, 200.0, 290.0])
STRIP = ["speed", "length", "thickness", "width", "density", "E"]


def tunable(scene, **placed):
    """A shipped scene with some numbers as tunable parameters, by the key of a number: name and value."""
    changes = {}
    for name, (key, value) in placed.items():
        changes[f"parameters.{name}"] = {"value": value, "tunable": True}
        if key:
            changes[key] = name
    return symgen.build(scene, set=changes)


def test_a_strip_on_a_shaft_against_50_digits():
    values, _ = CASES["rotating_cantilever"]
    of_link = {
        "width": "section.width",
        "thickness": "section.thickness",
        "density": "density",
        "E": "elastic.E",
    }
    units = {"width": "m", "thickness": "m", "density": "kg/m^3", "E": "Pa"}
    placed = {n: (f"links.strip.{key}", f"{float(values[n])!r} {units[n]}") for n, key in of_link.items()}
    model = tunable("rotating_cantilever", length=("", "1 m"), **placed)
    steady = model.periodic(at=ANGLES[1:2])
    found = model.sensitivity(["tip.displacement"], STRIP, at=steady)
    expected, slopes = of_strip(ANGLES[1], STRIP)
    assert found.derivatives.shape == (1, 2, len(STRIP)) and found.t == pytest.approx(steady.times)
    size = np.max(np.abs(expected))
    assert np.all(np.abs(found.values[0] - expected) <= 1e-10 * size)
    parameters = np.array([float(values[name]) for name in STRIP])
    assert np.all(np.abs(found.derivatives[0] - slopes) * parameters <= 1e-9 * size)


@pytest.mark.full
def test_a_four_bar_against_its_equations_in_plain_numpy():
    """Strains of a link by all lengths, the section, material and masses: within 1e-9 of the largest."""
    section = {"a": "7 in", "b": "10 in", "c": "12 in", "frame": "11 in"}
    model = tunable("thesis_four_bar", **{name: ("", value) for name, value in section.items()})
    parameters = [*model.parameters]
    links = ("crank", "coupler", "output")
    names = [f"{link}.{kind}_strain" for kind in ("bending", "axial") for link in links]
    found = model.sensitivity(names, parameters, at=model.periodic(at=ANGLES))
    values, slopes = of_four_bar(ANGLES, parameters)
    scaled = found.derivatives * np.array([model.parameters[name] for name in parameters])
    for i in range(len(names)):
        both = [i % 3, i % 3 + 3]
        assert np.all(np.abs(found.values[:, i] - values[i]) <= 1e-10 * np.max(np.abs(values[both])))
        for j in range(len(parameters)):
            size = max(np.max(np.abs(slopes[j, both])), np.max(np.abs(values[both])))
            assert np.all(np.abs(scaled[:, i, j] - slopes[j, i]) <= 1e-9 * size)


def test_a_slider_crank_with_damped_modes_against_differences_of_shooting():
    """Shooting steps the compiled equations in time: a rigid crank, a guide, and a damping ratio."""
    placed = {
        "E": ("links.rod.elastic.E", "210 GPa"),
        "ratio": ("links.rod.elastic.damping.ratio", "0.01"),
        "l": ("", "200 mm"),
    }
    model = tunable("elastic_slider_crank", **placed)
    parameters = [*model.parameters]
    names = ["rod.stress", "P.displacement"]
    found = model.sensitivity(names, parameters, at=model.periodic(at=ANGLES))

    def shot(name, factor):
        changed = model.with_parameters(**{name: model.parameters[name] * factor})
        run = changed.periodic(at=ANGLES, rtol=1e-9)
        return np.column_stack([run["rod.stress"].values, run["P.displacement"].values])

    assert found.values == pytest.approx(shot("E", 1.0), rel=1e-8, abs=1e-12)
    for j, name in enumerate(parameters):
        near, far = ((shot(name, 1 + h) - shot(name, 1 - h)) / (2 * h) for h in (1e-3, 2e-3))
        expected = (4 * near - far) / 3
        scaled = found.derivatives[:, :, j] * model.parameters[name]
        size = np.maximum(np.max(np.abs(expected), axis=0), np.max(np.abs(found.values), axis=0))
        assert np.all(np.abs(scaled - expected) <= 1e-6 * size)


def test_what_has_no_derivatives_is_refused_by_name():
    free = symgen.build("elastic_four_bar_free")
    with pytest.raises(ModelError, match="its crank is not held at a constant speed"):
        free.sensitivity(["A.displacement"], at=free.periodic(at=[0.0], steps=64))
    strip = symgen.build("rotating_cantilever")
    steady = strip.periodic(at=[0.0])
    with pytest.raises(ModelError, match="no derivatives of 'frequencies' of a steady state"):
        strip.sensitivity(["frequencies"], at=steady)
    with pytest.raises(ModelError, match="expected a steady state or a run of this model"):
        strip.with_parameters(speed=10.0).sensitivity(["tip.displacement"], at=steady)
    with pytest.raises(ModelError, match="expected a steady state or a run of this model"):
        strip.sensitivity(["tip.displacement"], at=strip.quasi_static(at=[0.0]))
    plain = strip.periodic(at=[0.0], geometric_stiffness=False)
    for made in (plain, pickle.loads(pickle.dumps(plain))):
        with pytest.raises(ModelError, match="leave form and geometric_stiffness out"):
            strip.sensitivity(["tip.displacement"], at=made)
    with pytest.raises(ModelError, match="expected a state, an equilibrium or a time for at"):
        symgen.build("four_bar").sensitivity(["energy"], at=steady)
    with pytest.raises(ModelError, match="leave t_eval out"):
        strip.sensitivity(["tip.displacement"], at=steady, t_eval=[0.1])
