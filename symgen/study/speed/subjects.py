"""Subjects of work-precision measurements: scenes integrated in time, with their error measures."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symgen.errors import BuildError, ModelError, SimulationError, check_known
from symgen.methods import method_of
from symgen.pipeline.build import build_scene
from symgen.precision import FLOAT64, PRECISIONS, precision
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.integrate.options import TIGHTEST
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.result import Result
from symgen.runtime.rods.model.rods import RodModel
from symgen.scene.loading import load_scene
from symgen.scene.schema import Scene
from symgen.study.speed.measures import distance, sizes
from symgen.study.speed.sweeps import Setting, fixed_steps, tolerances

Array = NDArray[np.float64]

#: Tolerances of the reference, by number type.
REFERENCE = {"float128": 1e-17, "float64": 3e-14}
#: Tolerance of the looser run, which estimates the uncertainty of the reference, over that of the reference.
_JUDGE = 30.0
#: Number of times that both are loosened tenfold at most, if the motion does not allow them.
_LOOSENED = 3


@dataclass(frozen=True, slots=True)
class StudyRun:
    """Recorded values (times, quantities) of one run in the subject's unit, with its statistics."""

    along: Array
    steps: int | None
    evaluations: int | None


@dataclass(frozen=True, slots=True)
class ReferenceSolution:
    """Reference solution; ``uncertainty`` is its distance from a looser one."""

    along: Array
    uncertainty: float
    about: str


class StudySubject(ABC):
    """A scene to be integrated with many methods.

    Attributes
    ----------
    title
        Title of the scene.
    t_end
        End time [s].
    unit, measured
        Unit and description of the errors.
    orders
        The methods with their theoretical orders.
    """

    title: str
    t_end: float
    unit: str
    measured: str
    orders: Mapping[str, int]

    @abstractmethod
    def settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield the settings of a method in a precision, loose to tight."""

    @abstractmethod
    def order_settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield the settings for the order of a method: increasing numbers of fixed steps."""

    @abstractmethod
    def call(self, setting: Setting) -> Any:
        """Run once; this call is timed."""

    @abstractmethod
    def read(self, result: Any) -> StudyRun:
        """Return the recorded values of a run."""

    @abstractmethod
    def reference(self) -> ReferenceSolution:
        """Return the reference solution."""

    @abstractmethod
    def size(self) -> float:
        """Return the size of the motion, in the unit of the errors."""

    def chosen(self, methods: Sequence[str] | None) -> list[str]:
        """Return the selected methods, by default all; raise ModelError for an unknown one."""
        selected = list(self.orders if methods is None else dict.fromkeys(methods))
        for name in selected:
            check_known(name, self.orders, "there is no integrator")
        return selected


def subject(
    scene: Scene | str | os.PathLike[str],
    set: Mapping[str, str] | None = None,
    backend: str = "auto",
    t_end: float | None = None,
    samples: int = 21,
    precisions: Sequence[str] = (FLOAT64.name,),
) -> StudySubject:
    """Return a scene as a subject, to be run in the given precisions.

    Raises
    ------
    ModelError
        If the scene is not integrated in time, or not in a precision.
    """
    for name in precisions:
        precision(name)
    checked = scene if isinstance(scene, Scene) else load_scene(scene, set=set)
    model = build_scene(checked, backend=backend)
    request = StudyRequest(checked, backend, precisions, t_end, samples)
    return method_of(model).load("subject")(model, request)


class StudyRequest(NamedTuple):
    """Subject of a study and its settings: see :func:`subject`."""

    scene: Scene
    backend: str
    precisions: Sequence[str]
    t_end: float | None
    samples: int


def loop(model: LoopModel, request: StudyRequest) -> StudySubject:
    """Return a loop under forces as a subject; errors as of :func:`subject`."""
    if model.is_driven:
        raise ModelError(
            f"the inputs of {model.name} move it: nothing is integrated in time\n"
            "  'symgen inverse-dynamics' evaluates it and prints its closure error."
        )
    return FreeLoop(_and_widest(request, in_types(request, model)), request.t_end, request.samples)


def rods(model: RodModel, request: StudyRequest) -> StudySubject:
    """Return a linkage of rods and bodies as a subject."""
    outputs = [f"{p}.position" for p in model.description.free]
    analysis = request.scene.analysis.model_copy(update={"outputs": outputs})
    watched = request._replace(scene=request.scene.model_copy(update={"analysis": analysis}))
    models = _and_widest(watched, in_types(watched))
    return Rods(models, request.t_end, request.samples)


def in_types(request: StudyRequest, plain: Any = None) -> dict[str, Any]:
    """Return the model in each number type, including float64."""
    scene, backend = request.scene, request.backend
    models = {FLOAT64.name: plain or build_scene(scene, backend=backend)}
    for name in request.precisions:
        if name not in models:
            models[name] = build_scene(scene, backend=backend, precision=name)
    return models


def _and_widest(request: StudyRequest, models: dict[str, Any]) -> dict[str, Any]:
    """Add the model in the reference's number type, or double precision if no compiler supports it."""
    with suppress(BuildError, ModelError):
        if "float128" not in models:
            models["float128"] = build_scene(request.scene, backend=request.backend, precision="float128")
    return models


class Rods(StudySubject):
    """A linkage of rods and bodies; errors are distances [m] between points and their reference positions."""

    unit = "m"
    measured = "largest distance of a moving point from its reference position"

    def __init__(self, models: Mapping[str, RodModel | LoopModel], t_end: float | None, samples: int) -> None:
        self.models, self.samples = models, samples
        model = models[FLOAT64.name]
        self.title = model.description.title
        self.t_end = model.description.t_end if t_end is None else float(t_end)
        self.orders = {name: m.order for name, m in INTEGRATORS.items()}

    def settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield tolerances for adaptive methods, numbers of steps for others."""
        if not INTEGRATORS[method].adaptive:
            return self.order_settings(method, precision)
        settings = tolerances(method, TIGHTEST * PRECISIONS[precision].epsilon)
        return (replace(setting, precision=precision) for setting in settings)

    def order_settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield fixed steps; nothing for methods that are always adaptive."""
        known = INTEGRATORS[method]
        if known.adaptive and known.kind != "explicit":
            return iter(())
        return (replace(setting, precision=precision) for setting in fixed_steps(method, self.t_end))

    def call(self, setting: Setting) -> Any:
        """Run the motion."""
        result = self.models[setting.precision].simulate(
            self.t_end, method=setting.method, rtol=setting.rtol, step=setting.step, samples=self.samples
        )
        if result.statistics["t"] < self.t_end:
            last = result.events[-1]
            raise SimulationError(
                f"the event {last.name!r} ends the run at t = {last.time:.9g} s",
                time=last.time,
                partial=result,
            )
        return result

    def read(self, result: Any) -> StudyRun:
        """Return the positions of all moving points, (times, points, axes)."""
        along = np.stack([v.values for v in result.variables], axis=1)
        return StudyRun(along, result.statistics["steps"], result.statistics["evaluations"])

    def reference(self) -> ReferenceSolution:
        """Return a run at the tightest possible tolerance, in the widest available precision."""
        name = next(p for p in REFERENCE if p in self.models)
        for k in range(_LOOSENED + 1):
            rtol = REFERENCE[name] * 10.0**k
            try:
                tight, loose = self._along(rtol, name), self._along(_JUDGE * rtol, name)
            except SimulationError:
                if k == _LOOSENED:
                    raise
                continue
            moved = float(np.max(distance(tight, loose)))
            return ReferenceSolution(tight, moved, f"dop853 at rtol {rtol:.0e}, {name}")
        raise AssertionError("the last failure is raised")

    def _along(self, rtol: float, precision: str = FLOAT64.name) -> Array:
        return self.read(self.call(Setting("dop853", "", rtol=rtol, precision=precision))).along

    def size(self) -> float:
        """Return the largest range of a coordinate [m]."""
        return float(np.max(np.ptp(self._along(1e-6), axis=0)))


class FreeLoop(Rods):
    """A loop with free variables; errors are those of the recorded outputs."""

    unit = "of the largest"
    measured = "largest error of a recorded output over its largest value"

    def __init__(self, models: Mapping[str, LoopModel], t_end: float | None, samples: int) -> None:
        super().__init__(models, t_end, samples)
        self.orders = {name: m.order for name, m in INTEGRATORS.items() if m.kind == "explicit"}
        model = models[FLOAT64.name]
        result = self.call(Setting("dop853", "", rtol=1e-6))
        outputs = self._outputs(result)
        if not outputs.size:
            raise ModelError(f"{model.name} records no outputs to compare: list some under analysis.outputs")
        units = [v.unit for v in result.variables for _ in range(v.values.size // result.count)]
        self._sizes = sizes(np.max(np.abs(outputs), axis=0), units)

    @staticmethod
    def _outputs(result: Result) -> Array:
        rows = [v.values.reshape(result.count, -1) for v in result.variables]
        return np.concatenate([*rows, np.zeros((result.count, 0))], axis=1)

    def read(self, result: Any) -> StudyRun:
        """Return all recorded outputs relative to their largest values, (times, outputs)."""
        along = self._outputs(result) / self._sizes
        return StudyRun(along, result.statistics["steps"], result.statistics["evaluations"])
