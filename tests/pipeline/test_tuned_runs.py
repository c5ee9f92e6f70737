"""Tuned parameters against the same numbers written into the scene: every way to what depends on them alone.

With all parameters fixed there is no set-up kernel; tuned, whatever forgot to call it would compute with zeros.
"""

from __future__ import annotations

import numpy as np
import pytest
from shared.full import full_unless
from shared.linkages import GRAVITY, at, ground

import symgen
from symgen.precision import PRECISIONS
from symgen.runtime import _core
from symgen.runtime.elastic.mesh import MeshedMotion
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.scene.loading import read_scene
from symgen.toolchain.compiler import find_compiler

WRITTEN = {"m": "1 kg", "k": "90 N/m", "c": "3 N*s/m", "l": "0.4 m", "push": "2 N", "w": "3 rad/s"}
CHANGED = {"m": 1.3, "k": 70.0, "c": 1.7, "l": 0.5, "push": 3.1, "w": 2.2}
UNITS = {name: value.split(" ", 1)[1] for name, value in WRITTEN.items()}
#: Of a result, in units of the type's epsilon, after some hundred steps.
LIMIT = 1e5
#: Of runs of elastic links.
TOLERANCE = 1e-4


def linkage(tunable):
    """A four-bar in which every load, and the mass of two links, is a product of parameters."""
    values = WRITTEN if tunable else {n: f"{CHANGED[n]!r} {UNITS[n]}" for n in WRITTEN}
    return symgen.Scene(
        parameters={
            name: {"value": value, "tunable": True} if tunable else value for name, value in values.items()
        }
        | {"half": "k/2", "load": "push*m/(m + m0)", "m0": "1 kg"},
        points={"O": ground(0, 0), "A": at(0.4, 0.7), "B": at(1.1, 0.9), "C": ground(1.6, 0.1)},
        links={
            "crank": {"points": ["O", "A"], "mass": "m"},
            "coupler": {"points": ["A", "B"], "mass": "2*m"},
            "rocker": {"points": ["B", "C"], "mass": "0.8 kg"},
        },
        gravity=GRAVITY,
        springs=[{"between": ["A", "C"], "stiffness": "half", "length": "2*l", "damping": "c"}],
        forces=[{"point": "B", "force": ["load*sin(w*t)", "0 N"]}],
        analysis={"outputs": ["energy", "O.reaction"]},
    )


def pair(**options):
    fixed = symgen.build(linkage(False), **options)
    tuned = symgen.build(linkage(True), **options).with_parameters(**CHANGED)
    assert fixed.description.derived == 0 and tuned.description.derived > 3
    return fixed, tuned


@pytest.fixture(scope="module")
def both():
    return pair()


def close(found, expected, epsilon=2.2e-16):
    for one, other in zip(found, expected, strict=True):
        a, b = (np.asarray(x, dtype=float) for x in (one, other))
        size = max(1.0, np.max(np.abs(b), initial=0.0))
        assert np.all(np.isfinite(b)) and np.max(np.abs(a - b), initial=0.0) <= LIMIT * epsilon * size


def end(model, **options):
    run = model.simulate(0.5, **options)
    assert run.statistics["steps"] > 2
    places = [m[what] for m in run.final.values() for what in ("position", "velocity") if what in m]
    return [*places, *(v.values for v in run.variables)]


@pytest.mark.parametrize("name", INTEGRATORS)
def test_runs_by_every_method(name, both):
    options = {} if INTEGRATORS[name].adaptive else {"step": 2e-3}
    if INTEGRATORS[name].needs_tangent:
        assert both[1].analysis("tangent").description.derived > 0
    fixed, tuned = (end(m, method=name, **options) for m in both)
    close(tuned, fixed)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("method", ["dop853", "radau5"])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_runs_in_every_type(precision, method):
    fixed, tuned = pair(precision=precision)
    loose = {"rtol": 1e-3, "atol": 1e-4} if precision == "float32" else {}
    epsilon = max(PRECISIONS[precision].epsilon, 2.2e-16)
    close(end(tuned, method=method, **loose), end(fixed, method=method, **loose), epsilon)


WAYS = [
    *({"precision": p} for p in PRECISIONS),
    *({"backend": "numpy", "precision": p} for p in ("float32", "float64", "longdouble")),
    {"backend": "mpmath", "digits": 30},
]


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("way", full_unless(lambda way: way in (WAYS[0], WAYS[-1]), WAYS), ids=str)
def test_batches(way):
    fixed, tuned = pair(**way)
    q = fixed.initial_state().q + 0.01 * np.random.default_rng(3).standard_normal((7, 4))
    u = np.random.default_rng(4).standard_normal((7, 4))
    epsilon = PRECISIONS[way.get("precision", "float64")].epsilon
    for kernel in ("accelerations", "energy", "outputs"):
        found, expected = (m.batch(kernel, 0.3, q, u) for m in (tuned, fixed))
        close(found.values(), expected.values(), max(epsilon, 2.2e-16))
    with pytest.raises(symgen.errors.ModelError, match="no kernel or result 'setup'"):
        tuned.batch("setup", 0.0, q, u)


def test_analyses(both):
    fixed, tuned = both
    found = [m.equilibrium() for m in (tuned, fixed)]
    close(*([e.state.q, *e.reactions.values(), [e.residual]] for e in found))
    close(*([m.modes().frequencies] for m in (tuned, fixed)))
    found = [m.accelerations() for m in (tuned, fixed)]
    close(*([*a.reactions.values(), *a.points.values(), [*a.multipliers.values()]] for a in found))
    y = tuned.rhs.start
    close([tuned.rhs(0.2, y), [tuned.rhs.energy(0.2, y)]], [fixed.rhs(0.2, y), [fixed.rhs.energy(0.2, y)]])


def test_a_set_up_of_the_tangent_alone_is_none_of_the_equations():
    """Slopes of cubes have products of parameters where the equations have none: theirs is not called for these."""
    written = {"c1": "4e5 N*s^3/m^3", "c2": "0 N*s^3/m^3", "c3": "0 N*s^3/m^3"}
    found = []
    for tunable in (True, False):
        scene = symgen.Scene(
            parameters={n: {"value": v, "tunable": True} if tunable else v for n, v in written.items()},
            points={"O": ground(0, 0), "A": at(0.4, 0.7), "B": at(1.1, 0.9)},
            links={
                "upper": {"points": ["O", "A"], "mass": "1 kg"},
                "lower": {"points": ["A", "B"], "mass": "2 kg"},
            },
            gravity=GRAVITY,
            actuators=[
                {"between": ends, "force": f"-{n}*this.rate**3"}
                for n, ends in zip(written, (["O", "B"], ["A", "B"], ["O", "A"]), strict=True)
            ],
        )
        model = symgen.build(scene)
        assert (model.description.derived, model.analysis("tangent").description.derived > 2) == (0, tunable)
        run = model.simulate(0.5, method="radau5")
        found.append(run.statistics["evaluations"])
    assert found[0] == pytest.approx(found[1], rel=0.05)


def test_parameters_are_taken_from_the_model_not_from_the_one_before(both):
    again = both[1].with_parameters(**{n: float(v.split()[0]) for n, v in WRITTEN.items()})
    first = symgen.build(linkage(True))
    close(end(again), end(first))
    with pytest.raises(AssertionError):
        close(end(again), end(both[1]))


def scene_of(name, **values):
    """A shipped scene with parameters fixed at these values [text]."""
    data = read_scene(name).data
    parameters = {
        n: values.get(n, p["value"]) if isinstance(p, dict) else p for n, p in data["parameters"].items()
    }
    return symgen.Scene(**{**data, "parameters": parameters})


OFFSETS = {"a4": ("30 in", 0.762), "alpha4": ("250 deg", np.radians(250)), "S1": ("2 in", 0.0508)}


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("precision", ["float64", "float128"])
def test_loops(precision):
    fixed = symgen.build(
        scene_of("slider_crank", **{n: v for n, (v, _) in OFFSETS.items()}), precision=precision
    )
    tuned = symgen.build("slider_crank", precision=precision).with_parameters(
        **{n: x for n, (_, x) in OFFSETS.items()}
    )
    assert fixed.description.derived == 0 < tuned.description.derived
    a, b = (m.inverse_dynamics(samples=25) for m in (tuned, fixed))
    close(*([v.values for v in x.variables] for x in (a, b)))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("elastic_slider_crank", "elastic_joints"), ("elastic_four_bar_motor", "elastic_motion")],
)
def test_elastic_links(name, kind):
    fixed = symgen.build(scene_of(name, speed="1100 rpm"))
    tuned = symgen.build(name).with_parameters(speed=1100 * np.pi / 30)
    assert tuned.rigid.analysis(kind).description.derived > 0
    a, b = (MeshedMotion(m.rigid).equations() for m in (tuned, fixed))
    t = 0.2 * 60 / 1100
    y = 1e-4 * np.random.default_rng(5).standard_normal(a.dim)
    found, expected = ([*e.matrices(t), *e.motion.evaluate(t), e.derivative(t, y)] for e in (a, b))
    for x, exact in zip(found, expected, strict=True):
        if exact is not None:
            assert x == pytest.approx(exact, rel=1e-8, abs=1e-8 * np.max(np.abs(exact), initial=0))
    assert found[0] == _core.DONE
    # Each run is off by its tolerance at most.
    one, other = (m.simulate(revolutions=0.25, rtol=TOLERANCE) for m in (tuned, fixed))
    for x, y in zip(one.variables, other.variables, strict=True):
        size = np.max(np.abs(y.values), initial=0.0)
        assert np.max(np.abs(x.values - y.values), initial=0.0) <= 2 * TOLERANCE * max(size, 1e-12), x.name


def test_what_the_set_up_leaves_is_found_once(both):
    """The evaluator completes its parameters when it is first called, not for kernels it only holds."""
    tuned = both[1]
    evaluator = Evaluator(tuned.description, tuned.evaluator.library, [*tuned.parameters.values()])
    assert "parameters" not in vars(evaluator)
    taken = evaluator.parameters
    assert taken is evaluator.parameters
    assert taken.shape == (len(CHANGED) + tuned.description.derived + 1,)
    assert np.array_equal(taken[: len(CHANGED)], [*CHANGED.values()]) and np.all(taken[len(CHANGED) : -1])
