"""Elastic links of a scene: material, section, elements, and the motion of the crank."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

#: Highest powers of x, the distance from the first point of a link, in the properties of a section.
AREA_POWER, INERTIA_POWER = 2, 4

Polynomial = tuple[sp.Expr, ...]


@dataclass(frozen=True, slots=True)
class Section:
    """Properties of a link along it, as polynomials in x [m] from its first point: coefficients by power.

    Attributes
    ----------
    mass
        Mass per length [kg/m]; powers up to ``AREA_POWER``.
    rotary
        Rotary inertia per length, density times second moment of area [kg m]; up to ``INERTIA_POWER``.
    axial
        Axial stiffness E A [N]; up to ``AREA_POWER``.
    bending
        Bending stiffness E I [N m^2]; up to ``INERTIA_POWER``.
    shear
        Shear stiffness k G A [N]; up to ``AREA_POWER``; zero where the element needs none.
    fibre
        Distance of the outer fibre from the neutral axis [m]; powers 0 and 1.
    """

    mass: Polynomial
    rotary: Polynomial
    axial: Polynomial
    bending: Polynomial
    shear: Polynomial
    fibre: Polynomial


@dataclass(frozen=True, slots=True)
class SectionInSpace:
    """A uniform section of a link in space: direction of its y axis, and mu, J_y, J_z, EA, EI_y, EI_z and GJ.

    ``fibres`` are the distances [m] of the outer fibres from the centroid along y and z; ``is_round`` is 1
    for a circle, else 0.
    """

    width: tuple[sp.Expr, ...]
    values: tuple[sp.Expr, ...]
    fibres: tuple[sp.Expr, sp.Expr]
    is_round: sp.Expr


@dataclass(frozen=True, slots=True)
class ElasticLink:
    """A link that bends.

    Attributes
    ----------
    link
        Its name; the :class:`~symgen.scene.rods.linkage.RigidLink` of that name is the link undeformed.
    element, elements
        Name of the finite element, of ``symgen.elements.ELEMENTS``, and how many of them; zero where symgen
        chooses.
    modulus
        Young's modulus [Pa].
    axial
        Whether it stretches; otherwise its length is kept.
    geometric_stiffness
        Whether the axial force stiffens or softens it.
    mass_damping, stiffness_damping, damping_ratio
        Rayleigh damping: times mass matrix [1/s], times stiffness matrix [s]; and the part of the critical
        damping of every mode of the link with free ends. All of the motion relative to the link's own axes.
    reduction, modes
        ``""``, ``"guyan"`` or ``"craig-bampton"``, and for the last how many modes of held ends are kept.
    yield_stress
        Stress [Pa] beyond which a result warns; None where none is given.
    welds
        Points at which it is welded to other elastic links or to the ground.
    in_space
        Its section in space; None in the plane.
    """

    link: str
    element: str
    elements: int
    section: Section
    modulus: sp.Expr
    axial: bool
    geometric_stiffness: bool
    mass_damping: sp.Expr
    stiffness_damping: sp.Expr
    damping_ratio: sp.Expr
    reduction: str
    modes: int
    yield_stress: sp.Expr | None
    welds: tuple[str, ...]
    in_space: SectionInSpace | None = None


@dataclass(frozen=True, slots=True)
class JointInSpace:
    """A joint at an end of the elastic link ``links[0]``, with a second link or the ground.

    ``kind`` is ``weld``, ``revolute`` or ``universal``, ``axis`` its direction at the start, zero of a weld.
    """

    kind: str
    point: str
    links: tuple[str, ...]
    axis: tuple[sp.Expr, ...]


@dataclass(frozen=True, slots=True)
class Crank:
    """How the input turns: the link's direction is ``angle + speed*t`` in the rigid motion.

    ``prescribed``: ``angle`` is a function of the time, and ``speed`` zero.

    ``mode`` is ``held`` (its shaft turns exactly so), ``free`` (nothing holds it: its turning departs from
    the rigid motion) or ``motor``: driven by a torque [N m] over the time t and the states ``LINK.angle`` and
    ``LINK.angular_velocity`` of its link, which scenes write as ``this.angle`` and ``this.rate``, with the
    moment of inertia ``flywheel`` [kg m^2] on it, which is in the ``inertia`` of its link.
    """

    link: str
    mode: str
    angle: sp.Expr
    speed: sp.Expr
    torque: sp.Expr
    flywheel: sp.Expr
    prescribed: bool


@dataclass(frozen=True, slots=True)
class ModalDamping:
    """Damping ratios of the modes of the structure at rest, in the pose in which the crank starts.

    ``ratios`` are those of the first modes that strain the structure by rising frequency, or one for ``all``.
    """

    ratios: tuple[sp.Expr, ...]
    all: bool


@dataclass(frozen=True, slots=True)
class Station:
    """Station of strain output: at the fraction ``at`` of a link, at ``fibre`` [m] from the neutral axis.

    ``fibre`` is None for the outer fibre of the section.
    """

    name: str
    link: str
    at: sp.Expr
    fibre: sp.Expr | None
