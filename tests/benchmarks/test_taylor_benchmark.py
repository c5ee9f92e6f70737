"""What benchmarks/taylor.py compares, and against what."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import symgen


@pytest.fixture(scope="module")
def bench(load):
    return load("taylor")


@pytest.fixture(scope="module")
def motions(load):
    return load("taylor_cases")


NAMES = ("chain of 3, 2 s", "chain of 10, 2 s", "peaucellier, 1 s", "four bar, 2 s", "andrews squeezer, 0.03 s",
         "pendulum in space, 2 s", "free RSSR, 2 s", "free RSSR of points, 2 s", "two rods, 10 s",
         "drawn four bar, 1 s")  # fmt: skip


def motion(motions, key):
    return next(c for c in (*motions.cases(), *motions.of_digits()) if c.key == key)


@pytest.mark.parametrize("key", NAMES)
def test_stored_ends_are_those_of_the_scenes(motions, key):
    """The minimal equations share nothing with symgen, which steps by another method."""
    found = motion(motions, key)
    run = symgen.build(found.scene).simulate(float(found.t_end), samples=2, rtol=1e-12)
    limit = 1e-7 if key == "two rods, 10 s" else 1e-11
    assert found.error(found.end_of(run)) < limit


@pytest.mark.parametrize("key", [name for name in NAMES if "of 10" not in name])
def test_ends_are_computed_as_stored(motions, key):
    found = motion(motions, key)
    with mpmath.workdps(18):
        end = found.solve(1e-11, 6)
    assert found.error(map(float, end)) < (1e-5 if key == "two rods, 10 s" else 1e-9)


def test_error_of_a_shifted_scene_has_more_digits_than_a_double(motions):
    found = motion(motions, "two rods, 10 s")
    exact = [x - shift for x, shift in zip(map(mpmath_decimal, found.truth()), found.shifts(), strict=True)]
    end = [float(x) + 3e-25 for x in exact]
    assert found.error_of_shifted(end) == pytest.approx(3e-25, rel=1e-3)


def mpmath_decimal(text):
    from decimal import Decimal

    return Decimal(text)


def test_required_lines(bench):
    """Three times as fast as dop853, which does not reach the smallest error, and twice as fast as heyoka."""
    found = {}
    for k, error in enumerate(bench.ERRORS, 1):
        found["m", "taylor", error] = 1.0 * k
        found["m", "dop853", error] = 3.0 * k if error > 2e-11 else math.nan
        found["m", "heyoka", error] = 2.0 * k
    lines = list(bench.required(found, with_peer=True))
    assert len(lines) == len(bench.REQUIRED) + len(bench.ERRORS) and all(line.holds for line in lines)
    assert [x.value for x in lines if "dop853" in x.name] == pytest.approx([1 / 3, 1 / 3, 0.0])
    assert all(x.value == pytest.approx(0.5) for x in lines if "heyoka" in x.name)
    never = {key: math.nan if key[1] == "taylor" else t for key, t in found.items()}
    assert not any(x.holds for x in bench.required(never, with_peer=False))


@pytest.mark.parametrize("key", ["chain of 3, 2 s", "pendulum in space, 2 s"])
def test_heyoka_is_given_the_same_motion(bench, motions, key):
    """In angles, and in the coordinates of the SymPy record, whose lengths drift."""
    pytest.importorskip("heyoka", reason="the extra 'peers' is not installed")
    found = motion(motions, key)
    forms = found.in_heyoka()
    assert len(forms) == 2
    for form in forms:
        end = form.place(form.run(form.integrator(1e-8), float(found.t_end)))
        assert found.error(end) < 1e-6


def test_heyoka_falls_with_the_chain(load):
    pytest.importorskip("heyoka", reason="the extra 'peers' is not installed")
    peers, reference, forms = load("chain_peers"), load("chain_reference"), load("heyoka_peer").chains(3)
    for form, limits in zip(forms, ((1e-6, 1e-15), (1e-6, 1e-6)), strict=True):
        states = form.sampled(form.integrator(1e-8), peers.TIMES)
        places, rates = peers.joints(form, states, 3)
        assert np.max(np.abs(places[:, -1] - reference.tips(3))) < 1e-6
        assert all(x < limit for x, limit in zip(peers.drift(places, rates), limits, strict=True))
