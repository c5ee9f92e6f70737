"""Derivatives of results of elastic links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from symgen.errors import ModelError
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.elastic.derivatives import periodic, runs
from symgen.runtime.linearisation.record import Sensitivity
from symgen.runtime.result.elastic import ElasticResult


def of_result(
    model: Any,
    methods: Sequence[str],
    outputs: Sequence[str],
    by: Sequence[str],
    at: ElasticResult,
    t_eval: ArrayLike | None,
) -> Sensitivity:
    """Return the derivatives of a steady state at its crank angles, or of a run at its times.

    Raises
    ------
    ModelError
        For a result of another model, and one that is no steady state or run by one of the ``methods``.
    """
    provenance = at.provenance
    method = provenance.get("method")
    if method == "large-rotation":
        raise ModelError(
            f"{model.name}: runs in large rotation have no derivatives\n"
            "  Compare runs with other parameters: model.with_parameters."
        )
    if method not in ("periodic", *methods) or provenance["parameters"] != dict(model.parameters):
        raise ModelError(
            f"{model.name}: expected a steady state or a run of this model for at: model.periodic(), "
            "model.simulate()"
        )
    if provenance["form"] != "exact" or not provenance.get("geometric_stiffness", True):
        raise ModelError(
            "derivatives of motions are those of the exact form with geometric stiffness: leave form and "
            "geometric_stiffness out"
        )
    if t_eval is not None:
        raise ModelError("a motion has times of its own: leave t_eval out")
    if not outputs or (method == "periodic" and at.times is None):
        raise ModelError("expected outputs to differentiate, got none")
    if method == "periodic":
        return periodic.sensitivity(model.motion(True), outputs, by, at.time)
    if method not in BEAM_METHODS:
        raise ModelError(
            f"expected an implicit method for derivatives of runs of elastic links, got {method}\n"
            f"  Choose {', '.join(BEAM_METHODS)}."
        )
    if provenance.get("initial", "undeformed") != "undeformed":
        raise ModelError("derivatives of runs of elastic links are for those that start undeformed")
    counts = at.counts
    if counts is None:
        raise ModelError(f"{model.name}: a stored run has no derivatives: simulate it again")
    return runs.sensitivity(model.motion(True), outputs, by, method, at.time, counts)
