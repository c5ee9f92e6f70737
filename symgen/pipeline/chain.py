"""Open chains and trees of rods in scenes, solved by the recursion of :class:`symgen.Chain`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import SceneError
from symgen.runtime.chain.chain import Chain
from symgen.scene.loading import SceneText, check_scene, override, text_of
from symgen.scene.rods.linkage import TIME, Linkage, RigidLink

if TYPE_CHECKING:
    from symgen.scene.schema import Scene

Array = NDArray[np.float64]

#: The part of its product with the length of a rod by which a velocity may lengthen it.
_ALONG = 1e-9


@dataclass(frozen=True, slots=True)
class ChainOfScene:
    """A chain with its start, as drawn.

    ``points`` and ``links`` are the names of the points and rods of ``chain``, in its order; ``positions``
    and ``velocities`` the start (points, axes) [m, m/s]; ``t_end`` the end of the analysis of the scene [s].
    """

    chain: Chain
    points: tuple[str, ...]
    links: tuple[str, ...]
    positions: Array
    velocities: Array
    t_end: float


@checked
def build_chain(
    scene: Scene | SceneText | str | os.PathLike[str], *, set: Mapping[str, Any] | None = None
) -> ChainOfScene:
    """Return the chain or tree of rods of a scene, of any number of rods, without derivation and compilation.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or a :class:`symgen.Scene`: links with two points that
        branch from one ground point, or none; masses at points; gravity; rates of links and velocities of
        points at the start, of all or of none.
    set
        Values to replace, as in ``symgen.load_scene``.

    Raises
    ------
    SceneError
        For a fault of the scene, closed loops, and entries that chains do not have, by their keys.
    """
    from symgen.scene.resolve import resolve_linkage

    text = text_of(scene)
    text = override(text, set or {})
    linkage = resolve_linkage(check_scene(text)).as_written
    try:
        return _chain(linkage)
    except SceneError as error:
        raise error.located(file=linkage.file) from None


def _chain(linkage: Linkage) -> ChainOfScene:
    for key in _foreign(linkage):
        raise SceneError(
            "a chain has links of two points with their drawn lengths, masses, gravity and a start, "
            "and nothing else",
            where=key,
            hint="symgen.build derives the equations of this scene.",
        )
    number = linkage.number
    order, rods = _outward(linkage)
    places = {name: i for i, name in enumerate(order)}
    at = {p.name: [number(c) for c in p.at] for p in linkage.points}
    turned = [k.start != inner for inner, k in rods]
    lengths = np.array([number(k.length) for _, k in rods])
    centres = np.array([number(k.centre) for _, k in rods])
    point_masses = np.zeros(len(order))
    for mass in linkage.masses:
        point_masses[places[mass.point]] += number(mass.mass)
    positions = np.array([at[name] for name in order])
    chain = Chain(
        lengths,
        [number(k.mass) for _, k in rods],
        centres=np.where(turned, lengths - centres, centres),
        inertias=[number(k.inertia) for _, k in rods],
        parents=[places[inner] for inner, _ in rods],
        point_masses=point_masses,
        pinned=any(p.ground for p in linkage.points),
        gravity=[number(c) for c in linkage.gravity],
    )
    velocities = _velocities(linkage, order, rods, positions)
    names = tuple(k.name for _, k in rods)
    return ChainOfScene(chain, tuple(order), names, positions, velocities, number(linkage.t_end))


def _foreign(linkage: Linkage) -> Iterator[str]:
    """Yield the keys of the entries that a chain does not have."""
    yield from (table for table, _, load in linkage.placed_loads if load.acts)
    for key in ("guides", "drivers", "motions", "hinges", "elastic", "events", "switches", "windings"):
        if getattr(linkage, key):
            yield key
    yield from (f"links.{body.name}" for body in linkage.bodies)
    if linkage.start.angles:
        yield "start.angles"
    if linkage.start.equilibrium:
        yield "start.equilibrium"
    for link in linkage.links:
        if not link.as_drawn or TIME.symbol in link.length.free_symbols:
            yield f"links.{link.name}.length"
        if link.carried or link.offset != 0:
            yield f"links.{link.name}"
    moving = (p for p in linkage.points if p.ground and p.motion != p.at)
    yield from (f"points.{p.name}.motion" for p in moving)


def _outward(linkage: Linkage) -> tuple[list[str], list[tuple[str, RigidLink]]]:
    """Return the points from the base outwards, and for each but the base its rod with the inner point."""
    ground = [p.name for p in linkage.points if p.ground]
    if len(ground) > 1:
        raise SceneError(
            f"a chain has one ground point at most, got {', '.join(ground[:3])}", where=f"points.{ground[1]}"
        )
    at: dict[str, list[RigidLink]] = {p.name: [] for p in linkage.points}
    for link in linkage.links:
        at[link.start].append(link)
        at[link.end].append(link)
    order = [ground[0] if ground else linkage.points[0].name]
    rods: list[tuple[str, RigidLink]] = []
    reached, used = set(order), set[str]()
    for inner in order:
        for link in at[inner]:
            if link.name in used:
                continue
            outer = link.end if link.start == inner else link.start
            if outer in reached:
                raise SceneError("this link closes a loop: a chain is open", where=f"links.{link.name}")
            used.add(link.name)
            reached.add(outer)
            order.append(outer)
            rods.append((inner, link))
    apart = next((p.name for p in linkage.points if p.name not in reached), None)
    if apart is not None:
        raise SceneError(f"no link leads from {order[0]} to this point", where=f"points.{apart}")
    return order, rods


def _velocities(
    linkage: Linkage, order: list[str], rods: list[tuple[str, RigidLink]], positions: Array
) -> Array:
    """Return the velocities at the start (points, axes) [m/s]."""
    number, start = linkage.number, linkage.start
    of_points = {name: np.array([number(c) for c in v]) for name, v in start.velocities}
    of_links = {name: [number(c) for c in rate] for name, rate in start.rates}
    velocities = np.zeros_like(positions)
    if not of_points and not of_links:
        return velocities
    places = {name: i for i, name in enumerate(order)}
    if not linkage.point(order[0]).ground:
        if order[0] not in of_points:
            raise SceneError("expected the velocity of this point", where=f"start.velocities.{order[0]}")
        velocities[0] = of_points[order[0]]
    for k, (inner, link) in enumerate(rods, 1):
        i = places[inner]
        along = positions[k] - positions[i]
        turned = None
        if link.name in of_links:
            rate = of_links[link.name]
            spun = rate[0] * np.array((-along[1], along[0])) if len(rate) == 1 else np.cross(rate, along)
            turned = velocities[i] + spun
        if order[k] in of_points:
            velocities[k] = of_points[order[k]]
            slip = abs(np.dot(velocities[k] - velocities[i], along))
            if slip > _ALONG * np.linalg.norm(along) * (np.linalg.norm(velocities[k]) + 1e-300):
                raise SceneError(f"this velocity lengthens {link.name}", where=f"start.velocities.{order[k]}")
            if turned is not None and np.linalg.norm(turned - velocities[k]) > _ALONG * np.max(
                np.abs([turned, velocities[k]])
            ):
                raise SceneError(
                    f"this rate contradicts the velocity of {order[k]}",
                    where=f"start.rates.{link.name}",
                    hint="Give one of them.",
                )
        elif turned is not None:
            velocities[k] = turned
        else:
            raise SceneError(
                "expected the rates of all links at the start, or of none", where=f"start.rates.{link.name}"
            )
    return velocities
