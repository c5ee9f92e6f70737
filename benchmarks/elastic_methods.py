"""Methods for the full equations of the elastic four-bar: stability over a revolution, errors and times.

The systems are those that the thesis could not integrate: prescribed crank motion (10 unknowns) and free
crank (11), in the exact and in the constant-transformation form, without geometric stiffness, from rest. The
error is the largest of any link's bending strain at mid-length over 181 times, relative to that link's peak,
against Gauss collocation with 8100 steps. A run survives if its values are finite and its error is below one.

Methods of symgen are compiled. SciPy's methods call the compiled accelerations from Python, which takes
minutes; ``--short`` omits them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from harness import Measurement, Required, arguments, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.errors import SimulationError

Array = NDArray[np.float64]

LINKS = ("crank", "coupler", "output")
SAMPLES = 181
SYSTEMS = tuple((crank, form) for crank in ("held", "free") for form in ("exact", "thesis"))
SCENES = {"held": "thesis_four_bar", "free": "elastic_four_bar_free"}
#: SciPy's methods that symgen does not provide.
SCIPY = ("RK45", "Radau", "BDF", "LSODA")


def by_method(model: Any, method: str, **options: Any) -> Any:
    """Return a result by an integration method, or of the analysis periodic or quasi-static."""
    if method in ("periodic", "quasi-static"):
        return getattr(model, method.replace("-", "_"))(**options)
    return model.simulate(method=method, **options)


@dataclass(frozen=True)
class Attempt:
    """A method with its number of steps per revolution or its tolerance, and whether it is recommended."""

    method: str
    steps: int | None = None
    tolerance: float | None = None
    recommended: bool = True

    @property
    def setting(self) -> str:
        """The number of steps or the tolerance as text."""
        return f"{self.steps} steps" if self.steps else f"rtol {self.tolerance:.0e}"


REFERENCE = Attempt("gauss", 8100)
ATTEMPTS = (
    *(Attempt("rk4", n, recommended=n > 1024) for n in (1024, 2250, 4500)),
    *(Attempt(m, n) for m in ("newmark", "generalized-alpha", "wilson-theta") for n in (1080, 2250, 4500)),
    *(Attempt(m, n) for m in ("gauss4", "gauss") for n in (1080, 2250, 4500)),
    *(Attempt("dop853", tolerance=x) for x in (1e-4, 1e-6, 1e-8)),
    *(Attempt(m, tolerance=1e-6) for m in SCIPY),
)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, short=True)
    return report_repeats(lambda: measured(options.short), options)


def measured(short: bool) -> Measurement:
    """Return the table of all methods, without those of SciPy where a ``short`` one is asked."""
    rows = table(SYSTEMS, [a for a in ATTEMPTS if not (short and a.method in SCIPY)])
    return Measurement(
        "One revolution of the elastic four-bar from rest, without geometric stiffness",
        rows,
        required(rows),
        [
            "growth: peak bending strain of the crank. With fixed steps the time includes a run with "
            "fewer or more of them, from which symgen estimates the error"
        ],
    )


def required(rows: Iterable[Mapping[str, Any]]) -> list[Required]:
    """Return the criteria: every recommended method survives, and accurate ones agree with the reference."""
    rows = list(rows)
    lost = sum(row["recommended"] and row["survives"] != "yes" for row in rows)
    tight = [row["error"] for row in rows if row["method"] == "dop853" and row["setting"] == "rtol 1e-08"]
    lines = [Required("recommended methods that do not survive", float(lost), 0.0, False)]
    return [*lines, Required("error of DOP853 at 1e-8", max(tight), 1e-5, False)] if tight else lines


def table(systems: Sequence[tuple[str, str]], attempts: Sequence[Attempt]) -> list[dict[str, Any]]:
    """Return one row per system and attempt."""
    rows = []
    for crank, form in systems:
        model = symgen.build(SCENES[crank])
        truth = _strains(model, form, REFERENCE)
        assert truth is not None
        for attempt in attempts:
            begun = perf_counter()
            found = _strains(model, form, attempt)
            spent = perf_counter() - begun
            error = _error(found, truth)
            rows.append(
                {
                    "crank": crank,
                    "form": form,
                    "method": attempt.method,
                    "setting": attempt.setting,
                    "recommended": attempt.recommended,
                    "survives": "yes" if error < 1.0 else "no",
                    "error": error,
                    "time [s]": spent,
                    "growth": float(np.max(np.abs(truth[0]))),
                }
            )
    return rows


def _error(found: Array | None, truth: Array) -> float:
    if found is None or not np.all(np.isfinite(found)):
        return float("inf")
    return float(np.max(np.abs(found - truth).max(axis=1) / np.abs(truth).max(axis=1)))


def _strains(model: Any, form: str, attempt: Attempt) -> Array | None:
    """Return the strains (links, times); None if the method breaks down."""
    if attempt.method in SCIPY:
        return _by_scipy(model, form, attempt)
    given = {"steps": attempt.steps} if attempt.steps else {"rtol": attempt.tolerance}
    try:
        found = by_method(
            model, attempt.method, samples=SAMPLES, form=form, geometric_stiffness=False, **given
        )
    except SimulationError:
        return None
    return np.array([found.variable(f"{link}.bending_strain").values for link in LINKS])


def _by_scipy(model: Any, form: str, attempt: Attempt) -> Array | None:
    from scipy.integrate import solve_ivp

    from symgen.runtime.elastic.outputs import outputs

    motion = model.motion(False)
    equations = motion.equations(form == "thesis")
    n = motion.layout.unknowns

    def rate(t: float, y: Array) -> Array:
        _, mass, damping, stiffness, load, _ = equations.matrices(t)
        return np.concatenate([y[n:], np.linalg.solve(mass, load - damping @ y[n:] - stiffness @ y[:n])])

    times = np.linspace(0.0, motion.period, SAMPLES)
    tolerance = attempt.tolerance
    # displacements are some 1e-2 m, rates some 10 m/s
    scale = np.repeat([1e-3, 1.0], n)
    found = solve_ivp(
        rate,
        (0.0, motion.period),
        np.zeros(2 * n),
        method=attempt.method,
        t_eval=times,
        rtol=tolerance,
        atol=tolerance * scale,
    )
    if not found.success:
        return None
    links = equations.motion.along(times)[3].reshape(SAMPLES, len(motion.beams), -1)
    made = {v.name: v.values for v in outputs(motion, links, np.ascontiguousarray(found.y[:n].T))}
    return np.array([made[f"{link}.bending_strain"] for link in LINKS])


if __name__ == "__main__":
    sys.exit(main())
