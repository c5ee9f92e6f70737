"""Synthesis of slider-cranks: limit positions by the theorem of Pythagoras, and linkages that the test draws."""

from __future__ import annotations

import math

import numpy as np
import pytest

import symgen
from symgen.errors import SceneError

#: Lengths of the slider-crank that tests draw, and its coupler's point from A in axes along AB.
R, L, E, POINT = 0.3, 0.9, 0.1, (0.2, 0.3)


def slider(crank):
    return R * np.cos(crank) + np.sqrt(L * L - (E - R * np.sin(crank)) ** 2)


def pose(crank):
    """Return place of the coupler's point and rotation of the coupler."""
    joint = R * np.array([math.cos(crank), math.sin(crank)])
    x, y = np.array([slider(crank), E]) - joint
    angle = math.atan2(y, x)
    c, s = math.cos(angle), math.sin(angle)
    return joint + [c * POINT[0] - s * POINT[1], s * POINT[0] + c * POINT[1]], angle


def in_metres(values):
    return [in_metres(v) if np.ndim(v) else f"{float(v)!r} m" for v in values]


def found(**task):
    return symgen.synthesise({"linkage": "slider-crank", **task}).designs


def own(designs):
    """Return the drawn slider-crank among designs, without faults."""
    (design,) = (d for d in designs if np.allclose([*d.linkage.lengths.values()], (R, L, E), rtol=1e-8))
    assert not design.faults
    return design


def quantities(r, l, e):
    """Return the quantities of a slider-crank by right triangles."""
    far, near = math.sqrt((l + r) ** 2 - e * e), math.sqrt((l - r) ** 2 - e * e)
    start, end = math.atan2(e, far), math.atan2(e, near)
    return {
        "crank": r, "coupler": l, "offset": e, "stroke": far - near, "slider_extended": far, "slider_folded": near,
        "crank_extended": start, "crank_folded": end, "transmission_least": math.acos((e + r) / l),
        "transmission_greatest": math.acos((e - r) / l),
        "time_ratio": (math.pi + end - start) / (math.pi - end + start),
    }  # fmt: skip


def unit(name):
    if name in ("crank", "coupler", "offset", "stroke", "slider_extended", "slider_folded"):
        return " m"
    return "" if name == "time_ratio" else " rad"


def test_any_three_quantities_of_a_random_slider_crank_lead_back_to_it():
    generator, met = np.random.default_rng(2), 0
    while met < 12:
        r, e = generator.uniform(0.05, 0.6, 2).tolist()
        if r + e > 0.95:
            continue
        every = quantities(r, 1.0, e)
        names = generator.choice([*every], 3, replace=False).tolist()
        try:
            designs = found(kind="limits", **{n: f"{every[n]!r}{unit(n)}" for n in names})
        except SceneError as error:
            assert "at least one length" in str(error) or "depend on each other" in str(error), names
            continue
        lengths = [[*d.linkage.lengths.values()] for d in designs]
        assert any(np.allclose(x, (r, 1.0, e), rtol=1e-7) for x in lengths), names
        for design in designs:
            assert not design.faults
            k = quantities(*design.linkage.lengths.values())
            assert all(k[n] == pytest.approx(every[n], rel=1e-8) for n in names)
        met += 1


def test_an_in_line_slider_crank():
    """Without an offset the stroke is twice the crank, and both strokes take the same time."""
    (design,) = found(kind="limits", stroke="20 cm", offset="0 m", coupler="30 cm")
    assert [*design.linkage.lengths.values()] == pytest.approx([0.1, 0.3, 0.0], abs=1e-12)
    assert design.quantities["stroke"] == pytest.approx(0.2, rel=1e-9)
    assert design.quantities["time_ratio"] == pytest.approx(1.0, rel=1e-9)
    assert design.quantities["transmission_minimum"] == pytest.approx(math.acos(0.1 / 0.3), rel=1e-9)


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ({"crank": "1 m", "stroke": "1.9 m", "coupler": "4 m"}, "contradict: stroke >= 2\\*crank"),
        ({"crank": "1 m", "stroke": "2.1 m", "time_ratio": 0.9}, "contradict: time_ratio >= 1"),
        ({"crank": "1 m", "coupler": "1.2 m", "offset": "0.3 m"}, "contradict: crank \\+ offset < coupler"),
        ({"crank": "1 m", "stroke": "3 m"}, "expected 3 quantities, which determine a slider-crank, got 2"),
        ({"crank": "1 m", "slider_extended": "3 m", "crank_extended": "91 deg"}, "no slider-crank"),
        ({"crank": "1 m", "stroke": "3 m", "time_ratio": -1}, "expected a ratio above zero, got -1"),
    ],
)
def test_limits_that_no_slider_crank_has(task, message):
    with pytest.raises(SceneError, match=message):
        found(kind="limits", **task)


def test_function_generation():
    cranks = np.linspace(0.3, 2.9, 5)
    positions = slider(cranks)
    ways = in_metres(positions - positions[0])
    design = own(found(kind="function", input=(cranks - cranks[0]).tolist(), output=ways))
    run = design.linkage.angles(cranks)
    moved = run["B.position"].values[:, 0]
    assert moved - moved[0] == pytest.approx(positions - positions[0], abs=1e-9)
    three = slice(0, 5, 2)
    own(
        found(kind="function", input=cranks[three].tolist(), output=in_metres(positions[three]),
              crank_start=0, slider_start="0 m")
    )  # fmt: skip


def test_motion_generation_of_four_poses():
    """Every linkage found keeps its crank's length and its slider on a line in the poses, rigidly moved."""
    tilt, places, angles = 0.4, *map(np.array, zip(*(pose(x) for x in (0.3, 1.0, 1.8, 2.5)), strict=True))
    places = places @ [[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]]
    angles = angles + tilt
    designs = found(kind="motion", points=in_metres(places), angles=angles.tolist(), ground_x="0 m")
    assert math.cos(own(designs).linkage.guide - tilt) == pytest.approx(1, abs=1e-12)
    for design in designs:
        k = design.linkage
        moved = []
        for place, angle in zip(places, angles, strict=True):
            c, s = math.cos(angle - angles[0]), math.sin(angle - angles[0])
            turn = np.array([[c, -s], [s, c]])
            moved.append([place + turn @ (joint - k.P) for joint in (k.A, k.B)])
        cranks, sliders = np.swapaxes(moved, 0, 1)
        assert np.ptp(np.linalg.norm(cranks - k.O, axis=1)) < 1e-8
        assert np.ptp(sliders @ [-math.sin(k.guide), math.cos(k.guide)]) < 1e-8


@pytest.mark.parametrize(
    ("cranks", "given"),
    [((0.3, 1.0, 1.8, 2.5, 3.3, 4.1), {"ground_x": "0 m", "ground_y": "0 m"}),
     ((0.3, 1.0, 1.8, 2.5, 3.3, 4.1, 5.0, 5.8), {})],
)  # fmt: skip
def test_path_generation(cranks, given):
    """Six points determine slider-cranks on a given ground point, eight all quantities."""
    places = [pose(x)[0] for x in cranks]
    own(found(kind="path", points=in_metres(places), **given))


def test_the_scene_of_a_design_runs_and_has_its_lengths_as_parameters(tmp_path):
    places, angles = zip(*(pose(x) for x in (0.3, 1.0, 1.8)), strict=True)
    designs = found(kind="motion", points=in_metres(places), angles=[*angles], ground_x="0 m", ground_y="0 m",
                    guide_angle=0)  # fmt: skip
    file = tmp_path / "design.toml"
    file.write_text(own(designs).linkage.toml())
    model = symgen.build(file)
    run = model.kinematics(at=[1.0, 1.8], over="input")
    assert np.allclose(run["P.position"].values, places[1:], atol=1e-9)
    other = model.with_parameters(crank_length=0.2, offset=0.05).kinematics(at=[2.0], over="input")
    x = 0.2 * math.cos(2.0) + math.sqrt(L * L - (0.05 - 0.2 * math.sin(2.0)) ** 2)
    assert other["B.position"].values[0] == pytest.approx([x, 0.05], abs=1e-9)


def test_the_best_offset_of_a_range_from_zero_is_zero():
    """The least transmission angle acos((e + r)/l) decreases with the offset e."""
    (design,) = found(kind="limits", crank="50 mm", coupler="200 mm", offset=["0 mm", "30 mm"], starts=20)
    assert design.linkage.lengths["offset"] == pytest.approx(0.0, abs=1e-9)
    assert design.quantities["transmission_minimum"] == pytest.approx(math.acos(0.25), rel=1e-9)
    assert not design.faults


@pytest.mark.parametrize("seed", range(6))
def test_a_crank_stops_where_the_coupler_no_longer_reaches_the_guide(seed):
    from symgen.synthesis.slider_crank import SliderCrank

    generator = np.random.default_rng(seed)
    r, l, e = generator.uniform([0.2, 0.4, 0.1], [1.0, 1.2, 0.5])
    directions = np.linspace(-np.pi, np.pi, 4001)
    reaches = np.abs(e - r * np.sin(directions)) < l
    start = float(generator.choice(directions[reaches]))
    joint = r * np.array([math.cos(start), math.sin(start)])
    end = np.array([joint[0] + math.sqrt(l * l - (e - joint[1]) ** 2), e])
    linkage = SliderCrank([0.0, 0.0], joint, end, end, 0.0)
    for way, stop in zip((-1, 1), linkage.swing, strict=True):
        turned = start + way * np.linspace(0.0, 2 * np.pi, 100_001)
        passes = np.abs(e - r * np.sin(turned)) < l
        assert math.isinf(stop) if passes.all() else abs(stop - turned[~passes][0]) < 1e-4
