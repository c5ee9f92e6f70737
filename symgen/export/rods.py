"""Exported data of a linkage of points and links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symgen.codegen.emit import SourceFile
from symgen.errors import ModelError
from symgen.export.program import arguments, exported, state_of
from symgen.export.view import (
    ATOL,
    COMPARED,
    RTOL,
    ConstantArray,
    ConstantStruct,
    Exported,
    braces,
    doubles,
    functions,
    members,
    method_tables,
    number,
)
from symgen.lowering.kernel import Program
from symgen.runtime import _core
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.integrate.integrators.method import Integrator
from symgen.runtime.integrate.redundancy import slack
from symgen.runtime.integrate.simulate import effects_of
from symgen.runtime.kernels.description import Description
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.model.rods import RodModel

#: Core files of a run with any method.
CORE = (
    "branch.c",
    "coordinates.c",
    "equations.c",
    "events.c",
    "kinematics.c",
    "linear.c",
    "rank.c",
    "run.c",
    "samples.c",
    "settle.c",
    "stiffness.c",
    "switches.c",
    "windings.c",
    "zeros.c",
)
#: Kernels that the core calls for a linkage, in the order of its struct.
KERNELS = (
    "accelerations", "factor", "solve", "constraints", "velocity_constraints", "energy", "residual", "events",
    "setup", "series",
)  # fmt: skip
#: Maximum number of events of each kind that the core stores.
REMEMBERED = 64


def rods(model: RodModel, program: Program, sources: tuple[SourceFile, ...]) -> Exported:
    """Return the exported data of a linkage: runs by power series if the program has them."""
    d = model.description
    state = model.initial_state()
    if state.references is not None and np.any(state.references):
        raise ModelError(
            f"{d.name} starts in an equilibrium with an angle of a load beyond half a revolution, where "
            "exported programs cannot start\n  Shift the free angle of the spring, or leave out "
            "start.equilibrium."
        )
    extra = int(d.work_of_loads)
    start = np.concatenate([state.q, state.u, np.zeros(extra)])
    method = INTEGRATORS["taylor" if program.series else "dop853"]
    kernels, sizes = equations_of(model, slack(model.evaluator, state.q) if d.redundant else np.inf, program)
    expected, until = _expected(model, start, method)
    return exported(
        d,
        program,
        sources,
        CORE,
        method,
        family="rods",
        core_headers=("run.h",),
        coordinates=d.coordinates,
        state=state_of(program, extra),
        **arguments(d, program),
        start=braces(start, 1),
        t_end=number(d.t_end),
        tables=(
            *_event_tables(d),
            *method_tables(method),
            *(method_tables(method.near) if method.near else ()),
        ),
        records=(ConstantStruct("kernels", "KERNELS", kernels), ConstantStruct("sizes", "SIZES", sizes)),
        expected=expected,
        notes=_notes(d),
        events=len(d.events),
        found=REMEMBERED * len(d.events),
        until=number(until),
        compares_outputs=_compares(d),
    )


def equations_of(model: RodModel, allowed: float, program: Program) -> tuple[Any, Any]:
    """Return the members of the structs ``kernels`` and ``sizes`` of a linkage."""
    d, series = model.description, bool(program.series)
    kernels = members(**functions(d.name, KERNELS, [*(k.name for k in d.kernels), *["series"][:series]]))
    sizes = members(
        n=d.coordinates,
        m=len(d.constraints),
        extra=int(d.work_of_loads),
        parameters=len(d.parameters),
        derived=d.derived,
        work=model.evaluator.work_size,
        first_pivot=d.first_pivot,
        redundant=len(d.redundant),
        events=len(d.events),
        switches=len(d.switches),
        tables=d.tables,
        windings=d.windings,
        turns=len(d.turns),
        series_rows=d.series_rows if series else 0,
        series_watched=d.series_watched if series else 0,
        rank_tolerance=float(d.rank_tolerance),
        slack=float(allowed),
    )
    return kernels, sizes


def _event_tables(d: Description) -> tuple[ConstantArray, ...]:
    if not d.events:
        return ()
    return (
        ConstantArray("signed char", "DIRECTIONS", braces(e.direction for e in d.events)),
        ConstantArray("char", "TERMINAL", braces(effects_of(d.events))),
    )


def _expected(model: RodModel, start: Any, method: Integrator) -> tuple[tuple[ConstantArray, ...], float]:
    """Run for a short time; return reference values for the test of the export, and the final time."""
    d, redundant = model.description, model.description.redundant
    q = start[: d.coordinates]
    equations = model.evaluator.equations(len(redundant), slack(model.evaluator, q) if redundant else np.inf)
    until = min(d.t_end, COMPARED)
    events = [e.direction for e in d.events], effects_of(d.events)
    expected = expected_of_run(equations, 0.0, start, until, *events, method=method, switches=len(d.switches))
    derivative, ends, t, last = expected
    tables = (derivative, ends, doubles("STATE", last))
    if not _compares(d):
        return tables, until
    n = d.coordinates
    solution = equations.solutions(np.array([t]), np.append(last, 0.0)[None, :])[0]
    evaluator = Evaluator(d, model.evaluator.library, equations.parameters)
    outputs = evaluator("outputs", t, last[:n], last[n : 2 * n], solution)
    return (*tables, doubles("OUTPUTS", outputs)), until


def _compares(d: Description) -> bool:
    """Return whether some outputs of the core are identical to those of symgen."""
    return d.kernel("outputs") is not None and not d.redundant


def expected_of_run(
    equations: Any,
    t0: float,
    start: Any,
    until: float,
    directions: Sequence[int] = (),
    terminal: Sequence[int] = (),
    method: Integrator = INTEGRATORS["dop853"],
    switches: int = 0,
) -> tuple[ConstantArray, ConstantArray, float, Any]:
    """Return the initial derivative and the final values of a run as tables, with final time and state."""
    derivative = equations.derivative(t0, np.append(start, 0.0))
    run = _core.Run(
        equations,
        method,
        t0,
        start,
        until,
        RTOL,
        ATOL,
        0.0,
        np.array([until]),
        directions=directions,
        terminal=terminal,
    )
    status = run.begin()
    while status == _core.MORE:
        status = run.advance(1000)
    ends = doubles("ENDS", [status, run.t, run.steps, run.rejected])
    if switches:  # of a finished run the loads switch by the state again, as in C
        parameters = equations.parameters
        parameters[-switches:] = 0.0
        equations.set_parameters(parameters)
    return doubles("DERIVATIVE", derivative), ends, run.t, run.state


def _notes(d: Description) -> tuple[str, ...]:
    notes = []
    if d.at_equilibrium:
        notes.append(
            "The start is the static equilibrium at the default parameters; other parameters do not move it: "
            "give the state of theirs."
        )
    if d.redundant:
        names = ", ".join(d.labels[i] for i in d.redundant)
        notes.append(
            f"Redundant constraints ({names}) follow from the others: forces are not unique. The forces of "
            "redundant constraints are zero here; symgen computes forces of minimum norm."
        )
    if d.events:
        notes.append("A run ends at an event declared as its end in the scene; it has its own status.")
    return tuple(notes)
