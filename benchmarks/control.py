"""State feedback of a cart-pole at 1 kHz over 6 s: time next to its error, and the cost of a stepper's calls.

The cart (1 kg) carries a uniform pole (0.5 m, 0.2 kg), which begins 0.3 rad off the vertical. The force is
constant over a sample. Reference: Lagrange's equations in place and angle, each sample by SciPy's DOP853 with
a relative tolerance of 1e-12. Errors are the largest of all samples [m, rad, m/s, rad/s]. Times are processor
times of the whole loop, the control law in Python included; MuJoCo's calls ``mj_step`` with RK4. The cost of
a call is the time of a loop of calls of ``step`` less that of one run with the same steps, per call.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import symgen

Array = NDArray[np.float64]

CART, POLE, LENGTH, G = 1.0, 0.2, 0.5, 9.81
SAMPLES, H = 6000, 1e-3
TILT = 0.3
#: Gains of the force by place, angle from the vertical, and their rates.
GAIN = (-1.0, -35.0, -2.6, -8.2)
#: Settings of symgen: options of the stepper.
SETTINGS: dict[str, dict[str, Any]] = {
    "rk4, a step per sample": {"method": "rk4", "step": H},
    "dop853": {},
    "taylor": {"method": "taylor"},
}
#: Methods of the cost of a call, with fixed steps.
FIXED = ("rk4", "dop853")
BY_RUN = "simulate with a controller, rk4"
PEER = "MuJoCo, RK4"
#: Bound of the cost of a call [us].
MOST = 1.0
SHORT_ROUNDS, ROUNDS = 3, 7


def scene() -> symgen.Scene:
    """Return the cart-pole."""
    tip = [f"{LENGTH * math.sin(TILT)!r} m", f"{LENGTH * math.cos(TILT)!r} m"]
    return symgen.Scene(
        inputs={"F": "0 N"},
        points={
            "A": {"at": ["-1 m", 0], "ground": True},
            "B": {"at": ["1 m", 0], "ground": True},
            "C": {"at": [0, 0]},
            "P": {"at": tip},
        },
        links={"rail": {"points": ["A", "B"]}, "pole": {"points": ["C", "P"], "mass": f"{POLE} kg"}},
        masses=[{"point": "C", "mass": f"{CART} kg"}],
        guides=[{"points": ["C"], "along": "rail"}],
        gravity={"acceleration": [0, f"{-G} m/s^2"]},
        forces=[{"point": "C", "force": ["F", 0]}],
        analysis={"outputs": ["C.position", "C.velocity", "pole.angle", "pole.angular_velocity"]},
    )


def force(x: float, angle: float, v: float, rate: float) -> float:
    """Return the force on the cart [N] of a state, its angle clockwise from the vertical."""
    return -(GAIN[0] * x + GAIN[1] * angle + GAIN[2] * v + GAIN[3] * rate)


def reference() -> Array:
    """Return the states at the ends of samples (samples, 4) by Lagrange's equations."""
    c, inertia = POLE * LENGTH / 2, POLE * LENGTH**2 / 3

    def rates(_: float, y: Array, push: float) -> list[float]:
        _, angle, v, rate = y
        a, b, d = CART + POLE, c * math.cos(angle), inertia
        first, second = push + c * math.sin(angle) * rate**2, c * G * math.sin(angle)
        determinant = a * d - b * b
        return [v, rate, (d * first - b * second) / determinant, (a * second - b * first) / determinant]

    y = np.array([0.0, TILT, 0.0, 0.0])
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    states = []
    for _ in range(SAMPLES):
        y = solve_ivp(rates, (0, H), y, args=(force(*y.tolist()),), **options).y[:, -1]
        states.append(y)
    return np.array(states)


State = tuple[float, float, float, float]
Loop = Callable[[], list[State]]


def controlled(model: symgen.Model, options: dict[str, Any]) -> Loop:
    """Return a loop of symgen, which returns the states at the ends of samples."""
    stepper = model.stepper(**options)

    def seen() -> State:
        angle, rate = stepper["pole.angle"], stepper["pole.angular_velocity"]
        return stepper["C.position.x"], math.pi / 2 - angle, stepper["C.velocity.x"], -rate  # type: ignore[return-value]

    def run() -> list[State]:
        stepper.reset()
        state, states = seen(), []
        for _ in range(SAMPLES):
            stepper.set(F=force(*state))
            stepper.step(H)
            state = seen()
            states.append(state)
        return states

    return run


def by_run(model: symgen.Model) -> Loop:
    """Return a run with a controller, which returns the states at the ends of samples."""
    times = np.arange(1, SAMPLES + 1) * H

    def law(_: float, view: symgen.MotionView) -> dict[str, float]:
        angle, rate = view["pole.angle"], view["pole.angular_velocity"]
        return {"F": force(view["C.position.x"], math.pi / 2 - angle, view["C.velocity.x"], -rate)}

    def run() -> list[State]:
        result = model.simulate(
            SAMPLES * H, controller=law, sample=H, t_eval=times, **SETTINGS[next(iter(SETTINGS))]
        )
        place, speed = result["C.position"].values[:, 0], result["C.velocity"].values[:, 0]
        angle, rate = result["pole.angle"].values, result["pole.angular_velocity"].values
        rows: list[State] = np.column_stack([place, math.pi / 2 - angle, speed, -rate]).tolist()
        return rows

    return run


def in_mujoco() -> Loop:
    """Return the loop of MuJoCo."""
    import mujoco

    across = POLE * LENGTH**2 / 12
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" timestep="{H}" gravity="0 0 {-G}"/><worldbody><body>'
        f'<joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="{CART}" diaginertia="1 1 1"/>'
        f'<body><joint type="hinge" axis="0 1 0"/><inertial pos="0 0 {LENGTH / 2}" mass="{POLE}" '
        f'diaginertia="{across} {across} 1e-3"/></body></body></worldbody></mujoco>'
    )
    data, step = mujoco.MjData(model), mujoco.mj_step

    def run() -> list[State]:
        data.time, data.qpos[:], data.qvel[:] = 0.0, (0.0, TILT), 0.0
        state, states = (0.0, TILT, 0.0, 0.0), list[State]()
        for _ in range(SAMPLES):
            data.qfrc_applied[0] = force(*state)
            step(model, data)
            state = (*data.qpos.tolist(), *data.qvel.tolist())
            states.append(state)
        return states

    return run


def of_calls(model: symgen.Model) -> dict[str, Case]:
    """Return loops of calls, with and without a change of the input, and runs with the same steps."""
    cases = {}
    for method in FIXED:
        options: dict[str, Any] = {"method": method, "step": H}
        stepper = model.stepper(**options)

        def calls(changes: bool, stepper: Any = stepper) -> None:
            stepper.reset()
            for k in range(SAMPLES):
                if changes:
                    stepper.set(F=0.1 * (k % 2))
                stepper.step(H)

        def run(options: dict[str, Any] = options) -> None:
            model.simulate(SAMPLES * H, samples=2, **options)

        cases[f"{method}: run"] = Case(run, SAMPLES)
        cases[f"{method}: calls"] = Case(partial(calls, False), SAMPLES)
        cases[f"{method}: calls with another input"] = Case(partial(calls, True), SAMPLES)
    return cases


def measured(rounds: int) -> Measurement:
    """Measure errors, loops and calls."""
    model, exact = symgen.build(scene()), reference()
    loops = {name: controlled(model, options) for name, options in SETTINGS.items()}
    loops[BY_RUN] = by_run(model)
    notes = []
    if importlib.util.find_spec("mujoco"):
        loops[PEER] = in_mujoco()
    else:
        notes.append("MuJoCo is not installed (pip install 'symgen[peers]').")
    errors = {name: float(np.max(np.abs(np.array(run()) - exact))) for name, run in loops.items()}
    calls = of_calls(model)
    timings = measure({**{name: Case(run, 1) for name, run in loops.items()}, **calls}, rounds, 1)
    times = {name: timing.processor for name, timing in timings.items()}
    rows = [
        {"loop": name, "6 s [s]": times[name], "sample [us]": 1e6 * times[name] / SAMPLES, "error": error}
        for name, error in errors.items()
    ]
    rows += [
        {"loop": name, "6 s [s]": SAMPLES * times[name], "sample [us]": 1e6 * times[name], "error": ""}
        for name in calls
    ]
    required = [Required(f"error of {name}", errors[name], 1e-8, False) for name in (*SETTINGS, BY_RUN)]
    for method in FIXED:
        cost = 1e6 * (times[f"{method}: calls"] - times[f"{method}: run"])
        required.append(Required(f"cost of a call, {method} [us]", cost, MOST, False, timed=True))
    own = times[next(iter(SETTINGS))]
    required.append(Required("state feedback by rk4 [s]", own, 0.2, False, timed=True))
    if PEER in times:
        line = "MuJoCo's time over symgen's by rk4"
        required.append(Required(line, times[PEER] / own, 1.0, True, timed=True))
    return Measurement("State feedback of a cart-pole at 1 kHz", rows, required, notes)


def main() -> int:
    """Measure and print; return the exit code."""
    options = arguments(__doc__, short=True)
    rounds = SHORT_ROUNDS if options.short else ROUNDS
    return report_repeats(lambda: measured(rounds), options)


if __name__ == "__main__":
    sys.exit(main())
