"""Elastic links of a linkage in space: bending in two planes, torsion and stretch in large rotation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.elastic.links import ElasticLink, JointInSpace, Section, SectionInSpace
from symgen.scene.elastic.schema import ElasticTable, JointTable, Weld
from symgen.scene.elastic.spatial_section import section_in_space
from symgen.scene.reading import Reader, check_count
from symgen.scene.rods.constraints import is_hinge
from symgen.scene.rods.linkage import RigidLink

#: Keys of the elasticity of such a link.
_ELASTIC = {"E", "elements", "shear", "damping"}
_ELEMENTS, _MOST_ELEMENTS = 4, 200
_ZERO, _HALF = sp.Integer(0), sp.Rational(1, 2)


def spatial_link(read: Reader, rigid: RigidLink, elastic: ElasticTable, place: str) -> ElasticLink:
    """Return an elastic link in space.

    Raises
    ------
    SceneError
        For keys that it does not have, more than two ends, and values that are not physical.
    """
    scene, where = read.scene, f"{place}.elastic"
    for key in sorted(elastic.model_fields_set - _ELASTIC):
        raise SceneError(
            f"an elastic link in space has no {key}",
            where=f"{where}.{key}",
            hint=f"It has {', '.join(sorted(_ELASTIC))}, and is computed in large rotation.",
        )
    if len(scene.links[rigid.name].points) > 2:
        raise SceneError(
            "an elastic link in space has two ends",
            where=f"{place}.points",
            hint='Place further points on it: P = { on = "link", fraction = 0.5 }.',
        )
    for key in ("crank", "modal_damping"):
        if getattr(scene, key):
            raise SceneError(
                f"a linkage with elastic links in space has no {key}",
                where=key,
                hint="Its input is the motion of ground points, points.NAME.motion.",
            )
    damping = elastic.damping
    for key in ("ratio", "mass"):
        if getattr(damping, key):
            raise SceneError(
                "an elastic link in space is damped in proportion to its stiffness",
                where=f"{where}.damping.{key}",
                hint='Write damping = { stiffness = "1e-5 s" }.',
            )
    elements = _ELEMENTS if elastic.elements is None else elastic.elements
    check_count(elements, 1, _MOST_ELEMENTS, f"{where}.elements")
    link = scene.links[rigid.name]
    width, values = section_in_space(read, rigid.name, elastic, rigid.length, place)
    mu, j_y, _, axial, bending_y, bending_z, _ = values
    modulus = read.positive(elastic.E, units.PRESSURE, f"{where}.E")
    area = axial / modulus
    # Of a rectangle I = A h^2/12; a circle has A = pi r^2, I = A r^2/4.
    square = link.section is not None and link.section.diameter is None
    factor = 3 if square else 4
    fibres = tuple(sp.sqrt(factor * b / modulus / area) for b in (bending_z, bending_y))
    stiffness = read.not_negative(damping.stiffness or 0, units.TIME, f"{where}.damping.stiffness")
    return ElasticLink(
        link=rigid.name,
        element="director_beam",
        elements=elements,
        section=Section((mu,), (j_y,), (axial,), (bending_y,), (_ZERO,), (_ZERO,)),
        modulus=modulus,
        axial=True,
        geometric_stiffness=True,
        mass_damping=_ZERO,
        stiffness_damping=stiffness,
        damping_ratio=_ZERO,
        reduction="",
        modes=0,
        yield_stress=None,
        welds=(),
        in_space=SectionInSpace(width, values, (fibres[0], fibres[1]), sp.Integer(not square)),
    )


def joints_in_space(read: Reader, links: Sequence[ElasticLink]) -> Iterator[JointInSpace]:
    """Yield welds, revolute and universal joints of elastic links in space, an elastic link first.

    Raises
    ------
    SceneError
        For links that do not meet at the point or of which none is elastic, and an axis of zero length.
    """
    scene, elastic = read.scene, {link.link for link in links}
    tables: tuple[tuple[str, Sequence[Weld | JointTable]], ...] = (
        ("welds", scene.welds),
        ("joints", scene.joints),
    )
    welded_rods: list[str] = []
    for table, joints in tables:
        for i, joint in enumerate(joints):
            where = f"{table}.{i}"
            if is_hinge(scene, joint):
                continue
            read.known_point(joint.point, f"{where}.point")
            for name in joint.links:
                read.known_link(name, f"{where}.links")
                read.known_joint(joint.point, name, read.points_of(name), f"{where}.point")
            names = sorted(joint.links, key=lambda name: name not in elastic)
            if names[0] not in elastic or len(set(names)) < len(names):
                raise SceneError(
                    "expected an elastic link, alone or with others that it joins, got "
                    + " and ".join(joint.links),
                    where=f"{where}.links",
                    hint="Without another link it is with the ground; that of a rigid link is revolute.",
                )
            if isinstance(joint, Weld):
                welded_rods += _rods(read, names, where)
                again = sorted({name for name in welded_rods if welded_rods.count(name) > 1})
                if again:
                    raise SceneError(
                        f"{again[0]} is welded twice, and a rod carries no torsion",
                        where=f"{where}.links",
                        hint="Give it a third point, mass, centre and inertia: it is a body then.",
                    )
                # Without another link, with the ground.
                for k in range(1, max(2, len(names))):
                    yield JointInSpace("weld", joint.point, (names[0], *names[k : k + 1]), (_ZERO,) * 3)
                continue
            axis = read.direction(joint.axis, f"{where}.axis")
            yield JointInSpace(joint.kind, joint.point, tuple(names), axis)


def _rods(read: Reader, names: Sequence[str], where: str) -> list[str]:
    """Return the rods without a drive among welded links."""
    scene = read.scene
    rigid = [name for name in names if scene.links[name].elastic is None and not read.is_spatial_body(name)]
    rods = [name for name in rigid if name not in scene.driven]
    for joint in scene.joints:
        if is_hinge(scene, joint) and joint.links[0] in rods:
            raise SceneError(
                f"{joint.links[0]} has a revolute joint with the ground and no drive: the weld would leave a "
                "rotation about its line",
                where=f"{where}.links",
                hint="Give it a third point and a second ground point: it is a body then, with an axis.",
            )
    return rods
