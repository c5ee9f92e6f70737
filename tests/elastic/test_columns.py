"""Links at rest under axial forces: beam-columns and Euler's elastica."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import SimulationError

CASES = Path(__file__).parents[1] / "cases"


def test_axial_forces_bend_links_at_rest():
    """A cantilever under P < Pcr is a beam-column; beyond Pcr it buckles, into Euler's elastica."""
    model = symgen.build(CASES / "post.toml")
    for load in (0.1, 0.5, 1.0, 2.0):
        k = math.sqrt(load)  # P/EI
        run = model.with_parameters(P=load).quasi_static(samples=2)
        tip, moment = 1e-6 / load * (math.tan(k) / k - 1), 1e-6 * math.tan(k) / k
        assert run["tip.displacement"].values[-1, 1] == pytest.approx(tip, rel=1e-6)
        assert run["beam.torque"].values[-1] == pytest.approx(-moment, rel=1e-6)
    factor = 3.0 / (math.pi / 2) ** 2
    with pytest.raises(SimulationError, match=rf"links buckle at 0 s: .* {factor:.4g} times"):
        model.with_parameters(P=3.0).quasi_static(samples=2)


def test_equilibrium_bends_elastic_links():
    """P/Pcr = (2 K/pi)^2, x/L = 2 E/K - 1, y/L = 2 k/K of the elastica clamped at one end."""
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    m = brentq(lambda m: ellipk(m) - math.sqrt(3.0), 1e-6, 0.9)
    tip = 2 * ellipe(m) / ellipk(m) - 1, 2 * math.sqrt(m) / ellipk(m)
    options = ["equilibrium", str(CASES / "post.toml"), "--set", "P=3 N", "--json"]
    found = json.loads(CliRunner().invoke(app, options).stdout)
    assert found["positions"]["tip"] == pytest.approx(tip, abs=0.01)
    assert found["stability"] == "stable"
