"""Limits of assembly by bisection, against the closed form of the slider-crank."""

from __future__ import annotations

import math

import pytest
from shared.full import full_unless

import symgen
from symgen.errors import ModelError, SimulationError
from symgen.study.limits import STEPS, find_limit
from symgen.study.plan import Search

INCH = 0.0254
#: sqrt(a2^2 - (a1 + a4)^2) by a4, in inches.
TRUE = {0: 48.538644, 10: 44.899889, 20: 38.418745, 30: 27.129320}


@pytest.fixture(scope="module")
def crank():
    return symgen.build("slider_crank")


def in_inches(start, stop, parameter="S1"):
    return Search(parameter, start * INCH, stop * INCH, "in", INCH)


@pytest.mark.parametrize("a4", full_unless(lambda a4: a4 == 30, TRUE))
def test_the_crank_shifts_as_far_as_the_rod_reaches(crank, a4):
    exact = math.sqrt(50**2 - (12 + a4) ** 2)
    assert exact == pytest.approx(TRUE[a4], abs=5e-7)
    found = find_limit(crank.with_parameters(a4=a4 * INCH), in_inches(0, 60), lambda: None)
    value, width = found.value / INCH, found.width / INCH
    assert width < 6e-8 and abs(value - exact) < 2 * width
    assert found.closure < 1e-13 and found.least_singular < 1e-4
    assert "cannot be followed" in found.cause and "towards theta1 = 0 deg" in found.cause


def test_the_other_way_round(crank):
    """a4 falls below zero: the crank passes the far side of the slider's line."""
    found = find_limit(crank.with_parameters(S1=9 * INCH), in_inches(0, -60, "a4"), lambda: None)
    exact = 12 - math.sqrt(50**2 - 9**2)
    assert found.value / INCH == pytest.approx(exact, abs=1e-6)


def test_no_limit(crank):
    turned = Search("alpha4", math.radians(270), math.radians(450), "deg", math.pi / 180)
    found = find_limit(crank.with_parameters(a4=20 * INCH), turned, lambda: None)
    assert found.value is None and found.cause == "" and found.closure < 1e-13


def test_a_search_must_start_where_it_goes_through(crank):
    with pytest.raises(ModelError, match=r"limit of S1 starts at 55 in, where .*cannot be assembled"):
        find_limit(crank, in_inches(55, 0), lambda: None)


class Stub:
    """A loop that goes through its range up to a value of x."""

    def __init__(self, limit, x=0.0):
        self.limit, self.x = limit, x

    def with_parameters(self, x):
        return Stub(self.limit, x)

    def inverse_dynamics(self):
        if self.x > self.limit:
            raise SimulationError(f"stuck at {self.x}\n  Do something.")
        from symgen.runtime.result.turn import Turn

        turn = object.__new__(Turn)
        object.__setattr__(turn, "statistics", {"closure": 0.0, "least_singular": 1.0})
        return turn


def test_the_number_of_evaluations_is_known_beforehand():
    calls = []
    found = find_limit(Stub(0.3), Search("x", 0.0, 1.0, "1", 1.0), lambda: calls.append(1))
    assert len(calls) == STEPS
    assert 0.3 - found.width <= found.value <= 0.3 and found.width < 1e-9
    assert found.cause.startswith("stuck at 0.3") and "\n" not in found.cause
