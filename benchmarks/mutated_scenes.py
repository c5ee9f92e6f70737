"""Scene files with injected faults: each must give a scene or a SymgenError.

``python benchmarks/mutated_scenes.py --count 10000`` derives files from the shipped scenes: missing,
duplicate and renamed keys, wrong types, extreme numbers, unusual units and characters, deep nesting,
expressions that try to run code, invalid bytes. Every file is read and resolved, one in four of the valid
ones is derived, one in sixteen built and run for half a second. Only errors of symgen with readable messages
are permitted; nothing may take longer than 5 seconds, and no run longer than its limit; nothing may start a
process, execute code from the scene, or write a file outside the cache. The longest runs are printed, and
saved with ``--save``. Equal values of ``--seed`` give equal files.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from shared.mutations import PATIENCE, Hang, judge, named, scene_files, warm_up

#: Files per task: tasks run in parallel, and a fault names its task. Number of longest runs printed.
SHARE, LONGEST = 500, 10


def share(number: int) -> tuple[Counter[str], dict[str, bytes], list[tuple[float, str, bytes]]]:
    """Test the files of one task; return the outcomes, an example of every fault, and the longest runs."""
    outcomes: Counter[str] = Counter()
    faults: dict[str, bytes] = {}
    runs: list[tuple[float, str, bytes]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["SYMGEN_CACHE"] = str(folder / "cache")
        warm_up()

        @seed(number)
        @settings(
            max_examples=SHARE,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(scene_files())
        def one(content: bytes) -> None:
            try:
                outcome, wall = _patiently(content, folder)
                outcomes[outcome] += 1
                runs.append((wall, outcome, content))
            except BaseException as error:  # any exception is an outcome
                if isinstance(error, KeyboardInterrupt):
                    raise
                outcomes["FAULT"] += 1
                faults.setdefault(named(error), content)

        one()
    return outcomes, faults, sorted(runs)[-LONGEST:]


def _patiently(content: bytes, folder: Path) -> tuple[str, float]:
    """Test a file; repeat after a timeout, which a busy machine may cause."""
    try:
        return judge(content, folder)
    except Hang:
        return judge(
            content, folder, 2 * PATIENCE if os.getloadavg()[0] > (os.cpu_count() or 1) else PATIENCE
        )


def main() -> int:
    """Test all files and print the outcomes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000, help="files (10000)")
    parser.add_argument("--seed", type=int, default=0, help="of the first task; CI uses the default")
    parser.add_argument("--processes", type=int, default=2, help="number of processes (2)")
    parser.add_argument("--save", type=Path, help="folder for one example of every fault")
    given_ = parser.parse_args()
    shares = range(given_.seed, given_.seed - (-given_.count // SHARE))
    outcomes: Counter[str] = Counter()
    faults: dict[str, bytes] = {}
    runs: list[tuple[float, str, bytes]] = []
    with ProcessPoolExecutor(given_.processes) as pool:
        for done, (counted, found, longest) in enumerate(pool.map(share, shares), 1):
            outcomes += counted
            faults = found | faults
            runs = sorted(runs + longest)[-LONGEST:]
            if sys.stderr.isatty():
                print(f"\r{done}/{len(shares)} shares, {len(faults)} faults", end="", file=sys.stderr)
    print(*(f"{count:7d}  {what}" for what, count in outcomes.most_common()), sep="\n")
    for wall, outcome, content in reversed(runs):
        title = next((line for line in content.splitlines() if line.startswith(b"title")), b"")
        print(f"{wall:7.2f}  s of run ({outcome}), {title[:80].decode(errors='replace')}")
    for what in sorted(faults):
        print(f"\n{what}")
    if given_.save:
        given_.save.mkdir(parents=True, exist_ok=True)
        kept = {f"{i}": faults[what] for i, what in enumerate(sorted(faults))}
        kept |= {f"run_{wall:.2f}_s": content for wall, _, content in runs}
        for name, content in kept.items():
            (given_.save / f"{name}.toml").write_bytes(content)
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
