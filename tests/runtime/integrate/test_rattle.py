"""RATTLE and its compositions: there and back, energy over long runs, forces of velocities, drives, hard steps."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import GRAVITY, at, chain, ground, rod

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.runtime.integrate.integrators import INTEGRATORS

RATTLES = [name for name, m in INTEGRATORS.items() if m.kind == "rattle"]


@pytest.fixture(scope="module")
def pendulum():
    return symgen.build("triple_pendulum")


def damped():
    """A pendulum of two rods with a damped spring to the ground, in a uniform field: forces of velocities."""
    return symgen.Scene(
        points={"O": ground(0, 0), "A": at(0.5, 0.1), "B": at(1.0, 0.0), "E": ground(1.0, -0.8)},
        links={"first": rod("O", "A"), "second": rod("A", "B", 0.7)},
        gravity=GRAVITY,
        springs=[
            {
                "between": ["B", "E"],
                "stiffness": "40 N/m",
                "length": "0.6 m",
                "damping": "1.5 N*s/m",
            }
        ],
    )


def driven():
    """Two rods that hang from a crank at constant speed: constraints of the time, and motion that they leave."""
    return symgen.Scene(
        parameters={"w": "3 rad/s"},
        points={"O": ground(0, 0), "A": at(0.2, 0.0), "B": at(0.2, -0.6), "C": at(0.5, -0.9)},
        links={"crank": rod("O", "A"), "first": rod("A", "B"), "second": rod("B", "C", 0.4)},
        gravity=GRAVITY,
        drivers=[{"link": "crank", "angle": "w*t"}],
    )


def ends(model, result):
    return np.concatenate([result.final[p]["position"] for p in model.description.free])


@pytest.mark.parametrize("name", RATTLES)
def test_backwards_to_the_start(name, pendulum):
    """Forward, velocities turned round, forward again: the start, to what rounding has grown to."""
    model, start = pendulum, pendulum.initial_state()
    there = model.simulate(0.5, method=name, step=1 / 256)
    places = {p: there.final[p]["position"] for p in model.description.free}
    rates = {p: -np.array(there.final[p]["velocity"]) for p in model.description.free}
    back = model.simulate(0.5, method=name, step=1 / 256, state=model.state(places, rates))
    assert ends(model, back) == pytest.approx(start.q, abs=2e-12)
    moved = np.max(np.abs(ends(model, there) - start.q))
    assert moved > 0.1


def test_other_methods_do_not_come_back_so_well(pendulum):
    model, start = pendulum, pendulum.initial_state()
    there = model.simulate(0.5, method="rk4", step=1 / 64)
    places = {p: there.final[p]["position"] for p in model.description.free}
    rates = {p: -np.array(there.final[p]["velocity"]) for p in model.description.free}
    back = model.simulate(0.5, method="rk4", step=1 / 64, state=model.state(places, rates))
    assert np.max(np.abs(ends(model, back) - start.q)) > 1e-8


@pytest.mark.parametrize("name", RATTLES)
@pytest.mark.parametrize("scene", [damped, driven])
def test_order_with_dampers_and_with_drives(name, scene):
    model, order = symgen.build(scene()), INTEGRATORS[name].order
    truth = ends(model, model.simulate(1.0, rtol=1e-13))
    counts = {2: (200, 400), 4: (100, 200), 6: (48, 96), 8: (32, 64)}[order]
    errors = [
        np.max(np.abs(ends(model, model.simulate(1.0, method=name, step=1 / n)) - truth)) for n in counts
    ]
    observed = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    assert observed > order - 0.4, errors


def test_energy_without_trend():
    """Two rods over 40,000 steps: the error of the energy swings, its mean of late is that of the beginning."""
    model = symgen.build(chain([(0, 0), (0.5, 0), (1.0, 0.0)]))
    run = model.simulate(40.0, method="rattle", step=1e-3, samples=2001)
    energy = energies(model, run)
    error = energy - energy[0]
    late, early = np.mean(error[-600:]), np.mean(error[:600])
    size = np.max(np.abs(error))
    assert abs(late - early) < 0.1 * size
    assert run.drift.constraint < 1e-15
    assert run.drift.energy < 5e-3


def energies(model, run):
    n = len(run.time)
    found = np.zeros(n)
    free = model.description.free
    for i in range(n):
        q, u = (
            np.concatenate([run[f"{p}.{what}"].values[i] for p in free]) for what in ("position", "velocity")
        )
        found[i] = np.sum(model.evaluator("energy", run.time[i], q, u)[:2])
    return found


def test_compositions_are_worth_their_parts(pendulum):
    """At as many parts a second, the higher orders are the more exact."""
    truth = ends(pendulum, pendulum.simulate(0.5, rtol=1e-13))
    errors = []
    for name, parts in (("rattle", 1), ("rattle4", 5), ("rattle6", 9)):
        run = pendulum.simulate(0.5, method=name, step=parts / 4500)
        errors.append(np.max(np.abs(ends(pendulum, run) - truth)))
    assert errors == sorted(errors, reverse=True)


def test_the_whip_needs_the_jacobian_anew():
    """At the crack of the whip iterations with the factor of the step's start diverge at this step."""
    model = symgen.build("whip")
    result = model.simulate(0.45, method="rattle", step=8e-4)
    assert result.drift.constraint < 1e-14


def test_a_step_too_long_is_told():
    model = symgen.build("triple_pendulum")
    with pytest.raises(SimulationError, match=r"could not be brought back onto the constraints at t = "):
        model.simulate(20.0, method="rattle", step=2.0)


@pytest.mark.parametrize("name", RATTLES)
def test_what_is_at_rest_without_forces_stays(name):
    """Velocities and accelerations are zero, and so is the size that errors are compared with."""
    points = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
    run = symgen.Chain([1.0, 1.0], [1.0, 1.0], gravity=(0, 0)).simulate(0.1, points, method=name, step=0.01)
    assert (run.positions == points).all() and not run.velocities.any()


def test_no_other_stabilisation(pendulum):
    with pytest.raises(ModelError, match="stabilisation=raw goes with explicit methods, not with rattle"):
        pendulum.simulate(1.0, method="rattle", step=1e-3, stabilisation="raw")


def test_not_for_loops():
    with pytest.raises(ModelError, match="rattle is for linkages of points and links"):
        symgen.build("cssp").simulate(1.0, method="rattle", step=1e-3)
