"""Hard cases of rods: no azimuth, rods on a line, lost rank, redundant links, spread masses and lengths."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, cast

import numpy as np

from symgen.pipeline import build
from symgen.runtime.model import Model
from symgen.runtime.result import Result
from symgen.runtime.state import State
from symgen.scene.loading import read_scene
from symgen.scene.schema import Scene
from symgen.study.stability.case import Case, Found, Trial, integrations
from symgen.study.stability.truths import accelerations_error, compound_pendulum, on_circle, peaucellier_arm

#: More steps than any way through a case needs: who takes more does not come to an end.
_MOST_STEPS = 50_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Rods(Case):
    """A linkage run through by every integrator.

    ``error`` takes the model and a result. Integrators that adapt their step have ``rtol``, all others
    ``step``; ``bounds`` says what the error of those named must not pass. What keeps the constraints without
    projecting is there for comparison. ``more`` are further ways through.
    """

    error: Callable[[Model, Result], float]
    rtol: float
    step: float
    bounds: Mapping[str, float]
    scene: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    start: Callable[[Model], State] | None = None
    t_end: float | None = None
    samples: int = 51
    more: tuple[Trial, ...] = ()
    most_drift: float = 1e-12
    family: str = "rods"
    drift_of: str = "constraints [m]"

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Every integrator by its tolerance or step, RK4 without projection, and what is tried besides."""
        found = integrations(self.rtol, self.step, self.bounds)
        found += [Trial("rk4", {"stabilisation": kept, "step": self.step}) for kept in ("baumgarte", "raw")]
        return (*found, *self.more)

    def go(self, trial: Trial) -> Found:
        """Run it and measure."""
        model = _model(self.scene or self.name).with_parameters(**self.parameters)
        begin = self.start(model) if self.start else None
        asked = {"method": trial.method, "samples": self.samples, "max_steps": _MOST_STEPS, **trial.options}
        result = model.simulate(self.t_end, state=begin, **asked)
        statistics = result.statistics
        return Found(
            self.error(model, result), result.drift.constraint, statistics["steps"], statistics["wall_s"]
        )


@cache
def _model(scene: str) -> Model:
    return cast(Model, build(scene))


def _largest(values: Any) -> float:
    return float(np.max(np.abs(values)))


@cache
def _turned() -> Model:
    """Return the linkage of ``vertical_rods`` with its axes permuted: it hangs along x."""
    data = read_scene("vertical_rods").data
    for table in data["points"].values():
        table["at"] = table["at"][2:] + table["at"][:2]
    data["gravity"]["acceleration"] = ["-9.81 m/s^2", "0 m/s^2", "0 m/s^2"]
    data["start"]["velocities"] = {k: v[2:] + v[:2] for k, v in data["start"]["velocities"].items()}
    return cast(Model, build(Scene(**data)))


def _of_vertical_rods(model: Model, result: Result) -> float:
    other = _turned().simulate(rtol=1e-12, samples=len(result.time))
    places = [(other.variable(f"{p}.position").values, result.variable(f"{p}.position").values) for p in "AB"]
    return max(_largest(np.roll(turned, -1, axis=1) - found) for turned, found in places)


def _of_whip(model: Model, result: Result) -> float:
    speed = np.linalg.norm(result.variable("P25.velocity").values, axis=1)
    return abs(float(speed.max()) - 15.7056)


def _of_crank(moment: float, inertia: float, tip: str = "B") -> Callable[[Model, Result], float]:
    """Return the error of a crank of 1 m about the origin, which moves as a compound pendulum."""

    def error(model: Model, result: Result) -> float:
        place = result.variable(f"{tip}.position").values
        first, velocity = place[0], result.variable(f"{tip}.velocity").values[0]
        angle, rate = (
            float(np.arctan2(first[1], first[0])),
            float(first[0] * velocity[1] - first[1] * velocity[0]),
        )
        moved = compound_pendulum(result.time, angle, rate, moment, inertia)
        return _largest(place - on_circle(moved))

    return error


def _of_peaucellier(model: Model, result: Result) -> float:
    expected = peaucellier_arm(float(result.time[-1]))(result.time)
    found = [result.variable(f"{p}.position").values for p in "ABCD"]
    return _largest(np.stack(found, axis=1) - expected)


def _fast(model: Model) -> State:
    """Return the start of the double four-bar with its cranks at 8 rad/s: they go all the way round."""
    begin = model.initial_state()
    pose = {k: begin.positions[k] for k in model.description.free}
    spin = 8 * np.array([-begin.positions["B"][1], begin.positions["B"][0]])
    return model.state(pose, dict.fromkeys(pose, spin))


def _accelerations(scene: str) -> Callable[[Model, Result], float]:
    return lambda model, result: accelerations_error(scene, model, result)


_PLACE = "position [m]"
_RELATIVE = "acceleration at start and end, relative"
#: Cranks of 1 kg/m with inertia m l^2/12 about their middle, the third of 0.09 kg m^2, and a coupler of 2 kg.
_DOUBLE = _of_crank(3.5, 2 * (1 / 12 + 1 / 4) + 0.09 + 1 / 4 + 2)

CASES: tuple[Case, ...] = (
    Rods(
        name="vertical_rods",
        hard="two rods in space exactly along the vertical, where azimuth is undefined",
        measure=_PLACE + " against the linkage with its axes permuted",
        error=_of_vertical_rods,
        rtol=1e-12,
        step=1e-3,
        bounds={"dop853": 1e-9, "dopri5": 1e-7, "rk4": 1e-7, "others": 1e-4},
    ),
    Rods(
        name="collinear_chain",
        hard="ten rods on one line",
        measure=_RELATIVE,
        error=_accelerations("collinear_chain"),
        rtol=1e-11,
        step=5e-4,
        bounds={"others": 1e-12},
    ),
    Rods(
        name="whip",
        hard="25 folded rods unfold, and the tip cracks",
        measure="largest speed of the tip [m/s] against the published 15.7056",
        error=_of_whip,
        rtol=1e-11,
        step=1e-4,
        bounds={"dop853": 2e-4, "dopri5": 2e-4, "rk4": 2e-4, "others": 1e-2},
        t_end=0.4,
        samples=8001,
        more=(Trial("rk4", {"step": 5e-3}),),
    ),
    Rods(
        name="parallelogram",
        hard="14 passages of the collinear state, where another motion branches off",
        measure=_PLACE,
        error=_of_crank(4.0, 1 / 3 + 1 / 3 + 3),
        rtol=1e-12,
        step=1e-3,
        bounds={"dop853": 2e-9, "dopri5": 5e-6, "rk4": 5e-6},
        more=(Trial("rk4", {"step": 5e-2}),),
    ),
    Rods(
        name="peaucellier_limit",
        hard="five rods on one line: rank 7 to 5, and back on the smooth branch",
        measure=_PLACE,
        error=_of_peaucellier,
        rtol=1e-12,
        step=1e-4,
        bounds={"dop853": 1e-9, "dopri5": 1e-8, "rk4": 1e-8},
        t_end=0.4,
    ),
    *(
        Rods(
            name=f"double_four_bar, {excess:g} m",
            hard=f"one redundant crank, longer by {excess:g} m than it may be",
            measure=_PLACE,
            error=_DOUBLE,
            rtol=1e-12,
            step=1e-3,
            bounds={"dop853": 1e-11 + 5 * excess, "rk4": 1e-8 + 5 * excess, "others": 1e-4},
            scene="double_four_bar",
            parameters={"excess": excess},
            samples=31,
        )
        for excess in (0.0, 1e-9, 1e-6)
    ),
    Rods(
        name="double_four_bar all round",
        hard="one redundant crank, through six collinear states",
        measure=_PLACE,
        error=_DOUBLE,
        rtol=1e-12,
        step=1e-3,
        bounds={"dop853": 1e-8, "rk4": 1e-6},
        scene="double_four_bar",
        start=_fast,
        samples=31,
    ),
    Rods(
        name="mass_ratios",
        hard="masses of 1 kg to 1e12 kg in one chain",
        measure=_RELATIVE,
        error=_accelerations("mass_ratios"),
        rtol=1e-10,
        step=1e-5,
        bounds={"others": 1e-13},
        samples=3,
    ),
    Rods(
        name="length_ratios",
        hard="lengths of 1 m and 1 micrometre in one chain",
        measure=_RELATIVE,
        error=_accelerations("length_ratios"),
        rtol=1e-10,
        step=1e-5,
        bounds={"others": 1e-13},
        samples=3,
    ),
    Rods(
        name="far_origin",
        hard="a four-bar linkage 1400 km from the origin",
        measure=_RELATIVE,
        error=_accelerations("far_origin"),
        rtol=1e-7,
        step=1e-3,
        bounds={"others": 1e-13},
        more=(Trial("dopri5", {"rtol": 1e-9}), Trial("radau5", {"rtol": 1e-8})),
        most_drift=1e-8,
        samples=3,
    ),
)
