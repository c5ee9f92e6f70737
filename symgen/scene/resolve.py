"""From a checked scene to a linkage or a loop: every value read, every name looked up, every fault named."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import sympy as sp

from symgen.errors import SceneError
from symgen.methods import METHODS, Method, claiming
from symgen.scene import units
from symgen.scene.elastic.crank import crank, driver_of, with_flywheel
from symgen.scene.elastic.in_space import joints_in_space
from symgen.scene.elastic.joints import with_joints, with_welds
from symgen.scene.elastic.links import Crank
from symgen.scene.elastic.offsets import with_lugs
from symgen.scene.elastic.reading import check_loads, elastic_links, modal_damping, stations
from symgen.scene.loop.loop import Loop
from symgen.scene.loop.resolve import loop_of
from symgen.scene.loop.schema import SpatialLoop
from symgen.scene.names import check_names
from symgen.scene.reading import Reader
from symgen.scene.rods import bodies, constraints, loads
from symgen.scene.rods.events import events, motions
from symgen.scene.rods.linkage import Linkage
from symgen.scene.rods.notes import remarks
from symgen.scene.rods.planar import in_its_plane
from symgen.scene.rods.spatial import spatial_bodies
from symgen.scene.rods.switches import with_switches, with_switches_of_loop
from symgen.scene.rods.windings import with_windings
from symgen.scene.schema import Scene


def resolve(scene: Scene) -> Linkage | Loop:
    """Return the linkage, or the loop, that a scene describes; a linkage in the plane in which it stays.

    Raises
    ------
    SceneError
        For a wrong unit, an unknown name, a value that is not physical; with file, table and key.
    """
    try:
        check_names(scene)
        resolved: Linkage | Loop = _method(scene).load("resolve")(scene)
    except SceneError as error:
        raise error.located(file=scene.file) from None
    return resolved


def resolved_loop(scene: Scene) -> Loop:
    """Return the loop of a scene with a link-joint table; errors as of :func:`resolve`, without the file."""
    return with_switches_of_loop(loop_of(scene, cast("SpatialLoop", scene.loop)))


def resolved_linkage(scene: Scene) -> Linkage:
    """Return the linkage of a scene of points and links; errors as of :func:`resolve`, without the file."""
    return with_switches(with_windings(_linkage(scene)))


def resolve_linkage(scene: Scene) -> Linkage:
    """Return the linkage of a scene, for functions that do not support loops.

    Raises
    ------
    SceneError
        As :func:`resolve` does, and for a scene with a loop.
    """
    resolved, method = resolve(scene), _method(scene)
    if method.system != METHODS["rods"].system:
        raise SceneError(
            f"expected a scene of points and links, got a {method.name}",
            where=method.claims[0],
            file=scene.file,
            hint=f"This is not there for {method.name}s.",
        )
    return cast("Linkage", resolved)


def _method(scene: Scene) -> Method:
    """Return the method that claims a scene by its tables."""
    return claiming([name for name in scene.model_fields_set if getattr(scene, name) is not None])


def _linkage(scene: Scene) -> Linkage:
    read = Reader(scene)
    bodies.points(read)
    with_lugs(read)
    scene = read.scene
    links = tuple(
        bodies.link(read, name, link) for name, link in scene.links.items() if not read.is_spatial_body(name)
    )
    in_space = spatial_bodies(read, links)
    elastic = tuple(elastic_links(read, links))
    turned = crank(read)
    gravity = (sp.Integer(0),) * read.dimension
    if scene.gravity:
        gravity = read.vector(scene.gravity.acceleration, units.ACCELERATION, "gravity.acceleration")
    masses, driven = tuple(loads.masses(read, links)), tuple(constraints.drivers(read))
    acting = tuple(loads.loads(read))
    hinges = tuple(constraints.hinges(read, (*driven, *loads.turned(acting))))
    linkage = Linkage(
        name=scene.name,
        file=scene.file,
        title=scene.title or scene.name,
        units=units.shown_units(scene.units),
        dimension=read.dimension,
        parameters=tuple(read.parameters),
        points=tuple(read.points.values()),
        links=tuple(loads.with_inertias(with_flywheel(links, turned), masses)),
        bodies=in_space,
        gravity=gravity,
        masses=masses,
        loads=tuple(loads.about_axes(read, acting, hinges)),
        guides=tuple(constraints.guides(read)),
        hinges=hinges,
        gears=tuple(constraints.gears(read)),
        drivers=(*driven, *((driver_of(turned),) if turned else ())),
        motions=tuple(motions(read)),
        start=constraints.start(read),
        t_end=_end(read, turned),
        assembly_tolerance=_assembly_tolerance(read),
        outputs=None if scene.analysis.outputs is None else tuple(scene.analysis.outputs),
        elastic=elastic,
        crank=turned,
        modal_damping=modal_damping(read),
        stations=tuple(stations(read, links, elastic)),
        events=tuple(events(read)),
        states=tuple(loads.states(read)),
        kinematic=scene.analysis.kind == "kinematics",
        written=read.written,
    )
    _check_every_point_used(scene, linkage)
    loads.check_efforts(linkage)
    linkage = with_joints(linkage)
    if elastic and read.dimension == 3:
        linkage = replace(linkage, joints=tuple(joints_in_space(read, elastic)))
    else:
        linkage = with_welds(read, linkage)
    check_loads(linkage)
    # Arguments of analyses replace the values of [analysis].
    limits = tuple(limit for limit in read.limits if not limit.where.startswith("analysis."))
    linkage = replace(linkage, remarks=remarks(scene, linkage), limits=limits)
    if scene.analysis.motion == "space":
        if read.dimension == 2:
            raise SceneError("points with two coordinates do not move in space", where="analysis.motion")
        return replace(linkage, leaves_plane='analysis.motion = "space"')
    if linkage.start.equilibrium and read.dimension == 3:
        return replace(linkage, leaves_plane="the equilibrium at the start is one of all freedoms")
    if elastic and read.dimension == 3:
        return replace(linkage, leaves_plane="elastic links bend in space")
    if linkage.kinematic and read.dimension == 3:
        return replace(linkage, leaves_plane="kinematics knows no loads that keep it in a plane")
    return in_its_plane(linkage)


def _end(read: Reader, crank: Crank | None) -> sp.Expr:
    """Return the end of the run: as in the scene, by default one revolution of the crank, or 1 s."""
    analysis = read.scene.analysis
    if crank and "t_end" not in analysis.model_fields_set and read.number(crank.speed) != 0:
        return 2 * sp.pi / sp.Abs(crank.speed)
    return read.positive(analysis.t_end, units.TIME, "analysis.t_end")


def _assembly_tolerance(read: Reader) -> sp.Expr:
    tolerance = read.scene.analysis.assembly_tolerance
    if tolerance is None:
        return sp.Integer(0)
    return read.positive(tolerance, units.LENGTH, "analysis.assembly_tolerance")


def _check_every_point_used(scene: Scene, linkage: Linkage) -> None:
    used = {p for link in scene.links.values() for p in link.points} | {m.point for m in linkage.masses}
    used |= {name for name, point in scene.points.items() if point.on is not None}
    used |= {point.name for point in linkage.points if point.hidden}
    for point in linkage.points:
        if point.name not in used and not point.ground:
            raise SceneError(
                f"the point {point.name} is on no link and carries no mass: its motion is not determined",
                where=f"points.{point.name}",
                hint="Name it in a link's points, make it ground, or remove it.",
            )
    if all(point.ground for point in linkage.points):
        hint = (
            'Place a point on an elastic link: P = { on = "link", fraction = 0.5 }.'
            if linkage.elastic
            else ""
        )
        raise SceneError("every point is ground: nothing can move", where="points", hint=hint)
