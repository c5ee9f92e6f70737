"""Exported data of the quasi-static shape of elastic links, and its recorded outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import SymgenError
from symgen.export.view import ConstantArray, doubles, indices
from symgen.lowering.kernel import Slot
from symgen.runtime import _core
from symgen.runtime.beams.forces import RunMotion, forces, torque
from symgen.runtime.beams.frames import frames
from symgen.runtime.elastic.mesh import MeshedMotion
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.elastic.outputs import (
    bow,
    deflection,
    displacement,
    outputs,
    position,
    recovered,
    strains,
)
from symgen.runtime.elastic.static import REFINED, quasi_static
from symgen.runtime.elastic.steps import turn
from symgen.runtime.result.records import Variable

Array = NDArray[np.float64]

#: Kinds of recorded numbers, as ``templates/export/shape.c.j2`` tells them apart.
KINDS = {"row": 0, "across_x": 1, "across_y": 2, "place": 3, "displacement": 4, "holding": 5}
#: Status of a structure whose stiffness is not positive definite, apart from those of the core.
_UNSTABLE = 40
#: Number of times of the comparison.
_COMPARED = 13
#: A parameter is multiplied by them, or takes them if it is 0, to see whether constants of links change.
_CHANGED = (1.01, 1e-3, 0.1, 0.5, 2.0, 10.0)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded number: its description, its kind with two numbers, and the row of unknowns of a link."""

    slot: Slot
    kind: str
    of: int
    at: int = 0
    row: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True)
class ShapeData:
    """Exported data of the quasi-static shape; without a shape there are no outputs."""

    outputs: tuple[Slot, ...] = ()
    tables: tuple[ConstantArray, ...] = ()
    expected: tuple[ConstantArray, ...] = ()
    notes: tuple[str, ...] = ()
    parameters: bool = True
    specific: dict[str, Any] = field(default_factory=dict)


def shape_of(model: ElasticModel, motion: MeshedMotion) -> ShapeData:
    """Return the exported data of the quasi-static shape."""
    fixed = _changing(model, motion)
    refused = _refused(motion, fixed)
    if refused:
        note = f"There are no outputs: {refused}."
        return ShapeData(notes=(note,), parameters=not fixed, specific={"refused": refused})
    recorded, x = [*_recorded(motion)], motion.layout
    starts = [0, *accumulate(len(r.row) for r in recorded)]
    joints = [beam.joints for beam in motion.beams]
    return ShapeData(
        outputs=tuple(r.slot for r in recorded),
        tables=(
            indices("LINK_PLACES", [*np.concatenate(x.of_links)]),
            indices("LINK_AT", [0, *accumulate(map(len, x.of_links))]),
            indices("LINK_JOINTS", np.ravel([pair for pairs in joints for pair in pairs])),
            indices("JOINTS_AT", [0, *accumulate(map(len, joints))]),
            indices("PIECE_UNKNOWNS", [k for b in motion.beams for piece in b.pieces for k in piece.at]),
            indices(
                "RECORDED",
                np.ravel([
                    (KINDS[r.kind], r.of, start if len(r.row) else r.at)
                    for r, start in zip(recorded, starts, strict=False)
                ]),
            ),
            doubles("ROWS_OF_OUTPUTS", np.concatenate([*(r.row for r in recorded), np.zeros(1)])),
        ),
        expected=_expected(motion, recorded),
        notes=("Outputs are those of the quasi-static shape; `symgen simulate` computes those of motions.",),
        specific={
            "kinds": KINDS,
            "free": x.unknowns - x.constraints,
            "largest": max(map(len, x.of_links)),
            "constraints": x.constraints,
            "refined": REFINED,
            "unstable": _UNSTABLE,
        },
    )  # fmt: skip


def _changing(model: ElasticModel, motion: MeshedMotion) -> list[str]:
    """Return the tunable parameters on which constants of links depend."""
    matrices = []
    constants = _constants(motion)
    for p in model.description.tunable:
        value = model.parameters[p.name]
        others = [c for x in _CHANGED if (c := _constants_at(model, p.name, x * (value or 1.0))) is not None]
        if not others or not all(np.array_equal(constants, other) for other in others):
            matrices.append(p.name)
    return matrices


def _constants_at(model: ElasticModel, name: str, value: float) -> Array | None:
    """Return the constants of links with another value of a parameter; None if there is no such linkage."""
    try:
        return _constants(MeshedMotion(model.with_parameters(**{name: value}).rigid))
    except SymgenError:
        return None


def _constants(motion: MeshedMotion) -> Array:
    rows = [r.row for r in _recorded(motion)]
    return np.concatenate([motion.layout.constants, *rows])


def _refused(motion: MeshedMotion, fixed: list[str]) -> str:
    """Return why there is no quasi-static shape in C; empty where there is one."""
    if motion.info.mode == "free":
        return "its crank is free, so that loads do not determine its static shape"
    if motion.has_motor:
        return "its motor is not exported"
    if motion.undetermined:
        return f"the crank does not determine the rigid motion of {', '.join(motion.undetermined)}"
    if fixed:
        return (
            f"sections and lengths of its elastic links, which depend on {', '.join(fixed)}, are fixed in C"
        )
    return ""


def _recorded(motion: MeshedMotion) -> Iterator[Recorded]:
    """Yield the numbers that are recorded, those that the scene selects in its order."""
    known = {r.slot.name: r for r in _known(motion)}
    names = {name: [key for key in known if key.partition(" ")[0] == name] for name in
             (key.partition(" ")[0] for key in known)}  # fmt: skip
    requested = names if motion.info.outputs is None else motion.info.outputs
    for name in requested:
        yield from (known[key] for key in names.get(name, ()))


def _known(motion: MeshedMotion) -> Iterator[Recorded]:
    """Yield all numbers that C records.

    The runtime computes a row over the unknowns of a link by setting each unknown alone to one.
    """
    for name, k, at, fibre in motion.stations:
        beam = motion.beams[k]
        unit, rows = np.eye(len(beam.dofs)), beam.rows(at)
        for v in strains(name, beam, at, rows.curvature * fibre, rows.axial_strain):
            yield Recorded(_slot(v), "row", k, row=v.values)
        off = bow(name, beam, at, deflection(beam, unit, at))
        yield Recorded(_slot(off), "row", k, row=off.values)
        for axis in "xy":
            about = f"{off.about}, its component along {axis}"
            yield Recorded(Slot(f"{off.name} {axis}", "m", about), f"across_{axis}", k, row=off.values)
    names, none = motion.layout.names, np.zeros((0, 2))
    for i, point in enumerate(motion.rigid.description.free):
        for v, kind in ((displacement(point, none), "displacement"), (position(point, none), "place")):
            for j, axis in enumerate("xy"):
                slot = Slot(f"{v.name} {axis}", v.unit, f"{v.about}, {axis}")
                yield Recorded(slot, kind, names.index(f"{point}.{axis}"), 2 * i + j)
    crank = motion.info.crank
    for k, beam in enumerate(motion.beams):
        if beam.info.link == crank and motion.info.mode == "held" and "theta@1" in beam.dofs:
            slot = _slot(torque(crank, none))
            yield Recorded(slot, "holding", k, beam.dofs.index("theta@1"))


def _slot(v: Variable) -> Slot:
    return Slot(v.name, v.unit, v.about)


def _expected(motion: MeshedMotion, recorded: list[Recorded]) -> tuple[ConstantArray, ...]:
    """Return reference values for the test of the export: the outputs of the runtime, which LAPACK solves."""
    times = np.linspace(0.0, turn(motion), _COMPARED)
    equations = motion.equations()
    shapes = quasi_static(motion, equations, times)
    (q, *_), links, loads = motion.rigid_motion(equations, times)
    rigid = RunMotion(times, q, links, loads, shapes, None)
    variables = [
        *outputs(motion, links, shapes),
        *recovered(motion, rigid),
        *forces(motion, equations, rigid, np.zeros_like(shapes)).variables,
    ]
    values = {v.name: v.values.reshape(_COMPARED, -1) for v in variables}
    columns = []
    for r in recorded:
        name, _, axis = r.slot.name.partition(" ")
        if r.kind.startswith("across"):
            off = values[name][:, 0]
            columns.append(frames(links[:, r.of]).fixed(0.0 * off, off)["xy".index(axis)])
        else:
            columns.append(values[name][:, "xy".index(axis) if axis else 0])
    return (
        doubles("TIMES", times),
        doubles("OUTPUTS", np.stack(columns, axis=1)),
        doubles("SHAPED", [_core.DONE, _COMPARED]),
    )
