"""Models and results of every method go through pickle, and through newly started processes."""

from __future__ import annotations

import math
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import symgen
from symgen.errors import ModelError


def positions(model):
    """What another process computes with a model."""
    return model.simulate(0.05, samples=3).variable("B.position").values


def run_of(model):
    if "simulate" in model.capabilities and "periodic" not in model.capabilities:
        return model.simulate(0.05, samples=3)
    return model.inverse_dynamics(samples=5)


MODELS = {
    "rods": ("four_bar", {}),
    "rods in space": ("tumbling_body", {}),
    "rods, kinematics": (
        "crank_rocker",
        {"set": {"analysis.kind": "kinematics", "analysis.outputs": ["A.position"]}},
    ),
    "driven loop": ("slider_crank", {"set": {"a4": "10 in"}}),
    "free loop": ("cssp", {}),
    "elastic": ("thesis_four_bar", {}),
    "NumPy": ("four_bar", {"backend": "numpy"}),
    "float128": ("four_bar", {"precision": "float128"}),
}


@pytest.mark.parametrize("name", MODELS)
def test_models_are_restored_with_their_options_and_parameters(name):
    scene, options = MODELS[name]
    model = symgen.build(scene, **options)
    again = pickle.loads(pickle.dumps(model))
    assert type(again) is type(model) and again.capabilities == model.capabilities
    assert (again.name, again.backend, again.precision) == (model.name, model.backend, model.precision)
    assert dict(again.parameters) == dict(model.parameters)
    if "kinematics" in name:
        one, other = (m.kinematics(samples=5) for m in (model, again))
    else:
        one, other = run_of(model), run_of(again)
    assert [v.values.tobytes() for v in one.variables] == [v.values.tobytes() for v in other.variables]
    assert other.provenance["equations"] == one.provenance["equations"]


def test_changed_parameters_are_restored():
    model = symgen.build("slider_crank").with_parameters(a4=0.3)
    again = pickle.loads(pickle.dumps(model))
    assert again.parameters["a4"] == 0.3 and again.is_changed
    built = symgen.build("peaucellier", set={"rho": "3 kg/m"})
    assert pickle.loads(pickle.dumps(built)).parameters["rho"] == 3.0


def test_the_rigid_linkage_of_elastic_links_stays_one():
    elastic = symgen.build("thesis_four_bar")
    rigid = pickle.loads(pickle.dumps(elastic.rigid))
    assert type(rigid) is type(elastic.rigid)
    again = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(elastic))))
    assert again.unknowns == elastic.unknowns


def test_equations_are_derived_after_pickling():
    again = pickle.loads(pickle.dumps(symgen.build("four_bar")))
    assert again.equations["mass_matrix"].shape[0] == again.description.coordinates


def test_models_work_in_processes_that_are_started_anew():
    models = [symgen.build("four_bar"), symgen.build("four_bar", precision="longdouble")]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        for model, found in zip(models, pool.map(positions, models), strict=True):
            assert found.tobytes() == positions(model).tobytes()


def test_results_are_pickled_with_their_coordinate():
    run = symgen.build("four_bar").simulate(0.05, samples=3)
    again = pickle.loads(pickle.dumps(run))
    assert again.dataset.identical(run.dataset) and again.drift == run.drift
    turn = symgen.build("slider_crank").inverse_dynamics(0.0, math.pi, samples=5)
    again = pickle.loads(pickle.dumps(turn))
    assert again.coordinate.name == "theta1" and again.units == turn.units
    assert np.array_equal(again.time, turn.time)


def test_user_defined_systems_are_restored_from_their_file(tmp_path):
    file = tmp_path / "square.py"
    file.write_text(
        "import sympy as sp\n"
        "from symgen.symbolic.quantity import quantity\n"
        "from symgen.symbolic.system import Export, Group, NamedMatrix, System\n"
        "def system():\n"
        "    x = quantity('x', 'm', 'a length')\n"
        "    area = NamedMatrix('area', sp.ImmutableMatrix([[x.symbol**2]]), 'm^2', 'its square')\n"
        "    return System(name='square', title='Square', groups=(Group('q', 'length', (x,)),),\n"
        "                  matrices=(area,), exports=(Export('squared', 'square', ('area',)),))\n"
    )
    again = pickle.loads(pickle.dumps(symgen.build(file)))
    assert again.evaluate("squared", q=[3.0])["area"] == 9.0


def test_a_model_without_its_scene_is_refused():
    model = symgen.build("four_bar")
    alone = type(model)(model.description, model.evaluator.library, lambda: None)
    with pytest.raises(ModelError, match="without its scene"):
        pickle.dumps(alone)
