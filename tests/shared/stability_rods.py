"""Test cases for rods: undefined azimuth, collinear rods, rank loss, redundancy, widely different scales."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from shared.stability_case import Case, Found, Trial, integrations, largest, model_of
from shared.stability_truths import (
    compound_pendulum,
    four_bar,
    hanging_chain,
    on_circle,
    peaucellier_arm,
    spatial_double_pendulum,
)

from symgen.runtime.result.result import Result
from symgen.runtime.result.state import State
from symgen.runtime.rods.model.rods import RodModel

#: Integrators in the order of bounds of their errors.
_METHODS = (
    "dop853", "dopri5", "rk4", "rattle", "rattle4", "rattle6", "rattle8", "radau5", "generalized-alpha",
    "newmark",
)  # fmt: skip
#: Maximum number of steps: a run that needs more counts as not completed.
_MOST_STEPS = 50_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Rods(Case):
    """A linkage simulated by every integrator.

    ``error`` takes the model and a result. Adaptive integrators use ``rtol``, all others ``step``; ``bounds``
    are the error bounds by integrator. Constraint stabilisation without projection is run for comparison.
    ``more`` are further trials.
    """

    error: Callable[[RodModel, Result], float]
    rtol: float
    step: float
    bounds: Mapping[str, float]
    scene: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    start: Callable[[RodModel], State] | None = None
    t_end: float | None = None
    samples: int = 51
    more: tuple[Trial, ...] = ()
    most_drift: float = 1e-14
    family: str = "rods"
    drift_of: str = "constraints [m]"

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Every integrator with its tolerance or step, RK4 without projection, and further trials."""
        trials = integrations(self.rtol, self.step, self.bounds)
        trials += [
            Trial("rk4", {"stabilisation": stabilisation, "step": self.step})
            for stabilisation in ("baumgarte", "raw")
        ]
        return (*trials, *self.more)

    def go(self, trial: Trial) -> Found:
        """Run a trial and evaluate the error."""
        model = model_of(self.scene or self.name).with_parameters(**self.parameters)
        begin = self.start(model) if self.start else None
        options = {"method": trial.method, "samples": self.samples, "max_steps": _MOST_STEPS, **trial.options}
        result = model.simulate(self.t_end, state=begin, **options)
        return Found.of(result, self.error(model, result), result.drift.constraint)


def _of_vertical_rods(model: RodModel, result: Result) -> float:
    exact = spatial_double_pendulum(tuple(result.time.tolist()))
    positions = [result.variable(f"{p}.position").values for p in "AB"]
    return largest(np.stack(positions, axis=1) - exact)


def _of_whip(model: RodModel, result: Result) -> float:
    speed = np.linalg.norm(result.variable("P25.velocity").values, axis=1)
    return abs(float(speed.max()) - 15.7056)


def _of_crank(moment: float, inertia: float) -> Callable[[RodModel, Result], float]:
    """Return the error function of a crank of 1 m about the origin, which moves as a compound pendulum."""

    def error(model: RodModel, result: Result) -> float:
        place = result.variable("B.position").values
        first, velocity = place[0], result.variable("B.velocity").values[0]
        angle, rate = (
            float(np.arctan2(first[1], first[0])),
            float(first[0] * velocity[1] - first[1] * velocity[0]),
        )
        moved = compound_pendulum(result.time, angle, rate, moment, inertia)
        return largest(place - on_circle(moved))

    return error


def _of_peaucellier(model: RodModel, result: Result) -> float:
    expected = peaucellier_arm(float(result.time[-1]))(result.time)
    positions = [result.variable(f"{p}.position").values for p in "ABCD"]
    return largest(np.stack(positions, axis=1) - expected)


def _fast(model: RodModel) -> State:
    """Return the start of the double four-bar with cranks at 8 rad/s, enough for full revolutions."""
    begin = model.initial_state()
    pose = {k: begin.positions[k] for k in model.description.free}
    spin = 8 * np.array([-begin.positions["B"][1], begin.positions["B"][0]])
    return model.state(pose, dict.fromkeys(pose, spin))


def _of_chain(scene: str) -> Callable[[RodModel, Result], float]:
    """Return the error function of the second and the last point of a chain of rods, released at rest."""

    def error(model: RodModel, result: Result) -> float:
        expected = hanging_chain(scene, tuple(result.time.tolist()))[:, [0, -1]]
        free = model.description.free
        positions = [result.variable(f"{p}.position").values for p in (free[0], free[-1])]
        return largest(np.stack(positions, axis=1) - expected)

    return error


def _of_four_bar(model: RodModel, result: Result) -> float:
    positions = [result.variable(f"{p}.position").values - 1e6 for p in "AB"]
    return largest(np.stack(positions, axis=1) - four_bar(float(result.time[-1]))(result.time))


def _bounds(*errors: float) -> dict[str, float]:
    return dict(zip(_METHODS, errors, strict=True))


_PLACE = "position [m]"
_CHAIN = _PLACE + " against Gauss's principle in the angles of the rods"
#: Cranks of 1 kg/m with inertia m l^2/12 about their middle, the third of 0.09 kg m^2, and a coupler of 2 kg.
_DOUBLE = _of_crank(3.5, 2 * (1 / 12 + 1 / 4) + 0.09 + 1 / 4 + 2)
#: Errors of a crank of exact length [m].
_DOUBLE_BOUNDS = _bounds(1e-11, 6e-12, 4e-11, 2e-5, 7e-12, 1e-12, 1e-12, 6e-10, 4e-5, 4e-5)

CASES: tuple[Case, ...] = (
    Rods(
        name="vertical_rods",
        hard="two rods in space exactly along the vertical, where azimuth is undefined",
        measure=_PLACE + " against Lagrange's equations in the directions of the rods",
        error=_of_vertical_rods,
        rtol=1e-12,
        step=1e-3,
        bounds=_bounds(4e-13, 4e-12, 2e-10, 3e-5, 4e-11, 3e-13, 3e-13, 6e-10, 6e-5, 6e-5),
    ),
    Rods(
        name="collinear_chain",
        hard="ten rods on one line",
        measure=_CHAIN,
        error=_of_chain("collinear_chain"),
        rtol=1e-11,
        step=5e-4,
        bounds=_bounds(8e-12, 8e-12, 5e-12, 4e-7, 1e-12, 1e-12, 1e-12, 5e-10, 6e-7, 6e-7),
    ),
    Rods(
        name="whip",
        hard="25 folded rods unfold, and the tip cracks",
        measure="largest speed of the tip [m/s] against the published 15.7056",
        error=_of_whip,
        rtol=1e-11,
        step=1e-4,
        bounds={"generalized-alpha": 1e-2, "newmark": 1e-2, "others": 2e-4},
        t_end=0.4,
        samples=8001,
        more=(Trial("rk4", {"step": 5e-3}),),
    ),
    Rods(
        name="parallelogram",
        hard="14 passages through the collinear state, where another motion branches off",
        measure=_PLACE,
        error=_of_crank(4.0, 1 / 3 + 1 / 3 + 3),
        rtol=1e-12,
        step=1e-3,
        bounds={"dop853": 2e-11, "dopri5": 1e-9, "rk4": 4e-8},
        more=(Trial("rk4", {"step": 5e-2}),),
    ),
    Rods(
        name="peaucellier_limit",
        hard="five collinear rods: rank drops from 7 to 5, and the motion continues on the smooth branch",
        measure=_PLACE,
        error=_of_peaucellier,
        rtol=1e-12,
        step=1e-4,
        bounds={"dop853": 2e-11, "dopri5": 1e-9, "rk4": 6e-11},
        t_end=0.4,
    ),
    *(
        Rods(
            name=f"double_four_bar, {excess:g} m",
            hard=f"one redundant crank, too long by {excess:g} m",
            measure=_PLACE,
            error=_DOUBLE,
            rtol=1e-12,
            step=1e-3,
            bounds={name: error + 0.8 * excess for name, error in _DOUBLE_BOUNDS.items()},
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
        bounds={"dop853": 1e-8, "rk4": 1e-8},
        scene="double_four_bar",
        start=_fast,
        samples=31,
    ),
    Rods(
        name="mass_ratios",
        hard="masses of 1 kg to 1e12 kg in one chain",
        measure=_CHAIN,
        error=_of_chain("mass_ratios"),
        rtol=1e-10,
        step=1e-5,
        bounds=_bounds(1e-13, 1e-13, 1e-13, 3e-10, 1e-13, 3e-13, 1e-13, 2e-12, 6e-10, 6e-10),
        samples=3,
    ),
    Rods(
        name="length_ratios",
        hard="lengths of 1 m and 1 micrometre in one chain",
        measure=_CHAIN,
        error=_of_chain("length_ratios"),
        rtol=1e-10,
        step=1e-5,
        bounds=_bounds(5e-14, 1e-13, 2e-12, 3e-9, 4e-13, 2e-13, 1e-13, 5e-14, 6e-9, 6e-9),
        samples=3,
    ),
    Rods(
        name="far_origin",
        hard="a four-bar linkage 1400 km from the origin",
        measure=_PLACE + " against the motion in the crank angle",
        error=_of_four_bar,
        rtol=1e-7,
        step=1e-3,
        bounds=_bounds(1e-7, 5e-7, 8e-9, 3e-5, 4e-8, 1e-7, 2e-7, 5e-9, 6e-5, 6e-5),
        more=(Trial("dopri5", {"rtol": 1e-9}), Trial("radau5", {"rtol": 1e-8})),
        most_drift=1e-9,
        samples=3,
    ),
)
