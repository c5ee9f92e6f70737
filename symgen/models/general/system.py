"""The System of the motion that a user's System states: its matrices, and all that follows from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy as sp

from symgen.errors import DerivationError
from symgen.mechanics.rods.elimination import minimum_degree
from symgen.models.general.equations import GeneralEquations, GeneralSystem
from symgen.models.rods import outputs as of_outputs
from symgen.models.rods import system as of_rods
from symgen.models.rods.matrix import named, sparse
from symgen.models.rods.refinement import refinement
from symgen.symbolic.calculus import ONE, ZERO
from symgen.symbolic.system import Export, NamedMatrix, SaddlePoint, System

#: Least eigenvalue of a mass matrix with ones on its diagonal that counts as positive.
_LEAST_MASS = 1e-12
#: Part of the pivot of a multiplier that rounding may leave.
_RANK_TOLERANCE = "1e-13"


def general_system(of: GeneralSystem) -> System:
    """Return the System of a motion that a user's System states: its matrices, and those that follow.

    Raises
    ------
    DerivationError
        When the mass matrix is not positive definite at the start, or there is no such output.
    """
    model = GeneralEquations(of)
    stated, q = model.stated, [x.symbol for x in model.coordinates]
    follow = [
        named(model, "kinetic_energy", [model.kinetic_energy], "J", "kinetic energy, u . M u / 2"),
        *([] if "potential_energy" in stated else [_zero_potential(model)]),
        *of_rods.constraints(model),
        *of_rods.places(model),
        *_start(model),
    ]
    energies: tuple[str, ...] = ("kinetic_energy", "potential_energy")
    if model.power != 0:
        about = "rate of the energies by the equations of motion"
        follow.append(named(model, "power", [model.power], "W", about))
        energies += ("power",)
    residual, refining = refinement(model, _masses(model))
    follow += residual
    outputs = _outputs(model)
    exports = [
        Export("energy", "kinetic and potential energy", energies),
        *of_rods.kinematic_exports(model),
        Export("outputs", "outputs", tuple(m.name for m in outputs)),
        Export("drawn", "coordinates at the start", ("drawn",)),
        Export("mass_matrix", "mass matrix", ("mass_matrix",)),
    ]
    if any(m.name == "start_rates" for m in follow):
        about = "rows K u = k of the rates at the start"
        exports.append(Export("start_velocity", about, ("start_rates", "start_jacobian")))
    if model.constraints:
        about = "residual and Jacobian of the coordinates at the start; u[0] goes from 0 to 1"
        exports.append(Export("assembly", about, ("assembly_residual", "assembly_jacobian")))
    exports += refining
    events = tuple(name for name in ("events", "ending_events") if name in stated)
    if events:
        exports.append(Export("events", "what passes zero at each event", events))
    own = tuple(e for e in stated.exports if e.kernel != "outputs" and e.matrices)
    known = {m.name for m in stated.matrices}
    kept = [_with_names(model, m) for m in stated.matrices]
    varies = {(i, j): True for i, a in enumerate(q) for j, b in enumerate(q) if (a, b) in model.mass_entries}
    varies |= {
        (len(q) + i, j): True for i, row in enumerate(model.jacobian) for j, s in enumerate(q) if s in row
    }
    order = minimum_degree(varies, len(q), len(q) + len(model.constraints))
    return System(
        name=of.name,
        title=of.title,
        groups=of_rods.groups(model),
        matrices=(*kept, *(m for m in (*follow, *outputs) if m.name not in known)),
        exports=(*exports, *own),
        definitions=of_rods.definitions(model),
        saddle_point=SaddlePoint(
            "mass_matrix", "constraint_jacobian", "force", "acceleration_rhs", order, _RANK_TOLERANCE
        ),
        references=stated.references,
        left_out=stated.left_out,
        sources=stated.sources,
    )


def _masses(model: GeneralEquations) -> list[float]:
    """Return the diagonal of the mass matrix at the start, where it must be positive definite."""
    q, number = [x.symbol for x in model.coordinates], model.linkage.number
    mass = np.array(
        [[number(model.mass_entries.get((a, b), ZERO).xreplace(model.start)) for b in q] for a in q]
    )
    diagonal = np.diag(mass)
    massless = next((x.name for x, m in zip(q, diagonal, strict=True) if not m > 0.0), None)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    least = float(np.linalg.eigvalsh(mass / np.outer(scale, scale))[0])
    if massless is not None or least < _LEAST_MASS:
        raise DerivationError(
            f"{model.stated.name}: expected a positive definite mass_matrix, got one that is not at the start"
            + (
                f": {massless} has the mass {diagonal[[x.name for x in q].index(massless)]:g}"
                if massless
                else ""
            )
        )
    return [float(m) for m in diagonal]


def _with_names(model: GeneralEquations, m: NamedMatrix) -> NamedMatrix:
    """Return a matrix of the System with the names of the derivation, and of coordinates along its sides."""
    names = tuple(x.name for x in model.coordinates)
    matrix = sp.ImmutableMatrix(*m.matrix.shape, [model.own(e) for e in m.matrix])
    if m.name == "mass_matrix":
        return replace(m, matrix=matrix, rows=names, columns=names, symmetric=True)
    return replace(m, matrix=matrix, rows=names if m.name == "force" else m.rows)


def _zero_potential(model: GeneralEquations) -> NamedMatrix:
    return named(model, "potential_energy", [ZERO], "J", "potential energy, which the system does not state")


def _outputs(model: GeneralEquations) -> list[NamedMatrix]:
    """Return coordinates, rates, the outputs that the System selects, and its energy."""
    names = [x.name for x in (*model.coordinates, *model.rates)]
    for name in model.linkage.outputs or ():
        rows = model.stated[name].rows if name in model.stated else ()
        names += [name] if len(rows) < 2 or rows == tuple(model.axes) else [f"{name}.{row}" for row in rows]
    names += [f"{p}.position" for p in model.points]
    found = []
    for name in dict.fromkeys([*names, "energy"]):
        scalars, unit, about = of_outputs.entries(model, name)
        found.append(named(model, name, scalars, unit, about, rows=model.axes if len(scalars) > 1 else ()))
    return found


def _start(model: GeneralEquations) -> list[NamedMatrix]:
    """Return coordinates and rates at the start; the constraints move from their values there to zero."""
    values = model.stated.values or {}
    q, s = [x.symbol for x in model.coordinates], model.rates[0].symbol
    names, drawn = [x.name for x in q], [model.start[x] for x in q]
    # Without constraints all rates are those stated, or zero; else the others follow.
    pairs = zip(q, model.rates, strict=True)
    rates = [(x, u) for x, u in pairs if u.name in values or not model.constraints]
    rows = [{x: ONE} for x, _ in rates]
    targets = [sp.Float(float(values.get(u.name, 0.0))) for _, u in rates]
    made = [named(model, "drawn", drawn, "SI", "coordinates at the start", rows=names)]
    labels = [f"{x.name} rate" for x, _ in rates]
    if rates:
        about = "prescribed rates at the start, k"
        made.append(named(model, "start_rates", targets, "SI", about, rows=labels))
        made.append(sparse(model, "start_jacobian", rows, "1", "slopes of these rates, K", rows=labels))
    if model.constraints:
        errors = [c.expression - (1 - s) * c.expression.xreplace(model.start) for c in model.constraints]
        labels = [c.name for c in model.constraints]
        about = "errors of the constraints at the start"
        made.append(named(model, "assembly_residual", errors, "SI", about, rows=labels))
        about = "slopes of these errors"
        made.append(sparse(model, "assembly_jacobian", model.jacobian, "SI", about, rows=labels))
    return made
