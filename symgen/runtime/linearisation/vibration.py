"""Derivatives of poles and frequencies of small vibrations by parameters.

A mode dq = phi exp(s t) with constraint forces J^T mu solves P phi + J^T mu = 0, J phi = 0 with
P = s^2 M + s C + K. With the solution psi, nu of the transposed equations, its derivative is

    s' = -(psi^T P' phi + psi^T J'^T mu + nu^T J' phi) / (psi^T (2 s M + C) phi),

where P' and J' follow the equilibrium as it moves, at constant s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.eigenvalues import eigenvalues, in_order, oscillating
from symgen.runtime.linearisation.tangents import Tangents

#: M, K, C of small vibrations, and the constraint Jacobian J.
Matrices = Sequence[NDArray[Any]]
#: Names of the first three.
_SYSTEM = ("mass_matrix", "stiffness", "damping")
#: Least relative difference of two eigenvalues that are not equal.
_APART = 1e-6


def eigenvalue_slopes(
    what: str,
    values: NDArray[Any],
    shapes: Sequence[tuple[NDArray[Any], NDArray[Any]]],
    matrices: Matrices,
    held: Array,
    along: Sequence[Matrices],
    first: int = 1,
) -> NDArray[np.complex128]:
    """Return the derivatives of eigenvalues s [1/s] along directions, (values, directions).

    Parameters
    ----------
    what
        The values in messages; their numbers begin with ``first``.
    shapes
        The motions phi and psi of each.
    matrices, along
        M, K, C and J, and their derivatives along each direction, with the motion of the equilibrium.
    held
        The matrix of mu by J^T mu.

    Raises
    ------
    ModelError
        When two values are equal, since they have no individual derivatives.
    """
    slopes = np.zeros((len(values), len(along)), dtype=complex)
    mass, stiffness, damping, _ = matrices
    for i, (s, (phi, psi)) in enumerate(zip(values, shapes, strict=True)):
        close = np.flatnonzero(np.abs(values[:i] - s) <= _APART * np.abs(s))
        if len(close):
            kind, _, of = what.partition(" ")
            raise ModelError(
                f"{kind} {close[0] + first} and {i + first} {of} are equal, so that they have no derivatives "
                "one by one"
            )
        whole = s**2 * mass + s * damping + stiffness
        mu, nu = (-held @ b for b in (whole @ phi, whole.T @ psi))
        below = psi @ (2 * s * mass + damping) @ phi
        for k, (by_mass, by_stiffness, by_damping, turned) in enumerate(along):
            change = psi @ (s**2 * by_mass + s * by_damping + by_stiffness) @ phi
            slopes[i, k] = -(change + psi @ (turned.T @ mu) + nu @ (turned @ phi)) / below
    return slopes


def spectrum(
    tangents: Tangents, kernels: Evaluator, moved: Array, parameters: Sequence[str], spectrum_name: str
) -> tuple[list[str], Array, Array]:
    """Return ``poles`` or ``frequencies`` of small vibrations: names, values and derivatives, a row each.

    Poles are real parts [1/s] and, where they oscillate, imaginary parts [rad/s]; those that grow first, then
    by rising modulus.
    Frequencies [Hz] are those of the modes that oscillate, growing or not, by rising modulus of their
    eigenvalues, as of :attr:`.Modes.frequencies`.

    Parameters
    ----------
    tangents
        At the equilibrium.
    kernels
        Those of the analysis ``vibration``.
    moved
        Derivatives of coordinates and multipliers of the equilibrium by the parameters, a row each.

    Raises
    ------
    ModelError
        When two of them are equal, since they have no individual derivatives; when no mode oscillates.
    """
    matrices = _matrices(tangents, kernels)
    mass, stiffness, damping = (matrices[name] for name in _SYSTEM)
    free, title = tangents.free, tangents.description.name
    values = eigenvalues(*(free.T @ matrix @ free for matrix in (mass, stiffness, damping)))[0]
    if spectrum_name == "frequencies":
        values = values[oscillating(values)]
        if not len(values):
            raise ModelError(
                f"no mode of {title} oscillates at this equilibrium, so there are no frequencies\n"
                "  Give poles, which include motions that grow or decay."
            )
    elif not np.any(damping):  # of each pair s, -s there is one
        values = np.append(values, -values[values.imag == 0.0])
        values = values[in_order(values)]
    shapes = []
    for s in values:
        left, _, right = np.linalg.svd(free.T @ (s**2 * mass + s * damping + stiffness) @ free)
        shapes.append((free @ right[-1].conj(), free @ left[:, -1].conj()))
    derivatives = eigenvalue_slopes(
        f"{spectrum_name} of {title}",
        values,
        shapes,
        (mass, stiffness, damping, tangents.jacobian),
        (tangents.bound / tangents.scale).T,
        _changes(tangents, kernels, moved, parameters),
    )
    if spectrum_name == "frequencies":
        names = [f"frequency.{i}" for i in range(1, len(values) + 1)]
        return names, values.imag / (2 * np.pi), derivatives.imag / (2 * np.pi)
    parts = [(i, part) for i, s in enumerate(values) for part in ("real", "imag")[: 1 + bool(s.imag)]]
    names = [f"pole.{i + 1}.{part}" for i, part in parts]
    numbers, rows = (np.array([getattr(x[i], part) for i, part in parts]) for x in (values, derivatives))
    return names, numbers, rows


def _matrices(tangents: Tangents, kernels: Evaluator) -> dict[str, Array]:
    """Return M, K and C, each (n, n)."""
    names = tangents.description.of_coordinates()
    values = kernels("pencil", *_at(tangents, kernels))
    matrices = {name: np.zeros((tangents.n, tangents.n)) for name in _SYSTEM}
    for block in kernels.info("pencil").blocks:
        if block.name in matrices:
            for row, column, place in block.places(names, names):
                matrices[block.name][row, column] = values[place]
    return matrices


def _changes(
    tangents: Tangents, kernels: Evaluator, moved: Array, parameters: Sequence[str]
) -> list[Matrices]:
    """Return the derivatives of M, K, C and J by each parameter."""
    d = tangents.description
    columns = {name: i for i, name in enumerate(d.of_coordinates())}
    constraints = {name: i for i, name in enumerate(d.constraints)}
    n, m = tangents.n, tangents.m
    directions = {name: moved[i] for name, i in columns.items()}
    directions |= {f"{name}_lambda": moved[n + i] for name, i in constraints.items()}
    directions |= dict(zip(parameters, np.eye(len(parameters)), strict=True))
    changes = {name: np.zeros((len(parameters), n, n)) for name in _SYSTEM}
    changes["constraint_slopes"] = np.zeros((len(parameters), m, n))
    if kernels.has("slopes"):
        (block,) = kernels.info("slopes").blocks
        values = kernels("slopes", *_at(tangents, kernels))
        for label, value in zip(block.rows, values, strict=False):
            matrix, row, column, argument = label.split()
            if argument in directions:  # other parameters may not be requested
                place = constraints[row] if matrix == "constraint_slopes" else columns[row]
                changes[matrix][:, place, columns[column]] += value * directions[argument]
    return [*zip(*changes.values(), strict=True)]


def _at(tangents: Tangents, kernels: Evaluator) -> tuple[float, Array, Array, Array]:
    """Return the arguments of kernels at the equilibrium."""
    n, state = tangents.n, tangents.state
    work = np.zeros(kernels.work_size + n + tangents.m + 1)
    work[: n + tangents.m] = tangents.solution
    return state.t, state.q, np.zeros(n), work
