"""Scene files with faults put into them: each gives a scene or a named error, and nothing else.

``python benchmarks/mutated_scenes.py --count 10000`` makes so many files out of the shipped scenes: keys
dropped, doubled and renamed, wrong types, extreme numbers, odd units and letters, deep nesting, expressions
that want to run code, broken bytes. Every file is read and resolved, one in four of the good ones is derived,
one in sixteen built. No other error than those of symgen may come, none without clean words, nothing may take
longer than 5 seconds, start a process, run code of the scene, or write a file outside the cache. The same
``--seed`` makes the same files.
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

from mutations import PATIENCE, Hang, judge, named, scene_files, warm_up

#: Files of one share: shares are made side by side, and a fault names its share.
SHARE = 500


def share(number: int) -> tuple[Counter[str], dict[str, bytes]]:
    """Judge one share of files; return how many came to what, and an example of every fault."""
    outcomes: Counter[str] = Counter()
    faults: dict[str, bytes] = {}
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
                outcomes[_patiently(content, folder)] += 1
            except BaseException as error:  # whatever it is, it is the finding
                if isinstance(error, KeyboardInterrupt):
                    raise
                outcomes["FAULT"] += 1
                faults.setdefault(named(error), content)

        one()
    return outcomes, faults


def _patiently(content: bytes, folder: Path) -> str:
    """Judge a file; on a busy machine once more before it is said to hang."""
    try:
        return judge(content, folder)
    except Hang:
        return judge(
            content, folder, 2 * PATIENCE if os.getloadavg()[0] > (os.cpu_count() or 1) else PATIENCE
        )


def main() -> int:
    """Judge all files and print what came of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000, help="files (10000)")
    parser.add_argument("--seed", type=int, default=0, help="of the first share; CI changes nothing")
    parser.add_argument("--processes", type=int, default=2, help="side by side (2)")
    parser.add_argument("--save", type=Path, help="folder for one example of every fault")
    given_ = parser.parse_args()
    shares = range(given_.seed, given_.seed - (-given_.count // SHARE))
    outcomes: Counter[str] = Counter()
    faults: dict[str, bytes] = {}
    with ProcessPoolExecutor(given_.processes) as pool:
        for done, (counted, found) in enumerate(pool.map(share, shares), 1):
            outcomes += counted
            faults = found | faults
            if sys.stderr.isatty():
                print(f"\r{done}/{len(shares)} shares, {len(faults)} faults", end="", file=sys.stderr)
    print(*(f"{count:7d}  {what}" for what, count in outcomes.most_common()), sep="\n")
    for number, (what, content) in enumerate(sorted(faults.items())):
        print(f"\n{what}")
        if given_.save:
            given_.save.mkdir(parents=True, exist_ok=True)
            (given_.save / f"{number}.toml").write_bytes(content)
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
