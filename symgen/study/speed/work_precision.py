"""Work-precision measurement of every integrator over its tolerances or steps, against a reference."""

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
from symgen.study.speed.measures import distance
from symgen.study.speed.orders import Order, observed_order
from symgen.study.speed.subjects import ReferenceSolution, StudySubject, subject
from symgen.study.speed.sweeps import Setting, worth_running

#: Error at which a sweep ends, over the uncertainty of the reference.
_NEAR = 3.0
#: Error at which a sweep ends, over the motion.
_ENOUGH = 1e-13


@dataclass(frozen=True, slots=True)
class WorkPrecisionPoint:
    """One setting of one method: final and largest error, wall time and counts.

    ``resolved`` is False if the error is within the uncertainty of the reference.
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
    resolved: bool


@dataclass(frozen=True, slots=True)
class WorkPrecision:
    """Results of the measurement, with errors in ``unit`` and times in seconds."""

    title: str
    t_end: float
    samples: int
    unit: str
    measured: str
    reference: str
    uncertainty: float
    points: tuple[WorkPrecisionPoint, ...]
    orders: tuple[Order, ...]
    notes: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return plain data for ``symgen bench --json``."""
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
    progress: Callable[[float], None] | None = None,
) -> WorkPrecision:
    """Measure error, wall time, steps and evaluations of every method over its tolerances or steps.

    A time is that of the whole Python call, including the result, after the model was built and run once.
    Settings are timed alternately in rounds, so that other load on the machine affects all of them.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or a :class:`symgen.Scene`.
    set
        Values to override, as in :func:`symgen.build`.
    methods
        Names of integrators; default: all.
    precisions
        Number types of the runs: see :func:`symgen.build`.
    t_end
        End time [s]; default: the scene's. In chaotic motion errors grow with it until neither the method nor
        the reference is meaningful, which is reported in the notes.
    samples
        Number of equally spaced times at which errors are evaluated.
    repeats
        Number of timings per setting.
    longest
        A sweep ends with the first run that takes longer [s].
    progress
        Callback that receives the completed fraction.

    Raises
    ------
    ModelError
        If a method is unknown, an option is out of range, or the scene is not integrated in time.
    SimulationError
        If the reference cannot reach the end time.
    """
    if repeats < 1 or not longest > 0:
        raise ModelError(f"expected repeats >= 1 and longest > 0 s, got {repeats} and {longest:g} s")
    subject_of_scene = subject(scene, set, backend, t_end, samples, precisions)
    selected = subject_of_scene.chosen(methods)
    try:
        reference = subject_of_scene.reference()
    except SimulationError as error:
        raise SimulationError(
            f"the reference does not reach t_end = {subject_of_scene.t_end:g} s: {error}\n"
            "  Give an earlier --t-end.",
            time=error.time,
            partial=error.partial,
        ) from None
    measured = _Measured(subject_of_scene, reference, longest)
    pairs = [(m, p) for m in selected for p in dict.fromkeys(precisions)]
    sweeps = [subject_of_scene.settings(m, p) for m, p in pairs]
    times = _timed(subject_of_scene, list(chain(*map(measured.worthwhile, sweeps))), repeats, progress)
    points = tuple(measured.point(setting, times[setting]) for setting in times)
    orders = tuple(measured.order(m, p) for m, p in pairs)
    return WorkPrecision(
        title=subject_of_scene.title,
        t_end=subject_of_scene.t_end,
        samples=samples,
        unit=subject_of_scene.unit,
        measured=subject_of_scene.measured,
        reference=reference.about,
        uncertainty=reference.uncertainty,
        points=points,
        orders=orders,
        notes=(*measured.failures.values(), *_of_reference(points, reference, subject_of_scene.unit)),
    )


class _Measured:
    """The runs of a subject by setting, each performed once, and their errors."""

    def __init__(self, subject: StudySubject, reference: ReferenceSolution, longest: float) -> None:
        self.subject, self.reference, self.longest = subject, reference, longest
        self.size = subject.size()
        self.goal = max(_NEAR * reference.uncertainty, _ENOUGH * self.size)
        self.errors: dict[Setting, tuple[float, float, int | None, int | None]] = {}
        self.walls: dict[Setting, float] = {}
        self.failures: dict[str, str] = {}
        self.warm: set[tuple[str, str]] = set()

    def worthwhile(self, sweep: Iterator[Setting]) -> list[Setting]:
        return list(worth_running(sweep, self._run, self.goal, self.longest))

    def _run(self, setting: Setting) -> tuple[float, float]:
        """Run a setting once; return its largest error and its wall time [s]."""
        if setting not in self.errors:
            begun = perf_counter()
            try:
                if (kind := (setting.method, setting.precision)) not in self.warm:
                    # Caches filled by the first call must not end the sweep as too long a run.
                    self.subject.call(setting)
                    self.warm.add(kind)
                    begun = perf_counter()
                result = self.subject.call(setting)
                self.walls[setting] = perf_counter() - begun
                run = self.subject.read(result)
            except SimulationError as error:
                first = str(error).partition("\n")[0]
                self.failures[setting.method] = f"{setting.method} fails with {setting.text}: {first}"
                self.errors[setting] = (math.inf, math.inf, 0, None)
                self.walls[setting] = perf_counter() - begun
                return math.inf, self.walls[setting]
            gaps = distance(run.along, self.reference.along[-len(run.along) :]).tolist()
            self.errors[setting] = (gaps[-1], max(gaps), run.steps, run.evaluations)
        return self.errors[setting][1], self.walls[setting]

    def point(self, setting: Setting, times: Sequence[float]) -> WorkPrecisionPoint:
        end, along, steps, evaluations = self.errors[setting]
        return WorkPrecisionPoint(
            method=setting.method,
            precision=setting.precision,
            setting=setting.text,
            end=end,
            along=along,
            best=min(times),
            median=median(times),
            steps=steps,
            evaluations=evaluations,
            resolved=along > _NEAR * self.reference.uncertainty,
        )

    def order(self, method: str, precision: str) -> Order:
        fixed_steps = self.subject.order_settings(method, precision)
        settings = self.worthwhile(fixed_steps)
        steps, errors = [s.steps or 0 for s in settings], [self.errors[s][0] for s in settings]
        floor = max(self.reference.uncertainty, PRECISIONS[precision].epsilon * self.size)
        observed, used = observed_order(steps, errors, floor, self.size)
        return Order(method, precision, self.subject.orders[method], observed, used)


def _timed(
    measured: StudySubject,
    settings: Sequence[Setting],
    repeats: int,
    progress: Callable[[float], None] | None,
) -> dict[Setting, list[float]]:
    times: dict[Setting, list[float]] = {setting: [] for setting in settings}
    collecting = gc.isenabled()
    gc.disable()
    try:
        for turn in range(repeats):
            for setting, spent in times.items():
                begun = perf_counter()
                measured.call(setting)
                spent.append(perf_counter() - begun)
            if progress:
                progress((turn + 1) / repeats)
    finally:
        if collecting:
            gc.enable()
    return times


def _of_reference(points: Sequence[WorkPrecisionPoint], reference: ReferenceSolution, unit: str) -> list[str]:
    """Return a note if errors are within the uncertainty of the reference."""
    lost = sum(not p.resolved for p in points)
    if not lost:
        return []
    return [
        f"{lost} of {len(points)} errors, marked ~, are within the uncertainty of the reference, "
        f"{reference.uncertainty:.1e} {unit}; in chaos a shorter --t-end makes both smaller"
    ]
