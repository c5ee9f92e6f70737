"""The options of a run, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgen.errors import ModelError, OptionsError, SimulationError, nearest
from symgen.precision import FLOAT64, Precision
from symgen.runtime._core import STABILISATIONS
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.integrators import integrator
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.kernels.arguments import count, is_real, out_of_range, reals

#: Initial states of motions of elastic links.
INITIAL = ("undeformed", "quasi-static")
#: Times of t_eval in messages.
_SHOWN = 4
#: Tightest relative tolerance that a type can meet, over its epsilon.
TIGHTEST = 100.0
#: Default relative tolerance of a type, over its epsilon.
_DEFAULT = 1000.0
#: Least default relative tolerance of any type.
_RTOL = 1e-9
#: Default absolute tolerance [m, m/s], over the relative one.
_ATOL = 1e-3
#: Largest relative tolerance at which power series are the default: measured, see docs/integrators.md.
SERIES_RTOL = 1e-7
#: The same where events or jumps of loads have no series: short steps take longer than dop853 in doubles.
SERIES_RTOL_PROBED = 1e-13


def end_of_scene(t_end: float) -> float:
    """Return the end of the run of a scene [s]; raise SimulationError if its parameters make it none."""
    if not 0.0 < t_end < math.inf:
        raise SimulationError(
            f"t_end of the scene is {t_end:g} s with these parameters, and not a finite time above zero\n"
            "  Change the parameters, t_end of the scene, or the end of a run or range of rigid links."
        )
    return t_end


@dataclass(frozen=True, slots=True)
class Options:
    """How to run: checked by :func:`options`.

    ``otherwise`` are the options of the run that replaces this one if its method, a default, cannot continue.
    """

    method: Integrator
    t_end: float
    rtol: float
    atol: float
    step: float
    samples: int
    max_steps: int
    stabilisation: str = "projection"
    rate: float = 0.0
    max_drift: float = np.inf
    max_step: float = 0.0
    otherwise: Options | None = None


#: Rate [1/s] of Baumgarte's terms when none is given: errors of constraints fall to a tenth in 0.4 s.
BAUMGARTE_RATE = 10.0


def options(*positional: Any, **named: Any) -> Options:
    """Check the options of a run as :func:`_options` does, once for each set of them.

    Raises
    ------
    ModelError
        If an option is out of its range, or does not apply to the method.
    """
    try:
        return _remembered(*positional, **named)
    except TypeError:  # not hashable, so neither a number nor a name: the check raises its error
        return _options(*positional, **named)


def _options(
    t_end: float,
    method: str | None,
    rtol: float | None,
    atol: float | None,
    step: float | None,
    samples: int,
    max_steps: int,
    stabilisation: str = "projection",
    rate: float | None = None,
    max_drift: float | None = None,
    precision: Precision = FLOAT64,
    *,
    max_step: float | None = None,
    series: float = 0.0,
) -> Options:
    """Check the options of a run in a precision and fill in the defaults.

    ``series`` is the largest relative tolerance at which power series of the motion are the default.

    Raises
    ------
    ModelError
        If an option is out of its range, or does not apply to the method.
    """
    count(samples, "samples")
    count(max_steps, "max_steps")
    if method is not None and not isinstance(method, str):
        raise ModelError(f"expected the name of an integrator, got {method!r}")
    chosen = integrator(method or "dop853")
    numbers = {"t_end": t_end, "rtol": rtol, "atol": atol, "step": step}
    limits = {"max_drift": max_drift, "max_step": max_step}
    for name, value in {**numbers, "stabilisation_rate": rate, **limits}.items():
        if value is not None and not (is_real(value) and value > 0):
            raise out_of_range(name, value)
    # Equal numbers of another type would make another run of the same one.
    t_end = float(t_end)
    rtol, atol, step, rate, max_drift, max_step = (
        None if x is None else float(x) for x in (rtol, atol, step, rate, max_drift, max_step)
    )
    constraint_options = (*_constraint_options(chosen, stabilisation, rate, max_drift), max_step or 0.0)
    if not 2 <= samples <= 10_000_000:
        raise ModelError(f"expected between 2 and 10 million samples, got {samples}")
    if max_steps < 1:
        raise ModelError(f"expected max_steps of at least 1, got {max_steps}")
    can_be_fixed = not chosen.adaptive or chosen.kind == "explicit"  # the others solve to the tolerance
    if step is not None and not can_be_fixed:
        raise OptionsError(
            f"{chosen.name} chooses its own step: give {{rtol}} and {{atol}}, also with a largest "
            "{max_step}, or another {method}"
        )
    if max_step is not None and (step is not None or not chosen.adaptive):
        raise OptionsError(
            "{max_step} limits the steps of methods that choose their own: give a smaller {step}"
        )
    if chosen.adaptive and step is None:
        rtol, atol = _tolerances(rtol, atol, precision)
        found = Options(chosen, t_end, rtol, atol, 0.0, samples, max_steps, *constraint_options)
        return by_series(found, series) if method is None else found
    if rtol is not None or atol is not None:
        if chosen.adaptive:
            raise OptionsError("fixed steps have no tolerance: give {step}, or {rtol} and {atol}, not both")
        raise OptionsError(f"{chosen.name} has a fixed step: give {{step}} instead of {{rtol}} and {{atol}}")
    if step is None:
        raise OptionsError(f"{chosen.name} has a fixed step: give it one, such as {{step}}=1e-3")
    if step < precision.coarsened(1e-12) * t_end:
        name = precision.name
        raise OptionsError(f"{{step}}={step:g} s is too small against {{t_end}}={t_end:g} s for {name}")
    return Options(chosen, t_end, 0.0, 0.0, step, samples, max_steps, *constraint_options)


def by_series(found: Options, largest: float) -> Options:
    """Return options by default: power series up to the ``largest`` tolerance, otherwise those ``found``."""
    if not 0.0 < found.rtol <= largest or found.stabilisation != "projection" or found.otherwise:
        return found
    return replace(found, method=integrator("taylor"), otherwise=found)


def recorded_at(t_eval: ArrayLike, start: float, end: float) -> Array:
    """Return the times [s] at which a run from ``start`` to ``end`` records its state.

    Raises
    ------
    ModelError
        When they do not increase, or are outside of the run.
    """
    times = reals(t_eval, "t_eval")
    if not len(times) or np.any(np.diff(times) <= 0.0) or times[0] < start or times[-1] > end:
        text = ", ".join(f"{t:.6g}" for t in times[:_SHOWN].tolist()) + (
            ", ..." if len(times) > _SHOWN else ""
        )
        raise ModelError(
            f"expected increasing times from {start:g} s to {end:g} s for t_eval, at least one, got "
            f"[{text}]\n"
            "  t_end sets the end of the run."
        )
    return times


def sample_count(samples: int | None, t_eval: ArrayLike | None, default: int) -> int:
    """Return the number of equally spaced samples; raise ModelError if times are given as well."""
    if samples is not None and t_eval is not None:
        raise OptionsError("give {samples} or {t_eval}, not both")
    return default if samples is None else samples


_remembered = lru_cache(maxsize=64, typed=True)(_options)


def _tolerances(rtol: float | None, atol: float | None, precision: Precision) -> tuple[float, float]:
    """Return (rtol, atol) with defaults filled in; ModelError if rtol is too tight for the precision."""
    tightest, name = TIGHTEST * precision.epsilon, precision.name
    rtol = max(_RTOL, _DEFAULT * precision.epsilon) if rtol is None else rtol
    if rtol < tightest:
        raise OptionsError(f"{{rtol}}={rtol:g} is below {tightest:.2g}, the tightest that {name} can meet")
    floor = 0.0 if precision.epsilon <= FLOAT64.epsilon else 10 * precision.epsilon
    return rtol, max(_ATOL * rtol, floor) if atol is None else atol


def _constraint_options(
    method: Integrator, stabilisation: str, rate: float | None, max_drift: float | None
) -> tuple[str, float, float]:
    """Check how the constraints are kept, and fill in the defaults."""
    if stabilisation not in STABILISATIONS:
        known = ", ".join(STABILISATIONS)
        raise OptionsError(
            f"expected {{stabilisation}} to be one of {known}, got {stabilisation!r}. "
            f"{nearest(str(stabilisation), STABILISATIONS)}"
        )
    if stabilisation != "projection" and method.kind != "explicit":
        raise OptionsError(
            f"{{stabilisation}}={stabilisation} goes with explicit methods, not with {method.name}"
        )
    if rate is not None and stabilisation != "baumgarte":
        raise OptionsError(
            f"{{stabilisation_rate}} goes with {{stabilisation}}=baumgarte, not with {stabilisation}"
        )
    if stabilisation == "baumgarte":
        rate = BAUMGARTE_RATE if rate is None else rate
    return stabilisation, rate or 0.0, np.inf if max_drift is None else max_drift


def initial_state(state: str | Sequence[float]) -> str | tuple[float, ...]:
    """Return the initial state of a run: its name, or amplitudes of modes [m].

    Raises
    ------
    ModelError
        For an unknown name, and amplitudes that are not finite.
    """
    if isinstance(state, str):
        if state not in INITIAL:
            known = nearest(state, INITIAL)
            raise ModelError(f"there is no initial state {state!r} of elastic links. {known}")
        return state
    return tuple(reals(state, "the amplitudes of modes at the start").tolist())
