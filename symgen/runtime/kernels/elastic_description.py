"""Runtime data of the elastic links of a linkage, without their code."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.runtime.beams.data import BeamInfo


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
    ``rotations`` are these, each once, in the order of the kernel ``joints``.
    ``welds`` are the names of the constraints that keep the angles of welded links; ``body_welds`` those of
    them that weld elastic links to rigid ones, in the elastic motion, and ``welded_bodies`` the points and
    the rigid links of these.
    ``joints_in_space`` are those that restrict rotations, in the order of the kernel ``axes``.
    ``driven`` are the links in space that drives rotate, in the order of the kernel ``driven``.
    ``shaft_alone``: nothing but the shaft of the crank and damping of the links does work over a revolution.
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
    damps_all: bool = False
    prescribed: bool = False
    couples: tuple[tuple[str, ...], ...] = ()
    rotations: tuple[str, ...] = ()
    welds: tuple[str, ...] = ()
    body_welds: tuple[str, ...] = ()
    welded_bodies: tuple[tuple[str, str], ...] = ()
    joints_in_space: tuple[JointInfo, ...] = ()
    driven: tuple[str, ...] = ()
