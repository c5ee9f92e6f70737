"""Many states in one call: the bits of single states, whatever the width, the threads and the neighbours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared.shipped import rigid

import symgen
from symgen.errors import ModelError
from symgen.runtime.kernels.batch import lanes_of
from symgen.toolchain import compiler
from symgen.toolchain.compiler import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

SCENES = ("four_bar", "peaucellier", "tumbling_body")


def states(model, count, seed=5):
    rng = np.random.default_rng(seed)
    drawn = model.initial_state().q
    size = np.max(np.abs(drawn))
    return drawn + 0.02 * size * rng.standard_normal((count, len(drawn))), rng.standard_normal(
        (count, len(drawn))
    )


@pytest.mark.parametrize("vector", ["none", "native"])
@pytest.mark.parametrize("scene", SCENES)
def test_lanes_have_the_bits_of_the_scalar_kernel(scene, vector):
    model = rigid(symgen.build(scene, vector=vector))
    q, u = states(model, 21)
    for kernel in ("accelerations", "energy", "constraints", "points"):
        found = model.batch(kernel, 0.25, q, u)
        for k in range(len(q)):
            single = model.evaluator.blocks(kernel, 0.25, q[k], u[k])
            for name, values in found.items():
                assert np.array_equal(values[k], single[name]), (kernel, name, k)


def avx():
    """Whether Linux says that the processor has AVX."""
    info = Path("/proc/cpuinfo")
    return info.exists() and " avx " in info.read_text()


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_width_threads_layout_and_neighbours_change_no_bit(precision, monkeypatch):
    wide = symgen.build("peaucellier", precision=precision)
    q, u = states(wide, 101)
    wide.batch("accelerations", 0.0, q, u)  # builds the kernels
    monkeypatch.setattr(compiler, "has_wide_vectors", lambda: False)
    narrow = symgen.build("peaucellier", precision=precision)
    ways = [lanes_of(m.number_type.kernels(True), "peaucellier")[1] for m in (wide, narrow)]
    assert ways[1] == 16 and (ways[0] > 16 or not avx())
    one = narrow.batch("accelerations", 0.0, q, u)["multipliers"]
    assert one.dtype == precision and one.shape == (101, 7)
    columns = np.asfortranarray(q.astype(precision)), np.asfortranarray(u.astype(precision))
    for other in (
        wide.batch("accelerations", 0.0, q, u),
        wide.batch("multipliers", np.zeros(101), *columns, threads=3),
        narrow.batch("accelerations", 0.0, q[:, ::-1].copy()[:, ::-1], u, threads=200),
    ):
        assert np.array_equal(one, other["multipliers"])
    assert np.array_equal(one[40:41], wide.batch("accelerations", 0.0, q[40:41], u[40:41])["multipliers"])


def test_lanes_are_as_wide_as_the_processor_has_them_where_that_changes_no_bit(monkeypatch):
    monkeypatch.setattr(compiler, "has_wide_vectors", lambda: True)
    plain = find_compiler()
    assert plain.of_lanes.flags == (*plain.flags, "-march=native")
    contracted, tuned = plain.with_options("fast", "none"), plain.with_options("off", "native")
    assert contracted.of_lanes == contracted and tuned.of_lanes == tuned


@pytest.mark.parametrize("count", [0, 1, 2, 7, 16, 17])
def test_any_number_of_states(count):
    model = symgen.build("four_bar", vector="native")
    q, u = states(model, 17)
    whole = model.batch("point_accelerations", 0.0, q, u)["point_accelerations"]
    some = model.batch("point_accelerations", 0.0, q[:count], u[:count])["point_accelerations"]
    assert some.shape == (count, 4, 2)
    assert np.array_equal(some, whole[:count])


def test_point_accelerations_follow_from_the_motion_or_from_what_is_given():
    model = symgen.build("four_bar")
    state = model.initial_state()
    q, u = state.q[None], state.u[None]
    known = model.accelerations(state)
    found = model.batch("point_accelerations", 0.0, q, u)["point_accelerations"][0]
    assert np.allclose(found, [known[p] for p in model.description.points], rtol=1e-12, atol=1e-12)
    size = model.description.kernel("point_accelerations").work_size
    at_rest = model.batch("point_accelerations", 0.0, q, u, work=np.zeros((1, size)))
    assert not np.any(at_rest["point_accelerations"])


def test_parameters_are_those_of_the_model():
    model = symgen.build("peaucellier")
    q, u = states(model, 5)
    heavy = model.with_parameters(rho=2 * model.parameters["rho"])
    one, two = (m.batch("energy", 0.0, q, u)["kinetic_energy"] for m in (model, heavy))
    assert np.allclose(two, 2 * one, rtol=1e-14)


@pytest.mark.parametrize(
    "call, what",
    [
        (
            lambda m, q: m.batch("acceleration", 0.0, q),
            "no kernel or result 'acceleration'. Did you mean 'acc",
        ),
        (lambda m, q: m.batch("factor", 0.0, q), "no kernel or result 'factor'"),
        (
            lambda m, q: m.batch("energy", 0.0, q[:, 1:]),
            r"expected rows of 4 numbers for q, got the shape \(3, 3\)",
        ),
        (lambda m, q: m.batch("energy", 0.0, q, q[1:]), "expected as many rows of u as of q, 3, got 2"),
        (
            lambda m, q: m.batch("energy", [0.0, 1.0], q),
            r"expected one time or 3 of them for t, got \[0.0, 1.0\]",
        ),
        (lambda m, q: m.batch("energy", 0.0, [["a"] * 4]), r"expected numbers for q, got"),
        (lambda m, q: m.batch("energy", 0.0, q, threads=0), "expected one thread or more, got 0"),
    ],
)
def test_what_makes_no_sense_is_refused(call, what):
    model = symgen.build("four_bar")
    with pytest.raises(ModelError, match=what):
        call(model, states(model, 3)[0])


def test_contraction_is_an_option_that_shows():
    """It is off by default; where the processor has FMA it changes last bits, and provenance says so."""
    plain = symgen.build("peaucellier", vector="native")
    fast = symgen.build("peaucellier", vector="native", contraction="fast")
    q, u = states(plain, 50)
    a, b = (m.batch("accelerations", 0.0, q, u)["accelerations"] for m in (plain, fast))
    assert np.allclose(a, b, rtol=1e-9)
    run = fast.simulate(0.05, samples=2)
    assert (run.provenance["contraction"], run.provenance["vector"]) == ("fast", "native")
    assert plain.simulate(0.05, samples=2).provenance["contraction"] == "off"
