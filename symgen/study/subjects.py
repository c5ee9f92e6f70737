"""What work and precision are measured on: scenes whose motion is integrated in time, and their errors."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import BuildError, ModelError, SimulationError, nearest
from symgen.pipeline import build_scene
from symgen.precision import FLOAT64, PRECISIONS, precision
from symgen.runtime.beam_methods import BEAM_METHODS
from symgen.runtime.elastic_model import ElasticModel
from symgen.runtime.integrators import INTEGRATORS
from symgen.runtime.loop_model import LoopModel
from symgen.runtime.model import Model
from symgen.runtime.options import TIGHTEST
from symgen.runtime.result import Result
from symgen.scene.linkage import Linkage
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve
from symgen.scene.schema import Scene
from symgen.study.measures import distance, sizes
from symgen.study.peers import PEERS, PeerSetting
from symgen.study.planar_chain import PlanarChain, planar_chain
from symgen.study.sweeps import Setting, fixed_steps, tolerances

Array = NDArray[np.float64]

#: Tolerance of the reference, and how much looser the run is that judges it. Both are loosened tenfold, so
#: many times at most, where the motion does not allow them.
_REFERENCE, _JUDGE, _LOOSENED = {"float128": 1e-17, "float64": 3e-14}, 30.0, 3
#: Steps a turn of the reference of elastic links, and of the run that their peaks are taken from.
_ELASTIC, _PEAKS = 8192, 1024


@dataclass(frozen=True, slots=True)
class Run:
    """What one run recorded, (times, quantities) in the subject's unit, and what it took.

    Some other programs record their end alone at its time.
    """

    along: Array
    steps: int | None
    evaluations: int | None


@dataclass(frozen=True, slots=True)
class Reference:
    """What errors are measured against; ``uncertainty`` is how far a looser one differs from it."""

    along: Array
    uncertainty: float
    about: str


class Subject(ABC):
    """A scene to be integrated by many methods.

    Attributes
    ----------
    title
        What it is called.
    t_end
        Horizon [s].
    unit, measured
        Unit of the errors, and what they are.
    orders
        The methods, with the orders that theory gives them.
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
        """Yield the settings that show the order of a method: fixed steps, rising in number."""

    @abstractmethod
    def call(self, setting: Setting) -> Any:
        """Run once: what is timed."""

    @abstractmethod
    def read(self, result: Any) -> Run:
        """Return what a run recorded."""

    def peers(self) -> tuple[list[Iterator[Setting]], list[str]]:
        """Return sweeps of other programs, and which of them could not be run and why.

        Raises
        ------
        ModelError
            When they cannot be given the scene.
        """
        raise ModelError(f"other programs are given open chains of rods in the plane, not {self.title}")

    @abstractmethod
    def reference(self) -> Reference:
        """Return what errors are measured against."""

    @abstractmethod
    def size(self) -> float:
        """Return the size of the motion, in the unit of the errors."""

    def chosen(self, methods: Sequence[str] | None) -> list[str]:
        """Return the methods asked for, all when none is; raise ModelError for one that is not there."""
        asked = list(self.orders if methods is None else dict.fromkeys(methods))
        for name in asked:
            if name not in self.orders:
                raise ModelError(f"there is no integrator {name!r}. {nearest(name, self.orders)}")
        return asked


def subject(
    scene: Scene | str | os.PathLike[str],
    set: Mapping[str, str] | None = None,
    backend: str = "auto",
    t_end: float | None = None,
    samples: int = 21,
    precisions: Sequence[str] = (FLOAT64.name,),
) -> Subject:
    """Return a scene as a subject, to be run in these precisions.

    Raises
    ------
    ModelError
        When nothing of the scene is integrated in time, or not in a precision.
    """
    for name in precisions:
        precision(name)
    checked = scene if isinstance(scene, Scene) else load_scene(scene, set=set)
    model = build_scene(checked, backend=backend)
    if isinstance(model, LoopModel):
        if model.is_driven:
            raise ModelError(
                f"the inputs of {model.name} move it: nothing is integrated in time\n"
                "  'symgen run' evaluates it, and tells its closure error."
            )
        models = _and_widest(checked, backend, _in_types(checked, backend, precisions, model))
        return FreeLoop(models, t_end, samples)
    if isinstance(model, ElasticModel):
        return Elastic(_in_types(checked, backend, precisions, model), t_end, samples)
    wanted = [f"{p}.position" for p in model.description.free]
    analysis = checked.analysis.model_copy(update={"outputs": wanted})
    watched = checked.model_copy(update={"analysis": analysis})
    models = _and_widest(watched, backend, _in_types(watched, backend, precisions))
    return Rods(models, t_end, samples, watched)


def _in_types(scene: Scene, backend: str, precisions: Sequence[str], plain: Any = None) -> dict[str, Any]:
    """Return the model in each type, float64 among them."""
    models = {FLOAT64.name: plain or build_scene(scene, backend=backend)}
    for name in precisions:
        if name not in models:
            models[name] = build_scene(scene, backend=backend, precision=name)
    return models


def _and_widest(scene: Scene, backend: str, models: dict[str, Any]) -> dict[str, Any]:
    """Add the type that the reference is run in; without a compiler that has it, that is in doubles."""
    with suppress(BuildError, ModelError):
        if "float128" not in models:
            models["float128"] = build_scene(scene, backend=backend, precision="float128")
    return models


class Rods(Subject):
    """A linkage of rods and bodies; errors are distances [m] of points from their places."""

    unit = "m"
    measured = "largest distance of a moving point from its place"

    def __init__(
        self,
        models: Mapping[str, Model | LoopModel],
        t_end: float | None,
        samples: int,
        scene: Scene | None = None,
    ) -> None:
        self.models, self.samples, self._scene = models, samples, scene
        self._others: dict[Setting, tuple[PlanarChain, PeerSetting]] = {}
        model = models[FLOAT64.name]
        self.title = model.description.title
        self.t_end = model.description.t_end if t_end is None else float(t_end)
        self.orders = {name: m.order for name, m in INTEGRATORS.items()}

    def settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield tolerances of a method that adapts its step, steps of others."""
        if not INTEGRATORS[method].adaptive:
            return self.order_settings(method, precision)
        found = tolerances(method, TIGHTEST * PRECISIONS[precision].epsilon)
        return (replace(setting, precision=precision) for setting in found)

    def order_settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield fixed steps; none of a method that always adapts its own."""
        known = INTEGRATORS[method]
        if known.adaptive and known.kind != "explicit":
            return iter(())
        return (replace(setting, precision=precision) for setting in fixed_steps(method, self.t_end))

    def peers(self) -> tuple[list[Iterator[Setting]], list[str]]:
        """Return sweeps of other programs over the same open chain."""
        linkage, model = self._scene and resolve(self._scene), self.models[FLOAT64.name]
        if not (isinstance(linkage, Linkage) and isinstance(model, Model)):
            return super().peers()
        chain, sweeps, missing = planar_chain(linkage, model, self.t_end, self.samples), [], []
        for name, (packages, make) in PEERS.items():
            try:
                sweeps += [self._of_peer(chain, sweep) for sweep in make(chain)]
            except ImportError as error:
                missing.append(
                    f"{name} could not be run: {error}; 'pip install {packages}' (the extra 'peers')"
                )
        return sweeps, missing

    def _of_peer(self, chain: PlanarChain, sweep: Iterator[PeerSetting]) -> Iterator[Setting]:
        for peer in sweep:
            setting = Setting(f"{peer.program}: {peer.series}", peer.text)
            self._others[setting] = chain, peer
            yield setting

    def call(self, setting: Setting) -> Any:
        """Run the motion, in symgen or in another program."""
        if setting in self._others:
            peer = self._others[setting][1]
            try:
                return setting, peer.run()
            except Exception as error:  # whatever another program may raise
                raise SimulationError(f"{peer.program}: {error}") from error
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

    def read(self, result: Any) -> Run:
        """Return the positions of all moving points, (times, points, axes)."""
        if isinstance(result, tuple):
            return self._read_peer(*result)
        along = np.stack([v.values for v in result.variables], axis=1)
        return Run(along, result.statistics["steps"], result.statistics["evaluations"])

    def _read_peer(self, setting: Setting, found: Any) -> Run:
        chain, peer = self._others[setting]
        places = chain.places(peer.angles(found))
        if len(places) not in (1, self.samples) or not np.isfinite(places).all():
            raise SimulationError(f"{peer.program} did not reach the end")
        model = self.models[FLOAT64.name]
        order = [chain.names.index(p) for p in model.description.free]  # type: ignore[union-attr]
        return Run(places[:, order], None, None)

    def reference(self) -> Reference:
        """Return a run at a tolerance as tight as can be met, in the widest precision there is."""
        name = next(p for p in _REFERENCE if p in self.models)
        for k in range(_LOOSENED + 1):
            rtol = _REFERENCE[name] * 10.0**k
            try:
                tight, loose = self._along(rtol, name), self._along(_JUDGE * rtol, name)
            except SimulationError:
                if k == _LOOSENED:
                    raise
                continue
            moved = float(np.max(distance(tight, loose)))
            return Reference(tight, moved, f"dop853 at rtol {rtol:.0e}, {name}")
        raise AssertionError("the last failure is raised")

    def _along(self, rtol: float, precision: str = FLOAT64.name) -> Array:
        return self.read(self.call(Setting("dop853", "", rtol=rtol, precision=precision))).along

    def size(self) -> float:
        """Return the largest range of a coordinate [m]."""
        return float(np.max(np.ptp(self._along(1e-6), axis=0)))


class FreeLoop(Rods):
    """A loop with free variables; errors are those of the outputs that the scene records."""

    unit = "of the largest"
    measured = "largest error of a recorded output over its largest value"

    def __init__(self, models: Mapping[str, LoopModel], t_end: float | None, samples: int) -> None:
        super().__init__(models, t_end, samples)
        self.orders = {name: m.order for name, m in INTEGRATORS.items() if m.kind == "explicit"}
        model = models[FLOAT64.name]
        result = self.call(Setting("dop853", "", rtol=1e-6))
        found = self._outputs(result)
        if not found.size:
            raise ModelError(f"{model.name} records no outputs to compare: list some under analysis.outputs")
        units = [v.unit for v in result.variables for _ in range(v.values.size // len(result.time))]
        self._sizes = sizes(np.max(np.abs(found), axis=0), units)

    @staticmethod
    def _outputs(result: Result) -> Array:
        rows = [v.values.reshape(len(result.time), -1) for v in result.variables]
        return np.concatenate([*rows, np.zeros((len(result.time), 0))], axis=1)

    def read(self, result: Any) -> Run:
        """Return all recorded outputs over their largest values, (times, outputs)."""
        along = self._outputs(result) / self._sizes
        return Run(along, result.statistics["steps"], result.statistics["evaluations"])


class Elastic(Subject):
    """A linkage with elastic links; errors are those of bending strains, each over its peak."""

    unit = "of the peak"
    measured = "largest error of a recorded bending strain over its peak"

    def __init__(self, models: Mapping[str, ElasticModel], t_end: float | None, samples: int) -> None:
        self.models, self.samples = models, samples
        model = models[FLOAT64.name]
        self.title = model.description.title
        motion = model._motion(True)
        turn = motion.period if motion.speed else model.description.t_end
        self.t_end = turn if t_end is None else float(t_end)
        self.revolutions = self.t_end / turn
        self.orders = {name: m.order for name, m in BEAM_METHODS.items()}
        self.orders |= {name: INTEGRATORS[name].order for name in ("dop853", "rk4")}
        peaks = np.max(np.abs(self._strains(self._fixed("gauss", _PEAKS))), axis=0)
        self._peaks = sizes(peaks, [""] * len(peaks))

    @staticmethod
    def _fixed(method: str, steps: int) -> Setting:
        return Setting(method, f"{steps} steps a turn", steps=steps)

    def settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield tolerances of dop853, steps a turn of others."""
        if method != "dop853":
            return self.order_settings(method, precision)
        return (replace(setting, precision=precision) for setting in tolerances(method, 1e-11))

    def order_settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield steps a turn; none of dop853, which adapts its own here."""
        counts = () if method == "dop853" else (round(256 * 2 ** (k / 2)) for k in range(17))
        return (replace(self._fixed(method, n), precision=precision) for n in counts)

    def call(self, setting: Setting) -> Result:
        """Run the elastic motion; with fixed steps a run with half of them is part of it."""
        given = {"steps": setting.steps} if setting.rtol is None else {"rtol": setting.rtol}
        model = self.models[setting.precision]
        return model.run(setting.method, revolutions=self.revolutions, samples=self.samples, **given)

    def _strains(self, setting: Setting) -> Array:
        return self._of(self.call(setting))

    def _of(self, result: Result) -> Array:
        strains = [v.values for v in result.variables if v.name.endswith(".bending_strain")]
        return np.stack(strains, axis=1)

    def read(self, result: Result) -> Run:
        """Return all recorded bending strains over their peaks, (times, strains)."""
        return Run(self._of(result) / self._peaks, result.statistics["steps"], None)

    def reference(self) -> Reference:
        """Return Gauss collocation with many steps."""
        tight, loose = (
            self._strains(self._fixed("gauss", n)) / self._peaks for n in (_ELASTIC, _ELASTIC // 2)
        )
        about = f"Gauss collocation of order {self.orders['gauss']}, {_ELASTIC} steps a turn"
        return Reference(tight, float(np.max(distance(tight, loose))), about)

    def size(self) -> float:
        """Return 1: errors are parts of peaks."""
        return 1.0
