"""What results say of themselves where linear theory does not hold."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shared.elastic_scenes as bars
from shared.elastic_scenes import by_method

import symgen
from symgen.runtime.beams.checks import COMPRESSION, SLOPE, euler_load

#: Newtons of a pound.
LBF = 4.4482216152605


def number(note: str, before: str) -> float:
    """The number in a note after some words."""
    return float(re.search(rf"{before} ([-+.\de]+)", note).group(1))


@pytest.fixture(scope="module")
def fast():
    """The four-bar at 373 rpm, with the loads of the rigid motion alone."""
    return symgen.build("thesis_four_bar").quasi_static(samples=181)


def test_compression_against_the_euler_load_as_the_method_has_it(fast):
    """Coupler -108 lbf of 165, output -77 lbf of 115."""
    for link, force, limit in (("coupler", 108, 165), ("output", 77, 115)):
        (note,) = (n for n in fast.notes if n.startswith(f"{link}: its compression"))
        assert number(note, "comes to") == pytest.approx(force * LBF, rel=5e-3)
        assert number(note, "Euler load of") == pytest.approx(limit * LBF, rel=5e-3)
        assert number(note, "crank angle") == pytest.approx(352 if link == "coupler" else 18, abs=8)
        assert "large rotation" in note


def test_slope(fast):
    for link in ("crank", "coupler", "output"):
        (note,) = (n for n in fast.notes if n.startswith(f"{link}: its centre line"))
        assert number(note, "turns by") > SLOPE
    mild = symgen.build("thesis_four_bar", set={"speed": "20 rpm"}).quasi_static(samples=181)
    assert not any("centre line" in note for note in mild.notes)


def test_slope_of_a_cantilever_under_a_load(tmp_path):
    """F L^2/2EI at the tip, and 3/2 of the tip's displacement over the length."""
    force = 0.12 * 2 * bars.E * bars.INERTIA
    load = f'[[forces]]\npoint = "tip"\nforce = ["0 N", "{force} N"]'
    result = bars.cantilever(tmp_path, more=load).quasi_static(samples=2)
    (note,) = result.notes
    assert number(note, "turns by") == pytest.approx(0.12, rel=1e-3)
    assert note.startswith("bar:") and "at 0 s" in note
    less = load.replace(str(force), str(0.8 * force))
    assert not bars.cantilever(tmp_path, more=less).quasi_static(samples=2).notes


def test_stress_beyond_yield():
    limit = "44 MPa"
    model = symgen.build("elastic_slider_crank", set={"links.rod.elastic.yield_stress": limit})
    result = model.simulate(samples=181)
    (note,) = result.notes
    assert note.startswith("rod: the stress") and "4.4e+07 Pa" in note
    # the station is at mid-length; the peak anywhere is no less
    assert number(note, "comes to") >= result.peaks["rod.stress"] * (1 - 1e-3)
    assert 0.3 < number(note, "Pa at") < 0.7


def test_axial_force_without_geometric_stiffness():
    """A tenth of the Euler load is nothing to worry about, unless it is left out."""
    model = symgen.build("elastic_slider_crank")
    result = model.quasi_static(samples=181, geometric_stiffness=False)
    (note,) = (n for n in result.notes if n.startswith("rod: its axial force"))
    assert 0.05 < number(note, "crank angle [-.0-9]+ degrees,") < COMPRESSION


@pytest.mark.parametrize("scene", ["elastic_slider_crank", "rotating_cantilever"])
@pytest.mark.parametrize("method", ["quasi-static", "periodic"])
def test_no_note_where_linear_theory_holds(scene, method):
    assert by_method(symgen.build(scene), method, samples=91).notes == ()


@pytest.mark.parametrize("element", ["beam8", "cubic"])
def test_euler_loads_in_closed_form(tmp_path, element):
    """Pinned pi^2, clamped with a free tip pi^2/4, clamped and pinned 20.1907 (tan x = x) times EI/L^2."""
    one = bars.E * bars.INERTIA / bars.LENGTH**2
    chosen = f', element = "{element}"'
    cases = [
        (bars.pinned(tmp_path, chosen), np.pi**2),
        (bars.cantilever(tmp_path, chosen), np.pi**2 / 4),
        (symgen.build("thesis_four_bar"), 20.190728556426629),
    ]
    for model, factor in cases:
        motion = model.motion(True)
        p = motion.beams[0].properties
        expected = factor * (one if p.length == 1.0 else p.bending[0] / p.length**2)
        assert euler_load(motion, 0) == pytest.approx(expected, rel=2e-4 if element == "cubic" else 1e-9)


def test_force_along_a_link_counts_to_its_axial_force(tmp_path):
    """q per length along a standing cantilever: q (L - x) is taken behind x, all of it at the clamp."""
    limit = np.pi**2 / 4 * bars.E * bars.INERTIA
    load = '[[distributed_forces]]\nlink = "bar"\nforce = ["{} N/m", "0 N/m"]'
    pressed = bars.cantilever(tmp_path, more=load.format(-0.6 * limit)).quasi_static(samples=2)
    (note,) = pressed.notes
    assert number(note, "comes to") == pytest.approx(0.6 * limit, rel=1e-3)
    assert number(note, "N at") == 0.0
    assert not bars.cantilever(tmp_path, more=load.format(0.6 * limit)).quasi_static(samples=2).notes
