"""Operations saved by the constants of a scene, compared with the general model."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from symgen.codegen.rolled import STRAIGHT, large, statements_of
from symgen.codegen.target import Target
from symgen.lowering.kernel import SETUP
from symgen.lowering.program import lower_system
from symgen.precision import FLOAT64
from symgen.symbolic.system import System

RUN, STAGE, STEP, POSE, ON_REQUEST = "once per run", "each stage", "each step", "each pose", "on request"
#: When the core calls each kernel, for linkages moved by forces, driven linkages, and loops.
_OF_LINKAGE = {
    "accelerations": STAGE, "residual": STAGE, "factor": STEP, "solve": STEP, "constraints": STEP,
    "velocity_constraints": STEP, "energy": STEP, "events": STEP,
}  # fmt: skip
_OF_DRIVEN = dict.fromkeys(
    ("constraints", "constraint_jacobian", "velocity_constraints", "acceleration_rhs", "outputs"), POSE
)
_OF_LOOP = ("inputs", "position", "motion", "inverse", "given")


def saving_lines(system: System, general: System, noun: str) -> Iterator[str]:
    """Yield the operations of every kernel for the scene and the general model, with sum and binding time.

    Operations executed once per run are not included in the sum.
    """
    program = lower_system(system)
    flops, other = ({k.name: k.counts.flops for k in p.kernels} for p in (program, lower_system(general)))
    total, whole = (sum(n for name, n in counts.items() if name != SETUP) for counts in (flops, other))
    times = f" ({whole / total:.1f} times)" if total else ""
    yield f"{system.name}: {total} operations; with {noun} {whole}{times}"
    when = binding_times(system, flops)
    names = [*dict.fromkeys([SETUP, *flops] if SETUP in other else flops)]
    width = max(map(len, names))
    for name in names:
        yield f"  {name:{width}}  {flops.get(name, 0):5}; {other.get(name, 0):5}  {when.get(name, RUN)}"
    statements, loops = sum(statements_of(program).values()), large(program, Target("c", FLOAT64, False))
    kind = (
        f"loops: {', '.join(k.name for k in program.kernels if k.name in loops)}"
        if loops
        else "straight-line"
    )
    yield f"code in C: {statements} statements, {kind} (loops above {STRAIGHT} statements)"


def binding_times(system: System, kernels: Collection[str]) -> dict[str, str]:
    """Return when a run calls each kernel: once per run, at each stage, step or pose, or on request.

    Factorisation and solution are part of 'accelerations'. They are also called for the projection onto the
    constraints after each step.
    """
    if system.saddle_point:
        known = dict(_OF_LINKAGE)
        if "residual" in kernels:  # iterative refinement of solutions
            known["solve"] = STAGE
        if any(m.name == "power" for m in system.matrices):  # its work is integrated along with the state
            known["energy"] = STAGE
    elif "position" in kernels:
        free = any(m.name == "mass_matrix" for m in system.matrices)
        known = dict.fromkeys(_OF_LOOP, STAGE if free else POSE) | {
            "energy": STAGE if free else ON_REQUEST,
            "outputs": ON_REQUEST if free else POSE,
        }
    else:
        known = _OF_DRIVEN
    return {name: RUN if name == SETUP else known.get(name, ON_REQUEST) for name in kernels}
