"""The gas table of the V-twin next to the same function by 25 terms of max: the counts that the documentation states."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import symgen

ROOT = Path(__file__).parents[3]


def by_max():
    """Changes of the scene: straight lines between the points as a sum of changes of slope, repeated by mod."""
    table = symgen.load_scene("v_twin").tables["gas"]
    x, y = ([float(value.split()[0]) for value in values] for values in (table.x, table.y))
    points = pairwise(zip([*x, x[0] + 720], [*y, y[0]], strict=True))
    slopes = [(d - b) / np.deg2rad(c - a) for (a, b), (c, d) in points]
    changes = np.diff(slopes, prepend=0.0)
    parameters = {f"x{i}": f"{value} deg" for i, value in enumerate(x)}
    parameters |= {f"s{i}": f"{float(change)!r} bar" for i, change in enumerate(changes)}
    parameters |= {"y0": f"{y[0]} bar", "d": "720 deg", "b1": "up + half", "b2": "up - half + turn"}
    forces = []
    for n, axis in ((1, "sin(half)"), (2, "-sin(half)")):
        terms = " + ".join(f"s{i}*max(mod(crank.angle - b{n}, d) - x{i}, 0)" for i in range(25))
        forces.append(
            {"point": f"B{n}", "force": [f"load*area*(y0 + {terms})*{k}" for k in (axis, "(-cos(half))")]}
        )
    return {"parameters": parameters, "forces": forces, "tables": None}


def test_a_table_and_its_terms_of_max_have_the_counts_of_the_documentation():
    runs, counts = [], []
    for changes in ({"tables.gas.kind": "linear"}, by_max()):
        run = symgen.build("v_twin", set=changes).simulate(method="dop853", rtol=1e-10, samples=41)
        (points,) = [
            int(n[1]) for note in run.notes if (n := re.match(r"steps end on (\d+) switching points", note))
        ]
        runs.append(run)
        counts.append((points, run.statistics["steps"]))
    table, terms = (run["crank.torque"].values for run in runs)
    assert terms == pytest.approx(table, abs=1e-12 * np.max(np.abs(table)))
    text = (ROOT / "docs" / "scene_jumps.md").read_text().replace("\n", " ")
    stated = re.search(r"(\d+) switching points in (\d+) steps.*?, (\d+) in (\d+) with", text)
    assert [int(n) for n in stated.groups()] == [*counts[0], *counts[1]]
