"""docs/elastic_four_bar_study.md: the numbers that symgen finds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import symgen

PAGE = (Path(__file__).parents[2] / "docs" / "elastic_four_bar_study.md").read_text(encoding="utf-8")
LINKS = ("coupler", "output")


def experiment():
    """Yield speed and the strains of coupler and output as the page has them: measured, symgen's."""
    found = re.search(r"<!-- study: experiment -->\n((?:\|.*\n)+)", PAGE)
    for line in found[1].splitlines()[2:]:
        rpm, *strains = (float(cell) for cell in line.strip("|").split("|"))
        yield int(rpm), strains[1::2]


@pytest.mark.parametrize(("rpm", "written"), tuple(experiment()))
def test_strains_beside_the_experiment(rpm, written):
    found = (
        symgen.build("thesis_rig").with_parameters(speed=rpm * np.pi / 30).periodic(steps=1024, samples=1025)
    )
    ours = [np.ptp(found.variable(f"{link}.bending_strain").values) * 1e6 for link in LINKS]
    assert ours == pytest.approx(written, abs=0.06)
    assert abs(found.floquet[0]) < 1
    # the page says that only the fastest is beyond linear theory
    assert any("linear theory" in note for note in found.notes) is (rpm == 373)


def test_quasi_static_strains_beside_table_ii():
    model = symgen.build("thesis_rig").with_parameters(speed=373 * np.pi / 30)
    found = model.quasi_static(at=np.radians(np.arange(0, 360, 8)), geometric_stiffness=False)
    for link, high, low in (("coupler", 421, -458), ("output", 667, -690)):
        strain = found.variable(f"{link}.bending_strain").values * 1e6
        assert (round(strain.max()), round(strain.min())) == (high, low)
        assert f"+{high} / {low}" in PAGE


def test_quasi_static_strain_of_the_held_crank():
    found = symgen.build("thesis_four_bar").quasi_static(samples=361, geometric_stiffness=False)
    assert round(found.peaks["crank.bending_strain"] * 1e6, -3) == 12_000
