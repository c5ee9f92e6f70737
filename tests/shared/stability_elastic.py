"""Test cases for elastic links: undamped, axially stiff, unstable speeds, and growth within a revolution."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, cast

from shared.stability_case import Case, Found, Trial, largest, model_of

from symgen.errors import SimulationError
from symgen.runtime.elastic.model import METHODS
from symgen.runtime.result.elastic import ElasticResult

#: Adaptive methods; all others have a number of steps.
_BY_TOLERANCE = ("gauss", "gauss4", "dop853")
_SAMPLES, _TIGHT = 91, 1e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class Turning(Case):
    """One revolution from rest by every method, against DOP853, or against Gauss collocation for DOP853."""

    scene: str
    bounds: Mapping[str, float]
    options: Mapping[str, Any] = field(default_factory=dict)
    steps: int = 2250
    rtol: float = 1e-5
    too_few: int = 1024
    measure: str = "bending strains, relative to their peak"
    family: str = "elastic links"

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Every method, and an explicit one with too few steps for the highest frequency."""
        trials = []
        for name in METHODS:
            size = {"rtol": self.rtol} if name in _BY_TOLERANCE else {"steps": self.steps}
            trials.append(Trial(name, size, self.bounds.get(name)))
        return (*trials, Trial("rk4", {"steps": self.too_few}))

    def go(self, trial: Trial) -> Found:
        """Run a trial and compare the bending strains of all stations."""
        result = model_of(self.scene).simulate(
            method=trial.method, samples=_SAMPLES, **self.options, **trial.options
        )
        other = "gauss" if trial.method == "dop853" else "dop853"
        truth = _reference(self.scene, other, tuple(self.options.items()))
        strains = (v for v in truth.variables if v.name.endswith("bending_strain"))
        errors = (largest(result.variable(v.name).values - v.values) / largest(v.values) for v in strains)
        return Found.of(result, max(errors, default=0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Steady(Case):
    """Steady state at a speed and its stability; the error is that of the largest Floquet multiplier.

    ``stable`` is the expected verdict. Without damping, the multiplier of a stable state is one; otherwise it
    is compared with the result for four times as many steps.
    """

    scene: str
    rpm: float
    stable: bool
    undamped: bool = False
    bound: float = 1e-4
    measure: str = "largest Floquet multiplier, relative"
    family: str = "elastic links"

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The method for steady states."""
        return (Trial("periodic", bound=self.bound),)

    def go(self, trial: Trial) -> Found:
        """Compute the steady state, check the verdict, and compare the multiplier."""
        model = model_of(self.scene).with_parameters(speed=self.rpm * math.pi / 30)
        result = model.periodic(samples=_SAMPLES)
        if result.stable is not self.stable:
            verdict = {True: "stable", False: "unstable", None: "not known"}
            raise SimulationError(f"found {verdict[result.stable]}, and it is {verdict[self.stable]}")
        exact = 1.0
        if not self.undamped:
            more = model.periodic(samples=_SAMPLES, steps=4 * result.statistics["steps"])
            exact = abs(more.floquet[0])
        error = abs(abs(result.floquet[0]) / exact - 1.0)
        return Found.of(result, error)


@cache
def _reference(scene: str, method: str, options: tuple[tuple[str, Any], ...]) -> ElasticResult:
    result = model_of(scene).simulate(method=method, samples=_SAMPLES, rtol=_TIGHT, **dict(options))
    return cast(ElasticResult, result)


#: Implicit methods with a step that resolves only the lowest frequencies.
_COARSE = {"newmark": 0.1, "generalized-alpha": 0.1}
#: The same for strains that grow without vibration.
_SMOOTH = {"newmark": 1e-3, "generalized-alpha": 1e-3}

# Adaptive runs are at rtol 1e-5. gauss and gauss4 take the steps that it needs, so their errors lie little
# below it. dop853 errs by 3e-7 or 1.2e-6 on the slider-crank: constraints eliminated densely, or by a border.

CASES: tuple[Case, ...] = (
    Turning(
        name="thesis_four_bar",
        hard="undamped, with high axial stiffness: vibrations of 8 Hz and of 4.6 kHz",
        scene="thesis_four_bar",
        bounds={"gauss": 2e-8, "gauss4": 5e-8, "dop853": 5e-5, "rk4": 1e-2, **_COARSE},
    ),
    Turning(
        name="elastic_four_bar_free, thesis",
        hard="free crank without geometric stiffness: strains grow 1e4 times per revolution",
        scene="elastic_four_bar_free",
        bounds={"gauss": 5e-7, "gauss4": 5e-7, "dop853": 5e-7, "rk4": 1e-3, **_SMOOTH},
        options={"form": "thesis", "geometric_stiffness": False},
    ),
    Turning(
        name="elastic_slider_crank",
        hard="damped, with a prismatic joint",
        scene="elastic_slider_crank",
        bounds={"gauss": 1e-7, "gauss4": 1e-6, "dop853": 2e-6, "rk4": 2e-3, **_COARSE},
    ),
    Steady(
        name="thesis_four_bar at 250 rpm",
        hard="undamped, with vibrations that hardly appear in its strains",
        scene="thesis_four_bar",
        rpm=250.0,
        stable=True,
        undamped=True,
        bound=5e-7,
    ),
    Steady(
        name="thesis_four_bar at 110 rpm",
        hard="an unstable speed: a steady state that no transient run reaches",
        scene="thesis_four_bar",
        rpm=110.0,
        bound=9e-11,
        stable=False,
    ),
    Steady(
        name="thesis_four_bar at 373 rpm",
        hard="an unstable speed, far above the lowest frequency",
        scene="thesis_four_bar",
        rpm=373.0,
        bound=2e-10,
        stable=False,
    ),
)
