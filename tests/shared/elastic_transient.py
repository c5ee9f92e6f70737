"""The strip on a turning shaft in motion from rest, in closed form and 40 digits; nothing is of symgen.

On axes that turn with the shaft at w its equations have constant coefficients,

    M s'' + 2 w G s' + (K + K_N - w^2 M) s = Q,

where G has the products of deflections along and across, so that s follows from a matrix exponential.

``python tests/shared/elastic_transient.py`` writes it to ``tests/reference/elastic_runs.json``.
"""

from __future__ import annotations

import json
from pathlib import Path

import mpmath as mp
from shared.elastic_exact import CASES, DIGITS, STEP, Structure, coriolis, structure

REFERENCE = Path(__file__).parents[1] / "reference" / "elastic_runs.json"
SCENE, TIME = "rotating_cantilever", "0.05"


def _turned(v):
    """Unknowns, mass, Coriolis matrix over w, stiffness and load on turning axes."""
    made = structure(SCENE, v, mp.mpf(0), moving=True)
    mass, stiffness = made.matrices()
    of = Structure()
    length, count = v["length"], 4
    nodes = [[{f"strip.{x}{i}": 1} for x in ("u", "w", "theta", "kappa")] for i in range(count + 1)]
    nodes[0] = [{}, {}, {}, nodes[0][3]]
    nodes[count] = [{"x": 1}, {"y": 1}, nodes[count][2], {}]
    for i in range(count):
        per_length = v["density"] * v["width"] * v["thickness"]
        of.add(coriolis(length / count, per_length), of.m, nodes[i] + nodes[i + 1])
    n = len(made.names)
    turning = mp.matrix(n, n)
    for (a, b), x in of.m.items():
        turning[made.names.index(a), made.names.index(b)] = x
    load = mp.matrix([made.q.get(name, mp.mpf(0)) for name in made.names])
    return made.names, mass, turning, stiffness - v["speed"] ** 2 * mass, load


def tip(v, t):
    """Displacement of the tip [m] on fixed axes at a time [s] after a start undeformed."""
    names, mass, turning, stiffness, load = _turned(v)
    n = len(names)
    inverse = mp.inverse(mass)
    system = mp.matrix(2 * n + 1, 2 * n + 1)
    blocks = ((-inverse * stiffness, 0), (-2 * v["speed"] * inverse * turning, n), (inverse * load, 2 * n))
    for i in range(n):
        system[i, n + i] = mp.mpf(1)
        for block, first in blocks:
            for j in range(block.cols):
                system[n + i, first + j] = block[i, j]
    moved = mp.expm(system * t) * mp.matrix([0] * (2 * n) + [1])
    found = mp.mpc(moved[names.index("x")], moved[names.index("y")]) * mp.expj(v["speed"] * t)
    return [mp.re(found), mp.im(found)]


def slopes(names):
    """Displacements of the tip, and their derivatives by parameters: lists by name."""
    values, _ = CASES[SCENE]
    with mp.workdps(DIGITS):
        t, by = mp.mpf(TIME), {}
        for name in names:
            h = STEP * values[name]
            high, low = (tip(values | {name: values[name] + e}, t) for e in (h, -h))
            by[name] = [(x - y) / (2 * h) for x, y in zip(high, low, strict=True)]
        return tip(values, t), by


def main():
    """Write the reference."""
    values, by = slopes([*CASES[SCENE][0]])
    text = {name: [mp.nstr(x, 25) for x in row] for name, row in by.items()}
    made = {SCENE: {"t": TIME, "values": [mp.nstr(x, 25) for x in values], "by": text}}
    REFERENCE.write_text(json.dumps(made, indent=1) + "\n")


if __name__ == "__main__":
    main()
