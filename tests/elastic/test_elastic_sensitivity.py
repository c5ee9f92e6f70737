"""Derivatives of linkages with elastic links against beams assembled in 40 digits."""

from __future__ import annotations

import json
from copy import deepcopy
from functools import cache

import mpmath as mp
import numpy as np
import pytest
from shared.elastic_exact import CASES, OF_JOINTS, REFERENCE, slopes
from shared.full import full_unless

import symgen
from symgen.errors import ModelError
from symgen.scene.loading import SHIPPED, read_scene

#: The scene that is compared in every run of the tests.
QUICK = {"elastic_four_bar"}
#: Numbers of scenes that are parameters here, by key.
PLACED = {
    "elastic_four_bar_motor": {"crank.flywheel": "flywheel"},
    "elastic_slider_crank": {
        "links.rod.section.width": "width", "links.rod.section.thickness": "thickness",
        "links.rod.density": "density", "links.rod.elastic.E": "E", "masses.0.mass": "piston",
    },
    "rotating_cantilever": {
        "links.strip.section.width": "width", "links.strip.section.thickness": "thickness",
        "links.strip.density": "density", "links.strip.elastic.E": "E",
    },
}  # fmt: skip
UNITS = {
    "flywheel": "slug*ft^2", "piston": "kg", "density": "kg/m^3", "E": "Pa", "width": "m", "thickness": "m",
}  # fmt: skip


@cache
def tunable(scene):
    """A shipped scene with all parameters of the reference tunable."""
    values, _ = CASES[scene]
    known = read_scene(SHIPPED / f"{scene}.toml").data["parameters"]
    changes = dict(PLACED.get(scene, {}))
    for name, value in values.items():
        given = known.get(
            name, "0.5 slug*ft^2" if name == "flywheel" else f"{float(value)!r} {UNITS.get(name)}"
        )
        given = given["value"] if isinstance(given, dict) else given
        changes[f"parameters.{name}"] = {"value": given, "tunable": True}
    return symgen.build(scene, set=changes)


def compared(found, stored, parameters, natural):
    """Values agree, and derivatives within 1e-9; those that vanish are compared with value over parameter."""
    count = len(stored["values"])
    assert found.values[:count] == pytest.approx([float(x) for x in stored["values"]], rel=1e-10, abs=1e-20)
    expected = np.array([[float(x) for x in row] for row in stored["by"].values()]).T
    size = natural[:, None] / np.array([*parameters])
    vanish = ~np.any(expected, axis=0)
    away = np.abs(found.derivatives[:count] - expected)
    assert np.all(away <= 1e-9 * np.abs(expected) + np.where(vanish, 1e-9, 1e-12) * size)


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene in QUICK, CASES))
def test_frequencies_of_shipped_scenes_have_exact_derivatives(scene):
    (values, t), stored = CASES[scene], json.loads(REFERENCE.read_text())["frequencies"][scene]
    model = tunable(scene)
    found = model.sensitivity(["frequencies"], [*values], at=t)
    natural = found.values[: len(stored["values"])]
    compared(found, stored, [model.parameters[name] for name in values], natural)


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene in QUICK, OF_JOINTS))
def test_quasi_static_displacements_of_shipped_scenes_have_exact_derivatives(scene):
    """Their parameters c and r are called like symbols of the derivation."""
    (values, t), stored = CASES[scene], json.loads(REFERENCE.read_text())["displacements"][scene]
    model = tunable(scene)
    points = dict.fromkeys(name.rpartition(".")[0] for name in OF_JOINTS[scene])
    found = model.sensitivity([*points], [*values], at=t)
    assert found.outputs[: len(stored["values"])] == (*OF_JOINTS[scene],)
    natural = np.abs(found.values[: len(stored["values"])])
    compared(found, stored, [model.parameters[name] for name in values], natural)


def test_strain_and_stress_of_a_rod_on_a_shaft():
    """Axial stress rho w^2 (L^2 - x^2)/2, of which an element has the mean over its length."""
    model, length = tunable("rotating_cantilever"), 1.0
    found = model.sensitivity(["root.stress"], ["speed", "density", "length"])
    w, rho = model.parameters["speed"], model.parameters["density"]
    mean = (1 - 1 / 48) * length**2 / 2
    assert found.values == pytest.approx([rho * w**2 * mean], rel=1e-12)
    expected = [2 * rho * w * mean, w**2 * mean, 2 * rho * w**2 * mean / length]
    assert found.derivatives[0] == pytest.approx(expected, rel=1e-12)


def test_what_has_no_derivatives_is_refused_by_name():
    reduction = {"kind": "craig-bampton", "modes": 1}
    model = symgen.build("elastic_four_bar", set={"links.crank.elastic.reduction": reduction})
    with pytest.raises(ModelError, match="link crank is reduced to modes"):
        model.sensitivity(["frequencies"])
    with pytest.raises(ModelError, match=r"no derivatives of 'B.position'.*\n?.*displacement"):
        symgen.build("elastic_four_bar").sensitivity(["B.position"])


def test_places_that_move_along_a_link_are_refused_by_the_parameter_that_moves_them():
    data = deepcopy(dict(read_scene(SHIPPED / "rotating_cantilever.toml").data))
    data["parameters"]["at"] = {"value": "0.5", "tunable": True}
    data["points"]["X"] = {"on": "strip", "fraction": "at"}
    data["masses"] = [{"point": "X", "mass": "0.1 kg"}]
    model = symgen.build(symgen.Scene(**data))
    with pytest.raises(ModelError, match=r"move along it with at: derivatives by it"):
        model.sensitivity(["frequencies"], ["speed", "at"])
    assert model.sensitivity(["frequencies"], ["speed"]).derivatives.shape[1] == 1


def test_derivatives_at_several_times_are_those_at_each():
    model, times = symgen.build("elastic_slider_crank"), [0.003, 0.001]
    found = model.sensitivity(["frequencies", "P.displacement"], ["speed"], t_eval=times)
    for k, t in enumerate(times):
        one = model.sensitivity(["frequencies", "P.displacement"], ["speed"], at=t)
        assert np.array_equal(found.values[k], one.values)
        assert np.array_equal(found.derivatives[k], one.derivatives)
    assert found.derivatives.shape == (2, *one.derivatives.shape) and found.t.tolist() == times


@pytest.mark.full
def test_names_of_parameters_do_not_change_energies():
    """Densities called like the velocity and the angular velocity of a link, and one called unlike anything."""

    def energies(name):
        given = {f"parameters.{name}": {"value": "3000 kg/m^3", "tunable": True}}
        model = symgen.build("elastic_four_bar", set=given | {"links.coupler.density": name})
        kernels, state = model.rigid.analysis("elastic_motion"), model.rigid.initial_state()
        work = np.linspace(-1.0, 2.0, kernels.description.work_size + 1)
        return kernels.blocks("energies", 0.0, state.q, state.q, work)["energies"]

    expected = energies("plain")
    for name in ("v_x", "omega"):
        assert energies(name) == pytest.approx(expected, rel=1e-13)


def test_the_stored_reference_is_reproduced():
    stored = json.loads(REFERENCE.read_text())["frequencies"]["elastic_slider_crank"]
    with mp.workdps(40):
        values, by = slopes("elastic_slider_crank", ["l"])
        for row, expected in ((values, stored["values"]), (by["l"], stored["by"]["l"])):
            assert all(abs(x / mp.mpf(y) - 1) < mp.mpf("1e-22") for x, y in zip(row, expected, strict=True))
