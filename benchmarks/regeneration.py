"""Time to regenerate kernels: nothing to do, all shipped kernels, one scene, and each scene.

Every command is a separate process, timed from outside. The budgets of scenes are in ``budgets.json``:
processor time relative to that of importing SymPy in the same run, including compilers, and peak memory.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from harness import Measurement, Required, arguments, report_repeats

import symgen
from symgen.scene.loading import scene_path

BUDGETS = Path(__file__).with_name("budgets.json")
#: Permitted ratio of a scene's time and memory to its budget.
SLACK = 1.5
#: Time [s] of importing SymPy on the reference machine; bounds are proportional to it on slower machines.
IMPORT = 0.5
#: Bounds [s] of whole processes: nothing to do, all of generated/, a cold four-bar, its second start.
IDLE, ALL, COLD, SECOND = 0.5, 60.0, 2.0, 0.7
STEP = ("--t-end", "1e-3", "--json")


@dataclass(frozen=True, slots=True)
class Spent:
    """Resources of one process: wall time and processor time [s], and peak memory [MB]."""

    seconds: float
    processor: float
    memory: float


def main() -> int:
    """Measure, print and check."""
    options = arguments(__doc__, short=True)
    return report_repeats(lambda: measured(options.short), options)


def measured(short: bool) -> Measurement:
    """Measure once."""
    scenes = ("four_bar", "slider_crank") if short else symgen.shipped_scenes()
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder)
        sympy = best(["-c", "import sympy"], cache, 3)
        rows = [row("import of SymPy", sympy, sympy)]
        required = []
        whole = commands(cache, short)
        for name, bound, found in whole:
            rows.append(row(name, found, sympy))
            value = found.seconds * IMPORT / max(IMPORT, sympy.seconds)
            required.append(Required(f"{name} [s]", value, bound, at_least=False, timed=True))
        built = {name: cold(["build", name], cache, 1) for name in scenes}
    rows += [row(f"build {name}", found, sympy) for name, found in built.items()]
    required += within(built, sympy)
    if not short:
        busy = (whole[0][2].processor + sum(b.processor for b in built.values())) / 2
        value = busy * IMPORT / max(IMPORT, sympy.processor)
        every = "all of generated/ and all scenes, on 2 cores [s]"
        required.append(Required(every, value, ALL, at_least=False, timed=True))
    notes = (
        "Times: best of several, or a single one if long; processor: sum over all processes.",
        f"Seconds required: on a machine that imports SymPy in {IMPORT:g} s; on a slower one in proportion.",
        f"imports: processor time over that of importing SymPy. A scene may take {SLACK:g} times its budget.",
    )
    return Measurement("Regeneration", rows, required, notes)


def commands(cache: Path, short: bool) -> list[tuple[str, float, Spent]]:
    """Return the resources of whole commands, each with its bound."""
    generate = ["-m", "symgen", "generate"]
    own = cache / "my_four_bar.toml"
    shutil.copy(scene_path("four_bar"), own)
    every = [] if short else [("generate, everything", ALL, cold(["generate"], cache, 1))]
    if short:
        spent(generate, cache)
    idle = best(generate, cache, 5)
    run = ["run", str(own), *STEP]
    first = cold(run, cache, 3)
    second = best(["-m", "symgen", *run], cache, 5)
    return [
        *every,
        ("generate, nothing to do", IDLE, idle),
        ("four-bar, cold", COLD, first),
        ("four-bar, second start", SECOND, second),
    ]


def within(built: dict[str, Spent], sympy: Spent) -> list[Required]:
    """Return the criteria for the budgets of scenes: the largest ratio of time and of memory."""
    stored: dict[str, Any] = json.loads(BUDGETS.read_text(encoding="utf-8"))
    missing = sorted(set(built) - set(stored))
    if missing:
        raise SystemExit(f"{BUDGETS.name} has no budget of {', '.join(missing)}")
    time = max(built[n].processor / sympy.processor / stored[n]["imports"] for n in built)
    memory = max(built[n].memory / stored[n]["memory"] for n in built)
    return [
        Required("time of a scene over its budget", time, SLACK, at_least=False, timed=True),
        Required("memory of a scene over its budget", memory, SLACK, at_least=False),
    ]


def row(name: str, found: Spent, sympy: Spent) -> dict[str, Any]:
    """Return one row of the table."""
    return {
        "what": name,
        "time [s]": found.seconds,
        "processor [s]": found.processor,
        "imports": found.processor / sympy.processor,
        "memory [MB]": found.memory,
    }


def cold(words: list[str], cache: Path, times: int) -> Spent:
    """Return the best of several runs of a command, each with an empty cache."""
    found = []
    for _ in range(times):
        shutil.rmtree(cache / "cache", ignore_errors=True)
        found.append(spent(["-m", "symgen", *words], cache))
    return least(found)


def best(words: list[str], cache: Path, times: int) -> Spent:
    """Return the best of several runs of Python with these arguments."""
    return least([spent(words, cache) for _ in range(times)])


def least(found: list[Spent]) -> Spent:
    """Return the minimum of each quantity: other load on the machine only increases it."""
    return Spent(*(min(getattr(f, k) for f in found) for k in ("seconds", "processor", "memory")))


def spent(words: list[str], cache: Path) -> Spent:
    """Run Python in a separate process and return its resources, including compilers."""
    begun = perf_counter()
    nothing = os.open(os.devnull, os.O_WRONLY)
    process = os.posix_spawn(
        sys.executable,
        [sys.executable, *words],
        {**os.environ, "SYMGEN_CACHE": str(cache / "cache")},
        file_actions=[(os.POSIX_SPAWN_DUP2, nothing, 1)],
    )
    _, status, usage = os.wait4(process, 0)
    seconds = perf_counter() - begun
    os.close(nothing)
    if status:
        raise SystemExit(f"{' '.join(words)} failed")
    unit = 1024**2 if sys.platform == "darwin" else 1024
    return Spent(seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / unit)


if __name__ == "__main__":
    raise SystemExit(main())
