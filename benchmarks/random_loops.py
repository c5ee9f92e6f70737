"""Random single loops with all joint types: built loops must close, rejected ones must have no closure.

``python benchmarks/random_loops.py --count 1000`` draws 1000 link-joint tables with special angles and zero
lengths, and ``--helical 300`` 300 with at least one helical joint. Each is built; the start and all
assemblies are evaluated with plain 4x4 matrices, and closures are sought from many starts by a solver
independent of symgen. A start must close to 1e-10, a rejected table must have no closure, idle freedoms must
be those of the null space of a numerical Jacobian, and no other closure found may be nearer to the guess than
the chosen one. Equal values of ``--seed`` give equal loops.
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

from shared.drawn_loops import draw, judge

#: Loops per task.
SHARE = 10


def share(first: int, count: int, helical: bool) -> tuple[Counter[str], list[str]]:
    """Test the loops of one task; return the counts of outcomes, and the faults."""
    outcomes: Counter[str] = Counter()
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SYMGEN_CACHE"] = folder
        for seed in range(first, first + count):
            loop = draw(seed, helical)
            outcome, wrong = judge(loop, f"random_loop_{seed}")
            outcomes[outcome] += 1
            if wrong:
                faults.append(f"{seed}{'h' if helical else ''} {' '.join(loop.joints)}, {outcome}: {wrong}")
    return outcomes, faults


def main() -> None:
    """Draw the loops, print every fault and the counts."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=1000, help="loops of any joints")
    parser.add_argument("--helical", type=int, default=300, help="loops with a helical joint")
    parser.add_argument("--seed", type=int, default=0, help="number of the first loop")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="number of processes")
    chosen = parser.parse_args()
    total: Counter[str] = Counter()
    faults = 0
    with ProcessPoolExecutor(chosen.processes) as pool:
        tasks = [
            pool.submit(share, chosen.seed + first, min(SHARE, count - first), helical)
            for helical, count in ((False, chosen.count), (True, chosen.helical))
            for first in range(0, count, SHARE)
        ]
        for task in tasks:
            outcomes, wrong = task.result()
            total += outcomes
            faults += len(wrong)
            for line in wrong:
                print(line, flush=True)
    print(", ".join(f"{name} {count}" for name, count in total.most_common()))
    print(f"{faults} faults in {sum(total.values())} loops")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
