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


def drawn(seed):
    """Return a random free loop: in space and in the plane, with redundant closure, and moved along."""
    rng = np.random.default_rng([38, 2, seed])
    kinds = ("rssr", "planar_4r", "bennett", pumping, swayed)
    kind = kinds[seed % len(kinds)]
    if callable(kind):
        made = kind(rng)
        return made if isinstance(made, symgen.Scene) else symgen.Scene(**made)
    return symgen.Scene(**freed(kind, 0.3, rng.uniform(-6, 6), rng.uniform(-9, 9, 3)))


def ended(model, method, rtol, t_end=0.7):
    run = model.simulate(t_end, samples=2, method=method, rtol=rtol, atol=rtol / 100)
    return run, np.array([x for v in run.final.values() for x in (v["value"], v["rate"])])


@pytest.mark.parametrize("seed", full_unless(lambda seed: seed < 10, range(200)))
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


def test_sizes_of_a_step():
    """Products of an order, of velocities and forces alone (with those of accelerations 127); closures."""
    scene = symgen.Scene(**freed("rssr", 0.5, 3.0))
    sides = lower_system(loop_system(resolve(scene))).series[0]
    assert sides.products + sides.ahead <= 91
    run, _ = ended(symgen.build(scene), "taylor", RTOL, 2.0)
    assert run.statistics["factorisations"] <= 7 * run.statistics["steps"]


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
