"""Tangents of a loop's closure, motion, efforts and outputs along a direction: forward mode.

Every quantity x of the derivation has a tangent dx, linear in the tangents of variables, rates,
accelerations, closing wrench and parameters, which follow the others in ``work``; the time is held.
Derivatives by parameters follow from these by solving a linear system for each of variables, rates,
accelerations and wrench: :mod:`symgen.runtime.linearisation.tangents`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import sympy as sp

from symgen.errors import ModelError, SceneError
from symgen.models.forward_mode import ArgumentTangents
from symgen.models.loop import outputs
from symgen.models.loop.derivation import REFERENCE, LoopDerivation
from symgen.models.loop.system import groups
from symgen.models.reverse_mode import Gradients
from symgen.scene.rods.linkage import TIME
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Export, NamedMatrix, System

if TYPE_CHECKING:
    from symgen.scene.loop.loop import Loop


def tangent_system(loop: Loop, balanced: bool = False) -> System:
    """Return the System of the tangents of a loop, and of the values of its outputs.

    Its kernels: ``prescribed``, tangents of values, rates and accelerations of the inputs; ``closure``, those
    of rotation and translation; ``motion``, those of the sums of screws by rates, and by accelerations with
    their drift; ``efforts``, values and tangents of the efforts of all variables less the known ones, where
    ``balanced`` or for outputs with forces; ``values``, one matrix for each output, and ``slopes``, the
    tangents of all outputs.

    Raises
    ------
    ModelError
        For an output that the loop does not have.
    """
    model = LoopDerivation(loop)
    try:
        requested = [outputs.output(model, name) for name in loop.outputs or ()]
    except SceneError as error:
        raise ModelError(str(error)) from None
    needs = [outputs.needs(name) for name in loop.outputs or ()]
    forces = balanced or any("forces" in of_one for of_one in needs)
    if balanced:
        model.check_masses("the motion of free variables")
    of = _equations(model, forces)
    inputs = [*(v.quantity for v in model.variables), *(v.rate for v in model.variables)]
    inputs += [*(v.acceleration for v in model.variables), *model.closing]
    inputs += [p.quantity for p in model.loop.parameters]
    tangents = ArgumentTangents(inputs, model.names.definitions)
    matrices = [_column(f"{name}_tangent", tangents.of(x), f"tangents of {name}") for name, x in of.items()]
    exports = [Export(name, f"tangents of {name}", (f"{name}_tangent",)) for name in of]
    if forces:
        matrices.append(_column("efforts_left", of["efforts"], "efforts less the known ones"))
        exports[-1] = replace(exports[-1], matrices=("efforts_left", "efforts_tangent"))
    slopes = [x for m in requested for x in tangents.of(list(m.matrix))]
    if requested:
        names = [m.name for m in requested]
        matrices += [*requested, _column("outputs_tangent", slopes, "tangents of outputs")]
        exports.append(Export("values", "values of outputs", tuple(names)))
        exports.append(Export("slopes", "tangents of outputs", ("outputs_tangent",)))
    of_model = groups(model)
    return System(
        name=f"{loop.name}_sensitivity",
        title=f"{loop.title}: tangents",
        groups=(
            *of_model[:-1],
            replace(of_model[-1], quantities=(*of_model[-1].quantities, *tangents.seeds)),
        ),
        matrices=tuple(matrices),
        exports=tuple(exports),
        definitions=(*model.names.definitions, *tangents.definitions),
        references=(REFERENCE,),
    )


def variation_system(loop: Loop) -> System:
    """Return the System of gradients of a loop's equations, from which runs are differentiated.

    Its kernels give gradients of sums with weights, which lie in ``work`` behind accelerations and closing
    wrench: ``stage``, of accelerations of closure (6 weights) and efforts less the known ones (one weight per
    variable) by variables, rates, accelerations of inputs and parameters; ``closing``, of rotation and
    translation of closure by variables and parameters; ``rates``, of sums of screws by rates by variables,
    rates and parameters. ``prescribed`` gives the slopes of values, rates and accelerations of inputs by
    parameters. Of inputs there are no efforts.
    """
    model = LoopDerivation(loop)
    model.check_masses("the motion of free variables")
    of = _equations(model, forces=True)
    inputs = loop.having("input")
    parameters = [p.quantity for p in loop.parameters]
    variables, rates = ([getattr(v, x) for v in model.variables] for x in ("quantity", "rate"))
    names = [*(f"closure{i}" for i in range(6)), *(f"effort{i}" for i in range(len(variables)))]
    weights = [quantity(f"weight_{name}", "SI", f"weight of {name}") for name in names]
    symbols = [x.symbol for x in weights]
    efforts = [0 if v in inputs else x for v, x in zip(model.variables, of["efforts"], strict=True)]
    accelerations = [v.acceleration for v in inputs]
    matrices, exports, definitions = [], [], list(model.names.definitions)
    for kernel, sums, by in (
        ("stage", [*of["motion"][6:], *efforts], [*variables, *rates, *accelerations, *parameters]),
        ("closing", of["closure"], [*variables, *parameters]),
        ("rates", of["motion"][:6], [*variables, *rates, *parameters]),
    ):
        gradients = Gradients(by, model.names.definitions)
        entries = [*gradients.of(kernel, sums, symbols[: len(sums)]).values()]
        matrices.append(_column(f"{kernel}_gradient", entries, f"gradient of {kernel}"))
        exports.append(Export(kernel, f"gradient of {kernel}", (f"{kernel}_gradient",)))
        definitions += gradients.definitions
    if inputs and parameters:
        slopes = [sp.diff(x, p.symbol) for x in of["prescribed"] for p in parameters]
        matrices.append(_column("prescribed_slopes", slopes, "slopes of prescribed motions by parameters"))
        exports.append(Export("prescribed", "slopes of prescribed motions", ("prescribed_slopes",)))
    of_model = groups(model)
    return System(
        name=f"{loop.name}_variation",
        title=f"{loop.title}: gradients of its equations",
        groups=(*of_model[:-1], replace(of_model[-1], quantities=(*of_model[-1].quantities, *weights))),
        matrices=tuple(matrices),
        exports=tuple(exports),
        definitions=tuple(definitions),
        references=(REFERENCE,),
    )


def _equations(model: LoopDerivation, forces: bool) -> dict[str, list[sp.Expr]]:
    """Return the equations that are differentiated, by the name of their kernel; see the systems."""
    turn, origin = model.paths.closure.turn, model.paths.closure.origin
    rotation = [(turn[k, j] - turn[j, k]) / 2 for j, k in ((1, 2), (2, 0), (0, 1))]
    count, time = len(model.variables), TIME.symbol
    screws = model.paths.columns(model.paths.screws, count)
    drift = model.paths.columns(model.paths.screw_rates(), count) * sp.Matrix(model.rates)
    inputs = [v.motion for v in model.loop.having("input")]
    of = {"prescribed": [x for m in inputs for x in (m, sp.diff(m, time), sp.diff(m, time, 2))]}
    of = (of if inputs else {}) | {
        "closure": [*rotation, *origin],
        "motion": [*(screws * sp.Matrix(model.rates)), *(screws * sp.Matrix(model.second) + drift)],
    }
    if forces:
        pairs = zip(model.joints[1], model.given_efforts, strict=True)
        of["efforts"] = [effort - applied for effort, applied in pairs]
    return of


def _column(name: str, entries: Sequence[sp.Expr], about: str) -> NamedMatrix:
    return NamedMatrix(name, sp.ImmutableMatrix(len(entries), 1, list(entries)), "SI", about)
