"""Run by a test: kills runs at random moments, resumes each, and prints the outcomes as JSON.

Arguments: a scene, a folder, and how often. Each run is a process of its own, forked from this one.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import symgen
from symgen.runtime.elastic.model import ElasticModel

OPTIONS = {"t_end": 2.0, "method": "rk4", "step": 1e-4, "samples": 1501}
OF_ELASTIC_LINKS = {"method": "gauss", "steps": 3000, "samples": 21}


def bits(result):
    """Return every number of a result but the wall time, exactly."""
    values = [v.values.tobytes().hex() for v in result.variables]
    return values, result.time.tobytes().hex(), result.final, repr(result.drift), result.notes


def main():
    folder, times = Path(sys.argv[2]), int(sys.argv[3])
    model = symgen.build(sys.argv[1])
    elastic = isinstance(model, ElasticModel)
    run, options = model.simulate, OF_ELASTIC_LINKS if elastic else OPTIONS
    begun = time.perf_counter()
    whole = bits(run(**options))
    lasts = time.perf_counter() - begun
    chance = random.Random(6)
    same, steps, half_written = 0, [], 0
    for k in range(times):
        file = folder / f"run{k}"
        wait, killed = chance.uniform(0.0, 0.5 * lasts), False
        while not killed:  # a run that completed before it was killed is repeated
            file.unlink(missing_ok=True)
            child = os.fork()
            if not child:
                run(**options, checkpoint=file, checkpoint_every=0.0)
                os._exit(0)
            while not file.exists():
                time.sleep(0.001)
            time.sleep(wait)
            os.kill(child, signal.SIGKILL)
            killed = os.WIFSIGNALED(os.waitpid(child, 0)[1])
            wait /= 2
        half_written += len(list(folder.glob(".run*")))
        resumed = run(**options, resume=file)
        same += bits(resumed) == whole
        steps.append(resumed.statistics["steps"])
        for left in folder.glob(".run*"):
            left.unlink()
    print(json.dumps({"same": same, "steps": steps, "left": half_written}))


if __name__ == "__main__":
    main()
