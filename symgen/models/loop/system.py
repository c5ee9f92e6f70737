"""System of a loop: derived matrices with names and units, and the kernels to generate."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import sympy as sp

from symgen.errors import SceneError
from symgen.mechanics.sources import LOOP, row_source
from symgen.models.limits import limits_of
from symgen.models.loop import outputs as loop_outputs
from symgen.models.loop.derivation import (
    DUAL,
    PLACED,
    REFERENCE,
    SCREW,
    LoopDerivation,
    entries,
    jet,
    named,
)
from symgen.models.loop.series import series_of_motion
from symgen.scene.loop.loop import ENTRIES, Loop
from symgen.scene.rods.linkage import TIME
from symgen.symbolic.dual import DualVector
from symgen.symbolic.system import Export, Group, NamedMatrix, System

_FRAME = ("ix jx kx px", "iy jy ky py", "iz jz kz pz")
_MOMENTUM = ("px", "py", "pz", "hx", "hy", "hz")
_WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
#: Tables of the scene that name variables, by their role.
_TABLES = {"input": "loop.inputs", "free": "loop.free", "dependent": "loop.inputs", "state": "states"}


def loop_system(loop: Loop) -> System:
    """Return the System of a loop: every step of the derivation, and the kernels that its outputs need.

    Raises
    ------
    SceneError
        For an output the loop does not have, and a link without mass where a force is asked.
    """
    model = LoopDerivation(loop)
    requested = loop_outputs.requested_outputs(model)
    needs = {need for m in requested for need in loop_outputs.needs(m.name)}
    free = loop.having("free")
    if free:
        model.check_masses(f"the motion of the free {free[0].name!r}")
        needs |= {"mass", "forces"}
    motion, exports = _motion(model, "forces" in needs)
    dynamics, kernels = _dynamics(model, bool(free)) if "forces" in needs else ([], [])
    steps = _steps(model, "mass" in needs)
    switches = _switches(loop)
    in_series = series_of_motion(model) if free else None
    dynamics += [in_series] if in_series else []
    derived = {m.name for m in (*motion, *dynamics)}
    _check_names(model, {*derived, *loop_outputs.OF_THE_WHOLE, *(m.name for m in steps)})
    limits, kernel_of_limits = limits_of(loop)
    return System(
        name=loop.name,
        title=loop.title,
        groups=groups(model),
        matrices=(
            *motion,
            *dynamics,
            *(m for m in requested if m.name not in derived),
            *steps,
            *([switches] if switches else []),
            *limits,
        ),
        exports=(
            *exports,
            *kernels,
            Export("outputs", "outputs of the scene", tuple(m.name for m in requested)),
            *([Export("events", switches.description, (switches.name,))] if switches else []),
            *kernel_of_limits,
        ),
        definitions=model.names.definitions,
        residual=in_series.name if in_series else "",
        references=(REFERENCE,),
        sources=(*loop_outputs.sources_of(model), *LOOP),
        left_out=tuple(_left_out(model, needs)),
    )


def _check_names(model: LoopDerivation, derived: set[str]) -> None:
    """Refuse a variable with the name of a derived quantity: their outputs would have the same name."""
    for v in model.variables:
        if v.name in derived:
            raise SceneError(
                f"{v.name!r} is reserved for a quantity of the loop",
                where=f"{_TABLES[v.role]}.{v.name}",
                hint="Choose another name for this variable.",
            )


def groups(model: LoopDerivation) -> tuple[Group, ...]:
    """Return the argument arrays that every kernel of a loop takes."""
    return (
        Group("t", "time", (TIME,)),
        Group("q", "joint variables", tuple(v.quantity for v in model.variables)),
        Group("u", "rates of the joint variables", tuple(v.rate for v in model.variables)),
        Group("p", "tunable parameters", tuple(p.quantity for p in model.loop.parameters), per_run=True),
        Group(
            "work",
            "accelerations of the joint variables, then the closing wrench",
            (*(v.acceleration for v in model.variables), *model.closing),
        ),
    )


def _motion(model: LoopDerivation, forces: bool) -> tuple[list[NamedMatrix], list[Export]]:
    """Return inputs, closure, screws and the velocity-dependent accelerations, with their kernels."""
    names = [v.name for v in model.variables]
    paths, count = model.paths, len(names)
    b = paths.closure
    defect = (b.turn - sp.eye(3)).row_join(sp.Matrix(b.origin))
    matrices, exports = [], []
    inputs = model.loop.having("input")
    if inputs:
        matrices.append(
            named(
                "inputs",
                sp.Matrix([row for v in inputs for row in [jet(v.motion)]]),
                ", ".join(x.unit for v in inputs for x in (v.quantity, v.rate, v.acceleration)),
                "prescribed motions: value, rate, acceleration",
                [v.name for v in inputs],
                ("value", "rate", "acceleration"),
            )
        )
        exports.append(Export("inputs", "prescribed motions by time", ("inputs",)))
    exact = paths.columns(paths.exact_screws, count)
    screws = paths.columns(paths.screws, count)
    about = "screws of the joint variables in the first frame"
    matrices += [
        named(
            "closure_defect",
            defect,
            "1, m",
            "B - I of the closure B = T_1 ... T_n: rotation, translation",
            "xyz",
            PLACED,
        ),
        named("closure_jacobian", exact, "1, m", f"{about}: exact also where it is open", SCREW, names),
        named("screws", screws, "1, m", f"{about}, by the shorter way", SCREW, names),
    ]
    position = ["closure_defect", "closure_jacobian"]
    if model.loop.having("free"):
        meeting, where = (
            paths.frames[paths.meet],
            "frame where both paths meet, in the first: axes and origin",
        )
        placed = meeting.turn.row_join(sp.Matrix(meeting.origin))
        matrices.append(named("meeting_frame", placed, "1, m", where, "xyz", PLACED))
        position.append("meeting_frame")
    exports.append(Export("position", "closure defect and its derivative", tuple(position)))
    moving = ["screws", "screw_drift"]
    rates = paths.columns(paths.screw_rates(), count)
    matrices += [
        named("screw_rates", rates, "1/s, m/s", f"rates of the {about}", SCREW, names),
        named(
            "screw_drift",
            rates * sp.Matrix(model.rates),
            "rad/s^2, m/s^2",
            "terms of the rates: sum of screws times accelerations + drift = 0",
            SCREW,
        ),
    ]
    if forces and any(v.effort is None and v.role != "input" for v in model.variables):
        moving.append("screw_rates")
    exports.append(Export("motion", "screws and terms of their rates", tuple(moving)))
    table = [e for row in model.loop.rows for e in entries(row)]
    rows = [f"row{i + 1}" for i in range(len(model.rows))]
    matrices.append(
        named("rows", sp.Matrix(len(rows), len(ENTRIES), table), "rad, m", "link-joint table", rows, ENTRIES)
    )
    exports.append(Export("rows", "the link-joint table", ("rows",)))
    return matrices, exports


def _switches(loop: Loop) -> NamedMatrix | None:
    """Return the functions that vanish at switching points of loads and drives; None without these."""
    if not loop.switches:
        return None
    gaps = sp.Matrix([s.gap for s in loop.switches])
    about = f"values zero at {'; '.join(s.text for s in loop.switches)}"
    return named("switches", gaps, "1", about, [s.branch.name for s in loop.switches])


def _dynamics(model: LoopDerivation, free: bool) -> tuple[list[NamedMatrix], list[Export]]:
    """Return efforts, energies and, for free variables, the mass matrix, with their kernels."""
    names = [v.name for v in model.variables]
    unit = ", ".join(dict.fromkeys(v.unit_of_effort for v in model.variables))
    matrices = [
        named(
            "inverse_efforts",
            sp.Matrix(model.inverse_efforts),
            unit,
            "efforts of motion and loads at the variables, without that of the closing wrench",
            names,
        ),
        named(
            "given_efforts", sp.Matrix(model.given_efforts), unit, "known efforts of drives, else 0", names
        ),
        named("kinetic_energy", sp.Matrix([model.kinetic_energy]), "J", "kinetic energy"),
        named("potential_energy", sp.Matrix([model.potential_energy]), "J", "potential of gravity"),
        named("power", sp.Matrix([model.power]), "W", "power of drives and loads"),
    ]
    also, inertia = (("mass_matrix",), ", and inertia") if free else ((), "")  # at the same positions
    exports = [
        Export("inverse", f"efforts of motion and loads{inertia}", ("inverse_efforts", *also)),
        Export("given", "known efforts", ("given_efforts",)),
        Export(
            "energy",
            "energies, and power of drives and loads",
            ("kinetic_energy", "potential_energy", "power"),
        ),
    ]
    if free:
        matrices.append(
            named(
                "mass_matrix",
                sp.Matrix(model.mass_matrix),
                "kg*m^2, kg*m, kg",
                "derivative of the inverse efforts by the accelerations",
                names,
                names,
            )
        )
    return matrices, exports


def _steps(model: LoopDerivation, mass: bool) -> list[NamedMatrix]:
    """Return the steps of the derivation that no kernel writes, in the order of the source."""
    steps = [
        replace(
            named(f"row_{i}_transform", t.beside, "1, m", f"T_{i} = real part | dual part", "xyz", DUAL),
            source=row_source(name for name in ENTRIES if getattr(row, name) != 0),
        )
        for i, (row, t) in enumerate(zip(model.loop.rows, model.paths.transforms, strict=True), 1)
    ]
    steps += [
        named(
            f"{v.name}_row_operator",
            q.beside,
            "1, m",
            f"Q of dT/d{v.name} = Q T, T of its row, real part | dual part",
            "xyz",
            DUAL,
        )
        for j, v in enumerate(model.variables)
        if (q := model.paths.row_operator(j)) is not None
    ]
    steps += [
        named(
            f"{v.name}_operator",
            model.paths.operator(j).beside,
            "1, m",
            f"H of dB/d{v.name} = H B, {_product(v.row)}real part | dual part: the operator of its screw",
            "xyz",
            DUAL,
        )
        for j, v in enumerate(model.variables)
        if not v.is_state
    ]
    steps += [*_step_of_closure(model), *_closure_of_velocities(model)]
    for k, link in enumerate(model.links, 1):
        frame = model.frame(k)
        placed = frame.turn.row_join(sp.Matrix(frame.origin))
        here = f"of {link}, in its frame about its origin"
        steps += [
            named(
                f"{link}_frame",
                placed,
                "1, m",
                f"frame of {link} in the first: axes and origin",
                "xyz",
                PLACED,
            ),
            _screw(f"{link}_motion", model.velocity(k), "rad/s, m/s", f"dual velocity {here}", SCREW),
            _screw(
                f"{link}_motion_rate",
                model.acceleration(k),
                "rad/s^2, m/s^2",
                f"rate of the dual velocity {here}",
                SCREW,
            ),
        ]
        if mass:
            body = model.bodies[k - 1]
            steps += [
                _screw(
                    f"{link}_momentum",
                    body.momentum,
                    "kg*m/s, kg*m^2/s",
                    f"dual momentum {here}",
                    _MOMENTUM,
                ),
                _screw(
                    f"{link}_inertia_wrench",
                    body.wrench,
                    "N, N*m",
                    f"rate of the momentum, less the weight, {here}",
                    _WRENCH,
                ),
            ]
    if mass:
        steps += [
            _screw(
                f"joint_{k}_wrench",
                wrench,
                "N, N*m",
                f"wrench of the link before joint {k} on the one behind it, in frame {{{k}}}",
                _WRENCH,
            )
            for k, wrench in enumerate(model.joints[0], 1)
        ]
    return steps


def _product(row: int) -> str:
    """Return H as the product of the transforms before its row, from 0, and the operator Q of the row."""
    before = " ".join(f"T_{i}" for i in range(1, row + 1))
    return f"H = ({before}) Q ({before})^T, " if before else "H = Q, "


def _step_of_closure(model: LoopDerivation) -> list[NamedMatrix]:
    """Return A and V of Newton's step A dq = V of the dependent variables, as in the source."""
    found = [j for j, v in enumerate(model.variables) if v.role == "dependent"]
    matrix, right = model.paths.step(found)
    rows = [f"{part}{entry}" for part in "pd" for entry in (12, 13, 23)]
    return [
        named(
            "closure_step_matrix",
            matrix,
            "1, m",
            "A of A dq = V, Newton's step of the closure: entries of operators of dependent variables",
            rows,
            [model.variables[j].name for j in found],
        ),
        named(
            "closure_step_rhs",
            right,
            "1, m",
            "V of A dq = V, Newton's step: the same entries of the skew part of B^T",
            rows,
        ),
    ]


def _closure_of_velocities(model: LoopDerivation) -> list[NamedMatrix]:
    """Return A and V of A q' = V for the rates of the dependent variables, as in the source."""
    screws = model.paths.columns(model.paths.meeting_screws, len(model.variables))
    found = [j for j, v in enumerate(model.variables) if v.role == "dependent"]
    given = [j for j in range(len(model.variables)) if j not in found]
    rates = sp.Matrix([model.rates[j] for j in given])
    where = "in the frame where both paths meet"
    return [
        named(
            "closure_matrix",
            screws.extract(list(range(6)), found),
            "1, m",
            f"A of A q' = V, the closure of velocities {where}: screws of the dependent variables",
            SCREW,
            [model.variables[j].name for j in found],
        ),
        named(
            "closure_rhs",
            -screws.extract(list(range(6)), given) * rates if given else sp.zeros(6, 1),
            "rad/s, m/s",
            f"V of A q' = V {where}: less the screws of the other variables times their rates",
            SCREW,
        ),
    ]


def _left_out(model: LoopDerivation, needs: Iterable[str]) -> Iterable[str]:
    if model.has_dynamics and "forces" not in needs:
        masses = "masses enter, but no loads" if "mass" in needs else "masses and loads"
        yield f"dynamics: no output asks for a force or a power ({masses})"
    for k, link in enumerate(model.links, 1):
        body = model.loop.body(k - 1)
        if body is not None and body.idle:
            yield (
                f"link {link}: the inertia about the line of its two balls, about which it does not spin; "
                f"its frame does"
            )
        if "forces" in needs and body is not None and body.mass == 0 and not any(map(any, body.inertia)):
            yield f"link {link}: it has no mass, so no inertia"


def _screw(name: str, screw: DualVector, unit: str, description: str, rows: Sequence[str]) -> NamedMatrix:
    return named(name, screw.column, unit, description, rows)
