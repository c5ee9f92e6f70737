"""Test cases for loops: turning points of inputs, special geometry, limits of assembly, poles of forces."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from shared.stability_case import Case, Found, Trial, integrations, largest

from symgen.errors import SimulationError
from symgen.pipeline.build import build
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.result.turn import Turn

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenLoop(Case):
    """A loop over the range of its input: pose by pose, or continued past turning points of the input.

    ``error`` evaluates the result; ``rank`` is that of the screws, which shows redundant closure equations.
    """

    error: Callable[[Turn], float]
    scene: str
    rank: int
    set: Mapping[str, Any] = field(default_factory=dict)
    through: bool = False
    bound: float = 5e-15
    most_drift: float = 4e-14
    family: str = "loops"
    drift_of: str = "closure"

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Pose by pose, and also by arc length if the input has turning points, where pose by pose fails."""
        if self.through:
            return (Trial("pose by pose"), Trial("through", bound=self.bound))
        return (Trial("pose by pose", bound=self.bound),)

    def go(self, trial: Trial) -> Found:
        """Traverse the range and evaluate the error."""
        model = cast(LoopModel, build(self.scene, set=self.set))
        if model.description.rank != self.rank:
            raise SimulationError(f"the screws have rank {model.description.rank}, not {self.rank}")
        turn = cast(Turn, model.inverse_dynamics(through=trial.method == "through"))
        return Found.of(turn, self.error(turn), turn.closure)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeLoop(Case):
    """A loop whose motion is integrated in time by every integrator."""

    scene: str
    rtol: float
    step: float
    bounds: Mapping[str, float]
    most_drift: float = 4e-14
    family: str = "loops"
    drift_of: str = "closure"

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Every explicit integrator with its tolerance or step; the others support points and links only."""
        trials = integrations(self.rtol, self.step, self.bounds)
        return tuple(t for t in trials if INTEGRATORS[t.method].kind == "explicit")

    def go(self, trial: Trial) -> Found:
        """Run a trial and evaluate the energy balance."""
        model = cast(LoopModel, build(self.scene))
        result = model.simulate(method=trial.method, samples=2, **trial.options)
        return Found.of(result, result.drift.relative_energy, result.drift.constraint)


def _values(turn: Turn, *names: str) -> tuple[Array, ...]:
    return tuple(turn.variable(name).values for name in names)


def _of_rocking_crank(turn: Turn) -> float:
    """Return the distance of the coupler's end from the rocker's circle [m]."""
    crank, coupler = _values(turn, "theta1", "theta2")
    end = 0.3 * np.exp(1j * crank) + 0.4 * np.exp(1j * (crank + coupler))
    return largest(np.abs(end - 0.25) - 0.2)


def _of_cardan(turn: Turn) -> float:
    """Return the residual of tan(theta1) tan(theta4) = cos(beta), in a form without poles."""
    one, four = _values(turn, "theta1", "theta4")
    return largest(np.sin(one) * np.sin(four) - np.cos(one) * np.cos(four) * math.cos(math.radians(89)))


def _of_bennett(turn: Turn) -> float:
    """Return the variation of tan(theta1/2) tan(theta2/2), in a form without poles."""
    one, two = (x / 2 for x in _values(turn, "theta1", "theta2"))
    ratio = math.sin(math.radians(70)) / math.sin(math.radians(30))
    return largest(np.sin(one) * np.sin(two) - ratio * np.cos(one) * np.cos(two))


def _of_bricard(turn: Turn) -> float:
    one, two = (np.cos(x) for x in _values(turn, "theta1", "theta2"))
    return largest(one + two + one * two)


#: Metres per inch.
_INCH = 0.0254


def _of_slider(turn: Turn) -> float:
    """Return the distance of the slider from its quadratic's root [in]: 12 in, 50 in, offset 37.99 in."""
    crank, slider = _values(turn, "theta1", "S4")
    slider = slider / _INCH
    across = 12 * np.cos(crank) + 37.99
    return largest(slider - 12 * np.sin(crank) - np.sqrt(2500 - across**2))


def _of_poles(turn: Turn) -> float:
    """Return the error of the dead centres [rad], where no finite load balances a torque."""
    exact = np.radians([90.0, 270.0])
    poles = [pole.at for pole in turn.poles]
    return largest(np.array(poles) - exact) if len(poles) == len(exact) else math.inf


_ANGLES = "relation of the angles"

CASES: tuple[Case, ...] = (
    DrivenLoop(
        name="planar_4r rocking",
        hard="a crank that only oscillates: rates grow without bound at its dead centres",
        measure="gap between ends that should coincide [m]",
        error=_of_rocking_crank,
        scene="planar_4r",
        rank=3,
        set={
            "crank": "0.3 m",
            "coupler": "0.4 m",
            "rocker": "0.2 m",
            "ground": "0.25 m",
            "loop.range": ["-100 deg", "150 deg"],
        },
        through=True,
    ),
    DrivenLoop(
        name="cardan at 89 deg",
        hard="shafts nearly at right angles: the output dwells, then rotates by 180 degrees almost at once",
        measure=_ANGLES,
        error=_of_cardan,
        scene="cardan",
        rank=3,
        bound=2e-14,
        set={"beta": "89 deg"},
    ),
    DrivenLoop(
        name="bennett",
        hard="movable only because of its special lengths: three of six closure equations are redundant",
        measure=_ANGLES,
        error=_of_bennett,
        scene="bennett",
        rank=3,
    ),
    DrivenLoop(
        name="bricard",
        hard="six hinges that move although the mobility count is zero",
        measure=_ANGLES,
        error=_of_bricard,
        scene="bricard",
        rank=5,
    ),
    DrivenLoop(
        name="slider_crank near its limit",
        hard="offset 0.01 in below the largest that permits a full revolution",
        measure="position of the slider [in]",
        error=_of_slider,
        scene="slider_crank",
        rank=6,
        set={"a4": "37.99 in"},
        bound=2e-11,
    ),
    DrivenLoop(
        name="slider_crank, torque given",
        hard="no load balances a torque at the dead centres: the forces have poles",
        measure="position of the poles [rad]",
        error=_of_poles,
        scene="slider_crank",
        rank=6,
        set={"S1": "3.5 in", "loop.drives.theta1": "100 lbf*in", "loop.drives.S4": "?"},
    ),
    FreeLoop(
        name="cssp",
        hard="forward dynamics of a spatial loop, projected after every step",
        measure="energy minus work, over the energy exchanged",
        scene="cssp",
        rtol=1e-10,
        step=1e-3,
        bounds={"dop853": 1e-10, "dopri5": 2e-9, "rk4": 4e-7},
    ),
)
