"""Many runs in one call: variants of a driven linkage, steps of fixed size, angles of a loop with all forces.

Processor times are those of the process, all threads together, per run, step or angle: other load on the
machine hardly affects them. Wall times are of one and of two threads. The loop in Python, with
``with_parameters`` and ``simulate``, is timed for a part of the variants. Positions are compared with two
circles, and all with the same runs by themselves.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
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
    return report_repeats(partial(measured, options.slack), repeats=options.repeats, as_json=options.json)


def measured(slack: float) -> Measurement:
    """Measure once."""
    rows: list[dict[str, Any]] = []
    required = [*_variants(rows, slack), *_steps(rows, slack), *_angles(rows, slack)]
    notes = [
        f"{VARIANTS} variants of crank_rocker over a revolution, {POSES} poses each, with the torque; "
        f"{SWINGS} swings of four_bar with {STEPS} steps of RK4; {OFFSETS} variants of slider_crank at "
        f"{ANGLES} angles."
    ]
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
            calls=3,
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
    same, each, walls = True, np.inf, []
    model = symgen.build("four_bar")
    start = model.initial_state()
    states = [
        model.state(start.positions, {p: f * v for p, v in start.velocities.items()})
        for f in np.linspace(0.5, 1.5, SWINGS).tolist()
    ]
    model.simulate_many(states=states[:16], **options)
    for threads in (1, 2):
        found, one = _timed(
            f"four_bar by rk4, {threads} thread{'s' if threads > 1 else ''}",
            "step",
            SWINGS * STEPS,
            partial(model.simulate_many, states=states, threads=threads, **options),
            rows,
            calls=8,
        )
        walls.append(rows[-1]["wall [s]"])
        each = min(one, each)
        alone = model.simulate(state=states[7], **options)
        same = same and np.array_equal(found["B.position"].values[7], alone["B.position"].values)
    return [
        Required("four_bar by rk4: steps per second and core", 1 / each, STEPS_A_SECOND / slack, True, True),
        Required(
            "four_bar by rk4: steps of two threads for one", walls[0] / walls[1], BOTH / slack, True, True
        ),
        Required("four_bar by rk4: same bits as single runs", float(same), 1.0, True),
    ]


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
