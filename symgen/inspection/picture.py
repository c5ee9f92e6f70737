"""A mechanism as it stands at its start: lines and points in space, to be drawn by ``report.drawing``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.report.drawing import Line, Node, Sketch
from symgen.runtime.loop_frames import product
from symgen.runtime.loop_model import LoopModel
from symgen.runtime.result import Result
from symgen.scene.linkage import Linkage
from symgen.scene.loop import Loop

Array = NDArray[np.float64]
#: Length of the axis of a joint as it is drawn, over the size of the loop.
_AXIS = 0.09
#: A part of a length that tells a direction and takes no room.
_LITTLE = 1e-3
#: Letters of joints in the pictures' legends.
JOINTS = {"R": "revolute", "P": "prismatic", "C": "cylindric", "H": "helical", "S": "ball", "U": "universal"}


def sketch(resolved: Linkage | Loop, model: Any, result: Result | None) -> Sketch:
    """Return the mechanism at its start, with the paths of the points that a result records.

    Parameters
    ----------
    resolved
        What the scene resolves to.
    model
        What was built of it.
    result
        A run of the model, if there is one.
    """
    if isinstance(resolved, Loop):
        return _of_loop(resolved, model)
    rigid = getattr(model, "rigid", model)
    return _of_linkage(resolved, rigid.initial_state().positions, result)


def _of_linkage(linkage: Linkage, places: dict[str, Array], result: Result | None) -> Sketch:
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
    for spring in linkage.springs:
        yield Line("spring", "", np.array([places[spring.start], places[spring.end]]))
    for actuator in linkage.actuators:
        yield Line("actuator", "", np.array([places[actuator.start], places[actuator.end]]))
    for guide in linkage.guides:
        along = linkage.link(guide.along)
        d = places[along.end] - places[along.start]
        for point in guide.points:
            yield Line("slider", "", np.array([places[point], places[point] + _LITTLE * d]))


def _of_loop(loop: Loop, model: LoopModel) -> Sketch:
    """Return the links between the axes of their joints, in the first frame."""
    start = model.closed_start()
    table = model.kernels("rows", start.t, start.q, np.zeros_like(start.q))["rows"]
    frame, lines, nodes = np.eye(4), [], []
    size = loop.size
    for i, (row, entries) in enumerate(zip(loop.rows, table, strict=True)):
        foot, k = frame[:3, 3].copy(), frame[:3, 2].copy()
        behind = frame @ product([entries])
        head = foot + entries[1] * k  # where the link begins: the shift along the joint's axis behind it
        if abs(entries[1]) > 1e-9 * size:
            lines.append(Line("axis", "", np.array([foot, head])))
        if row.joint == "P":
            lines.append(Line("slider", "", np.array([foot, foot + _LITTLE * size * k])))
        if row.joint != "S":
            lines.append(Line("axis", "", np.array([head - _AXIS * size * k, head + _AXIS * size * k])))
        last = i == len(loop.rows) - 1
        if np.linalg.norm(behind[:3, 3] - head) > 1e-9 * size:
            lines.append(Line("rail" if last else "rod", row.link, np.array([head, behind[:3, 3]])))
        nodes.append(Node(f"{row.joint}{i + 1}", head, "ground" if i == 0 or last else "joint"))
        frame = behind
    gravity = np.array([loop.number(g) for g in loop.gravity])
    return Sketch(tuple(nodes), tuple(lines), gravity, "m")
