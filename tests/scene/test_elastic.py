"""Elastic links in scenes: what they resolve to, and one clear error for what they cannot be."""

from __future__ import annotations

import json
import tomllib

import pytest
import sympy as sp
from shared.commands import call

import symgen
from symgen.errors import SceneError, SimulationError
from symgen.scene.loading import read_scene
from symgen.scene.resolve import resolve

SECTION = 'section = { width = "20 mm", thickness = "5 mm" }'
ELASTIC = 'elastic = { E = "210 GPa", elements = 2 }'
CRANK = '[crank]\nlink = "crank"\nspeed = "60 rpm"\n'
GOOD = f"""
symgen = 1
[points]
O = {{ at = ["0 m", "0 m"], ground = true }}
A = {{ at = ["0.1 m", "0 m"] }}
B = {{ at = ["0.4 m", "0.3 m"] }}
Q = {{ at = ["0.4 m", "0 m"], ground = true }}
[links.crank]
points = ["O", "A"]
mass = "0.2 kg"
[links.coupler]
points = ["A", "B"]
density = "7850 kg/m^3"
{SECTION}
{ELASTIC}
[links.rocker]
points = ["B", "Q"]
mass = "0.5 kg"
{CRANK}
"""
COUPLER = "[links.coupler"


def with_keys(keys):
    """Return the change to further keys of the coupler's elastic."""
    return ("elements = 2", keys)


def with_section(section):
    return (SECTION, f"section = {section}")


def with_crank(keys):
    return ('speed = "60 rpm"', f'speed = "60 rpm"\n{keys}')


def with_time():
    return ("[points]", '[parameters]\none = "1 s"\n[points]')


def behind(tables):
    return (CRANK, f"{CRANK}{tables}\n")


def with_point(point):
    return ("[links.crank]", f"{point}\n[links.crank]")


#: What is changed in the good scene, and what the message must say.
CASES = {
    "negative section": ([with_section('{ width = "20 mm", thickness = "-5 mm" }')],
        [f"{COUPLER}.section] thickness", "a length above zero", "'-5 mm'"]),
    "section without unit": ([with_section('{ width = "20 mm", thickness = 5 }')],
        [f"{COUPLER}.section] thickness", "a length", "got 5"]),
    "half a section": ([with_section('{ width = "20 mm" }')], [f"{COUPLER}.section] thickness", "{ diameter }"]),
    "two sections": ([with_section('{ diameter = "2 mm", area = "1 mm^2" }')],
        [f"{COUPLER}.section] area", "no area"]),
    "misspelled section": ([with_section('{ width = "20 mm", thicknes = "5 mm" }')],
        [f"{COUPLER}.section] thicknes", "'thickness'"]),
    "no section": ([(SECTION, "")], [f"{COUPLER}] density", "needs its section"]),
    "taper below zero": ([with_section('{ width = "20 mm", thickness = ["5 mm", "-1 mm"] }')],
        [f"{COUPLER}.section] thickness[1]", "above zero", "'-1 mm'"]),
    "taper of three": ([with_section('{ width = "20 mm", thickness = ["5 mm", "4 mm", "3 mm"] }')],
        [f"{COUPLER}.section] thickness", "two of a taper", "got 3"]),
    "taper by mass": ([with_section('{ width = "20 mm", thickness = ["5 mm", "4 mm"] }'),
        ('density = "7850 kg/m^3"', 'mass = "1 kg"')], [f"{COUPLER}] mass", "density"]),
    "no elements": ([with_keys("elements = 0")], [f"{COUPLER}.elastic] elements", "1 to 1000", "got 0"]),
    "negative elements": ([with_keys("elements = -3")], [f"{COUPLER}.elastic] elements", "got -3"]),
    "huge elements": ([with_keys("elements = 100000000000")], [f"{COUPLER}.elastic] elements", "1 to 1000"]),
    "broken elements": ([with_keys("elements = 2.5")], [f"{COUPLER}.elastic] elements", "a whole number", "2.5"]),
    "elements as text": ([with_keys('elements = "2"')], [f"{COUPLER}.elastic] elements", "a whole number", "'2'"]),
    "unknown element": ([with_keys('element = "timoshenk"')],
        [f"{COUPLER}.elastic] element", "'timoshenk'", "Did you mean 'timoshenko'?"]),
    "massless": ([('density = "7850 kg/m^3"', "")], ["[links] coupler", "no mass", "density"]),
    "no density": ([("7850 kg/m^3", "0 kg/m^3")], [f"{COUPLER}] density", "needs a mass", "no finite frequency"]),
    "zero mass": ([('density = "7850 kg/m^3"', 'mass = "0 kg"')], [f"{COUPLER}] mass", "needs a mass"]),
    "density and mass": ([("density =", 'mass = "1 kg"\ndensity =')],
        [f"{COUPLER}] mass", "one of density, mass"]),
    "own inertia": ([("density =", 'inertia = "1 kg*m^2"\ndensity =')], [f"{COUPLER}] inertia", "from its section"]),
    "negative modulus": ([("210 GPa", "-210 GPa")], [f"{COUPLER}.elastic] E", "above zero", "'-210 GPa'"]),
    "no modulus": ([('E = "210 GPa", ', "")], [f"{COUPLER}.elastic] E", "missing"]),
    "unit of the modulus": ([("210 GPa", "210 N")], [f"{COUPLER}.elastic] E", "a modulus", "a force"]),
    "unknown reduction": ([with_keys('reduction = "guyon"')], ["reduction", "'guyan' or 'craig-bampton'", "'guyon'"]),
    "reduction without modes": ([with_keys('reduction = "craig-bampton"')],
        [f"{COUPLER}.elastic.reduction] modes", "modes = 3"]),
    "modes of guyan": ([with_keys('reduction = { kind = "guyan", modes = 2 }')], ["reduction] modes", "keeps no modes"]),
    "reduction of kept length": ([with_keys('axial = false, reduction = "guyan"')],
        [f"{COUPLER}.elastic] reduction", "keeps its length"]),
    "no crank": ([(CRANK, "")], ["[crank]", "coupler is elastic", "[crank] with link"]),
    "unknown crank": ([('link = "crank"', 'link = "crnk"')], ["[crank] link", "'crnk'", "Did you mean 'crank'?"]),
    "crank off the ground": ([('link = "crank"', 'link = "coupler"')], ["[crank] link", "no ground point"]),
    "crank the wrong way": ([('link = "crank"', 'link = "rocker"')], ["[crank] link", 'points = ["Q", "B"]']),
    "motor without torque": ([with_crank('mode = "motor"')], ["[crank] torque", "this.rate"]),
    "torque on a held crank": ([with_crank('torque = "1 N*m"')], ["[crank] torque", 'mode = "motor"']),
    "unknown mode": ([with_crank('mode = "hold"')], ["[crank] mode", "'held', 'free' or 'motor'", "'hold'"]),
    "crank without speed": ([('speed = "60 rpm"', "")], ["[crank] speed", "needs its speed", "uses the time t"]),
    "speed and prescribed angle": ([with_time(), with_crank('angle = "t/one"')], ["[crank] speed", "no speed in addition"]),
    "prescribed angle of a free crank": (
        [with_time(), ('speed = "60 rpm"', 'mode = "free"\nangle = "t/one"')], ["[crank] angle", "no prescribed angle"]),
    "negative flywheel": ([with_crank('mode = "motor"\ntorque = "1 N*m"\nflywheel = "-1 kg*m^2"')],
        ["[crank] flywheel", "at least zero"]),
    "crank driven twice": ([behind('[[drivers]]\nlink = "crank"\nangle = "0 deg"')], ["[drivers.0] link", "already"]),
    "crank without elastic": ([(ELASTIC, "")], ["[crank]", "no link is elastic", "[[drivers]]"]),
    "yield stress": ([with_keys('yield_stress = "-1 MPa"')], [f"{COUPLER}.elastic] yield_stress", "above zero"]),
    "negative damping": ([with_keys('damping = { stiffness = "-1 s" }')], ["damping] stiffness", "at least zero"]),
    "overdamped": ([with_keys("damping = { ratio = 2 }")], ["damping] ratio", "below 1", "got 2", "0.02"]),
    "station off the link": ([behind('[[stations]]\nlink = "coupler"\nat = 1.5')],
        ["[stations.0] at", "from 0 to 1", "got 1.5"]),
    "station on a rigid link": ([behind('[[stations]]\nlink = "rocker"\nat = 0.5')],
        ["[stations.0] link", "not elastic", "coupler"]),
    "station out of the section": ([behind('[[stations]]\nlink = "coupler"\nat = 0.5\nfibre = "4 mm"')],
        ["[stations.0] fibre", "0.0025 m", "0.004 m"]),
    "station twice": ([behind('[[stations]]\nlink = "coupler"\nat = 0.5\n' * 2)], ["[stations.1] name", "coupler_50"]),
    "poisson": ([with_keys('element = "timoshenko", shear = { poisson = 0.7 }')], ["shear] poisson", "up to 0.5", "0.7"]),
    "no shear modulus": ([with_keys('element = "timoshenko"')], [f"{COUPLER}.elastic] shear", "poisson = 0.3"]),
    "shear of a slender beam": ([with_keys("shear = { poisson = 0.3 }")], [f"{COUPLER}.elastic] shear", "timoshenko"]),
    "loop that does not close": ([('points = ["A", "B"]', 'points = ["A", "B"]\nlength = "9 m"')],
        ["[links] coupler", "cannot be assembled"]),
    "elastic rail on moved ground": ([behind('[points.M]\nat = ["2 m", "0 m"]\nground = true\nmotion = ["0 m", "0 m"]\n'
        '[links.rail]\npoints = ["O", "M"]\ndensity = "1 kg/m^3"\n' + f"{SECTION}\n{ELASTIC}")],
        ["[links.rail] elastic", "cannot turn"]),
    "third point": ([with_point('X = { at = ["1 m", "1 m"] }'), ('["A", "B"]', '["A", "B", "X"]')],
        ["[points] X", "lies between its ends", "0 to 1"]),
    "joint along an inextensible link": (
        [with_point('X = { on = "coupler", fraction = 0.5 }'), ('["B", "Q"]', '["X", "Q"]'), with_keys("axial = false")],
        ["[points.X] fraction", "coupler, which keeps its length", "axial = false"],
    ),
    "joint along the link at its end": (
        [with_point('X = { on = "coupler", fraction = 1 }'), ('["B", "Q"]', '["X", "Q"]')],
        ["[points.X] fraction", "coupler at its end, B", "Name B instead"],
    ),
    "joints along the link at one place": (
        [
            with_point('X = { on = "coupler", fraction = 0.5 }\nY = { on = "coupler", fraction = 0.5005 }'),
            ('["B", "Q"]', '["X", "Q"]'),
            behind('[links.other]\npoints = ["Y", "Q"]\nmass = "1 kg"'),
        ],
        ["[points.Y] fraction", "Y and X", "coupler at the same place", "move them apart"],
    ),
    "link welded to itself": (
        [behind('[[welds]]\npoint = "B"\nlinks = ["coupler", "coupler"]')],
        ["[welds.0] links", "named twice", "Name each link once"],
    ),
    "point beyond the link": ([with_point('X = { on = "coupler", fraction = 1.5 }')], ["[points.X] fraction", "0 to 1"]),
    "torque": ([behind('[[torques]]\nlink = "coupler"\ntorque = "1 N*m"')], ["[torques.0] link", "no one angle"]),
    "torsion spring": ([behind('[[torsion_springs]]\nlink = "rocker"\nagainst = "coupler"\nstiffness = "1 N*m"')],
        ["[torsion_springs.0] against", "no one angle"]),
    "guide along": ([behind('[[guides]]\npoints = ["Q"]\nalong = "coupler"')], ["[guides.0] along", "a straight link"]),
    "driver": ([behind('[[drivers]]\nlink = "coupler"\nangle = "3 deg"')], ["[drivers.0] link", "[crank]"]),
    "elastic in space": (
        [(f'["{x} m", "0 m"]', f'["{x} m", "0 m", "0 m"]') for x in ("0", "0.4")]
        + [('["0.1 m", "0 m"]', '["0.1 m", "0 m", "0.1 m"]'), ('"0.3 m"]', '"0.3 m", "0.2 m"]')],
        ["[crank]", "elastic links in space has no crank"],
    ),
    "not a table": ([(ELASTIC, "elastic = true")], [f"{COUPLER}] elastic", "a table of keys", "True"]),
    "misspelled key": ([with_keys("elments = 2")], [f"{COUPLER}.elastic] elments", "'elements'"]),
}  # fmt: skip

#: What shows only when the crank turns.
LATE = {
    "crank that locks": ([('["0.1 m", "0 m"]', '["0 m", "0.35 m"]')], ["the crank, crank,", "past 139.", "dead centre"]),
    "too many modes": ([with_keys('reduction = { kind = "craig-bampton", modes = 50 }')],
        ["[links.coupler.elastic.reduction] modes", "at most 2 modes", "got 50", "more elements"]),
}  # fmt: skip

LOOP = """
symgen = 1
[loop]
inputs = { theta1 = "2*t/(1 s)" }
rows = [
  { joint = "R", link = "crank", theta = "theta1", a = "1 m" },
  { joint = "R", link = "ground", theta = "?", a = "1 m" },
]
[loop.links]
crank = { mass = "1 kg" }
"""


def changed(changes, text=GOOD):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def written(text, folder):
    (folder / "bad.toml").write_text(text, encoding="utf-8")
    return folder / "bad.toml"


@pytest.mark.parametrize(
    ("fraction", "told"),
    [
        (0.0, "coupler at its end, A"),
        (1e-9, "coupler at its end, A"),
        (1.0, "coupler at its end, B"),
        (1.5, "a fraction from 0 to 1, got 1.5"),
        (-0.3, "a fraction from 0 to 1, got -0.3"),
    ],
)
def test_joints_are_not_tuned_to_an_end_or_off_their_link(fraction, told, tmp_path):
    hung = [
        ("[points]", "[parameters]\nplace = { value = 0.5, tunable = true }\n[points]"),
        with_point('X = { on = "coupler", fraction = "place" }\nZ = { at = ["0.25 m", "-0.2 m"] }'),
        behind('[links.hung]\npoints = ["X", "Z"]\nmass = "1 kg"'),
    ]
    model = symgen.build(written(changed(hung), tmp_path)).with_parameters(place=fraction)
    with pytest.raises(SceneError, match=rf"\[points.X\] fraction.*{told}"):
        model.beams  # noqa: B018


@pytest.mark.parametrize("case", CASES)
def test_bad_elastic_scene(case, tmp_path):
    changes, words = CASES[case]
    path = written(changed(changes), tmp_path)
    with pytest.raises(SceneError) as caught:
        symgen.build(path)
    said = str(caught.value)
    assert said.startswith("bad.toml: [")
    for word in words:
        assert word in said
    assert [p.name for p in tmp_path.iterdir()] == ["bad.toml"]


@pytest.mark.parametrize(
    ("case", "code"),
    [
        *((case, 3) for case in ("no elements", "no density", "no crank", "unknown element")),
        ("crank that locks", 4),
        ("too many modes", 3),
    ],
)
def test_the_command_line_says_it_once_and_exits_with_a_code(case, code, tmp_path, monkeypatch, entry):
    changes, words = {**CASES, **LATE}[case]
    monkeypatch.chdir(tmp_path)
    ended, out, said = entry("run", written(changed(changes), tmp_path).name, "--json")
    assert (ended, out) == (code, ""), said
    assert said.startswith("symgen: ") and said.count("symgen: ") == 1
    assert "Traceback" not in said
    for word in words:
        assert word in said
    assert [p.name for p in tmp_path.iterdir()] == ["bad.toml"]


@pytest.mark.parametrize(
    "change, words",
    [
        (('crank = { mass = "1 kg" }', 'crank = { mass = "1 kg", elastic = { E = "1 GPa" } }'), "[loop.links.crank] elastic"),
        (("[loop]\n", f"{CRANK}[loop]\n"), "[crank]: a scene with a loop has no crank"),
        (("[loop]\n", '[[stations]]\nlink = "crank"\nat = 0.5\n[loop]\n'), "[stations]: a scene with a loop has no"),
    ],
)  # fmt: skip
def test_loops_in_space_have_no_elastic_links(change, words, tmp_path):
    with pytest.raises(SceneError) as caught:
        symgen.build(written(changed([change], LOOP), tmp_path))
    assert words in str(caught.value)


def test_speed_above_the_first_critical_one_is_noted(tmp_path):
    path = written(changed([("60 rpm", "5000 rpm")]), tmp_path)
    options = ("--samples", "5", "--no-geometric-stiffness", "--json")
    (note,) = [n for n in json.loads(call("quasi-static", path, *options))["notes"] if "critical speed" in n]
    assert "83.33 Hz" in note
    slow = symgen.build(written(GOOD, tmp_path)).quasi_static(samples=5)
    assert not [n for n in slow.notes if "critical speed" in n]


def test_crank_that_locks_is_named_where_it_locks(tmp_path):
    """The crank of 350 mm meets coupler and rocker in line: cosine law, whatever the recorded times."""
    model = symgen.build(written(changed(LATE["crank that locks"][0]), tmp_path))
    reach = sp.sqrt(sp.Rational(16, 100) + sp.Rational(25, 10000)) + sp.Rational(3, 10)
    cosine = (sp.Rational(1225, 10000) + sp.Rational(16, 100) - reach**2) / sp.Rational(28, 100)
    locks = float(sp.acos(cosine) * 180 / sp.pi)
    for samples in (2, 91):
        with pytest.raises(SimulationError) as caught:
            model.simulate(method="gauss", samples=samples, steps=128)
        said = float(str(caught.value).partition("past ")[2].partition(" degrees")[0])
        assert locks - 0.3 < said <= locks + 0.05


def test_rigid_mass_follows_from_the_section():
    """A rod that tapers in thickness from 6 to 3 mm: mass, centre and inertia by integration."""
    text = changed([with_section('{ width = "20 mm", thickness = ["6 mm", "3 mm"] }')])
    link = resolve(symgen.Scene(**tomllib.loads(text))).link("coupler")
    x, l = sp.Symbol("x"), link.length
    mu = 7850 * sp.Rational(20, 1000) * (sp.Rational(6, 1000) - sp.Rational(3, 1000) * x / l)
    mass = sp.integrate(mu, (x, 0, l))
    centre = sp.integrate(mu * x, (x, 0, l)) / mass
    assert sp.simplify(link.mass - mass) == 0
    assert sp.simplify(link.centre - centre) == 0
    assert sp.simplify(link.inertia - sp.integrate(mu * (x - centre) ** 2, (x, 0, l))) == 0


def test_a_size_that_is_none_is_missing():
    data = read_scene("thesis_four_bar").data
    data["links"]["coupler"]["section"]["thickness"] = None
    with pytest.raises(SceneError, match=r"a section by its width needs this too"):
        resolve(symgen.Scene(**data))
