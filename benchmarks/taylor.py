"""Power series against dop853 and heyoka: processor time at equal errors, and digits in float128.

Every motion has a reference of more than 20 digits by other equations (``taylor_cases.py``): Lagrange's, in
as few coordinates as freedoms, by extrapolation in mpmath. A program's error at a tolerance is the median
over five runs with slightly varied tolerances, since single runs have lucky errors; its time is the least
processor time of a whole Python call, all programs and tolerances in turn. Times at an error are interpolated
between the logarithms of a program's best tolerances. Errors are relative to a length of the linkage. heyoka
is given the minimal equations, and chains also in the coordinates of symgen's SymPy record; a state is set
and the end is read, and its compilation is not timed. Compilation and code size are those of all shipped
scenes, with and without power series.

Many runs in one call are compared by the time to an error of all of them: see ``taylor_lanes.py``.

``--short`` measures three tolerances of three motions without heyoka.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from statistics import median
from time import process_time
from typing import Any

import chain_peers
import chain_reference
import compilation
import work_precision
from fronts import time_at
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from taylor_cases import Case as Motion
from taylor_cases import cases, of_digits
from taylor_lanes import measured_in_lanes

import symgen
from symgen.errors import SimulationError

ERRORS, REQUIRED = (1e-4, 1e-6, 1e-8, 1e-10, 1e-11), (1e-8, 1e-10, 1e-11)
TOLERANCES = tuple(10.0 ** -(k / 2) for k in range(6, 28))
#: heyoka compiles for every tolerance.
HEYOKA = (1e-3, 1e-5, 1e-7, 1e-11, 1e-15)
#: Factors of the relative tolerance and, over it, the absolute one in the runs of a median.
VARIED = tuple((10 ** (0.06 * k), 10 ** (-2 - 0.1 * k)) for k in range(-2, 3))
METHODS, PEER = ("taylor", "dop853"), "heyoka"
ROUNDS, SHORT_ROUNDS = 9, 5


@dataclass(frozen=True)
class Setting:
    """A program at a tolerance: its error and what is timed."""

    motion: str
    program: str
    tolerance: float
    error: float
    run: Callable[[], Any]


def own(motion: Motion, tolerances: tuple[float, ...]) -> Iterator[Setting]:
    """Yield symgen's settings; one in which a run ends early has an infinite error and is not timed."""
    model = symgen.build(motion.scene, contraction="fast", vector="native")
    for rtol in tolerances:
        for method in METHODS:

            def run(factor: float, part: float, method: str = method, rtol: float = rtol) -> Any:
                given = {"rtol": rtol * factor, "atol": rtol * factor * part}
                return model.simulate(float(motion.t_end), samples=2, method=method, **given)

            try:
                ends = [motion.end_of(run(*varied)) for varied in VARIED]
            except SimulationError:
                continue
            error = median(motion.error(end) for end in ends)
            middle = VARIED[len(VARIED) // 2]
            yield Setting(motion.key, method, rtol, error, lambda run=run, middle=middle: run(*middle))


def theirs(motion: Motion) -> Iterator[Setting]:
    """Yield heyoka's settings; ImportError without it."""
    for form in motion.in_heyoka():
        for tolerance in HEYOKA:
            found = [form.integrator(tolerance)]
            end = form.place(form.run(found[0], float(motion.t_end)))

            def run(form: Any = form, found: Any = found) -> Any:
                return form.run(found[0], float(motion.t_end))

            yield Setting(motion.key, f"{PEER}, {form.name}", tolerance, motion.error(end), run)


def times(settings: list[Setting], spent: Mapping[int, float]) -> dict[tuple[str, str, float], float]:
    """Return the time [s] of each motion and program at each error; NaN where it is not reached."""
    found = {}
    for motion in dict.fromkeys(s.motion for s in settings):
        for program in (*METHODS, PEER):
            points = [
                (max(s.error, 1e-17), spent[i])
                for i, s in enumerate(settings)
                if s.motion == motion and s.program.startswith(program)
            ]
            for error in ERRORS:
                found[motion, program, error] = time_at(points, error) or math.nan
    return found


def required(found: Mapping[tuple[str, str, float], float], *, with_peer: bool) -> Iterator[Required]:
    """Yield the criteria on times."""
    for motion in dict.fromkeys(motion for motion, _, _ in found):
        for error in ERRORS:
            series, other, peer = (found[motion, p, error] for p in (*METHODS, PEER))
            if error in REQUIRED:
                # An error that only power series reach is no ratio.
                ratio = 0.0 if math.isnan(other) and not math.isnan(series) else series / other
                name = f"{motion}: time of taylor over that of dop853 at {error:.0e}"
                yield Required(name, ratio, 0.45, at_least=False, timed=True)
            if with_peer:
                fastest = min((t for t in (series, other) if not math.isnan(t)), default=math.nan)
                ratio = 0.0 if math.isnan(peer) and not math.isnan(fastest) else fastest / peer
                name = f"{motion}: time of symgen over that of heyoka at {error:.0e}"
                yield Required(name, ratio, 1.0, at_least=False, timed=True)


def digits(motion: Motion) -> tuple[float, float]:
    """Return the digits of a run in float128 and its least processor time [s].

    The scene is shifted so that the point ends next to the origin, where results, which are doubles, have
    more digits behind the point than the run. The start, computed in doubles, is exact.
    """
    model = symgen.build(motion.shifted(), precision="float128")
    least, error = math.inf, math.nan
    for _ in range(3):
        begun = process_time()
        run = model.simulate(float(motion.t_end), samples=2, method="taylor", rtol=1e-31, atol=1e-33)
        least = min(least, process_time() - begun)
        error = motion.error_of_shifted(motion.end_of(run))
    return -math.log10(error), least


def of_two_rods() -> Iterator[Required]:
    """Yield the criteria on errors in doubles and in float128."""
    rods, four_bar = of_digits()
    found = [s.error for s in own(rods, tuple(10.0**-k for k in (13, 13.2, 13.4))) if s.program == "taylor"]
    yield Required(f"{rods.key}: error of taylor in float64 [m]", median(found), 1e-11, at_least=False)
    for motion, limit in ((rods, 0.5), (four_bar, None)):
        count, spent = digits(motion)
        yield Required(f"{motion.key}: digits of taylor in float128", count, 28.0, at_least=True)
        if limit:
            yield Required(f"{motion.key}: time in float128 [s]", spent, limit, at_least=False, timed=True)


def against_exudyn(rounds: int) -> Required:
    """Return the criterion on the falling chain of three rods, with the samples of ``work_precision.py``."""
    truth, tried = chain_reference.tips(3), {}
    for sweep in chain(chain_peers.exudyn_sweeps(3), work_precision.ours(3)):
        tried.update(work_precision.swept(3, sweep, truth))
    errors = work_precision.contenders(tried)
    timings = measure({key: Case(key[1].run, 1) for key in errors}, rounds, 1, primed=True)
    at = [
        time_at([(e[1], timings[k].processor) for k, e in errors.items() if k[1].program == name], 1e-4)
        for name in (work_precision.OURS, "Exudyn")
    ]
    ratio = at[1] / at[0] if at[0] and at[1] else math.nan
    return Required("chain of 3 at 1e-4: times faster than Exudyn", ratio, 10.0, at_least=True, timed=True)


def measured(*, short: bool) -> Measurement:
    """Return one measurement."""
    chosen, missing = cases()[:: 2 if short else 1], []
    settings = [s for motion in chosen for s in own(motion, TOLERANCES[::8] if short else TOLERANCES)]
    with_peer = not short
    try:
        for motion in chosen if with_peer else ():
            settings += theirs(motion)
    except ImportError as error:
        with_peer = False
        missing.append(f"heyoka could not be run: {error}; 'pip install heyoka' (the extra 'peers')")
    rounds = SHORT_ROUNDS if short else ROUNDS
    timings = measure({str(i): Case(s.run, 1) for i, s in enumerate(settings)}, rounds, 1, primed=True)
    spent = {i: timings[str(i)].processor for i in range(len(settings))}
    found = times(settings, spent)
    lines = list(required(found, with_peer=with_peer))
    if not short:
        lines += of_two_rods()
        lines += compilation.required()
        try:
            lines.append(against_exudyn(rounds))
        except ImportError as error:
            missing.append(f"Exudyn could not be run: {error}; 'pip install exudyn' (the extra 'peers')")
    rows, in_lanes = measured_in_lanes(rounds)
    lines.append(in_lanes)
    rows += [
        {
            "motion": s.motion,
            "program": s.program,
            "tolerance": s.tolerance,
            "error": s.error,
            "processor [s]": spent[i],
        }
        for i, s in enumerate(settings)
    ]
    rows += [
        {"motion": motion, "program": f"{program} at this error", "tolerance": None, "error": error,
         "processor [s]": time}
        for (motion, program, error), time in found.items()
        if not math.isnan(time)
    ]  # fmt: skip
    return Measurement("Power series, dop853 and heyoka", rows, lines, missing)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True)
    return report_repeats(lambda: measured(short=options.short), options)


if __name__ == "__main__":
    sys.exit(main())
