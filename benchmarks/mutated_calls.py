"""Calls of every public function and method with invalid arguments: a result or a SymgenError.

    python benchmarks/mutated_calls.py [--only NAME]

The calls are those of ``tests/shared/wrong_calls.py``, of which the tests take a sample. Built-in exceptions,
errors without a readable message and calls longer than 20 s are faults; the exit code is then
1.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from shared.mutations import named
from shared.wrong_calls import judge, wrong_calls


def main() -> int:
    """Make all calls and print their outcomes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="only functions whose name contains this")
    given = parser.parse_args()
    outcomes: Counter[str] = Counter()
    faults: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SYMGEN_CACHE"] = f"{folder}/cache"
        os.chdir(folder)
        for call in wrong_calls(Path(folder)):
            if given.only not in call.callee.name:
                continue
            try:
                outcomes[judge(call)] += 1
            except BaseException as error:  # any exception is an outcome
                if isinstance(error, KeyboardInterrupt):
                    raise
                outcomes["FAULT"] += 1
                faults.setdefault(named(error), str(call))
        os.chdir("/")
    print(*(f"{count:7d}  {what}" for what, count in outcomes.most_common()), sep="\n")
    for what, call in sorted(faults.items()):
        print(f"\n{what}\n  {call}")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
