"""Kernels in every precision and backend against 50 digits, and runs of linkages against float128."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from shared import float128
from shared.full import full_unless
from shared.oracle import Oracle
from shared.shipped import OF_ALL_TYPES, derived, rigid
from shared.states import random_values

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.precision import PRECISIONS
from symgen.runtime.kernels.batch import Batch
from symgen.toolchain.compiler import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

#: Units of each type's epsilon, over the largest entry of a result, as in double precision.
LIMIT, SOLUTION_LIMIT, REDUNDANT_LIMIT = 500, 1e5, 5e6
#: Where mpmath has the same program: nothing is worse than its digits.
WAYS = [
    *({"backend": "c", "precision": p} for p in PRECISIONS),
    *({"backend": "numpy", "precision": p} for p in ("float32", "float64", "longdouble")),
    {"backend": "mpmath", "digits": 38},
]
#: Linkages of few and many constraints, in plane and space, with a redundant one; and loops.
SOME = ("four_bar", "peaucellier", "tumbling_body")
SOME_LOOPS = ("slider_crank",)
#: The coarsest and the finest type of compiled kernels.
SHORT, LONG = ({"backend": "c", "precision": p} for p in ("float32", "float128"))
STATES = 3
DIGITS = 50


def called(way):
    return way if isinstance(way, str) else "-".join(str(x) for x in way.values())


def exactly(values, scale=1):
    """The sum of two arrays in mpmath, whatever the type of the first."""
    high, low = values
    found = []
    for i, x in enumerate(np.asarray(high).ravel()):
        rest = 0 if low is None else mpmath.mpf(float(np.asarray(low).ravel()[i]))
        if isinstance(x, np.longdouble):
            rest = mpmath.mpf(float(x - np.longdouble(float(x))))
        found.append(mpmath.mpf(float(x) if isinstance(x, np.floating) else x) + rest)
    return found


def error(found, exact):
    """The largest error over the largest entry."""
    size = max((abs(x) for x in exact), default=mpmath.mpf(0)) or mpmath.mpf(1)
    return max((abs(a - b) / size for a, b in zip(found, exact, strict=True)), default=mpmath.mpf(0))


def epsilon(way):
    if way["backend"] == "mpmath":
        return mpmath.mpf(10) ** (1 - way["digits"])
    if way["precision"] == "longdouble":
        return mpmath.mpf(float(np.finfo(np.longdouble).eps))
    return mpmath.mpf(PRECISIONS[way["precision"]].epsilon)


def single(values):
    """The same values as every type holds them."""
    return {name: np.asarray(array, np.float32).astype(float) for name, array in values.items()}


@pytest.mark.parametrize(
    ("scene", "way"),
    full_unless(
        lambda scene, way: scene == "four_bar" or (scene == "tumbling_body" and way == LONG),
        [(scene, way) for scene in SOME for way in WAYS],
    ),
    ids=called,
)
def test_kernels_of_linkages(scene, way):
    model, system = rigid(symgen.build(scene, **way)), derived(scene)
    rng = np.random.default_rng(0xF10A7)
    states = [single(random_values(system, model, rng)) for _ in range(STATES)]
    for values in states:
        values["p"] = states[0]["p"]
    model = model.with_parameters(**dict(zip(model.parameters, states[0]["p"].tolist(), strict=True)))
    oracle, eps = Oracle(system), epsilon(way)
    t, q, u = (np.array([v[name] for v in states]) for name in ("t", "q", "u"))
    with mpmath.workdps(DIGITS):
        solutions = [list(oracle.solve(v)) for v in states]
        found = both(model, "accelerations", t[:, 0], q, u)
        limit = REDUNDANT_LIMIT if model.redundant else SOLUTION_LIMIT
        for k, exact in enumerate(solutions):
            rows = [row(part, k) for part in found.values()]
            assert error([x for r in rows for x in exactly(r)], exact) < limit * eps
        for export in system.exports:
            info = model.description.kernel(export.kernel)
            work = np.array([v["work"][: info.work_size] for v in states]) if info.work_size else None
            found = both(model, export.kernel, t[:, 0], q, u, work)
            for name, part in found.items():
                for k, values in enumerate(states):
                    miss = error(exactly(row(part, k)), list(oracle.matrix(name, values)))
                    assert miss < LIMIT * eps, (export.kernel, name, float(miss / eps))


@pytest.mark.parametrize(
    ("scene", "way"),
    full_unless(
        lambda scene, way: way in (LONG, WAYS[-2]),
        [(scene, way) for scene in SOME_LOOPS for way in WAYS],
    ),
    ids=called,
)
def test_kernels_of_loops(scene, way):
    model, system = symgen.build(scene, **way), derived(scene)
    rng, eps = np.random.default_rng(0x100), epsilon(way)
    values = single({g.name: rng.uniform(-1.5, 1.5, len(g.quantities)) for g in system.groups})
    values["p"] = np.array([*model.parameters.values()])
    oracle = Oracle(system)
    with mpmath.workdps(DIGITS):
        for export in system.exports:
            info = model.description.kernel(export.kernel)
            work = values["work"][None, : info.work_size] if info.work_size else None
            found = both(model, export.kernel, values["t"][0], values["q"][None], values["u"][None], work)
            for name, part in found.items():
                miss = error(exactly(row(part, 0)), list(oracle.matrix(name, values)))
                assert miss < LIMIT * eps, (export.kernel, name, float(miss / eps))


def both(model, kernel, t, q, u, work=None):
    batch = Batch(model.description, model.number_type, model.parameter_values)
    high, low = batch(kernel, t, q, u, work, 1)
    return {name: (values, low.get(name)) for name, values in high.items()}


def row(part, k):
    return part[0][k], None if part[1] is None else part[1][k]


def test_more_digits_than_any_type():
    """Constants keep as many digits as are asked for: one third, pi of the angles, section constants."""
    first, second = (symgen.build("thesis_four_bar", backend="mpmath", digits=n).rigid for n in (60, 90))
    q = first.initial_state().q[None]
    with mpmath.workdps(100):
        a, b = (m.batch("accelerations", 0.1, q)["accelerations"][0] for m in (first, second))
        miss = error(list(a), list(b))
        assert 0 < miss < mpmath.mpf(10) ** -55


def test_a_rounded_constant_would_be_seen():
    """Float128 is not double precision in a wide coat: the same kernels with doubles differ by 1e-17."""
    wide, plain = (symgen.build("four_bar", precision=p) for p in ("float128", "float64"))
    q = plain.initial_state().q[None]
    with mpmath.workdps(DIGITS):
        a, b = (exactly(both(m, "accelerations", 0.0, q, None)["accelerations"]) for m in (wide, plain))
        assert 1e-19 < error(b, a) < 1e-14


@pytest.mark.parametrize(
    "scene",
    full_unless(
        lambda scene: scene in ("four_bar", "far_origin", "slider_crank", "elastic_slider_crank"),
        OF_ALL_TYPES,
    ),
)
def test_float128_confirms_float64(scene):
    rows = float128.confirmed(scene)
    assert float128.holds(rows), rows
    assert all(row["gap"] > 0 for row in rows)


@pytest.mark.parametrize("scene", SOME)
def test_float128_confirms_what_float32_claims(scene):
    wide, short = (symgen.build(scene, precision=p) for p in ("float128", "float32"))
    exact, found = (m.simulate(0.1, rtol=2e-5, samples=3) for m in (wide, short))
    places, truth = (np.array([x["position"] for x in r.final.values()]) for r in (found, exact))
    assert found.provenance["precision"] == "float32"
    assert np.max(np.abs(places - truth)) < 2e-3 * np.max(np.abs(truth))


def test_the_confirmation_can_fail(monkeypatch):
    """A float64 that is off by 1e-7 in time does not pass."""
    build = symgen.build

    def late(scene, precision):
        model = build(scene, precision=precision)
        if precision == "float64":
            run = model.simulate
            model.simulate = lambda t_end, **options: run(t_end * (1 + 1e-6), **options)
        return model

    monkeypatch.setattr(symgen, "build", late)
    assert not float128.holds(float128.confirmed("peaucellier"))


@pytest.mark.parametrize("precision", PRECISIONS)
def test_same_run_twice_has_the_same_bits(precision):
    a, b = (symgen.build("four_bar", precision=precision).simulate(0.3, samples=7) for _ in range(2))
    for x, y in zip(a.variables, b.variables, strict=True):
        assert np.array_equal(x.values, y.values)


def test_tolerances_follow_the_type():
    with pytest.raises(ModelError, match=r"below 1.2e-05, the tightest that float32 can meet"):
        symgen.build("four_bar", precision="float32").simulate(0.1, rtol=1e-9)
    tight = symgen.build("four_bar", precision="float128").simulate(0.1, rtol=1e-15)
    assert tight.drift.constraint < 1e-30
    with pytest.raises(ModelError, match="the tightest that float64 can meet"):
        symgen.build("four_bar").simulate(0.1, rtol=1e-15)


def test_accelerations_in_every_type():
    found = {
        called(way): symgen.build("four_bar", **way).accelerations().multipliers["crank"] for way in WAYS
    }
    exact = found["mpmath-38"]
    assert found["c-float128"] == exact
    assert 0 < abs(found["c-float32"] - exact) < 1e-5 * abs(exact)


def test_what_is_computed_in_doubles_only_says_so():
    model = symgen.build("thesis_four_bar", precision="float128")
    with pytest.raises(ModelError, match=r"computed in float64 only, and .* was built for float128\n.*batch"):
        model.speed_response([1.0, 2.0])
    model = symgen.build("thesis_four_bar", backend="mpmath", digits=30)
    with pytest.raises(ModelError, match=r"computed in types of C only, and .* was built for 30 digits\n"):
        model.simulate()


def test_tolerances_of_a_loop_follow_the_type():
    model = symgen.build("cssp", precision="float32")
    assert model.simulate(0.1).provenance["rtol"] == pytest.approx(1.2e-4, rel=0.01)
    with pytest.raises(ModelError, match="below 1.2e-05, the tightest that float32 can meet"):
        model.simulate(0.1, rtol=1e-6)


def test_more_steps_that_only_add_round_off_end_an_elastic_run():
    """With a tolerance beyond float32, at the first sign of it and not after a quarter of a million steps."""
    model = symgen.build("elastic_slider_crank", precision="float32")
    with pytest.raises(SimulationError, match=r"in float32: .* round-off, and \d\.\de-0[5-8] is the best\n"):
        model.simulate(rtol=1e-9)
    assert model.simulate(rtol=1e-4).statistics["error"] < 1e-4


@pytest.mark.parametrize(
    "options, what",
    [
        ({"precision": "quad"}, r"there is no precision 'quad'\. Known: float128, float32"),
        (
            {"backend": "numpy", "precision": "float128"},
            "float128 needs a C compiler: NumPy has no such type",
        ),
        ({"backend": "mpmath", "precision": "float32"}, "has digits, not a precision"),
        ({"backend": "c", "digits": 30}, "digits = 30 goes with the backend 'mpmath', not 'c'"),
        ({"backend": "mpmath", "digits": 3}, "expected between 15 and 10000 digits, got 3"),
        ({"backend": "mpmath", "digits": 2.5}, "expected a whole number for digits, got 2.5"),
        ({"contraction": "on"}, r"there is no contraction 'on'"),
        ({"vector": "avx"}, r"there is no vector 'avx'"),
        ({"backend": "numpy", "vector": "native"}, "options of a C compiler, and none is used"),
    ],
)
def test_options_that_make_no_sense(options, what):
    with pytest.raises(ModelError, match=what):
        symgen.build("four_bar", **options)
