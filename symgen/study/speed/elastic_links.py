"""Elastic motions as subjects of studies of speed; errors are those of bending strains over their peaks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.precision import FLOAT64
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.result.result import Result
from symgen.study.speed.measures import distance, sizes
from symgen.study.speed.subjects import ReferenceSolution, StudyRequest, StudyRun, StudySubject, in_types
from symgen.study.speed.sweeps import Setting, tolerances

Array = NDArray[np.float64]

#: Steps per revolution of the reference of elastic links.
_REFERENCE_STEPS = 8192
#: Steps per revolution of the run that determines peak values.
_PEAK_STEPS = 1024


def elastic(model: ElasticModel, request: StudyRequest) -> StudySubject:
    """Return a linkage with elastic links as a subject."""
    return ElasticSubject(in_types(request, model), request.t_end, request.samples)


class ElasticSubject(StudySubject):
    """A linkage with elastic links; errors are those of bending strains, relative to their peaks."""

    unit = "of the peak"
    measured = "largest error of a recorded bending strain over its peak"

    def __init__(self, models: Mapping[str, ElasticModel], t_end: float | None, samples: int) -> None:
        self.models, self.samples = models, samples
        model = models[FLOAT64.name]
        self.title = model.description.title
        motion = model.motion(True)
        turn = motion.period if motion.speed else model.description.t_end
        self.t_end = turn if t_end is None else float(t_end)
        self.revolutions = self.t_end / turn
        self.orders = {name: m.order for name, m in BEAM_METHODS.items()}
        self.orders |= {name: INTEGRATORS[name].order for name in ("dop853", "rk4")}
        peaks = np.max(np.abs(self._strains(self._fixed("gauss", _PEAK_STEPS))), axis=0)
        self._peaks = sizes(peaks, [""] * len(peaks))

    @staticmethod
    def _fixed(method: str, steps: int) -> Setting:
        return Setting(method, f"{steps} steps per revolution", steps=steps)

    def settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield tolerances of dop853, steps per revolution of other methods."""
        if method != "dop853":
            return self.order_settings(method, precision)
        return (replace(setting, precision=precision) for setting in tolerances(method, 1e-11))

    def order_settings(self, method: str, precision: str) -> Iterator[Setting]:
        """Yield steps per revolution; nothing for dop853, which is adaptive here."""
        counts = () if method == "dop853" else (round(256 * 2 ** (k / 2)) for k in range(17))
        return (replace(self._fixed(method, n), precision=precision) for n in counts)

    def call(self, setting: Setting) -> Result:
        """Run the elastic motion; with fixed steps, this includes a run with half the number of steps."""
        accuracy = {"steps": setting.steps} if setting.rtol is None else {"rtol": setting.rtol}
        model = self.models[setting.precision]
        return model.simulate(
            method=setting.method, revolutions=self.revolutions, samples=self.samples, **accuracy
        )

    def _strains(self, setting: Setting) -> Array:
        return self._of(self.call(setting))

    def _of(self, result: Result) -> Array:
        strains = [v.values for v in result.variables if v.name.endswith(".bending_strain")]
        if not strains:
            raise ModelError(
                f"{self.title}: errors of elastic links are those of bending strains, none in outputs\n"
                '  Add one, such as "rod.bending_strain", to outputs under [analysis].'
            )
        return np.stack(strains, axis=1)

    def read(self, result: Result) -> StudyRun:
        """Return all recorded bending strains relative to their peaks, (times, strains)."""
        return StudyRun(self._of(result) / self._peaks, result.statistics["steps"], None)

    def reference(self) -> ReferenceSolution:
        """Return a solution by Gauss collocation with many steps."""
        tight, loose = (
            self._strains(self._fixed("gauss", n)) / self._peaks
            for n in (_REFERENCE_STEPS, _REFERENCE_STEPS // 2)
        )
        about = f"Gauss collocation of order {self.orders['gauss']}, {_REFERENCE_STEPS} steps per revolution"
        return ReferenceSolution(tight, float(np.max(distance(tight, loose))), about)

    def size(self) -> float:
        """Return 1: errors are relative to peak values."""
        return 1.0
