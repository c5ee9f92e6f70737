"""Calls of the public interface: every call is checked, and an error names the argument."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from shared.full import full
from shared.wrong_calls import judge, sample, wrong_calls

import symgen
from symgen.calls import checked
from symgen.errors import ModelError


@checked
class Interface:
    def named(self, name: str, number: float = 0.0) -> str:
        return f"{name} {number!r}"

    def any_of(self, *names: str) -> int:
        return len(names)


def test_values_are_checked_in_every_call():
    interface = Interface()
    for _ in range(2):  # the second call has the types of the first
        assert interface.named("a") == "a 0.0"
        assert interface.named("a", 2) == "a 2.0"
        assert interface.any_of("a", "b") == 2
        for wrong in ((3,), ("a", math.nan), ("a", "b"), (), ("a", 1.0, 2.0)):
            with pytest.raises(ModelError, match=r"Interface\.named"):
                interface.named(*wrong)
        with pytest.raises(ModelError, match=r"Interface\.any_of: expected text"):
            interface.any_of("a", 1)
        with pytest.raises(ModelError, match="has no argument 'size'"):
            interface.named("a", size=1)


@pytest.mark.parametrize("count", [80, full(1200)])
def test_wrong_calls_give_a_named_error(count, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    calls = wrong_calls(tmp_path)
    assert len(calls) > 5000
    chosen = sample(calls, count, seed=22)
    outcomes = {str(call): judge(call) for call in chosen}
    assert len({call.callee.name for call in chosen}) > 40
    refused = sum(outcome != "accepted" for outcome in outcomes.values())
    assert refused > 0.85 * len(outcomes)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: m.simulate(0.1, method=3), r"Model\.simulate: expected text for method, got 3"),
        (
            lambda m: m.simulate("1 s"),
            r"Model\.simulate: expected a finite number for t_end, got '1 s'",
        ),
        (lambda m: m.simulate(0.1, tol=1e-6), r"Model\.simulate has no argument 'tol'.*'rtol'"),
        (lambda m: m.simulate(0.1, t_end=0.1), r"Model\.simulate got 't_end' twice"),
        (lambda m: m.simulate(0.1, 1e-6), r"Model\.simulate takes t_end by position, got 1e-06 besides"),
        (
            lambda m: m.modes("x"),
            r"Model\.modes: expected an object of type Equilibrium or a finite number for at, got 'x'",
        ),
        (lambda m: m.equilibrium(stable="no"), r"expected True or False for stable, got 'no'"),
        (lambda m: m.accelerations()["Z"], r"there is no point 'Z'"),
        (lambda m: m.with_parameters(rho="x"), r"expected a finite number for rho, got 'x'"),
        (lambda m: symgen.Chain([1.0], [1.0]).simulate(), r"Chain\.simulate needs a finite number for t_end"),
        (lambda m: symgen.Chain([1.0]), r"Chain needs numbers for masses, got no argument"),
        (lambda m: symgen.build(5), r"build: expected an object of type Scene or .*text.* for scene, got 5"),
        (
            lambda m: symgen.build("four_bar", set={1: "x"}),
            r"a mapping from names .* for set, got \{1: 'x'\}",
        ),
        (lambda m: symgen.Scene("four_bar"), r"Scene takes nothing by position, got 'four_bar' besides"),
    ],
)
def test_the_argument_is_named(call, words):
    model = symgen.build("four_bar", backend="numpy")
    with pytest.raises(ModelError, match=words):
        call(model)


def test_the_argument_of_elastic_links_is_named():
    model = symgen.build("thesis_four_bar", backend="numpy")
    with pytest.raises(
        ModelError, match=r"Model\.speed_response: expected a list of numbers for speeds, got 'x'"
    ):
        model.speed_response("x")
    with pytest.raises(ModelError, match=r"Model\.simulate: expected text for method, got 3"):
        model.simulate(method=3)
    with pytest.raises(
        ModelError, match=r"Model\.modes: expected an object of type Equilibrium or a finite number for at"
    ):
        model.modes("x")


def test_numbers_of_other_types_are_numbers():
    """Those of NumPy, of results, and fractions; not those in text, and not True."""
    model = symgen.build("four_bar", backend="numpy")
    expected = model.simulate(0.5, samples=3)["A.position"].values
    for half in (np.float32(0.5), np.array(0.5), Fraction(1, 2)):
        assert np.array_equal(model.simulate(half, samples=np.int64(3))["A.position"].values, expected)
    for wrong in ("0.5", True, 0.5 + 0j, [0.5], np.array([0.5])):
        with pytest.raises(ModelError, match="for t_end, got"):
            model.simulate(wrong)


def test_plot_takes_a_list_in_place_of_names():
    result = symgen.build("four_bar", backend="numpy").simulate(0.01, samples=3)
    with pytest.raises(ModelError, match=r"Result\.plot.*names.*got \[3\]"):
        result.plot([3])
    of_list, of_names = (
        [line.get_label() for line in f.axes[0].lines] for f in (result.plot(["A"]), result.plot("A"))
    )
    assert of_list == of_names
