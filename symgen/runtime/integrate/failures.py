"""Messages of runs that cannot continue: time and state, cause, remedy."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from symgen.precision import PRECISIONS
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.causes import cause
from symgen.runtime.integrate.options import Options
from symgen.runtime.integrate.pace import OUT_OF_TIME, out_of_time
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator

#: Units of the state in loads, by the last word of its name.
_UNITS = {"vx": "m/s", "vy": "m/s", "vz": "m/s", "rate": "rad/s", "angular_velocity": "rad/s"}
_UNITS |= {"x": "m", "y": "m", "z": "m", "length": "m", "angle": "rad", "t": "s"}
#: A failed run's message names pivots that keep less than this.
_NEAR = 1e-2
#: In the text of a switching point: it is that of a prescribed motion, not of a load.
PRESCRIBED = re.compile(r" in the (drive|motion|length) of ")
#: Small part of positions, the rounding of doubles, and the number of its signs that are tried.
_PART, _ROUNDINGS = 2.0**-52, 6
#: What failures of power series may have as their cause, whatever else the message says.
_OF_SERIES = (
    "Power series lose their digits near a loss of rank, where loads have no derivatives, and where a "
    "function in a load, such as cosh, exceeds all numbers: try dop853."
)


def problem(
    status: int,
    stepper: _core.Run,
    equations: _core.KernelEquations,
    evaluator: Evaluator,
    chosen: Options,
) -> str:
    """Return the message for a run that ended with this status: time, cause, remedy and last state."""
    return with_cause(_problem(status, stepper, equations, evaluator, chosen), status, chosen)


def with_cause(text: str, status: int, chosen: Options) -> str:
    """Return the message for a run with this status, with what may cause the failure of power series."""
    asked = status in (OUT_OF_TIME, _core.DRIFTED, _core.MORE, _core.SLIDING)
    return text if chosen.method.kind != "taylor" or asked else f"{text}\n  {_OF_SERIES}"


def _problem(
    status: int,
    stepper: _core.Run,
    equations: _core.KernelEquations,
    evaluator: Evaluator,
    chosen: Options,
) -> str:
    description = evaluator.description
    free, width = description.free, 1 if description.rates else len(description.axes)
    at = f"at t = {stepper.t:.9g} s after {stepper.steps} steps"
    unit = "" if description.rates else " m"
    points = ", ".join(
        f"{p} ({', '.join(f'{x:.6g}' for x in stepper.state[i * width : (i + 1) * width])}){unit}"
        for i, p in enumerate(free[:8])
    )
    where = f"State: {points}."
    if status == OUT_OF_TIME:
        return f"{out_of_time(stepper.t, chosen.t_end)} {where}"
    if status == _core.DRIFTED:
        return (
            f"{description.labels[stepper.worst]} strayed by {stepper.position_drift:.4g} m, more than "
            f"max_drift = {chosen.max_drift:g} m, {at}\n  Use the stabilisation 'projection', tighter "
            f"tolerances or a smaller step. {where}"
        )
    if status == _core.SLIDING and PRESCRIBED.search(jump := description.switches[stepper.slid]):
        return f"{of_prescribed(jump, at)} {where}"
    if status == _core.SLIDING:
        return of_sliding(description.switches[stepper.slid], at, f"Run it by the method radau5. {where}")
    if status in (_core.CONTRADICTED, _core.SINGULAR):
        return _of_constraints(status, equations, description, at, where)
    lost_rank = _near_singular(stepper, equations, description)
    failed = status in (_core.PROJECTION_FAILED, _core.UNSOLVED)
    if failed and not lost_rank:
        return _of_the_step(status, chosen, at, where)
    slow = status == _core.STEP_TOO_SMALL or (status == _core.MORE and stepper.steps < chosen.max_steps)
    if failed or (slow and lost_rank):
        return _of_a_dead_centre(description, description.unknown(equations.weakest), at, where)
    return _of_the_loads(status, stepper, equations, evaluator, chosen, lost_rank, at, where)


def of_prescribed(jump: str, at: str) -> str:
    """Return the message for a prescribed motion that jumps, or whose rate does."""
    return (
        f"the prescribed motion, or its rate, jumps with {jump} {at}: no acceleration takes it further\n"
        "  Choose parameters with which its parts end as they begin, or write a profile.NAME; or end before."
    )


def unfinished(stepper: _core.Run, chosen: Options, at: str, reason: str = "") -> str:
    """Return the message for a run that needs more than ``max_steps``; ``reason`` is the cause."""
    if stepper.steps < chosen.max_steps:
        return (
            f"the steps are too short for the run to come to its end {at}: at {stepper.h:.2g} s a step "
            f"it would take more than max_steps = {chosen.max_steps}{reason}\n"
            "  Shorten the run, loosen rtol and atol, or raise max_steps."
        )
    return f"the run was not finished within max_steps, {at}\n  Raise max_steps or shorten the run."


def of_sliding(jump: str, at: str, where: str, units: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the message for a load that holds the motion at its jump, with a smooth form as remedy.

    ``units`` are those of the names in the load.
    """
    return (
        f"the motion stays at the jump of {jump} {at}: on both sides the load drives it back there, as "
        "friction does at rest, and no step can follow\n"
        f"  {_smooth(jump, units)} {where}"
    )


def _smooth(jump: str, smooth_forms: Mapping[str, str]) -> str:
    """Return the smooth function to write in a scene instead of a jump, with its width."""
    written, _, place = jump.rpartition(" in ")
    x = written[written.index("(") + 1 : -1]
    inner = x if re.fullmatch(r"[\w.]+", x) else f"({x})"
    smooth = f"tanh({inner}/w) instead of {written}"
    if not written.startswith(("sign(", "abs(")):
        return "Place the points of the table further apart: points so close to each other act as a jump."
    if not written.startswith("sign"):
        smooth = f"sqrt({inner}**2 + w**2) instead of {written}, or tanh({inner}/w) for a quotient by it"
    words = set(re.findall(r"\.([a-z_]+)", x)) or {x}
    units = {"m/s" if w == "rate" and "actuators" in place else _UNITS.get(w, "") for w in words}
    unit = smooth_forms.get(x) or ("" if len(units) > 1 or re.search(r"[*/(]", x) else units.pop())
    width = f'w = "1e-3 {unit}"' if unit else f"w, in the unit of {x}"
    return f"Write {smooth}, with a small width under [parameters]: {width}."


def _of_constraints(
    status: int, equations: _core.KernelEquations, description: Description, at: str, where: str
) -> str:
    """Return the message for a constraint that contradicts the others or has become dependent."""
    if status == _core.CONTRADICTED:
        return (
            f"a redundant constraint contradicts the others by {equations.missed:.2g} m {at}: the linkage "
            f"cannot be in two places\n  Make the lengths, drives and motions of the ground agree. {where}"
        )
    if equations.lost < equations.redundant:
        return (
            f"a constraint that was redundant at the start is no longer so {at}: its contradiction of the "
            f"other constraints is no longer distinguishable from a free motion\n  {where}"
        )
    name = description.unknown(equations.weakest)
    if equations.weakest < description.coordinates:
        return f"the mass matrix lost its positive definiteness {at}: {name} carries no mass"
    return _of_a_dead_centre(description, name, at, where)


def _of_the_step(status: int, chosen: Options, at: str, where: str) -> str:
    """Say that a step was too large: its equations could not be solved, or it left the constraints."""
    if status == _core.UNSOLVED:
        return (
            f"the implicit equations of a step of {chosen.method.name} could not be solved {at}: the step is "
            f"too large for the motion\n  Use a smaller step. {where}"
        )
    return (
        f"the state could not be brought back onto the constraints {at}: the step is too large for the "
        f"motion, or the start is off the constraints\n  Use a smaller step or tighter tolerances. {where}"
    )


def _of_a_dead_centre(description: Description, name: str, at: str, where: str) -> str:
    """Return the message for constraints that lose rank, or nearly, one by name, with and without drives."""
    cause = "which it cannot be taken through"
    if description.drives:
        cause = "beyond which its drives cannot take it"
    return (
        f"the run cannot continue {at}: the linkage comes to a dead centre, {cause}; there {name} is not "
        "independent of the other constraints\n"
        f"  {_remedy(description)} {where}"
    )


def _remedy(description: Description) -> str:
    """Return the remedy for a dead centre, with drives and without."""
    if description.drives:
        return (
            "'symgen kinematics SCENE' shows how far the drives go, and with --animate FILE the motion up to "
            "there. A run with an earlier t_end ends before it."
        )
    return "Start elsewhere, or change the lengths."


def _of_the_loads(
    status: int,
    stepper: _core.Run,
    equations: _core.KernelEquations,
    evaluator: Evaluator,
    chosen: Options,
    lost_rank: str,
    at: str,
    where: str,
) -> str:
    """Return the message for forces or accelerations too large for any step, with the cause if known."""
    n = evaluator.description.coordinates
    q, u, _ = np.split(stepper.state, [n, 2 * n])
    reached = 2 * stepper.h * float(np.max(np.abs(u), initial=0.0))
    known = cause(evaluator, stepper.t, q, u, reached)
    near = f"; {known.text}" if known else lost_rank
    if status == _core.NOT_FINITE and not stepper.recorded:
        what = (
            "the power series of the motion is not finite"
            if chosen.method.kind == "taylor"
            else "there are no finite accelerations"
        )
        remedy = known.remedy if known else "Change the load that has no value there, or the start."
        return f"{what} at the start{near}\n  {remedy} {where}"
    if status == _core.NOT_FINITE:
        remedy = known.remedy if known else "Use a smaller step."
        return (
            f"a number that is not finite appeared in the step {at}{near}\n"
            f"  {remedy} Last good state: {where.removeprefix('State: ')}"
        )
    if status == _core.STEP_TOO_SMALL:
        small = f"the step became too small to continue {at}: the tolerance cannot be met there"
        changed = 0.0 if near else _rounded(evaluator, stepper.t, q, u) * equations.core_type.epsilon
        if known:
            return f"{small}{near}\n  {known.remedy} {where}"
        if not changed > chosen.rtol:
            return f"{small}{near or _stiff(stepper)}\n  Loosen rtol and atol. {where}"
        finer = [repr(p.name) for p in PRECISIONS.values() if p.epsilon < equations.core_type.epsilon]
        remedy = f"Use precision {' or '.join(finer)}, or loosen" if finer else "Loosen"
        return (
            f"{small}, since rounding of the positions changes accelerations by {changed:.2g} of the "
            f"largest, more than rtol\n  {remedy} rtol and atol. {where}"
        )
    if known and stepper.steps < chosen.max_steps:
        return f"the steps become too short to continue {at}{near}\n  {known.remedy} {where}"
    return unfinished(stepper, chosen, at, near or (_stiff(stepper) if stepper.stiff else ""))


def _rounded(evaluator: Evaluator, t: float, q: Array, u: Array) -> float:
    """Return the relative change of accelerations with that of positions, a rounding, over this."""
    n, signs = len(q), np.random.default_rng(0).choice([-1.0, 1.0], (_ROUNDINGS, len(q)))
    at = evaluator("accelerations", t, q, u)[:n]
    changed = [evaluator("accelerations", t, q * (1 + _PART * s), u)[:n] - at for s in signs]
    return float(np.max(np.abs(changed)) / np.max(np.abs(at))) / _PART


def _stiff(stepper: _core.Run) -> str:
    if stepper.stiff:
        return f", the motion has been stiff since t = {stepper.t_stiff:.6g} s"
    return ", the motion may be stiff"


def _near_singular(stepper: _core.Run, equations: _core.KernelEquations, description: Description) -> str:
    """Return a remark if the constraints of the last good state nearly lose rank, else ''."""
    equations.check(stepper.t, np.append(stepper.state, 0.0))
    if equations.soundness > _NEAR:
        return ""
    name = description.unknown(equations.weakest)
    almost = f"{name} follows from the others but for {equations.soundness:.1e}"
    return f"; the constraints nearly lose rank there: {almost}"
