"""One turn of the elastic four-bar by symgen, and by the same SymPy matrices and SciPy; cost by elements.

The linkage is the shipped scene: crank held, 10 unknowns, exact form, with geometric stiffness, from rest.
The error is the largest of any link's bending strain at mid-length over 91 times, relative to that link's
peak, against an independent NumPy model of the tests. Of each method the loosest tolerance that comes within
``ERROR`` counts, of symgen's fixed steps the fewest, with the run of half as many that its estimate of the
error takes; symgen's time is that of the whole call of ``model.run``.

The other route lambdifies the assembled matrices together with the rigid motion in closed form, one function
of the time, once with functions of ``numpy`` and once with those of ``math``; SciPy's DOP853 and
``numpy.linalg.solve`` do the rest. The faster of the two counts. Deriving and compiling are not timed.

The cost of a step by the number of elements a link is that of the default method, Gauss collocation, alone.

Exudyn, where installed, solves the same linkage of its own cables, of large rotation. At this speed that is
another motion, so its error is against itself with four times the steps (``exudyn_cables.py``). It comes
within ``ERROR`` in the first eighth of a turn but not, at steps that can be waited for, over the whole: the
time of its eighth is compared with that of symgen's whole turn.
"""

from __future__ import annotations

import copy
import math
import sys
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from harness import Case, Required, Timing, arguments, measure, report
from numpy.typing import NDArray

import symgen

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from elastic_reference import LINKS, RIG, Elastic
from exudyn_cables import Peer, exudyn_or_why
from lambdified_beams import Lambdified

Array = NDArray[np.float64]

SAMPLES, STEPS_BETWEEN, OURS = 91, 48, 5
#: Rounds that routes of seconds are timed in, and routes of a tenth of one: the best counts.
ROUNDS, QUICK_ROUNDS = 2, 10
TOLERANCES = tuple(10.0 ** (-k / 2) for k in range(6, 19))
#: Steps a turn of symgen's fixed steps, so that as many lie between two of the 91 times.
COUNTS = tuple(90 * k for k in range(2, 25))
ERROR, FASTER = 1e-4, 50.0
#: Of the peer's turn, and the steps its search starts from.
PART, FEW = 1 / 8, 5760
ELEMENTS, STEPS, EXPONENT = (10, 20, 50, 100, 200), 20, 1.3
#: The unknowns of the lambdified route by the names of the reference.
NAMES = (
    *("A.x", "A.y", "B.x", "B.y", "crank.k0", "crank.th1"),
    *("coupler.th0", "coupler.th1", "output.th0", "output.th1"),
)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, slack=True)
    truth = Truth()
    routes: list[Any] = [Ours("gauss", truth), Ours("dop853", truth)]
    routes += [Theirs("numpy", truth), Theirs("math", truth)]
    for route in routes:
        route.settle()
    exudyn, why = exudyn_or_why()
    peer = Peer(exudyn, PART, FEW) if exudyn else None
    if peer:
        peer.settle(ERROR)
        routes.append(peer)
    timings = {}
    for quick in (True, False):
        kind = {r.name: Case(r.run, r.work) for r in routes if isinstance(r, Ours) == quick}
        timings |= measure(kind, QUICK_ROUNDS if quick else ROUNDS, 0)
    ours = min((r for r in routes if isinstance(r, Ours)), key=lambda r: timings[r.name].best)
    rows = [_row(r, timings[r.name], timings[ours.name].best) for r in routes]
    costs = {n: cost_of_a_step(n) for n in ELEMENTS}
    rows += [
        {
            "route": f"symgen, {n} elements a link",
            "setting": "a step",
            "steps": None,
            "best [ms]": costs[n] * 1e3,
            "median [ms]": None,
            "over symgen": None,
            "error": None,
        }
        for n in ELEMENTS
    ]
    slow = min(timings[r.name].best for r in routes if isinstance(r, Theirs))
    required = [
        Required(
            "faster than lambdify and DOP853", slow / timings[ours.name].best, FASTER / options.slack, True
        ),
        Required("error over the peak", ours.error, ERROR, False),
        Required("exponent of the cost by elements", exponent(costs), EXPONENT, False),
    ]
    notes = [f"Time of one turn, best and median of {QUICK_ROUNDS} rounds of symgen, {ROUNDS} of the others."]
    if peer:
        ratio = timings[peer.name].best / timings[ours.name].best
        required.append(Required(f"a turn faster than {peer.name}", ratio, 1.0, True))
        notes.append("Exudyn's error is against itself with four times the steps; it follows large rotation.")
    else:
        notes.append(f"Exudyn is left out: {why}")
    title = "One turn of the elastic four-bar, crank held"
    return report(title, rows, required, notes=notes, as_json=options.json)


def _row(route: Any, timing: Timing, ours: float) -> dict[str, Any]:
    return {
        "route": route.name,
        "setting": route.setting,
        "steps": route.steps,
        "best [ms]": timing.best * 1e3,
        "median [ms]": timing.median * 1e3,
        "over symgen": timing.best / ours,
        "error": route.error,
    }


class Truth:
    """The strains of the independent model, and its size of displacements and rates."""

    def __init__(self, samples: int = SAMPLES, steps_between: int = STEPS_BETWEEN) -> None:
        self.model, self.samples = Elastic(), samples
        strain, states = self.model.transient((samples - 1) * steps_between)
        self.strain = strain[:, ::steps_between] * 1e-6
        rows, _ = self.model.strain_rows(np.linspace(0, 2 * math.pi, samples))
        order = [self.model.unknowns.index(name) for name in NAMES]
        self.rows = rows[:, :, order]
        n = len(NAMES)
        self.scale = np.abs(states).max(axis=0)[[*order, *(n + i for i in order)]]

    def error(self, strain: Array) -> float:
        """Return the largest error of strains (links, times) over the peak of each link."""
        worst = np.abs(strain - self.strain).max(axis=1) / np.abs(self.strain).max(axis=1)
        return float(np.max(worst))


class Settled:
    """A route with the loosest setting that comes within the error asked."""

    name: str
    steps: int | None = None
    error = math.inf
    option = "rtol"
    settings: Sequence[float] = TOLERANCES
    given = math.nan
    work = 1

    @property
    def setting(self) -> str:
        """What the method was given."""
        return f"{self.option} {self.given:g}"

    def strain(self) -> Array:
        """Run, and return the strains (links, times)."""
        raise NotImplementedError

    def settle(self) -> None:
        """Find the setting."""
        for given in self.settings:
            self.given = given
            self.error = self.truth.error(self.strain())
            if self.error <= ERROR:
                return
        raise ArithmeticError(f"{self.name} does not come within {ERROR}")

    truth: Truth


class Ours(Settled):
    """symgen's run."""

    work = OURS

    def __init__(self, method: str, truth: Truth) -> None:
        self.name, self.method, self.truth = f"symgen, {method}", method, truth
        self.model = symgen.build("elastic_four_bar")
        if method == "gauss":
            self.option, self.settings = "steps", COUNTS

    def strain(self) -> Array:
        """Run, and return the strains (links, times)."""
        given: dict[str, Any] = {self.option: self.given}
        result = self.model.run(self.method, samples=self.truth.samples, **given)
        self.steps = result.statistics["steps"]
        return np.array([result.variable(f"{link}.bending_strain").values for link in LINKS])

    def run(self) -> None:
        """Run several times."""
        given: dict[str, Any] = {self.option: self.given}
        for _ in range(self.work):
            self.model.run(self.method, samples=self.truth.samples, **given)


class Theirs(Settled):
    """The lambdified matrices and SciPy."""

    def __init__(self, functions: str, truth: Truth) -> None:
        self.name, self.functions, self.truth = f"lambdify ({functions}), SciPy DOP853", functions, truth

    @cached_property
    def route(self) -> Lambdified:
        """The function, made when first used."""
        return Lambdified(RIG, self.functions)

    def strain(self) -> Array:
        """Run, and return the strains (links, times)."""
        S = self.route.turn(self.given, self.truth.samples, self.truth.scale)
        self.steps = self.route.evaluations // 12
        return np.asarray(np.einsum("ktn,tn->kt", self.truth.rows, S))

    def run(self) -> None:
        """Run once."""
        self.route.turn(self.given, self.truth.samples, self.truth.scale)


def linkage(elements: int) -> Any:
    """Return the model with so many elements a link."""
    from symgen.scene.loading import read_scene

    data = copy.deepcopy(dict(read_scene("elastic_four_bar").data))
    for link in data["links"].values():
        link["elastic"]["elements"] = elements
    return symgen.build(symgen.Scene(**data))


def cost_of_a_step(elements: int, steps: int = STEPS, rounds: int = 5) -> float:
    """Return the best time of a step [s]."""
    from symgen.runtime._beams import BeamSteps
    from symgen.runtime.beam_methods import BEAM_METHODS

    motion = linkage(elements)._motion(True)
    equations = motion.equations()
    rest = np.zeros((motion.layout.unknowns, 1))
    stepper = BeamSteps(equations, BEAM_METHODS["gauss"], 1)
    motion.check(equations, stepper.start(0.0, rest, rest), 0.0)
    h = motion.period / 100_000

    def run() -> None:
        motion.check(equations, stepper.advance(0.0, steps * h, steps), 0.0)

    return measure({"": Case(run, steps)}, rounds, 1)[""].best


def exponent(costs: dict[int, float]) -> float:
    """Return the exponent of the cost by the number of elements, by least squares of logarithms."""
    n, seconds = np.log(list(costs)), np.log(list(costs.values()))
    return float(np.polyfit(n, seconds, 1)[0])


if __name__ == "__main__":
    sys.exit(main())
