"""Derivatives of linkages with elastic links against beams assembled in 40 digits."""

from __future__ import annotations

import json
from copy import deepcopy

import mpmath as mp
import numpy as np
import pytest
from shared.elastic_exact import OF_JOINTS, REFERENCE, slopes
from shared.exact_slopes import of_elastic, tunable
from shared.full import full_unless

import symgen
from symgen.errors import ModelError
from symgen.scene.loading import SHIPPED, read_scene


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene == "elastic_four_bar", OF_JOINTS))
def test_quasi_static_displacements_of_shipped_scenes_have_exact_derivatives(scene):
    """Their parameters c and r are called like symbols of the derivation."""
    assert of_elastic(scene, "displacements") <= 1e-9


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


@pytest.mark.parametrize("elastic_rocker", [False, True])
def test_torsion_springs_count_revolutions_in_derivatives(elastic_rocker):
    """The spring passes half a revolution as the rocker turns: by differences of quasi-static runs."""
    strip = {
        "section": {"width": "20 mm", "thickness": "5 mm"},
        "density": "7800 kg/m^3",
        "elastic": {"E": "200 GPa", "elements": 2},
    }
    spring = {"link": "rocker", "stiffness": "k", "angle": "-50 deg"}
    scene = symgen.Scene(
        parameters={"k": {"value": "5 N*m", "tunable": True}},
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["0.1 m", "0 m"]},
            "B": {"at": ["0.4 m", "0.3 m"]},
            "D": {"at": ["0.5 m", "0 m"], "ground": True},
        },
        links={
            "crank": {"points": ["O", "A"], "mass": "1 kg"},
            "coupler": {"points": ["A", "B"], **strip},
            "rocker": {"points": ["D", "B"], **(strip if elastic_rocker else {"mass": "0.3 kg"})},
        },
        crank={"link": "crank", "speed": "60 rpm"},
        torsion_springs=[spring | ({"point": "D"} if elastic_rocker else {})],
    )
    model = symgen.build(scene, backend="numpy")
    output = "rocker.bending_strain" if elastic_rocker else "coupler.axial_strain"

    def strains(k):
        return model.with_parameters(k=k).quasi_static(samples=5)[output].values[:4]

    differences = (strains(5.005) - strains(4.995)) / 0.01
    found = [model.sensitivity([output], ["k"], at=t).derivatives[0, 0] for t in (0.0, 0.25, 0.5, 0.75)]
    assert found == pytest.approx(differences, rel=1e-7)
