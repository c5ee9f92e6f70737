"""Derivatives of a linkage by parameters: at a state, at an equilibrium, along a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from symgen.errors import ModelError, OptionsError
from symgen.runtime.arrays import Array
from symgen.runtime.integrate.options import Options
from symgen.runtime.linearisation.record import Sensitivity
from symgen.runtime.linearisation.runs import at_run, follow, halved, of_run
from symgen.runtime.linearisation.sensitivity import at_equilibrium, at_pose, check_starts
from symgen.runtime.linearisation.state_space import derivatives
from symgen.runtime.linearisation.steps import LinkageSteps, StoredTrajectory, resolved
from symgen.runtime.linearisation.tangents import LinkageTangents
from symgen.runtime.model.arguments import LinkageDerivatives
from symgen.runtime.result.equilibrium import Equilibrium
from symgen.runtime.result.state import State
from symgen.runtime.rods.equilibrium import at_rest


def derivatives_by(model: Any, request: LinkageDerivatives) -> Sensitivity:
    """Return derivatives of outputs by parameters; see :meth:`symgen.Model.sensitivity`."""
    d, initial = model.description, [f"{x}{mark}" for mark in ("", "'") for x in request.coordinates]
    request = replace(request, coordinates=[*request.coordinates, *d.integrals])
    at, along, coordinates = request.at, request.along, request.coordinates
    if not (at is None or isinstance(at, State | Equilibrium | float | int)):
        raise ModelError(f"{model.name}: expected a state, an equilibrium or a time for at, got {at!r}")
    if not along and (run_arguments := request.of_run + ["integrals"] * bool(request.integrals)):
        named = ", ".join(f"{{{name}}}" for name in run_arguments)
        raise OptionsError(f"{named} is for derivatives along a run: give {{t_end}} or {{t_eval}}, too")
    by = model._differentiated(request.parameters, initial if along else [])
    rest = _rest(model) if at is None or at == 0.0 else None
    at = at if along or rest is None else rest
    check_starts(model, () if rest or isinstance(at, State | Equilibrium) else by)
    spectra = [name for name in dict.fromkeys(request.outputs) if name in ("frequencies", "poles")]
    if spectra and (along or at is None or isinstance(at, State | float | int)):
        raise ModelError(f"{spectra[0]} belong to an equilibrium: give model.equilibrium() for at")
    outputs = [name for name in request.outputs if name not in spectra]
    names = tuple(dict.fromkeys([*derivatives(d, coordinates), *outputs]))
    if isinstance(at, float | int):
        if at and d.freedom:
            raise OptionsError(
                f"{model.name}: expected a state or an equilibrium for {{at}}, got the time {at:g} s: "
                "drives alone do not determine the motion\n  Give {t_end} for derivatives along the run,"
                " or use linearise for a state-space model at this time."
            )
        at = model.reached(at)
    if along:
        start = model.initial_state() if at is None else at if isinstance(at, State) else at.state
        if not outputs and not request.integrals:
            raise ModelError("expected outputs or integrals to differentiate along a run, got none")
        if len(start.q) != d.coordinates:
            raise ModelError(
                f"{model.name}: expected a state of {d.coordinates} coordinates for at, "
                f"got one of {len(start.q)}\n  Give one of this model."
            )
        return _along_run(model, request, outputs, names, by, start, rest)
    if at is None or isinstance(at, State):
        return at_pose(model._tangents(at, names, "sensitivity"), outputs, by, coordinates)
    tangents = model._tangents(at, names, "sensitivity")
    return at_equilibrium(tangents, outputs, by, spectra, lambda: model.counting(at).analysis("vibration"))


def _rest(model: Any) -> Equilibrium | None:
    """Return the equilibrium in which runs start, if they do; raise ModelError if a drive accelerates there.

    Derivatives hold the forces in balance, which the accelerations of ground points would change.
    """
    rest: Equilibrium | None = model._stored_start().rest
    if rest:
        try:
            at_rest(model.constraints(), rest.state.q, 0.0)
        except ModelError as error:
            raise ModelError(
                f"{error}\n  Derivatives hold the start in equilibrium: begin with zero acceleration, too."
            ) from None
    return rest


def _along_run(
    model: Any,
    request: LinkageDerivatives,
    outputs: Sequence[str],
    names: tuple[str, ...],
    by: tuple[str, ...],
    start: State,
    rest: Equilibrium | None,
) -> Sensitivity:
    """Return derivatives along a run; ``names`` are the outputs of the kernels ``sensitivity``.

    ``rest`` is the equilibrium in which it starts and that moves with the parameters, if it does.
    """
    (times, chosen), d = request.run(), model.description
    tangent = model.analysis("tangent") if chosen.method.needs_tangent else None
    kernels = model.counting(start).evaluator
    followed = partial(follow, kernels, tangent, len(model.redundant), start, times=times)

    def tangents(state: State, references: Array) -> LinkageTangents:
        of: LinkageTangents = model._holding(references)._tangents(state, names, "sensitivity")
        return of

    variation = model.analysis("variation", outputs=tuple(request.integrals))
    steps = LinkageSteps(model.evaluator, variation, len(model.redundant), chosen.method)
    if rest and steps.states and chosen.rtol and len(request.coordinates) < d.freedom + len(d.integrals):
        raise OptionsError(
            f"expected {{coordinates}} of {model.name}: derivatives by the start choose the steps of "
            f"{chosen.method.name} from rest\n  {LinkageTangents.CHOICE} Or choose dop853."
        )
    about = model._tangents(rest, names, "sensitivity") if rest else None

    def path(chosen: Options) -> StoredTrajectory:
        along = resolved(followed(chosen), steps, chosen)
        return halved(along, followed, tangents, steps, request.coordinates, chosen)

    def derivatives_along(path: StoredTrajectory) -> Sensitivity:
        return at_run(path, tangents, steps, outputs, by, request.coordinates, about)

    return of_run(chosen, path, derivatives_along)
