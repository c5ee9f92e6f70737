"""Loops for the tests of the derivation, without scene files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from symgen.scene.loop.loop import ENTRIES, JointVariable, Loop, LoopBody, LoopLoad, Row
from symgen.scene.rods.linkage import TIME
from symgen.scene.rods.run_parameters import Parameter
from symgen.symbolic.quantity import quantity

ZERO = sp.Integer(0)
R = sp.Rational


def variable(
    name: str, row: int, role: str, unit: str, motion=ZERO, effort=ZERO, start=ZERO
) -> JointVariable:
    return JointVariable(
        quantity(name, unit, f"variable {name}"),
        quantity(f"{name}_rate", f"{unit}/s", f"rate of {name}"),
        quantity(f"{name}_acceleration", f"{unit}/s^2", f"acceleration of {name}"),
        row,
        role,
        sp.sympify(motion),
        sp.sympify(start),
        ZERO,
        effort,
    )


def body(link: str, row: int, mass, centre=(0, 0, 0), inertia=(0, 0, 0), products=(0, 0, 0), idle=False):
    xx, yy, zz = (sp.sympify(x) for x in inertia)
    xy, xz, yz = (sp.sympify(x) for x in products)
    return LoopBody(
        link,
        row,
        sp.sympify(mass),
        tuple(sp.sympify(x) for x in centre),
        ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)),
        idle,
    )


def load(name, link, row, force=(0, 0, 0), at=(0, 0, 0), torque=(0, 0, 0), in_ground=False):
    return LoopLoad(name, link, row, *(tuple(map(sp.sympify, v)) for v in (at, force, torque)), in_ground)


def loop(
    name: str,
    rows: Sequence[tuple[str, str, Mapping[str, object]]],
    variables: Sequence[tuple],
    *,
    parameters: Mapping[str, tuple[str, object]] | None = None,
    bodies: Sequence[LoopBody] = (),
    loads: Sequence[LoopLoad] = (),
    gravity: Sequence[object] = (0, 0, 0),
    outputs: Sequence[str] | None = None,
) -> Loop:
    """Make a loop; the entries of a row by name, with symbols by :func:`sp.Symbol` of their names."""
    tuned = tuple(
        Parameter(quantity(n, unit, f"parameter {n}"), sp.sympify(v))
        for n, (unit, v) in (parameters or {}).items()
    )
    made = tuple(
        Row(joint, link, **{e: real(entries.get(e, 0)) for e in ENTRIES}) for joint, link, entries in rows
    )
    return Loop(
        name=name, file="", title=name, parameters=tuned, rows=made,
        variables=tuple(variable(*v) for v in variables), bodies=tuple(bodies),
        gravity=tuple(sp.sympify(g) for g in gravity), loads=tuple(loads), span=(ZERO, 2 * sp.pi),
        lead=next((v[0] for v in variables if v[2] == "input"), ""),
        t_end=sp.Integer(1), size=1.0, units={},
        outputs=None if outputs is None else tuple(outputs),
    )  # fmt: skip


def real(text: object) -> sp.Expr:
    """Read an expression, every name a real symbol."""
    found = sp.sympify(text)
    return found.xreplace({s: sp.Symbol(s.name, real=True) for s in found.free_symbols})


T = TIME.symbol
#: Numbers of the golden file in its own units: inch, lbf, second.
A1, A2, GRAVITY, DENSITY = R(12), R(50), R("386.4"), R("0.28")
OMEGA = 50 * 2 * sp.pi / 60


def bar(link: str, row: int, radius, length, idle=False):
    """A round bar from joint to joint."""
    mass = sp.pi * radius**2 * length * DENSITY / GRAVITY
    across = mass * (radius**2 / 4 + length**2 / 12)
    return body(link, row, mass, (-length / 2, 0, 0), (mass * radius**2 / 2, across, across), idle=idle)


def slider_crank(load_given: bool = True, fixed: Mapping[str, object] | None = None, **options) -> Loop:
    """The generalized slider-crank of the golden file; ``fixed`` folds tunable parameters."""
    parameters = {"a4": ("m", 30), "alpha4": ("rad", 5), "stroke": ("m", R(7, 2)), "ratio": ("1", 2)}
    fixed = fixed or {}
    a4, alpha4, stroke, ratio = (sp.sympify(fixed.get(n, real(n))) for n in parameters)
    slider = 27 * DENSITY / GRAVITY
    return loop(
        "slider_crank",
        [
            ("C", "crank", {"theta": "theta1", "S": "S1", "a": A1}),
            ("S", "rod", {"theta": "theta2", "eta": "eta2", "a": A2}),
            ("S", "slider", {"theta": "theta3", "eta": "eta3", "alpha": "alpha3"}),
            ("P", "ground", {"S": "S4", "alpha": alpha4, "a": a4}),
        ],
        [
            ("theta1", 0, "input", "rad", OMEGA * T, None if load_given else R(100)),
            ("S1", 0, "input", "m", stroke * sp.sin(ratio * OMEGA * T), None),
            *((n, i, "dependent", "rad", ZERO, ZERO) for n, i in (("theta2", 1), ("eta2", 1))),
            *((n, 2, "dependent", "rad", ZERO, ZERO) for n in ("theta3", "eta3", "alpha3")),
            ("S4", 3, "dependent", "m", ZERO, ZERO if load_given else None),
        ],
        parameters={n: x for n, x in parameters.items() if n not in fixed},
        bodies=[
            bar("crank", 0, R(3, 2), A1),
            bar("rod", 1, R(1), A2, idle=True),
            body("slider", 2, slider, inertia=(slider * R(3, 2),) * 3),
        ],
        **options,
    )


def planar_4r(**options) -> Loop:
    """A planar four-bar with hinges, of bars; it is its own crank-rocker."""
    links = zip(("crank", "coupler", "rocker", "ground"), (2, 5, 4, 6), strict=True)
    rows = [("R", link, {"theta": f"theta{i}", "a": R(a)}) for i, (link, a) in enumerate(links, 1)]
    return loop(
        "planar_4r",
        rows,
        [
            ("theta1", 0, "input", "rad", 5 * T, None),
            *((f"theta{i}", i - 1, "dependent", "rad", ZERO, ZERO) for i in (2, 3, 4)),
        ],
        bodies=[body(row[1], i, R(1), (-R(1, 2), 0, 0), (R(1, 10),) * 3) for i, row in enumerate(rows[:3])],
        **options,
    )


def screw_jack(**options) -> Loop:
    """A nut turned by a hinge drives a slider by a screw, all on skew parallel lines."""
    return loop(
        "screw_jack",
        [
            ("R", "nut", {"theta": "theta1", "S": R(1, 10), "alpha": real("tilt"), "a": R(1, 5)}),
            ("H", "spindle", {"theta": "theta2", "S": real("pitch*theta2 + 1/20"), "alpha": R(1, 3) * sp.pi}),
            ("C", "ground", {"theta": "theta3", "S": "S3", "alpha": -real("tilt"), "a": R(1, 7)}),
        ],
        [
            ("theta1", 0, "input", "rad", 3 * T + T**2, None),
            ("theta2", 1, "dependent", "rad", ZERO, ZERO),
            ("theta3", 2, "dependent", "rad", ZERO, R(-1, 8)),
            ("S3", 2, "dependent", "m", ZERO, -20 * real("S3_rate") + sp.cos(T)),
        ],
        parameters={"tilt": ("rad", R(1, 4)), "pitch": ("m/rad", R(1, 50))},
        bodies=[
            body(
                "nut", 0, 2, (R(1, 30), R(-1, 20), R(1, 9)), (R(1, 40), R(1, 30), R(1, 25)), (R(1, 300), 0, 0)
            ),
            body("spindle", 1, R(3, 2), (0, 0, R(1, 4)), (R(1, 60), R(1, 50), R(1, 90))),
        ],
        gravity=(0, R(-981, 100), R(1, 3)),
        **options,
    )


def hooke_loop(**options) -> Loop:
    """Two Hooke joints, a hinge and a free crank, with loads in both frames and a variable in two rows."""
    crank, two = real("theta1"), real("theta4")
    return loop(
        "hooke_loop",
        [
            ("R", "crank", {"theta": -crank + R(1, 5), "S": R(1, 10), "alpha": R(1, 2) * sp.pi, "a": R(1, 4)}),
            ("U", "rod", {"theta": "theta2", "eta": "eta2", "a": R(3, 4)}),
            ("U", "arm", {"theta": "theta3", "eta": "eta3", "alpha": R(1, 6) * sp.pi, "a": real("reach")}),
            ("C", "ground", {"theta": 2 * two, "S": real("S4 + 1/10"), "eta": R(1, 9), "alpha": two, "a": R(1, 3)}),
        ],
        [
            ("theta1", 0, "free", "rad", ZERO, -real("theta1_rate") / 3),
            *((n, i, "dependent", "rad", ZERO, ZERO) for n, i in (("theta2", 1), ("eta2", 1))),
            *((n, i, "dependent", "rad", ZERO, ZERO) for n, i in (("theta3", 2), ("eta3", 2), ("theta4", 3))),
            ("S4", 3, "dependent", "m", ZERO, ZERO),
        ],
        parameters={"reach": ("m", R(1, 2))},
        bodies=[
            body("crank", 0, R(1, 2), (R(-1, 8), 0, 0), (R(1, 100), R(1, 90), R(1, 95))),
            body("rod", 1, R(6, 5), (R(-1, 3), R(1, 40), 0), (R(1, 80), R(1, 20), R(1, 22)), (0, R(1, 500), 0)),
            body("arm", 2, 0),
        ],
        loads=[
            load("push", "rod", 1, (real("t"), -3, real("theta2_rate")), (R(1, 5), 0, R(1, 9)), (0, R(1, 2), 0)),
            load("wind", "arm", 2, (2, 0, real("sin(theta3)")), (0, R(1, 6), 0), (R(1, 4), 0, 1), in_ground=True),
        ],
        gravity=(0, 0, R(-981, 100)),
        **options,
    )  # fmt: skip


LOOPS = {
    "slider_crank": slider_crank,
    "load_found": lambda **options: slider_crank(False, **options),
    "planar_4r": planar_4r,
    "screw_jack": screw_jack,
    "hooke_loop": hooke_loop,
}
