"""Errors of compiled kernels against their original matrices, and their causes."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from symgen.errors import ModelError
from symgen.precision import precision as precision_named
from symgen.study.accuracy.cancelling import Cancelling, cancelling
from symgen.study.accuracy.kernel_errors import KernelErrors, OutputAccuracy
from symgen.study.accuracy.kernels import ComparedKernels, kernels_of
from symgen.symbolic.exact import DIGITS

Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Error report of a scene.

    Attributes
    ----------
    scene, title, precision, epsilon, digits, seed
        Name and title, number type and its relative spacing, digits of the reference values, and seed of the
        random states.
        Number of states of each kind: along the run, random on and off the constraints.
    outputs
        Errors of every output of every kernel.
    condition
        Largest condition number of the equilibrated equations of motion, and its state; None if no equations
        are solved.
    cancelling
        Sums with the largest loss of digits, avoidable ones first.
    notes
        Remarks on the states.
    """

    scene: str
    title: str
    precision: str
    epsilon: float
    digits: int
    seed: int
    states: Mapping[str, int]
    outputs: tuple[OutputAccuracy, ...]
    condition: tuple[float, str] | None
    cancelling: tuple[Cancelling, ...]
    notes: tuple[str, ...]

    @property
    def worst(self) -> OutputAccuracy:
        """The output with the largest error relative to the error explained by its condition."""
        return max(self.outputs, key=lambda o: o.beyond)

    def summary(self) -> dict[str, Any]:
        """Return the report as plain data for ``symgen accuracy --json``; infinities become None."""
        data = asdict(self)
        for entry, output in zip(data["outputs"], self.outputs, strict=True):
            entry |= {"beyond": output.beyond, "verdict": output.verdict}
        return _finite(data)


def accuracy(
    scene: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    states: int = 20,
    seed: int = 0,
    run: bool = True,
    precision: str = "float64",
    top: int = 10,
    progress: Progress | None = None,
) -> Accuracy:
    """Compare every output of every kernel of a scene or building block with its matrix at 40 digits.

    Parameters
    ----------
    scene
        A shipped name, the path of a scene file, or the name of a building block.
    set
        Values to override, as in :func:`symgen.build`.
    states
        Number of states of each kind.
    seed
        Seed of the random states; equal seeds give equal reports.
    run
        Whether to sample states along a run, and random states near all of it; otherwise near its start.
    precision
        Number type of the kernels: ``float32``, ``float64``, ``longdouble`` or ``float128``. For types other
        than float64, only kernels of the motion are examined.
    top
        Maximum number of cancelling sums to return.
    progress
        Callback that receives the completed fraction.

    Raises
    ------
    SceneError, ModelError
        If the scene or an option is invalid.
    """
    if states < 1 or seed < 0:
        raise ModelError(f"expected at least 1 state and a seed from 0 on, got {states} and {seed}")
    if top < 0:
        raise ModelError(f"expected a number of sums from 0 on for top, got {top}")
    title, parts = kernels_of(scene, set=set, count=states, seed=seed, run=run, precision=precision)
    return report(str(scene), title, parts, seed=seed, precision=precision, top=top, progress=progress)


def report(
    scene: str,
    title: str,
    parts: list[ComparedKernels],
    *,
    seed: int = 0,
    precision: str = "float64",
    top: int = 10,
    progress: Progress | None = None,
) -> Accuracy:
    """Return the error report of a set of kernels; see :func:`accuracy`."""
    epsilon = precision_named(precision).epsilon
    total, finished = sum(len(p.states.all) for p in parts), 0
    outputs: list[OutputAccuracy] = []
    condition: tuple[float, str] | None = None
    sums: list[Cancelling] = []
    notes: list[str] = []
    for part in parts:
        errors = KernelErrors(part, epsilon, np.random.default_rng(seed))
        for at in part.states.all:
            errors.look(at)
            finished += 1
            if progress:
                progress(finished / total)
        outputs += errors.outputs()
        condition = errors.condition or condition
        notes += part.states.notes
        if errors.unsolved:
            where = ", ".join(errors.unsolved)
            notes.append(f"the constraints have lost rank, and nothing is solved, at: {where}")
        sums += cancelling(part, errors.places())
    kinds = [at.kind for at in parts[0].states.all]
    ranked = sorted(sums, key=lambda c: c.rank, reverse=True)
    return Accuracy(
        scene,
        title,
        precision,
        epsilon,
        DIGITS,
        seed,
        {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
        tuple(outputs),
        condition,
        tuple(ranked[:top]),
        tuple(dict.fromkeys(notes)),
    )


def _finite(value: Any) -> Any:
    """Return plain numbers, with None for values that are not finite."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    return [_finite(v) for v in value] if isinstance(value, list | tuple) else value
