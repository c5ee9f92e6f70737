"""Sections of elastic links in space: torsion constants, and values that are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp
from shared.in_numpy import build

import symgen
from symgen.errors import RangeError, SceneError
from symgen.scene.elastic.spatial_section import torsion_constant
from symgen.scene.loading import read_scene
from symgen.scene.resolve import resolve

SCENE = {
    "points": {"root": {"at": [0, 0, 0], "ground": True}, "tip": {"at": ["1 m", 0, 0]}},
    "links": {
        "blade": {
            "points": ["root", "tip"],
            "density": "2700 kg/m^3",
            "section": {"width": "20 mm", "thickness": "5 mm", "width_along": [0, 1, 0]},
            "elastic": {"E": "70 GPa", "elements": 1, "shear": {"poisson": 0.3}},
        }
    },
    "welds": [{"point": "root", "links": ["blade"]}],
}


def constant(width, thickness):
    a, b = sp.symbols("a b")
    return float(torsion_constant(a, b).subs({a: width, b: thickness}))


@pytest.mark.parametrize(("ratio", "factor"), [(1, 0.1406), (2, 0.229), (10, 0.312)])
def test_torsion_constant_of_rectangles(ratio, factor):
    """J/(a b^3) of the table of Timoshenko and Goodier, Art. 109."""
    assert constant(float(ratio), 1.0) / ratio == pytest.approx(factor, rel=2e-3)


@pytest.mark.parametrize(
    ("width", "thickness"), [(1.0, 2.0), (2.0, 1.0), (1.0, 1.0), (1.0, 10.0), (30.0, 1.0)]
)
def test_torsion_constant_has_no_longer_side_of_its_own(width, thickness):
    """Against Prandtl's stress function as a double Fourier series over the rectangle."""
    odd = np.arange(1.0, 801.0, 2.0)
    m, n = odd[:, None], odd[None, :]
    terms = 1 / (m**2 * n**2 * (m**2 / width**2 + n**2 / thickness**2))
    exact = 256 / math.pi**6 * width * thickness * np.sum(terms)
    assert constant(width, thickness) == pytest.approx(exact, rel=1e-6)


def with_link(**changed):
    link = SCENE["links"]["blade"]
    return symgen.Scene(**SCENE | {"links": {"blade": link | changed}})


SECTION, ELASTIC = (SCENE["links"]["blade"][key] for key in ("section", "elastic"))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"section": SECTION | {"width": ["20 mm", "10 mm"]}}, "uniform along its length.*one value"),
        ({"section": {k: SECTION[k] for k in ("width", "thickness")}}, "direction of its width in space"),
        ({"elastic": ELASTIC | {"shear": {"poisson": -1}}}, "Poisson's ratio above -1"),
        ({"elastic": ELASTIC | {"shear": {"poisson": 0.3, "modulus": "30 GPa"}}}, "one of them"),
    ],
)
def test_wrong_sections(changed, said):
    with pytest.raises(SceneError, match=f"(?s){said}"):
        resolve(with_link(**changed))


def test_tunable_ratios_leave_a_shear_modulus():
    scene = with_link(elastic=ELASTIC | {"shear": {"poisson": "nu"}})
    model = build(scene, set={"parameters.nu": {"value": 0.3, "tunable": True}})
    with pytest.raises(
        RangeError, match=r"links.blade.elastic.shear.poisson, modulus: expected .* above zero"
    ):
        model.with_parameters(nu=-2.0)


def test_masses_in_space_have_no_moment_of_inertia():
    tip = {"point": "tip", "mass": "1 kg", "inertia": "1 kg*m^2"}
    with pytest.raises(SceneError, match="(?s)in the plane alone.*give the inertia to a body"):
        resolve(symgen.Scene(**SCENE, masses=[tip]))


def test_planar_sections_have_no_direction():
    data = read_scene("rotating_cantilever").data
    data["links"]["strip"]["section"]["width_along"] = [0, 1, 0]
    with pytest.raises(SceneError, match="a section by its width has no width_along"):
        resolve(symgen.Scene(**data))


def test_rotors_are_an_unknown_table():
    with pytest.raises(SceneError, match="unknown key 'rotor'"):
        symgen.Scene(**SCENE, rotor={"axis": [0, 0, 1], "speed": "600 rpm"})
