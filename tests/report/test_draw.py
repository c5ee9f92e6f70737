"""Drawings: their coordinates, read back, against closed forms and the model's own results."""

from __future__ import annotations

import io
import math
import re
import xml.etree.ElementTree as ET

import ezdxf
import numpy as np
import pytest

import symgen
from symgen.errors import ModelError, ResultError
from symgen.inspection.film import sheet_of
from symgen.scene.loading import override, read_scene

#: Crank, coupler and rocker of crank_rocker, and the place of the rocker's pivot [m].
CRANK, COUPLER, ROCKER, BASE = 0.1, 0.35, 0.3, 0.4


def read(sheet):
    """Return the entities of a DXF file by layer, and its unit code, without faults."""
    document = ezdxf.read(io.StringIO(sheet.dxf()))
    assert not document.audit().errors
    layers = {}
    for entity in document.modelspace():
        layers.setdefault(entity.dxf.layer, []).append(entity)
    return layers, document.header["$INSUNITS"]


def four_bar(angle):
    """Return A and B by the intersection of two circles, B above the line from A to the pivot."""
    a = CRANK * np.array([math.cos(angle), math.sin(angle)])
    d = np.array([BASE, 0.0]) - a
    length = np.linalg.norm(d)
    along = (length**2 + COUPLER**2 - ROCKER**2) / (2 * length)
    up = math.sqrt(COUPLER**2 - along**2)
    return a, a + (along * d + up * np.array([-d[1], d[0]])) / length


def test_dxf_of_poses_has_the_joints_of_two_circles():
    """In millimetres, with a layer each for links, joints, ground and paths."""
    angles = np.radians([0.0, 60.0, 200.0])
    sheet = symgen.build("crank_rocker").draw(angles, of=["B"], unit="mm")
    layers, unit = read(sheet)
    assert unit == 4
    expected = [1e3 * point for angle in angles for point in four_bar(angle)]
    circles = [np.array(c.dxf.center)[:2] for c in layers["JOINTS"]]
    assert np.array(circles) == pytest.approx(np.array(expected), abs=1e-6)
    pivots = [tuple(c.dxf.center)[:2] for c in layers["GROUND"] if c.dxftype() == "CIRCLE"]
    assert sorted(pivots) == [pytest.approx((0.0, 0.0)), pytest.approx((400.0, 0.0))]
    ends = [np.array(line.get_points("xy")) for line in layers["LINKS"]]
    a, b = four_bar(angles[1])
    assert any(np.allclose(e, 1e3 * np.array([a, b]), atol=1e-6) for e in ends)
    assert [text.dxf.text for text in layers["NAMES"]] == ["O", "A", "B", "C", "crank", "coupler", "rocker"]
    (path,) = layers["PATHS"]
    curve = np.array(path.get_points("xy"))
    assert path.closed and np.linalg.norm(curve[-1] - curve[0]) > 0.01  # once round, no vertex twice
    assert np.linalg.norm(curve - [400.0, 0.0], axis=1) == pytest.approx(np.full(len(curve), 300.0))
    far = (COUPLER - CRANK, COUPLER + CRANK)  # of B from O where crank and coupler are in line
    swing = [math.acos((ROCKER**2 + BASE**2 - x**2) / (2 * ROCKER * BASE)) for x in far]
    reach = [math.atan2(y, 400.0 - x) for x, y in curve]
    assert (min(reach), max(reach)) == pytest.approx(swing, abs=1e-3)


def slider(angle, offset):
    """Return the crank's end and the slider [in] of a crank of 12 in and a rod of 50 in."""
    crank = 12.0 * np.array([math.cos(angle), math.sin(angle)])
    return crank, np.array([offset, crank[1] + math.sqrt(50.0**2 - (offset - crank[0]) ** 2)])


@pytest.mark.parametrize("offset", [0.0, 4.0])
def test_dxf_of_a_loop_has_the_unit_of_its_table_and_its_tuned_parameters(tmp_path, offset):
    file = tmp_path / "pose.dxf"
    symgen.build("slider_crank").with_parameters(a4=offset * 0.0254).draw(0.7, of=["S3"], file=file)
    document = ezdxf.readfile(file)
    assert document.header["$INSUNITS"] == 1  # inches
    found = [np.array(p.dxf.location) for p in document.modelspace().query('POINT[layer=="JOINTS"]')]
    side = np.sign(found[1][0]) if offset else 1.0
    expected = [(*place, 0.0) for place in slider(0.7, side * offset)]
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-8)
    (path,) = document.modelspace().query('POLYLINE[layer=="PATHS"]')
    curve = np.array([v.dxf.location for v in path.vertices])
    ends = [math.sqrt((50.0 + k * 12.0) ** 2 - offset**2) for k in (-1, 1)]  # rod and crank in line
    assert curve[:, 0] == pytest.approx(np.full(len(curve), side * offset), abs=1e-8)
    assert (curve[:, 1].min(), curve[:, 1].max()) == pytest.approx(ends, rel=1e-4)


def test_a_pose_of_a_motion_under_forces_is_that_of_its_run():
    """Times are sorted, and the paths end where the run ends."""
    sheet = symgen.build("four_bar").draw([0.3, 0.0], of=["B"])
    assert not any(line.closed for line in read(sheet)[0]["PATHS"])
    start, later = ({n.name: n.at for n in pose.nodes} for pose in sheet.poses)
    run = symgen.build("four_bar", set={"analysis.outputs": ["B.position"]}).simulate(t_eval=[0.0, 0.3])
    assert start["B"] == pytest.approx(run["B.position"].values[0], abs=1e-12)
    assert later["B"] == pytest.approx(run["B.position"].values[1], abs=1e-9)


def test_poses_and_paths_end_at_a_dead_centre():
    """The path of the crank's end is an arc to where coupler and rocker are in line."""
    scene = read_scene("crank_rocker")
    long = override(scene, {"points.A.at": ["30 cm", "0 cm"], "links.crank.length": "30 cm"})
    sheet = sheet_of(long, lambda _: ([0.0, 1.0], "input"), of=["A"])
    a = 0.3
    limit = math.acos((a**2 + BASE**2 - (COUPLER + ROCKER) ** 2) / (2 * a * BASE))
    path = sheet.paths["A"]
    turned = np.arctan2(path[:, 1], path[:, 0])
    assert 0.9 * limit < turned.max() <= limit and turned.min() == pytest.approx(0.0, abs=1e-12)
    tip = {n.name: n.at for n in sheet.poses[1].nodes}["A"]
    assert tip == pytest.approx([a * math.cos(1.0), a * math.sin(1.0)], abs=1e-12)


def test_paths_of_a_free_linkage_with_a_redundant_constraint_are_those_of_its_run():
    """It has as many constraints as coordinates, and no drive."""
    sheet = sheet_of(read_scene("double_four_bar"), samples=5)
    path = sheet.paths["B"]
    assert np.hypot(*path.T) == pytest.approx(np.ones(5), abs=1e-9) and np.ptp(path[:, 0]) > 0.5
    assert sheet.paths["C"] - path == pytest.approx(np.tile([1.0, 0.0], (5, 1)), abs=1e-9)


def test_values_of_poses_are_numbers_in_any_shape():
    model = symgen.build("four_bar")
    row, table = (model.draw(at).svg() for at in ([0.1, 0.2], np.array([[0.1], [0.2]])))
    assert row == table
    with pytest.raises(ModelError, match="expected finite numbers for at, got nan"):
        model.draw(math.nan)


def test_svg_is_one_file_of_its_own():
    text = sheet_of(read_scene("crank_rocker"), unit="mm").svg()
    root = ET.fromstring(text)
    assert root.tag == "{http://www.w3.org/2000/svg}svg" and "var(" not in text and "href" not in text
    paths = [e for e in root.iter() if e.get("class") == "path"]
    assert len(paths) == 2  # of A and of B
    lines = [e.get("class") for e in root.iter() if e.tag.rpartition("}")[2] in ("polyline", "polygon")]
    assert lines[-2:] == ["path"] * 2  # drawn last, over the links
    assert any(e.text == "100 mm" for e in root.iter())
    assert text == sheet_of(read_scene("crank_rocker"), unit="mm").svg()


def test_nothing_of_the_mechanism_lies_on_the_scale_or_the_arrows():
    """The pivots of crank_rocker stand at the bottom, where the arrows are: these go below."""
    sheet = sheet_of(read_scene("crank_rocker"))
    found = [
        float(y)
        for y in re.findall(r'<g transform="translate\([\d.]+ ([\d.]+)\)"><path class="ground"', sheet.svg())
    ]
    (arrows,) = re.findall(r'<g transform="translate\(46 ([\d.]+)\)">', sheet.svg())
    assert len(found) == 2 and max(found) + 20 < float(arrows) - 37


def test_what_cannot_be_drawn_is_refused(tmp_path, monkeypatch):
    model = symgen.build("crank_rocker")
    with pytest.raises(ModelError, match="no moving point 'C'"):
        model.draw(of=["C"])
    with pytest.raises(ModelError, match="unit of length.*'kg', a mass"):
        model.draw(unit="kg")
    with pytest.raises(ResultError, match=r"\.svg or \.dxf for the drawing, got 'pose.png'"):
        model.draw(file=tmp_path / "pose.png")
    with pytest.raises(ModelError, match="poses are drawn at times"):
        symgen.build("four_bar").draw(0.1, over="input")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ModelError, match=r"a drawing in DXF needs ezdxf: pip install 'symgen\[dxf\]'"):
        model.draw().dxf()


def test_the_command_draws(tmp_path, monkeypatch, entry):
    monkeypatch.chdir(tmp_path)
    command = ("draw", "crank_rocker", "--at", "60 deg", "--at", "0.5 rad", "--of", "B", "--out", "b.dxf")
    assert entry(*command)[:2] == (0, "wrote b.dxf\n")
    document = ezdxf.readfile(tmp_path / "b.dxf")
    centres = [np.array(c.dxf.center)[:2] for c in document.modelspace().query('CIRCLE[layer=="JOINTS"]')]
    expected = [point for angle in (math.pi / 3, 0.5) for point in four_bar(angle)]
    assert np.array(centres) == pytest.approx(np.array(expected), abs=1e-9)
    code, _, said = entry("draw", "four_bar", "--at", "20 mm")
    assert code == 2 and "times after --at" in said
    code, _, said = entry("draw", "four_bar", "--of", "B", "--no-paths")
    assert code == 2 and "not both" in said
