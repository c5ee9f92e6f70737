"""Slopes of the equations of motion and of outputs, from which state-space models are made.

With the residual R = [f - M a - J^T lambda; gamma - J a] of the equations of motion, the constraints' rates
dPhi/dt and the outputs h, all functions of coordinates q, velocities u, accelerations and multipliers w, and
inputs v,

    dR = R_q dq + R_u du + R_w dw + R_v dv = 0,   d(dPhi/dt) = 0,   dh = h_q dq + h_u du + h_w dw + h_v dv.

R_w is minus the matrix [M J^T; J 0]. With respect to tunable parameters, which change the constraints
too, slopes of Phi are added. Solving for dw, and for dq and du of independent coordinates, is
numerics: :mod:`symgen.runtime.linearisation.state_space`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import ModelError, SceneError
from symgen.models.couples import couples_by_forces
from symgen.models.general.equations import equations_of
from symgen.models.rods import outputs
from symgen.models.rods.linearised import analysis_of, constraint_slopes, linearised, slopes_by
from symgen.models.rods.linkage import RodsModel
from symgen.models.rods.matrix import named
from symgen.models.rods.refinement import residual
from symgen.models.rods.system import definitions
from symgen.scene.rods.linkage import TIME
from symgen.symbolic.calculus import per_second
from symgen.symbolic.system import Export, NamedMatrix, System

if TYPE_CHECKING:
    from symgen.scene.rods.linkage import Linkage
    from symgen.symbolic.quantity import Quantity

#: The mark of a time derivative behind the name of an output.
RATE = "'"

Entry = tuple[str, sp.Expr, str]
#: Name of a matrix of slopes, labels and expressions of its rows, and its description.
Rows = tuple[str, list[str], Sequence[sp.Expr], str]


def linearisation_system(linkage: Linkage) -> System:
    """Return the System of values and slopes of the linkage's outputs, and slopes of its equations.

    An output is one that a scene can record, or a component of it such as ``A.position.x``; behind one that
    depends on the pose alone, ``'`` and ``''`` are its first and second time derivatives.

    Its kernels: ``values``, one matrix for each scalar output; ``slopes``, the matrices ``residual``,
    ``rates`` and ``outputs``. Each is the list of its nonzero entries, called by the row and the argument of
    the kernels, ``pole.angle C_x``.

    Raises
    ------
    ModelError
        For an output that the linkage does not have.
    """
    return _system(linkage, "linearisation", [p.quantity for p in linkage.parameters if p.input])


def sensitivity_system(linkage: Linkage) -> System:
    """Return the System of :func:`linearisation_system` with all tunable parameters in place of inputs.

    Its kernel ``slopes`` also has the matrix ``constraints``, of Phi, and slopes by the time; its outputs are
    followed by what passes zero at switching points of loads and at events that end a run.
    """
    return _system(linkage, "sensitivity", _tunable(linkage))


def variation_system(linkage: Linkage) -> System:
    """Return the System of slopes along a run, by its state and the tunable parameters.

    Its kernels: ``stage``, the matrix ``residual``, at held accelerations and multipliers; ``closing``, the
    matrices ``constraints`` of Phi and ``rates`` of dPhi/dt; ``integrands``, the values of the linkage's
    outputs, and ``integrand_slopes``, the matrix ``outputs``. Matrices are lists of nonzero entries, called
    as in :func:`linearisation_system`.

    Raises
    ------
    ModelError
        For an output that the linkage does not have.
    """
    model = equations_of(linkage)
    entries = _outputs(model)
    equations, work = _equations(model)
    state = [*(x.symbol for x in model.coordinates), *(x.symbol for p in model.free for x in model.u[p])]
    tunable = [x.symbol for x in _tunable(linkage)]
    matrices = [
        *_slopes(model, equations, [*state, *tunable]),
        *_slopes(model, [_of_outputs(entries)], [*state, *work, *tunable]),
    ]
    values = _values(model, entries)
    known = {m.name for m in (*matrices, *values)}
    exports = []
    for kernel, of in (
        ("stage", ("residual",)),
        ("closing", ("constraints", "rates")),
        ("integrands", tuple(m.name for m in values)),
        ("integrand_slopes", ("outputs",)),
    ):
        if known.intersection(of):
            exports.append(Export(kernel, "slopes along a run", tuple(x for x in of if x in known)))
    return analysis_of(model, "variation", (*matrices, *values), exports)


def tangent_system(linkage: Linkage) -> System:
    """Return the System of the Jacobian of the equations of motion, for implicit integrators.

    Its one kernel, ``tangent``, has the matrices ``by_positions`` R_q and ``by_rates`` R_u, at the
    accelerations and multipliers in ``work``: lists of nonzero entries, called as in
    :func:`linearisation_system`; one that is all zero is omitted. The accelerations and multipliers change
    with the state as [M J^T; J 0] d[a; lambda] = R_q dq + R_u du, with the matrix that the kernels ``factor``
    and ``solve`` have.
    """
    model = equations_of(linkage)
    (_, unknowns, rows, _), *_ = _equations(model)[0]
    positions = [x.symbol for x in model.coordinates]
    rates = [x.symbol for p in model.free for x in model.u[p]]
    matrices = [
        replace(m, unit=unit)
        for name, by, arguments, unit in (
            ("by_positions", "q", positions, "N/m, m/s^2"),
            ("by_rates", "u", rates, "N*s/m, m/s"),
        )
        for m in _slopes(model, [(name, unknowns, rows, f"slope of the residual by {by}")], arguments)
    ]
    about = "slope of f - M a - J^T lambda and of gamma - J a by the state, at the a and lambda in work"
    export = Export("tangent", about, tuple(m.name for m in matrices))
    return analysis_of(model, "tangent", matrices, [export])


def vibration_system(linkage: Linkage) -> System:
    """Return the System of the matrices of small vibrations and their slopes.

    Its kernels: ``pencil``, the matrices M, K, C of :func:`symgen.models.rods.linearised.linearised` and the
    constraint Jacobian, lists of nonzero entries; ``slopes``, their derivatives by coordinates, multipliers
    and tunable parameters, called by the matrix, the row and column of the entry, and the argument.
    """
    model = equations_of(linkage)
    bound = [model.multipliers[c.name] for c in model.constraints]
    pencil = [*linearised(model, model.constraints)]
    if model.constraints:
        pencil.append(constraint_slopes(model))
    arguments = [x.symbol for x in (*model.coordinates, *bound, *_tunable(linkage))]
    labels = [f"{m.name} {label}" for m in pencil for label in m.rows]
    about = "slopes of the matrices of small vibrations"
    rows: Rows = "slopes", labels, [entry for m in pencil for entry in m.matrix], about
    slopes = list(_slopes(model, [rows], arguments))
    exports = [Export("pencil", "matrices of small vibrations", tuple(m.name for m in pencil))]
    exports += [Export(m.name, about, (m.name,)) for m in slopes]
    return analysis_of(model, "vibration", [*pencil, *slopes], exports)


def _tunable(linkage: Linkage) -> list[Quantity]:
    """Return the parameters that users can change."""
    set_by_runs = {w.reference for w in linkage.windings} | {s.branch for s in linkage.switches}
    return [p.quantity for p in linkage.parameters if p.quantity not in set_by_runs]


def _outputs(model: RodsModel) -> list[Entry]:
    """Return the scalars of the linkage's outputs; raise ModelError for one that it does not have."""
    try:
        return [entry for name in model.linkage.outputs or () for entry in _entries(model, name)]
    except SceneError as error:
        raise ModelError(str(error)) from None


def _gaps(model: RodsModel) -> list[Entry]:
    """Return the functions that vanish at switching points of loads and at events that end a run."""
    linkage = model.linkage
    gaps = {f"switch.{k}": s.gap for k, s in enumerate(linkage.switches)}
    gaps |= {f"event.{k}": e.gap for k, e in enumerate(linkage.events) if e.ends_run}
    return [(name, e, "1") for name, e in zip(gaps, model.loads.with_state([*gaps.values()]), strict=True)]


def _equations(model: RodsModel) -> tuple[list[Rows], list[sp.Symbol]]:
    """Return the rows of the residual, of dPhi/dt and of Phi, and the unknowns of the equations of motion."""
    bound = [model.multipliers[c.name] for c in model.constraints]
    work = [*(x for p in model.free for x in model.a[p]), *bound]
    names = [x.name for x in bound]
    rates, couples = model.constraint_rates, couples_by_forces(model)
    work += [model.loads.of_joints[x.owner] for x in couples]
    equations = [*residual(model), *(x.factor * x.size - x.couple for x in couples)]
    return [
        ("residual", [x.name for x in work], equations, "slopes of the equations of motion"),
        ("rates", names, rates, "slopes of dPhi/dt"),
        ("constraints", names, [c.expression for c in model.constraints], "slopes of Phi"),
    ], [x.symbol for x in work]


def _of_outputs(entries: Sequence[Entry]) -> Rows:
    return "outputs", [name for name, *_ in entries], [e for _, e, _ in entries], "slopes of outputs"


def _slopes(model: RodsModel, rows: Sequence[Rows], arguments: Sequence[sp.Symbol]) -> Iterator[NamedMatrix]:
    """Yield the matrices of slopes of labelled expressions by arguments of kernels, unless all are zero."""
    slopes = slopes_by(model, arguments, definitions(model))
    for name, labels, expressions, about in rows:
        columns = {
            f"{label} {argument.name}": row[argument]
            for label, expression in zip(labels, expressions, strict=True)
            for row in [slopes(expression.xreplace(model.held))]
            for argument in arguments
            if argument in row
        }
        if columns:
            yield named(model, name, list(columns.values()), "SI", about, rows=list(columns))


def _system(linkage: Linkage, kind: str, parameters: Sequence[Quantity]) -> System:
    model = equations_of(linkage)
    entries = _outputs(model) + (_gaps(model) if kind == "sensitivity" else [])
    equations, work = _equations(model)
    rows = [*equations[: 3 if kind == "sensitivity" else 2], _of_outputs(entries)]
    rates = [x for p in model.free for x in model.u[p]]
    arguments = [x.symbol for x in (*model.coordinates, *rates)]
    by = [*arguments, *work, *(p.symbol for p in parameters)]
    if kind == "sensitivity":
        by.append(TIME.symbol)
    matrices = [*_slopes(model, rows, by)]
    exports = [Export("slopes", "slopes of equations and outputs", tuple(m.name for m in matrices))]
    values = _values(model, entries)
    if values:
        exports.append(Export("values", "values of outputs", tuple(m.name for m in values)))
    return analysis_of(model, kind, (*matrices, *values), exports)


def _values(model: RodsModel, entries: Sequence[Entry]) -> list[NamedMatrix]:
    return [named(model, f"value {i}", [e], unit, name) for i, (name, e, unit) in enumerate(entries)]


def _entries(model: RodsModel, name: str) -> Iterator[Entry]:
    """Yield the scalars of an output, or its time derivative, with their names and units."""
    whole = name.rstrip(RATE)
    order = len(name) - len(whole)
    expressions, unit, _ = outputs.entries(model, whole)
    for i, expression in enumerate(expressions):
        full = f"{whole}.{model.shown_axes[i]}" if len(expressions) > 1 else whole
        yield _derived(model, full, expression, unit, order)


def _derived(model: RodsModel, name: str, expression: sp.Expr, unit: str, order: int) -> Entry:
    """Return a scalar, or its first or second derivative by the time."""
    if order == 0:
        return name, expression, unit
    moving = {x.symbol for p in model.u for x in (*model.u[p], *model.a[p])}
    moving |= {x.symbol for x in model.multipliers.values()}
    if order > 2 or slopes_by(model, sorted(moving, key=str))(expression):
        raise SceneError(
            f"{name} depends on more than the pose, so it is no coordinate",
            hint="Choose the angle of a link, or components of the position of points.",
        )
    unit = per_second(unit)
    if order == 1:
        return name + RATE, model.calculus.rate(expression), unit
    return name + 2 * RATE, model.second_rate(expression), per_second(unit)
