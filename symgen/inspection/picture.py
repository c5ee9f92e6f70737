"""A mechanism in a pose: lines and points in space for ``report.drawing``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from symgen.joints import JOINTS
from symgen.loads.of_points import Length
from symgen.report.page.drawing import Line, Node, Sketch
from symgen.runtime.loop.frames import product
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.result import Result
from symgen.scene.loop.loop import Loop
from symgen.scene.rods.linkage import Linkage

Array = NDArray[np.float64]
#: Drawn length of a joint axis relative to the size of the loop.
_AXIS = 0.09
#: The freedoms of a joint that has no axis.
_BALL = ("theta", "eta", "alpha")
#: A relative length that defines a direction but is invisible in the picture.
_LITTLE = 1e-3


def linkage_sketch(linkage: Linkage, places: dict[str, Array], result: Result | None) -> Sketch:
    """Return a linkage with its points in places [m], and their paths in a run, if there is one."""
    linkage = linkage.as_written
    hidden = {p.name for p in linkage.points if p.hidden}
    joints = [name for k in linkage.links for name in (k.start, k.end, *(p.name for p in k.carried))]
    joints += [name for body in linkage.bodies for name in (*body.base, *(p.name for p in body.carried))]
    nodes = tuple(
        Node(
            p.name,
            places[p.name],
            "hidden"
            if p.hidden
            else "ground"
            if p.ground
            else "joint"
            if joints.count(p.name) != 1
            else "end",
        )
        for p in linkage.points
    )
    paths = [
        Line("path", "", variable.values)
        for p in linkage.points
        if p.name not in hidden and result is not None and f"{p.name}.position" in result
        for variable in [result.variable(f"{p.name}.position")]
    ]
    gravity = np.array([linkage.number(g) for g in linkage.gravity])
    return Sketch(nodes, (*paths, *_bars(linkage, places)), gravity, "m")


def _bars(linkage: Linkage, places: dict[str, Array]) -> Iterator[Line]:
    fixed = {p.name for p in linkage.points if p.ground}
    elastic = {e.link for e in linkage.elastic}
    for k in linkage.links:
        ends = [places[k.start], places[k.end]]
        if {k.start, k.end} <= fixed:
            yield Line("rail", "", np.array(ends))
        elif k.carried:
            yield Line("body", k.name, np.array([*ends, *(places[p.name] for p in k.carried)]))
        else:
            yield Line("elastic" if k.name in elastic else "rod", k.name, np.array(ends))
    for body in linkage.bodies:
        yield Line(
            "body", body.name, np.array([places[p] for p in (*body.base, *(c.name for c in body.carried))])
        )
    for load in linkage.loads:
        for measure in load.measures(len(linkage.axes)):
            if isinstance(measure, Length):
                yield Line(load.drawn, "", np.array([places[measure.start], places[measure.end]]))
    for guide in linkage.guides:
        along = linkage.link(guide.along)
        d = places[along.end] - places[along.start]
        for point in guide.points:
            yield Line("slider", "", np.array([places[point], places[point] + _LITTLE * d]))


def drawn_of_loop(loop: Loop) -> list[str]:
    """Return the outputs from which a pose follows: of each joint, its place on both links, and its axis."""
    links = _links(loop)
    return [
        name
        for k in range(1, len(links))
        for name in (
            f"{links[k - 1]}.joint{k}.position",
            f"{links[k]}.joint{k}.position",
            f"{links[k]}.joint{k}.axis",
        )
    ]


def pose_of_loop(loop: Loop, model: LoopModel, t: float, q: Array) -> dict[str, Array]:
    """Return the outputs of :func:`drawn_of_loop` at a time [s] and joint variables, for any model."""
    table = model.kernels("rows", t, q, np.zeros_like(q))["rows"]
    frame, found = np.eye(4), []
    for entries in table:
        foot, k = frame[:3, 3], frame[:3, 2]
        found += [foot, foot + entries[1] * k, k]
        frame = frame @ product([entries])
    return dict(zip(drawn_of_loop(loop), found, strict=True))


def loop_sketch(loop: Loop, drawn: Mapping[str, Array]) -> Sketch:
    """Return the links between their joint axes, in the first frame, from the outputs of a pose."""
    links, size, lines, nodes = _links(loop), loop.size, [], []
    last = len(loop.rows)
    for i, row in enumerate(loop.rows, 1):
        foot, head, k = (
            drawn[f"{links[j]}.joint{i}.{word}"]
            for j, word in ((i - 1, "position"), (i, "position"), (i, "axis"))
        )
        behind = drawn[f"{links[i]}.joint{i % last + 1}.position"]
        lines.append(Line("axis", "", np.array([foot, head])))
        varies = JOINTS[row.joint].varies
        if varies == ("S",):
            lines.append(Line("slider", "", np.array([foot, foot + _LITTLE * size * k])))
        if varies != _BALL:
            lines.append(Line("axis", "", np.array([head - _AXIS * size * k, head + _AXIS * size * k])))
        lines.append(Line("rail" if i == last else "rod", row.link, np.array([head, behind])))
        nodes.append(Node(f"{row.joint}{i}", head, "ground" if i in (1, last) else "joint"))
    gravity = np.array([loop.number(g) for g in loop.gravity])
    return Sketch(tuple(nodes), tuple(lines), gravity, "m")


def _links(loop: Loop) -> list[str]:
    """Return the links along the loop, from the ground to the ground."""
    links = [row.link for row in loop.rows]
    return [links[-1], *links]
