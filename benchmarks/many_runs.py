"""Many runs in one call: variants of a driven linkage, steps of fixed size, angles of a loop with all forces.

Processor times are those of the process, all threads together, per run, step or angle: other load on the
machine hardly affects them. Wall times are of one and of two threads. The loop in Python, with
``with_parameters`` and ``simulate``, is timed for a part of the variants. Positions are compared with two
circles, and all with the same runs by themselves.

MuJoCo, where it is installed, carries out the same swings by its threaded rollout. Its Runge-Kutta method has
the same order, and the same step, with which symgen must have the smaller error. Its connection is soft, with
the smallest time constant that it accepts. References have tolerances of 1e-12.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from time import perf_counter, process_time
from typing import Any

import numpy as np
from harness import Measurement, Required, arguments, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.scene.loading import SHIPPED, read_scene

Array = NDArray[np.float64]

VARIANTS, POSES, SINGLE = 10_000, 361, 200
#: Runs in lanes: so many that Python, in which one thread works, takes a tenth of the time at most. Otherwise
#: two threads cannot be 1.8 times as fast.
SWINGS, STEPS, STEP = 512, 2000, 1e-3
#: Calls by one and by two threads in turn, of which the fastest count.
CALLS = 10
#: Step of the swings in MuJoCo and symgen [s], and how much faster symgen must be.
ROLLED_OUT, THAN_ROLLOUT = 4e-3, 5.0
OFFSETS, ANGLES = 1000, 361
#: Lengths of ``crank_rocker`` [m]; its coupler is varied.
CRANK, COUPLERS, ROCKER, BASE = 0.1, np.linspace(0.33, 0.37, VARIANTS), 0.3, 0.4
#: Processor time of all variants [s], and how much faster they are than one by one.
MOST_TIME, FASTER, LARGEST_ERROR = 6.0, 2.0, 1e-9
#: Wall time of all variants with the torque, in lanes [s].
MOST_WALL = 2.0
#: Steps, and angles with all forces, of a core per second, with vectors of AVX-512.
STEPS_A_SECOND, ANGLES_A_SECOND = 4e6, 1e6
#: How much faster two threads are than one.
BOTH = 1.8


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, slack=True)
    return report_repeats(partial(measured, options.slack), options)


def measured(slack: float) -> Measurement:
    """Measure once."""
    rows: list[dict[str, Any]] = []
    required = [*_variants(rows, slack), *_steps(rows, slack), *_angles(rows, slack)]
    notes = [
        f"{VARIANTS} variants of crank_rocker over a revolution, {POSES} poses each, with the torque; "
        f"{SWINGS} swings of four_bar with {STEPS} steps of RK4; {OFFSETS} variants of slider_crank at "
        f"{ANGLES} angles."
    ]
    if find_spec("mujoco") is None:
        notes.append("Skipped: MuJoCo is not installed (pip install 'symgen[peers]').")
    return Measurement("Many runs in one call", rows, required, notes)


def _timed(
    what: str, unit: str, count: int, run: Callable[[], Any], rows: list[dict[str, Any]], calls: int = 1
) -> tuple[Any, float]:
    """Return the result of a call and the least processor time per unit of some calls [s]; add their row."""
    wall = busy = np.inf
    for _ in range(calls):
        began, busy_before = perf_counter(), process_time()
        found = run()
        wall = min(wall, perf_counter() - began)
        busy = min(busy, process_time() - busy_before)
    rows.append(
        {
            "runs": what,
            "unit": unit,
            "units": count,
            "wall [s]": wall,
            "processor [s]": busy,
            "processor time per unit [us]": busy / count * 1e6,
        }
    )
    return found, busy / count


def _crank_rocker() -> symgen.Model:
    data = dict(read_scene(SHIPPED / "crank_rocker.toml").data)
    data["parameters"] = {**data["parameters"], "b": {"value": "35 cm", "tunable": True}}
    data["links"] = {**data["links"], "coupler": {**data["links"]["coupler"], "length": "b"}}
    data["analysis"] = {**data["analysis"], "outputs": ["B.position", "crank.torque"]}
    return symgen.build(symgen.Scene(**data))


def _variants(rows: list[dict[str, Any]], slack: float) -> list[Required]:
    model = _crank_rocker()
    for threads in (1, 2):
        found, each = _timed(
            f"simulate_many, {threads} thread{'s' if threads > 1 else ''}",
            "variant",
            VARIANTS,
            lambda threads=threads: model.simulate_many({"b": COUPLERS}, samples=POSES, threads=threads),
            rows,
        )
    walls = []
    for threads in (1, 2):
        torques, _ = _timed(
            f"inverse_dynamics_many, {threads} thread{'s' if threads > 1 else ''}",
            "variant",
            VARIANTS,
            lambda threads=threads: model.inverse_dynamics_many(
                {"b": COUPLERS}, outputs=["crank.torque"], samples=POSES, threads=threads
            ),
            rows,
            calls=2,
        )
        walls.append(rows[-1]["wall [s]"])
    apart = np.max(np.abs(torques["crank.torque"].values - found["crank.torque"].values))
    some = np.arange(0, VARIANTS, VARIANTS // SINGLE)

    def one_by_one() -> list[symgen.Result]:
        made = [model.with_parameters(b=b).simulate(samples=POSES) for b in COUPLERS[some].tolist()]
        for result in made:
            result["crank.torque"]
        return made

    alone, each_alone = _timed(
        "with_parameters and simulate, one by one", "variant", SINGLE, one_by_one, rows
    )
    same = all(
        np.array_equal(found[name].values[i], result[name].values)
        for i, result in zip(some.tolist(), alone, strict=True)
        for name in ("crank.torque", "B.position")
    )
    truth = _rocker(COUPLERS[:, None], 2 * np.pi * found["time"].values)
    error = float(np.max(np.abs(found["B.position"].values - truth)))
    return [
        Required(
            f"{VARIANTS} variants with torque: wall time [s]", min(walls), MOST_WALL * slack, False, True
        ),
        Required(
            "variants: torque in lanes less that of runs, over the largest",
            float(apart / np.max(np.abs(found["crank.torque"].values))),
            LARGEST_ERROR,
            False,
        ),
        Required(
            f"{VARIANTS} variants: processor time of two threads [s]",
            each * VARIANTS,
            MOST_TIME * slack,
            False,
            True,
        ),
        Required(
            "variants: processor time of single runs for one of many",
            each_alone / each,
            FASTER / slack,
            True,
            True,
        ),
        Required("variants: same bits as single runs", float(same), 1.0, True),
        Required("variants: error of B [m]", error, LARGEST_ERROR, False),
    ]


def _rocker(coupler: Array, angle: Array) -> Array:
    """Return the places of B: circles about A and C meet, above the line between them."""
    a = CRANK * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    d = np.array([BASE, 0.0]) - a
    far = np.hypot(d[..., 0], d[..., 1])
    along = ((coupler**2 - ROCKER**2 + far**2) / (2 * far))[..., None]
    across = np.sqrt(coupler[..., None] ** 2 - along**2)
    place: Array = a + (d * along + np.stack([-d[..., 1], d[..., 0]], axis=-1) * across) / far[..., None]
    return place


def _steps(rows: list[dict[str, Any]], slack: float) -> list[Required]:
    options = {"t_end": STEPS * STEP, "step": STEP, "samples": 2}
    model = symgen.build("four_bar")
    start = model.initial_state()
    states = [
        model.state(start.positions, {p: f * v for p, v in start.velocities.items()})
        for f in np.linspace(0.5, 1.5, SWINGS).tolist()
    ]
    runs = {n: partial(model.simulate_many, states=states, threads=n, **options) for n in (1, 2)}
    found, times = _in_turn(runs, SWINGS * STEPS, rows)
    alone = model.simulate(state=states[7], **options)
    same = all(np.array_equal(f["B.position"].values[7], alone["B.position"].values) for f in found.values())
    each, both = min(x for x, _ in times.values()) / (SWINGS * STEPS), times[1][1] / times[2][1]
    return [
        Required("four_bar by rk4: steps per second and core", 1 / each, STEPS_A_SECOND / slack, True, True),
        Required("four_bar by rk4: steps of two threads for one", both, BOTH / slack, True, True),
        Required("four_bar by rk4: same bits as single runs", float(same), 1.0, True),
        *_rollout(model, states, rows, slack),
    ]


def _in_turn(
    runs: dict[int, Callable[[], Any]], steps: int, rows: list[dict[str, Any]]
) -> tuple[dict[int, Any], dict[int, tuple[float, float]]]:
    """Call by each number of threads in turn; return results, and least processor and wall times [s]."""
    found = {n: run() for n, run in runs.items()}
    least = dict.fromkeys(runs, (np.inf, np.inf))
    for _ in range(CALLS):
        for n, run in runs.items():
            began, busy_before = perf_counter(), process_time()
            run()
            spent = process_time() - busy_before, perf_counter() - began
            least[n] = min(least[n][0], spent[0]), min(least[n][1], spent[1])
    for n, (busy, wall) in least.items():
        rows.append(
            {
                "runs": f"four_bar by rk4, {n} thread{'s' if n > 1 else ''}",
                "unit": "step",
                "units": steps,
                "wall [s]": wall,
                "processor [s]": busy,
                "processor time per unit [us]": busy / steps * 1e6,
            }
        )
    return found, least


def _rollout(model: Any, states: list[Any], rows: list[dict[str, Any]], slack: float) -> list[Required]:
    """Compare with MuJoCo's rollout; nothing without it."""
    try:
        from mujoco import MjData, rollout
    except ImportError:
        return []
    t_end, step = STEPS * STEP, ROLLED_OUT
    steps = round(t_end / step)
    other, start = _four_bar_of_mujoco(states, step)
    data = [MjData(other) for _ in range(2)]
    peer, of_peer = _timed(
        "four_bar in MuJoCo, rollout by RK4, 2 threads", "step", SWINGS * steps,
        lambda: rollout.rollout(other, data, start, nstep=steps)[0][:, -1, 3], rows, calls=2,
    )  # fmt: skip
    swings = partial(model.simulate_many, states=states, t_end=t_end, samples=2)
    found, own = _timed(
        "four_bar by rk4, 2 threads, steps as in MuJoCo", "step", SWINGS * steps,
        lambda: swings(method="rk4", step=step, threads=2), rows, calls=8,
    )  # fmt: skip
    truth = swings(rtol=1e-12, atol=1e-12)["B.position"].values[:, -1]
    c, b = (np.array(states[0].positions[p]) for p in "CB")
    there = c + np.linalg.norm(b - c) * np.stack([np.cos(peer), np.sin(peer)], axis=1)
    wrong, of_rollout = (float(np.max(np.abs(x - truth))) for x in (found["B.position"].values[:, -1], there))
    return [
        Required("MuJoCo's rollout: its time over symgen's", of_peer / own, THAN_ROLLOUT / slack, True, True),
        Required("MuJoCo's rollout: its error over symgen's", of_rollout / wrong, 1.0, True),
    ]


def _four_bar_of_mujoco(states: list[Any], step: float) -> tuple[Any, Array]:
    """Return ``four_bar`` of crank and coupler in a tree, a rocker, and a soft connection, and all starts."""
    from mujoco import MjModel

    axial = 1e-6  # moment of inertia about the axis of a rod [kg m^2], which nothing turns about

    def rod(name: str, length: float, pos: str, then: str = "") -> str:
        across = length**3 / 12  # rods have 1 kg/m
        return (
            f'<body pos="{pos}"><joint type="hinge" axis="0 -1 0"/><site name="{name}" pos="{length} 0 0"/>'
            f'<inertial pos="{length / 2} 0 0" mass="{length}" diaginertia="{axial} {across} {across}"/>'
            f"{then}</body>"
        )

    model = MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" timestep="{step}" gravity="0 0 -9.81"/><worldbody>'
        f"{rod('crank', 1.0, '0 0 0', rod('coupler', 1.8, '1 0 0'))}{rod('rocker', 1.4, '2 0 0')}</worldbody>"
        f'<equality><connect site1="coupler" site2="rocker" solref="{2 * step} 1" '
        'solimp="0.9999 0.9999 0.001"/></equality></mujoco>'
    )
    starts = []
    for state in states:
        turned = []
        for inner, outer in ("OA", "AB", "CB"):
            along, rate = (np.subtract(x[outer], x[inner]) for x in (state.positions, state.velocities))
            spin = (along[0] * rate[1] - along[1] * rate[0]) / (along @ along)
            turned.append((np.arctan2(along[1], along[0]), spin))
        crank, coupler, rocker = np.array(turned)
        starts.append([0.0, *np.stack([crank, coupler - crank, rocker], axis=1).ravel()])
    return model, np.array(starts)


def _angles(rows: list[dict[str, Any]], slack: float) -> list[Required]:
    model = symgen.build("slider_crank")
    offsets, each = np.linspace(0.0, 0.05, OFFSETS), np.inf
    for threads in (1, 2):
        found, one = _timed(
            f"slider_crank with all forces, {threads} thread{'s' if threads > 1 else ''}",
            "angle",
            OFFSETS * ANGLES,
            lambda threads=threads: model.inverse_dynamics_many(
                {"a4": offsets}, samples=ANGLES, threads=threads
            ),
            rows,
            calls=4,
        )
        each = min(one, each)
    alone = model.with_parameters(a4=offsets[7]).inverse_dynamics(samples=ANGLES)
    same = all(np.array_equal(found[v.name].values[7], v.values) for v in alone.variables)
    return [
        Required("slider_crank: angles per second and core", 1 / each, ANGLES_A_SECOND / slack, True, True),
        Required("slider_crank: same bits as single runs", float(same), 1.0, True),
    ]


if __name__ == "__main__":
    sys.exit(main())
