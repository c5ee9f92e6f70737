"""Speed beside error: every integrator over its tolerances or steps, against a reference."""

from __future__ import annotations

import gc
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from statistics import median
from time import perf_counter
from typing import Any

from symgen.errors import ModelError, SimulationError
from symgen.precision import PRECISIONS
from symgen.scene.schema import Scene
from symgen.study.measures import distance
from symgen.study.orders import Order, observed_order
from symgen.study.subjects import Reference, Subject, subject
from symgen.study.sweeps import Setting, worth_running

#: A sweep ends within this many times the uncertainty of the reference, and never needs to go below this
#: part of the motion.
_NEAR, _ENOUGH = 3.0, 1e-13


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of one method: errors at the end and the largest along the samples, wall time and counts.

    ``told`` is false where the reference is too uncertain for the error to mean anything.
    """

    method: str
    precision: str
    setting: str
    end: float
    along: float
    best: float
    median: float
    steps: int | None
    evaluations: int | None
    told: bool


@dataclass(frozen=True, slots=True)
class WorkPrecision:
    """What was measured. Errors are in ``unit``, times in seconds."""

    title: str
    t_end: float
    samples: int
    unit: str
    measured: str
    reference: str
    uncertainty: float
    points: tuple[Point, ...]
    orders: tuple[Order, ...]
    notes: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return it in plain numbers: what ``symgen bench --json`` prints."""
        return {
            **{key: value for key, value in asdict(self).items() if key != "orders"},
            "points": [asdict(p) for p in self.points],
            "orders": [{**asdict(o), "agrees": o.agrees} for o in self.orders],
            "notes": list(self.notes),
        }


def work_precision(
    scene: Scene | str | os.PathLike[str],
    *,
    set: Mapping[str, str] | None = None,
    methods: Sequence[str] | None = None,
    precisions: Sequence[str] = ("float64",),
    t_end: float | None = None,
    samples: int = 21,
    repeats: int = 5,
    longest: float = 0.5,
    backend: str = "auto",
    peers: bool = False,
    progress: Callable[[float], None] | None = None,
) -> WorkPrecision:
    """Measure error, wall time, steps and evaluations of every method over its tolerances or steps.

    A time is that of the whole call from Python, result included, of a model that is built and has run
    before. Settings are timed in turn, round by round, so that what else the machine does meets all alike.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or a :class:`symgen.Scene`.
    set
        Values to replace, as in :func:`symgen.build`.
    methods
        Names of integrators; all when absent.
    precisions
        Types of numbers to run in: see :func:`symgen.build`.
    t_end
        Horizon [s]; the scene's own when absent. A chaotic motion magnifies errors with it until neither
        method nor reference says anything; the notes tell.
    samples
        Equally spaced times recorded, at which errors along the run are taken.
    repeats
        How often each setting is timed.
    longest
        A sweep ends with the first run that takes longer [s].
    peers
        Run other programs too, those that are installed: of open chains of rods in the plane.
    progress
        Takes the part that is done.

    Raises
    ------
    ModelError
        For an unknown method, options out of range, or a scene that is not integrated in time.
    SimulationError
        When the reference cannot be run to the end.
    """
    if repeats < 1 or not longest > 0:
        raise ModelError(f"expected repeats >= 1 and longest > 0 s, got {repeats} and {longest:g} s")
    what = subject(scene, set, backend, t_end, samples, precisions)
    asked = what.chosen(methods)
    others, missing = what.peers() if peers else ([], [])
    try:
        reference = what.reference()
    except SimulationError as error:
        raise SimulationError(
            f"the reference does not reach t_end = {what.t_end:g} s: {error}\n  Give an earlier --t-end.",
            time=error.time,
            partial=error.partial,
        ) from None
    measured = _Measured(what, reference, longest)
    pairs = [(m, p) for m in asked for p in dict.fromkeys(precisions)]
    sweeps = [*(what.settings(m, p) for m, p in pairs), *others]
    times = _timed(what, list(chain(*map(measured.worthwhile, sweeps))), repeats, progress)
    points = tuple(measured.point(setting, times[setting]) for setting in times)
    orders = tuple(measured.order(m, p) for m, p in pairs)
    return WorkPrecision(
        title=what.title,
        t_end=what.t_end,
        samples=samples,
        unit=what.unit,
        measured=what.measured,
        reference=reference.about,
        uncertainty=reference.uncertainty,
        points=points,
        orders=orders,
        notes=(*missing, *measured.failures.values(), *_of_reference(points, reference)),
    )


class _Measured:
    """The runs of a subject by setting, each made once, and their errors."""

    def __init__(self, what: Subject, reference: Reference, longest: float) -> None:
        self.what, self.reference, self.longest = what, reference, longest
        self.size = what.size()
        self.goal = max(_NEAR * reference.uncertainty, _ENOUGH * self.size)
        self.found: dict[Setting, tuple[float, float, int | None, int | None]] = {}
        self.walls: dict[Setting, float] = {}
        self.failures: dict[str, str] = {}
        self.warm: set[tuple[str, str]] = set()

    def worthwhile(self, sweep: Iterator[Setting]) -> list[Setting]:
        return list(worth_running(sweep, self._run, self.goal, self.longest))

    def _run(self, setting: Setting) -> tuple[float, float]:
        """Run a setting once; return its largest error and its wall time [s]."""
        if setting not in self.found:
            begun = perf_counter()
            try:
                if (kind := (setting.method, setting.precision)) not in self.warm:
                    # What is made at the first call must not end the sweep as too long a run.
                    self.what.call(setting)
                    self.warm.add(kind)
                    begun = perf_counter()
                result = self.what.call(setting)
                self.walls[setting] = perf_counter() - begun
                run = self.what.read(result)
            except SimulationError as error:
                first = str(error).partition("\n")[0]
                self.failures[setting.method] = f"{setting.method} fails with {setting.text}: {first}"
                self.found[setting] = (math.inf, math.inf, 0, None)
                self.walls[setting] = perf_counter() - begun
                return math.inf, self.walls[setting]
            gaps = distance(run.along, self.reference.along[-len(run.along) :]).tolist()
            self.found[setting] = (gaps[-1], max(gaps), run.steps, run.evaluations)
        return self.found[setting][1], self.walls[setting]

    def point(self, setting: Setting, times: Sequence[float]) -> Point:
        end, along, steps, evaluations = self.found[setting]
        return Point(
            method=setting.method,
            precision=setting.precision,
            setting=setting.text,
            end=end,
            along=along,
            best=min(times),
            median=median(times),
            steps=steps,
            evaluations=evaluations,
            told=along > _NEAR * self.reference.uncertainty,
        )

    def order(self, method: str, precision: str) -> Order:
        wanted = self.what.order_settings(method, precision)
        settings = self.worthwhile(wanted)
        steps, errors = [s.steps or 0 for s in settings], [self.found[s][0] for s in settings]
        floor = max(self.reference.uncertainty, PRECISIONS[precision].epsilon * self.size)
        observed, used = observed_order(steps, errors, floor, self.size)
        return Order(method, precision, self.what.orders[method], observed, used)


def _timed(
    what: Subject, settings: Sequence[Setting], repeats: int, progress: Callable[[float], None] | None
) -> dict[Setting, list[float]]:
    times: dict[Setting, list[float]] = {setting: [] for setting in settings}
    collecting = gc.isenabled()
    gc.disable()
    try:
        for turn in range(repeats):
            for setting, spent in times.items():
                begun = perf_counter()
                what.call(setting)
                spent.append(perf_counter() - begun)
            if progress:
                progress((turn + 1) / repeats)
    finally:
        if collecting:
            gc.enable()
    return times


def _of_reference(points: Sequence[Point], reference: Reference) -> list[str]:
    """Say where the reference is no better than what it is to judge."""
    lost = sum(not p.told for p in points)
    if not lost:
        return []
    return [
        f"{lost} of {len(points)} errors, marked ~, are not told from that of the reference, "
        f"{reference.uncertainty:.1e}; in chaos a shorter --t-end makes both smaller"
    ]
