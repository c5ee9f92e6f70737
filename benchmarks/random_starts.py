"""Initial configurations of random scenes, with sines, roots and fractions, checked against plain geometry.

``python benchmarks/random_starts.py --count 500`` builds 500 random linkages, planar and spatial, pinned and
floating: chains, trees, loops, bodies with several joints; with given lengths, guides, drives and initial
angles. The distances, lines and directions prescribed in a scene are evaluated from the initial positions
without symgen's kernels. They must hold to 1e-13 of the linkage's size. Scenes that cannot be assembled must
be rejected with a scene error; they are counted by message, and least squares from many starts must find no
pose for them either, at 0 s or a moment later. The shipped scenes of points and links come first. Equal
values of ``--seed`` give equal scenes.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from shared.written_linkages import judged, worst_miss

import symgen
from symgen.scene.loading import SHIPPED, read_scene

#: Error of positions due to rounding, relative to the size of a linkage, and scenes per task.
ROUNDING, SHARE = 1e-13, 20


def share(seeds: range) -> tuple[Counter[str], dict[int, float]]:
    """Test scenes, using a separate cache."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SYMGEN_CACHE"] = folder
        return judged(seeds)


def shipped() -> dict[str, float]:
    """Return the errors of the shipped scenes of points and links."""
    names = [path.stem for path in sorted(SHIPPED.glob("*.toml"))]
    names = [name for name in names if "loop" not in read_scene(name).data]
    return {name: worst_miss(name, symgen.build(name, backend="numpy")) for name in names}


def main() -> int:
    """Test all scenes and print the outcomes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=500, help="scenes (500)")
    parser.add_argument("--seed", type=int, default=0, help="of the first scene")
    parser.add_argument("--processes", type=int, default=2, help="in parallel (2)")
    given = parser.parse_args()
    errors: dict[str | int, float] = dict(shipped())
    print(f"{len(errors):7d}  shipped scenes, largest error {max(errors.values()):.1e}")
    end = given.seed + given.count
    shares = [range(first, min(first + SHARE, end)) for first in range(given.seed, end, SHARE)]
    outcomes: Counter[str] = Counter()
    with ProcessPoolExecutor(given.processes) as pool:
        for counted, found in pool.map(share, shares):
            outcomes += counted
            errors |= found
    print(*(f"{count:7d}  {what}" for what, count in outcomes.most_common()), sep="\n")
    print(f"largest error {max(errors.values()):.1e} of the linkage's size")
    wrong = {what: error for what, error in errors.items() if error > ROUNDING}
    print(*(f"wrong start: {what}, {error:.1e}" for what, error in wrong.items()), sep="\n")
    return 1 if wrong or any(what.startswith("WRONGLY") for what in outcomes) else 0


if __name__ == "__main__":
    raise SystemExit(main())
