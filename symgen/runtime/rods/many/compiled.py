"""Many runs of a linkage without Python between them, where starts and runs are regular."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symgen.runtime import _core
from symgen.runtime._many import Lanes, LinkageRuns
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options, by_series
from symgen.runtime.integrate.simulate import sample_times
from symgen.runtime.kernels.batch import fits_lanes, lanes_of
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import Library
from symgen.runtime.kernels.typed import Typed
from symgen.runtime.many.dataset import BLOCK, CompiledRuns, Keep, KeptSamples
from symgen.runtime.many.runs import is_stored, parameters_of_runs
from symgen.runtime.result.recording import Recording, continued, shaped
from symgen.runtime.result.records import over_time
from symgen.runtime.rods.large_start import LARGE
from symgen.runtime.rods.many.driven import driven_runs
from symgen.runtime.rods.many.starts import start_of

if TYPE_CHECKING:
    from symgen.runtime.result.state import State

#: Longer runs are carried out singly: they can be interrupted, and tell their pace.
MOST_STEPS = 100_000
#: Fewer runs by power series as the default save less time in lanes than kernels of lanes take to compile.
LEAST_IN_LANES = 64


@dataclass(frozen=True, slots=True)
class SimulatedRuns:
    """Runs with ``parameters`` (runs, parameters) from their starts, or from states (runs, (q, u)).

    ``single`` are runs with the parameters of the scene, which start from the stored state; ``batched`` the
    kernels that take vectors, for fixed explicit steps and power series in SIMD lanes. Of ``steps``, as many
    as the first run took, ``most`` runs take place in one call, which nothing interrupts. ``reason`` is why
    there are no lanes.
    """

    evaluator: Evaluator
    chosen: Options
    t0: float
    times: Array
    parameters: Array
    states: Array | None
    single: NDArray[np.bool_]
    batched: Library | None
    steps: int
    reason: str

    def most(self, keep: Keep) -> int:
        """Return the number of runs of one call."""
        return min(BLOCK, max(1, MOST_STEPS // max(1, self.steps)))

    @property
    def grain(self) -> int:
        """Number of runs that fill all lanes."""
        return lanes_of(self.batched, self.evaluator.description.name)[0] if self.batched else 1

    def __call__(self, first: int, last: int, keep: Keep) -> list[KeptSamples | None]:
        """Carry out some runs; None stands for those that are to be carried out singly."""
        d, rows = self.evaluator.description, slice(first, last)
        states = None if self.states is None else self.states[rows]
        regular, out, turned, drifts = self.runs().carry_out(self.parameters[rows], states)
        info, along = self.evaluator.find("outputs"), over_time(self.times)
        recorded = tuple(v for v in shaped(info, out) if keep.takes(v)) if info else ()
        variables = continued(recorded, d.turns, turned)
        is_done = regular & ~self.single[rows]
        if not is_done.all():
            variables = tuple(v.of(v.values[is_done]) for v in variables)
        drift = dict(zip(("constraint", "energy"), drifts[is_done].T, strict=True))
        runs = first + np.flatnonzero(is_done)
        record = keep(variables, along, None, drift, d.shown_axes, runs) if len(runs) else None
        return [record if done else None for done in is_done.tolist()]

    def runs(self) -> LinkageRuns:
        """Return the compiled runs, for one thread."""
        chosen, start = self.chosen, start_of(self.evaluator, self.chosen.rate)
        return LinkageRuns(
            *start,
            chosen.method,
            self.t0,
            chosen.t_end,
            chosen.rtol,
            chosen.atol,
            chosen.step,
            self.times,
            stabilisation=_core.STABILISATIONS[chosen.stabilisation],
            max_drift=chosen.max_drift,
            max_step=chosen.max_step,
            places_only=self.evaluator.outputs_by_places,
            most=min(chosen.max_steps, MOST_STEPS),
            lanes=Lanes(self.batched, start[1], self.grain) if self.batched else None,
        )


def compiled_runs(
    model: Any,
    first: Any,
    columns: Mapping[str, Array],
    states: Sequence[State] | None,
    arguments: Mapping[str, Any],
) -> CompiledRuns | str:
    """Return runs with the options of a first one, or a reason, maybe '', to carry out each singly."""
    kind = getattr(first, "KIND", "")
    if kind in ("kinematics", "forces"):
        return driven_runs(model, kind == "forces", columns, states, arguments) or ""
    source = getattr(first, "__dict__", {}).get("_source")
    if not isinstance(source, Recording):
        return ""
    evaluator, chosen, d = source.kernels, source.chosen, source.kernels.description
    if d.at_equilibrium and states is None:
        return "each run starts in an equilibrium of its own"
    default = arguments.get("method") is None
    if default:  # the first run may have ended by the method that is chosen otherwise
        chosen = by_series(chosen, model._series)
    starts = {s.t for s in states} if states is not None else {0.0}
    reason = _alone(source, chosen, starts, arguments)
    if reason:
        return reason
    state_of = getattr(model, "_own", lambda state: state)
    rows = None if states is None else np.array([np.concatenate((s.q, s.u)) for s in map(state_of, states)])
    parameter_rows = parameters_of_runs(evaluator, columns, states)
    single = is_stored(evaluator, parameter_rows, states)
    t0 = starts.pop()
    times = np.ascontiguousarray(sample_times(t0, chosen, arguments.get("t_eval")))
    batched, series = None, chosen.method.kind == "taylor"
    few = default and series and len(parameter_rows) < LEAST_IN_LANES
    reason = _without_lanes(d, chosen, model) or (f"they are less than {LEAST_IN_LANES}" if few else "")
    if not reason:
        batched = model.number_type.kernels(True, *((True,) if series else ()))
        if lanes_of(batched, d.name)[0] < 2:
            batched, reason = None, "the compiler has no vectors"
    return SimulatedRuns(
        evaluator, chosen, t0, times, parameter_rows, rows, single, batched, source.stepper.steps, reason
    )


def _alone(source: Recording, chosen: Options, starts: set[float], arguments: Mapping[str, Any]) -> str:
    """Return why each run is carried out by itself, with Python between its steps; '' where it is not."""
    d = source.kernels.description
    own_end = d.kernel("run_end") and arguments.get("t_end") is None and arguments.get("t_eval") is None
    long = chosen.rtol == chosen.atol == 0.0 and chosen.t_end - min(starts) > MOST_STEPS * chosen.step > 0.0
    in_c = source.equations.core_type is _core.DOUBLE and source.library.backend in ("c", "shipped")
    reasons = {
        "a controller sets inputs": source.controls is not None,
        "max_wall is given": arguments.get("max_wall") is not None,
        "kernels are not compiled for float64": not in_c,
        "the scene has events": bool(d.events),
        "a load has jumps": bool(d.switches),
        "a torsion spring or a load follows an angle": bool(d.windings),
        "constraints are redundant": bool(source.redundant),
        "all points are fixed": not d.coordinates,
        "coordinates at the start follow from others": bool(d.constraints) and 0 < len(d.given) < len(d.free),
        "states are at several times": len(starts) > 1,
        "the end of a run depends on its parameters": bool(own_end),
        f"{chosen.method.name} is implicit": chosen.method.needs_tangent,
        f"there are more than {LARGE} coordinates": d.coordinates > LARGE,  # starts are sparse
        f"a run has more than {MOST_STEPS} steps": long,
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _without_lanes(d: Any, chosen: Options, model: Any) -> str:
    """Return why compiled runs are not in SIMD lanes; '' where they are."""
    of_methods = "these are for taylor, and for dop853 and rk4 with fixed steps and projection"
    reasons = {
        of_methods: not _in_lanes(chosen),
        "an angle of a link is recorded": bool(d.turns),
        "the linkage is too large to be compiled for them": not fits_lanes(d),
        "unknowns of the equations are behind the multipliers": bool(model.evaluator.couples),
        "kernels are not compiled": not isinstance(model.number_type, Typed),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _in_lanes(chosen: Options) -> bool:
    """Return whether steps are power series, or explicit of a fixed length, and end on the constraints."""
    method = chosen.method
    fixed = chosen.rtol == chosen.atol == 0.0 and chosen.step > 0.0
    explicit = method.kind == "explicit" and not method.coefficients["same_as_last"]
    return (method.kind == "taylor" or (fixed and explicit)) and chosen.stabilisation == "projection"
