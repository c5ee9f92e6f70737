"""Times of commands against the import of SymPy."""

from __future__ import annotations

import subprocess
import sys
import time

#: Rounds at most: other work on the machine only ever adds to a time, so the best of each counts.
ROUNDS = 8


def seconds(arguments, environment):
    begun = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - begun


def holds(arguments, environment, bound, before=lambda: None):
    """Time a command and the import of SymPy in turn, until the bound holds or the rounds are over."""
    command = imported = float("inf")
    for _ in range(ROUNDS):
        imported = min(imported, seconds(["-c", "import sympy"], environment))
        before()
        command = min(command, seconds(arguments, environment))
        if command <= bound * max(0.5, imported):
            return True
    return False
