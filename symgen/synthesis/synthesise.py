"""Synthesis of planar four-bars, and the check of each by running it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import SceneError, SimulationError
from symgen.synthesis import limits, precision
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.search import Search
from symgen.synthesis.tasks import FunctionTask, LimitTask, MotionTask, PathTask, Task, read_task
from symgen.synthesis.triangle import angle

Array = NDArray[np.float64]

#: Difference between the conditions and the linkage's run: rounding, near dead centres its root [rad, size].
_AGREES = 1e-7
#: Larger error of a fit that is a fault [rad, size].
_FITS = 0.05
#: Angle by which a crank may move back before its order is wrong [rad].
_IN_ORDER = 1e-9


@checked
@dataclass(frozen=True, slots=True)
class Design:
    """A four-bar, with measures and faults of its motion.

    Attributes
    ----------
    linkage
        The four-bar.
    quantities
        Lengths [m] and angles [rad] measured in a run, if the crank turns: least and greatest transmission
        angle, range of the rocker, and those of the limit positions if the task prescribes some.
    faults
        Faults of the motion: precision points on another branch, in another order, or out of reach.
    """

    linkage: FourBar
    quantities: dict[str, float]
    faults: tuple[str, ...]


@checked
@dataclass(frozen=True, slots=True)
class Synthesis:
    """All four-bars found; ``designs`` without faults come first, those of least error before others."""

    title: str
    kind: str
    designs: tuple[Design, ...]
    search: Search

    def summary(self) -> dict[str, Any]:
        """Return it in plain numbers, in SI units: what ``symgen synthesise --json`` prints."""
        return {
            "title": self.title,
            "kind": self.kind,
            "starts": self.search.starts,
            "designs": [
                {
                    "class": d.linkage.grashof,
                    "lengths": d.linkage.lengths,
                    "points": {name: getattr(d.linkage, name).tolist() for name in "OABCP"},
                    "error": d.linkage.error,
                    "quantities": d.quantities,
                    "faults": list(d.faults),
                }
                for d in self.designs
            ],
        }


@checked
def synthesise(task: str | os.PathLike[str] | Mapping[str, Any]) -> Synthesis:
    """Return the planar four-bars with the properties that a task prescribes.

    Parameters
    ----------
    task
        Path of a TOML file with a table ``[synthesis]``, or that table: ``{"kind": "limits", ...}``.

    Raises
    ------
    SceneError
        For anything wrong in the task, and when no four-bar was found.
    """
    title, asked = read_task(task)
    if isinstance(asked, LimitTask):
        linkages, search = limits.crank_rockers(asked)
        given = asked.given()
        designs = [_checked(linkage, partial(_limits, linkage, given)) for linkage in linkages]
    else:
        found = _GENERATIONS[type(asked)](asked)
        run = _function if isinstance(asked, FunctionTask) else _guidance
        pairs = zip(found.linkages, found.poses, strict=True)
        designs = [_checked(own, partial(run, own, poses)) for own, poses in pairs]
        search = found.search
    if not designs:
        raise SceneError(_nothing(asked, search), hint="Change the prescribed values, or try more starts.")
    return Synthesis(title, asked.kind, tuple(sorted(designs, key=lambda d: bool(d.faults))), search)


_GENERATIONS: dict[type[Task], Callable[[Any], precision.Found]] = {
    FunctionTask: precision.function,
    MotionTask: precision.motion,
    PathTask: precision.path,
}


def _nothing(task: Task, search: Search) -> str:
    if search.singular:
        return (
            f"no four-bar was found: {search.singular} of {search.starts} starts led to degenerate linkages, "
            "with links of zero length or with undetermined quantities"
        )
    if np.isfinite(search.nearest):
        return f"no four-bar was found: {search.starts} starts end {search.nearest:.2g} off or more"
    return f"no four-bar was found: lengths or angles of all roots are out of range ({search.starts} starts)"


def _checked(linkage: FourBar, run: Callable[[], tuple[dict[str, float], list[str]]]) -> Design:
    try:
        quantities, faults = run()
    except SimulationError as error:
        quantities, faults = {}, [_stopped(linkage, error.time)]
    return Design(linkage, quantities, tuple(faults))


def _stopped(linkage: FourBar, time: float) -> str:
    if linkage.grashof == "change-point":
        return "a change-point linkage: its branches meet where all links are in line"
    stop = np.degrees(linkage.parameters["start"] + time) % 360.0
    return f"the crank stops at {stop:.6g} deg, before it has passed all poses"


def _limits(linkage: FourBar, given: dict[str, float]) -> tuple[dict[str, float], list[str]]:
    quantities = dict(limits.measured(linkage)) | _over_revolution(linkage)
    sizes = {n: x if n in linkage.lengths else 1.0 for n, x in given.items() if n in quantities}
    missed = {n: abs(quantities[n] - given[n]) / size for n, size in sizes.items()}
    return quantities, [f"{name} is missed by {x:.2g}" for name, x in missed.items() if not x <= _AGREES]


def _over_revolution(linkage: FourBar) -> dict[str, float]:
    """Return extremes over a revolution: transmission angles with the crank on the fixed link, and limits."""
    if not linkage.turns:
        return {}
    a, b, c, d = linkage.lengths.values()
    towards = float(np.arctan2(*(linkage.C - linkage.O)[::-1]))
    directions = [0.0, np.pi]
    if linkage.grashof == "crank-rocker":
        inline = [angle(c, d, b + a), np.pi + angle(c, d, b - a)]
        directions += [*inline, *(-x for x in inline)]
    run = linkage.angles(np.array(directions) + towards)
    transmission, rocker = np.abs(run["A.B.C.angle"].values), run["rocker.angle"].values
    found = {
        "transmission_minimum": float(transmission.min()),
        "transmission_maximum": float(transmission.max()),
    }
    if linkage.grashof == "crank-rocker":
        found["rocker_range"] = float(np.ptp(rocker))
    return found


def _function(linkage: FourBar, poses: Array) -> tuple[dict[str, float], list[str]]:
    """Return faults of the rocker's angles at those of the crank."""
    directions = linkage.within_reach(poses[:, 0])
    run = linkage.angles(directions.tolist())
    missed = _turn(run["rocker.angle"].values - poses[:, 1])
    return _passed(linkage, missed, directions, linkage.error, "rad")


def _guidance(linkage: FourBar, poses: Array) -> tuple[dict[str, float], list[str]]:
    """Return faults of places and rotations of the coupler at the directions of the crank."""
    directions = linkage.within_reach(precision.crank_directions(linkage, poses))
    run = linkage.angles(directions.tolist())
    exact = linkage.error <= _AGREES * float(np.ptp(poses[:, :2], axis=0).max())
    size = max(linkage.lengths.values()) if exact else float(np.ptp(poses[:, :2], axis=0).max())
    places = np.linalg.norm(run["P.position"].values - poses[:, :2], axis=1)
    turned = _turn(
        (run["coupler.angle"].values - run["coupler.angle"].values[0]) - (poses[:, 2] - poses[0, 2])
    )
    missed = np.maximum(places / size, np.abs(turned))
    return _passed(linkage, missed, directions, linkage.error / size, "of the points' extent, or rad")


def _passed(
    linkage: FourBar, missed: Array, directions: Array, error: float, unit: str
) -> tuple[dict[str, float], list[str]]:
    """Return measures and faults of a run through the poses, of which ``missed`` is the error in its unit."""
    fitted = error > _AGREES
    least = _FITS if fitted else _AGREES
    wrong = [str(i + 1) for i in np.flatnonzero(~(np.abs(missed) <= least))]
    faults = [*_order(linkage, directions)]
    if wrong and fitted:
        most = f"{np.abs(missed).max():.2g} {unit}"
        faults.insert(0, f"precision points {', '.join(wrong)} are missed by up to {most}")
    elif wrong:
        faults.insert(0, f"precision points {', '.join(wrong)} are on another assembly branch")
    return _over_revolution(linkage), faults


def _turn(x: Array) -> Array:
    """Return angles less whole revolutions."""
    return np.asarray(x - 2 * np.pi * np.round(x / (2 * np.pi)))


def _order(linkage: FourBar, directions: Array) -> Iterator[str]:
    """Yield the fault of a crank that does not pass the poses in their order, in either sense of rotation."""
    steps = np.diff(directions)
    if linkage.turns:
        steps = np.mod(steps, 2 * np.pi)
        right = steps.sum() < 2 * np.pi or np.mod(-steps, 2 * np.pi).sum() < 2 * np.pi
    else:
        right = (steps > -_IN_ORDER).all() or (steps < _IN_ORDER).all()
    if not right:
        yield "the crank passes the precision points in another order"
