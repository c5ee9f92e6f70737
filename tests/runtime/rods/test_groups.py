"""Groups of driven linkages, and forces by multipliers against the equations of the elements."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from shared.in_numpy import build
from shared.linkages import GRAVITY, at, circles, four_bar, ground, rod, stephenson

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.rods.following.branch import steps_of
from symgen.runtime.rods.following.groups import groups_of
from symgen.runtime.rods.forces import analysis


def groups(model):
    constraints = model.constraints()
    assert constraints.m == constraints.n
    return constraints, groups_of(constraints.slopes, range(constraints.m), constraints.n)


@pytest.mark.parametrize(
    ("scene", "widths"),
    [(four_bar(0.1, 0.35, 0.3, 0.4, 0.3), [2, 2]), (stephenson(), [2, 4])],
    ids=["crank and dyad", "crank and triad"],
)
def test_groups_solve_what_the_whole_jacobian_solves(scene, widths):
    """The third point of the ternary link is no unknown: it is carried by the other two."""
    model = build(scene)
    constraints, found = groups(model)
    assert found.widths == widths
    q = model.initial_state().q
    steps = steps_of(constraints, q, 0.0)
    times = np.linspace(0.0, 6.0, 40)
    states = steps.follow(0.0, q, times)
    assert len(states) == len(times)
    for t, (q, u, a) in zip(times.tolist(), states, strict=True):
        jacobian = constraints.jacobian(q, t)
        assert np.max(np.abs(constraints.residual(q, t))) < 1e-14
        assert u == pytest.approx(np.linalg.solve(jacobian, -constraints.drift(q, t)), abs=1e-12)
        assert a == pytest.approx(np.linalg.solve(jacobian, constraints.gamma(q, u, t)), abs=1e-11)


def test_dependent_constraints_have_no_groups():
    places = np.array([(0, 0, 0), (1, 0, 1)])
    with pytest.raises(ValueError, match="dependent in every pose"):
        groups_of(places, [0, 1], 2)


@pytest.fixture
def by_elements(monkeypatch):
    """Switch the multipliers off when called; until then, record whether they gave the forces."""
    given, compiled = [], analysis.by_multipliers

    def spied(*arguments):
        found = compiled(*arguments)
        given.append(found is not None)
        return found

    monkeypatch.setattr(analysis, "by_multipliers", spied)

    def off(model, **asked):
        assert given == [True]
        monkeypatch.setattr(analysis, "by_multipliers", lambda *arguments: None)
        return model.inverse_dynamics(**asked)

    return off


def random_scene(seed):
    """A four-bar linkage with a load of each kind on links of any centre and inertia."""
    random = np.random.default_rng(seed)
    crank, coupler, rocker, base = 0.1, 0.35, 0.3, 0.4
    angle = random.uniform(0, 6)
    a = crank * np.array([np.cos(angle), np.sin(angle)])
    b = circles(a, [base, 0.0], coupler, rocker)
    link = {"points": ["A", "B"], "mass": f"{random.uniform(0.1, 3)} kg", "inertia": f"{random.uniform(0.01, 1)} kg*m^2",
            "centre": [f"{x} m" for x in random.uniform(-0.3, 0.6, 2).tolist()]}  # fmt: skip
    return symgen.Scene(
        parameters={"w": f"{random.uniform(1, 30)} rad/s"},
        points={"O": ground(0, 0), "A": at(*a), "B": at(*b), "C": ground(base, 0)},
        links={"crank": rod("O", "A", random.uniform(0.1, 2)), "coupler": link, "rocker": rod("C", "B")},
        masses=[{"point": "B", "mass": f"{random.uniform(0, 2)} kg"}],
        springs=[{"between": ["A", "C"], "stiffness": "900 N/m", "length": "0.1 m", "damping": "5 N*s/m"}],
        torsion_springs=[{"link": "coupler", "against": "crank", "stiffness": "3 N*m/rad"}],
        torques=[{"link": "rocker", "torque": "7 N*m"}],
        forces=[{"point": "B", "force": ["20 N", "-30 N"]}],
        drivers=[{"link": "crank", "angle": f"{angle} + w*t + 0.2*sin(w*t)"}],
        gravity=GRAVITY,
        analysis={"t_end": "0.4 s"},
    )


@pytest.mark.parametrize("scene", [*map(random_scene, range(2)), stephenson(), "crank_rocker"], ids=str)
def test_forces_by_multipliers_are_those_by_elements(scene, by_elements):
    """Two derivations: Attia's constraints and their multipliers, and the balance of rigid elements."""
    model = build(scene)
    asked = {"samples": 60, "elements": 2, "sections": (0.3,)}
    found = model.inverse_dynamics(**asked)
    reference = by_elements(model, **asked)
    assert [v.name for v in found.variables] == [v.name for v in reference.variables]
    largest = max(np.max(np.abs(v.values)) for v in reference.variables)
    for v in reference.variables:
        assert found[v.name].values == pytest.approx(v.values, abs=1e-12 * largest), v.name
    assert found.statistics["residual"] < 1e-12
    assert found.statistics["condition"] <= reference.statistics["condition"] * (1 + 1e-9)


@pytest.mark.parametrize("by", ["multipliers", "elements"])
def test_loads_that_are_not_a_number_are_named(by, monkeypatch):
    """The force is a root of a number that falls below zero at t = 0.19 s."""
    if by == "elements":
        monkeypatch.setattr(analysis, "by_multipliers", lambda *arguments: None)
    scene = four_bar(0.1, 0.35, 0.3, 0.4, 0.3).model_dump(exclude_unset=True)
    scene["parameters"] |= {"F": "1 N", "T": "0.2 s"}
    scene["forces"] = [{"point": "B", "force": ["F*sqrt(0.95 - t/T)", "0 N"]}]
    model = build(symgen.Scene(**scene))
    with pytest.raises(
        SimulationError, match="no finite forces at crank.angle = .*: a load there is not"
    ) as error:
        model.inverse_dynamics(0.0, 0.3, over="time", samples=31)
    assert error.value.time == pytest.approx(0.2, abs=1e-9)
    assert np.isfinite(
        model.inverse_dynamics(0.0, 0.18, over="time", samples=31)["crank.torque"].values
    ).all()


def test_steps_keep_the_kernels_that_they_call():
    model = build("crank_rocker")
    steps = steps_of(model.constraints(), model.initial_state().q, 0.0, model.analysis("forces"))
    start = model.initial_state().q
    model.__dict__.clear()
    del model
    gc.collect()
    times = np.linspace(0.0, 0.1, 3)
    states = steps.follow(0.0, start, times)
    multipliers, quality = steps.multipliers(times, states)
    assert np.all(np.isfinite(multipliers)) and multipliers.shape == (3, 4)
    assert np.all(quality[:, 0] > 1e-3)


def test_errors_of_multipliers_are_those_of_the_equations_at_each_pose():
    """J^T lambda = f - M a, with the Jacobian of the dense kernel in place of the groups."""
    model = build("crank_rocker")
    constraints, loads, start = model.constraints(), model.analysis("forces"), model.initial_state().q
    steps = steps_of(constraints, start, 0.0, loads)
    times = np.linspace(0.0, 1.0, 9)
    states = steps.follow(0.0, start, times)
    multipliers, quality = steps.multipliers(times, states)
    for i, (t, (q, u, a)) in enumerate(zip(times.tolist(), states, strict=True)):
        jacobian = model.evaluator("constraint_jacobian", t, q, u)[: constraints.m * constraints.n].reshape(
            constraints.m, -1
        )
        balance = loads("balance", t, q, u, np.append(a, np.zeros(loads.info("balance").work_size)))
        missed = balance[: constraints.n] - jacobian.T @ multipliers[i]
        size = np.max(np.abs(multipliers[i] * np.max(np.abs(jacobian), axis=1)))
        assert quality[i, 1] == pytest.approx(np.max(np.abs(missed)), abs=1e-14 * size)
        assert quality[i, 1] < 1e-13 * size


def test_forces_without_their_kernel_are_refused():
    model = build("crank_rocker")
    with pytest.raises(ModelError, match="no kernel 'balance'"):
        steps_of(model.constraints(), model.initial_state().q, 0.0, model.evaluator)


def test_states_of_another_shape_are_refused():
    model = build("crank_rocker")
    start = model.initial_state().q
    steps = steps_of(model.constraints(), start, 0.0)
    with pytest.raises(ValueError, match="expected states of shape"):
        steps.multipliers(np.zeros(1), np.zeros((1, 3, 4)))
