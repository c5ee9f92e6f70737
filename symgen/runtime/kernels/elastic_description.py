"""Runtime data of the elastic links of a linkage, without their code."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BeamInfo:
    """Names and choices of an elastic link.

    Attributes
    ----------
    link, start, end
        The link and its first and last point.
    element, node_dofs, inner_dofs, elements
        The finite element, the unknowns of its nodes, its inner unknowns, and the number of elements; zero if
        symgen chooses it: see :mod:`symgen.runtime.elastic.mesh`.
    axial
        Whether the link stretches.
    geometric_stiffness
        Whether the axial force stiffens or softens it.
    reduction, modes
        ``""``, ``"guyan"`` or ``"craig-bampton"``, and for the last the number of modes kept.
    clamped
        Whether the rotation of the first node is held, or is the rotation of a shaft.
    nodes
        Where the elements meet, as fractions of the length, both ends included; evenly spaced if empty.
    definition
        Hash of the definition of an element that a program registers, empty for those of symgen.
    between
        Joints between the ends: name of the point, fraction of the length. There is a node at each.
    welds
        Joints whose rotation is that of the other links welded there, or zero on the ground.
    couples
        Joints at whose sections couples act.
    jumps
        Nodes between the ends, as fractions of the length, at which couples act: each side has a curvature.
    """

    link: str
    start: str
    end: str
    element: str
    node_dofs: tuple[str, ...]
    inner_dofs: tuple[str, ...] = ()
    elements: int = 1
    axial: bool = True
    geometric_stiffness: bool = True
    reduction: str = ""
    modes: int = 0
    clamped: bool = False
    nodes: tuple[float, ...] = ()
    definition: str = ""
    between: tuple[tuple[str, float], ...] = ()
    welds: tuple[str, ...] = ()
    couples: tuple[str, ...] = ()
    jumps: tuple[float, ...] = ()

    @property
    def points(self) -> tuple[str, ...]:
        """The points at which it is joined, from the first to the last."""
        return self.start, *(name for name, _ in self.between), self.end

    @property
    def joint_nodes(self) -> tuple[int, ...]:
        """Numbers of the nodes at these points."""
        return 0, *(self.nodes.index(fraction) for _, fraction in self.between), self.elements

    @property
    def welded(self) -> dict[str, str]:
        """The points with welds by the names of the rotations there."""
        at = zip(self.points, self.joint_nodes, strict=True)
        return {f"theta@{node + 1}": point for point, node in at if point in self.welds}

    @property
    def rotations(self) -> dict[str, str]:
        """Names of the rotations that other components use, by unknown."""
        at = zip(self.points, self.joint_nodes, strict=True)
        acted = {f"theta@{node + 1}": f"{self.link}.{point}" for point, node in at if point in self.couples}
        return acted | self.welded

    def bent_at(self, point: str) -> bool:
        """Return whether a weld or a couple bends the link at one of its points."""
        return point in self.welds or point in self.couples

    @property
    def block(self) -> str:
        """The name of the kernels of its elements, which belongs to one definition of the element."""
        return "_".join(part for part in ("element", self.element, self.definition) if part)

    def node(self, k: int) -> float:
        """Return the place of a node as a fraction of the length."""
        return self.nodes[k] if self.nodes else k / self.elements


@dataclass(frozen=True, slots=True)
class JointInfo:
    """A joint of the elastic link ``links[0]`` in space: see ``symgen.runtime.elastic.space.joints``.

    ``base`` are the points that carry the second link, if it is rigid.
    """

    kind: str
    point: str
    links: tuple[str, ...]
    base: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ElasticInfo:
    """Elastic links, the crank, and the stations of strains.

    ``stations`` are pairs of a name and a link, ``lumps`` and ``loads`` the links of the masses and forces
    along links, all in the order of the rows that kernels give; ``joints`` has for each of these loads the
    point between the ends of its link whose joint force it is, or is empty for a load. ``outputs`` are those
    the scene selects.
    ``damps_all``: the one ratio of modal damping is that of all modes.
    ``prescribed``: the angle of the crank is a function of the time, and its speed zero.
    ``couples`` has for each couple on sections of elastic links the rotations on which it acts, one or two;
    ``rotations`` are these, each once, in the order of the kernel ``joints``. ``reads`` has the points that
    the law of each couple reads, and "" if it reads the rotation of its sections.
    ``welds`` are the names of the constraints that keep the angles of welded links; ``body_welds`` those of
    them that weld elastic links to rigid ones, in the elastic motion, and ``welded_bodies`` the points and
    the rigid links of these.
    ``joints_in_space`` are those that restrict rotations, in the order of the kernel ``axes``.
    ``driven`` are the links in space that drives rotate, in the order of the kernel ``driven``.
    ``shaft_alone``: nothing but the shaft of the crank and damping of the links does work over a revolution.
    ``states`` has the unit of the rate and the meaning of each first-order state.
    ``work_on_links``: forces without potential act on elastic links and on an elastic or held crank alone.
    """

    beams: tuple[BeamInfo, ...]
    crank: str
    mode: str
    stations: tuple[tuple[str, str], ...]
    lumps: tuple[str, ...]
    loads: tuple[str, ...]
    joints: tuple[str, ...] = ()
    outputs: tuple[str, ...] | None = None
    shaft_alone: bool = False
    work_on_links: bool = False
    states: tuple[tuple[str, str], ...] = ()
    damps_all: bool = False
    prescribed: bool = False
    couples: tuple[tuple[str, ...], ...] = ()
    reads: tuple[tuple[str, ...], ...] = ()
    rotations: tuple[str, ...] = ()
    welds: tuple[str, ...] = ()
    body_welds: tuple[str, ...] = ()
    welded_bodies: tuple[tuple[str, str], ...] = ()
    joints_in_space: tuple[JointInfo, ...] = ()
    driven: tuple[str, ...] = ()
