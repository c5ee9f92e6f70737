"""Exported data of a closed loop of links."""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.codegen.emit import SourceFile
from symgen.errors import ModelError
from symgen.export.program import arguments, exported, group, state_of
from symgen.export.rods import CORE as RUNS
from symgen.export.rods import expected_of_run
from symgen.export.view import (
    COMPARED,
    ConstantArray,
    ConstantStruct,
    Exported,
    braces,
    doubles,
    functions,
    indices,
    members,
    method_tables,
    number,
)
from symgen.lowering.kernel import Program
from symgen.runtime import _core
from symgen.runtime.loop.ball_poles import ball_pole
from symgen.runtime.loop.driven import PARTS
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.loop.motion import rates_at_start

#: Core files for closing, following and running a loop, in addition to those of runs.
CORE = (*RUNS, "balls.c", "follow.c", "loop.c", "loop_motion.c")
#: Kernels that the core calls for a loop, in the order of its struct.
KERNELS = ("inputs", "position", "motion", "inverse", "given", "outputs", "energy", "setup", "events")
#: Number of poses of a driven loop in the comparison.
POSES = 13


def loop(model: LoopModel, program: Program, sources: tuple[SourceFile, ...]) -> Exported:
    """Return the exported data of a closed loop."""
    d, kernels, begin = model.description, model.kernels, model.closed_start()
    driven = model.is_driven
    if not driven and (names := ball_pole(kernels, begin.t, begin.q)):
        raise ModelError(
            f"{d.name} starts at a pole of the angles {', '.join(names)} of a ball joint, where C has no "
            "rates to start with\n  Start at another pose (loop.free), or turn the axes of the rows next to "
            "the ball (theta, alpha)."
        )
    solved = d.solved
    equations = kernels.equations(solved, begin.rank)
    start = begin.q if driven else np.concatenate([begin.q, rates_at_start(kernels, begin), [0.0]])
    t_end = kernels.time_of(d.span[1]) if driven else d.t_end
    expected = _of_poses(model, equations, t_end) if driven else _of_run(model, equations, begin.t, start)
    until = "" if driven else number(min(d.t_end, COMPARED))
    return exported(
        d,
        program,
        sources,
        CORE,
        family="loop",
        core_headers=("loop.h",),
        driven=driven,
        coordinates=d.coordinates,
        state=group(program, "q") if driven else state_of(program, 1),
        **arguments(d, program),
        start=braces(start, 1),
        t_start=number(begin.t),
        t_end=number(t_end),
        tables=_tables(model, solved, driven),
        records=_records(model, solved, begin.rank),
        expected=expected,
        parts=PARTS,
        until=until,
        compares_outputs=d.kernel("outputs") is not None,
    )


def _tables(model: LoopModel, solved: list[int], driven: bool) -> tuple[ConstantArray, ...]:
    d, inputs = model.description, model.kernels.inputs
    places, known = _efforts(model, solved)
    lengths = ConstantArray("unsigned char", "IS_LENGTH", braces((int(v.is_length) for v in d.variables), 1))
    return (
        indices("VARIABLES", [*solved, *inputs, *places, *known, -1]),
        lengths,
        _balls(model),
        *(() if driven else method_tables()),
    )


def _balls(model: LoopModel) -> ConstantArray:
    """Return the ball joints whose angles need the substitution near their poles, followed by a dummy."""
    rows = [braces(numbers) for numbers in (*(ball.angles for ball in model.description.balls), [-1] * 3)]
    return ConstantArray("struct ball", "BALLS", "{" + ", ".join(f"{{{row}}}" for row in rows) + "}")


def _efforts(model: LoopModel, solved: list[int]) -> tuple[list[int], list[int]]:
    """Return the indices of unknown efforts among the unknowns, and of known efforts among the inputs."""
    unknown = [i for i, v in enumerate(model.description.variables) if v.unknown]
    places = [solved.index(i) for i in unknown if i in solved]
    return places, [k for k, i in enumerate(model.kernels.inputs) if i not in unknown]


def _records(model: LoopModel, solved: list[int], rank: int) -> tuple[ConstantStruct, ...]:
    d = model.description
    places, known = _efforts(model, solved)
    outputs = d.kernel("outputs")
    sizes = members(
        n=d.coordinates,
        parameters=len(d.parameters),
        derived=d.derived,
        extra=1,
        work=model.kernels.work_size,
        out_size=outputs.out_size if outputs else 0,
        solved=len(solved),
        inputs=len(model.kernels.inputs),
        unknown=len(places),
        known=len(known),
        balls=len(d.balls),
        switches=len(d.switches),
        tables=d.tables,
        rank=rank,
        size=float(d.size),
        tolerance=d.assembly_tolerance / d.size,
    )
    kernels = members(**functions(d.name, KERNELS, (k.name for k in d.kernels)))
    return ConstantStruct("loop_kernels", "KERNELS", kernels), ConstantStruct("loop_sizes", "SIZES", sizes)


def _of_poses(model: LoopModel, equations: Any, t_end: float) -> tuple[ConstantArray, ...]:
    """Follow the loop; return reference values for the test of the export."""
    d, begin = model.description, model.closed_start()
    info = d.kernel("outputs")
    width = info.out_size if info else 0
    times = np.linspace(begin.t, t_end, POSES)
    states, out = np.zeros((POSES, 3 * d.coordinates + 6)), np.zeros((POSES, width))
    diagnosis = np.zeros((POSES, 5))
    longest = max(abs(times[-1] - begin.t), 1e-12) / PARTS
    room = out if width else np.zeros((POSES, 1))
    status, count, _ = equations.follow(
        begin.t, np.append(begin.q, 0.0), times, longest, states, room, diagnosis
    )
    return (
        doubles("TIMES", times),
        doubles("ENDS", [status, count]),
        doubles("STATES", states[:count]),
        doubles("OUTPUTS", out[:count]),
    )


def _of_run(model: LoopModel, equations: Any, t0: float, start: Any) -> tuple[ConstantArray, ...]:
    d = model.description
    n = d.coordinates
    derivative, ends, t, last = expected_of_run(
        equations, t0, start, min(d.t_end, COMPARED), switches=len(d.switches)
    )
    tables = (derivative, ends, doubles("STATE", last))
    info = d.kernel("outputs")
    if info is None:
        return tables
    out, work = np.zeros(info.out_size), np.zeros(model.kernels.work_size + 1)
    work[: n + 6] = equations.solutions(np.array([t]), np.append(last, 0.0)[None, :])[0, : n + 6]
    address = model.kernels.library.addresses["outputs"]
    p = model.kernels.at(equations.parameters).parameters
    _core.call(address, d.sizes_of("outputs"), np.array([t]), last, last[n:].copy(), p, work, out)
    return (*tables, doubles("OUTPUTS", out))
