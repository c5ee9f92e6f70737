"""Free loops by power series: they agree with a Runge-Kutta method within the tolerances, in fewer steps."""

from __future__ import annotations

import tomllib

import mpmath
import numpy as np
import pytest
import sympy as sp
from shared.crank_vectors import Crank, Jet
from shared.full import full_unless
from shared.loop_scenes import crank_scene, freed, guess_of

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.lowering.program import lower_system
from symgen.models.loop.derivation import LoopDerivation
from symgen.models.loop.system import loop_system
from symgen.scene.loading import shipped_scene
from symgen.scene.resolve import resolve

RTOL = 1e-10


def pumping(rng):
    """The shipped crank that a motor turns against a pump, two coordinates free."""
    tables = tomllib.loads(shipped_scene("cssp"))
    tables["loop"]["free"] = {
        "theta1": {"at": "45 deg", "rate": f"{rng.uniform(-9, 9)} rad/s"},
        "S1": {"at": "1 cm", "rate": f"{rng.uniform(-0.3, 0.3)} m/s"},
    }
    for name, unit, low, high in (("stall", "N*m", 1, 20), ("pump", "N*s/m", 5, 80), ("k", "N/m", 500, 4000)):
        tables["parameters"][name] = {"value": f"{rng.uniform(low, high)} {unit}", "tunable": True}
    return tables


def swayed(rng):
    """A crank that is free while its shaft is moved along its axis."""
    crank = Crank(a4=20.0, alpha4=rng.uniform(3.5, 5.0), gravity=(0.0, -386.4, 0.0))
    return crank_scene(
        crank,
        S1="S1",
        guess=guess_of(crank.motion(Jet([0.75]), Jet([3.0]))),
        inputs={"S1": "far + sway*sin(w*t)"},
        free={"theta1": {"at": "0.75", "rate": f"{rng.uniform(2, 8)} rad/s"}},
        parameters={"far": "3 in", "sway": "0.5 in", "w": f"{rng.uniform(2, 20)} rad/s"},
        gravity=np.array(crank.gravity) * 0.0254,
    )


def loaded(rng):
    """A crank of one freedom with a motor, a damper and a spring at joints, and loads on its links by time and rate."""
    tables = freed("rssr", 0.3, rng.uniform(-6, 6))
    tables["parameters"] |= {
        "stall": f"{rng.uniform(1, 3)} N*m",
        "top": f"{rng.uniform(20, 40)} rad/s",
        "k": f"{rng.uniform(1, 10)} N*m/rad",
        "d": f"{rng.uniform(0.01, 0.3)} N*m*s/rad",
        "drag": "0.4 N*s/rad",
        "push": "3 N",
        "couple": "0.4 N*m",
        "w": "4 rad/s",
    }
    tables["loop"]["drives"] = {
        "theta1": "stall*(1 - theta1.rate/top)",
        "theta4": "-k*(theta4 - 1.8) - d*theta4.rate",
    }
    tables["loop"]["loads"] = [
        {"link": "rod", "force": ["push*sin(w*t)", 0, "push"], "at": ["-0.2 m", 0, 0], "frame": "ground"},
        {"link": "rocker", "force": [0, "-drag*theta4.rate", 0], "torque": [0, 0, "couple*cos(theta1)"]},
    ]
    return tables


def drawn(seed):
    """Return a random free loop: in space and in the plane, with redundant closure, loaded, and moved along."""
    rng = np.random.default_rng([38, 2, seed])
    kinds = ("rssr", "planar_4r", "bennett", pumping, swayed, loaded)
    kind = kinds[seed % len(kinds)]
    if callable(kind):
        made = kind(rng)
        return made if isinstance(made, symgen.Scene) else symgen.Scene(**made)
    return symgen.Scene(**freed(kind, 0.3, rng.uniform(-6, 6), rng.uniform(-9, 9, 3)))


def ended(model, method, rtol, t_end=0.7):
    run = model.simulate(t_end, samples=2, method=method, rtol=rtol, atol=rtol / 100)
    return run, np.array([x for v in run.final.values() for x in (v["value"], v["rate"])])


@pytest.mark.parametrize("seed", full_unless(lambda seed: seed < 12, range(240)))
def test_random_loops_agree(seed):
    """Errors by a run at a tighter tolerance: ten times that of the other method is within the tolerance."""
    model = symgen.build(drawn(seed))
    try:
        _, exact = ended(model, "dop853", RTOL / 1000)
    except SimulationError as error:
        with pytest.raises(SimulationError):
            ended(model, "taylor", RTOL)
        assert "dead centre" in str(error)
        return
    (run, series), (other, found) = ended(model, "taylor", RTOL), ended(model, "dop853", RTOL)
    size = max(1.0, np.max(np.abs(exact)))
    gap = np.max(np.abs(series - exact)) / size
    assert gap < 1e-9 + 10 * np.max(np.abs(found - exact)) / size
    assert run.statistics["steps"] < other.statistics["steps"]
    assert run.drift.energy < 1e-8 * max(other.drift.energy_exchanged, 1.0)


def test_digits_of_quadruple_precision():
    """Energy and closure of a free motion to 30 digits, which no scheme of doubles has."""
    model = symgen.build(symgen.Scene(**freed("rssr", 0.5, 3.0)), precision="float128")
    run = model.simulate(1.0, samples=2, method="taylor", rtol=1e-31, atol=1e-33)
    assert run.drift.energy < 1e-29
    assert run.drift.constraint < 1e-31


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_are_the_rates_of_velocities_that_the_derivation_states(seed):
    """What the series take as the next coefficient, by differences at 60 digits along any path, also of an open loop."""
    system = loop_system(resolve(drawn(seed))).in_numbers()
    rng = np.random.default_rng([38, 3, seed])
    q, u, a = ([x.symbol for x in system.group(name).quantities] for name in ("q", "u", "work"))
    numbers = {x: mpmath.mpf(rng.uniform(-1, 1)) for x in [s.symbol for s in system.arguments()]}

    def at(t):
        values = dict(numbers)
        for x, v, rate in zip(q, u, a[: len(q)], strict=True):
            values[x] += t * values[v] + t**2 / 2 * values[rate]
            values[v] += t * values[rate]
        of = {}
        for d in system.definitions:
            names = sorted(
                d.expression.free_symbols | (d.rate_of.free_symbols if d.rate_of else set()), key=str
            )
            both = sp.lambdify(names, [d.expression, d.rate_of or 0], "mpmath")
            values[d.quantity.symbol], of[d.quantity.name] = both(*(values[x] for x in names))
        return values, of

    with mpmath.workdps(60):
        h = mpmath.mpf("1e-20")
        (found, _), (_, before), (_, behind) = at(mpmath.mpf(0)), at(-h), at(h)
        stated = [d.quantity for d in system.definitions if d.rate_of is not None]
        for x in stated:
            rate = (behind[x.name] - before[x.name]) / (2 * h)
            assert abs(found[x.symbol] - rate) < 1e-30 * (1 + abs(rate)), x.name
    assert len(stated) > 5


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_one_freedom_speeds_up_by_the_power_on_its_motion(seed):
    """At rest, its accelerations are that power times the motion, as by the forces of all joints."""
    scene = drawn(seed)
    model, derivation = symgen.build(scene), LoopDerivation(resolve(scene))
    of, system = derivation.free_motion, loop_system(resolve(scene)).in_numbers()
    state = model.state(rates={"theta1": 0.0})
    values = dict.fromkeys((s.symbol for s in system.arguments()), 0.0)
    values |= dict(
        zip([x.symbol for x in system.group("p").quantities], model.kernels.parameter_values, strict=False)
    )
    values |= dict(zip([x.symbol for x in system.group("q").quantities], state.q, strict=True))
    a = [x.symbol for x in system.group("work").quantities][: len(state.q)]
    constants = {c.quantity.symbol: c.expression for c in loop_system(resolve(scene)).constants}
    steps = [(d.quantity.symbol, d.expression.xreplace(constants)) for d in derivation.names.definitions]
    results = sp.Matrix(of).xreplace(constants)
    needed, chosen = set(results.free_symbols), []
    for symbol, expression in reversed(steps):
        if symbol in needed:
            needed |= expression.free_symbols
            chosen.insert(
                0, (symbol, sp.lambdify(list(expression.free_symbols), expression), expression.free_symbols)
            )
    last = sp.lambdify(list(results.free_symbols), results)

    def at(motion):
        found = values | dict(zip(a, motion, strict=True))
        for symbol, function, symbols in chosen:
            found[symbol] = function(*(found[x] for x in symbols))
        return np.ravel(last(*(found[x] for x in results.free_symbols)))

    one = np.zeros(len(state.q))
    slopes = np.array([at(row)[1:7] - at(one)[1:7] for row in np.eye(len(one))]).T
    *_, motion = np.linalg.svd(slopes)[2]
    motion = motion / np.sqrt(1.0 - at(motion)[0])
    vanishing, power = at(motion)[:7], at(motion)[7]
    assert np.max(np.abs(vanishing)) < 1e-12
    exact = model.rhs(0.0, np.concatenate([state.q, 0 * state.q]))[len(one) :]
    assert power * motion == pytest.approx(exact, rel=1e-10, abs=1e-10)


def test_sizes_of_a_step():
    """Products and statements of an order, of one freedom (with joint forces 91 and 534); closures."""
    scene = symgen.Scene(**freed("rssr", 0.5, 3.0))
    series = lower_system(loop_system(resolve(scene))).series
    assert series[0].products + series[0].ahead <= 56
    assert sum(len(kernel.assignments) for kernel in series) <= 230
    model = symgen.build(scene)
    run, _ = ended(model, "taylor", RTOL, 2.0)
    assert run.statistics["factorisations"] <= 7 * run.statistics["steps"]
    run, _ = ended(model, "taylor", RTOL, 1e-3)
    assert run.statistics["steps"] == 1 and run.statistics["factorisations"] <= 5


def test_the_pose_evaluated_last_is_evaluated_again_where_it_is_another():
    """With other parameters, after another pose, and after a search, screws are those of new equations."""
    kernels = symgen.build(symgen.Scene(**freed("rssr", 0.5, 3.0))).kernels
    solved, q = range(kernels.description.coordinates), np.array(kernels.description.start)
    other = kernels.parameter_values.copy()
    other[0] += 0.1

    def new(parameters, q):
        screws, defect = kernels.at(parameters).equations(solved, 6).closed_screws(0.0, q)
        return *screws.ravel(), defect

    equations = kernels.equations(solved, 6)

    def again(q):
        screws, defect = equations.closed_screws(0.0, q)
        return *screws.ravel(), defect

    assert again(q) == again(q) == new(kernels.parameter_values, q)
    assert again(q + 0.1) == new(kernels.parameter_values, q + 0.1) != again(q)
    equations.set_parameters(other)
    assert again(q) == new(other, q) != new(kernels.parameter_values, q)
    equations.assemble(0.0, np.append(q + 0.2, 0.0))
    assert again(q) == new(other, q)


def test_what_has_no_series_says_so():
    scene = symgen.Scene(**freed("rssr", 0.5, 3.0))
    with pytest.raises(ModelError, match="power series are for compiled .* free loops and"):
        symgen.build(scene, backend="numpy").simulate(0.1, method="taylor")
