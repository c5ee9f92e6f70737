"""The comparison of random linkages with the curve by arc length."""

from __future__ import annotations

import pytest

import symgen
from symgen.runtime.rods import kinematics


@pytest.fixture(scope="module")
def random_linkages(load):
    return load("random_linkages")


@pytest.mark.parametrize("stop", [0.7, 1.5])
def test_the_curve_starts_at_the_very_time_of_its_start(random_linkages, monkeypatch, stop):
    """Newton's method moved the time of the start by 3e-32 s, and the sample at t = 0 was missed."""
    lengths = (0.09291178612087374, 0.7197746774650672, 0.4949903650195496, 0.5695685101969211)
    model = symgen.build(random_linkages.four_bar(1.0))
    monkeypatch.setattr(kinematics, "along_branch", lambda *given: None)
    motion = model.with_parameters(**dict(zip("abcd", lengths, strict=True))).kinematics(0.0, stop, samples=6)
    assert motion.time[0] == 0.0 and len(motion.time) == 6 and not motion.out_of_reach
