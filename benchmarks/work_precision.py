"""Wall time and error of falling chains: symgen, MuJoCo, Pinocchio with SciPy and CVODE, Exudyn, and heyoka.

Planar chains of 3 and 10 uniform rods of 1 m and 1 kg, pinned at one end and released at rest with relative
angles alternating between 0 and 0.1 from the horizontal, fall for 2 s. Each program is swept over its steps
or tolerances, and symgen over all its integrators; every run records the same 21 times. Errors are those of
the tip, final and maximum over all samples, against a reference by another formulation
(``chain_reference.py``).

A time is that of the whole Python call, from initial state to recorded samples, after a warm-up: for symgen
``simulate`` and the tip positions, for other programs without the tip positions, which are computed from
their joint angles untimed. Settings alternate in rounds, each called untimed for a millisecond (at least
once) before the timed call, and the best round counts, because other load only increases times; ratios are
the smaller of those of wall and processor time. Settings that are far from their program's best in a first
run are omitted. The time at an error is interpolated between the logarithms of a program's best settings.
heyoka integrates equations that it is given, in angles and from symgen's SymPy record; symgen must not be
slower.
``--short`` runs symgen alone.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from time import perf_counter
from typing import Any

import chain_reference as reference
import heyoka_peer
import numpy as np
from chain_peers import PEERS, TIMES, Array, Attempt, drift, joints
from fronts import front, time_at
from harness import Case, Required, Timing, measure, report

import symgen
from symgen.errors import SimulationError
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.study.speed.sweeps import worth_running

SIZES, ERRORS = reference.SIZES, (1e-4, 1e-6, 1e-8, 1e-10)
#: Required speed ratio to the fastest peer, by number of rods.
FASTER = {3: 10.0, 10: 5.0}
#: A sweep ends at this error, or with a run of this duration [s].
GOAL, LONGEST = 2e-11, {3: 0.1, 10: 0.4}
ROUNDS, SHORT_ROUNDS = 11, 5
#: Settings are timed further if their first runs took at most this multiple of the best time at their error.
NEAR = 1.5
#: Program that is given its equations: speed ratios are to the others.
OURS, GIVEN = "symgen", "heyoka"

#: Wall time and processor time, by the attribute names of :class:`harness.Timing`.
CLOCKS = ("best", "processor")

Errors = tuple[float, float]
Key = tuple[int, Attempt]


def main() -> int:
    """Measure, print, and return the exit code."""
    options = _arguments()
    missing: dict[str, str] = {}
    tried: dict[Key, tuple[Errors, float]] = {}
    for n in SIZES:
        truth = reference.tips(n)
        for sweep in attempts(n, {} if options.short else PEERS, missing):
            tried.update(swept(n, sweep, truth))
    errors = contenders(tried)
    cases = {key: Case(key[1].run, 1) for key in errors}
    timings = measure(cases, SHORT_ROUNDS if options.short else ROUNDS, 1, primed=True)
    if options.plot:
        draw(errors, timings, options.plot)
    notes = [
        "symgen is built for this processor: contraction='fast', vector='native'.",
        "along: largest error of the tip in m at 21 times; end: that at the last.",
        *(f"{name} could not be run: {why}" for name, why in missing.items()),
        *(["symgen alone: nothing is compared."] if options.short else drifts()),
        *(
            f"the reference for N = {n} moves by {reference.uncertainty(n):.0e} m with its tolerance"
            for n in SIZES
        ),
    ]
    return report(
        "A chain of N rods falls for 2 s",
        table(errors, timings),
        [] if options.short else required(errors, timings),
        notes=notes,
        as_json=options.json,
    )


def drifts() -> Iterator[str]:
    """Yield how far energy and lengths drift in symgen and heyoka at tight tolerances; nothing without it."""
    for n in SIZES:
        run = symgen.build(scene(n)).simulate(reference.T_END, method="taylor", rtol=1e-13)
        lost = {OURS: (run.drift.energy, run.drift.constraint)}
        try:
            for form in heyoka_peer.chains(n):
                states = form.sampled(form.integrator(1e-15), TIMES)
                lost[f"{GIVEN}, {form.name}"] = drift(*joints(form, states, n))
        except ImportError:
            return
        for name, (energy, length) in lost.items():
            yield f"N = {n}, {name}: energy drifts by {energy:.0e} J, lengths by {length:.0e} m"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument("--short", action="store_true", help="measure symgen only")
    parser.add_argument("--plot", metavar="FILE", help="draw error and time: .svg, .png or .pdf")
    return parser.parse_args()


def attempts(n: int, peers: Mapping[str, Any], missing: dict[str, str]) -> Iterator[Iterator[Attempt]]:
    """Yield the sweeps of all available programs; record the reasons why others are missing."""
    yield from ours(n)
    for name, (packages, sweeps) in peers.items():
        try:
            yield from sweeps(n)
        except ImportError as error:
            missing[name] = f"{error}; 'pip install {packages}' (the extra 'peers')"


def scene(n: int) -> symgen.Scene:
    """Return the chain as a scene that records the position of its tip."""
    angles = np.array(reference.start_angles(n))
    places = np.cumsum(np.stack([np.cos(angles), np.sin(angles)], axis=1), axis=0)
    points: dict[str, Any] = {"P0": {"at": ["0 m", "0 m"], "ground": True}}
    points |= {f"P{k + 1}": {"at": [f"{x!r} m" for x in p]} for k, p in enumerate(places.tolist())}
    return symgen.Scene(
        title=f"chain of {n} rods",
        points=points,
        links={
            f"L{k}": {"points": [f"P{k - 1}", f"P{k}"], "mass": "1 kg", "length": "1 m"}
            for k in range(1, n + 1)
        },
        gravity={"acceleration": ["0 m/s^2", f"-{reference.GRAVITY} m/s^2"]},
        analysis={"t_end": f"{reference.T_END} s", "outputs": [f"P{n}.position"]},
    )


def ours(n: int) -> Iterator[Iterator[Attempt]]:
    """Yield a sweep for every integrator: tolerances if it is adaptive, and fixed steps."""
    model = symgen.build(scene(n), contraction="fast", vector="native")

    def attempt(method: str, kind: str, text: str, **given: float) -> Attempt:
        def run() -> Array:
            result = model.simulate(reference.T_END, method=method, samples=reference.SAMPLES, **given)
            return result.variables[0].values

        return Attempt(OURS, f"{method}{kind}", text, run, lambda tips: tips)

    between = reference.SAMPLES - 1
    for name, method in INTEGRATORS.items():
        if method.adaptive:
            rtols = (10.0 ** (-k / 2) for k in range(2, 27))
            yield (attempt(name, "", f"rtol {r:.0e}", rtol=r) for r in rtols)
            if method.kind != "explicit":
                continue
        counts = dict.fromkeys(between * round(2 ** (k / 2)) for k in range(22))
        kind = ", fixed steps" if method.adaptive else ""
        yield (attempt(name, kind, f"{c} steps", step=reference.T_END / c) for c in counts)


def swept(n: int, sweep: Iterable[Attempt], truth: Array) -> Iterator[tuple[Key, tuple[Errors, float]]]:
    """Yield the settings of a sweep while they improve: final and maximum error, and a time."""
    found: dict[Attempt, tuple[Errors, float]] = {}

    def run(attempt: Attempt) -> tuple[float, float]:
        times = []
        for _ in range(2):
            begun = perf_counter()
            try:
                answer = attempt.run()
            except SimulationError:
                return math.inf, perf_counter() - begun
            times.append(perf_counter() - begun)
        errors = errors_of(attempt.tips(answer), truth)
        found[attempt] = errors, min(times)
        return errors[1], min(times)

    for attempt in worth_running(iter(sweep), run, GOAL, LONGEST[n]):
        yield (n, attempt), found[attempt]


def contenders(tried: Mapping[Key, tuple[Errors, float]]) -> dict[Key, Errors]:
    """Return the settings, with their errors, that are close to their program's best at either error."""
    chosen = {}
    for (n, attempt), (errors, spent) in tried.items():
        rivals = [f for (m, a), f in tried.items() if m == n and a.program == attempt.program]
        best = (time_at([(e[k], t) for e, t in rivals], errors[k]) for k in range(2))
        if any(t is not None and spent <= NEAR * t for t in best):
            chosen[n, attempt] = errors
    return chosen


def errors_of(tips: Array, truth: Array) -> Errors:
    """Return the final and the maximum error; equal if a run recorded only its final state."""
    gaps = np.linalg.norm(tips - truth[-len(tips) :], axis=1)
    return float(gaps[-1]), float(np.max(gaps))


def table(errors: Mapping[Key, Errors], timings: Mapping[Key, Timing]) -> list[dict[str, Any]]:
    """Return one row per setting."""
    return [
        {
            "N": n,
            "program": a.program,
            "method": a.series,
            "setting": a.text,
            "end": end,
            "along": along,
            "best [s]": timings[n, a].best,
            "median [s]": timings[n, a].median,
            "processor [s]": timings[n, a].processor,
        }
        for (n, a), (end, along) in errors.items()
    ]


def required(errors: Mapping[Key, Errors], timings: Mapping[Key, Timing]) -> list[Required]:
    """Return the speed ratio of symgen to the fastest peer, at every error.

    It is the smaller of the ratios of wall times and of processor times: on a loaded machine long runs are
    interrupted and short ones are not, to the disadvantage of the slower program.
    """
    lines = []
    for n in SIZES:
        for which, where in enumerate(("at the end", "along the run")):
            for error in ERRORS:
                at = f"N = {n}, {error:.0e} {where}"
                found = [_times(n, which, error, errors, timings, clock) for clock in CLOCKS]
                given = [{name: t.pop(name) for name in (GIVEN,) if name in t} for t in found]
                if all(given):
                    pairs = zip(given, found, strict=True)
                    ratio, _ = min(_ratio({OURS: t[OURS], **own}) for own, t in pairs)
                    lines.append(Required(f"{at}: times faster than {GIVEN}", ratio, 1.0, True))
                ratio, peer = min(map(_ratio, found))
                lines.append(Required(f"{at}: times faster than {peer}", ratio, FASTER[n], True))
    return lines


def _ratio(times: dict[str, float | None]) -> tuple[float, str]:
    """Return the speed ratio of symgen to the fastest other program, and the name of that program."""
    own = times.pop(OURS)
    peers = {name: t for name, t in times.items() if t is not None}
    fastest = min(peers, key=lambda name: peers[name], default="any other, none of which got there")
    if own is None:
        return 0.0, fastest
    return peers.get(fastest, math.inf) / own, fastest


def _times(
    n: int,
    which: int,
    error: float,
    errors: Mapping[Key, Errors],
    timings: Mapping[Key, Timing],
    clock: str,
) -> dict[str, float | None]:
    """Return the time in which every program reaches an error; None if it does not."""
    points: dict[str, list[tuple[float, float]]] = {OURS: []}
    for (m, attempt), found in errors.items():
        if m == n:
            points.setdefault(attempt.program, []).append((found[which], getattr(timings[m, attempt], clock)))
    return {name: time_at(own, error) for name, own in points.items()}


def draw(errors: Mapping[Key, Errors], timings: Mapping[Key, Timing], file: str) -> None:
    """Plot the best settings of every program: maximum error over wall time, one panel per N."""
    from matplotlib.figure import Figure

    from symgen.report.page.plots import draw_errors
    from symgen.study.speed.report import save

    figure = Figure(figsize=(9, 4.6), layout="constrained")
    panels: Sequence[Any] = figure.subplots(1, len(SIZES), sharey=True)
    for panel, n in zip(panels, SIZES, strict=True):
        curves: dict[str, list[tuple[float, float]]] = {}
        for (m, a), found in errors.items():
            if m == n:
                curves.setdefault(a.program, []).append((found[1], timings[m, a].processor))
        best = ((name, front(own)) for name, own in curves.items())
        draw_errors(panel, best, "largest error of the tip [m]")
        panel.legend(fontsize="small", frameon=False)
        panel.set_title(f"N = {n}", fontsize="medium")
    save(figure, file)


if __name__ == "__main__":
    sys.exit(main())
