"""The motion of a planar four-bar in closed form as a building block, for inspection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import sympy as sp

from symgen.mechanics.loop import four_bar
from symgen.mechanics.loop.four_bar import Angles, Lengths
from symgen.mechanics.rods.particles import Vector
from symgen.mechanics.sources import FOUR_BAR
from symgen.mechanics.synthesis.points import freudenstein
from symgen.symbolic.calculus import Calculus
from symgen.symbolic.quantity import AXES, quantity
from symgen.symbolic.system import Definition, Export, Group, NamedMatrix, System

REFERENCE = "The thesis on kineto-elastodynamics, Chapter IV, Eqs. (4.17)-(4.51)"
_LINKS = ("crank", "coupler", "output link")
_MOTION = (("", "rad", "angle"), ("_rate", "rad/s", "angular velocity"),
           ("_acceleration", "rad/s^2", "angular acceleration"))  # fmt: skip
_MOVED = ("angles", "angular_velocities", "angular_accelerations")


def four_bar_motion_system() -> System:
    """Return the System of a four-bar whose crank is at a given angle, with given rate and acceleration."""
    sizes = [quantity(x, "m", f"length of the {link}") for x, link in zip("abc", _LINKS, strict=True)]
    sizes.append(quantity("d", "m", "distance of the ground points"))
    branch = quantity("branch", "1", "assembly branch: -1 or 1, the sign of the root")
    q, u, w = (
        [quantity(f"theta{k}{end}", unit, f"{noun} of the {link}") for k, link in enumerate(_LINKS, 1)]
        for end, unit, noun in _MOTION
    )
    lengths, angles = Lengths(*(x.symbol for x in sizes)), Angles(*(x.symbol for x in q))
    second = Angles(*(x.symbol for x in w))
    calculus = Calculus(q, u, sp.Symbol("t", real=True))

    k1, k2, k3 = four_bar.output_ratios(lengths, angles)
    _, k4, k5 = four_bar.coupler_ratios(lengths, angles)
    ratios = _lettered("K", 1, (k1, k2, k3, -k4, k5), "ratio of lengths")
    k1, k2, k3, k4, k5 = _letters(ratios)
    of_coupler, of_output = (k1, -k4, k5), (k1, k2, k3)
    k9, _, k10 = four_bar.half_angle_coefficients(of_coupler, angles.crank)
    halves = (*four_bar.half_angle_coefficients(of_output, angles.crank), k9, k10)
    quadratics = _lettered("K", 6, halves, "coefficient of a quadratic of tan(angle/2)")
    k6, k7, k8, k9, k10 = _letters(quadratics)
    roots = [four_bar.angle_of(x, branch.symbol) for x in ((k9, k7, k10), (k6, k7, k8))]
    terms = four_bar.acceleration_terms(lengths, angles, second.crank, calculus)
    closing = _lettered(
        "H", 1, terms, "term of the second rate of the closure", ("m/s^2", "m", "m", "m/s^2", "m", "m")
    )
    found = [
        [Definition(x, e) for x, e in zip(quantities[1:], expressions, strict=True)]
        for quantities, expressions in (
            (q, roots),
            (u, four_bar.rates(lengths, angles, calculus)),
            (w, four_bar.accelerations(_letters(closing))),
        )
    ]
    nodes = _nodes(lengths, angles)
    known: dict[sp.Symbol, sp.Expr] = {}
    for x in chain.from_iterable(nodes.values()):
        known[x.quantity.symbol] = x.expression.xreplace(known)
    pairs = enumerate(pairwise(_letters(nodes[name]) for name in "MABQ"), 1)
    centres = {f"G{k}": four_bar.middle(*pair) for k, pair in pairs}
    places = {name: _letters(nodes[name]) for name in "AB"} | centres
    moved = {
        name: tuple(four_bar.accelerated(x.xreplace(known), angles, second, calculus) for x in place)
        for name, place in places.items()
    }
    matrices = (
        _column("closure", "end of the coupler less that of the output link, zero",
                dict(zip(AXES, four_bar.closure(lengths, angles), strict=False)), "m"),
        _column("freudenstein", "equation of the angle of each link and that of the crank, zero",
                {"coupler": freudenstein(of_coupler, angles.crank, angles.coupler),
                 "output": freudenstein(of_output, angles.crank, angles.output)}, "1"),
        _defined("ratios", "ratios of the lengths", ratios),
        _defined("half_angle_coefficients", "of K6 x^2 + K7 x + K8 = 0, x = tan(theta3/2), and of"
                 " K9 x^2 + K7 x + K10 = 0, x = tan(theta2/2)", quadratics),
        *(
            _defined(name, f"{name.replace('_', ' ')} of coupler and output link", definitions)
            for name, definitions in zip(_MOVED, found, strict=True)
        ),
        _defined("acceleration_terms", "terms of the second rate of the closure", closing),
        _defined("joints", "positions of the joints A and B", [*nodes["A"], *nodes["B"]]),
        _column("centres", "centres of mass of crank, coupler and output link, each at mid-length",
                _components(centres), "m"),
        _column("point_accelerations", "accelerations of joints and centres of mass", _components(moved),
                "m/s^2"),
    )  # fmt: skip
    return System(
        name="four_bar_motion",
        title="Motion of a planar four-bar in closed form",
        groups=(
            Group("q", "angle of the crank", (q[0],)),
            Group("u", "angular velocity and acceleration of the crank", (u[0], w[0])),
            Group("p", "lengths and branch", (*sizes, branch)),
        ),
        matrices=matrices,
        exports=(Export("motion", "angles, angular velocities and accelerations", _MOVED),),
        definitions=(
            *ratios,
            *quadratics,
            *found[0],
            *found[1],
            *closing,
            *found[2],
            *chain(*nodes.values()),
        ),
        references=(REFERENCE,),
        sources=FOUR_BAR,
    )


def _nodes(lengths: Lengths, angles: Angles) -> dict[str, list[Definition]]:
    """Return the positions of the nodes of the thesis by name: ground points M and Q, joints A and B."""

    def named(name: str, about: str, at: Vector) -> list[Definition]:
        components = zip(AXES, at, strict=False)
        return [
            Definition(quantity(f"{name}_{k}", "m", f"{k} position of {about}"), x) for k, x in components
        ]

    start, end = four_bar.ground(lengths)
    ground = named("Q", "Q, the ground point of the output link", end)
    return {
        "M": named("M", "M, the ground point of the crank", start),
        "Q": ground,
        "A": named("A", "A, the joint of crank and coupler", four_bar.place(start, lengths.a, angles.crank)),
        "B": named(
            "B",
            "B, the joint of coupler and output link",
            four_bar.place(_letters(ground), lengths.c, angles.output),
        ),
    }


def _components(points: Mapping[str, Vector]) -> dict[str, sp.Expr]:
    named = ({f"{name}_{axis}": x for axis, x in zip(AXES, at, strict=False)} for name, at in points.items())
    return dict(chain.from_iterable(x.items() for x in named))


def _column(name: str, about: str, entries: Mapping[str, sp.Expr], unit: str) -> NamedMatrix:
    """Return the column of entries by row."""
    column = sp.ImmutableMatrix(len(entries), 1, [*entries.values()])
    return NamedMatrix(name, column, unit, about, tuple(entries))


def _defined(name: str, about: str, definitions: Sequence[Definition]) -> NamedMatrix:
    """Return the column of defined letters."""
    units = [d.quantity.unit for d in definitions]
    unit = units[0] if len({*units}) == 1 else ", ".join(units)
    column = _column(name, about, {d.quantity.name: d.expression for d in definitions}, unit)
    return replace(column, left=sp.ImmutableMatrix(_letters(definitions)))


def _lettered(
    letter: str, first: int, expressions: Sequence[sp.Expr], about: str, units: Sequence[str] = ()
) -> list[Definition]:
    """Return numbered letters of the expressions, without units unless these are given."""
    units = units or ["1"] * len(expressions)
    numbered = enumerate(zip(expressions, units, strict=True), first)
    return [Definition(quantity(f"{letter}{k}", unit, about), e) for k, (e, unit) in numbered]


def _letters(definitions: Sequence[Definition]) -> tuple[sp.Symbol, ...]:
    return tuple(d.quantity.symbol for d in definitions)
