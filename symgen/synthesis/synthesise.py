"""Synthesis of linkages, and the check of each by running it."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import NoLinkageError, SimulationError
from symgen.scene.units import Shown
from symgen.synthesis import dyads, function
from symgen.synthesis.constraints import DesignConstraints
from symgen.synthesis.constraints import read as read_constraints
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.limits import search as limits
from symgen.synthesis.limits.crank_rocker import CRANK_ROCKER, SPHERICAL_CRANK_ROCKER
from symgen.synthesis.limits.kind import LimitKind, time_ratio
from symgen.synthesis.limits.slider_crank import SLIDER_CRANK
from symgen.synthesis.linkage import DesignedLinkage, turn
from symgen.synthesis.search import RootSearch, Solutions
from symgen.synthesis.slider_crank import SliderCrank
from symgen.synthesis.spherical import SphericalFourBar
from symgen.synthesis.tasks import LimitTask, Task, read_task

Array = NDArray[np.float64]
#: Measured quantities, and faults of the motion.
Faults = tuple[dict[str, float], list[str]]

#: Difference between the conditions and the linkage's run: rounding, near dead centres its root [rad, size].
_AGREES = 1e-7
#: Least length of a linkage of best transmission without a fault [size]: the optimum may be at zero.
_VANISHES = 2e-3
#: Larger error of a fit that is a fault [rad, size].
_FITS = 0.05
#: Angle by which a crank may move back before its order is wrong [rad].
_IN_ORDER = 1e-9


@checked
@dataclass(frozen=True, slots=True)
class Design:
    """A linkage, with measures and faults of its motion.

    Attributes
    ----------
    linkage
        A ``FourBar``, ``SliderCrank`` or ``SphericalFourBar``, with their lengths or arcs, class and error.
    quantities
        Lengths [m], angles [rad] and ratios measured in a run, if the crank turns: least and greatest
        transmission angle, swing or stroke and time ratio, and those of limit positions if the task
        prescribes some. A time ratio of other tasks is that of the slower to the faster way: at least one.
    faults
        Faults of the motion: precision points on another branch, in another order, or out of reach.
    """

    linkage: Any
    quantities: dict[str, float]
    faults: tuple[str, ...]


@checked
@dataclass(frozen=True, slots=True, repr=False)
class Synthesis:
    """All linkages found; ``designs`` without faults come first, those of least error before others.

    ``units`` are those of tables, by ``length`` and ``angle``; values are in SI. ``omitted`` has the number
    of further linkages that miss a constraint, by its name.
    """

    title: str
    kind: str
    linkage: str
    designs: tuple[Design, ...]
    search: RootSearch
    units: Shown
    omitted: dict[str, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        good = sum(not d.faults for d in self.designs)
        count = len(self.designs)
        return f"<Synthesis of {_NOUNS[self.linkage]}s, {self.kind}: {count} designs, {good} without a fault>"

    def summary(self) -> dict[str, Any]:
        """Return it in plain numbers, in SI units: what ``symgen synthesise --json`` prints."""
        return {
            "title": self.title,
            "kind": self.kind,
            "linkage": self.linkage,
            "starts": self.search.starts,
            "incomplete": self.search.incomplete,
            "omitted": self.omitted,
            "designs": [
                {
                    "class": d.linkage.grashof,
                    "lengths": d.linkage.lengths,
                    "points": {n: getattr(d.linkage, n).tolist() for n in "OABCP" if hasattr(d.linkage, n)},
                    "error": d.linkage.error,
                    "quantities": d.quantities,
                    "faults": list(d.faults),
                }
                for d in self.designs
            ],
        }


@checked
def synthesise(task: str | os.PathLike[str] | Mapping[str, Any]) -> Synthesis:
    """Return the linkages with the properties that a task prescribes.

    Parameters
    ----------
    task
        Path of a TOML file with a table ``[synthesis]``, or that table: ``{"kind": "limits", ...}``.

    Raises
    ------
    SceneError
        For anything wrong in the task; ``NoLinkageError`` when no linkage was found or can exist.
    """
    head, fields = read_task(task)
    kind = LIMITS[fields.linkage]
    constraints = read_constraints(fields, kind.quantities, CLASSES[fields.linkage])
    if isinstance(fields, LimitTask):
        prescribed, ranges = fields.prescribed()
        if ranges:
            allowed = partial(_allowed, kind, constraints)
            linkages, search = limits.best(kind, prescribed, ranges, fields.starts, fields.seed, allowed)
        else:
            linkages, search = limits.linkages(kind, prescribed, fields.starts, fields.seed)
        measured = partial(_limits, kind, prescribed, optimised=bool(ranges))
        designs = [_checked(linkage, partial(measured, linkage)) for linkage in linkages]
        if not designs:
            reason = kind.why_not(prescribed, ranges)
            if reason:
                raise NoLinkageError(
                    f"no {_NOUNS[fields.linkage]} has these values, which contradict: {reason}",
                    hint="Change the prescribed values.",
                )
            raise NoLinkageError(
                _nothing(fields, search) + _greatest(kind, prescribed, ranges, fields),
                hint="Change the prescribed values, or try more starts.",
            )
    else:
        generated = _GENERATIONS[fields.kind, fields.linkage](fields)
        run = _function if fields.kind == "function" else _guidance
        pairs = zip(generated.linkages, generated.poses, strict=True)
        designs = [_checked(design, partial(run, design, poses)) for design, poses in pairs]
        search = generated.search
    if not designs:
        raise NoLinkageError(
            _nothing(fields, search), hint="Change the prescribed values, or try more starts."
        )
    kept, omitted = _kept(constraints, designs, _NOUNS[fields.linkage])
    ordered = tuple(sorted(kept, key=lambda d: bool(d.faults)))
    return Synthesis(head.title, fields.kind, fields.linkage, ordered, search, head.units, omitted)


def _kept(
    constraints: DesignConstraints, designs: list[Design], noun: str
) -> tuple[list[Design], dict[str, int]]:
    """Return the designs that meet the constraints, and the number of those that miss each of them."""
    missed = [constraints.missed(d.linkage, d.quantities) for d in designs]
    kept = [d for d, names in zip(designs, missed, strict=True) if not names]
    if not kept:
        count = (
            f"the {noun} found does not meet"
            if len(designs) == 1
            else f"none of {len(designs)} {noun}s found meets"
        )
        reasons = [*constraints.why(designs)] or ["each meets some of them only"]
        raise NoLinkageError(
            f"{count} the constraints: {'; '.join(reasons)}",
            hint="Change the constraints or the prescribed values.",
        )
    return kept, dict(Counter(name for names in missed for name in names))


def _allowed(kind: LimitKind, constraints: DesignConstraints, linkage: DesignedLinkage) -> bool:
    """Return whether a linkage meets the constraints, by the closed forms of its limit positions."""
    values = kind.derived([*linkage.lengths.values()])
    ends = {"minimum": "least", "maximum": "greatest"}
    values |= {f"transmission_{end}": values[f"transmission_{by}"] for end, by in ends.items()}
    return not constraints.missed(linkage, values)


CLASSES = {"four-bar": FourBar.CLASSES, "slider-crank": SliderCrank.CLASSES, "spherical": FourBar.CLASSES}
#: Limit positions by linkage.
LIMITS = {"four-bar": CRANK_ROCKER, "slider-crank": SLIDER_CRANK, "spherical": SPHERICAL_CRANK_ROCKER}
_GENERATIONS: dict[tuple[str, str], Callable[[Any], Solutions]] = {
    ("function", "four-bar"): function.four_bars,
    ("function", "slider-crank"): function.slider_cranks,
    ("function", "spherical"): function.spherical_four_bars,
    **{("motion", linkage): dyads.motion for linkage in ("four-bar", "slider-crank", "spherical")},
    **{("path", linkage): dyads.path for linkage in ("four-bar", "slider-crank")},
}
_NOUNS = {"four-bar": "four-bar", "slider-crank": "slider-crank", "spherical": "spherical four-bar"}


def _nothing(task: Task, search: RootSearch) -> str:
    none = f"no {_NOUNS[task.linkage]} was found"
    if search.singular:
        return (
            f"{none}: {search.singular} of {search.starts} starts led to degenerate linkages, "
            "with links of zero length or with undetermined quantities"
        )
    if np.isfinite(search.nearest):
        return (
            f"{none}: {search.starts} starts miss the conditions by {search.nearest:.2g} or more "
            "(root of the sum of squares; angles in rad, lengths over the size of the task)"
        )
    return f"{none}: lengths or angles of all roots are out of range ({search.starts} starts)"


def _greatest(
    kind: LimitKind,
    prescribed: dict[str, float],
    ranges: dict[str, tuple[float, float]],
    task: Any,
) -> str:
    """Return the greatest transmission angle of linkages with the other values, if more is prescribed."""
    name = "transmission_least"
    others = {n: x for n, x in prescribed.items() if n != name}
    requested = ranges[name][0] if name in ranges else prescribed.get(name, 0.0)
    if not requested or len(others) != kind.required - 1:
        return ""
    most = limits.greatest_transmission(kind, others, task.starts, task.seed)
    if not 0 < most < requested:
        return ""
    return (
        f"; the greatest {name} found with the other values is {np.floor(100 * np.degrees(most)) / 100:g} deg"
    )


def _checked(linkage: DesignedLinkage, run: Callable[[], Faults]) -> Design:
    try:
        quantities, faults = run()
    except SimulationError as error:
        quantities, faults = {}, [_stopped(linkage, error.time)]
    return Design(linkage, quantities, tuple(faults))


def _stopped(linkage: DesignedLinkage, time: float) -> str:
    if linkage.grashof == "change-point":
        return "a change-point linkage: its branches meet where all links are in line"
    stop = np.degrees(linkage.parameters["start"] + time) % 360.0
    return f"the crank stops at {stop:.6g} deg, before it has passed all poses"


def _limits(
    kind: LimitKind, prescribed: dict[str, float], linkage: DesignedLinkage, *, optimised: bool
) -> Faults:
    quantities = _over_revolution(linkage) | dict(kind.measured(linkage))
    size = max(linkage.lengths.values())
    sizes = {n: size if n in kind.lengths else 1.0 for n in prescribed if n in quantities}
    missed = {n: abs(quantities[n] - prescribed[n]) / unit for n, unit in sizes.items()}
    faults = [f"{name} has an error of {x:.2g}" for name, x in missed.items() if not x <= _AGREES]
    for name, length in linkage.lengths.items() if optimised else ():
        if name not in prescribed and name != "offset" and length < _VANISHES * size:
            share = f"{length / size:.1e} of the longest length"
            faults.append(f"the {name} has {share}: prescribe a length instead of the range")
    return quantities, faults


def _over_revolution(linkage: DesignedLinkage) -> dict[str, float]:
    """Return extremes over a revolution: of transmission angles, and of the rocker or slider."""
    if not linkage.turns:
        return {}
    directions, moves, more = linkage.extremes
    run = linkage.angles(np.array(directions))
    transmission = linkage.transmission(run)
    extremes = {
        "transmission_minimum": float(transmission.min()),
        "transmission_maximum": float(transmission.max()),
    }
    if moves:
        extremes[moves] = float(np.ptp(linkage.output(run)))
        extremes["time_ratio"] = time_ratio(abs(more))
    return extremes


def _function(linkage: DesignedLinkage, poses: Array) -> Faults:
    """Return faults of the outputs at the angles of the crank."""
    directions = linkage.within_reach(poses[:, 0])
    missed = linkage.output(linkage.angles(directions.tolist())) - poses[:, 1]
    if isinstance(linkage, SliderCrank):
        size = float(np.ptp(poses[:, 1]))
        return _passed(linkage, missed / size, directions, linkage.error / size, "of the slider's way")
    return _passed(linkage, turn(missed), directions, linkage.error, "rad")


def _guidance(linkage: DesignedLinkage, poses: Array) -> Faults:
    """Return faults of places and rotations of the coupler at the directions of the crank."""
    if isinstance(linkage, SphericalFourBar):
        return _on_sphere(linkage, poses)
    directions = linkage.within_reach(dyads.crank_directions(linkage, poses))
    run = linkage.angles(directions.tolist())
    extent = float(np.ptp(poses[:, :2], axis=0).max())
    size = max(linkage.lengths.values()) if linkage.error <= _AGREES * extent else extent
    places = np.linalg.norm(run["P.position"].values - poses[:, :2], axis=1)
    turned = turn(
        (run["coupler.angle"].values - run["coupler.angle"].values[0]) - (poses[:, 2] - poses[0, 2])
    )
    missed = np.maximum(places / size, np.abs(turned))
    return _passed(linkage, missed, directions, linkage.error / size, "of the points' extent, or rad")


def _on_sphere(linkage: SphericalFourBar, poses: Array) -> Faults:
    """Return faults of the coupler's axes in its rotations (poses, 9)."""
    rotations = poses.reshape(-1, 3, 3)
    from_first = rotations @ rotations[0].T
    cranks = np.array([linkage.angle_of(r @ linkage.A) for r in from_first])
    rockers = np.array([linkage.rocker_angle_of(r @ linkage.B) for r in from_first])
    directions = linkage.within_reach(cranks)
    missed = turn(linkage.output(linkage.angles(directions)) - rockers)
    return _passed(linkage, missed, directions, linkage.error, "rad")


def _passed(linkage: DesignedLinkage, missed: Array, directions: Array, error: float, unit: str) -> Faults:
    """Return measures and faults of a run through the poses, of which ``missed`` is the error in its unit."""
    fitted = error > _AGREES
    least = _FITS if fitted else _AGREES
    wrong = [str(i + 1) for i in np.flatnonzero(~(np.abs(missed) <= least))]
    points = f"precision point{'s' * (len(wrong) > 1)} {', '.join(wrong)} {'are' if len(wrong) > 1 else 'is'}"
    faults = [*_order(linkage, directions)]
    if wrong and fitted:
        most = f"{np.abs(missed).max():.2g} {unit}"
        faults.insert(0, f"{points} missed by up to {most}")
    elif wrong:
        faults.insert(0, f"{points} on another assembly branch")
    return _over_revolution(linkage), faults


def _order(linkage: DesignedLinkage, directions: Array) -> Iterator[str]:
    """Yield the fault of a crank that does not pass the poses in their order, in either sense of rotation."""
    steps = np.diff(directions)
    if linkage.turns:
        steps = np.mod(steps, 2 * np.pi)
        right = steps.sum() < 2 * np.pi or np.mod(-steps, 2 * np.pi).sum() < 2 * np.pi
    else:
        right = (steps > -_IN_ORDER).all() or (steps < _IN_ORDER).all()
    if not right:
        yield "the crank passes the precision points in another order"
