"""Points off the line of elastic links: against a closed form, welded links, and elements of large rotation."""

from __future__ import annotations

import numpy as np
import pytest
from shared.in_numpy import build

import symgen
from symgen.errors import InitialStateError, ModelError, SceneError
from symgen.inspection.view import view_of
from symgen.pipeline.systems import system_of
from symgen.scene.resolve import resolve
from symgen.study.speed.work_precision import work_precision

E, WIDTH, THICK, LENGTH = 210e9, 20e-3, 4e-3, 0.8
SECTION = {
    "density": "7850 kg/m^3",
    "section": {"width": f"{WIDTH} m", "thickness": f"{THICK} m"},
    "elastic": {"E": f"{E} Pa", "elements": 2},
}


def column(force, **more):
    """A cantilever along x, clamped at O, with a force on P, 50 mm to the left of the place at 3/4."""
    given = {
        "title": "Cantilever with a lug",
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": [f"{LENGTH} m", "0 m"]},
            "P": {"on": "beam", "fraction": "3/4", "offset": "50 mm"},
        },
        "links": {"beam": {"points": ["O", "A"], **SECTION}},
        "masses": [{"point": "P", "mass": "1 g"}],
        "forces": [{"point": "P", "force": [f"{f} N" for f in force]}],
        "crank": {"link": "beam", "speed": "0 rpm"},
    }
    return symgen.Scene(**given | more)


def displacements(scene, *points):
    found = build(scene).quasi_static(samples=2, geometric_stiffness=False)
    return [found[f"{p}.displacement"].values[-1] for p in points]


@pytest.mark.parametrize("third", [False, True], ids=["offset", "third point"])
def test_a_force_on_a_lug_bends_as_force_and_couple(third):
    """With x = 3L/4 and the couple b = -F_x e - F_y e theta of the lug, which rotates by theta, at x:

    w = F_y x^3/(3EI) + b x^2/(2EI), theta = F_y x^2/(2EI) + b x/(EI).
    """
    (fx, fy), x, e = (40.0, 3.0), 0.75 * LENGTH, 0.05
    scene = column((fx, fy))
    if third:
        points = scene.points | {"P": {"at": [f"{x} m", f"{e} m"]}}
        scene = column((fx, fy), points=points, links={"beam": {"points": ["O", "A", "P"], **SECTION}})
    stiffness, axial = E * WIDTH * THICK**3 / 12, E * WIDTH * THICK
    theta = (fy * x**2 / 2 - fx * e * x) / (stiffness + fy * e * x)
    w = (fy * x**3 / 3 - (fx + fy * theta) * e * x**2 / 2) / stiffness
    found = build(scene).quasi_static(samples=2, geometric_stiffness=False)
    p, tip = (found[f"{point}.displacement"].values[-1] for point in "PA")
    assert p == pytest.approx([fx * x / axial - e * theta, w], rel=1e-9)
    # The lug of P and its foot are internal: the force of P on the section has the name of P.
    assert not [name for name in found.dataset if "foot" in name or "lug" in name]
    assert found["beam.P.force"].values[-1] == pytest.approx([fx, fy], rel=1e-9)
    assert found["beam.P.couple"].values[-1] == pytest.approx(-fx * e - fy * e * theta, rel=1e-9)
    assert tip == pytest.approx([fx * x / axial, w + theta * (LENGTH - x)], rel=1e-9)


def test_points_at_one_place_are_on_one_lug():
    """Equal forces on both sides have no couple; the lug of an end welded to another link is in that weld."""
    points = column((0, 0)).points | {"Q": {"on": "beam", "fraction": "3/4", "offset": "-50 mm"}}
    forces = [{"point": p, "force": ["20 N", "0 N"]} for p in "PQ"]
    p, tip = displacements(column((0, 0), points=points, forces=forces), "P", "A")
    stretched = 40.0 * 0.75 * LENGTH / (E * WIDTH * THICK)
    assert p == pytest.approx([stretched, 0.0], abs=1e-9 * stretched)
    assert tip == pytest.approx([stretched, 0.0], abs=1e-9 * stretched)


def blade(points, **more):
    """A blade on a hub that swings, with a tip mass off its line."""
    return symgen.Scene(
        title="Blade on a hub",
        points={
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "R": {"at": ["0.1 m", "0 m"]},
            "A": {"at": ["0.5 m", "0 m"]},
            **points,
        },
        links={"hub": {"points": ["O", "R"], "mass": "0.2 kg"}, "blade": {"points": ["R", "A"], **SECTION}},
        masses=[{"point": "P", "mass": "0.1 kg"}],
        welds=[{"point": "R", "links": ["hub", "blade"]}],
        crank={"link": "hub", "angle": "0.01*sin(rate*t)"},
        parameters={"rate": "20 rad/s"},
        analysis={"t_end": "0.05 s"},
        **more,
    )


def test_large_rotation_of_welds_to_rigid_links_agrees_with_linear_theory():
    """The hub is welded to the blade, and the lug; small motion, so that linear theory holds."""
    model = symgen.build(blade({"P": {"on": "blade", "fraction": 1, "offset": "3 cm"}}))
    linear = model.simulate(samples=41)
    large = model.large_rotation(elements=4, rtol=1e-3, samples=41)
    for output in ("P.displacement", "A.displacement", "blade.bending_strain"):
        expected = linear[output].values
        apart = np.abs(large[output].values - expected).max()
        assert apart < 5e-3 * np.abs(expected).max(), output
    # The lug is rigid, and as far from its foot as drawn.
    lug = large["P.position"].values - large["A.position"].values
    assert np.abs(np.linalg.norm(lug, axis=1) - 0.03).max() < 1e-9
    # The shaft works through the drive of the hub, whose power the balance has.
    assert large.drift.energy < 1e-4 * large.drift.energy_exchanged


def test_refused_points_off_the_line():
    points = column((0, 0)).points | {"P": {"on": "beam", "fraction": 0, "offset": "50 mm"}}
    with pytest.raises(SceneError, match="P is rigidly joined to the section of beam at O, on the"):
        symgen.build(column((0, 0), points=points))
    points = column((0, 0)).points | {"P_foot": {"on": "beam", "fraction": 0.3}}
    with pytest.raises(SceneError, match="'P_foot' is reserved for a part of the rigid joint"):
        symgen.build(column((0, 0), points=points))
    with pytest.raises(SceneError, match="P carries no mass"):
        symgen.build(column((0, 0), masses=[]))


def test_a_tunable_offset_of_zero_is_refused_in_words_of_the_scene():
    points = column((0, 0)).points | {"P": {"on": "beam", "fraction": 0.5, "offset": "e"}}
    scene = column((0, 0), points=points, parameters={"e": {"value": "5 cm", "tunable": True}})
    with pytest.raises(
        InitialStateError, match=r"expected P off the line .* zero\n  Give the offset"
    ) as error:
        build(scene).with_parameters(e=0.0).quasi_static(samples=2)
    assert error.value.where == "points.P.offset"
    structure = "\n".join(view_of(resolve(scene)).structure(resolve(scene), system_of(resolve(scene))))
    assert "P is rigidly joined to link beam, off its line" in structure
    assert "lug" not in structure and "foot" not in structure


def test_studies_of_speed_need_strains():
    """Pages on a scene whose outputs have no strain ended with an error of NumPy."""
    scene = column((1.0, 0.0), analysis={"t_end": "0.01 s", "outputs": ["P.position"]})
    with pytest.raises(ModelError, match="errors of elastic links are those of bending strains"):
        work_precision(scene, methods=("gauss",), samples=3)
