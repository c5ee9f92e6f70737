"""Hard cases of elastic links: undamped, stiff along the links, unstable speeds, what grows in a turn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, cast

import numpy as np

from symgen.errors import SimulationError
from symgen.pipeline import build
from symgen.runtime.elastic_model import METHODS, ElasticModel
from symgen.runtime.elastic_result import ElasticResult
from symgen.study.stability.case import Case, Found, Trial

#: Methods that choose their steps by a tolerance; all others are given a number of steps.
_BY_TOLERANCE = ("gauss", "gauss4", "dop853")
_NO_STEPS = ("quasi-static", "periodic")
_SAMPLES, _TIGHT = 91, 1e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class Turning(Case):
    """One turn from rest by every method, against a method of another kind: DOP853, and Gauss for that."""

    scene: str
    bounds: Mapping[str, float]
    options: Mapping[str, Any] = field(default_factory=dict)
    steps: int = 2250
    rtol: float = 1e-5
    too_few: int = 1024
    measure: str = "bending strains over their peak"
    most_drift: float = math.inf
    family: str = "elastic links"
    drift_of: str = ""

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Every method, and an explicit one with too few steps for the fastest vibration."""
        found = []
        for name in (m for m in METHODS if m not in _NO_STEPS):
            size = {"rtol": self.rtol} if name in _BY_TOLERANCE else {"steps": self.steps}
            found.append(Trial(name, size, self.bounds.get(name)))
        return (*found, Trial("rk4", {"steps": self.too_few}))

    def go(self, trial: Trial) -> Found:
        """Run it and compare the bending strains of all stations."""
        result = _model(self.scene).run(trial.method, samples=_SAMPLES, **self.options, **trial.options)
        other = "gauss" if trial.method == "dop853" else "dop853"
        truth = _reference(self.scene, other, tuple(self.options.items()))
        worst = 0.0
        for v in truth.variables:
            if v.name.endswith("bending_strain"):
                peak = float(np.max(np.abs(v.values)))
                worst = max(worst, float(np.max(np.abs(result.variable(v.name).values - v.values))) / peak)
        return Found(worst, 0.0, result.statistics["steps"], result.statistics["wall_s"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Steady(Case):
    """The steady state at a speed, and whether it is stable; the error is that of its largest multiplier.

    ``stable`` is the verdict that must come out. Where nothing damps, the multiplier of a stable state is
    one; elsewhere it is compared with that of four times as many steps.
    """

    scene: str
    rpm: float
    stable: bool
    undamped: bool = False
    bound: float = 1e-4
    measure: str = "largest Floquet multiplier, relative"
    most_drift: float = math.inf
    family: str = "elastic links"
    drift_of: str = ""

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The one method for steady states."""
        return (Trial("periodic", bound=self.bound),)

    def go(self, trial: Trial) -> Found:
        """Find it, judge the verdict, and compare the multiplier."""
        model = _model(self.scene).with_parameters(speed=self.rpm * math.pi / 30)
        result = model.run("periodic", samples=_SAMPLES)
        statistics = result.statistics
        if result.stable is not self.stable:
            said = {True: "stable", False: "unstable", None: "not known"}
            raise SimulationError(f"found {said[result.stable]}, and it is {said[self.stable]}")
        exact = 1.0
        if not self.undamped:
            more = model.run("periodic", samples=_SAMPLES, steps=4 * statistics["steps"])
            exact = abs(more.floquet[0])
        error = abs(abs(result.floquet[0]) / exact - 1.0)
        return Found(error, 0.0, statistics["steps"], statistics["wall_s"])


@cache
def _model(scene: str) -> ElasticModel:
    return cast(ElasticModel, build(scene))


@cache
def _reference(scene: str, method: str, options: tuple[tuple[str, Any], ...]) -> ElasticResult:
    return _model(scene).run(method, samples=_SAMPLES, rtol=_TIGHT, **dict(options))


_BOUNDS = {
    "gauss": 1e-5,
    "gauss4": 1e-5,
    "dop853": 1e-4,
    "rk4": 0.1,
    "newmark": 0.1,
    "generalized-alpha": 0.1,
}

CASES: tuple[Case, ...] = (
    Turning(
        name="elastic_four_bar",
        hard="undamped, and stiff along its links: vibrations of 8 Hz and of 4.6 kHz",
        scene="elastic_four_bar",
        bounds=_BOUNDS,
    ),
    Turning(
        name="elastic_four_bar_free, thesis",
        hard="nothing holds the crank, no axial force stiffens links: strains grow 1e4 times in a turn",
        scene="elastic_four_bar_free",
        bounds=_BOUNDS,
        options={"form": "thesis", "geometric_stiffness": False},
    ),
    Turning(
        name="elastic_slider_crank",
        hard="damped, with a joint that slides",
        scene="elastic_slider_crank",
        bounds=_BOUNDS,
    ),
    Steady(
        name="elastic_four_bar at 250 rpm",
        hard="undamped, with vibrations that its strains hardly show",
        scene="elastic_four_bar",
        rpm=250.0,
        stable=True,
        undamped=True,
        bound=1e-6,
    ),
    Steady(
        name="elastic_four_bar at 110 rpm",
        hard="an unstable speed: a steady state that no run would come to",
        scene="elastic_four_bar",
        rpm=110.0,
        stable=False,
    ),
    Steady(
        name="elastic_four_bar at 373 rpm",
        hard="an unstable speed, far above the lowest frequency",
        scene="elastic_four_bar",
        rpm=373.0,
        stable=False,
    ),
)
