"""A link-joint table to a loop: what is read, what is counted, and every fault with its place."""

from __future__ import annotations

import copy
import json
import math

import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import symgen
from symgen.errors import SceneError
from symgen.joints import JOINTS
from symgen.scene.expressions import parse_value
from symgen.scene.loading import SceneText, check_scene, read_scene
from symgen.scene.resolve import resolve, resolve_linkage
from symgen.symbolic.constants import with_pi

GOOD = {
    "symgen": 1,
    "parameters": {
        "w": {"value": "3 rad/s", "tunable": True},
        "r": {"value": "10 cm", "tunable": True},
        "L": "45 cm",
        "J": "0.01 kg*m^2",
    },
    "loop": {
        "inputs": {"theta1": "w*t"},
        "rows": [
            {"joint": "R", "link": "crank", "theta": "theta1", "a": "r"},
            {"joint": "S", "link": "rod", "theta": "?", "eta": "?", "a": "L"},
            {"joint": "S", "link": "rocker", "theta": "?", "eta": "?", "alpha": "?", "a": "30 cm"},
            {"joint": "R", "link": "ground", "theta": "?", "S": "10 cm", "alpha": "60 deg", "a": "-35 cm"},
        ],
        "start": {"theta2": "10 deg"},
        "links": {
            "crank": {"mass": "1 kg", "centre": ["-r/2", 0, 0], "inertia": [0, "J", "J"]},
            "rod": {"mass": "1 kg", "centre": ["-L/2", 0, 0], "inertia": [0, "J", "J"]},
            "rocker": {"mass": "0 kg"},
        },
        "loads": [{"link": "rocker", "force": ["1 N", 0, 0], "at": [0, "1 cm", 0]}],
    },
}


def changed(*changes):
    """The good scene with values at dotted paths set, or removed where they are None."""
    data = copy.deepcopy(GOOD)
    for path, value in copy.deepcopy(changes):
        *inner, last = path.split(".")
        table = data
        for part in inner:
            table = table[int(part)] if isinstance(table, list) else table.setdefault(part, {})
        if isinstance(table, list):
            last = int(last)
        if value is None:
            del table[last]
        elif isinstance(table, list) and last == len(table):
            table.append(value)
        else:
            table[last] = value
    return data


def loop_of(*changes):
    return resolve(check_scene(SceneText("x", "x.toml", changed(*changes))))


def test_what_a_table_resolves_to():
    loop = loop_of(("units", {"length": "in", "force": "lbf", "angle": "deg"}))
    w, t, r = (sp.Symbol(name, real=True) for name in "wtr")
    assert [v.name for v in loop.variables] == [
        "theta1",
        "theta2",
        "eta2",
        "theta3",
        "eta3",
        "alpha3",
        "theta4",
    ]
    assert [v.role for v in loop.variables] == ["input"] + ["dependent"] * 6
    assert [v.row for v in loop.variables] == [0, 1, 1, 2, 2, 2, 3]
    first, second = loop.variables[:2]
    assert first.motion == w * t and first.effort is None and second.effort == 0
    assert (first.quantity.unit, first.rate.name, first.acceleration.unit) == (
        "rad",
        "theta1_rate",
        "rad/s^2",
    )
    assert loop.number(second.start) == pytest.approx(math.radians(10), rel=1e-15)
    assert loop.rows[0].a == r and loop.rows[1].alpha == 0 and loop.rows[3].alpha == sp.pi / 3
    assert loop.rows[3].link == "ground"
    assert [b.idle for b in loop.bodies] == [False, True, False]
    assert loop.bodies[1].row == 1 and loop.bodies[0].centre == (-r / 2, 0, 0)
    assert loop.span == (0, 2 * sp.pi) and loop.size == 0.45
    assert loop.units["length"] == ("in", 0.0254) and loop.units["angle"][0] == "deg"
    assert loop.units["force"] == ("lbf", 4.4482216152605)
    assert loop.units["angle"][1] == pytest.approx(math.pi / 180, rel=1e-16)
    assert loop.loads[0].row == 2 and not loop.loads[0].in_ground
    assert loop.gravity == (0, 0, 0) and loop.outputs is None


def test_inputs_follow_each_other_and_entries_are_linear_in_one():
    loop = loop_of(
        ("loop.inputs", {"phi": "w*t", "rise": "r*sin(2*phi)"}),
        (
            "loop.rows.0",
            {"joint": "C", "link": "crank", "theta": "phi - 90*deg", "S": "L - 2*rise", "a": "r"},
        ),
        ("parameters.deg", "1 deg"),
        ("loop.drives", {"phi": "2*w*J*phi.rate", "rise": "?", "theta4": "?"}),
    )
    w, t, r, phi, rise = (sp.Symbol(name, real=True) for name in ("w", "t", "r", "phi", "rise"))
    assert loop.variables[1].motion == r * sp.sin(2 * w * t)
    assert loop.rows[0].theta == phi - sp.pi / 2 and loop.rows[0].S - sp.Rational(9, 20) == -2 * rise
    assert loop.variables[0].effort == 2 * w * sp.Rational(1, 100) * sp.Symbol("phi_rate", real=True)
    assert [v.effort is None for v in loop.variables] == [False, True] + [False] * 5 + [True]


@pytest.mark.parametrize(
    "text, exact",
    [
        ("90 deg", sp.pi / 2),
        ("-270 deg", -3 * sp.pi / 2),
        ("0.25 rev", sp.pi / 2),
        ("22.5 deg", sp.pi / 8),
        ("1.5707963267948966", sp.Rational(15707963267948966, 10**16)),
        ("pi/2 + right", sp.pi),
        ("0.5 rad", sp.Rational(1, 2)),
        ("sin(right)", 1),
    ],
)
def test_angles_in_degrees_are_exact(text, exact):
    names = {"right": (parse_value("90 deg", {}), symgen.scene.units.NUMBER)}
    assert with_pi(parse_value(text, names)) == exact


def test_a_helical_joint_moves_by_its_pitch():
    loop = resolve(check_scene(read_scene("screw_jack")))
    lead, theta2 = sp.Symbol("lead", real=True), sp.Symbol("theta2", real=True)
    assert sp.expand(loop.rows[1].S + lead / (2 * sp.pi) * theta2) == 0
    assert loop.loads[0].in_ground


def test_free_variables_have_a_start_and_no_range():
    loop = resolve(check_scene(read_scene("cssp")))
    angle, slide = loop.having("free")
    assert loop.span is None and loop.number(angle.start) == pytest.approx(math.pi / 4)
    assert loop.number(slide.start) == 0.01 and slide.start_rate == 0
    assert loop.number(loop.t_end) == 2
    assert all(v.effort is not None for v in loop.variables)


def test_a_length_that_leads_needs_no_range_beside_a_free_variable():
    row = {"joint": "C", "link": "crank", "theta": "theta1", "S": "S1", "a": "r"}
    loop = loop_of(
        ("loop.inputs", {"S1": "r*w*t"}), ("loop.free.theta1", {"at": "1 deg"}), ("loop.rows.0", row)
    )
    assert loop.span is None and loop.lead == "S1"
    assert [v.effort is None for v in loop.variables[:2]] == [False, True]
    assert loop_of(*FREE).lead == ""


def test_the_first_input_written_leads_wherever_it_stands_in_the_rows():
    row = {"joint": "C", "link": "crank", "theta": "theta1", "S": "S1", "a": "r"}
    loop = loop_of(
        ("loop.inputs", {"S1": "r*w*t", "theta1": "S1/r"}), ("loop.rows.0", row), ("loop.range", ["0 cm", "r0"]),
        ("parameters.r0", "3 cm"),
    )  # fmt: skip
    assert [v.name for v in loop.having("input")] == ["theta1", "S1"]
    assert loop.lead == "S1" and loop.number(loop.span[1]) == 0.03


def test_a_guess_may_be_tunable():
    guess = loop_of(("loop.start.theta2", "r/L")).variables[1].start
    assert guess == sp.Symbol("r", real=True) / sp.Rational(9, 20)


def test_the_spin_of_a_link_between_balls_may_be_free():
    loop = loop_of(
        ("loop.rows.1.alpha", "spin"),
        ("loop.free", {"spin": {"at": "10 deg", "rate": "1 rad/s"}}),
        ("loop.links.rod.inertia", ["J", "J", "1.5*J"]),
        ("parameters.J2", "2 kg"),
    )
    assert loop.variables[3].role == "free" and not any(b.idle for b in loop.bodies)


def test_the_idle_spin_may_be_held_at_the_second_ball():
    loop = loop_of(("loop.rows.1.alpha", "?"), ("loop.rows.2.alpha", "20 deg"), ("loop.rows.2.theta", "?"))
    assert loop.body(1).idle and loop.rows[2].alpha == sp.pi / 9


def long(count):
    """The good loop with as many driven hinges before its rod, 6 dependent variables, and no guesses."""
    hinges = [{"joint": "R", "link": f"l{i}", "theta": f"turn{i}"} for i in range(count)]
    inputs = {f"turn{i}": "w*t" for i in range(count)}
    rows = [*hinges, *GOOD["loop"]["rows"][1:]]
    return [("loop.inputs", inputs), ("loop.rows", rows), ("loop.start", {}), ("loop.links", {})]


def test_a_loop_has_room_for_24_variables():
    assert len(loop_of(*long(18)).variables) == 24


#: What is changed in the good scene, where the fault is found, and what the message says.
ROW = "loop.rows."
FREE = [("loop.inputs", {}), ("loop.free.theta1", {"at": 0})]
MIXED = [
    ("loop.free.S1", {"at": "0 m"}),
    ("loop.rows.0", {"joint": "C", "link": "crank", "theta": "theta1", "S": "S1", "a": "r"}),
]
FOLDED = "depends on the tunable parameter {0}\n  It is folded: make {0} not tunable, or give a plain value."
TONNE = 't behind a number with a unit is the tonne: name the speed as a parameter and write "speed*t".'
FAULTS = {
    "no such joint": ([(ROW + "0.joint", "Q")], ROW + "0.joint", "no joint 'Q'\n  Known: R (revolute)"),
    "unknown link joint case": ([(ROW + "0.joint", "r")], ROW + "0.joint", "no joint 'r'"),
    "no ground": ([(ROW + "3.link", "base")], ROW + "3.link", "end on the ground, got 'base'"),
    "ground too soon": ([(ROW + "1.link", "ground")], ROW + "1.link", "only the last row ends on it"),
    "a link twice": ([(ROW + "2.link", "rod")], ROW + "2.link", "an earlier row ends on it"),
    "a freedom not said": ([(ROW + "0.theta", None)], ROW + "0.theta", "lets theta vary, got nothing"),
    "a freedom held": (
        [(ROW + "3.theta", "30 deg")],
        ROW + "3.theta",
        "a revolute joint lets theta vary, got the constant '30 deg'",
    ),
    "a joint with fewer freedoms": (
        [(ROW + "0", {"joint": "C", "link": "crank", "theta": "theta1", "S": "1 cm", "a": "r"})],
        ROW + "0.S",
        "With S constant it is a revolute joint, R.",
    ),
    "a freedom that is none": ([(ROW + "0.S", "?")], ROW + "0.S", "does not let S vary: expected a constant"),
    "an input where none is let": (
        [(ROW + "0.alpha", "theta1")],
        ROW + "0.alpha",
        "does not let alpha vary: expected a constant\n  It lets theta vary.",
    ),
    "a ball with an offset": ([(ROW + "1.S", "1 cm")], ROW + "1.S", "a ball joint has S = 0"),
    "a pitch of a hinge": ([(ROW + "0.pitch", "1 mm")], ROW + "0.pitch", "a revolute joint has no pitch"),
    "a screw without pitch": ([(ROW + "3.joint", "H")], ROW + "3.pitch", "a helical joint needs its pitch"),
    "wrong unit": ([(ROW + "0.a", "3 s")], ROW + "0.a", "expected a length such as"),
    "angle with a length": ([(ROW + "0.alpha", "3 cm")], ROW + "0.alpha", "expected a plain number or an angle"),
    "an unknown name": ([(ROW + "0.theta", "theta")], ROW + "0.theta", "unknown name 'theta'\n  Did you mean 'theta1'"),
    "time in a row": ([(ROW + "0.theta", "w*t")], ROW + "0.theta", "unknown name 't'"),
    "not linear": ([(ROW + "0.theta", "theta1*theta1")], ROW + "0.theta", "an entry is linear in its variable"),
    "without effect": ([(ROW + "0.theta", "theta1*(L/L - 1)")], ROW + "0.theta", "lets theta vary, got the constant"),
    "without effect at these parameters": (
        [(ROW + "0.theta", "theta1*(r/L - 2/9)")],
        ROW + "0.theta",
        "theta1 has no effect",
    ),
    "two in one entry": (
        [("loop.inputs.phi", "2*w*t"), (ROW + "0.theta", "theta1 + phi")],
        ROW + "0.theta",
        "an entry holds one variable",
    ),
    "in two rows": ([(ROW + "3.theta", "theta1")], "loop.inputs.theta1", "may occur in one row only, got rows 1 and 4"),
    "in no row": ([("loop.inputs.phi", "2*w*t")], "loop.inputs.phi", "no row holds the variable phi"),
    "nothing moves": ([("loop.inputs", {}), (ROW + "0.theta", "?")], "loop.inputs", "at least one input or free variable of the loop"),
    "input called like a row's": (
        [("loop.inputs", {"eta2": "w*t"}), (ROW + "0.theta", "eta2")],
        "loop.inputs.eta2",
        "another variable of the table",
    ),
    "input called like a parameter": ([("loop.inputs.w", "3*t")], "loop.inputs.w", "is a parameter already"),
    "input called t": ([("loop.inputs.t", "3")], "loop.inputs.t", "already has a meaning"),
    "input that stands still": ([("loop.inputs.theta1", "30 deg")], "loop.inputs.theta1", "depends on the time, got '30 deg'"),
    "input of another kind": ([("loop.inputs.theta1", "w")], "loop.inputs.theta1", "expected an angle or a length"),
    "input without acceleration": ([("loop.inputs.theta1", "abs(w*t)")], "loop.inputs.theta1", "rate jumps where"),
    "input by a later one": (
        [("loop.inputs", {"theta1": "2*phi", "phi": "w*t"})],
        "loop.inputs.theta1",
        "unknown name 'phi'",
    ),
    "input and free": ([("loop.free.theta1", {"at": 0})], "loop.free.theta1", "cannot be free as well"),
    "free with a length's rate": (
        [("loop.inputs", {}), ("loop.free.theta1", {"at": 0, "rate": "1 m/s"})],
        "loop.free.theta1.rate",
        "expected an angular velocity",
    ),
    "range without input": (
        [*FREE, ("loop.range", [0, 1])],
        "loop.range",
        "with theta1 free the motion runs by the time\n  Omit range",
    ),
    "range beside a free variable": (
        [*MIXED, ("loop.range", [0, 1])],
        "loop.range",
        "with S1 free the motion runs by the time",
    ),
    "range that goes down": (
        [("loop.range", ["1 rev", "30 deg"])],
        "loop.range",
        "expected a range with start before stop, got '1 rev' and '30 deg'",
    ),
    "tunable start": ([*FREE, ("loop.free.theta1.at", "r/L")], "loop.free.theta1.at", FOLDED.format("r")),
    "tunable rate": ([*FREE, ("loop.free.theta1.rate", "2*w")], "loop.free.theta1.rate", FOLDED.format("w")),
    "tunable range": ([("loop.range", ["0 deg", "r/L"])], "loop.range.1", FOLDED.format("r")),
    "range by another tunable one": (
        [("loop.range", ["half", 1]), ("parameters.half", "r/L/2")],
        "loop.range.0",
        FOLDED.format("r"),
    ),
    "tunable end": ([("analysis.t_end", "1/w")], "analysis.t_end", FOLDED.format("w")),
    "motion by a sum of forces to find": (
        [*FREE, ("loop.drives.theta1", "?")],
        "loop.drives.theta1",
        "where variables are free, the motion follows from the known efforts: only an input's drive can be "
        "found, and it always is; got '?'\n  Give the effort",
    ),
    "load to find in a free motion": (
        [*MIXED, ("loop.drives", {"theta1": "1 N*m", "S1": "?"})],
        "loop.drives.theta1",
        "got '1 N*m'\n  Write \"?\", or nothing.",
    ),
    "a free variable's drive to find": ([*MIXED, ("loop.drives.S1", "?")], "loop.drives.S1", "only an input's drive"),
    "time taken for tonnes": ([("loop.inputs.theta1", "6 rpm*t")], "loop.inputs.theta1", TONNE),
    "time taken for tonnes, in radians": ([("loop.inputs.theta1", "1 rad/s * t")], "loop.inputs.theta1", TONNE),
    "a torque by tonnes": ([("loop.drives.theta4", "3 N*m/s*t")], "loop.drives.theta4", TONNE),
    "too many variables": (long(19), "loop.rows", "expected at most 24 joint variables, got 25"),
    "no range of a length": (
        [
            ("loop.inputs", {"S1": "r*w*t"}),
            (ROW + "0", {"joint": "P", "link": "crank", "S": "S1", "a": "r"}),
        ],
        "loop.range",
        "the range of S1 is missing",
    ),
    "range of one value": ([("loop.range", ["30 deg", "30 deg"])], "loop.range", "got '30 deg' and '30 deg'"),
    "a length as range": ([("loop.range", ["30 deg", "30 cm"])], "loop.range.1", "got '30 cm', a length"),
    "idle spin": ([(ROW + "1.alpha", "?")], ROW + "1.alpha", "between two balls spins idly"),
    "too many": (
        [
            (ROW + "0", {"joint": "C", "link": "crank", "theta": "theta1", "S": "?", "a": "r"}),
        ],
        "loop.rows",
        "7 dependent variables for the 6 equations of closure: S1, theta2, eta2",
    ),
    "none left": (
        [
            ("loop.inputs", {"theta1": "w*t", "phi": "-w*t"}),
            ("loop.rows", [
                {"joint": "R", "link": "crank", "theta": "theta1"},
                {"joint": "R", "link": "ground", "theta": "phi"},
            ]),
            ("loop.links", {}),
            ("loop.start", {}),
            ("loop.loads", []),
        ],
        "loop.rows",
        "no variable follows from closure",
    ),
    "two balls in one": ([(ROW + "1.a", "r - 10*cm"), ("parameters.cm", "1 cm")], ROW + "1.a", "rod have the same centre"),
    "two constant angles of a ball": ([(ROW + "1.eta", "0 deg")], ROW + "1.eta", "lets eta vary, got the constant"),
    "both balls held": ([(ROW + "2.alpha", "0 deg")], ROW + "2.alpha", "only to hold the idle spin"),
    "a ball that is a Hooke joint": (
        [
            (ROW + "2", {"joint": "U", "link": "rocker", "theta": "?", "eta": "?", "a": "30 cm"}),
            (ROW + "3", {"joint": "C", "link": "ground", "theta": "?", "S": "?", "alpha": "60 deg", "a": "-35 cm"}),
        ],
        ROW + "1.alpha",
        "With alpha constant it is a universal joint, U.",
    ),
    "unknown drive": ([("loop.drives.theta9", 0)], "loop.drives.theta9", "no variable called 'theta9'"),
    "drive in the wrong unit": ([("loop.drives.theta4", "3 N")], "loop.drives.theta4", "expected a torque"),
    "too many unknown drives": ([("loop.drives.theta4", "?")], "loop.drives", "inputs, 1 (theta1), got 2 (theta1, theta4)"),
    "no unknown drive": ([("loop.drives.theta1", 0)], "loop.drives", "inputs, 1 (theta1), got 0 (none)"),
    "a drive of an idle ball": ([("loop.drives.theta2", "1 N*m")], "loop.drives.theta2", "no axes of a drive"),
    "a drive by an unknown state": (
        [("loop.drives.theta4", "J*theta4.speed*w")],
        "loop.drives.theta4",
        "unknown name 'theta4.speed'\n  Did you mean 'theta4.rate'",
    ),
    "a guess of an input": ([("loop.start.theta1", 0)], "loop.start.theta1", "needs no guess"),
    "an unknown guess": ([("loop.start.theta22", 0)], "loop.start.theta22", "no variable called 'theta22'"),
    "a guess in the wrong unit": ([("loop.start.theta2", "1 m")], "loop.start.theta2", "a length"),
    "unknown link": ([("loop.links.crnk", {"mass": "1 kg"})], "loop.links.crnk", "Did you mean 'crank'"),
    "mass of the ground": ([("loop.links.ground", {"mass": "1 kg"})], "loop.links.ground", "no moving link"),
    "negative mass": ([("loop.links.crank.mass", "-1 kg")], "loop.links.crank.mass", "at least zero"),
    "four moments": ([("loop.links.crank.inertia", [0, 0, 0, 0])], "loop.links.crank.inertia", "three or six"),
    "no real body": (
        [("loop.links.crank.inertia", ["3*J", "J", "J"])],
        "loop.links.crank.inertia",
        "no real body has these moments",
    ),
    "products too large": (
        [("loop.links.crank.inertia", ["J", "J", "J", "2*J", 0, 0])],
        "loop.links.crank.inertia",
        "no real body",
    ),
    "negative inertia": (
        [("loop.links.crank.inertia", ["-J", "-J", "-J"])],
        "loop.links.crank.inertia",
        "no real body",
    ),
    "idle link out of line": ([("loop.links.rod.centre.1", "1 mm")], "loop.links.rod.centre", "rotational symmetry about the line"),
    "idle link not round": ([("loop.links.rod.inertia", ["J", "J", "1.1*J"])], "loop.links.rod.inertia", "rotational symmetry about"),
    "idle link with a product": (
        [("loop.links.rod.inertia", ["J", "J", "J", 0, "J/5", 0])],
        "loop.links.rod.inertia",
        "rotational symmetry about",
    ),
    "idle only at these parameters": (
        [("loop.links.rod.centre.2", "r - L*2/9")],
        "loop.links.rod.centre",
        "rotational symmetry about",
    ),
    "couple on an idle link": (
        [("loop.loads.1", {"link": "rod", "torque": ["1 N*m", 0, 0]})],
        "loop.loads.1.torque",
        "rod spins idly",
    ),
    "force beside an idle link": (
        [("loop.loads.1", {"link": "rod", "force": ["1 N", 0, 0], "at": [0, "1 mm", 0]})],
        "loop.loads.1.at",
        "rod spins idly",
    ),
    "force across an idle link": (
        [("loop.loads.1", {"link": "rod", "force": [0, "1 N", 0]})],
        "loop.loads.1.force",
        'frame = "ground" for a force across',
    ),
    "load on nothing": ([("loop.loads.0.link", "ground")], "loop.loads.0.link", "no moving link called 'ground'"),
    "empty load": ([("loop.loads.0", {"link": "crank"})], "loop.loads.0", "a force, a torque, or both"),
    "a couple at a point": (
        [("loop.loads.0", {"link": "crank", "torque": [0, 0, "1 N*m"], "at": [0, 0, "1 m"]})],
        "loop.loads.0.at",
        "only a force acts at a point",
    ),
    "gravity in the plane": ([("gravity", {"acceleration": [0, "-9.81 m/s^2"]})], "gravity.acceleration", "3 components"),
    "unit of another kind": ([("units", {"length": "lbf"})], "units.length", "the unit of a length"),
    "no unit": ([("units", {"force": "2 N"})], "units.force", "expected a unit such as 'kN'"),
    "no stress": ([("units", {"stress": "N"})], "units.stress", "the unit of a stress"),
    "power in units of force and length": (
        [("units", {"power": "kN*mm"})],
        "units.power",
        "the unit of a power",
    ),
    "units of the loop": ([("loop.units", {"angle": "deg"})], "loop.units", "[units]"),
    "no angle": ([("units", {"angle": "degree"})], "units.angle", "expected rad, deg or rev, got 'degree'"),
    "link called like a variable": ([(ROW + "1.link", "eta3")], ROW + "1.link", "is a variable of the loop"),
    "parameter called like a variable": ([("parameters.eta2", 3)], "parameters.eta2", "is a variable of the loop"),
    "parameter called like a rate": (
        [("parameters.eta2_rate", {"value": 3, "tunable": True})],
        "parameters.eta2_rate",
        "a quantity of the loop",
    ),
    "parameter called like a force": (
        [("parameters.closing_fx", {"value": 3, "tunable": True})],
        "parameters.closing_fx",
        "a quantity of the loop",
    ),
    "tolerance": ([("analysis.assembly_tolerance", "1 mm")], "analysis.assembly_tolerance", "at most 0.00045 m"),
    "no end": ([("analysis.t_end", "0 s")], "analysis.t_end", "above zero"),
    "infinite length": ([(ROW + "0.a", "r/(r - 10*cm)"), ("parameters.cm", "1 cm")], ROW + "0.a", ""),
    "no finite length": ([(ROW + "0.a", "1e999 m")], ROW + "0.a", "double precision"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_one_clear_error(name):
    changes, where, says = FAULTS[name]
    with pytest.raises(SceneError) as caught:
        loop_of(*changes)
    assert caught.value.where == where
    assert says in str(caught.value)
    assert str(caught.value).startswith("x.toml: [")


def test_what_is_not_there_for_loops_says_so():
    with pytest.raises(SceneError, match="expected a scene of points and links, got a loop"):
        resolve_linkage(symgen.load_scene("bennett"))


LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.floats(),
    st.sampled_from([
        "?", "", "theta1", "theta2", "2*theta1 - pi", "theta1**2", "theta1*theta2", "theta1.rate", "t", "w*t", "r",
        "90 deg", "3 cm", "-3 cm", "0 m", "1 kg", "-1 kg", "3 N", "1e308 m", "1e-320 m", "ground", "crank", "rod",
        "rocker", *JOINTS, "link", "deg", "exp(1000*t)", "sqrt(-t)", "1/t", "open('x')", "nan", "\x00", "((((",
    ]),
    st.text(max_size=6),
    st.sampled_from([[], {}, [0, 0, 0], [0, 0, "1 N"], {"at": "1 deg"}, {"mass": "0 kg"}, ["J", "J", "J"]]),
)  # fmt: skip


def places(data, at=()):
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield (*at, key)
        if isinstance(value, dict | list):
            yield from places(value, (*at, key))


@settings(max_examples=150, deadline=5000, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_a_mutated_loop_is_a_loop_or_a_scene_error(data):
    """Any values of a loop replaced by nonsense, or by another's sense, removed or renamed."""
    tables = json.loads(json.dumps(GOOD))
    for _ in range(data.draw(st.integers(1, 4))):
        path = data.draw(st.sampled_from(sorted(places(tables), key=str)))
        table = tables
        for part in path[:-1]:
            table = table[part]
        action = data.draw(st.sampled_from(["set", "set", "delete", "rename", "twice"]))
        if action == "delete":
            del table[path[-1]]
        elif action == "rename" and isinstance(table, dict):
            table[data.draw(st.sampled_from(["theta1", "S", "free", "rod", "spin", "loads"]))] = table.pop(
                path[-1]
            )
        elif action == "twice" and isinstance(table, list):
            table.append(copy.deepcopy(table[path[-1]]))
        else:
            table[path[-1]] = copy.deepcopy(data.draw(LEAVES))
    try:
        loop = resolve(check_scene(SceneText("mutated", "mutated.toml", tables)))
    except SceneError as error:
        assert str(error).startswith("mutated.toml: ")
        assert error.problem
        return
    assert loop.rows[-1].link == "ground"
    assert 1 <= len(loop.having("dependent")) <= 6
