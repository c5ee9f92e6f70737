"""Exported data of a linkage with elastic links."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from symgen.codegen.emit import SourceFile
from symgen.elements.element import INNER_DOFS, NODE_DOFS
from symgen.export.program import exported, group
from symgen.export.rods import CORE as RUNS
from symgen.export.rods import equations_of
from symgen.export.shape import shape_of
from symgen.export.view import (
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
from symgen.lowering.kernel import Program, Slot
from symgen.runtime import _core
from symgen.runtime.beams.layout import BeamLayout
from symgen.runtime.beams.methods import GAUSS, integrator_of
from symgen.runtime.elastic.mesh import MeshedMotion
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.steps import stepped, turn

#: Core files for elastic links, in addition to those of runs.
CORE = (
    *RUNS, "bands.c", "beam_basis.c", "beam_motion.c", "beam_steps.c", "beams.c", "rigid_motion.c",
)  # fmt: skip
#: Revolution over the duration of the comparison run.
_PART = 8
#: Steps of the comparison run.
_STEPS = 32
#: Parts of the way from the parameters of the scene to others, over which the start is led.
PARTS = 32
_INDEXED = (
    "sizes", "constants_at", "link_of", "joints", "places", "places_at", "slots", "slots_at",
    "joint_places", "joint_at", "mass_slots", "damping_slots", "stiffness_slots", "loads_at", "rows",
    "columns",
)  # fmt: skip


def elastic(
    model: ElasticModel, program: Program, sources: tuple[SourceFile, ...], prefixes: dict[str, str]
) -> Exported:
    """Return the exported data of a linkage with elastic links; ``prefixes`` of its kernels, by analysis.

    Raises
    ------
    ModelError
        For free coordinates, which linear theory does not support.
    """
    d, motion = model.description, MeshedMotion(model.rigid)
    motion.check_determined()
    x = motion.layout
    n = x.unknowns
    extra = int(d.work_of_loads)
    rigid = model.rigid.initial_state()
    kernels, sizes = equations_of(model.rigid, np.inf, program)
    shape = shape_of(model, motion)
    return exported(
        d,
        program,
        sources,
        CORE,
        family="elastic",
        core_headers=("beams.h", "run.h"),
        coordinates=n,
        state=_state(x),
        start=braces(np.zeros(2 * n), 1),
        t_end=number(turn(motion)),
        tables=(
            *(indices(name.upper(), [*np.ravel(getattr(x, name)), -1]) for name in _INDEXED),
            doubles("CONSTANTS", x.constants),
            *shape.tables,
            ConstantArray("double", "RIGID_START", braces([*rigid.q, *rigid.u, *np.zeros(extra)], 1)),
            ConstantArray("double", "RIGID_PARAMETERS", braces(model.rigid.parameter_values)),
            *method_tables(integrator_of(GAUSS)),
            *method_tables(),
        ),
        records=(
            ConstantStruct("kernels", "RIGID_KERNELS", kernels),
            ConstantStruct("sizes", "RIGID_SIZES", sizes),
            ConstantStruct("motion_sizes", "MOTION_SIZES", members(**motion.kernel_sizes)),
            ConstantStruct("motion_kernels", "MOTION_KERNELS", members(**_motion_kernels(motion, prefixes))),
            ConstantStruct(
                "beam_layout",
                "LAYOUT",
                members(
                    **{f"counts.{n}": k for n, k in x.counts.items()}, **{n: n.upper() for n in _INDEXED}
                ),
            ),
        ),
        expected=(*_expected(motion), *shape.expected),
        notes=(*_notes(motion), *shape.notes),
        parameters=group(program, "p") if shape.parameters else (),
        defaults=braces(model.rigid.parameter_values),
        outputs=shape.outputs,
        specific={
            "steps": _STEPS,
            "parts": PARTS,
            "stride": number(motion.stride),
            "rigid_n": d.coordinates,
            "rigid_m": len(d.constraints),
            "rigid_dim": 2 * d.coordinates + extra,
            **_speed(motion, prefixes["elastic_motion"]),
            **shape.specific,
        },
    )


def _speed(motion: ElasticMotion, prefix: str) -> dict[str, Any]:
    """Return where the kernel of the tables gives the speed of the crank; 0 if it is at rest."""
    if not motion.speed:
        return {"speed_at": 0}
    tables = next(k for k in motion.kernels_of_motion if k.name == "constants")
    return {
        "tables": f"{prefix}_constants",
        "tables_size": tables.out_size,
        "tables_work": tables.work_size,
        "speed_at": next(b.offset for b in tables.blocks if b.name == "crank") + 1,
        "stride_of_turn": number(motion.stride / motion.period),
    }


def _state(x: BeamLayout) -> tuple[Slot, ...]:
    """Return the descriptions of the unknowns and their rates."""
    known = NODE_DOFS | {name: dof for name, (dof, _) in INNER_DOFS.items()}
    values = []
    for name in x.names:
        owner, _, word = name.rpartition(".")
        dof = known.get(re.sub(r"@.*", "", word))
        unit = dof.unit if dof else "m" if word in ("x", "y") else "1"
        about = (
            dof.description
            if dof
            else f"displacement of {owner} along {word}"
            if unit == "m"
            else "modal amplitude"
        )
        values.append(Slot(name, unit, about))
    rates = [
        Slot(f"{s.name}'", "1/s" if s.unit == "1" else f"{s.unit}/s", f"its rate: {s.description}")
        for s in values
    ]
    return (*values, *rates)


def _motion_kernels(motion: ElasticMotion, prefixes: dict[str, str]) -> dict[str, str]:
    there, of_joints = (
        [k.name for k in known] for known in (motion.kernels_of_motion, motion.kernels_of_joints)
    )
    joints = functions(prefixes["elastic_joints"], ("joints", "setup"), of_joints)
    return {
        **functions(prefixes["elastic_motion"], ("links", "shaft", "loads", "setup"), there),
        **{"joints_setup" if name == "setup" else name: text for name, text in joints.items()},
    }


def _expected(motion: ElasticMotion) -> tuple[ConstantArray, ...]:
    """Integrate a few steps; return reference values for the test of the export."""
    equations, n = motion.equations(), motion.layout.unknowns
    derivative = equations.derivative(0.0, np.zeros(2 * n + 1))
    until = turn(motion) / _PART
    both = stepped(motion, equations, GAUSS, np.array([until]), np.array([_STEPS]))
    ends = doubles("ENDS", [_core.DONE, until])
    return doubles("DERIVATIVE", derivative), ends, doubles("STATE", np.ravel(both))


def _notes(motion: ElasticMotion) -> tuple[str, ...]:
    constant = (
        ("The crank rotates at constant speed; its motor is not exported.",) if motion.has_motor else ()
    )
    return (
        *constant,
        f"One revolution of the crank takes {motion.period:.6g} s."
        if motion.speed
        else "The angle of the crank is a function of the time."
        if motion.info.prescribed
        else "The crank is at rest.",
    )
