"""Terminal output for elastic links: modes in poses, and results of runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.analyses import print_modes
from symgen.report.extremes import Components
from symgen.report.tables import MODES, events_table, print_notes, table
from symgen.runtime.result.elastic import ElasticResult
from symgen.runtime.result.equilibrium import Modes
from symgen.runtime.result.modes import COARSE, ElasticModes
from symgen.runtime.result.speed_response import SpeedResponse

#: Maximum number of times for which every value is printed; otherwise the range.
_FEW = 6
#: A smaller damping ratio is round-off.
_UNDAMPED = 1e-12


def print_elastic_modes(results: Sequence[ElasticModes | Modes], model: Any, console: Console) -> None:
    """Print the natural frequencies in each pose, exact and with model reduction, in columns.

    Modes about an equilibrium, as with first-order states, are printed as those of rigid links.

    Those with errors by elements above 5 % in all poses are omitted, others with such errors are marked.
    """
    if about := [x for x in results if isinstance(x, Modes)]:
        print_modes(about, model, console)
        return
    poses = [x for x in results if isinstance(x, ElasticModes)]
    moving = any(len(p.growth) for p in poses)
    head, columns = ["mode"], []
    for p in poses:
        head.append(f"{p.pose} [Hz]")
        columns.append(
            [f"{x:.6g}{'*' if bad else ''}" for x, bad in zip(p.frequencies, p.coarse, strict=True)]
        )
        if np.any(p.ratios):
            head.append("damping ratio")
            columns.append([_damped(x) for x in p.ratios])
        if moving:
            head.append("growth [1/s]")
            columns.append([f"{x:.3g}" for x in p.growth])
        if len(p.errors_of_elements):
            head.append("error of elements")
            columns.append([f"{x:.1e}" for x in p.errors_of_elements])
        if p.without_reduction is not None:
            head.append(f"error of reducing {p.without_reduction[1]} unknowns")
            columns.append([f"{x:.1e}" for x in p.errors])
    count = max(len(c) for c in columns)
    coarse = [i for i in range(count) if all(p.coarse[i : i + 1].all() for p in poses)]
    listed = [i for i in range(count) if i not in coarse][:MODES]
    rows = [(str(i + 1), *(c[i] if i < len(c) else "" for c in columns)) for i in listed]
    state = "in motion" if moving else "at rest"
    console.print(table(f"{model.description.title}: the structure {state}", head, rows))
    console.print(f"elements: {', '.join(f'{link} {n}' for link, n in poses[0].elements.items())}")
    if any(p.coarse[listed].any() for p in poses if len(p.coarse) == count):
        console.print(f"* error of elements above {100 * COARSE:g} %")
    if more := count - len(listed):
        highest = max(float(np.max(p.frequencies)) for p in poses)
        wrong = f", {len(coarse)} of them with errors of elements above {100 * COARSE:g} %" if coarse else ""
        console.print(f"and {more} more modes up to {highest:.6g} Hz{wrong}: --json lists all")


def _rpm(speed: float, digits: int) -> str:
    """Return a speed [rad/s] in rpm."""
    return f"{speed * 30 / math.pi:.{digits}g}"


def print_speed_response(result: SpeedResponse, _: Any, console: Console) -> None:
    """Print peak values and stability at every speed, and the critical speeds."""
    shown = [v for v in result.shown if v.name.endswith(".bending_strain")]
    head = ("speed [rpm]", *(f"{v.name} [{v.unit}]" for v in shown), "largest multiplier")
    multipliers = result.variable("floquet").values
    rows = [
        (
            _rpm(speed, 6),
            *(f"{v.values[k]:.5g}" for v in shown),
            f"{multipliers[k]:.6g}" if result.verdicts[k] is not None else "not resolved",
        )
        for k, speed in enumerate(result.speeds)
    ]
    console.print(table(f"{result.title}: {result.headline}", head, rows))
    console.print(f"first critical speed, that of the lowest frequency: {_rpm(result.first_critical, 6)} rpm")
    highest = "stress highest among neighbouring speeds"
    for label, speeds in ((highest, result.resonances), ("unstable", result.unstable)):
        console.print(f"{label} at: {', '.join(_rpm(s, 5) for s in speeds) or 'none'}")
    print_notes(result.notes, console)


def _damped(ratio: float) -> str:
    """Return a damping ratio; 0 for round-off."""
    return f"{ratio:.3g}" if abs(ratio) > _UNDAMPED else "0"


def print_elastic_result(result: ElasticResult, _: Any, console: Console) -> None:
    """Print the outputs at a few times, or the range of each, and the errors of the run."""
    along, label = result.over
    outputs = Components(result.shown, result.count)
    if len(along) <= _FEW:
        console.print(outputs.values(f"{result.title}: over {label}", [f"{x:.6g}" for x in along]))
    else:
        title = f"{result.title}: range over {result.coordinate.about}"
        console.print(outputs.extremes(title, along, result.shown_in[0]))
    console.print(table("The run", ("", ""), list(_of_run(result))))
    if result.events:
        console.print(events_table(result))
    print_notes(result.completed()["notes"], console)


def _of_run(result: ElasticResult) -> Iterator[tuple[str, str]]:
    """Yield method, errors, damping, powers and stability of a run: names and values."""
    statistics = result.statistics
    yield "method", str(result.provenance["method"])
    yield "steps", str(statistics["steps"])
    for cause, error in (("time steps", statistics["error"]), ("elements", result.mesh_error)):
        if error is not None:
            yield f"error by {cause}", f"{error:.1e} of the peak stress"
    if ratios := statistics.get("damping_ratios"):
        yield "damping ratios", ", ".join(map(_damped, ratios))
    if shares := statistics.get("second_order"):
        link = max(shares, key=shares.__getitem__)
        yield "second-order terms", f"{shares[link]:.1e} of the peak strain of {link}, omitted"
    if powers := statistics.get("mean_powers_w"):
        yield "mean powers", "shaft {:.4g} W, damping {:.4g} W".format(*powers)
    if (balance := statistics.get("power_balance")) is not None:
        yield "power balance", f"{balance:.1e} of the largest power"
    if (share := statistics.get("omitted_power")) is not None:
        yield "omitted power", f"{share:.1e} of the largest power"
    if result.floquet:
        stable = {True: "stable", False: "unstable", None: "stability not resolved"}[result.stable]
        yield "Floquet multiplier", f"{abs(result.floquet[0]):.6g}, {stable}"
