"""``[states]`` of linkages with elastic links in space: eigenvalues of a beam, closed forms, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from shared.flexible_arms import HUB, LAG, built, root_near, spatial

from symgen.errors import ModelError


def test_eigenvalues_in_space_are_those_of_a_beam():
    kp, kd = 0.8, 0.3
    found = [m.s for m in built(spatial(kp=kp, kd=kd, elements=6)).modes()]
    exact = np.array([root_near(s, 0.1, HUB, kp, kd) for s in found[:5]])
    assert np.array(found[:5]) == pytest.approx(exact, rel=2e-4)
    assert [abs(s.imag) < 1e-9 for s in exact] == [False, True, True, True, False]
    assert min(abs(s + 1 / LAG) for s in found) < 1e-9  # that of the filter


def test_a_filter_in_space_has_its_closed_form():
    run = built(spatial(elements=1)).simulate(samples=6)
    exact = 0.25 * np.exp(-np.linspace(0, 0.1, 6) / LAG)
    assert run["f"].values == pytest.approx(exact, abs=1e-10)
    assert run["f.rate"].values == pytest.approx(-exact / LAG, abs=1e-8)


def test_derivatives_along_a_run_in_space():
    tables = spatial(thickness=0.003, kp=8.0, kd=1.2, elements=1, shift="60 mm")
    model = built(tables)
    run = model.simulate(samples=3)
    held = ["A.position.y", "B.position.y", "B.position.z"]
    found = model.sensitivity(["m", "B.position.y"], ["lag"], at=run, coordinates=held)
    step = 1e-5
    near = [model.with_parameters(lag=LAG + x).simulate(samples=3, rtol=1e-7) for x in (step, -step)]
    m, place = ((near[0][name].values - near[1][name].values) / (2 * step) for name in ("m", "B.position"))
    exact = np.stack([m, place[:, 1]], axis=1)
    assert np.squeeze(found.derivatives) == pytest.approx(exact, rel=1e-4, abs=1e-6)
    with pytest.raises(ModelError, match=r"frequencies of a scene with \[states\]"):
        model.sensitivity(["frequencies"], ["lag"])
    with pytest.raises(ModelError, match=r"expected an undeformed start for a scene with \[states\]"):
        model.simulate(initial="quasi-static")
