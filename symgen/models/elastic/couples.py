"""Couples on sections of elastic links, by their rotations from the rigid motion."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping

import sympy as sp

from symgen.loads.load import Load
from symgen.loads.measure import RATE, RATES, VALUE, VALUES, LoadTerm
from symgen.mechanics.elastic.shaft import ROTATION, couple
from symgen.models.rods.linkage import RodsModel
from symgen.scene.rods.linkage import Linkage, WeldedAngle, state_of, state_symbol

Renaming = Callable[[sp.Expr], sp.Expr]
Couple = tuple[Load, LoadTerm, tuple[str, ...]]


def couples(linkage: Linkage) -> Iterator[Couple]:
    """Yield load, term and rotations of each couple on elastic links: of its link, then of the other one."""
    welded = {(beam.link, point) for beam in linkage.elastic for point in beam.welds}
    for load in linkage.loads:
        for term in load.terms(linkage.dimension):
            if term.on.section and term.total:
                links = [name for _, name in term.on.links if name]
                at = term.on.section
                yield load, term, tuple(at if (k, at) in welded else f"{k}.{at}" for k in links)


def read_by(linkage: Linkage, acting: Couple) -> tuple[str, ...]:
    """Return the points that the law of a couple reads, "" for the rotation of its sections among them."""
    load, term, _ = acting
    (torque,) = term.total
    own = {load.name, *(name for _, name in term.on.links)}
    owners = dict.fromkeys(str(s.name).partition(".")[0] for s in state_of(torque))
    points = [""] if torque.has(*VALUES, *RATES) or own.intersection(owners) else []
    ends = {link.name: (link.start, link.end) for link in linkage.links}
    for owner in (name for name in owners if name not in own):
        measure = linkage.measure(owner)
        points += (point for _, point in measure.points) if measure else ends.get(owner, (owner,))
    return tuple(dict.fromkeys(points))


def rotations(linkage: Linkage) -> tuple[str, ...]:
    """Return the rotations of sections on which couples act, or that are welded to rigid links, each once."""
    acted = (name for *_, names in couples(linkage) for name in names)
    return tuple(dict.fromkeys((*acted, *(angle.point for angle in welded_to_bodies(linkage)))))


def welded_to_bodies(linkage: Linkage) -> Iterator[WeldedAngle]:
    """Yield one kept angle of every point with elastic links welded to a rigid one, its ``other``."""
    beams, seen = {beam.link for beam in linkage.elastic}, set[str]()
    for angle in linkage.welded_angles:
        if angle.other and angle.other not in beams and angle.point not in seen:
            seen.add(angle.point)
            yield angle


def with_bodies(model: RodsModel, angle: WeldedAngle) -> dict[sp.Symbol, sp.Expr]:
    """Return the row n.dd - l phi = 0 by coordinate and rotation: a section rotates with a rigid link.

    n is the vector across the rigid link in its rigid motion, l its length, d the vector along it. The row
    has no terms of second order: n.(d + dd) = l sin(phi).
    """
    d, length = model.along[angle.other], model.linkage.link(angle.other).length
    values: dict[sp.Symbol, sp.Expr] = {sp.Symbol(f"{angle.point}_theta"): -length}
    for n, along in zip((-d[1], d[0]), d, strict=True):
        for q, slope in model.calculus.gradient(along).items():
            values[q] = values.get(q, sp.S.Zero) + n * slope / length
    return values


def entries(model: RodsModel, linkage: Linkage) -> Mapping[str, list[tuple[str, sp.Expr]]]:
    """Return entries of ``damping``, ``stiffness`` and ``load`` of the rotations, each after its label.

    Those of ``load`` are one for every rotation. ``model`` gives the rigid motion.
    """
    load = {name: sp.Integer(0) for name in rotations(linkage)}
    by_matrix: dict[str, list[tuple[str, sp.Expr]]] = {"damping": [], "stiffness": []}
    for acting in couples(linkage):
        signed = list(zip(acting[2], (1, -1), strict=False))
        *slopes, torque = _terms(model, linkage, acting)
        for name, sign in signed:
            load[name] += sign * torque
        pairs = [(a, b, s * r) for a, s in signed for b, r in signed]
        for block, slope in zip(by_matrix.values(), slopes, strict=True):
            block += [(f"{a}_theta {b}_theta", sign * slope) for a, b, sign in pairs if slope != 0]
    return by_matrix | {"load": [(f"{name}_theta", torque) for name, torque in load.items()]}


def _terms(model: RodsModel, linkage: Linkage, acting: Couple) -> list[sp.Expr]:
    """Return damping, stiffness and load of a couple."""
    load, term, _ = acting
    hidden, shown = apart(linkage, ROTATION)
    load_state = {state_symbol(f"{load.name}.angle"): VALUE, state_symbol(f"{load.name}.rate"): RATE}
    (torque,) = term.total
    force_and_slopes = couple(hidden(torque.xreplace(load_state)), VALUE, RATE)
    entries_of_links = term.on.put(model.loads, [shown(e) for e in force_and_slopes])
    return list(model.loads.with_state(entries_of_links))


def apart(linkage: Linkage, unknowns: Container[sp.Symbol]) -> tuple[Renaming, Renaming]:
    """Return a function that renames parameters that are among symbols of links, and the one back."""
    shared = [p.quantity.symbol for p in linkage.parameters if p.quantity.symbol in unknowns]
    away = {s: sp.Symbol(f"{s.name} of the scene", **s.assumptions0) for s in shared}
    back = {other: s for s, other in away.items()}
    return lambda e: sp.sympify(e).xreplace(away), lambda e: sp.sympify(e).xreplace(back)
